"""Looks: what a model declares about how it is drawn, and its own charts and panels on the page."""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from mesa_swarm.base.errors import (
    InvalidValueError,
    UnknownNameError,
    check_name,
    check_number,
    error_line,
    shortened,
    unknown_name,
)
from mesa_swarm.geometry.masked_arrays import fill_masked

COLOUR = re.compile(r"#[0-9a-fA-F]{6}")
# Columns of frames: by what robots are coloured, and their texts.
VALUE, LABEL = "looks.value", "looks.label"
# Of a label at a robot, UTF-8.
LABEL_BYTES = 12
MOST_COLOURS = 16
# A colour for both themes, or one for the light and one for the dark.
Colour = str | tuple[str, str]
# A column by its name, or what is computed from the model: (n,) values, one a robot.
Source = str | Callable[[Any], Any]


def pair_colours(name: str, colour: Colour) -> tuple[str, str]:
    """Return a colour for the light and one for the dark theme, or refuse what is not one.

    Examples
    --------
    >>> pair_colours("puck", "#c08030")
    ('#c08030', '#c08030')
    """
    both = (colour, colour) if isinstance(colour, str) else colour
    if isinstance(both, (tuple, list)) and len(both) == 2:
        light, dark = both
        if all(isinstance(colour, str) and COLOUR.fullmatch(colour) for colour in (light, dark)):
            return light, dark
    raise InvalidValueError(
        f"colour of {shortened(name)} is {shortened(colour)}; expected #rrggbb, or (light, dark) of two such"
    )


@dataclass(frozen=True, slots=True)
class ColourMap:
    """Robots in colours of a quantity: what it is, its range, and the colours from its least to its greatest value.

    Parameters
    ----------
    source : str or callable
        A column of the swarm by its name, or a function of the model that returns one number a robot. Recordings that
        have the column are replayed with these colours; what a function computes is not recorded.
    low, high : float
        The values of the first and the last colour; those beyond have the same. NaN has the colour of robots.
    label : str
        In legends; by default the name of the column.
    colours : tuple of str or of (light, dark)
        Two to 16, spaced evenly; by default those of the palette.

    Examples
    --------
    >>> ColourMap("energy", 0, 100).label
    'energy'
    """

    source: Source
    low: float = 0.0
    high: float = 1.0
    label: str = ""
    colours: tuple[Colour, ...] = ()

    def __post_init__(self) -> None:
        """Check every value."""
        _check_source("source", self.source)
        check_number("low", self.low)
        check_number("high", self.high, above=self.low)
        label = self.label or (self.source if isinstance(self.source, str) else _name_of(self.source))
        object.__setattr__(self, "label", check_name("label", label))
        colours = tuple(pair_colours(self.label, colour) for colour in _as_tuple("colours", self.colours))
        if len(colours) == 1 or len(colours) > MOST_COLOURS:
            raise InvalidValueError(f"colours are {len(colours)}; expected 2 to {MOST_COLOURS}, or none")
        object.__setattr__(self, "colours", colours)


@dataclass(frozen=True, slots=True)
class Chart:
    """A chart on the page: numbers after every step.

    Parameters
    ----------
    name : str
        Its title.
    source : str or callable
        A function of the model that returns a number, or one for each of `curves`; or the name of an attribute of the
        model. What is not a number is left out.
    unit : str
    curves : tuple of str
        Names of the curves, if they are several.

    Examples
    --------
    >>> Chart("delivered", lambda model: model.steps // 10, unit="pucks").curves
    ('delivered',)
    """

    name: str
    source: Source
    unit: str = ""
    curves: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check every value."""
        check_name("name of a chart", self.name)
        _check_source(f"source of {self.name}", self.source)
        if self.unit:
            check_name("unit", self.unit)
        curves = _as_tuple("curves", self.curves) or (self.name,)
        object.__setattr__(self, "curves", tuple(check_name("name of a curve", curve) for curve in curves))

    def measure(self, model: Any) -> np.ndarray:
        """Return the number of each curve now, shape (k,); NaN for what is not a number."""
        try:
            return self.numbers(model)
        except Exception:  # a function of a user's may raise anything; the chart has a gap there
            return np.full(len(self.curves), np.nan)

    def numbers(self, model: Any) -> np.ndarray:
        """Return the same, or raise whatever the function raises."""
        value = getattr(model, self.source) if isinstance(self.source, str) else self.source(model)
        return np.array(fill_masked(value), float).reshape(len(self.curves))


@dataclass(frozen=True, kw_only=True, slots=True)
class Looks:
    """How a model is drawn, and what stands beside it: the class attribute ``looks`` of a SwarmModel.

    Parameters
    ----------
    kinds : mapping of str to colour
        Colours of kinds of bodies: "robot", "obstacle", "load", "mark", and those that `add_body` names. A colour is
        "#rrggbb", or (light, dark) for the two themes.
    column : str, callable or ColourMap, optional
        By what robots are coloured; a name or a function alone has the range 0 to 1.
    label : str or callable, optional
        A short text at each robot, at most 12 bytes: a column of the swarm by its name, or a function of the model that
        returns one text or number a robot; an empty text for none.
    charts : tuple of Chart
    panels : tuple of Solara components
        Each is called with the model, and drawn below the charts of the page, anew while the model is played.

    Examples
    --------
    >>> looks = Looks(kinds={"load": "#c08030"}, column=ColourMap("temperature", 0, 2), label="task")
    >>> looks.column.high
    2
    """

    kinds: Mapping[str, Colour] = field(default_factory=dict)
    column: ColourMap | Source | None = None
    label: Source | None = None
    charts: tuple[Chart, ...] = ()
    panels: tuple[Callable[[Any], Any], ...] = ()

    def __post_init__(self) -> None:
        """Check every value."""
        if not isinstance(self.kinds, Mapping):
            raise InvalidValueError(f"kinds is {shortened(self.kinds)}; expected a mapping from kinds to colours")
        kinds = {check_name("kind", name): pair_colours(name, colour) for name, colour in self.kinds.items()}
        object.__setattr__(self, "kinds", MappingProxyType(kinds))
        if self.column is not None and not isinstance(self.column, ColourMap):
            object.__setattr__(self, "column", ColourMap(self.column))
        if self.label is not None:
            _check_source("label", self.label)
        object.__setattr__(self, "charts", _as_tuple("charts", self.charts))
        object.__setattr__(self, "panels", _as_tuple("panels", self.panels))
        for chart in self.charts:
            if not isinstance(chart, Chart):
                raise InvalidValueError(f"charts has {shortened(chart)}; expected Chart(name, function)")
        names = [chart.name for chart in self.charts]
        for name in names:
            if names.count(name) > 1:
                raise InvalidValueError(f"two charts are named {shortened(name)}; give each a name of its own")
        for panel in self.panels:
            if not callable(panel):
                raise InvalidValueError(f"panels has {shortened(panel)}; expected a Solara component of the model")

    def columns_of(self, model: Any) -> dict[str, np.ndarray]:
        """Return what is drawn of a model now: `VALUE`, shape (n,), and `LABEL`, n texts, as far as declared."""
        columns: dict[str, np.ndarray] = {}
        if isinstance(self.column, ColourMap):
            columns[VALUE] = _numbers("column", _values(model, "column", self.column.source))
        if self.label is not None:
            values = _values(model, "label", self.label)
            columns[LABEL] = np.array([label_text(value) for value in values.tolist()], object)
        return columns

    def as_json(self) -> dict[str, Any]:
        """Return what a recording stores: colours, range and names; what a function computes is not recorded."""
        content: dict[str, Any] = {}
        if self.kinds:
            content["kinds"] = {name: list(pair) for name, pair in self.kinds.items()}
        if isinstance(self.column, ColourMap):
            source = self.column.source
            content["column"] = {
                "name": source if isinstance(source, str) else "",
                "label": self.column.label,
                "low": float(self.column.low),
                "high": float(self.column.high),
                "colours": [list(pair) for pair in self.column.colours],
            }
        if self.label is not None:
            content["label"] = self.label if isinstance(self.label, str) else ""
        return content


def looks_of(model: Any) -> Looks | None:
    """Return the looks that a model declares, None without any."""
    looks = getattr(model, "looks", None)
    if looks is not None and not isinstance(looks, Looks):
        raise InvalidValueError(f"looks of {type(model).__name__} is {shortened(looks)}; expected Looks(...)")
    return looks


def label_bytes(texts: np.ndarray) -> np.ndarray:
    """Return texts as UTF-8 of at most 12 bytes each, whole letters, zeros behind: shape (n, 12), int8.

    Examples
    --------
    >>> label_bytes(np.array(["ab", ""], object))[:, :3].tolist()
    [[97, 98, 0], [0, 0, 0]]
    """
    labels = [str(text).encode()[:LABEL_BYTES].decode(errors="ignore").encode() for text in texts.tolist()]
    return np.frombuffer(b"".join(text.ljust(LABEL_BYTES, b"\0") for text in labels), np.int8).reshape(-1, LABEL_BYTES)


def _values(model: Any, what: str, source: Source) -> np.ndarray:
    """Return one value a robot, or refuse a source that has another number of them."""
    count = len(model.swarm)
    if isinstance(source, str):
        if source not in model.swarm.columns:
            raise UnknownNameError(f"{what} of looks: {unknown_name('column', source, model.swarm.columns)}")
        values = model.swarm.columns[source]
    else:
        try:
            values = fill_masked(source(model))
        except Exception as error:  # a function of a user's may raise anything
            raise InvalidValueError(f"{what} of looks, {_name_of(source)}, failed: {error_line(error)}") from error
    if values.shape not in ((count,), (count, 1)):
        name = source if isinstance(source, str) else _name_of(source)
        raise InvalidValueError(f"{what} of looks, {name}, has shape {values.shape}; expected one value a robot")
    return values.reshape(count)


def _numbers(what: str, values: np.ndarray) -> np.ndarray:
    try:
        return values.astype(float)
    except (TypeError, ValueError):
        raise InvalidValueError(f"{what} of looks has {shortened(values)}; expected numbers") from None


def label_text(value: object) -> str:
    """Return a value as a label: a flag only where it is true, a real number in three digits.

    Examples
    --------
    >>> label_text(True), label_text(0.12345), label_text(7), label_text(None)
    ('yes', '0.123', '7', '')
    """
    if isinstance(value, bool):
        return "yes" if value else ""
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.3g}"
    return "" if value is None else "".join(letter for letter in str(value) if letter.isprintable())


def _check_source(name: str, source: object) -> None:
    if not (callable(source) or (isinstance(source, str) and source)):
        raise InvalidValueError(f"{name} is {shortened(source)}; expected a name, or a function of the model")


def _name_of(function: Callable) -> str:
    name = getattr(function, "__name__", type(function).__name__)
    return "value" if name == "<lambda>" else str(name)


def _as_tuple(name: str, value: object) -> tuple:
    if isinstance(value, (tuple, list)):
        return tuple(value)
    raise InvalidValueError(f"{name} is {shortened(value)}; expected a tuple")
