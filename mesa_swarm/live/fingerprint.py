"""The fingerprint of a model in compiled code, so that a page shows the same as `state_hash()` in Python.

It is BLAKE2b with a digest of 16 bytes (RFC 7693) of pieces: texts, and arrays as numbers of 8 bytes each.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.kernels.block import Block, stack_blocks, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.type_names import Bytes, Codes, Flags, IntegerRows, Integers, Reals, Shorts, Singles, Unsigned
from mesa_swarm.model.state_hash import Pieces, add_part, add_state, bytes_of_numbers
from mesa_swarm.world.read_only import writable_view

DIGEST_BYTES, BLOCK_BYTES = 16, 128
ROUNDS, WORDS = 12, 16
# The first words of BLAKE2b, and the order in which a round takes the words of a message (RFC 7693, 2.6 and 2.7).
INITIAL = np.array(
    [
        0x6A09E667F3BCC908, 0xBB67AE8584CAA73B, 0x3C6EF372FE94F82B, 0xA54FF53A5F1D36F1,
        0x510E527FADE682D1, 0x9B05688C2B3E6C1F, 0x1F83D9ABFB41BD6B, 0x5BE0CD19137E2179,
    ],
    np.uint64,
)  # fmt: skip
ORDER = np.array(
    [
        [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15],
        [14, 10, 4, 8, 9, 15, 13, 6, 1, 12, 0, 2, 11, 7, 5, 3],
        [11, 8, 12, 0, 5, 2, 15, 13, 10, 14, 3, 6, 7, 1, 9, 4],
        [7, 9, 3, 1, 13, 12, 11, 14, 2, 6, 5, 10, 4, 0, 15, 8],
        [9, 0, 5, 7, 2, 4, 10, 15, 14, 1, 11, 12, 6, 8, 3, 13],
        [2, 12, 6, 10, 0, 11, 8, 3, 4, 13, 7, 5, 15, 14, 1, 9],
        [12, 5, 1, 15, 14, 13, 4, 10, 0, 7, 6, 3, 9, 2, 8, 11],
        [13, 11, 7, 14, 12, 1, 3, 9, 5, 0, 15, 4, 8, 6, 2, 10],
        [6, 15, 14, 9, 11, 3, 0, 8, 12, 2, 13, 7, 1, 4, 10, 5],
        [10, 2, 8, 4, 7, 6, 1, 5, 15, 11, 9, 14, 3, 12, 13, 0],
    ],
    np.int64,
)  # fmt: skip
# Which words of its state a round mixes, columns first and then diagonals.
MIXED = np.array(
    [
        [0, 4, 8, 12], [1, 5, 9, 13], [2, 6, 10, 14], [3, 7, 11, 15],
        [0, 5, 10, 15], [1, 6, 11, 12], [2, 7, 8, 13], [3, 4, 9, 14],
    ],
    np.int64,
)  # fmt: skip
# Digest and key lengths, depth and width of a hash without a tree (2.5).
PARAMETERS = 0x01010000 ^ DIGEST_BYTES
SIXTY_FOUR, BYTE = np.uint64(64), np.uint64(8)
# Places in the numbers of a digest: bytes that were compressed, and bytes that wait.
TAKEN, WAITING = 0, 1
# In a row of pieces: the kind, behind the address and length of its array.
KIND = 2


class TextPiece(NamedTuple):
    """Bytes as they are."""

    array: Bytes


class RealPiece(NamedTuple):
    """Numbers; of all pieces 8 bytes each."""

    array: Reals


class SinglePiece(NamedTuple):
    """Numbers of 4 bytes."""

    array: Singles


class IntegerPiece(NamedTuple):
    """Whole numbers."""

    array: Integers


class ShortPiece(NamedTuple):
    """Whole numbers of 4 bytes."""

    array: Shorts


class CodePiece(NamedTuple):
    """Whole numbers of 1 byte."""

    array: Codes


class FlagPiece(NamedTuple):
    """True and False."""

    array: Flags


class WordPiece(NamedTuple):
    """Whole numbers without sign."""

    array: Unsigned


PIECES: dict[Any, Any] = {
    np.dtype(np.float64): RealPiece,
    np.dtype(np.float32): SinglePiece,
    np.dtype(np.int64): IntegerPiece,
    np.dtype(np.int32): ShortPiece,
    np.dtype(np.int8): CodePiece,
    np.dtype(np.bool_): FlagPiece,
    np.dtype(np.uint64): WordPiece,
}
TEXT, REAL, SINGLE, INTEGER, SHORT, CODE, FLAG, UNSIGNED = range(8)
KINDS = {kind: place for place, kind in enumerate((TextPiece, *PIECES.values()))}


class DigestArrays(NamedTuple):
    """What `digest_pieces` takes: rows of pieces, the digest, and its state and scratch."""

    pieces: IntegerRows
    out: Bytes
    state: Unsigned
    counts: Integers
    waiting: Bytes
    message: Unsigned
    mixed: Unsigned
    digits: Bytes


class LivePieces(Pieces):
    """Pieces of a fingerprint, of which arrays stay arrays, to be read when the digest is made, but for some."""

    def __init__(self, constant: Iterable[Any] = ()) -> None:
        super().__init__()
        self._constant = set(map(id, constant))

    def add_array(self, array: np.ndarray) -> None:
        """Add an array of which numbers may change, if it is not one that is constant."""
        is_readable = array.dtype in PIECES and array.flags.c_contiguous and array.size
        changes = is_readable and id(array) not in self._constant
        self.append(writable_view(array) if changes else bytes_of_numbers(array))


class Fingerprint:
    """What compiled code makes the fingerprint of a model with, as long as its arrays stay the same.

    Attributes
    ----------
    block : Block
        Of `DigestArrays`.
    pieces : int64 ndarray
        Rows of addresses, lengths and kinds.
    described : bytes
        What the bodies are, all at rest: one of the pieces; empty if some may move.
    place : int
        Which of the pieces that is.
    """

    def __init__(self, model: Any) -> None:
        bodies = [] if model.parts.bodies.moves else model.parts.bodies.describe()
        self.described, pieces = text_of_part(bodies) if bodies else b"", LivePieces(bodies)
        add_state(pieces, model)
        joined = split_text(join_texts(pieces), self.described)
        of_bodies = (
            place for place, piece in enumerate(joined) if isinstance(piece, bytes) and piece == self.described
        )
        self.place = next(of_bodies, -1)
        blocks = list(map(_piece_of, joined))
        kinds = [(KINDS[type(block._values)],) for block in blocks]
        self._out = np.zeros(DIGEST_BYTES, np.uint8)
        scratch = np.zeros(8, np.uint64), np.zeros(2, np.int64), np.zeros(BLOCK_BYTES, np.uint8)
        words = np.zeros(WORDS, np.uint64), np.zeros(WORDS, np.uint64), np.zeros(20, np.uint8)
        self.pieces = stack_blocks(blocks, KIND + 1, kinds)
        self.block = Block(DigestArrays(self.pieces, self._out, *scratch, *words))
        self._kept = blocks

    @property
    def out(self) -> np.ndarray:
        """The bytes of the digest."""
        return self._out

    def hexdigest(self, completed: int) -> str:
        """Return the fingerprint after this number of steps."""
        digest_pieces(self.block.numbers, completed, 0, 0)
        return self._out.tobytes().hex()


def join_texts(pieces: list[Any]) -> list[Any]:
    """Return pieces with bytes that follow each other as one.

    Examples
    --------
    >>> join_texts([b"a", b"b"])
    [b'ab']
    """
    joined: list[Any] = []
    for piece in pieces:
        if isinstance(piece, bytes) and joined and isinstance(joined[-1], bytes):
            joined[-1] += piece
        else:
            joined.append(piece)
    return joined


def text_of_part(value: Any) -> bytes:
    """Return what a fingerprint has of a part, or of a value in it, as bytes."""
    pieces = Pieces()
    add_part(pieces, value)
    return b"".join(pieces)


def split_text(pieces: list[Any], text: bytes) -> list[Any]:
    """Return pieces of which a text is one, that was a part of another.

    Examples
    --------
    >>> split_text([b"abc"], b"b"), split_text([b"abc"], b"")
    ([b'a', b'b', b'c'], [b'abc'])
    """
    found = next(
        (place for place, piece in enumerate(pieces) if text and isinstance(piece, bytes) and text in piece), None
    )
    if found is None:
        return pieces
    before, _, after = pieces[found].partition(text)
    return [*pieces[:found], *(piece for piece in (before, text, after) if piece), *pieces[found + 1 :]]


def _piece_of(piece: Any) -> Block:
    if isinstance(piece, bytes):
        return Block(TextPiece(np.frombuffer(bytearray(piece), np.uint8)))
    return Block(PIECES[piece.dtype](piece.reshape(-1)))


@compiled(nogil=True)
def digest_pieces(block, step, first, last):
    """Write the digest of the number of steps, in digits, and all pieces."""
    d = unpack(block, DigestArrays)
    state, counts = d.state, d.counts
    for k in range(8):
        state[k] = INITIAL[k]
    state[0] ^= np.uint64(PARAMETERS)
    counts[TAKEN], counts[WAITING] = 0, 0
    add_digits(d, step)
    for k in range(d.pieces.shape[0]):
        add_piece(d, d.pieces[k])
    for k in range(counts[WAITING], BLOCK_BYTES):
        d.waiting[k] = 0
    counts[TAKEN] += counts[WAITING]
    compress(d, True)
    for k in range(DIGEST_BYTES):
        d.out[k] = np.uint8(state[k // 8] >> (BYTE * np.uint64(k % 8)))
    return 0


@compiled
def add_digits(d, number):
    """Add a number that is not negative as text."""
    count = 0
    while number > 0 or count == 0:
        d.digits[count] = 48 + number % 10
        number //= 10
        count += 1
    for k in range(count - 1, -1, -1):
        add_byte(d, d.digits[k])


@compiled
def add_piece(d, row):
    """Add the array of a row of pieces."""
    kind = row[KIND]
    if kind == TEXT:
        text = unpack(row, TextPiece).array
        for k in range(text.shape[0]):
            add_byte(d, text[k])
    elif kind == REAL:
        add_reals(d, unpack(row, RealPiece).array)
    elif kind == SINGLE:
        add_reals(d, unpack(row, SinglePiece).array)
    elif kind == INTEGER:
        add_integers(d, unpack(row, IntegerPiece).array)
    elif kind == SHORT:
        add_integers(d, unpack(row, ShortPiece).array)
    elif kind == CODE:
        add_integers(d, unpack(row, CodePiece).array)
    elif kind == FLAG:
        add_integers(d, unpack(row, FlagPiece).array)
    else:
        add_integers(d, unpack(row, WordPiece).array)


@compiled
def add_reals(d, array):
    """Add numbers as float64; 0 without its sign."""
    for k in range(array.shape[0]):
        add_word(d, np.float64(array[k] + 0.0).view(np.uint64))


@compiled
def add_integers(d, array):
    """Add whole numbers as int64."""
    for k in range(array.shape[0]):
        add_word(d, np.uint64(np.int64(array[k])))


@compiled
def add_word(d, word):
    """Add the 8 bytes of a word, the lowest first."""
    for k in range(8):
        add_byte(d, np.uint8(word >> (BYTE * np.uint64(k))))


@compiled
def add_byte(d, byte):
    """Add a byte; a full block is compressed when more comes."""
    if d.counts[WAITING] == BLOCK_BYTES:
        d.counts[TAKEN] += BLOCK_BYTES
        compress(d, False)
        d.counts[WAITING] = 0
    d.waiting[d.counts[WAITING]] = byte
    d.counts[WAITING] += 1


@compiled
def compress(d, is_last):
    """Mix the block that waits into the state (RFC 7693, 3.2)."""
    state, v, m = d.state, d.mixed, d.message
    for k in range(WORDS):
        word = np.uint64(0)
        for b in range(8):
            word |= np.uint64(d.waiting[8 * k + b]) << (BYTE * np.uint64(b))
        m[k] = word
    for k in range(8):
        v[k], v[8 + k] = state[k], INITIAL[k]
    v[12] ^= np.uint64(d.counts[TAKEN])
    if is_last:
        v[14] = ~v[14]
    for r in range(ROUNDS):
        for g in range(8):
            a, b, c, e = MIXED[g, 0], MIXED[g, 1], MIXED[g, 2], MIXED[g, 3]
            v[a] = v[a] + v[b] + m[ORDER[r % 10, 2 * g]]
            v[e] = rotate(v[e] ^ v[a], np.uint64(32))
            v[c] = v[c] + v[e]
            v[b] = rotate(v[b] ^ v[c], np.uint64(24))
            v[a] = v[a] + v[b] + m[ORDER[r % 10, 2 * g + 1]]
            v[e] = rotate(v[e] ^ v[a], np.uint64(16))
            v[c] = v[c] + v[e]
            v[b] = rotate(v[b] ^ v[c], np.uint64(63))
    for k in range(8):
        state[k] ^= v[k] ^ v[8 + k]


@compiled
def rotate(word, count):
    """Return a word of 64 bits rotated to the right."""
    return (word >> count) | (word << (SIXTY_FOUR - count))
