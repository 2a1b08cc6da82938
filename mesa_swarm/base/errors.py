"""Errors that a user can cause, and the checks that raise them.

A value is checked once, at the border, and refused in one line: what was got, what was expected, what to do.
Inner code trusts what has passed the border.
"""

import math
import os
import re
import sysconfig
import traceback
from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from functools import cache
from numbers import Integral
from pathlib import Path
from typing import Any

__all__ = [
    "BehaviourError",
    "DegreesWarning",
    "ExportError",
    "ExportWarning",
    "FireConstantsWarning",
    "InvalidValueError",
    "JobError",
    "LearningError",
    "MapError",
    "MapWarning",
    "PlacementError",
    "RecordingError",
    "RemovedRobotError",
    "StepWarning",
    "SwarmError",
    "UncompiledBehaviourWarning",
    "UnknownKindWarning",
    "UnknownNameError",
    "UnobservedStepError",
    "UnstoredStateWarning",
    "check_choice",
    "check_count",
    "check_flag",
    "check_name",
    "check_number",
    "shortened",
]

# Larger arrays are shown as NumPy abbreviates them.
MOST_SHOWN = 20
LONGEST_NAME = 100
LONGEST = 300
# A line of a traceback that came from another process as text.
REMOTE = re.compile(r'^  File "(.+)", line (\d+)', re.MULTILINE)
# How Jupyter names the folder of the files that it takes the cells of a notebook for.
CELLS = "ipykernel_"


class SwarmError(Exception):
    """Base of every error that mesa_swarm raises on purpose."""


class InvalidValueError(SwarmError, ValueError):
    """A value is outside what the named parameter permits."""


class UnknownNameError(SwarmError, ValueError):
    """A name is not one of the known ones; the nearest is suggested."""


class PlacementError(SwarmError, ValueError):
    """The robots do not fit; the message names how many would."""


class MapError(SwarmError, ValueError):
    """A map file cannot be read; the message names the file and the place."""


class JobError(SwarmError, ValueError):
    """A job file cannot be read or run; the message names the file and the place."""


class RecordingError(SwarmError, RuntimeError):
    """A recording cannot be written, read or run again; the message names the file.

    Recordings come from anywhere: whatever one contains, the message is one line of at most 300 characters.
    """

    def __init__(self, message: str = "") -> None:
        super().__init__(without_middle(" ".join(message.splitlines())))


class ExportError(SwarmError, RuntimeError):
    """A picture, film, page or table of a recording cannot be written; the message names the file."""


class UnobservedStepError(SwarmError, RuntimeError):
    """A step was taken in a way in which observers, such as a recorder, would miss it."""


class RemovedRobotError(SwarmError, RuntimeError):
    """A handle was used after its robot, obstacle or fire was removed."""


class BehaviourError(SwarmError, RuntimeError):
    """A rule returned something else than finite wheel speeds."""


class LearningError(SwarmError, RuntimeError):
    """A policy is unusable, or nothing was learned yet."""


class UncompiledBehaviourWarning(UserWarning):
    """A rule could not be compiled and runs as plain Python."""


class UnstoredStateWarning(UserWarning):
    """A model is recorded without checkpoints; the message names what cannot be stored."""


class StepWarning(UserWarning):
    """A step of a custom class omits the model's own step, or collects what is collected already."""


class UnknownKindWarning(UserWarning):
    """A sensor or a gripper is for a kind of bodies that the model does not know, nor one with a similar name."""


class DegreesWarning(UserWarning):
    """Headings are larger than radians usually are: probably degrees."""


class MapWarning(UserWarning):
    """A map file is read, though a bracket is missing; the message names the file, the line and what was assumed."""


class ExportWarning(UserWarning):
    """An export shows less than the run."""


class FireConstantsWarning(UserWarning):
    """Required fire properties contradict each other or make the task trivial or impossible."""


def error_line(error: BaseException) -> str:
    """Return one printable line of at most 300 characters about any error: ours as they are, others by name."""
    try:
        text = " ".join(str(error).split())
    except Exception:  # of a class of the user's
        text = ""
    if not text or not isinstance(error, SwarmError):
        text = f"{type(error).__name__}: {text}".removesuffix(": ")
    # A file's name may hold what ends a text or turns its direction.
    return without_middle("".join(letter if letter.isprintable() else "\ufffd" for letter in text))


def locate_error(error: BaseException) -> str:
    """Return the line of `error_line`, and before it the place in a user's code where the error arose, if it did there.

    Examples
    --------
    >>> locate_error(ValueError("n is 0"))  # which was not raised
    'ValueError: n is 0'
    """
    words, place = error_line(error), place_of_error(error)
    return words if not place or f"{place}: " in words else without_middle(f"{place}: {words}")


def place_of_error(error: BaseException) -> str:
    """Return file and line of the innermost call in a user's code, such as "mine.py, line 12"; empty if there is none.

    A user's code is neither part of mesa_swarm nor of Python, nor installed, unless it imports mesa_swarm itself. The
    place of an error that was caused by another is that of its cause. Of one that came from another process, and lost
    its calls on the way, the text of its traceback is read.
    """
    for cause in reversed(_causes(error)):
        if isinstance(cause, SyntaxError) and cause.filename:
            return _as_place(cause.filename, cause.lineno)
        if places := [place for place in _calls(cause) if place is not None]:
            return _as_place(*places[-1])
    return ""


def _causes(error: BaseException) -> list[BaseException]:
    """Return an error, what it was raised from, and so on."""
    causes: list[BaseException] = []
    cause: BaseException | None = error
    while cause is not None and cause not in causes:
        causes.append(cause)
        cause = cause.__cause__
    return causes


def _calls(error: BaseException) -> Iterator[tuple[str, int] | None]:
    """Yield file and line of each call that led to an error, None for calls in other code than a user's."""
    if type(error).__name__ == "_RemoteTraceback":  # by which another process sends its traceback as text
        for file, line in REMOTE.findall(str(error)):
            yield (file, int(line)) if _is_users(file) else None
    for frame, line in traceback.walk_tb(error.__traceback__):
        file = frame.f_code.co_filename
        yield (file, line) if _is_users(file) or (_is_installed(file) and _uses_us(frame.f_globals)) else None


def _as_place(file: str, line: int | None) -> str:
    path = Path(file)
    is_cell = path.parent.name.startswith(CELLS) or file.startswith("<ipython-input")
    return f"{'cell of the notebook' if is_cell else path.name}, line {line}"


def _is_users(file: str) -> bool:
    if file.startswith("<"):  # made while the program runs
        return file.startswith(("<stdin", "<ipython-input"))
    return not (_is_installed(file) or Path(file).is_relative_to(_standard_library()) or _is_ours(file))


def _is_installed(file: str) -> bool:
    return not {"site-packages", "dist-packages"}.isdisjoint(Path(file).parts) and not _is_ours(file)


def _is_ours(file: str) -> bool:
    return any(Path(file).is_relative_to(folder) for folder in _our_folders())


def _uses_us(names: dict[str, Any]) -> bool:
    """Return whether a module has anything of mesa_swarm's among its names."""
    values, read = list(names.values()), read_attribute
    origins = (read(value, "__module__", "") or read(value, "__name__", "") for value in values)
    return any(isinstance(origin, str) and origin.partition(".")[0] == "mesa_swarm" for origin in origins)


@cache
def _standard_library() -> str:
    return sysconfig.get_paths()["stdlib"]


@cache
def _our_folders() -> tuple[str, ...]:
    """Return the folders of the package, its models and studies, which lie elsewhere in an editable installation."""
    here = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    return here, *(os.path.realpath(os.path.join(here, name)) for name in ("models", "../mesa_swarm_studies"))


def without_middle(line: str, longest: int = LONGEST) -> str:
    """Return a line without its middle if it is too long: an error begins with what it is and ends with the cure."""
    return line if len(line) <= longest else f"{line[: longest // 2 - 5]} ... {line[-longest // 2 :]}"


def check_number(
    name: str, value: object, *, minimum: float = -math.inf, maximum: float = math.inf, above: float = -math.inf
) -> float:
    """Return any real number, NumPy's included, as a float if it is finite and permitted; `above` is exclusive."""
    return _check_real(name, value, minimum, maximum, above, "a finite number")


def _check_real(name: str, value: object, minimum: float, maximum: float, above: float, what: str) -> float:
    if type(value) is float and minimum <= value <= maximum and value > above and math.isfinite(value):
        return value  # as a rule: composing the text below takes longer than all else
    expectation = _range_in_words(what, minimum, maximum, above)
    try:
        # Arrays of one number would be taken for it, with a warning.
        if isinstance(value, (bool, str, bytes, bytearray)) or getattr(value, "ndim", 0) != 0:
            raise TypeError
        number = float(value)  # type: ignore[arg-type]
    except Exception:  # a class of the user's may raise anything
        raise InvalidValueError(f"{name} is {shortened(value)}; expected {expectation}") from None
    if not (math.isfinite(number) and minimum <= number <= maximum and number > above):
        raise InvalidValueError(f"{name} is {number:g}; expected {expectation}")
    return number


def check_count(name: str, value: object, *, minimum: int = 0, maximum: int = 2**31 - 1) -> int:
    """Return `value` as an int if it is a permitted count."""
    if isinstance(value, Integral) and not isinstance(value, bool):  # a float would not be exact from 2**53 on
        number: float = int(value)
        permitted = minimum <= number <= maximum
    else:
        number = _check_real(name, value, minimum, maximum, -math.inf, "a whole number")
        permitted = number == int(number)
    if not permitted:
        expectation = _range_in_words("a whole number", minimum, maximum, -math.inf)
        raise InvalidValueError(f"{name} is {shortened(value)}; expected {expectation}")
    return int(number)


def check_choice(name: str, value: object, choices: Iterable[str]) -> str:
    """Return `value` if it is one of `choices`, else suggest the nearest."""
    names = list(choices)
    if isinstance(value, str) and value in names:
        return value
    raise UnknownNameError(unknown_name(name, value, names))


def check_name(name: str, value: object) -> str:
    """Return `value` if it can be a name in messages, files and pictures: one short line of text."""
    if isinstance(value, str) and value.isprintable() and 1 <= len(value) <= LONGEST_NAME:
        return value
    raise InvalidValueError(
        f"{name} is {shortened(value)}; expected one line of text, at most {LONGEST_NAME} characters"
    )


def check_flag(name: str, value: object) -> bool:
    """Return `value` as a bool; anything else is refused, for "no" would count as True."""
    # By the names of NumPy's own, which nothing is imported for here.
    if type(value).__name__ in ("bool", "bool_"):
        return bool(value)
    raise InvalidValueError(f"{name} is {shortened(value)}; expected True or False")


def unknown_name(what: str, value: object, known_names: Iterable[str], *, beside: int = 0) -> str:
    """Return one sentence about an unknown name, with the nearest known one.

    Known names are listed as far as a message of 300 characters has room, with `beside` characters of other text.
    """
    names = list(known_names)
    hint = f"did you mean {near!r}? " if (near := _nearest(value, names)) else ""
    begin = f"unknown {what} {shortened(value)}; {hint}known: "
    room = LONGEST - beside - len(begin)
    listing = ", ".join(names)
    while len(listing) > room and names:
        names.pop()
        listing = ", ".join([*names, "..."])
    return begin + listing


def _nearest(value: object, names: list[str]) -> str:
    """Return the known name that is most like another one, in any case, or an empty text."""
    text = value[:80] if isinstance(value, str) else shortened(value)
    if near := get_close_matches(text, names, n=1, cutoff=0.5):
        return near[0]
    by_folded = {name.casefold(): name for name in reversed(names)}
    near = get_close_matches(text.casefold(), by_folded, n=1, cutoff=0.5)
    return by_folded[near[0]] if near else ""


def read_attribute(value: object, name: str, default: Any = None) -> Any:
    """Return an attribute of a user's object, or the default where it is missing or raises an error."""
    try:
        return getattr(value, name, default)
    except Exception:  # of a class of the user's
        return default


def _range_in_words(what: str, minimum: float, maximum: float, above: float) -> str:
    if above > -math.inf:
        lower = f"above {_format_limit(above)}"
    elif minimum > -math.inf:
        lower = f"at least {_format_limit(minimum)}"
    else:
        lower = ""
    upper = f"at most {_format_limit(maximum)}" if maximum < math.inf else ""
    limits = " and ".join(part for part in (lower, upper) if part)
    return f"{what} {limits}".rstrip()


def _format_limit(limit: float) -> str:
    return str(limit) if isinstance(limit, int) else f"{limit:g}"


def shortened(value: object) -> str:
    """Return a value on one line of at most 80 characters, NumPy's numbers and paths as plain ones."""
    if isinstance(value, (str, bytes)):
        value = value[:80]
    try:
        if 0 < getattr(value, "size", 0) <= MOST_SHOWN:
            value = value.tolist()  # type: ignore[attr-defined]
        text = re.sub(r"\b(?:np\.\w+|PosixPath|WindowsPath)\(([^()]*)\)", r"\1", repr(value))
    except (ValueError, RecursionError):  # Python refuses to write integers of more than 4300 digits
        text = f"a huge {type(value).__name__}"
    except Exception:  # of a class of the user's, or lists within lists without end
        text = f"a {type(value).__name__}"
    text = " ".join(text.split())
    return text if len(text) <= 80 else text[:77] + "..."
