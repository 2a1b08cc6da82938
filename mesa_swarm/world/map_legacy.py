"""Map files of the thesis (`.map`): a list of Obstacle("rec", ...) and Obstacle("cir", ...), y down.

The text looks like Python and is parsed as such, but nothing in it is ever run: only the listed calls with
plain numbers are recognised, everything else is refused.
"""

import ast
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from mesa_swarm.errors import InvalidValueError, check_choice, check_number
from mesa_swarm.world.map_parts import Bounds, FireSpot, check_inside, checked_bounds, naming, refusal
from mesa_swarm.world.shapes import LARGEST_COORDINATE, Shape, disc, rectangle

LARGEST_LEGACY_FILE = 1_000_000
# Python's parser makes a kilobyte and more of each.
MOST_WORDS = 150_000
_WORD = re.compile(r"\w+(?:\.\w*)?|[^\w \t]")
# Remarks and strings, whole or cut off, with the letters before a string: f and t make it a text that is computed.
_STRING = re.compile(
    r"""
    \#[^\r\n]*+
    | (?:(?<!\w)([a-zA-Z]{1,2}))?
      (?: \"{3}(?:[^"\\]++|\\.|"(?!""))*+(?:\"{3})? | \'{3}(?:[^'\\]++|\\.|'(?!''))*+(?:\'{3})?
        | "(?:[^"\\\r\n]++|\\.)*+"? | '(?:[^'\\\r\n]++|\\.)*+'? )
    """,
    re.VERBOSE | re.DOTALL,
)
DEEPEST_NESTING = 3
NUMBERS_OF_KIND = {"rec": 4, "cir": 3, "fire": 3}


class Entry(NamedTuple):
    """One call of the file: what it makes, with which numbers, on which line."""

    kind: str
    numbers: list[float]
    line: int

    @property
    def place(self) -> str:
        """Where errors say it stands."""
        return f"line {self.line}"

    @property
    def far_corner(self) -> tuple[float, float]:
        """Its largest x and y."""
        if self.kind == "rec":
            x0, y0, x1, y1 = self.numbers
            return max(x0, x1), max(y0, y1)
        x, y, radius = self.numbers
        return x + radius, y + radius


def read_legacy(text: str, source: str, name: str) -> dict[str, Any]:
    """Return what a `.map` file of the thesis says, as the keyword arguments of `Map`.

    The map spans from (0, 0) to the far corner of all that stands in it; y is turned to point up.

    Parameters
    ----------
    text : str
        The file's text.
    source : str
        The name that errors begin with.
    name : str
        The map's name; the file has none.

    Raises
    ------
    MapError
        Naming the line of anything that is not a known call with plain numbers.

    Examples
    --------
    >>> text = '[Obstacle("rec", [[0, 0], [20, 600]]), Obstacle("cir", [[650, 160], 30])]'
    >>> parts = read_legacy(text, "hall.map", "hall")
    >>> parts["bounds"], parts["obstacles"][1].position
    ((0.0, 0.0, 680.0, 600.0), array([650., 440.]))
    """
    entries = []
    for call in _calls(_tree(text, source), source):
        with naming(source, f"line {call.lineno}"):
            entries.append(_entry(call))
    with naming(source):
        bounds = _bounds(entries)
    parts = [_part(entry, bounds, source) for entry in entries]
    return {
        "name": name,
        "bounds": bounds,
        "obstacles": tuple(part for part in parts if isinstance(part, Shape)),
        "fires": tuple(part for part in parts if isinstance(part, FireSpot)),
    }


def _tree(text: str, source: str) -> ast.Module:
    """Parse, which builds a tree and runs nothing."""
    if len(text) > LARGEST_LEGACY_FILE:
        raise refusal(source, "", f"has more than {LARGEST_LEGACY_FILE} characters")
    words = sum(1 for _ in _WORD.finditer(text))
    if words > MOST_WORDS:
        raise refusal(source, "", f"has {words:,} words, brackets and lines; expected at most {MOST_WORDS:,}")
    _refuse_computed_strings(text, source)
    try:
        return ast.parse(text)
    except (RecursionError, MemoryError):  # what Python's parser says to bombs of nested brackets or signs
        raise refusal(source, "", "is nested too deeply") from None
    except (SyntaxError, ValueError) as error:
        line = getattr(error, "lineno", None) or 1
        raise refusal(source, f"line {line}", getattr(error, "msg", error)) from None


def _refuse_computed_strings(text: str, source: str) -> None:
    """Refuse f"..." and its like, which Python's parser may take the square of their length to read."""
    for found in _STRING.finditer(text):
        if set("fFtT") & set(found[1] or ""):
            line = text.count("\n", 0, found.start()) + 1
            raise refusal(source, f"line {line}", f'has a string that begins with {found[1]}; expected such as "rec"')


def _calls(tree: ast.Module, source: str) -> Iterator[ast.expr]:
    """Yield the items of the list, or of several lists or bare calls one after the other."""
    for statement in tree.body:
        if not isinstance(statement, ast.Expr):
            raise refusal(source, f"line {statement.lineno}", "expected a list of Obstacle(...)")
        value = statement.value
        yield from value.elts if isinstance(value, (ast.List, ast.Tuple)) else [value]


def _entry(call: ast.expr) -> Entry:
    match call:
        case ast.Call(func=ast.Name("Obstacle"), args=[ast.Constant(str(kind)), what], keywords=[]):
            kind = check_choice("kind of obstacle", kind, NUMBERS_OF_KIND)
        case ast.Call(func=ast.Name("Fire"), args=[what], keywords=[]):
            kind = "fire"
        case _:
            raise InvalidValueError('expected Obstacle("rec", [[x, y], [x, y]]) or ("cir", [[x, y], radius])')
    numbers = list(_numbers(what, DEEPEST_NESTING))
    wanted = NUMBERS_OF_KIND[kind]
    if len(numbers) != wanted:
        raise InvalidValueError(f"{kind} has {len(numbers)} numbers; expected {wanted}")
    if kind != "rec":
        check_number("radius", numbers[2], above=0)
    return Entry(kind, numbers, call.lineno)


def _numbers(node: ast.expr, depth: int) -> Iterator[float]:
    """Yield the numbers of nested lists in order: [[x, y], r] and [x, y, r] read alike."""
    match node:
        case ast.List(items) | ast.Tuple(items) if depth > 0:
            for item in items:
                yield from _numbers(item, depth - 1)
        case ast.Constant(value):
            yield _coordinate(value)
        case ast.UnaryOp(ast.USub(), ast.Constant(value)):
            yield -_coordinate(value)
        case _:
            raise InvalidValueError("expected plain numbers in lists")


def _coordinate(value: object) -> float:
    return check_number("coordinate", value, minimum=-LARGEST_COORDINATE, maximum=LARGEST_COORDINATE)


def _bounds(entries: list[Entry]) -> Bounds:
    if not entries:
        raise InvalidValueError("has no obstacles, which alone say how large a .map is")
    corners = [entry.far_corner for entry in entries]
    return checked_bounds((0.0, 0.0, max(x for x, _ in corners), max(y for _, y in corners)))


def _part(entry: Entry, bounds: Bounds, source: str) -> Shape | FireSpot:
    with naming(source, entry.place):
        part = _standing(entry, height=bounds[3])
        check_inside(entry.kind, part, bounds)
    return part


def _standing(entry: Entry, height: float) -> Shape | FireSpot:
    """Make the shape or fire, with y turned to point up."""
    if entry.kind == "rec":
        x0, y0, x1, y1 = entry.numbers
        return rectangle((x0, height - y0), (x1, height - y1))
    x, y, radius = entry.numbers
    centre = (x, height - y)
    return FireSpot(centre, radius) if entry.kind == "fire" else disc(centre, radius)
