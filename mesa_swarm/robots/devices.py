"""What sensors and actuators have in common: a name, a width, and a function of arrays that is compiled."""

import inspect
import keyword
import re
import warnings
from collections.abc import Callable, Container, Iterable, Mapping
from difflib import get_close_matches
from functools import cache
from itertools import pairwise
from typing import Any

from mesa_swarm.base.errors import (
    InvalidValueError,
    UncompiledBehaviourWarning,
    UnknownKindWarning,
    check_count,
    read_attribute,
    shortened,
)
from mesa_swarm.kernels.custom_code import rename_function, store_on_disk
from mesa_swarm.kernels.custom_functions import VERSION, compile_custom, is_refused
from mesa_swarm.kernels.digests import digest_function

MOST_NUMBERS = 10_000
# How similar a kind is at least to a known one that it misspells: "pukc" and "puck" are 0.75, "food" and "load" 0.5.
ALIKE = 0.7
# Names that a robot, a swarm, a rule's `me` or a row of a recording has already, see `reserve_names`; and those of what
# functions of arrays take.
OF_FUNCTIONS = ("obstacles", "out", "owners", "rows", "value")
RESERVED = set(OF_FUNCTIONS)


def reserve_names(names: Iterable[str]) -> None:
    """Reserve public names, so that no custom sensor can have them; called where they are declared."""
    RESERVED.update(name for name in names if not name.startswith("_"))


class Device:
    """What a sensor and an actuator are: named numbers of every robot that has one.

    Attributes
    ----------
    name : str
        The word by which rules, columns and recordings call its numbers.
    width : int
        How many numbers one of them has, at least 1.
    """

    __slots__ = ()

    name: Any = ""
    width: Any = 1

    def arguments(self, model: Any) -> Mapping[str, Any]:
        """Return further arrays and numbers by name, which its function may take; called before each use."""
        return {}

    def check_model(self, model: Any) -> None:
        """Raise an error if a model lacks what the device needs, such as a field; called before robots are added."""

    def check_bodies(self, model: Any) -> None:
        """Raise an error if a model lacks what may be added after robots, such as a kind; called before they read."""


def check_spelling(model: Any, kind: str) -> None:
    """Refuse a kind of bodies that the model knows but for its spelling; any other may come later.

    Raises
    ------
    UnknownNameError
    """
    if kind not in model.kinds and get_close_matches(kind, model.kinds, n=1, cutoff=ALIKE):
        model.kind_code(kind)


def check_kind(model: Any, device: Device, kind: str) -> None:
    """Refuse a kind of bodies that the model knows but for its spelling, and warn of any other that it does not know.

    Bodies may come later, or not at all in a run; `SwarmModel.add_kind` declares their kind.
    """
    check_spelling(model, kind)
    if kind in model.kinds:
        return
    warnings.warn(
        f"a {type(device).__name__} is for the kind {kind!r}, of which the model has no body; if this is meant, "
        f"declare it by model.add_kind({kind!r})",
        UnknownKindWarning,
        stacklevel=2,
    )


def check_identifier(what: str, name: object, taken_names: Container[str] = ()) -> str:
    """Return a name that can be written after a dot, as in ``me.compass``, and is not taken.

    Raises
    ------
    InvalidValueError
    """
    if not isinstance(name, str) or not name.isidentifier() or keyword.iskeyword(name) or name.startswith("_"):
        raise InvalidValueError(f"{what} is {shortened(name)}; expected one word of letters, such as 'compass'")
    if name in taken_names:
        raise InvalidValueError(f"{what} is {name!r}, which robots have already; choose another name")
    return name


def check_device(what: str, device: Any, function: str, taken_names: Container[str] = ()) -> None:
    """Refuse a sensor or actuator whose name, width or function cannot be used; `function` is the name of its own.

    Raises
    ------
    InvalidValueError
    """
    kind = type(device).__name__
    check_identifier(f"name of {what} {kind}", read_attribute(device, "name"), taken_names)
    check_count(f"width of {what} {kind}", read_attribute(device, "width"), minimum=1, maximum=MOST_NUMBERS)
    try:
        hash(device)
    except Exception:  # of a class of the user's
        raise InvalidValueError(
            f"{what} {kind} cannot be hashed; make its class with @dataclass(frozen=True, kw_only=True), "
            "and its fields numbers, texts or tuples"
        ) from None
    if own_function(device, function) is not None:
        argument_names(own_function(device, function), f"{kind}.{function}")


def own_function(device: Any, name: str) -> Callable | None:
    """Return a device's function of arrays as it was written, None without one."""
    value = inspect.getattr_static(type(device), name, None)
    if isinstance(value, staticmethod):
        return value.__func__
    if value is None or hasattr(value, "py_func"):
        return value
    raise InvalidValueError(f"{type(device).__name__}.{name} is {shortened(value)}; expected a @staticmethod of arrays")


def argument_names(function: Any, what: str = "") -> tuple[str, ...]:
    """Return the names of what a function of arrays takes.

    Raises
    ------
    InvalidValueError
        If it takes anything else than named parameters without defaults.
    """
    try:
        parameters = list(inspect.signature(getattr(function, "py_func", function)).parameters.values())
    except (TypeError, ValueError):
        raise InvalidValueError(f"{what} is {shortened(function)}; expected a function of arrays") from None
    for parameter in parameters:
        if parameter.kind is not parameter.POSITIONAL_OR_KEYWORD or parameter.default is not parameter.empty:
            raise InvalidValueError(f"{what} has the parameter {parameter}; expected plain names, such as heading")
    return tuple(parameter.name for parameter in parameters)


class DeviceFunction:
    """A function of arrays, compiled when first used; one that cannot be is run as plain Python, with a warning."""

    def __init__(self, function: Any) -> None:
        self.function = getattr(function, "py_func", function)
        self.takes = argument_names(function)
        self._run: Any = _compiled(function) if self.function is function else function

    def __call__(self, *values: Any) -> None:
        """Call it with the values of the names that it takes, in their order."""
        try:
            self._run(*values)
        except Exception as error:
            if self._run is self.function or not is_refused(self._run, values):
                raise
            warn_of_plain(self.function, self.function.__qualname__, str(error) or type(error).__name__)
            self._run = self.function
            self._run(*values)


def warn_of_plain(function: Any, subject: str, problem: str, more: str = "") -> None:
    """Warn, at its first line, that a user's function is not compiled because of a problem that Numba explains."""
    text = f"{subject} cannot be compiled and runs as plain Python, about 100 times slower: {extract_reason(problem)}"
    code = function.__code__
    warnings.warn_explicit(f"{text}{more}", UncompiledBehaviourWarning, code.co_filename, code.co_firstlineno)


def _compiled(function: Any) -> Any:
    digest = digest_function(function, VERSION)
    return store_on_disk(compile_custom(rename_function(function, digest)), digest)


@cache
def device_function_of(function: Any) -> DeviceFunction:
    """Return what is made of a function, always the same object, so that it is compiled once."""
    return DeviceFunction(function)


def extract_reason(problem: str) -> str:
    """Return the most specific line of Numba's explanation, and the line of the code that it is about."""
    lines = [line.strip() for line in problem.splitlines()]
    lines = [line for line in lines if line and not line.startswith("Failed in nopython")]
    inner = [after for before, after in pairwise(lines) if before.startswith("Rejected as")]
    place = re.search(r'^File ".*", (line \d+)', problem, re.MULTILINE)
    line = (inner or lines or ["no reason is known"])[0]
    return f"{line[:200]} ({place[1]})" if place else line[:200]
