"""Policies as files, written whole and read without running code."""

import json
import math
import os
import struct
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any

import numpy as np

from mesa_swarm.base.errors import (
    InvalidValueError,
    LearningError,
    check_count,
    check_number,
    shortened,
    without_middle,
)
from mesa_swarm.base.files import draft_of, show_path
from mesa_swarm.learning.fire_learning import SkillPolicy
from mesa_swarm.learning.fire_wheels import FireWheelPolicy
from mesa_swarm.learning.policy import Policy, SensorLayout, check_policy
from mesa_swarm.learning.q_learning import QPolicy
from mesa_swarm.learning.reflex_policy import ReflexPolicy
from mesa_swarm.learning.table_learning import TablePolicy
from mesa_swarm.learning.wire_learning import WirePolicy
from mesa_swarm.robots.design import MOST_SENSORS

FORMAT = "mesa_swarm policy 1"
HEADER = "header"
# The families of policies that can be stored in files; those of robots at fires act by more than readings.
STORED: tuple[Any, ...] = (QPolicy, ReflexPolicy, WirePolicy, TablePolicy, SkillPolicy, FireWheelPolicy)
FAMILIES: dict[str, Any] = {family.family: family for family in STORED}
# A policy of 1,000 robots takes 13 MB.
LARGEST_BYTES = 1 << 27
# Saved policies stay below, since deflating noise makes it a little larger.
LARGEST_SAVED = LARGEST_BYTES - (LARGEST_BYTES >> 8)
LONGEST_HEADER = 1 << 20
MOST_ARRAYS = 64
# The end of a ZIP archive without a comment: sizes and places of its list of contents, which is read as a whole.
END, LARGEST_LIST = struct.Struct("<4s4H2LH"), 1 << 20


def save_policy(policy: Policy, path: str | os.PathLike[str]) -> Path:
    """Write a policy to a file, whole or not at all, and return its path.

    The file is NumPy's .npz without pickles: the arrays, and a header of JSON with the family, the sensors, the
    settings, and the policy's provenance.

    Parameters
    ----------
    policy : Policy
    path : str or Path
        Ends with .npz.

    Raises
    ------
    LearningError
        If the file cannot be written, its name ends otherwise, or `load_policy` would refuse it: it may have 133 MB,
        and holds finite numbers.
    InvalidValueError
        If `policy` is not a policy, or `path` not a path.

    Examples
    --------
    >>> import tempfile
    >>> from mesa_swarm import AGENT3
    >>> policy = QPolicy.untrained(AGENT3, rng=np.random.default_rng(1))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     load_policy(save_policy(policy, f"{folder}/mine.npz")).sensors == policy.sensors
    True
    """
    check_policy(policy, "arrays", "settings")
    file = file_at(path)
    if file.suffix != ".npz":
        raise LearningError(f"{file.name} does not end with .npz; give the policy such a name")
    header = {
        "format": FORMAT,
        "family": policy.family,
        "sensors": asdict(policy.sensors),
        "steps": policy.steps,
        "training": {"numpy": np.__version__, **policy.training},
        "settings": policy.settings(),
    }
    try:
        text = json.dumps(header, allow_nan=False, default=_number)
    except (TypeError, ValueError):
        raise LearningError("the policy's training may only hold texts and finite numbers; leave out others") from None
    # Any, as a type checker sees NumPy's own option among the names.
    contents: dict[str, Any] = {HEADER: np.frombuffer(text.encode(), np.uint8), **policy.arrays()}
    _check_contents(contents)
    with draft_of(file, LearningError, folders=False) as draft, draft.open("wb") as part:
        np.savez_compressed(part, **contents)
    return file


def load_policy(path: str | os.PathLike[str]) -> Policy:
    """Return the policy in a file.

    Raises
    ------
    LearningError
        If the file is missing, damaged, hostile, or not a policy.
    """
    file = file_at(path)
    try:
        _check_list(file)
        with zipfile.ZipFile(file) as archive:
            _check_members(file, archive)
        with np.load(file, allow_pickle=False) as archive_arrays:
            arrays = {name: archive_arrays[name] for name in archive_arrays.files}
    except FileNotFoundError:
        raise LearningError(f"there is no policy {show_path(file)}; save one with save_policy") from None
    except LearningError:
        raise
    except OSError as error:
        raise LearningError(f"{show_path(file)} cannot be read: {error.strerror or error}") from None
    except Exception as error:  # zip, zlib and NumPy raise many kinds
        raise _refusal(file, f"it is damaged ({type(error).__name__})") from None
    return _policy_of(file, _header_of(file, arrays), arrays)


def file_at(path: str | os.PathLike[str]) -> Path:
    """Return a path that a user gave."""
    try:
        return Path(path)
    except TypeError:
        raise InvalidValueError(f"path is {shortened(path)}; expected a text or Path") from None


def _check_contents(contents: dict[str, np.ndarray]) -> None:
    """Check that `load_policy` would accept the contents."""
    size = sum(array.nbytes for array in contents.values())
    if size > LARGEST_SAVED:
        raise LearningError(
            f"the policy has {size:,} bytes, more than the {LARGEST_SAVED:,} of a file; save one of fewer robots"
        )
    if contents[HEADER].size > LONGEST_HEADER:
        raise LearningError(
            f"the policy's training and settings take {contents[HEADER].size:,} bytes as JSON, more than the "
            f"{LONGEST_HEADER:,} of a file; shorten the training"
        )
    for name, array in contents.items():
        if not np.isfinite(array).all():
            raise LearningError(f"the policy's {shortened(name)} is not finite; learn with a lower rate")


def _number(value: object) -> float:
    """Return one of NumPy's numbers as Python's, for JSON."""
    for kind, plain in ((np.floating, float), (np.integer, int), (np.bool_, bool)):
        if isinstance(value, kind):
            return plain(value)
    raise TypeError


def _policy_of(file: Path, header: dict, arrays: dict[str, np.ndarray]) -> Policy:
    family = header.get("family")
    if not isinstance(family, str) or family not in FAMILIES:
        raise _refusal(file, f"its family is {shortened(family)}; known: {', '.join(FAMILIES)}")
    for name, array in arrays.items():
        if not isinstance(array, np.ndarray) or array.dtype != np.float64 or not np.isfinite(array).all():
            raise _refusal(file, f"its {shortened(name)} holds other values than finite float64 numbers")
    try:
        sensors = stored_sensors(header["sensors"])
        steps = check_count("steps", header["steps"], maximum=2**62)
        training, settings = header["training"], header["settings"]
        if not isinstance(training, dict) or not isinstance(settings, dict):
            raise TypeError
        return FAMILIES[family].restored(sensors, steps, training, settings, arrays)
    except (KeyError, TypeError) as error:
        raise _refusal(file, f"its header is incomplete ({type(error).__name__})") from None
    except (ArithmeticError, AttributeError, LookupError, ValueError) as error:
        raise _refusal(file, str(error) or type(error).__name__) from None


def stored_sensors(rows: dict) -> SensorLayout:
    """Return the sensors that a header describes, or raise a TypeError, LookupError or ValueError."""
    names = ("bearings", "ranges", "fields_of_view")
    for name in names:
        if not isinstance(rows[name], list) or len(rows[name]) > MOST_SENSORS:
            raise ValueError(f"its {name} are not a list of at most {MOST_SENSORS} numbers")
    layout = SensorLayout(*(tuple(check_number(name, v) for v in rows[name]) for name in names))
    if len({len(rows[name]) for name in names}) > 1:
        raise ValueError("its bearings, ranges and fields of view differ in number")
    return layout


def _header_of(file: Path, arrays: dict[str, np.ndarray]) -> dict:
    raw = arrays.pop(HEADER, None)
    if not isinstance(raw, np.ndarray) or raw.dtype != np.uint8 or raw.ndim != 1 or raw.size > LONGEST_HEADER:
        raise _refusal(file, "it has no header")
    try:
        header = json.loads(raw.tobytes())
    except (ValueError, RecursionError):
        raise _refusal(file, "its header is not JSON") from None
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise _refusal(file, f"its format is not {FORMAT!r}")
    return header


def _check_members(file: Path, archive: zipfile.ZipFile) -> None:
    """Check sizes before anything is unpacked."""
    members = archive.infolist()
    if len(members) > MOST_ARRAYS or sum(member.file_size for member in members) > LARGEST_BYTES:
        raise _refusal(file, f"it unpacks to more than {MOST_ARRAYS} arrays or {LARGEST_BYTES >> 20} MB")
    if len({member.filename for member in members}) < len(members):
        raise _refusal(file, "it holds two arrays of the same name")
    for member in members:
        with archive.open(member) as part:
            _check_shape(file, part, member.file_size)


def _check_list(file: Path) -> None:
    """Check that it is a file, not too large, and its list of contents not too long."""
    if why := unreadable_archive(file, LARGEST_BYTES):
        raise _refusal(file, f"{why}, or not an .npz file" if "damaged" in why else why)


def unreadable_archive(file: Path, largest: int) -> str:
    """Return why a ZIP archive cannot be opened: it has more bytes than these, or a list that is damaged or too long.

    The list of contents is read as a whole when an archive is opened. "" is returned if it can be.
    """
    size = file.stat().st_size
    if not file.is_file():
        raise LearningError(f"{show_path(file)} cannot be read: it is a folder or device; expected a file")
    if size > largest:
        return f"it unpacks to more than {largest >> 20} MB"
    with file.open("rb") as content:
        content.seek(max(size - END.size, 0))
        end = content.read(END.size)
    is_list = len(end) == END.size and end.startswith(b"PK\5\6") and END.unpack(end)[5] <= LARGEST_LIST
    return "" if is_list else "it is damaged"


def _check_shape(file: Path, part: IO[bytes], size: int) -> None:
    """Refuse an array that claims to be larger than the file, before memory is allocated for it."""
    version = np.lib.format.read_magic(part)
    read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[version]
    shape, _, dtype = read(part)
    if math.prod(shape) * max(dtype.itemsize, 1) > size:
        raise _refusal(file, f"it holds an array of shape {shortened(shape)}, which is larger than the file")


def _refusal(file: Path, why: str) -> LearningError:
    text = f"{show_path(file)} is not a usable policy: {' '.join(why.split())}"
    return LearningError(without_middle(text))
