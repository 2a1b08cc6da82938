"""What all map files share: fire spots, bounds, limits on size, and one-line errors that name the place."""

import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.errors import GEOSException

from mesa_swarm.errors import LONGEST, InvalidValueError, MapError, UnknownNameError, check_number, shortened
from mesa_swarm.files import LONGEST_SHOWN
from mesa_swarm.world.shapes import LARGEST_COORDINATE, Shape

RADIUS_OF_UNIT_AREA = 10.0
LARGEST_FILE = 20_000_000
LONGEST_NAME = 200
# Of a path in errors, and of the errors.

Bounds = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class FireSpot:
    """Where a fire starts, how large, and how hot.

    Parameters
    ----------
    position : (x, y)
        Centre in map units, y up.
    radius : float
        Map units, above 0.
    temperature : float
        Above 0 and at most 1: a fire that starts at 0 would be out.

    Raises
    ------
    InvalidValueError
        If a number is outside its range.

    Examples
    --------
    >>> FireSpot((400, 300), 40).area
    16.0
    """

    position: tuple[float, float]
    radius: float
    temperature: float = 1.0

    def __post_init__(self) -> None:
        """Check the numbers and keep them as floats."""
        limit = LARGEST_COORDINATE
        x, y = _listed("position of a fire", self.position, 2)
        checked = {
            # adding 0 turns -0.0 into 0.0, which every file format keeps
            "position": (
                check_number("x of a fire", x, minimum=-limit, maximum=limit) + 0.0,
                check_number("y of a fire", y, minimum=-limit, maximum=limit) + 0.0,
            ),
            "radius": check_number("radius of a fire", self.radius, above=0, maximum=limit),
            "temperature": check_number("temperature of a fire", self.temperature, above=0, maximum=1),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    @property
    def area(self) -> float:
        """The area in the sense of the fire model, (radius / 10)^2, without pi."""
        return (self.radius / RADIUS_OF_UNIT_AREA) ** 2


def checked_bounds(bounds: object) -> Bounds:
    """Return `(x_min, y_min, x_max, y_max)` as floats, or say what is wrong with them.

    Examples
    --------
    >>> checked_bounds([0, 0, 800, 600])
    (0.0, 0.0, 800.0, 600.0)
    """
    names = ("x_min", "y_min", "x_max", "y_max")
    limit = LARGEST_COORDINATE
    x_min, y_min, x_max, y_max = (
        check_number(f"{name} of the bounds", value, minimum=-limit, maximum=limit) + 0.0
        for name, value in zip(names, _listed("bounds", bounds, 4), strict=True)
    )
    check_number("width of the map", x_max - x_min, above=0, maximum=limit)
    check_number("height of the map", y_max - y_min, above=0, maximum=limit)
    return x_min, y_min, x_max, y_max


def checked_name(name: object) -> str:
    """Return a map's name: printable, on one line, without spaces around it.

    Examples
    --------
    >>> checked_name("original")
    'original'
    """
    if not isinstance(name, str) or not name.isprintable() or not name.strip():
        raise InvalidValueError(f"name of the map is {shortened(name)}; expected a word or two")
    if name != name.strip() or len(name) > LONGEST_NAME:
        limit = f"at most {LONGEST_NAME} characters, no spaces around them"
        raise InvalidValueError(f"name of the map is {shortened(name)}; expected {limit}")
    return name


def check_inside(what: str, part: Shape | FireSpot, bounds: Bounds) -> None:
    """Refuse an obstacle or fire of which nothing lies within the bounds.

    Raises
    ------
    InvalidValueError
        Naming `what`, where it is and what the bounds are.
    """
    if first_points_within([part], bounds).all():
        return  # a tenth of the work
    geometry = part.geometry if isinstance(part, Shape) else shapely.Point(part.position)
    with np.errstate(all="ignore"):  # of a map of almost no width, the geometry library divides by it
        distance = shapely.distance(geometry, shapely.box(*bounds))
    if distance > part.radius:
        x, y = geometry.centroid.coords[0]
        area = "({:g}, {:g}) to ({:g}, {:g})".format(*bounds)
        raise InvalidValueError(f"{what} at ({x:g}, {y:g}) lies outside the map, which spans {area}")


def first_points_within(parts: Sequence[Shape | FireSpot], bounds: Bounds) -> np.ndarray:
    """Return for each obstacle or fire whether the first of its points is within the bounds, as it nearly always is.

    Examples
    --------
    >>> first_points_within([FireSpot((9, 9), 1), FireSpot((99, 9), 1)], (0, 0, 20, 20))
    array([ True, False])
    """
    if not parts:
        return np.empty(0, bool)
    geometries = [part.geometry for part in parts if isinstance(part, Shape)]
    if geometries:
        points, owner = shapely.get_coordinates(geometries, return_index=True)
        x, y = points[np.searchsorted(owner, np.arange(len(parts)))].T
    else:
        x, y = np.array([part.position for part in parts]).T
    return (bounds[0] <= x) & (x <= bounds[2]) & (bounds[1] <= y) & (y <= bounds[3])


def refusal(source: str, place: str, why: object) -> MapError:
    """Return the error that says on one line which file, where in it, and why.

    Examples
    --------
    >>> refusal("arena.svg", "<rect> on line 7", "width is -5")
    MapError('arena.svg: <rect> on line 7: width is -5')
    """
    text = ": ".join(str(part) for part in (_last(source), place, why) if part)
    return MapError(_cut(" ".join(text.split())))


def _last(text: str) -> str:
    return text if len(text) <= LONGEST_SHOWN + 3 else f"...{text[-LONGEST_SHOWN:]}"


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."


@contextmanager
def naming(source: str, place: str = "") -> Iterator[None]:
    """Turn a wrong value into a MapError that names the file and the place."""
    try:
        yield
    except (InvalidValueError, UnknownNameError) as error:
        raise refusal(source, place, error) from None
    except GEOSException as error:  # rounding that the geometry library finds no way around
        raise refusal(source, place, f"is beyond what geometry can compute: {error}") from None


def file_content(path: Path, limit: int = LARGEST_FILE) -> bytes:
    """Return a file's bytes; look at its kind and size before reading it.

    Raises
    ------
    MapError
        If it is missing, a folder or device, unreadable, or larger than `limit` bytes.
    """
    try:
        about = path.stat()
        if not stat.S_ISREG(about.st_mode):
            raise refusal(str(path), "", "is a folder or device; expected a file")
        if about.st_size > limit:
            raise refusal(str(path), "", f"has {about.st_size} bytes; expected at most {limit}")
        return path.read_bytes()
    except OSError as error:
        raise refusal(str(path), "", error.strerror) from None


def text_of(content: bytes, source: str) -> str:
    """Return UTF-8 bytes as text, without a byte-order mark."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise refusal(source, f"byte {error.start + 1}", "not UTF-8 text") from None


def bytes_of(content: str | bytes, source: str) -> bytes:
    """Return text as UTF-8, and bytes as they are.

    Examples
    --------
    >>> bytes_of("<svg/>", "hall.svg")
    b'<svg/>'
    """
    try:
        return content.encode() if isinstance(content, str) else content
    except UnicodeEncodeError as error:  # half of a surrogate pair
        raise refusal(source, f"character {error.start + 1}", "not Unicode text") from None


def _listed(name: str, value: Any, length: int) -> tuple:
    """Return the items of a list, tuple or array of the wanted length."""
    try:
        items = () if isinstance(value, (str, bytes)) or not hasattr(value, "__len__") else tuple(value)
    except Exception:  # whatever a class of the user's raises instead of being a list
        items = ()
    if len(items) != length:
        raise InvalidValueError(f"{name} is {shortened(value)}; expected {length} numbers")
    return items
