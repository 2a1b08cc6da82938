"""Outcomes of runs, and the append-only ledger that stores them: they survive a kill and a power cut."""

import json
import os
import re
import sys
from array import array
from collections.abc import Callable, Container, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Condition, Lock, Thread
from typing import Any, BinaryIO, Self, TypeGuard
from zlib import crc32

import numpy as np

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.base.files import lock, show_path, unlock

# The name of the file in most folders of runs; that of a sweep, and its parts, is another.
RUNS = "runs.jsonl"
KEY_BYTES = 16
KEY = re.compile(f"[0-9a-f]{{{2 * KEY_BYTES}}}")
# Checksum and the text up to the key: how each line of a ledger begins, and of no other file.
BEGINNING = re.compile(rb'[0-9a-f]{8} \{"key": "')
# A file with nothing but these first bytes of a line is a ledger: with fewer it might be any number.
FEWEST_BYTES = 9
# Lists within lists: those of a run's results are few, and one line can hold millions.
DEEPEST = 32
LONGEST_ERROR = 500
LONGEST_LINE = 4 << 20
LARGEST_STEPS = 2**62
STORED = ("steps", "state_hash", "results", "error")
# Stored of a run with a condition only, so that lines of others are those of earlier versions.
ENDED_BY = "ended_by"


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a run: results, None for what did not happen, or the error that ended it.

    `steps` are those that the model took, `state_hash` the fingerprint of its final state; `ended_by` is what ended a
    run that had a condition: "condition", "steps" if it took all of them, "model" if that stopped by itself.
    """

    steps: int = 0
    state_hash: str | None = None
    results: dict[str, Any] | None = None
    error: str | None = None
    ended_by: str | None = None

    @property
    def numbers(self) -> dict[str, Any]:
        """The results, empty after an error."""
        return self.results or {}

    def stored(self) -> dict[str, Any]:
        """Return the fields that a ledger stores."""
        more = () if self.ended_by is None else (ENDED_BY,)
        return {name: getattr(self, name) for name in (*STORED, *more)}


class Syncing:
    """Syncs a file to the disk, in a thread of its own: what is written during one sync waits for the next.

    A busy disk takes 10 ms for a sync, during which many quick runs end.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._change = Condition()
        self._written = self._synced = 0
        self._error: OSError | None = None
        self._thread: Thread | None = None
        # How many bytes of the file the disk has for certain, from the first line on that was written.
        self.safe: int | None = None

    def begin(self, place: int) -> None:
        """Have what was written so far synced, soon; its last line begins here. Raise the error of an earlier sync."""
        with self._change:
            self._raise_error()
            if self.safe is None:
                self.safe = place
            self._written += 1
            if self._thread is None:
                number = os.dup(self._file.fileno())  # Ctrl-C may close the file meanwhile
                self._thread = Thread(target=self._sync, args=(number,), name="sync a ledger", daemon=True)
                self._thread.start()
            self._change.notify_all()

    def end(self) -> None:
        """Wait until the disk has all that was written, and end the thread."""
        with self._change:
            thread, self._thread = self._thread, None
            self._change.notify_all()
        if thread is not None:  # that of a process from which this one was forked is not alive
            thread.join()
        self._raise_error()

    def _raise_error(self) -> None:
        error, self._error = self._error, None
        if error is not None:
            raise error

    def _sync(self, number: int) -> None:
        """Sync the file with this descriptor until the end, or until an error."""
        try:
            while (written := self._next()) > self._synced:
                size = os.fstat(number).st_size
                os.fsync(number)
                self.safe, self._synced = size, written
        except OSError as error:
            with self._change:
                self._error, self._synced, self._thread = error, self._written, None
        finally:
            os.close(number)

    def _next(self) -> int:
        """Wait until something was written since the last sync, or for the end; return how often something was."""
        with self._change:
            self._change.wait_for(lambda: self._written > self._synced or self._thread is None)
            return self._written


class Ledger:
    """A file with one line per finished run: checksum, key, outcome.

    A line is written in one piece when its run is done, and synced to the disk at once, though nothing waits for that:
    a power cut may take the lines of the last few milliseconds, a kill of the process none. A line that was torn apart
    is cut off when the ledger is opened again; a damaged line fails its checksum and counts as never written, as does
    one whose checksum is right and whose content is not the outcome of a run. Nothing else is ever cut:
    a file that is not a ledger is refused and stays as it is, as does one with the checksum of a first line at most. Of
    two lines with one key the last counts. One process at a time may write, others may read.

    Memory grows by 24 bytes per run: its key, and where its line begins.

    With `retry_failed` runs that ended in an error count as not done; so do outcomes for which `fits` is false. The
    file is created when it is opened, unless `read_only`: then it must exist, and another process may write to it.
    """

    def __init__(
        self,
        path: Path,
        *,
        retry_failed: bool = False,
        read_only: bool = False,
        fits: Callable[[Outcome], bool] | None = None,
    ) -> None:
        self.path = path
        self._lock = Lock()  # joblib asks for outstanding runs in a thread of its own
        self._fits = fits
        self._retry_failed = retry_failed
        self._file = _opened(path, read_only)
        self._syncing = Syncing(self._file)
        try:
            if not read_only and lock(self._file) is False:
                raise InvalidValueError(
                    f"{show_path(path)} is being written by another sweep; wait for it or choose another folder"
                )
            self._read()
            if not read_only:
                self._cut()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *reason: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file when the disk has all of it, and give up its lock."""
        try:
            with self._disk_errors_in_words(), self._cut_back():
                self._syncing.end()
        finally:
            unlock(self._file)  # a worker that is still there may share it
            self._file.close()

    def __contains__(self, key: str) -> bool:
        """Whether this run is done."""
        with self._lock:
            return self._place(key) is not None

    def clear(self) -> None:
        """Delete all runs: the file is empty then."""
        with self._lock:
            os.truncate(self.path, 0)
            self._ended = True
            self._read()

    def absorb(self, path: Path, keys: Container[str] | None = None) -> None:
        """Copy the outcomes of another ledger that this one lacks, and those that replace an error.

        Parameters
        ----------
        path : Path
            Of the other one, to which another process may be writing.
        keys : container of str, optional
            The runs that are wanted, by default all.
        """
        with Ledger(path, read_only=True, fits=self._fits) as other:
            for _, (key, outcome) in other._entries():
                if (keys is None or key in keys) and self._lacks(key, outcome):
                    self.append(key, outcome)

    def __iter__(self) -> Iterator[str]:
        """Yield the keys of the runs that are done, of each once."""
        with self._lock:
            self._sort_in()
            found = np.unique(self._keys)
        for key in found:
            yield bytes(key).ljust(KEY_BYTES, b"\0").hex()

    def _lacks(self, key: str, outcome: Outcome) -> bool:
        """Return whether an outcome is better than what this has of the run: nothing, or an error."""
        before = self.outcome(key)
        if outcome.error is not None:
            return before is None and not self._retry_failed
        return before is None or before.error is not None

    def append(self, key: str, outcome: Outcome) -> None:
        """Write the outcome of a run, which the disk has soon after; nothing is left of one that cannot be written."""
        line = _line(key, outcome)
        if _entry(line) is None:
            size = f"it has {len(line)} bytes" if line else "it is not of such types"
            raise InvalidValueError(
                f"the outcome of a run cannot be stored in {show_path(self.path)}: {size}; "
                f"expected numbers and lists of them by name, at most {LONGEST_LINE} bytes, or one line of error"
            )
        with self._lock:
            place = self._file.seek(0, os.SEEK_END)
            separator = b"" if self._ended else b"\n"
            self._put(separator + line, place)
            self._ended = True
            self._late[bytes.fromhex(key)] = place + len(separator)
            if len(self._late) > max(1024, len(self._keys) // 8):
                self._sort_in()

    def outcome(self, key: str) -> Outcome | None:
        """Return the outcome of a run, None if it is not done."""
        with self._lock:
            place = self._place(key)
            if place is None:
                return None
            self._file.seek(place)
            entry = _entry(self._file.readline(LONGEST_LINE))
        if entry is None or entry[0] != key:
            raise InvalidValueError(f"{show_path(self.path)} changed while it was read; run the sweep again")
        return entry[1]

    def _put(self, line: bytes, place: int) -> None:
        """Write past the file's buffer, which would hold what a full disk refuses and try again when closed."""
        left = memoryview(line)
        with self._disk_errors_in_words():
            try:
                while left:
                    left = left[os.write(self._file.fileno(), left) :]
            except OSError:
                self._cut_to(place)
                raise
            with self._cut_back():
                self._syncing.begin(place)

    @contextmanager
    def _cut_back(self) -> Iterator[None]:
        """Cut a file that cannot be synced back to what the disk has: lines that it may lose would count as done."""
        try:
            yield
        except OSError:
            self._cut_to(self._syncing.safe or 0)
            raise

    def _cut_to(self, place: int) -> None:
        with suppress(OSError):  # a torn line is cut off when the ledger is next opened
            if place < os.path.getsize(self.path):
                os.truncate(self.path, place)
                self._read()

    @contextmanager
    def _disk_errors_in_words(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise InvalidValueError(
                f"{show_path(self.path)} cannot be written: {error.strerror}; earlier runs are stored, "
                "make room and sweep again"
            ) from None

    def _place(self, key: str) -> int | None:
        wanted = bytes.fromhex(key)
        if wanted in self._late:
            return self._late[wanted]
        index = np.searchsorted(self._keys, np.array([wanted], f"S{KEY_BYTES}"), side="right")[0] - 1
        # NumPy drops zeros at the end of such texts.
        if index < 0 or self._keys[index].ljust(KEY_BYTES, b"\0") != wanted:
            return None
        return int(self._places[index])

    def _read(self) -> None:
        keys, places = bytearray(), array("q")
        for place, (key, outcome) in self._entries():
            if not (self._retry_failed and outcome.error is not None):
                keys += bytes.fromhex(key)
                places.append(place)
        self._late: dict[bytes, int] = {}
        self._keys = np.frombuffer(bytes(keys), f"S{KEY_BYTES}")
        self._places = np.frombuffer(places, np.int64)
        self._order()

    def _entries(self) -> Iterator[tuple[int, tuple[str, Outcome]]]:
        """Yield where each good line begins and what it holds; refuse another file, and note a torn end."""
        known, torn, line, place = False, None, b"\n", 0
        self._file.seek(0)
        # A longer line than a ledger has comes in pieces, which are skipped.
        for piece in iter(partial(self._file.readline, LONGEST_LINE), b""):
            is_start, line = line.endswith(b"\n"), piece
            is_ours = is_start and BEGINNING.match(line) is not None
            entry = _entry(line) if is_ours else None
            if entry is not None and (self._fits is None or self._fits(entry[1])):
                yield place, entry
            torn = place if is_start and not line.endswith(b"\n") and _is_torn(line) else None
            known = known or is_ours or (torn == 0 and len(line) >= FEWEST_BYTES)
            place += len(line)
        if place and not known:
            raise InvalidValueError(
                f"{show_path(self.path)} is not a ledger of runs; move it away, or choose another folder"
            )
        self._ended, self._torn = line.endswith(b"\n"), torn

    def _cut(self) -> None:
        """Cut off a line that a kill tore apart."""
        if self._torn is not None:
            os.truncate(self.path, self._torn)
            self._ended = True

    def _sort_in(self) -> None:
        late = np.frombuffer(b"".join(self._late), f"S{KEY_BYTES}")
        self._keys = np.concatenate([self._keys, late])
        self._places = np.concatenate([self._places, np.fromiter(self._late.values(), np.int64)])
        self._late.clear()
        self._order()

    def _order(self) -> None:
        order = np.argsort(self._keys, kind="stable")  # of equal keys the last line stays last
        self._keys, self._places = self._keys[order], self._places[order]


def _opened(path: Path, read_only: bool) -> BinaryIO:
    """Return an open file; it is created unless it is only to be read."""
    try:
        if path.exists() and not path.is_file():  # reading from a pipe would never end
            raise InvalidValueError(f"{show_path(path)} is not a file; move it away, or choose another folder")
        if not read_only:
            path.parent.mkdir(parents=True, exist_ok=True)
        return open(path, "rb" if read_only else "a+b")
    except OSError as error:
        raise InvalidValueError(
            f"{show_path(path)} cannot be opened: {error.strerror}; choose another folder"
        ) from None


def _line(key: str, outcome: Outcome) -> bytes:
    """Return the line of an outcome, empty if part of it cannot be written."""
    try:
        text = json.dumps({"key": key, **outcome.stored()}, ensure_ascii=False).encode("utf-8", "backslashreplace")
    except (TypeError, ValueError, RecursionError):
        return b""
    return b"%08x %s\n" % (crc32(text), text)


def _is_torn(line: bytes) -> bool:
    """Return whether a line without an end begins as a ledger's do, as far as it goes."""
    missing = b'00000000 {"key": "'[len(line) :]
    return BEGINNING.match(line + missing) is not None


def _entry(line: bytes) -> tuple[str, Outcome] | None:
    """Return the key and the outcome in a line, None if it is torn, damaged or holds anything else."""
    checksum, _, text = line.rstrip(b"\n").partition(b" ")
    if not line.endswith(b"\n") or len(line) > LONGEST_LINE or checksum != b"%08x" % crc32(text):
        return None
    try:
        values = json.loads(text.decode())
    except (ValueError, RecursionError):
        return None
    if not isinstance(values, dict) or values.keys() - {ENDED_BY} != {"key", *STORED}:
        return None
    key = values.pop("key")
    outcome = Outcome(**values)
    return (key, outcome) if isinstance(key, str) and KEY.fullmatch(key) and _is_outcome(outcome) else None


def _is_outcome(outcome: Outcome) -> bool:
    """Return whether this is a possible outcome of a run: either results, or the error that ended it."""
    if type(outcome.steps) is not int or not 0 <= outcome.steps <= LARGEST_STEPS:
        return False
    if (outcome.results is None) == (outcome.error is None):
        return False
    if not all(text is None or _is_line(text) for text in (outcome.state_hash, outcome.error, outcome.ended_by)):
        return False
    results = outcome.results
    return results is None or (
        isinstance(results, dict) and all(map(_is_text, results)) and all(map(_is_number, results.values()))
    )


def _is_line(text: object) -> bool:
    return _is_text(text) and len(text) <= LONGEST_ERROR and len(text.splitlines()) <= 1


def _is_text(text: object) -> TypeGuard[str]:
    """Return whether this is a text that can be written: without half a pair of surrogates."""
    return isinstance(text, str) and not any("\ud800" <= letter <= "\udfff" for letter in text)


def _is_number(value: object, depth: int = DEEPEST) -> bool:
    """Return whether this is a number, None, or a list of them."""
    if isinstance(value, list):
        return depth > 0 and all(_is_number(each, depth - 1) for each in value)
    # Integers beyond the floats have no place in a table.
    return value is None or isinstance(value, float) or (isinstance(value, int) and abs(value) < sys.float_info.max)
