"""What users type and upload, checked."""

from decimal import Decimal
from typing import Any

from mesa_swarm.base.errors import InvalidValueError, check_count
from mesa_swarm.dashboard.page.edits import MOST_ROBOTS
from mesa_swarm.maps.map import Map
from mesa_swarm.model.parameters import Parameter

LARGEST_MAP_FILE = 1_000_000
LARGEST_SEED = 2**53 - 1


def checked_setting(parameter: Parameter, value: Any) -> Any:
    """Return a requested setting, as the parameter's type and within the number of robots on a page."""
    value = parameter.checked(parameter.parse(value) if isinstance(value, str) else value)
    return check_count("n_robots", value, maximum=MOST_ROBOTS) if parameter.name == "n_robots" else value


def map_from(name: str, content: bytes) -> Map:
    """Return the map in an uploaded file."""
    if len(content) > LARGEST_MAP_FILE:
        raise InvalidValueError(f"{name:.60} has {len(content):,} bytes; expected at most {LARGEST_MAP_FILE:,}")
    if name.lower().endswith(".svg"):
        return Map.from_svg(content, name)
    if name.lower().endswith(".toml"):
        try:
            return Map.from_toml(content.decode(), name)
        except UnicodeDecodeError:
            raise InvalidValueError(f"{name:.60} is not UTF-8 text; expected a map as TOML") from None
    raise InvalidValueError(f"{name!r:.60} is not a map; expected a file that ends in .svg or .toml")


def whole_number(name: str, text: str | int, minimum: int = 0, maximum: int = LARGEST_SEED) -> int:
    """Return a typed whole number, such as 1000 or 1e3."""
    try:
        number = Decimal(text)
        if number != number.to_integral_value() or not minimum <= number <= maximum:
            raise ValueError
    except (ValueError, ArithmeticError):
        expectation = f"expected a whole number at least {minimum} and at most {maximum}"
        raise InvalidValueError(f"{name} is {text!r:.60}; {expectation}") from None
    return int(number)
