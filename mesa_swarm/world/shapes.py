"""Shapes of bodies and marks: discs, rectangles and polygons, as Shapely geometries."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TypeGuard

import numpy as np
import shapely
from shapely.geometry import Point, Polygon

from mesa_swarm.base.errors import InvalidValueError, check_number, shortened
from mesa_swarm.geometry import Bounds
from mesa_swarm.geometry.masked_arrays import fill_masked, holds_masked
from mesa_swarm.world.read_only import read_only

LARGEST_COORDINATE = 1e9
MOST_VERTICES = 200_000

Coordinates = Sequence[float] | np.ndarray


class Computed:
    """What Shapely computes of a shape, once: worlds of one map share its shapes. No field: copies compute it anew."""

    __slots__ = ("_centre", "_hash")
    _centre: np.ndarray
    _hash: int


@dataclass(frozen=True, slots=True, eq=False)
class Shape(Computed):
    """A disc or a simple polygon with holes, solid or a mark on the ground.

    Build one with `disc`, `rectangle` or `polygon`, which check their arguments.

    Parameters
    ----------
    geometry : shapely Point or Polygon
        A Point is the centre of a disc. Polygons are in Shapely's normal form, so that equal shapes have equal
        coordinates. y points up.
    radius : float
        Radius of the disc; 0 for a polygon.
    contact : bool
        False makes it a ground mark: line sensors see it, robots drive over it.
    """

    geometry: Point | Polygon
    radius: float = 0.0
    contact: bool = field(default=True, kw_only=True)

    @property
    def is_disc(self) -> bool:
        """Whether this is a disc."""
        return isinstance(self.geometry, Point)

    @property
    def kind(self) -> str:
        """The name of the shape in map files: disc, rectangle or polygon."""
        if self.is_disc:
            return "disc"
        box = shapely.box(*self.geometry.bounds)
        return "rectangle" if self.geometry.equals_exact(shapely.normalize(box)) else "polygon"

    @property
    def bounds(self) -> Bounds:
        """Smallest and largest x and y: (x_min, y_min, x_max, y_max)."""
        x_min, y_min, x_max, y_max = self.geometry.bounds
        return x_min - self.radius, y_min - self.radius, x_max + self.radius, y_max + self.radius

    @property
    def position(self) -> np.ndarray:
        """The centre of a disc, or a polygon's centroid."""
        if not hasattr(self, "_centre"):
            centre = self.geometry if self.is_disc else shapely.centroid(self.geometry)
            object.__setattr__(self, "_centre", read_only(shapely.get_coordinates(centre)[0]))
        return self._centre

    def __eq__(self, other: object) -> bool:
        """Compare coordinates, radius and contact exactly."""
        if not isinstance(other, Shape):
            return NotImplemented
        return self is other or self._key() == other._key()

    def __hash__(self) -> int:
        """Hash what equality compares."""
        if not hasattr(self, "_hash"):
            object.__setattr__(self, "_hash", hash(self._key()))
        return self._hash

    def _key(self) -> tuple:
        return self.geometry.wkb, self.radius, self.contact


def disc(centre: Coordinates, radius: float, *, contact: bool = True) -> Shape:
    """Return a disc.

    Parameters
    ----------
    centre : (x, y)
        Map units, y up.
    radius : float
        Above 0.
    contact : bool
        False for a mark on the ground.

    Raises
    ------
    InvalidValueError
        If a number is not finite or the radius is not above 0.

    Examples
    --------
    >>> disc((10, 20), 5).kind
    'disc'
    """
    x, y = _check_points("centre", [centre])[0]
    size = check_number("radius", radius, above=0, maximum=LARGEST_COORDINATE)
    return Shape(Point(x, y), size, contact=bool(contact))


def rectangle(corner: Coordinates, opposite: Coordinates, *, contact: bool = True) -> Shape:
    """Return an axis-parallel rectangle given by two opposite corners.

    Raises
    ------
    InvalidValueError
        If its area is zero or a number is not finite.

    Examples
    --------
    >>> rectangle((0, 0), (20, 600)).bounds
    (0.0, 0.0, 20.0, 600.0)
    """
    (x0, y0), (x1, y1) = _check_points("rectangle's corners", [corner, opposite])
    if (x1 - x0) * (y1 - y0) == 0:
        corners = f"({x0:g}, {y0:g}) to ({x1:g}, {y1:g})"
        raise InvalidValueError(f"rectangle from {corners} has no area; give opposite corners")
    box = shapely.box(min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
    return Shape(shapely.normalize(box), contact=bool(contact))


def polygon(
    outline: Iterable[Coordinates], holes: Iterable[Iterable[Coordinates]] = (), *, contact: bool = True
) -> Shape:
    """Return a simple polygon, convex or not, with or without holes.

    Parameters
    ----------
    outline : sequence of (x, y)
        Corner points in order, either way round, at least three; closing it is optional.
    holes : sequence of outlines
        Each within the outline.
    contact : bool
        False for a mark on the ground.

    Raises
    ------
    InvalidValueError
        If the outline crosses or touches itself (a bow-tie, a spike), has no area, or a number is not finite.

    Examples
    --------
    >>> polygon([(0, 0), (10, 0), (0, 10)]).kind
    'polygon'
    """
    shell, *rings = check_rings(outline, holes)
    is_plain = not rings and (shell[0] != shell[-1]).any()  # as most are, and then made in a fifth of the time
    geometry = shapely.polygons(shell) if is_plain else Polygon(shell, rings)
    if not geometry.is_valid:
        reason = shapely.is_valid_reason(geometry)
        raise InvalidValueError(f"polygon is not simple ({reason}); its outline may not cross itself")
    if geometry.area == 0:
        raise InvalidValueError("polygon has no area; give corner points that enclose some")
    return Shape(shapely.normalize(geometry), contact=bool(contact))


def shape_to_json(shape: Shape) -> dict:
    """Return a disc as x, y and radius, a polygon as its rings, from which `shape_from_json` makes the same again.

    Examples
    --------
    >>> shape_to_json(disc((1, 2), 3, contact=False))
    {'disc': [1.0, 2.0, 3.0], 'mark': True}
    """
    return {**outline_to_json(shape.geometry, shape.radius), **({} if shape.contact else {"mark": True})}


def outline_to_json(geometry: Point | Polygon, radius: float) -> dict:
    """Return the same of a bare geometry: a Point with its radius, or a Polygon."""
    if isinstance(geometry, Point):
        return {"disc": [geometry.x, geometry.y, radius]}
    return {"rings": [shapely.get_coordinates(ring)[:-1].tolist() for ring in (geometry.exterior, *geometry.interiors)]}


def shape_from_json(value: dict) -> Shape:
    """Return the shape that `shape_to_json` wrote.

    Raises
    ------
    InvalidValueError, TypeError, ValueError, LookupError
        If there is no such shape: the JSON is not checked before.

    Examples
    --------
    >>> shape_from_json({"rings": [[[0, 0], [10, 0], [0, 10]]]}).kind
    'polygon'
    """
    contact = not value.get("mark", False)
    if "disc" in value:
        x, y, radius = value["disc"]
        return disc((x, y), radius, contact=contact)
    outline, *holes = [np.array(ring, dtype=float) for ring in value["rings"]]
    return polygon(outline, holes, contact=contact)


def check_rings(outline: Iterable[Coordinates], holes: Iterable[Iterable[Coordinates]] = ()) -> list[np.ndarray]:
    """Return the outline of a polygon and its holes as (n, 2) arrays of 3 to 200,000 finite points, not yet a polygon.

    Examples
    --------
    >>> [len(ring) for ring in check_rings([(0, 0), (10, 0), (0, 10)])]
    [3]
    """
    shell = _check_points("outline", outline)
    if not isinstance(holes, Iterable):
        raise InvalidValueError(f"holes is {shortened(holes)}; expected a list of outlines")
    rings = [shell, *(_check_points("hole", hole) for hole in holes)]
    if min(map(len, rings)) < 3:
        raise InvalidValueError("polygon has an outline of fewer than 3 points; give at least 3")
    return rings


def _check_points(name: str, points: Iterable[Coordinates]) -> np.ndarray:
    """Return (n, 2) finite floats; refuse anything else before memory is spent on it."""
    if not isinstance(points, Iterable):
        raise InvalidValueError(f"{name} is {shortened(points)}; expected a list of points (x, y)")
    points = fill_masked(points) if holds_masked(points) else points
    if _is_table(points) and len(points) <= MOST_VERTICES and (np.abs(points) <= LARGEST_COORDINATE).all():
        return points + 0.0
    pairs = []
    for point in points:
        x, y = _pair(name, point)
        if not (abs(x) <= LARGEST_COORDINATE and abs(y) <= LARGEST_COORDINATE):  # also refuses NaN
            limit = f"finite coordinates of at most {LARGEST_COORDINATE:g}"
            raise InvalidValueError(f"{name} has the point ({x}, {y}); expected {limit}")
        pairs.append((x, y))
        if len(pairs) > MOST_VERTICES:
            raise InvalidValueError(f"{name} has more than {MOST_VERTICES} points; simplify it first")
    return np.array(pairs).reshape(-1, 2)


def _is_table(points: Iterable[Coordinates]) -> TypeGuard[np.ndarray]:
    """Return whether the points are an array of pairs of floats, which can be checked at once."""
    return isinstance(points, np.ndarray) and points.dtype == float and points.ndim == 2 and points.shape[1] == 2


def _pair(name: str, point: Coordinates) -> tuple[float, float]:
    try:
        x, y = point
        if not isinstance(x, (str, bool)) and not isinstance(y, (str, bool)):
            return float(x) + 0.0, float(y) + 0.0  # adding 0 turns -0.0 into 0.0: equal shapes, equal bytes
    except (TypeError, ValueError, OverflowError):
        pass
    raise InvalidValueError(f"{name} has the point {shortened(point)}; expected two numbers (x, y)")


def as_numbers(value: object) -> np.ndarray:
    """Return a user's value as an array of floats, masked ones NaN; an empty one if it does not hold numbers alone."""
    try:
        array = fill_masked(value)
        if array.dtype.kind in "iufO":
            return array.astype(float)
    except Exception:
        pass
    return np.empty(0)
