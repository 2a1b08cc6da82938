"""The recordings that the server offers: those of a folder, whatever they are called."""

import os
from contextlib import suppress
from pathlib import Path

import pyarrow as pa

from mesa_swarm.dashboard import RECORDINGS_VARIABLE

MOST_LISTED = 500
# Files of which it is remembered whether they are recordings.
MOST_KNOWN = 20_000
# Recordings begin with an Arrow schema, whose metadata have these names; a larger one is not looked into.
MESSAGE = b"\xff\xff\xff\xff"
METADATA = frozenset({b"format", b"model", b"parameters", b"versions"})
LARGEST_SCHEMA = 64_000_000


def recordings_place() -> Path | None:
    """Return the recording or the folder of recordings of the server, None without one."""
    place = os.environ.get(RECORDINGS_VARIABLE, "")
    return Path(place) if place else None


# Whether a file is a recording, by its path, time of change and size.
_KNOWN: dict[tuple[str, int, int], bool] = {}


def recordings_in(folder: Path) -> list[str]:
    """Return the names of the recordings in a folder, whatever they are called, the latest first."""
    files = []
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            with suppress(OSError):  # it may have been deleted meanwhile
                if entry.is_file() and not entry.name.startswith("."):
                    status = entry.stat()
                    files.append((-status.st_mtime_ns, entry.name, status.st_size))
    found: list[str] = []
    for time, name, size in sorted(files):
        key = str(folder / name), time, size
        if key not in _KNOWN:
            if len(_KNOWN) >= MOST_KNOWN:
                _KNOWN.clear()
            _KNOWN[key] = is_recording(folder / name)
        if _KNOWN[key]:
            found.append(name)
            if len(found) == MOST_LISTED:
                break
    return found


def is_recording(path: Path) -> bool:
    """Return whether a file begins as a recording does: with an Arrow schema that has its metadata.

    It may still be damaged, which is found when it is opened.
    """
    try:
        with path.open("rb") as file:
            begin = file.read(8)
            size = int.from_bytes(begin[4:], "little")
            if begin[:4] != MESSAGE or not 0 < size <= LARGEST_SCHEMA:
                return False
            schema = pa.ipc.read_schema(pa.py_buffer(begin + file.read(size)))
    except (OSError, pa.ArrowException, ValueError, MemoryError):
        return False
    return set(schema.metadata or ()) >= METADATA
