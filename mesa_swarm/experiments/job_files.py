"""The files that a job names, all of them in its folder: maps to read, recordings to write."""

import re
from pathlib import Path, PurePosixPath, PureWindowsPath

from mesa_swarm.errors import InvalidValueError, shortened

SUFFIX = ".arrow"
# No part of a recording's name may mean more than a name on some system: hidden files, options, streams, devices.
PART = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_+=,.-]{0,99}")
DEVICE = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def file_within(folder: Path, name: str) -> Path:
    """Return a file that a job names if it lies in the job's folder, and is reached by no link.

    Parameters
    ----------
    folder : Path
        Of the job file.
    name : str
        Relative to the folder.

    Raises
    ------
    InvalidValueError
        If it leads elsewhere, or might.

    Examples
    --------
    >>> file_within(Path("/jobs"), "maps/hall.toml").as_posix()
    '/jobs/maps/hall.toml'
    >>> file_within(Path("/jobs"), "../hall.toml")
    Traceback (most recent call last):
    mesa_swarm.errors.InvalidValueError: '../hall.toml' leads out of the job's folder; put the file into it
    """
    parts = PurePosixPath(name).parts
    windows = PureWindowsPath(name)
    if name.startswith("/") or windows.drive or windows.root or ".." in (*parts, *windows.parts):
        raise InvalidValueError(f"{shortened(name)} leads out of the job's folder; put the file into it")
    path = folder
    for part in parts:
        path = path / part
        if _is_link(path):
            raise InvalidValueError(f"{shortened(name)} is reached by a link; put the file itself there")
    return path


def recording_within(folder: Path, name: str) -> Path:
    """Return a file to record to if it lies in the job's folder and has a name that is plain on every system.

    Raises
    ------
    InvalidValueError
        If it leads elsewhere, is a device, or could be taken for another kind of file.

    Examples
    --------
    >>> recording_within(Path("/jobs"), "runs/1.arrow").as_posix()
    '/jobs/runs/1.arrow'
    >>> recording_within(Path("/jobs"), "nul.arrow")
    Traceback (most recent call last):
    mesa_swarm.errors.InvalidValueError: 'nul.arrow' is the name of a device; choose another
    """
    path = file_within(folder, name)
    for part in PurePosixPath(name).parts:
        if DEVICE.fullmatch(part):
            raise InvalidValueError(f"{shortened(name)} is the name of a device; choose another")
        if not PART.fullmatch(part) or part.endswith("."):
            wanted = "letters, digits and _+=,.- between slashes, with no dot or dash before or dot after"
            raise InvalidValueError(f"{shortened(name)} is no name for a recording; expected {wanted}")
    if path.suffix != SUFFIX:
        raise InvalidValueError(f"{shortened(name)} does not end in {SUFFIX}, as recordings do; add it")
    return path


def _is_link(path: Path) -> bool:
    try:
        return path.is_symlink() or path.is_junction() if hasattr(path, "is_junction") else path.is_symlink()
    except (OSError, ValueError):  # a name too long for the system, or with a null byte: it is no file either
        return False
