"""Maps: built in, loaded from TOML, SVG or the thesis's `.map` files, written as TOML or SVG."""

import ast
import os
import re
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

import numpy as np

from mesa_swarm.base.errors import (
    InvalidValueError,
    MapError,
    MapWarning,
    check_choice,
    check_number,
    shortened,
    unknown_name,
)
from mesa_swarm.base.files import check_present_format, show_path, write_whole
from mesa_swarm.base.wording import quantity
from mesa_swarm.geometry import Bounds
from mesa_swarm.maps.map_parts import (
    LARGEST_FILE,
    RADIUS_OF_UNIT_AREA,
    FireSpot,
    bytes_of,
    check_inside,
    check_map_bounds,
    check_map_name,
    coordinate,
    decode_text,
    file_content,
    first_points_within,
    name_file_in_errors,
    refusal,
)
from mesa_swarm.maps.toml import number_text, read_toml, toml_text
from mesa_swarm.world.shapes import Shape, disc, rectangle

__all__ = ["RADIUS_OF_UNIT_AREA", "FireSpot", "Map", "builtin_maps"]

BUILTIN = ("original", "sparse", "openspace", "openspace_fire")
Part = TypeVar("Part", Shape, FireSpot)
ALIASES = {"maze": "sparse"}  # it is maze in the thesis's text, sparse in its figure
READABLE = (".toml", ".svg", ".map")
WRITABLE = (".toml", ".svg")

LARGEST_LEGACY_FILE = 1_000_000
# Python's parser uses a kilobyte or more for each.
MOST_WORDS = 150_000
# Quotation marks as PDF files have them in listings.
PRINTED = str.maketrans(
    {**dict.fromkeys("\u201c\u201d\u201e\u201f", '"'), **dict.fromkeys("\u2018\u2019\u201a\u201b", "'")}
)
_WORD = re.compile(r"\w+(?:\.\w*)?|[^\w \t]")
# Comments and strings, whole or cut off, with the letters before a string: f and t make it a computed text.
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

# As in viewing/palette.py, which is on a higher floor; a test compares them.
GROUND = "#faf9f6"
SOLID = "#646b75"
MARK = "#9c8858"
FLAME = "#e81c14"
RIM = "#8a1710"


@dataclass(frozen=True, kw_only=True, slots=True)
class Map:
    """The bounds of a world, its obstacles and its fires.

    Parameters
    ----------
    name : str
        Printable, on one line.
    bounds : (x_min, y_min, x_max, y_max)
        Map units, y up; a width and height above 0, no coordinate beyond 1e9. By default 800 wide and 600 high, as are
        the maps of the thesis.
    obstacles : sequence of Shape
        Solid shapes and ground marks, each at least partly within the bounds.
    fires : sequence of FireSpot
        Each at least partly within the bounds.

    Raises
    ------
    InvalidValueError
        If a value is wrong; obstacles and fires are named by their number.

    Examples
    --------
    >>> from mesa_swarm.world.shapes import disc
    >>> hall = Map(name="hall", bounds=(0, 0, 80, 60), obstacles=[disc((40, 30), 5)])
    >>> hall.width, hall.height, len(hall.obstacles)
    (80.0, 60.0, 1)
    >>> Map.load("original").obstacles[4].bounds
    (70.0, 70.0, 110.0, 530.0)
    """

    name: str = "map"
    bounds: Bounds = (0.0, 0.0, 800.0, 600.0)
    obstacles: tuple[Shape, ...] = ()
    fires: tuple[FireSpot, ...] = ()

    def __post_init__(self) -> None:
        """Check everything and store the sequences as tuples."""
        bounds = check_map_bounds(self.bounds)
        values = {
            "name": check_map_name(self.name),
            "bounds": bounds,
            "obstacles": _parts_within(bounds, "obstacle", self.obstacles, Shape),
            "fires": _parts_within(bounds, "fire", self.fires, FireSpot),
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def width(self) -> float:
        """Extent in x, map units."""
        return self.bounds[2] - self.bounds[0]

    @property
    def height(self) -> float:
        """Extent in y, map units."""
        return self.bounds[3] - self.bounds[1]

    @classmethod
    def load(cls, source: "Map | str | os.PathLike[str]") -> "Map":
        """Return a map given by a built-in name, a file, or itself.

        Parameters
        ----------
        source : Map, str or Path
            A Map is returned as it is. A string may be one of `builtin_maps()`; any other string and every Path
            is a `.toml`, `.svg` or `.map` file. A string that is not a file may be a name of the thesis's, such as
            `maze` or `openspace_FIRE.map`.

        Raises
        ------
        MapError
            On one line: the file, the place in it, and the mistake.

        Warns
        -----
        MapWarning
            If the list of a `.map` file is not closed, as in the thesis's Listing 4.1, and read as if it were.

        Examples
        --------
        >>> Map.load("maze").name, Map.load("openspace_FIRE.map").name
        ('sparse', 'openspace_fire')
        """
        if isinstance(source, Map):
            return source
        if not isinstance(source, (str, os.PathLike)):
            raise refusal("map", "", f"is {shortened(source)}; expected a Map, a name or a path")
        name = builtin_name(source)
        if name and (source in (*BUILTIN, *ALIASES) or not _exists(Path(source))):
            return _builtin(name)
        return _from_file(source)

    @classmethod
    def from_toml(cls, text: str, source: str = "TOML text") -> Self:
        """Return the map of a TOML text; errors begin with `source`.

        Examples
        --------
        >>> hall = Map(name="hall", bounds=(0, 0, 80, 60))
        >>> Map.from_toml(hall.to_toml()) == hall
        True
        """
        with name_file_in_errors(source):
            return cls(**read_toml(text, source))

    @classmethod
    def from_svg(cls, content: str | bytes, source: str = "drawing.svg") -> Self:
        """Return the map of an SVG drawing; a drawing without title is named after `source`.

        Examples
        --------
        >>> drawing = '<svg width="80" height="60"><circle cx="40" cy="20" r="5"/></svg>'
        >>> Map.from_svg(drawing).obstacles[0].position
        array([40., 40.])
        """
        from mesa_swarm.maps.svg import read_svg  # noqa: PLC0415 - slow to load

        with name_file_in_errors(source), np.errstate(all="ignore"):  # overflows are refused as shapes
            return cls(**read_svg(bytes_of(content, source), source))

    def to_toml(self) -> str:
        """Return a TOML text that `from_toml` reads back as an equal map."""
        return toml_text(self.name, self.bounds, self.obstacles, self.fires)

    def to_svg(self) -> str:
        """Return an SVG drawing that reads back as an equal map.

        Reading refuses drawings of more than 10,000 elements or 200,000 corners; TOML has room for more.
        """
        return svg_text(self.name, self.bounds, self.obstacles, self.fires)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the map as `.toml` or `.svg`, wholly or not at all.

        Parameters
        ----------
        path : str or Path
            Its suffix decides the format.

        Raises
        ------
        MapError
            If the suffix is another one or the file cannot be written; the old file then stays.

        Examples
        --------
        >>> import tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     Map.load("original").save(f"{folder}/copy.svg")
        ...     Map.load(f"{folder}/copy.svg") == Map.load("original")
        True
        """
        target = Path(path)
        suffix = _check_suffix(target, WRITABLE)
        write_whole(target, self.to_toml() if suffix == ".toml" else self.to_svg(), MapError, folders=False)


def builtin_maps() -> list[str]:
    """Return the names of the maps that come with the package."""
    return list(BUILTIN)


def builtin_name(text: object) -> str | None:
    """Return the name of the built-in map that a text stands for, in the thesis's writing too, or None.

    Examples
    --------
    >>> builtin_name("openspace_FIRE.map"), builtin_name("maze"), builtin_name("hall.map")
    ('openspace_fire', 'sparse', None)
    """
    if not isinstance(text, str):
        return None
    name = text.lower().removesuffix(".map")
    name = ALIASES.get(name, name)
    return name if name in BUILTIN else None


def _parts_within(bounds: Bounds, word: str, parts: Iterable[Part], part_class: type[Part]) -> tuple[Part, ...]:
    """Return the parts as a tuple if each is of the wanted type and partly within the bounds."""
    if not isinstance(parts, Iterable):
        raise InvalidValueError(f"{word}s is {shortened(parts)}; expected a list of {part_class.__name__}")
    all_parts = tuple(parts)
    for number, part in enumerate(all_parts, start=1):
        if not isinstance(part, part_class):
            raise InvalidValueError(f"{word} {number} is {shortened(part)}; expected a {part_class.__name__}")
    for index in np.flatnonzero(~first_points_within(all_parts, bounds)):
        check_inside(f"{word} {index + 1}", all_parts[index], bounds)
    return all_parts


def _builtin(name: str) -> Map:
    file = resources.files("mesa_swarm.maps") / "standard" / f"{name}.toml"
    return Map.from_toml(file.read_text(encoding="utf-8"), f"{name}.toml")


def _from_file(source: str | os.PathLike[str]) -> Map:
    path, shown_name = _find_file(source)
    suffix = _check_suffix(path, READABLE)
    content = file_content(path, LARGEST_LEGACY_FILE if suffix == ".map" else LARGEST_FILE)
    if suffix == ".svg":
        return Map.from_svg(content, shown_name)
    text = decode_text(content, shown_name)
    if suffix == ".toml":
        return Map.from_toml(text, shown_name)
    with name_file_in_errors(shown_name):
        return Map(**read_legacy(text, shown_name, path.stem.strip()))


def _find_file(source: str | os.PathLike[str]) -> tuple[Path, str]:
    """Return the path and how errors show it; a missing file may be a misspelt built-in name."""
    path, shown_name = Path(source), show_path(source)
    check_present_format(path, MapError)
    if _exists(path):
        return path, shown_name
    if name := builtin_name(path.stem):
        raise refusal(shown_name, "no such file", f"a path is a file; the built-in map is the text {name!r}")
    raise refusal(shown_name, "no such file", unknown_name("map", path.stem, (*BUILTIN, *ALIASES)))


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name too long for the system, or with a null byte
        return False


def _check_suffix(path: Path, suffixes: tuple[str, ...]) -> str:
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        raise refusal(str(path), "", f"expected a file that ends in {', '.join(suffixes)}")
    return suffix


class Entry(NamedTuple):
    """One call of a `.map` file: the kind of body, its numbers, and the line."""

    kind: str
    numbers: list[float]
    line: int

    @property
    def far_corner(self) -> tuple[float, float]:
        """Its largest x and y."""
        if self.kind == "rec":
            x0, y0, x1, y1 = self.numbers
            return max(x0, x1), max(y0, y1)
        x, y, radius = self.numbers
        return x + radius, y + radius


def read_legacy(text: str, source: str, name: str) -> dict[str, Any]:
    """Return the contents of a `.map` file of the thesis, as the keyword arguments of `Map`; errors name the line.

    The text looks like Python and is parsed as such, but never executed: only the listed calls with plain numbers,
    in a list that may be assigned to a name as in the thesis's Listing 4.1, are recognised, everything else is refused.
    Lines may be indented, and quotation marks be those of print. The bracket that closes the list may be missing, as in
    print, which is warned of (MapWarning); no other may. The map spans from (0, 0) to the far corner of all its bodies;
    y is turned to point up.
    """
    entries = []
    tree, unclosed = _tree(_as_typed(text), source)
    for call in _calls(tree, source):
        with name_file_in_errors(source, f"line {call.lineno}"):
            entries.append(_entry(call))
    with name_file_in_errors(source):
        bounds = _bounds(entries)
    parts = [_part(entry, bounds, source) for entry in entries]
    obstacles = tuple(part for part in parts if isinstance(part, Shape))
    fires = tuple(part for part in parts if isinstance(part, FireSpot))
    if unclosed:
        _warn_of_end(source, unclosed, len(obstacles), len(fires))
    return {"name": name, "bounds": bounds, "obstacles": obstacles, "fires": fires}


def _as_typed(text: str) -> str:
    """Return what is copied from print as it is typed: plain quotation marks, no indentation, no empty space."""
    text = re.sub("\u2019\u2019|\u2018\u2018", '"', text)
    lines = text.translate(PRINTED).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return "\n".join(line.replace("\xa0", " ").lstrip(" \t") for line in lines)


def _tree(text: str, source: str) -> tuple[ast.Module, int]:
    """Parse the text, which executes nothing; return the tree, and the line of a list that is never closed or 0."""
    if len(text) > LARGEST_LEGACY_FILE:
        raise refusal(source, "", f"has more than {LARGEST_LEGACY_FILE} characters")
    words = sum(1 for _ in _WORD.finditer(text))
    if words > MOST_WORDS:
        raise refusal(source, "", f"has {words:,} words, brackets and lines; expected at most {MOST_WORDS:,}")
    _refuse_computed_strings(text, source)
    try:
        return ast.parse(text), 0
    except (RecursionError, MemoryError):  # of Python's parser, for bombs of nested brackets or signs
        raise refusal(source, "", "is nested too deeply") from None
    except (SyntaxError, ValueError) as error:
        if closed := _close_list(text):
            return closed
        line = getattr(error, "lineno", None) or 1
        raise refusal(source, f"line {line}", getattr(error, "msg", error)) from None


def _close_list(text: str) -> tuple[ast.Module, int] | None:
    """Return the tree and the line of the last list if its bracket at the end, and nothing else, is missing."""
    try:
        tree = ast.parse(f"{text}\n]")
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return None
    match tree.body[-1]:
        case ast.Expr(ast.List() as listed) | ast.Assign(value=ast.List() as listed):
            return tree, listed.lineno
    return None


def _warn_of_end(source: str, line: int, obstacles: int, fires: int) -> None:
    """Warn of a list that is never closed; a file may also have been cut off there."""
    bodies = f"{quantity(obstacles, 'obstacle')} and {quantity(fires, 'fire')}"
    text = (
        f"'[' is never closed; read as if ']' stood at the end of the file, which has {bodies}: add it there, and "
        "check that none is missing"
    )
    # As Python's own `warn`, but of a place in the map: once in a process, not in every run with the same file.
    registry = globals().setdefault("__warningregistry__", {})
    warnings.warn_explicit(str(refusal(source, f"line {line}", text)), MapWarning, source, line, registry=registry)


def _refuse_computed_strings(text: str, source: str) -> None:
    """Refuse f"..." and the like, which may take Python's parser the square of their length."""
    for match in _STRING.finditer(text):
        if set("fFtT") & set(match[1] or ""):
            line = text.count("\n", 0, match.start()) + 1
            raise refusal(
                source, f"line {line}", f'has a string that begins with {match[1]}; expected a plain one such as "rec"'
            )


def _calls(tree: ast.Module, source: str) -> Iterator[ast.expr]:
    """Yield the items of the list, or of several lists or bare calls one after the other."""
    for statement in tree.body:
        match statement:
            case ast.Expr(value) | ast.Assign([ast.Name()], value=ast.List() as value):
                pass
            case _:
                raise refusal(source, f"line {statement.lineno}", "expected a list of Obstacle(...)")
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
    expected = NUMBERS_OF_KIND[kind]
    if len(numbers) != expected:
        raise InvalidValueError(f"{kind} has {len(numbers)} numbers; expected {expected}")
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
            yield coordinate("coordinate", value)
        case ast.UnaryOp(ast.USub(), ast.Constant(value)):
            yield -coordinate("coordinate", value)
        case _:
            raise InvalidValueError("expected plain numbers in lists")


def _bounds(entries: list[Entry]) -> Bounds:
    if not entries:
        raise InvalidValueError("has no obstacles; expected at least one, for they define the size of a .map")
    corners = [entry.far_corner for entry in entries]
    return check_map_bounds((0.0, 0.0, max(x for x, _ in corners), max(y for _, y in corners)))


def _part(entry: Entry, bounds: Bounds, source: str) -> Shape | FireSpot:
    with name_file_in_errors(source, f"line {entry.line}"):
        part = _turn_upright(entry, height=bounds[3])
        check_inside(entry.kind, part, bounds)
    return part


def _turn_upright(entry: Entry, height: float) -> Shape | FireSpot:
    """Make the shape or fire, with y turned to point up."""
    if entry.kind == "rec":
        x0, y0, x1, y1 = entry.numbers
        return rectangle((x0, height - y0), (x1, height - y1))
    x, y, radius = entry.numbers
    centre = (x, height - y)
    return FireSpot(centre, radius) if entry.kind == "fire" else disc(centre, radius)


def svg_text(name: str, bounds: Bounds, obstacles: Iterable[Shape], fires: Iterable[FireSpot]) -> str:
    """Return the drawing of a map.

    Marks on the ground are brown, obstacles grey, fires red, the paler the cooler. One group turns y up, with the
    map's own coordinates in it: turning each shape instead would round (600 - (600 - 0.1) is not 0.1), and the map
    would not read back equal.
    """
    from xml.sax.saxutils import escape  # noqa: PLC0415 - slow to load

    width, height = number_text(bounds[2] - bounds[0]), number_text(bounds[3] - bounds[1])
    is_shifted = bounds[:2] != (0.0, 0.0)
    attribute = f' data-bounds="{" ".join(map(number_text, bounds))}"' if is_shifted else ""
    size = f'width="{width}" height="{height}"'
    # A separate group for the move: in one transform the reader would round height + y_min.
    shift = f'<g transform="translate({number_text(-bounds[0])} {number_text(-bounds[1])})">' if is_shifted else ""
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} viewBox="0 0 {width} {height}"{attribute}>',
        f"  <title>{escape(name)}</title>",
        f'  <rect class="background" {size} fill="{GROUND}"/>',
        f'  <g transform="translate(0 {height}) scale(1 -1)" fill="{SOLID}" fill-rule="evenodd">{shift}',
        *(f"    {_shape_text(shape)}" for shape in obstacles),
        *(f"    {_fire_text(fire)}" for fire in fires),
        "  </g></g>" if is_shifted else "  </g>",
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _shape_text(shape: Shape) -> str:
    look = "" if shape.contact else f' class="mark" fill="{MARK}"'
    if shape.is_disc:
        return f"<circle{look}{_round_text(shape.position.tolist(), shape.radius)}/>"
    if shape.kind == "rectangle" and _is_exact(shape.bounds):
        return f"<rect{look}{_box_text(*shape.bounds)}/>"
    rings = [shape.geometry.exterior, *shape.geometry.interiors]
    texts = [" ".join(f"{number_text(x)},{number_text(y)}" for x, y in ring.coords[:-1]) for ring in rings]
    if len(rings) == 1:
        return f'<polygon{look} points="{texts[0]}"/>'
    path = " ".join(f"M {text} Z" for text in texts)
    return f'<path{look} d="{path}"/>'


def _fire_text(fire: FireSpot) -> str:
    heat = f'data-temperature="{number_text(fire.temperature)}"'
    opacity = f"{0.35 + 0.65 * fire.temperature:.2f}"
    paint = f'fill="{FLAME}" fill-opacity="{opacity}" stroke="{RIM}" stroke-width="3"'
    return f'<circle class="fire"{_round_text(fire.position, fire.radius)} {heat} {paint}/>'


def _box_text(x_min: float, y_min: float, x_max: float, y_max: float) -> str:
    width, height = number_text(x_max - x_min), number_text(y_max - y_min)
    return f' x="{number_text(x_min)}" y="{number_text(y_min)}" width="{width}" height="{height}"'


def _round_text(centre: Iterable[float], radius: float) -> str:
    x, y = map(number_text, centre)
    return f' cx="{x}" cy="{y}" r="{number_text(radius)}"'


def _is_exact(bounds: Bounds) -> bool:
    """Return whether corner plus size gives back the other corner to the bit; if not, draw a polygon."""
    x_min, y_min, x_max, y_max = bounds
    return x_min + (x_max - x_min) == x_max and y_min + (y_max - y_min) == y_max
