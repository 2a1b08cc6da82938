"""What users may wish for: values, seeds and maps, checked before a model is given them."""

from typing import Any

from mesa_swarm.errors import InvalidValueError, check_count
from mesa_swarm.parameters import Parameter
from mesa_swarm.world.map import Map

MOST_ROBOTS = 10_000
LARGEST_UPLOAD = 1_000_000
LARGEST_SEED = 2**53 - 1


def checked_wish(parameter: Parameter, value: Any) -> Any:
    """Return what somebody wishes for, as the parameter's type.

    Raises
    ------
    InvalidValueError, UnknownNameError
        If it is no such value, or more robots than a page can take.

    Examples
    --------
    >>> checked_wish(Parameter("n_robots", 10, int, None), "12")
    12
    """
    value = parameter.checked(parameter.parse(value) if isinstance(value, str) else value)
    return check_count("n_robots", value, maximum=MOST_ROBOTS) if parameter.name == "n_robots" else value


def map_from(name: str, content: bytes) -> Map:
    """Return the map in a file that was handed over.

    Raises
    ------
    MapError, InvalidValueError
        If it is too large, of another kind, or not a map.

    Examples
    --------
    >>> map_from("hall.svg", b'<svg width="80" height="60"><circle cx="40" cy="20" r="5"/></svg>').name
    'hall'
    """
    if len(content) > LARGEST_UPLOAD:
        raise InvalidValueError(f"{name:.60} has {len(content):,} bytes; expected at most {LARGEST_UPLOAD:,}")
    if name.lower().endswith(".svg"):
        return Map.from_svg(content, name)
    if name.lower().endswith(".toml"):
        try:
            return Map.from_toml(content.decode(), name)
        except UnicodeDecodeError:
            raise InvalidValueError(f"{name:.60} is not UTF-8 text; expected a map as TOML") from None
    raise InvalidValueError(f"{name!r:.60} is no map; expected a file that ends in .svg or .toml")


def seed_from(text: str | int) -> int:
    """Return the seed that somebody typed.

    Raises
    ------
    InvalidValueError
        If it is none.

    Examples
    --------
    >>> seed_from("7")
    7
    """
    try:
        return check_count("seed", int(text), maximum=LARGEST_SEED)
    except ValueError:
        raise InvalidValueError(f"seed is {text!r:.60}; expected a whole number from 0 on") from None
