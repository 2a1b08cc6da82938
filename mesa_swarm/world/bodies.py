"""Obstacles and loads: bodies with a shape, as Mesa agents, and the form of a body at any pose."""

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import shapely
from mesa import Model
from shapely import Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from mesa_swarm.errors import InvalidValueError, RemovedRobotError, check_number, shortened
from mesa_swarm.geometry.overlap import wrapped
from mesa_swarm.world.arena import Arena, ArenaAgent
from mesa_swarm.world.read_only import read_only
from mesa_swarm.world.shapes import Coordinates, Shape, as_numbers
from mesa_swarm.world.statics import KINDS, LOAD, OBSTACLE

# Bodies may overlap by this share of their thickness, and by more at the tips of sharp corners: it is rounding.
LOOSE = 1e-9
# Depth of the heart, as a share of the thickness: enough for lines from the outside to have a direction, and so
# little that corners of the heart are next to those of the body.
PITH = 1e-3
LARGEST_RESISTANCE = 1e9

Pose = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Form:
    """The form of a body independent of its pose, as Shapely geometries about its centre.

    Parameters
    ----------
    outline : shapely Point or Polygon
        A Point at the origin is the centre of a disc.
    radius : float
        Radius of the disc; 0 for a polygon.
    core : shapely geometry
        The body without the skin that may overlap others; a Point for a disc.
    core_radius : float
        Radius of the core of a disc; 0 for a polygon.
    heart : shapely geometry
        The body without a thicker skin; never empty. Lines to it have a direction even where bodies touch.
    reach : float
        Distance of the centre from the farthest point.
    thickness : float
        Radius of the largest disc within.
    lever : float
        Mean distance of the points of the body from its centre, see `mean_distance`.
    """

    outline: Point | Polygon
    radius: float
    core: BaseGeometry
    core_radius: float
    heart: BaseGeometry
    reach: float
    thickness: float
    lever: float

    @classmethod
    def of(cls, shape: Shape) -> "Form":
        """Return the form of a shape.

        Examples
        --------
        >>> from mesa_swarm.world.shapes import rectangle
        >>> round(Form.of(rectangle((100, 100), (130, 140))).reach, 9)
        25.0
        """
        centre = shape.position
        return cls.about_origin(shapely.transform(shape.geometry, lambda points: points - centre), shape.radius)

    @classmethod
    def about_origin(cls, outline: Point | Polygon, radius: float) -> "Form":
        """Return the form of an outline that is centred on the origin."""
        is_disc = isinstance(outline, Point)
        thickness = radius or shapely.maximum_inscribed_circle(outline).length
        skin = LOOSE * thickness
        points = shapely.get_coordinates(outline)
        return cls(
            outline=outline,
            radius=radius,
            core=outline if is_disc else outline.buffer(-skin, join_style="mitre"),
            core_radius=radius - skin if is_disc else 0.0,
            heart=outline if is_disc else outline.buffer(-PITH * thickness, join_style="mitre"),
            reach=radius + float(np.hypot(*points.T).max()),
            thickness=thickness,
            lever=mean_distance(outline, radius),
        )

    def shape_at(self, pose: Pose) -> Shape:
        """Return the shape of the body at (x, y, heading)."""
        return Shape(shapely.normalize(placed(self.outline, pose)), self.radius)

    def body_at(self, pose: Pose) -> Shape:
        """Return the same, its corners in the same order at every pose instead of in normal form."""
        return Shape(placed(self.outline, pose), self.radius)

    def overlaps(self, pose: Pose, shape: Shape) -> bool:
        """Return whether the body in this pose overlaps a shape by more than rounding."""
        return self.meets(pose, shape.geometry, shape.radius)

    def meets(self, pose: Pose, geometry: BaseGeometry, radius: float) -> bool:
        """Return whether it overlaps, by more than rounding, what lies within a radius of a geometry."""
        return bool(shapely.distance(placed(self.core, pose), geometry) <= self.core_radius + radius)

    def is_within(self, pose: Pose, bounds: tuple[float, float, float, float]) -> bool:
        """Return whether the body in this pose is within a map."""
        x_min, y_min, x_max, y_max = placed(self.core, pose).bounds
        r = self.core_radius
        return bounds[0] <= x_min - r and bounds[1] <= y_min - r and x_max + r <= bounds[2] and y_max + r <= bounds[3]


def placed(geometry: BaseGeometry, pose: Pose) -> BaseGeometry:
    """Return a geometry about the origin turned by the heading and moved to the place of a pose.

    Examples
    --------
    >>> placed(Point(2, 0), (10.0, 5.0, 0.0)).wkt
    'POINT (12 5)'
    """
    x, y, heading = pose
    cosine, sine = math.cos(heading), math.sin(heading)

    def move(points: np.ndarray) -> np.ndarray:
        return np.column_stack(
            [cosine * points[:, 0] - sine * points[:, 1] + x, sine * points[:, 0] + cosine * points[:, 1] + y]
        )

    return shapely.transform(geometry, move)


def mean_distance(outline: Point | Polygon, radius: float) -> float:
    r"""Return the mean distance of the points of a body from the origin, which is its centre.

    Two thirds of the radius of a disc. A polygon is the sum of the triangles between the origin and each
    edge, counted negative where the edge runs the other way round: with the distance h of the edge's line
    from the origin, and azimuths a and b of the edge's ends from the foot of the perpendicular,

    .. math:: \int r\,dA = \frac{h^3}{6} \left[\sec t \tan t + \operatorname{asinh} \tan t\right]_a^b

    Examples
    --------
    >>> round(mean_distance(shapely.box(-1, -1, 1, 1), 0.0), 6)  # (sqrt 2 + asinh 1) / 3
    0.765196
    """
    if isinstance(outline, Point):
        return 2.0 * radius / 3.0
    polygon = orient(outline)
    rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
    moments = [_moment(a, b) for ring in rings for a, b in zip(ring[:-1].tolist(), ring[1:].tolist(), strict=True)]
    return math.fsum(moments) / polygon.area


def _moment(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Return the integral of the distance from the origin over the triangle between it and an edge."""
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = math.hypot(dx, dy)
    height = (a[0] * b[1] - b[0] * a[1]) / length
    if height == 0.0:
        return 0.0
    begin, end = ((p[0] * dx + p[1] * dy) / (length * abs(height)) for p in (a, b))
    return height**3 / 6.0 * (_antiderivative(end) - _antiderivative(begin))


def _antiderivative(tangent: float) -> float:
    return tangent * math.hypot(1.0, tangent) + math.asinh(tangent)


class Body(ArenaAgent):
    """Whatever has a shape and can be seen and bumped into, besides robots; or a mark on the ground.

    `SwarmModel.add_body` makes an `Obstacle`, which stands still, a `Load`, which robots push, or a `Driven` body. A
    `Fire` is one too.

    Attributes
    ----------
    mode : str
        "fixed", "pushed" or "driven".
    temperature : float or None
        How hot it is, 0 to 1, if it radiates heat.
    blocked : bool
        Whether a driven body had to stop in the last step; False for all others.
    """

    mode = "fixed"
    _kind: str
    _temperature: float | None

    def __init__(self, space: Arena, model: Model, kind: str) -> None:
        self._kind, self._temperature = kind, None
        super().__init__(space, model)

    def __repr__(self) -> str:
        if self.space is None:
            return f"<{type(self).__name__} {self.unique_id}, removed>"
        x, y = (round(float(number), 2) for number in self.position)
        name, mark = type(self).__name__, "" if self.contact else ", a mark"
        own = "" if self.kind in ("obstacle", "load") else f", a {self.kind}"
        return f"<{name} {self.unique_id}, {self.shape.kind} at ({x}, {y}){own}{mark}>"

    @property
    def blocked(self) -> bool:
        """Whether it had to stop in the last step: only driven bodies ever do."""
        return False

    @property
    def kind(self) -> str:
        """The name of what sensors see, one of `model.kinds`."""
        return self._kind

    @property
    def temperature(self) -> float | None:
        """How hot it is, 0 to 1, as radiation sensors read it; None for a body that does not radiate.

        Examples
        --------
        >>> from mesa_swarm import AGENT_HEAT, SwarmModel, disc
        >>> model = SwarmModel(rng=1)
        >>> lamp = model.add_body(disc((100, 100), 8), kind="lamp", mode="fixed", temperature=1.0)
        >>> (robot,) = model.add_robots(AGENT_HEAT, poses=[(60, 100, 0.0)])
        >>> lamp.temperature = 0.25
        >>> model.sense()
        >>> float(robot.radiation.max())
        0.25
        """
        return self._temperature

    @temperature.setter
    def temperature(self, value: float | None) -> None:
        checked = checked_temperature(value)
        if self.space is None:
            raise RemovedRobotError("this body has been removed; take one from model.bodies")
        if checked is not None and not self.contact:
            raise InvalidValueError("temperature was given for a mark on the ground, which does not radiate")
        self._temperature = checked
        self.model.parts["bodies"].heat_changed()

    @property
    def contact(self) -> bool:
        """Whether bodies bump into it; False for a mark on the ground."""
        return self.shape.contact

    def remove(self) -> None:
        """Take the body out of the world, between two steps."""
        if self.space is None:
            raise RemovedRobotError("this obstacle has been removed already; take one from model.obstacles")
        model = self.model
        model.parts["bodies"].leave(self)
        super().remove()
        model.parts["bodies"].changed()

    if TYPE_CHECKING:  # an attribute, or what follows from the pose
        shape: Shape


def checked_temperature(value: float | None) -> float | None:
    """Return the temperature of a body as a float from 0 to 1, None for one that does not radiate."""
    return None if value is None else check_number("temperature", value, minimum=0, maximum=1)


class BodyTable:
    """Columns of bodies, one row each, in the order in which they were added; `agents` are their handles.

    `columns` are the attributes that are columns, as they are without any body.
    """

    columns: ClassVar[dict[str, np.ndarray]] = {"position": np.empty((0, 2)), "heading": np.empty(0)}
    position: np.ndarray
    heading: np.ndarray

    def __init__(self) -> None:
        self.agents: list[Any] = []
        for name, column in self.columns.items():
            setattr(self, name, column.copy())

    def __len__(self) -> int:
        return len(self.agents)

    def __iter__(self) -> Iterator[Any]:
        return iter(self.agents)

    def __getitem__(self, row: int) -> Any:
        return self.agents[row]

    def add(self, body: Any, **values: Any) -> None:
        """Append the row of a body; columns without a value are 0 there."""
        body.row = len(self.agents)
        self.agents.append(body)
        for name, column in self.columns.items():
            row = np.zeros((1, *column.shape[1:]), column.dtype)
            row[0] = values.get(name, 0)
            setattr(self, name, np.concatenate([getattr(self, name), row]))

    def drop(self, body: Any) -> None:
        """Remove the row of a body."""
        row, body.row = body.row, -1
        for name in self.columns:
            setattr(self, name, np.delete(getattr(self, name), row, axis=0))
        del self.agents[row]
        for later, agent in enumerate(self.agents):
            agent.row = later


class Obstacle(Body):
    """A static body, or a mark painted on the ground.

    Created by `SwarmModel.add_obstacle`; take it out with `remove()`. Its `shape` is from `disc`, `rectangle` or
    `polygon`.
    """

    shape: Shape
    _made_by: ClassVar[str] = "model.add_obstacle(disc((x, y), radius))"

    def __init__(self, space: Arena, model: Model, shape: Shape, kind: str = KINDS[OBSTACLE]) -> None:
        self.shape = shape
        super().__init__(space, model, kind)
        space._agent_positions[self._mesa_index] = shape.position

    @property
    def position(self) -> np.ndarray:
        """Centre of a disc or centroid of a polygon, shape (2,)."""
        return self.shape.position

    @position.setter
    def position(self, value: Coordinates) -> None:
        raise InvalidValueError("obstacles do not move; remove this one and add another")


class Loads(BodyTable):
    """The poses of all loads of a model, and what happened to them in the last step.

    Attributes
    ----------
    position, heading : ndarrays, shape (m, 2), (m,) rad
    resistance : ndarray, shape (m,)
        In robots' full pushes.
    pushers : int64 ndarray, shape (m,)
        Number of robots that pushed each in the last step.
    moved : bool ndarray, shape (m,)
        Whether it moved in the last step.
    """

    columns: ClassVar[dict[str, np.ndarray]] = BodyTable.columns | {
        "resistance": np.empty(0),
        "pushers": np.empty(0, np.int64),
        "moved": np.empty(0, bool),
    }
    resistance: np.ndarray
    pushers: np.ndarray
    moved: np.ndarray

    def add(self, body: "Load", **values: Any) -> None:
        """Append the row of a load."""
        super().add(body, **values)
        body.table = self

    def drop(self, body: "Load") -> None:
        """Remove the row of a load, which keeps what it was in a table of its own."""
        was = {name: getattr(self, name)[body.row].copy() for name in self.columns}
        super().drop(body)
        Loads().add(body, **was)

    def rest(self) -> None:
        """Forget the last step."""
        self.pushers[:], self.moved[:] = 0, False


class Load(Obstacle):
    """A body that moves while robots push harder than it resists; otherwise an obstacle.

    Created by `SwarmModel.add_load`; take it out with `remove()`. See `physics.loads` for how it moves.

    Attributes
    ----------
    shape : Shape
        At its present pose; a new one whenever it has moved.
    table : Loads
        The columns in which its pose is, in the row `row`; of a removed load, its own.
    """

    mode = "pushed"

    form: Form
    table: Loads
    row: int
    _shown: tuple[Pose, Shape] | None
    _made_by: ClassVar[str] = "model.add_load(disc((x, y), radius), resistance=0.5)"

    def __init__(
        self, space: Arena, model: Model, shape: Shape, table: Loads, resistance: float, kind: str = KINDS[LOAD]
    ) -> None:
        self.form = Form.of(shape)
        self._shown = None
        self.table, self.row = table, -1
        Body.__init__(self, space, model, kind)
        table.add(self, position=shape.position, resistance=checked_resistance(resistance))

    @property
    def pose(self) -> Pose:
        """Where it is: x, y, heading."""
        x, y = self.table.position[self.row].tolist()
        return x, y, self.heading

    @property
    def shape(self) -> Shape:  # type: ignore[override]
        """Its shape where it is."""
        pose = self.pose
        if self._shown is None or self._shown[0] != pose:
            self._shown = pose, self.form.shape_at(pose)
        return self._shown[1]

    @property
    def position(self) -> np.ndarray:
        """Its centre (of a polygon the centroid), shape (2,)."""
        return read_only(self.pose[:2])

    @position.setter
    def position(self, value: Coordinates) -> None:
        raise InvalidValueError(
            "loads move only when robots push them; use move_to((x, y, heading)) to move one by hand"
        )

    @property
    def heading(self) -> float:
        """Its turn since it was added, rad in [-pi, pi), counter-clockwise."""
        return float(self.table.heading[self.row])

    @property
    def resistance(self) -> float:
        """Number of robots' full pushes that it withstands; it moves only when pushed harder than that."""
        return float(self.table.resistance[self.row])

    @resistance.setter
    def resistance(self, value: float) -> None:
        self.table.resistance[self.row] = checked_resistance(value)

    @property
    def moved(self) -> bool:
        """Whether it moved in the last step."""
        return bool(self.table.moved[self.row])

    @property
    def pushers(self) -> int:
        """Number of robots that pushed it in the last step."""
        return int(self.table.pushers[self.row])

    def move_to(self, pose: Sequence[float]) -> None:
        """Move it by hand to (x, y, heading), between two steps; robots there give way in the next step.

        Raises
        ------
        InvalidValueError
            If the pose is not three finite numbers, or the load would not be within the map, or would overlap an
            obstacle, a fire or another load.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel, disc
        >>> load = SwarmModel(rng=1).add_load(disc((100, 100), 10), resistance=1.0)
        >>> load.move_to((120, 100, 0.0))
        >>> load.position
        array([120., 100.])
        """
        numbers = as_numbers(pose)
        if numbers.shape != (3,):
            raise InvalidValueError(f"pose is {shortened(pose)}; expected three numbers (x, y, heading)")
        heading = wrapped(check_number("heading", float(numbers[2]), minimum=-1e9, maximum=1e9))
        place = self.space.checked_point(numbers[:2]).tolist()
        self.model.parts["bodies"].check_room_for_load(self.form, (*place, heading), self)
        self.put((*place, heading))
        self.model.parts["bodies"].changed()  # sensors that were read already are read again

    def put(self, pose: Pose) -> None:
        """Put it where it is pushed to, or was before: nothing is checked, and no reading is made anew."""
        *self.table.position[self.row], self.table.heading[self.row] = *pose[:2], wrapped(pose[2])

    def lay(self, pose: Pose) -> None:
        """Move it to (x, y, heading); deprecated, see `move_to`."""
        warnings.warn("Load.lay is called move_to now", DeprecationWarning, stacklevel=2)
        self.move_to(pose)

    def note(self, *, moved: bool, pushers: int) -> None:
        """Write what happened to it in the last step."""
        self.table.moved[self.row], self.table.pushers[self.row] = moved, pushers

    def farthest_from(self, pose: Pose) -> float:
        """Return an upper bound of the distance of its points from where they are at another pose."""
        x, y, heading = self.pose
        turned = 2.0 * abs(math.sin((heading - pose[2]) / 2.0))
        return math.hypot(x - pose[0], y - pose[1]) + self.form.reach * turned


def checked_resistance(value: float) -> float:
    """Return a resistance as a float if it is above 0 and at most 1e9."""
    return check_number("resistance", value, above=0, maximum=LARGEST_RESISTANCE)
