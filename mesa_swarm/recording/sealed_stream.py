"""Arrow IPC streams whose pieces are sealed: torn or flipped bytes are found before they are used.

A sealed stream is an ordinary Arrow IPC stream, which any tool reads. After the schema, and after each record
batch, stands an empty batch whose metadata are the seal: a CRC-32 of all bytes since the last seal began, the number
of rows, and the step of the first one. A seal is written with what it seals, so whatever is followed by a matching
seal is whole. Other content, a checkpoint for example, is in the metadata of an empty batch, sealed likewise.
"""

import base64
import mmap
import os
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cached_property
from io import FileIO
from itertools import pairwise
from pathlib import Path
from threading import Lock, Thread
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from mesa_swarm.base.errors import RecordingError
from mesa_swarm.base.files import (
    check_present_format,
    checked_place,
    discard,
    is_locked,
    is_named,
    lock,
    open_draft,
    put_in_place,
    show_path,
    unlock,
    unwritable,
)

SEAL = re.compile(rb"crc32=([0-9a-f]{8}) rows=(\d{1,18}) step=(-?\d{1,18});")
# Names of pieces without rows.
CHECKPOINT, CHANGE, INTERVENTION, MOVES = "checkpoint", "change", "intervention", "moves"
NAME = re.compile(rb"\0(checkpoint|change|intervention|moves)\0")
BEGIN_OF_MESSAGE = b"\xff\xff\xff\xff"
END_OF_STREAM = BEGIN_OF_MESSAGE + b"\x00\x00\x00\x00"
# Fields of flatbuffers: the header of a message; the buffers of a record batch, and their compression.
HEADER, BUFFERS, PACKED = 2, 2, 3
# Bytes before a compressed buffer, with its length.
CLAIM = 8
# Limit in bytes of a batch in memory, or as a multiple of its size in the file.
ALWAYS_ALLOWED, MOST_PACKED = 1 << 25, 64
# Uncertainty of that size when a batch is written.
SLACK = 1 << 16
# The files that this process writes: a recorder that was left open, as in a notebook, yields to the next.
OWN: set[tuple[int, int]] = set()
# Level 1: higher ones cost a step more than they save on disk. Without threads: to wait for these takes longer than to
# compress the few hundred kB of a chunk.
ZSTD = pa.ipc.IpcWriteOptions(compression=pa.Codec("zstd", compression_level=1), use_threads=False)
PLAIN = pa.ipc.IpcWriteOptions()


class Sealed(NamedTuple):
    """The sealed length of a stream, and its rows."""

    end: int
    rows: int


class Piece(NamedTuple):
    """A sealed piece of a stream: the offsets of its bytes, and the content of its seal."""

    begin: int
    batch: int
    seal: int
    end: int
    crc: int
    rows: int
    step: int


class LaterPiece:
    """A piece that a thread of its own writes, unless that has not begun when the piece is needed.

    Parameters
    ----------
    write : callable
        Writes it; if it is interrupted by Ctrl-C, it may be called again.
    rows : int
        Those of the stream when it is written.
    """

    def __init__(self, write: Callable[[], None], rows: int) -> None:
        self.rows = rows
        self._write, self._lock, self._is_done = write, Lock(), False
        self._error: Exception | None = None

    def begin(self) -> None:
        """Let a thread write the piece; where no thread can be had, `finish` does."""
        with suppress(RuntimeError):
            Thread(target=self._run, name="recording").start()

    def _run(self) -> None:
        with self._lock:
            if self._is_done:
                return
            try:
                self._write()
            except Exception as error:
                self._error = error
            self._is_done = True

    def finish(self) -> None:
        """Wait until the piece is written, and raise what its writing has raised."""
        self._run()
        if self._error is not None:
            raise self._error

    @property
    def is_pending(self) -> bool:
        """Whether it is to be written yet, as after Ctrl-C."""
        return not self._is_done

    def drop(self) -> None:
        """Do not write the piece, unless it is written."""
        with self._lock:
            self._is_done = True


class SealedWriter:
    """Writes a sealed stream, piece by piece; a piece that cannot be written leaves no trace.

    A stream that replaces a file (`overwrite`) is written beside it, and takes its name when its first piece with rows
    is on the disk, or when it is closed: until then the old file is untouched. As long as it is open no other process
    can replace it. `sealed` is replaced at once when a piece is on disk: an interrupt cannot leave half an update. A
    piece that is to be written later is written before anything else is.
    """

    def __init__(self, path: Path, schema: pa.Schema, overwrite: bool) -> None:
        self.path = path
        self._bare = schema.remove_metadata()
        self._empty = pa.RecordBatch.from_pylist([], schema=self._bare)
        self._head = len(_stream_of(self._bare))
        self._last_seal = b""
        self._file, self._place = _open_stream(path, overwrite)
        self._identity = _identity(os.fstat(self._file.fileno()))
        self._owner = os.getpid()
        OWN.add(self._identity)
        self.sealed = Sealed(0, 0)
        self._later: LaterPiece | None = None
        try:
            self._append(_stream_of(schema), 0, 0)
        except BaseException:
            self.abandon()  # an empty file would stand in the way of the next attempt
            raise

    @property
    def closed(self) -> bool:
        """Whether nothing more can be written."""
        return self._file.closed

    @property
    def is_in_place(self) -> bool:
        """Whether the file has the stream's name, and is not a draft beside an older file of that name."""
        return self._place is None

    @property
    def rows(self) -> int:
        """How many rows were written, or are to be written later."""
        later = self._later
        return self.sealed.rows if later is None else later.rows

    def write(self, batch: pa.RecordBatch, step: int) -> None:
        """Write a piece whose first row is of this step."""
        self.finish()
        self.write_now(batch, step)

    def write_now(self, batch: pa.RecordBatch, step: int) -> None:
        """Do so without waiting for what is written later: for the thread that writes it."""
        self._append(self._message(batch), batch.num_rows, step)
        self._take_name()

    def write_later(self, write: Callable[[], None], rows: int) -> None:
        """Let a thread of its own write a piece of some rows, by a function that calls `write_now`."""
        self.finish()
        end = self.sealed.rows + rows

        def write_once() -> None:
            if self.sealed.rows < end:  # else Ctrl-C came just after it was written
                write()

        self._later = LaterPiece(write_once, end)
        self._later.begin()

    def finish(self) -> None:
        """Wait for a piece that is written later.

        Raises
        ------
        RecordingError
            If it could not be written.
        """
        later = self._later
        if later is not None:
            try:
                later.finish()
            finally:
                self._later = later if later.is_pending else None

    def attach(self, name: str, content: bytes, step: int) -> None:
        """Write a piece without rows that contains these bytes, which other tools ignore."""
        self.finish()
        words = base64.b64encode(content)  # metadata are texts for other readers
        self._append(self._message(self._empty, {name: words}), 0, step)

    def sync(self) -> None:
        """Synchronise the file to disk, so that it survives a power cut."""
        self.finish()
        try:
            os.fsync(self._file.fileno())
        except OSError as error:
            raise unwritable(self.path, error, RecordingError, "its last rows may be lost") from None

    def close(self) -> None:
        """End the stream; a second time does nothing."""
        if self.closed:
            return
        try:
            self.finish()
            self._put(END_OF_STREAM)
            self._take_name()
            self.sync()
        except BaseException:
            self.abandon()
            raise
        self._release()

    def abandon(self) -> None:
        """Close the file as it is, with everything sealed so far; one without rows is deleted."""
        if self._later is not None:
            self._later.drop()
        if not self.closed and not (self.is_in_place and self.sealed.rows):
            discard(self._file)
        self._release()

    def _release(self) -> None:
        # A forked child shares the lock: only this process may end it.
        if os.getpid() == self._owner:
            unlock(self._file)
        self._file.close()
        OWN.discard(self._identity)

    def _append(self, message: bytes, rows: int, step: int) -> None:
        crc = zlib.crc32(f"{rows} {step}".encode(), zlib.crc32(message, zlib.crc32(self._last_seal)))
        words = f"crc32={crc:08x} rows={rows} step={step};"
        seal = self._message(self._empty, {"seal": words})
        self._put(message + seal)
        self._last_seal = seal
        self.sealed = Sealed(self.sealed.end + len(message) + len(seal), self.sealed.rows + rows)

    def _message(self, batch: pa.RecordBatch, metadata: dict | None = None) -> bytes:
        if not batch.num_rows:  # nothing to compress, which would take ten times as long
            return _stream_of(self._bare, batch, metadata, PLAIN)[self._head :]
        message = _stream_of(self._bare, batch, metadata)[self._head :]
        if batch.nbytes > _find_most_bytes(message):  # readers accept that much only uncompressed
            return _stream_of(self._bare, batch, metadata, PLAIN)[self._head :]
        return message

    def _put(self, content: bytes) -> None:
        """Write after the last sealed piece; the rest of a failed attempt is cut off."""
        try:
            self._file.seek(self.sealed.end)
            self._file.truncate()
            remaining = memoryview(content)
            while remaining:
                remaining = remaining[self._file.write(remaining) :]
        except OSError as error:
            with suppress(OSError):  # readers ignore a tail without a seal
                self._file.truncate(self.sealed.end)
            raise unwritable(self.path, error, RecordingError, self._remaining()) from None

    def _remaining(self) -> str:
        """Return what remains under the name when no more can be written."""
        if not self.is_in_place:
            return "the older file is untouched"
        return f"its {self.sealed.rows} rows so far remain" if self.sealed.rows else "no row was written"

    def _take_name(self) -> None:
        """Replace the older file, once: the new one is on disk by then."""
        place = self._place
        if place is None:
            return
        try:
            if is_named(self._file, Path(self._file.name)):
                _check_unused(self.path, place)
                put_in_place(self._file, place)
            elif not is_named(self._file, place):  # it is after Ctrl-C just after the renaming
                raise RecordingError(
                    f"{show_path(self.path)} was not replaced: the draft beside it, with all rows of this recording, "
                    "was deleted; record again"
                )
        except OSError as error:
            raise unwritable(self.path, error, RecordingError, self._remaining()) from None
        self._place = None
        if self._file.closed:  # on Windows, for renaming
            self._file = open(place, "r+b", buffering=0)  # noqa: SIM115 - closed by close


def _open_stream(path: Path, overwrite: bool) -> tuple[FileIO, Path | None]:
    """Return a new file, and the path of the older file that it is to replace."""
    try:
        place = checked_place(path)
        if overwrite and place.exists():
            _check_unused(path, place)
            return open_draft(place), place
        file = open(place if overwrite else path, "xb", buffering=0)  # noqa: SIM115 - closed by close
    except FileExistsError:
        raise RecordingError(
            f"{show_path(path)} exists already; choose another name, or replace it with overwrite=True (--force)"
        ) from None
    except OSError as error:
        raise unwritable(path, error, RecordingError, "choose another place") from None
    lock(file)
    return file, None


def _check_unused(path: Path, place: Path) -> None:
    """Refuse to replace what another process is writing."""
    if is_locked(place) and _identity(place.stat()) not in OWN:
        raise RecordingError(
            f"{show_path(path)} is being recorded by another program; wait for its end, or choose another name"
        )


def _identity(status: os.stat_result) -> tuple[int, int]:
    return status.st_dev, status.st_ino


def _find_most_bytes(message: bytes) -> int:
    """Return the bytes that a batch may take in memory, given its length in the file."""
    return max(ALWAYS_ALLOWED, MOST_PACKED * len(message)) - SLACK


def _stream_of(
    schema: pa.Schema,
    batch: pa.RecordBatch | None = None,
    metadata: dict | None = None,
    options: pa.ipc.IpcWriteOptions = ZSTD,
) -> bytes:
    """Return the bytes of schema and batch, without the end of the stream."""
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, schema, options=options) as writer:
        if batch is not None:
            writer.write_batch(batch, custom_metadata=metadata)
    return sink.getvalue().to_pybytes()[: -len(END_OF_STREAM)]


class SealedReader:
    """Finds the sealed pieces of a stream without decoding them; each is checked when it is read.

    `pieces` have rows, `attached` have none but a name and bytes (`content`). `complete` is whether the stream was
    closed and nothing is missing at its end, `lost` the number of bytes after the last piece.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._bytes = pa.py_buffer(_map_file(path))
        pieces = list(self._scan_pieces())
        if not pieces or pieces[0].batch != 0 or not self.is_whole(pieces[0]):
            check_present_format(path, RecordingError)
            raise RecordingError(f"{path} is not a recording, or its beginning is damaged; choose another file")
        try:
            self.schema = pa.ipc.read_schema(self._message(0))
        except (pa.ArrowException, OSError, ValueError, MemoryError):
            raise RecordingError(f"{path} does not begin with an Arrow schema; choose another file") from None
        if len(pieces) > 1 and not self.is_whole(pieces[-1]):  # a power cut may leave holes before the end
            pieces.pop()
        self.pieces = [piece for piece in pieces[1:] if piece.rows]
        self.attached = [piece for piece in pieces[1:] if not piece.rows]
        self._end = pieces[-1].end
        self.lost = self._bytes.size - self._end
        self.complete = self._bytes[self._end :].to_pybytes() == END_OF_STREAM

    def cut(self, piece: Piece) -> None:
        """Treat a piece and all that follow it as damaged."""
        self.pieces, self.attached = (
            [other for other in pieces if other.begin < piece.begin] for pieces in (self.pieces, self.attached)
        )
        self._end = piece.batch
        self.lost, self.complete = self._bytes.size - self._end, False

    @cached_property
    def broken(self) -> bool:
        """Whether the bytes after the last piece are more than the torn end of a stream that was not closed."""
        if self.complete:
            return False
        tail = memoryview(self._bytes)[self._end :].tobytes()
        return tail.endswith(END_OF_STREAM) or _holds_whole_piece(tail)

    def batch(self, piece: Piece) -> pa.RecordBatch:
        """Return the rows of a piece."""
        if not self.is_whole(piece):
            raise RecordingError(f"{self.path} is damaged from step {piece.step} on; earlier rows are whole")
        try:
            return pa.ipc.read_record_batch(self._checked_message(piece), self.schema)
        except (pa.ArrowException, OSError, ValueError, MemoryError):
            raise RecordingError(
                f"{self.path} has rows from step {piece.step} on that do not match its columns"
            ) from None

    def is_whole(self, piece: Piece) -> bool:
        """Return whether the bytes of a piece match its seal."""
        crc = zlib.crc32(self._bytes[piece.begin : piece.seal])
        return zlib.crc32(f"{piece.rows} {piece.step}".encode(), crc) == piece.crc

    def name(self, piece: Piece) -> str:
        """Return the name of a piece without rows, unchecked."""
        names = NAME.findall(self._message(piece.batch).metadata.to_pybytes())
        return names[0].decode() if names else ""

    def content(self, piece: Piece) -> bytes:
        """Return the bytes that a piece without rows contains."""
        damage = f"{self.path} is damaged at the piece of step {piece.step}"
        if not self.is_whole(piece):
            raise RecordingError(damage)
        try:
            sink = pa.BufferReader(self._bare + self._checked_message(piece).serialize())
            _, carried = pa.ipc.open_stream(sink).read_next_batch_with_custom_metadata()
            return base64.b64decode(carried[self.name(piece)], validate=True)
        except (KeyError, TypeError, ValueError, OSError, StopIteration, MemoryError, pa.ArrowException):
            raise RecordingError(damage) from None

    @cached_property
    def _bare(self) -> bytes:
        """The schema as bytes, without its metadata."""
        return self.schema.remove_metadata().serialize().to_pybytes()

    def _checked_message(self, piece: Piece) -> pa.Message:
        """Return the batch of a piece, unless it claims more memory than its bytes permit."""
        message = self._message(piece.batch)
        if unpacked_bytes(message) > max(ALWAYS_ALLOWED, MOST_PACKED * (piece.seal - piece.batch)):
            raise ValueError("a batch that is too large")
        return message

    def _scan_pieces(self) -> Iterator[Piece]:
        begin = 0
        batch: int | None = None
        for at, end, metadata in self._messages():
            seal = SEAL.search(metadata) if at else None  # the schema may hold any text
            if (seal is None) == (batch is not None):  # every second message is a seal: this one, or that, is damaged
                return
            if seal is None or batch is None:
                batch = at
            else:
                yield Piece(begin, batch, at, end, int(seal[1], 16), int(seal[2]), int(seal[3]))
                begin, batch = at, None

    def _messages(self) -> Iterator[tuple[int, int, bytes]]:
        """Iterate over the offsets and metadata of messages, up to the first that is torn."""
        source = pa.BufferReader(self._bytes)
        while True:
            at = source.tell()
            try:
                message = pa.ipc.read_message(source)
            except (EOFError, OSError, pa.ArrowException, MemoryError, ValueError):
                return
            yield at, source.tell(), message.metadata.to_pybytes()

    def _message(self, at: int) -> pa.Message:
        return pa.ipc.read_message(pa.BufferReader(self._bytes[at:]))


def unpacked_bytes(message: pa.Message) -> int:
    """Return the bytes that a record batch claims to take once it is decompressed, which Arrow does not check.

    They precede each compressed buffer, whose offset is in the message's flatbuffer:
    https://arrow.apache.org/docs/format/Columnar.html#recordbatch-message.
    """
    content, body = message.metadata.to_pybytes(), message.body
    try:
        header = _field(content, struct.unpack_from("<I", content)[0], HEADER)
        batch = header + struct.unpack_from("<I", content, header)[0]
        vector = _field(content, batch, BUFFERS)
        begin = vector + struct.unpack_from("<I", content, vector)[0]
        count = struct.unpack_from("<I", content, begin)[0]
        buffers = np.frombuffer(content, "<i8", 2 * count, begin + 4).reshape(-1, 2)
        claims = [struct.unpack_from("<q", body, at)[0] for at, length in buffers.tolist() if length >= CLAIM]
    except (struct.error, TypeError):
        raise ValueError("not a record batch") from None
    return sum(max(claim, 0) for claim in claims) if _field(content, batch, PACKED) else 0


def _field(content: bytes, table: int, number: int) -> int:
    """Return the offset of a field of a flatbuffer's table, 0 if the table does not have it."""
    vtable = table - struct.unpack_from("<i", content, table)[0]
    place = 4 + 2 * number
    if place >= struct.unpack_from("<H", content, vtable)[0]:
        return 0
    offset = struct.unpack_from("<H", content, vtable + place)[0]
    return table + offset if offset else 0


def _holds_whole_piece(tail: bytes) -> bool:
    """Return whether a seal matches the bytes between it and the one before, wherever the two are."""
    seals, after = [], 0
    for seal in SEAL.finditer(tail):  # only between two seals, else the time is the square of their number
        seals.append((max(tail.rfind(BEGIN_OF_MESSAGE, after, seal.start()), after), seal))
        after = seal.end()
    return any(_fits(tail[begin:end], seal) for (begin, _), (end, seal) in pairwise(seals))


def _fits(content: bytes, seal: re.Match[bytes]) -> bool:
    return zlib.crc32(b"%b %b" % (seal[2], seal[3]), zlib.crc32(content)) == int(seal[1], 16)


def _map_file(path: Path) -> mmap.mmap | bytes:
    try:
        with open(path, "rb") as file:
            if not os.fstat(file.fileno()).st_size:
                return b""
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise RecordingError(f"{path} cannot be read: {reason}") from None
