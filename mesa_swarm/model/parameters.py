"""Parameters of a model: their types, and the ranges and choices that a model declares beside them."""

import inspect
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from mesa_swarm.base.errors import (
    InvalidValueError,
    UnknownNameError,
    check_choice,
    check_count,
    check_number,
    shortened,
    unknown_name,
)
from mesa_swarm.base.files import check_present_format
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.maps.map import READABLE, Map, builtin_name

LARGEST_WHOLE = 10**9
YES_NO = ("no", "yes")


def is_yes(name: str, answer: str | bool) -> bool:
    """Return whether it is yes; sweeps and scripts may pass True and False."""
    return bool(answer) if isinstance(answer, bool | np.bool_) else check_choice(name, answer, YES_NO) == "yes"


@dataclass(frozen=True, slots=True)
class Slider:
    """Range of a number for sliders.

    Parameters
    ----------
    minimum, maximum : float
    step : float
        Of the slider; a whole number for whole numbers.
    help : str
        One line: what it is, with its unit.

    Examples
    --------
    >>> Slider(1, 50, 1, "robots").maximum
    50
    """

    minimum: float
    maximum: float
    step: float
    help: str = ""


@dataclass(frozen=True, slots=True)
class Choice:
    """The names that a parameter may have; a `map` may also be a file.

    Examples
    --------
    >>> Choice(("A", "B"), "strategy").options
    ('A', 'B')
    """

    options: tuple[str, ...]
    help: str = ""


# The parameters that every model takes, see `EngineModel`; a model that declares one has a default of its own.
Noise = Annotated[float, Slider(0, 1, 0.01, "relative error of every sensor, standard deviation")]
Slip = Annotated[float, Slider(0, 1, 0.01, "probability, per wheel and step, of losing half its speed")]
Dial = Annotated[float, Slider(0, 1, 0.05, "dial from ideal robots, 0, to imperfect ones, 1")]


@dataclass(frozen=True, slots=True)
class Parameter:
    """One keyword parameter of a model: its default, its type, and its Slider or Choice if it has one."""

    name: str
    default: Any
    kind: type
    control: Slider | Choice | None

    @property
    def help(self) -> str:
        """What it is, in one line."""
        return self.control.help if self.control else ""

    def parse(self, text: str) -> Any:
        """Return the value that a user typed, as the parameter's type; any other text is refused."""
        if text in ("", "None") and self.default is None:
            return None
        if self.name == "map" and Path(text).suffix.lower() in READABLE:
            return text  # a file, which the model reads or refuses
        if self.name == "map":
            check_present_format(text)
            self._check_offered(text)
            text = builtin_name(text) or text
        if isinstance(self.control, Choice):
            return check_choice(self.name, text, self.control.options)
        if self.kind is bool:
            return check_choice(self.name, text.lower(), ("true", "false")) == "true"
        if self.kind in (int, float):
            return self._number(text)
        return text

    def checked(self, value: Any) -> Any:
        """Return a value that a file or a program gives, as the parameter's type; any other is refused."""
        if self.name == "map" and isinstance(value, Map):
            return value
        if value is None and self.default is None:
            return value
        if isinstance(self.control, Choice):
            self._check_offered(value)
            return check_choice(self.name, value, self.control.options)
        if self.kind is int and not isinstance(value, bool):
            return check_count(self.name, value, minimum=-LARGEST_WHOLE, maximum=LARGEST_WHOLE)
        if self.kind in (int, float):
            return check_number(self.name, value)
        if not isinstance(value, self.kind):
            expectation = {bool: "true or false", str: "a text"}.get(self.kind, f"a {self.kind.__name__}")
            raise InvalidValueError(f"{self.name} is {shortened(value)}; expected {expectation}")
        return value

    def _check_offered(self, value: Any) -> None:
        """Refuse a built-in map that is not one of the choice."""
        options = self.control.options if isinstance(self.control, Choice) else ()
        name = builtin_name(value) if self.name == "map" and options else None
        if name is not None and not {name, value} & set(options):
            expectation = f"expected {', '.join(options)} or a file of your own"
            raise InvalidValueError(f"map is {shortened(value)}, which this model does not offer; {expectation}")

    def _number(self, text: str) -> float:
        try:
            number = check_number(self.name, float(text))
            if self.kind is int and number != int(number):
                raise ValueError
        except ValueError:
            expectation = "a whole number" if self.kind is int else "a finite number"
            raise InvalidValueError(f"{self.name} is {shortened(text)}; expected {expectation}") from None
        return self.kind(number)


def parameters_of(model: Callable) -> dict[str, Parameter]:
    """Return the parameters of a model by name, in order, `rng` left out."""
    hints = _hints_of(model)
    parameters = {}
    for name, parameter in inspect.signature(model).parameters.items():
        if name == "rng" or parameter.kind not in (parameter.KEYWORD_ONLY, parameter.POSITIONAL_OR_KEYWORD):
            continue
        default = None if parameter.default is parameter.empty else parameter.default
        hint = hints.get(name, object if default is None else type(default))
        if name not in hints and get_origin(parameter.annotation) is Annotated:
            hint = parameter.annotation  # one that every model takes
        extras = getattr(hint, "__metadata__", ())
        kind = _kind_of(getattr(hint, "__origin__", hint) if extras else hint)
        control = next((extra for extra in extras if isinstance(extra, (Slider, Choice))), None)
        if isinstance(control, Slider) and not isinstance(default, (int, float)):
            control = None  # a slider begins at the default
        parameters[name] = Parameter(name, default, kind, control or _choice_in(hint))
    return parameters


def _hints_of(model: Callable) -> dict[str, Any]:
    """Return the annotations of a model's parameters, none if a name in them is not defined when the model runs."""
    try:
        return get_type_hints(model.__init__, include_extras=True)
    except Exception:  # annotations of a user's may be any expression
        return {}


def _kind_of(hint: Any) -> type:
    """Return the type of what is typed for an annotation, `object` where any text may be meant."""
    if hint == int | Trigger:  # what is typed is a number of steps
        return int
    if get_origin(hint) is Literal:
        hint = type(get_args(hint)[0])
    if get_origin(hint) in (Union, UnionType):
        arguments = [argument for argument in get_args(hint) if argument is not NoneType]
        hint = arguments[0] if len(arguments) == 1 else object
    kind = get_origin(hint) or hint
    return kind if isinstance(kind, type) else object


def _choice_in(hint: Any) -> Choice | None:
    """Return the texts of a `Literal` as a choice."""
    texts = get_args(hint) if get_origin(hint) is Literal else ()
    return Choice(texts) if texts and all(isinstance(text, str) for text in texts) else None


def check_names(model: Callable, names: Iterable[str]) -> None:
    """Refuse a name that is not a parameter of a model, `rng` included, unless it takes any keyword.

    Examples
    --------
    >>> from mesa_swarm.models.boids import Boids
    >>> check_names(Boids, ["n_robot"])
    Traceback (most recent call last):
    ...
    mesa_swarm.base.errors.UnknownNameError: unknown parameter of Boids 'n_robot'; did you mean 'n_robots'? known: ...
    """
    parameters = inspect.signature(model).parameters
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values()):
        return
    for name in names:
        if name not in parameters:
            raise UnknownNameError(unknown_name(f"parameter of {model.__name__}", name, parameters))


def parse_settings(model: Callable, settings: Sequence[str]) -> dict[str, Any]:
    """Return what ``name=value`` texts set, checked against the model's parameters."""
    parameters = parameters_of(model)
    values = {}
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals:
            raise InvalidValueError(f"setting {shortened(setting)} has no =; expected name=value, such as n_robots=5")
        if name not in parameters:
            raise UnknownNameError(unknown_name(f"parameter of {model.__name__}", name, parameters))
        values[name] = parameters[name].parse(text)
    return values
