"""Maps: the bounds of a world, its obstacles and fires; built in, loaded from files, and saved."""

import os
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Self, TypeVar

import numpy as np

from mesa_swarm.errors import InvalidValueError, MapError, shortened, unknown_name
from mesa_swarm.files import shown_path, write_whole
from mesa_swarm.world.map_legacy import LARGEST_LEGACY_FILE, read_legacy
from mesa_swarm.world.map_parts import (
    LARGEST_FILE,
    RADIUS_OF_UNIT_AREA,
    Bounds,
    FireSpot,
    bytes_of,
    check_inside,
    checked_bounds,
    checked_name,
    file_content,
    first_points_within,
    naming,
    refusal,
    text_of,
)
from mesa_swarm.world.map_svg import read_svg
from mesa_swarm.world.map_toml import read_toml, toml_text
from mesa_swarm.world.shapes import Shape
from mesa_swarm.world.svg_drawing import svg_text

__all__ = ["RADIUS_OF_UNIT_AREA", "FireSpot", "Map", "builtin_maps"]

BUILTIN = ("original", "sparse", "openspace", "openspace_fire")
Part = TypeVar("Part", Shape, FireSpot)
ALIASES = {"maze": "sparse"}  # the thesis's text calls it maze, its figure sparse
READABLE = (".toml", ".svg", ".map")
WRITABLE = (".toml", ".svg")


@dataclass(frozen=True, kw_only=True, slots=True)
class Map:
    """The bounds of a world, and what stands and burns in it.

    Parameters
    ----------
    name : str
        Printable, on one line.
    bounds : (x_min, y_min, x_max, y_max)
        Map units, y up; a width and height above 0, no coordinate beyond 1e9.
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

    name: str
    bounds: Bounds
    obstacles: tuple[Shape, ...] = ()
    fires: tuple[FireSpot, ...] = ()

    def __post_init__(self) -> None:
        """Check everything and keep the sequences as tuples."""
        bounds = checked_bounds(self.bounds)
        checked = {
            "name": checked_name(self.name),
            "bounds": bounds,
            "obstacles": _parts_within(bounds, "obstacle", self.obstacles, Shape),
            "fires": _parts_within(bounds, "fire", self.fires, FireSpot),
        }
        for name, value in checked.items():
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
            A Map is returned as it is. A string may be one of `builtin_maps()` or `maze`; any other
            string and every Path is a `.toml`, `.svg` or `.map` file.

        Raises
        ------
        MapError
            On one line: the file, the place in it, and what is wrong.

        Examples
        --------
        >>> Map.load("maze").name
        'sparse'
        """
        if isinstance(source, Map):
            return source
        if isinstance(source, str) and source in (*BUILTIN, *ALIASES):
            return _builtin(ALIASES.get(source, source))
        if not isinstance(source, (str, os.PathLike)):
            raise refusal("map", "", f"is {shortened(source)}; expected a Map, a name or a path")
        return _from_file(source)

    @classmethod
    def from_toml(cls, text: str, source: str = "TOML text") -> Self:
        """Return the map that a TOML text describes; errors begin with `source`.

        Examples
        --------
        >>> hall = Map(name="hall", bounds=(0, 0, 80, 60))
        >>> Map.from_toml(hall.to_toml()) == hall
        True
        """
        with naming(source):
            return cls(**read_toml(text, source))

    @classmethod
    def from_svg(cls, content: str | bytes, source: str = "drawing.svg") -> Self:
        """Return the map that an SVG drawing shows; a drawing without title is named after `source`.

        Examples
        --------
        >>> drawing = '<svg width="80" height="60"><circle cx="40" cy="20" r="5"/></svg>'
        >>> Map.from_svg(drawing).obstacles[0].position
        array([40., 40.])
        """
        with naming(source), np.errstate(all="ignore"):  # what overflows is refused as a shape, in the user's words
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
            The suffix says which format.

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
        suffix = _known_suffix(target, WRITABLE)
        write_whole(target, self.to_toml() if suffix == ".toml" else self.to_svg(), MapError, folders=False)


def builtin_maps() -> list[str]:
    """Return the names of the maps that come with the package.

    Examples
    --------
    >>> builtin_maps()
    ['original', 'sparse', 'openspace', 'openspace_fire']
    """
    return list(BUILTIN)


def _parts_within(bounds: Bounds, word: str, parts: Iterable[Part], wanted: type[Part]) -> tuple[Part, ...]:
    """Return the parts as a tuple if each is of the wanted type and partly within the bounds."""
    if not isinstance(parts, Iterable):
        raise InvalidValueError(f"{word}s is {shortened(parts)}; expected a list of {wanted.__name__}")
    checked = tuple(parts)
    for number, part in enumerate(checked, start=1):
        if not isinstance(part, wanted):
            raise InvalidValueError(f"{word} {number} is {shortened(part)}; expected a {wanted.__name__}")
    for index in np.flatnonzero(~first_points_within(checked, bounds)):
        check_inside(f"{word} {index + 1}", checked[index], bounds)
    return checked


def _builtin(name: str) -> Map:
    file = resources.files("mesa_swarm.world") / "maps" / f"{name}.toml"
    return Map.from_toml(file.read_text(encoding="utf-8"), f"{name}.toml")


def _from_file(source: str | os.PathLike[str]) -> Map:
    path, shown = _existing(source)
    suffix = _known_suffix(path, READABLE)
    content = file_content(path, LARGEST_LEGACY_FILE if suffix == ".map" else LARGEST_FILE)
    if suffix == ".svg":
        return Map.from_svg(content, shown)
    text = text_of(content, shown)
    if suffix == ".toml":
        return Map.from_toml(text, shown)
    with naming(shown):
        return Map(**read_legacy(text, shown, path.stem.strip()))


def _existing(source: str | os.PathLike[str]) -> tuple[Path, str]:
    """Return the path and how errors show it; a missing file may be a misspelt built-in name."""
    path, shown = Path(source), shown_path(source)
    try:
        exists = path.exists()
    except (OSError, ValueError):  # a name too long for the system, or with a null byte
        exists = False
    if not exists:
        names = (*BUILTIN, *ALIASES)
        if shown in names:
            raise refusal(shown, "no such file", f"a path is a file; the built-in map is the text {shown!r}")
        raise refusal(shown, "no such file", unknown_name("map", path.stem, names))
    return path, shown


def _known_suffix(path: Path, known: tuple[str, ...]) -> str:
    suffix = path.suffix.lower()
    if suffix not in known:
        raise refusal(str(path), "", f"expected a file that ends in {', '.join(known)}")
    return suffix
