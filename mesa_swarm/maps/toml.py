"""Map files in TOML: read with the place of every mistake, and written exactly.

The format: `name`, `width` and `height` (or `bounds`), an optional `origin`, then `[[obstacle]]` and
`[[fire]]` tables in map units, y up. Floats are written with all their digits: a map reads back equal.
"""

import json
import re
import tomllib
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_number, shortened, unknown_name
from mesa_swarm.geometry import Bounds
from mesa_swarm.maps.map_parts import (
    DISC,
    POLYGON,
    FireSpot,
    Work,
    check_items,
    check_map_bounds,
    coordinate,
    name_file_in_errors,
    refusal,
)
from mesa_swarm.world.shapes import LARGEST_COORDINATE, Shape, check_rings, disc, polygon, rectangle

TOP_KEYS = ("name", "width", "height", "origin", "bounds", "obstacle", "fire")
FIRE_KEYS = ("centre", "radius", "temperature")
# Dots of names such as a.b.c, of which maps have none and jobs a few.
MOST_DOTTED = 2_000
MOST_DOTTED_ON_LINE = 10
# A remark or string, whole or cut off; or a dot before a quoted part of a name or one before another dot.
_DOTTED = re.compile(
    r"""
    \#[^\n]*+
    | \"{3}(?:[^"\\]++|\\.|"(?!""))*+(?:"{3,5})? | \'{3}(?:[^']++|'(?!''))*+(?:'{3,5})?
    | "(?:[^"\\\n]++|\\.)*+"? | '[^'\n]*+'?
    | (\.)[ \t]*+(?=["']|[\w-]++[ \t]*+\.)
    """,
    re.VERBOSE | re.DOTALL,
)
SHAPE_KEYS = {"rectangle": ("corners",), "disc": ("centre", "radius"), "polygon": ("outline", "holes")}


def read_toml(text: str, source: str) -> dict[str, Any]:
    """Return the contents of a TOML map, as the keyword arguments of `Map`.

    Errors name line and column of a syntax error, else the table, such as `obstacle 3`, after `source`.
    """
    table = parse_toml(text, source)
    work = Work(len(text))
    with name_file_in_errors(source):
        _refuse_unknown_keys(table, TOP_KEYS)
        bounds = _bounds(table)
        name = _require(table, "name")
    return {
        "name": name,
        "bounds": bounds,
        "obstacles": _tables(table, "obstacle", partial(_obstacle, work), source),
        "fires": _tables(table, "fire", partial(_fire, work), source),
    }


def toml_text(name: str, bounds: Bounds, obstacles: Iterable[Shape], fires: Iterable[FireSpot]) -> str:
    """Return the TOML text that `read_toml` reads back exactly."""
    head = [
        "# A map of mesa_swarm: y points up, all numbers are in map units.",
        f"name = {json.dumps(name, ensure_ascii=False)}",
        *_size_lines(bounds),
    ]
    blocks = [head, *map(_obstacle_lines, obstacles), *map(_fire_lines, fires)]
    return "\n".join("\n".join(block) + "\n" for block in blocks)


def number_text(value: float) -> str:
    """Return the shortest text that reads back as exactly this float."""
    # Beyond 2**53 a whole number has more digits than the float is exact to.
    return str(int(value)) if value.is_integer() and abs(value) < 2**53 else repr(value)


def parse_toml(text: str, source: str) -> dict[str, Any]:
    """Return the contents of any TOML text, or name line and column of an error in its syntax."""
    _refuse_long_keys(text, source)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise refusal(source, "", "lists are nested too deeply") from None
    except ValueError as error:  # of tomllib, or of Python for numbers of more than 4300 digits
        raise refusal(source, "", error) from None


def _refuse_long_keys(text: str, source: str) -> None:
    """Refuse dotted names of thousands of parts, which take Python's reader the square of their length.

    The reader stops at a string that is cut off: the text after it does not matter.
    """
    dots = on_line = 0
    next_line = 0
    for match in _DOTTED.finditer(text):
        if not match[1]:
            continue
        if match.start() >= next_line:
            next_line = text.find("\n", match.start()) + 1 or len(text)
            on_line = 0
        dots, on_line = dots + 1, on_line + 1
        if dots > MOST_DOTTED or on_line > MOST_DOTTED_ON_LINE:
            line = text.count("\n", 0, match.start()) + 1
            most = f"more than {MOST_DOTTED_ON_LINE} dots, or {MOST_DOTTED} in the file"
            raise refusal(source, f"line {line}", f"has dotted names of {most}; write tables instead")


def _bounds(table: dict[str, Any]) -> Bounds:
    if "bounds" in table:
        if {"width", "height", "origin"} & table.keys():
            raise InvalidValueError("bounds and width, height or origin are both given; keep one of them")
        return check_map_bounds(table["bounds"])
    width, height = (
        check_number(side, _require(table, side), above=0, maximum=LARGEST_COORDINATE) for side in ("width", "height")
    )
    origin = check_items("origin", table.get("origin", [0.0, 0.0]), 2, "two numbers [x, y]")
    x, y = (coordinate("origin", value) for value in origin)
    return check_map_bounds((x, y, x + width, y + height))


def _tables(table: dict[str, Any], key: str, read: Callable[[dict[str, Any]], Any], source: str) -> tuple:
    """Return what `read` makes of each `[[key]]` table, naming the table that is at fault."""
    entries = table.get(key, [])
    if not isinstance(entries, list):
        raise refusal(source, key, f"write [[{key}]] with double brackets")
    parts = []
    for number, entry in enumerate(entries, start=1):
        with name_file_in_errors(source, f"{key} {number}"):
            if not isinstance(entry, dict):
                raise InvalidValueError(f"is {shortened(entry)}; expected a [[{key}]] table")
            parts.append(read(entry))
    return tuple(parts)


def _obstacle(work: Work, entry: dict[str, Any]) -> Shape:
    shape = check_choice("shape", _require(entry, "shape"), SHAPE_KEYS)
    _refuse_unknown_keys(entry, ("shape", "mark", *SHAPE_KEYS[shape]))
    mark = entry.get("mark", False)
    if not isinstance(mark, bool):
        raise InvalidValueError(f"mark is {shortened(mark)}; expected true or false")
    if shape == "rectangle":
        work.spend(POLYGON)
        corners = check_items("corners", _require(entry, "corners"), 2, "two points [[x, y], [x, y]]")
        return rectangle(*corners, contact=not mark)
    if shape == "disc":
        work.spend(DISC)
        return disc(_require(entry, "centre"), _require(entry, "radius"), contact=not mark)
    outline, *holes = check_rings(_require(entry, "outline"), entry.get("holes", []))
    work.spend_on_outlines([outline, *holes])
    return polygon(outline, holes, contact=not mark)


def _fire(work: Work, entry: dict[str, Any]) -> FireSpot:
    work.spend(DISC)
    _refuse_unknown_keys(entry, FIRE_KEYS)
    return FireSpot(_require(entry, "centre"), _require(entry, "radius"), entry.get("temperature", 1.0))


def _require(table: dict[str, Any], key: str) -> Any:
    if key not in table:
        raise InvalidValueError(f"{key} is missing")
    return table[key]


def _refuse_unknown_keys(table: dict[str, Any], known_keys: Iterable[str]) -> None:
    for key in table:
        if key not in known_keys:
            raise InvalidValueError(unknown_name("key", key, known_keys))


def _size_lines(bounds: Bounds) -> list[str]:
    x_min, y_min, x_max, y_max = bounds
    if (x_min, y_min) == (0.0, 0.0):
        return [f"width = {number_text(x_max)}", f"height = {number_text(y_max)}"]
    # origin + width may round to a neighbour of x_max; the bounds themselves cannot.
    return [f"bounds = {_list_text(bounds)}"]


def _obstacle_lines(shape: Shape) -> list[str]:
    mark = [] if shape.contact else ["mark = true"]
    return ["[[obstacle]]", f'shape = "{shape.kind}"', *_shape_lines(shape), *mark]


def _shape_lines(shape: Shape) -> list[str]:
    if shape.kind == "disc":
        return [f"centre = {_list_text(shape.position.tolist())}", f"radius = {number_text(shape.radius)}"]
    if shape.kind == "rectangle":
        x_min, y_min, x_max, y_max = shape.bounds
        return [f"corners = [{_list_text((x_min, y_min))}, {_list_text((x_max, y_max))}]"]
    outline = f"outline = {_ring_text(shape.geometry.exterior)}"
    holes = ", ".join(map(_ring_text, shape.geometry.interiors))
    return [outline, f"holes = [{holes}]"] if holes else [outline]


def _fire_lines(fire: FireSpot) -> list[str]:
    return [
        "[[fire]]",
        f"centre = {_list_text(fire.position)}",
        f"radius = {number_text(fire.radius)}",
        f"temperature = {number_text(fire.temperature)}",
    ]


def _ring_text(ring: Any) -> str:
    return f"[{', '.join(map(_list_text, ring.coords[:-1]))}]"


def _list_text(numbers: Iterable[float]) -> str:
    return f"[{', '.join(map(number_text, numbers))}]"
