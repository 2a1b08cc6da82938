"""An append-only ledger of finished runs: what it has taken survives a kill and a power cut."""

import json
import os
from array import array
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from threading import Lock
from typing import Self
from zlib import crc32

import numpy as np

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.experiments.experiment import Outcome

try:
    import fcntl
except ModuleNotFoundError:  # on Windows
    fcntl = None  # type: ignore[assignment]  # what is missing is asked for by its name

KEY_BYTES = 16


class Ledger:
    """A file with one line a finished run: checksum, key, outcome.

    A line is written in one piece and synced to the disk before anybody is told that the run is done. A line that
    a kill tore apart is cut off when the ledger is opened again; one that the disk spoilt fails its checksum and
    counts as never written. Of two lines with one key the last counts. One process at a time may write.

    Memory grows by 24 bytes a run: its key, and where its line begins.

    Parameters
    ----------
    path : Path
        Created if it is missing.
    retry_failed : bool
        Whether runs that ended in an error count as not done.

    Raises
    ------
    InvalidValueError
        If another process writes to it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as home, Ledger(Path(home) / "ledger.jsonl") as ledger:
    ...     ledger.append("0" * 32, Outcome(steps=5, state_hash="", results={"groups": 2.0}))
    ...     ledger.outcome("0" * 32).results, "f" * 32 in ledger
    ({'groups': 2.0}, False)
    """

    def __init__(self, path: Path, *, retry_failed: bool = False) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._lock = Lock()  # joblib asks what is left in a thread of its own
        self._file = open(path, "a+b")  # noqa: SIM115 - closed by close
        try:
            self._keep_others_out()
            self._read(retry_failed)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *reason: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file, and let others write."""
        self._file.close()

    def __contains__(self, key: str) -> bool:
        """Whether this run is done."""
        with self._lock:
            return self._place(key) is not None

    def append(self, key: str, outcome: Outcome) -> None:
        """Write down what came of a run, and wait until the disk has it.

        Raises
        ------
        InvalidValueError
            If the disk does not take it. Nothing of it is left then.
        """
        text = json.dumps({"key": key, **asdict(outcome)}, ensure_ascii=False).encode()
        with self._lock:
            place = self._file.seek(0, os.SEEK_END)
            self._put(b"%08x %s\n" % (crc32(text), text), place)
            self._late[bytes.fromhex(key)] = place
            if len(self._late) > max(1024, len(self._keys) // 8):
                self._sort_in()

    def outcome(self, key: str) -> Outcome | None:
        """Return what came of a run, None if it is not done."""
        with self._lock:
            place = self._place(key)
            if place is None:
                return None
            self._file.seek(place)
            kept = _entry(self._file.readline())
        if kept is None:
            raise InvalidValueError(f"{self.path} was changed while it was read; run the sweep again")
        return Outcome(**{name: value for name, value in kept.items() if name != "key"})

    def _put(self, line: bytes, place: int) -> None:
        """Write past the file's buffer, which would keep what the disk does not take and try again when closed."""
        left = memoryview(line)
        try:
            while left:
                left = left[os.write(self._file.fileno(), left) :]
            os.fsync(self._file.fileno())
        except OSError as error:
            with suppress(OSError):  # a torn line is cut off when the ledger is next opened
                os.truncate(self.path, place)
            raise InvalidValueError(
                f"{self.path} cannot be written: {error.strerror}; runs before are kept, make room and sweep again"
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

    def _read(self, retry_failed: bool) -> None:
        keys, places = bytearray(), array("q")
        for place, kept in self._entries():
            if retry_failed and kept["error"] is not None:
                continue
            keys += bytes.fromhex(kept["key"])
            places.append(place)
        self._late: dict[bytes, int] = {}
        self._keys = np.frombuffer(bytes(keys), f"S{KEY_BYTES}")
        self._places = np.frombuffer(places, np.int64)
        self._order()

    def _entries(self) -> Iterator[tuple[int, dict]]:
        """Yield where each good line begins and what it says, and cut off a torn end."""
        self._file.seek(0)
        place = 0
        for line in self._file:
            kept = _entry(line)
            if kept is not None:
                yield place, kept
            elif not line.endswith(b"\n"):
                os.truncate(self.path, place)
                return
            place += len(line)

    def _sort_in(self) -> None:
        late = np.frombuffer(b"".join(self._late), f"S{KEY_BYTES}")
        self._keys = np.concatenate([self._keys, late])
        self._places = np.concatenate([self._places, np.fromiter(self._late.values(), np.int64)])
        self._late.clear()
        self._order()

    def _order(self) -> None:
        order = np.argsort(self._keys, kind="stable")  # of equal keys the last line stays last
        self._keys, self._places = self._keys[order], self._places[order]

    def _keep_others_out(self) -> None:
        if fcntl is None:
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InvalidValueError(
                f"{self.path} is being written by another sweep; wait for it or choose another folder"
            ) from None


def _entry(line: bytes) -> dict | None:
    """Return what a line says, None if it is torn or spoilt."""
    checksum, _, text = line.rstrip(b"\n").partition(b" ")
    if not line.endswith(b"\n") or checksum != b"%08x" % crc32(text):
        return None
    return json.loads(text)
