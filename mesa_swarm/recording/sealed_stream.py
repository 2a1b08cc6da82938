"""Arrow IPC streams whose pieces are sealed: what was torn or flipped is found before it is believed.

A sealed stream is an ordinary Arrow IPC stream, which any tool reads. After the schema, and after each record
batch, stands a batch of no rows whose metadata are the seal: a CRC-32 of all bytes since the last seal began, the
number of rows, and the step of the first one. A seal is written with what it seals, so whatever is followed by
a seal that fits is whole. What is no row, a checkpoint for example, is carried by the metadata of a batch of no
rows, sealed likewise.
"""

import base64
import binascii
import mmap
import os
import re
import zlib
from collections.abc import Iterator
from functools import cached_property
from io import FileIO
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa

from mesa_swarm.errors import RecordingError

SEAL = re.compile(rb"crc32=([0-9a-f]{8}) rows=(\d{1,18}) step=(-?\d{1,18});")
# What pieces without rows carry.
CHECKPOINT, CHANGE, INTERVENTION = "checkpoint", "change", "intervention"
NAME = re.compile(rb"\0(checkpoint|change|intervention)\0")
BEGIN_OF_MESSAGE = b"\xff\xff\xff\xff"
END_OF_STREAM = BEGIN_OF_MESSAGE + b"\x00\x00\x00\x00"
# Level 1: higher ones cost a step more than they save on disk.
ZSTD = pa.ipc.IpcWriteOptions(compression=pa.Codec("zstd", compression_level=1))


class Sealed(NamedTuple):
    """How far a stream is sealed."""

    end: int
    rows: int


class Piece(NamedTuple):
    """A sealed piece of a stream: where its bytes are, and what its seal says."""

    begin: int
    batch: int
    seal: int
    end: int
    crc: int
    rows: int
    step: int


class SealedWriter:
    """Writes a sealed stream, piece by piece; a piece that fails to be written leaves no trace.

    Parameters
    ----------
    path : Path
    schema : pyarrow.Schema
    overwrite : bool
        Whether a file that is there is replaced.

    Attributes
    ----------
    sealed : Sealed
        Replaced in one go when a piece is on disk, so that an interrupt cannot leave half the news.
    """

    def __init__(self, path: Path, schema: pa.Schema, overwrite: bool) -> None:
        self.path = path
        self._bare = schema.remove_metadata()
        self._empty = pa.RecordBatch.from_pylist([], schema=self._bare)
        self._head = len(_stream_of(self._bare))
        self._last_seal = b""
        self._file = _opened(path, overwrite)
        self.sealed = Sealed(0, 0)
        try:
            self._append(_stream_of(schema), 0, 0)
        except RecordingError:
            self._file.close()
            path.unlink()  # an empty file would stand in the way of the next attempt
            raise

    @property
    def closed(self) -> bool:
        """Whether nothing more can be written."""
        return self._file.closed

    def write(self, batch: pa.RecordBatch, step: int) -> None:
        """Write a piece whose first row is of this step.

        Raises
        ------
        RecordingError
            If it cannot be written; what was sealed before stays.
        """
        self._append(self._message(batch), batch.num_rows, step)

    def attach(self, name: str, content: bytes, step: int) -> None:
        """Write a piece of no rows that carries these bytes, which tools that know nothing of them pass over.

        Raises
        ------
        RecordingError
            If it cannot be written.
        """
        words = base64.b64encode(content)  # metadata are texts for other readers
        self._append(self._message(self._empty, {name: words}), 0, step)

    def sync(self) -> None:
        """Have the system put what was written on the disk, where a power cut cannot reach it."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """End the stream; a second time does nothing."""
        if self.closed:
            return
        try:
            self._put(END_OF_STREAM)
            self.sync()
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Close the file as it is, with everything sealed so far."""
        self._file.close()

    def _append(self, message: bytes, rows: int, step: int) -> None:
        crc = zlib.crc32(f"{rows} {step}".encode(), zlib.crc32(message, zlib.crc32(self._last_seal)))
        words = f"crc32={crc:08x} rows={rows} step={step};"
        seal = self._message(self._empty, {"seal": words})
        self._put(message + seal)
        self._last_seal = seal
        self.sealed = Sealed(self.sealed.end + len(message) + len(seal), self.sealed.rows + rows)

    def _message(self, batch: pa.RecordBatch, metadata: dict | None = None) -> bytes:
        return _stream_of(self._bare, batch, metadata)[self._head :]

    def _put(self, content: bytes) -> None:
        """Write after what is sealed; whatever an earlier attempt left there is cut off."""
        try:
            self._file.seek(self.sealed.end)
            self._file.truncate()
            left = memoryview(content)
            while left:
                left = left[self._file.write(left) :]
        except OSError as error:
            self._cut()
            raise RecordingError(
                f"{self.path} cannot be written: {error.strerror or error}; its {self.sealed.rows} rows so far are kept"
            ) from None

    def _cut(self) -> None:
        try:
            self._file.truncate(self.sealed.end)
        except OSError:  # a tail without a seal is passed over by readers
            return


def _opened(path: Path, overwrite: bool) -> FileIO:
    try:
        if overwrite and path.is_file():
            path.unlink()  # not emptied: whoever reads the old one still has it in memory
        return open(path, "xb", buffering=0)
    except FileExistsError:
        raise RecordingError(
            f"{path} exists already; choose another name, or replace it with overwrite=True (--force)"
        ) from None
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        reason = getattr(error, "strerror", None) or error
        raise RecordingError(f"{path} cannot be written: {reason}; choose another place") from None


def _stream_of(schema: pa.Schema, batch: pa.RecordBatch | None = None, metadata: dict | None = None) -> bytes:
    """Return the bytes of schema and batch, without the end of the stream."""
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, schema, options=ZSTD) as writer:
        if batch is not None:
            writer.write_batch(batch, custom_metadata=metadata)
    return sink.getvalue().to_pybytes()[: -len(END_OF_STREAM)]


class SealedReader:
    """Finds the sealed pieces of a stream without decoding them; each is checked when it is first read.

    Parameters
    ----------
    path : Path

    Attributes
    ----------
    schema : pyarrow.Schema
    pieces : list of Piece
        With rows.
    attached : list of Piece
        Without rows: `content` returns what they carry.
    complete : bool
        Whether the stream was closed and nothing is missing at its end.

    Raises
    ------
    RecordingError
        If it cannot be read, or is damaged so early that nothing can be told.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._bytes = pa.py_buffer(_mapped(path))
        found = list(self._found())
        if not found or found[0].batch != 0 or not self.is_whole(found[0]):
            raise RecordingError(f"{path} is not a recording, or its beginning is damaged; choose another file")
        self.schema = pa.ipc.read_schema(self._message(0))
        if len(found) > 1 and not self.is_whole(found[-1]):  # a power cut may leave holes before the end
            found.pop()
        self.pieces = [piece for piece in found[1:] if piece.rows]
        self.attached = [piece for piece in found[1:] if not piece.rows]
        self._end = found[-1].end
        self.lost = self._bytes.size - self._end
        self.complete = self._bytes[self._end :].to_pybytes() == END_OF_STREAM

    @cached_property
    def broken(self) -> bool:
        """Whether what follows the last piece was once more than the torn end of a stream that nobody closed."""
        if self.complete:
            return False
        rest = memoryview(self._bytes)[self._end :].tobytes()
        return rest.endswith(END_OF_STREAM) or _holds_whole_piece(rest)

    def batch(self, piece: Piece) -> pa.RecordBatch:
        """Return the rows of a piece.

        Raises
        ------
        RecordingError
            If its bytes are not what was sealed.
        """
        if not self.is_whole(piece):
            raise RecordingError(f"{self.path} is damaged from step {piece.step} on; earlier rows are whole")
        return pa.ipc.read_record_batch(self._message(piece.batch), self.schema)

    def is_whole(self, piece: Piece) -> bool:
        """Tell whether the bytes of a piece are what was sealed."""
        crc = zlib.crc32(self._bytes[piece.begin : piece.seal])
        return zlib.crc32(f"{piece.rows} {piece.step}".encode(), crc) == piece.crc

    def name(self, piece: Piece) -> str:
        """Return what a piece without rows carries; read without being checked."""
        names = NAME.findall(self._message(piece.batch).metadata.to_pybytes())
        return names[0].decode() if names else ""

    def content(self, piece: Piece) -> bytes:
        """Return the bytes that a piece without rows carries.

        Raises
        ------
        RecordingError
            If they are not what was sealed.
        """
        damage = f"{self.path} is damaged at what it carries for step {piece.step}"
        if not self.is_whole(piece):
            raise RecordingError(damage)
        try:
            sink = pa.BufferReader(self.schema.serialize().to_pybytes() + self._message(piece.batch).serialize())
            _, carried = pa.ipc.open_stream(sink).read_next_batch_with_custom_metadata()
            return base64.b64decode(carried[self.name(piece)], validate=True)
        except (KeyError, TypeError, OSError, StopIteration, binascii.Error, pa.ArrowException):
            raise RecordingError(damage) from None

    def _found(self) -> Iterator[Piece]:
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
        """Iterate over messages: where each begins and ends, and its metadata; the first that is torn ends it."""
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


def _holds_whole_piece(rest: bytes) -> bool:
    """Tell whether a seal fits what stands between it and the one before, wherever the two are."""
    seals = [(rest.rfind(BEGIN_OF_MESSAGE, 0, seal.start()), seal) for seal in SEAL.finditer(rest)]
    return any(_fits(rest[begin:end], seal) for (begin, _), (end, seal) in pairwise(seals))


def _fits(content: bytes, seal: re.Match[bytes]) -> bool:
    return zlib.crc32(b"%b %b" % (seal[2], seal[3]), zlib.crc32(content)) == int(seal[1], 16)


def _mapped(path: Path) -> mmap.mmap | bytes:
    try:
        with open(path, "rb") as file:
            if not os.fstat(file.fileno()).st_size:
                return b""
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise RecordingError(f"{path} cannot be read: {reason}") from None
