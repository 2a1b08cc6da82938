"""Bodies: their table, a Mesa agent as the handle of each row, and the form of a body at any pose."""

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self, cast

import numpy as np
import shapely
from mesa import Model
from shapely import Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.geometry.polygon import orient

from mesa_swarm.base.errors import InvalidValueError, RemovedRobotError, check_number, shortened
from mesa_swarm.geometry import Bounds
from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels.elementary import direction_of, hypot, log1p, vector_lengths
from mesa_swarm.world.arena import Arena, ArenaAgent
from mesa_swarm.world.read_only import read_only
from mesa_swarm.world.shapes import Coordinates, Shape, as_numbers, disc
from mesa_swarm.world.statics import FIRE, KINDS, LOAD, MODES, OBSTACLE

# Bodies may overlap by this share of their thickness, and by more at the tips of sharp corners: it is rounding.
LOOSE = 1e-9
# Depth of the heart, as a share of the thickness: enough for lines from the outside to have a direction, and so
# little that corners of the heart are next to those of the body.
PITH = 1e-3
LARGEST_RESISTANCE = 1e9
LARGEST_HEADING = 1e9

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
            reach=radius + float(vector_lengths(*points.T).max()),
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

    def is_within(self, pose: Pose, bounds: Bounds) -> bool:
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
    cosine, sine = direction_of(heading)

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
    length = hypot(dx, dy)
    height = (a[0] * b[1] - b[0] * a[1]) / length
    if height == 0.0:
        return 0.0
    begin, end = ((p[0] * dx + p[1] * dy) / (length * abs(height)) for p in (a, b))
    return height**3 / 6.0 * (_antiderivative(end) - _antiderivative(begin))


def _antiderivative(tangent: float) -> float:
    slope = hypot(1.0, tangent)
    arc = log1p(abs(tangent) + tangent * tangent / (1.0 + slope))  # of which the tangent is the hyperbolic sine
    return tangent * slope + math.copysign(arc, tangent)


class BodyTable:
    """All bodies of a model, one row each in the order in which they were added, which is that of `model.bodies`.

    Its columns are attributes. They are written in place, and are other arrays whenever a body comes or goes.

    Attributes
    ----------
    agents : list of Body
        The handles of the rows.
    kinds : tuple of str
        Names of kinds, which the column `kind` has as codes.
    position, heading : ndarrays, shape (m, 2), (m,) rad
        Centres (of polygons the centroids), and turns since the bodies were added.
    mode, kind : int8 ndarrays, shape (m,)
        Indices of `MODES` and of `kinds`.
    contact : bool ndarray, shape (m,)
        False for marks on the ground.
    radius, reach : ndarrays, shape (m,)
        Of discs, 0 for polygons; and of bodies that may move the distance of the centre from the farthest point.
    temperature : ndarray, shape (m,)
        0 to 1, NaN for a body that does not radiate.
    resistance : ndarray, shape (m,)
        Of pushed bodies, in robots' full pushes.
    pushers, moved : int64 and bool ndarrays, shape (m,)
        How many robots pushed a body in the last step, and whether it gave way.
    aim, aim_heading : ndarrays, shape (m, 2), (m,) rad
        Where driven bodies go in the next step.
    blocked, fresh : bool ndarrays, shape (m,)
        Whether a driven body had to stop in the last step, and whether it was added after that.
    carrier : int64 ndarray, shape (m,)
        The row of the robot that carries a body, -1 for none.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel, disc
    >>> model = SwarmModel(map="openspace", rng=1)
    >>> body = model.add_body(disc((100, 100), 5))
    >>> table = model.parts["bodies"].table
    >>> [MODES[mode] for mode in table.mode], table.position[-1]  # with four walls
    (['fixed', 'fixed', 'fixed', 'fixed', 'driven'], array([100., 100.]))
    """

    columns: ClassVar[dict[str, np.ndarray]] = {
        "position": np.zeros((1, 2)),
        "heading": np.zeros(1),
        "mode": np.zeros(1, np.int8),
        "kind": np.zeros(1, np.int8),
        "contact": np.ones(1, bool),
        "radius": np.zeros(1),
        "reach": np.zeros(1),
        "temperature": np.full(1, np.nan),
        "resistance": np.zeros(1),
        "pushers": np.zeros(1, np.int64),
        "moved": np.zeros(1, bool),
        "aim": np.zeros((1, 2)),
        "aim_heading": np.zeros(1),
        "blocked": np.zeros(1, bool),
        "fresh": np.zeros(1, bool),
        "carrier": np.full(1, -1, np.int64),
    }
    position: np.ndarray
    heading: np.ndarray
    mode: np.ndarray
    kind: np.ndarray
    contact: np.ndarray
    radius: np.ndarray
    reach: np.ndarray
    temperature: np.ndarray
    resistance: np.ndarray
    pushers: np.ndarray
    moved: np.ndarray
    aim: np.ndarray
    aim_heading: np.ndarray
    blocked: np.ndarray
    fresh: np.ndarray
    carrier: np.ndarray

    def __init__(self, kinds: tuple[str, ...] = KINDS) -> None:
        self.kinds = kinds
        self.agents: list[Any] = []
        # Of each body that may move its form, and where it was last shown; of one at rest its shape.
        self.forms: list[Form | None] = []
        self._shape_cache: list[tuple[Pose | None, Shape]] = []
        self._others: list[Any] | None = []
        self._room = {name: row[:0] for name, row in self.columns.items()}
        self._publish()

    def __getstate__(self) -> dict[str, Any]:
        """Leave out columns, which are views of the arrays in which there is room for more rows."""
        return {name: value for name, value in self.__dict__.items() if name not in self.columns}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take back what `__getstate__` has returned."""
        self.__dict__.update(state)
        self._publish()

    def __len__(self) -> int:
        return len(self.agents)

    def add(self, body: Any, shape: Shape, form: Form | None = None, *, mode: int, kind: int, **values: Any) -> None:
        """Append the row of a body; a form has one that may move. Columns without a value have their usual one."""
        self.add_all([body], [shape], [form], mode=mode, kind=kind, **values)

    def add_all(
        self, bodies: Sequence[Any], shapes: Sequence[Shape], forms: Sequence[Form | None] = (), **values: Any
    ) -> None:
        """Append the rows of bodies; `values` are those of all of them, or one a body."""
        first, count = len(self.agents), len(bodies)
        forms = forms or [None] * count
        for row, body in enumerate(bodies, first):
            body.table, body.row = self, row
        self.agents += bodies
        self.forms += forms
        self._shape_cache += [(None, shape) for shape in shapes]
        self._others = None
        self._make_room(first, first + count)
        of_shapes = {
            "position": [shape.position for shape in shapes],
            "contact": [shape.contact for shape in shapes],
            "radius": [shape.radius for shape in shapes],
            "reach": [0.0 if form is None else form.reach for form in forms],
        }
        for name, value in {**of_shapes, "aim": of_shapes["position"], **values}.items():
            self._room[name][first : first + count] = value
        self._publish()

    def _make_room(self, first: int, last: int) -> None:
        """Write the usual values into rows, for which room is made, and for half as many again."""
        if last > len(self._room["mode"]):
            more = max(last - first, 4 + first // 2)
            for name, usual in self.columns.items():
                self._room[name] = np.concatenate([self._room[name][:first], np.repeat(usual, more, axis=0)])
        else:
            for name, usual in self.columns.items():
                self._room[name][first:last] = usual

    def drop(self, body: Any) -> None:
        """Remove the row of a body, which keeps what it was in a table of its own."""
        row, alone = body.row, BodyTable(self.kinds)
        alone.add(body, self._shape_cache[row][1], self.forms[row], mode=0, kind=0)
        for name, column in self._room.items():
            alone._room[name][0] = column[row]
            self._room[name] = np.delete(column, row, axis=0)
        for rows in (self.agents, self.forms, self._shape_cache):
            del rows[row]
        for later, agent in enumerate(self.agents[row:], row):
            agent.row = later
        self._others = None
        self._publish()

    def sort(self) -> None:
        """Bring the rows into the order of the handles' unique_id, in which bodies are not always made again."""
        order = sorted(range(len(self)), key=lambda row: self.agents[row].unique_id)
        if order == list(range(len(self))):
            return
        for name, column in self._room.items():
            self._room[name] = column[order]
        for rows in cast(list[list], [self.agents, self.forms, self._shape_cache]):
            rows[:] = [rows[row] for row in order]
        for row, agent in enumerate(self.agents):
            agent.row = row
        self._others = None
        self._publish()

    def _publish(self) -> None:
        for name, column in self._room.items():
            setattr(self, name, column[: len(self.agents)])

    @property
    def others(self) -> list[Any]:
        """The handles of all bodies but fires, which are numbered apart."""
        if self._others is None:
            self._others = [self.agents[row] for row in np.flatnonzero(self.kind != FIRE).tolist()]
        return self._others

    @property
    def numbers(self) -> np.ndarray:
        """Indices in `others`, shape (m,); of fires, which hide nothing, numbers that no item of `Statics` has."""
        is_fire = self.kind == FIRE
        return np.where(is_fire, len(self) + np.arange(len(self)), np.cumsum(~is_fire) - 1)

    @property
    def visible_kinds(self) -> np.ndarray:
        """Codes of the kinds as sensors see them, int8 (m,): a fire that is out is an obstacle."""
        return np.where((self.kind == FIRE) & ~(self.temperature > 0.0), np.int8(OBSTACLE), self.kind)

    def rows(self, *modes: int) -> np.ndarray:
        """Return the rows of the bodies that move in one of these ways."""
        mask = self.mode == modes[0]
        for mode in modes[1:]:
            mask |= self.mode == mode
        return np.flatnonzero(mask)

    def set_kinds(self, kinds: tuple[str, ...]) -> None:
        """Let kinds have other codes.

        Raises
        ------
        InvalidValueError
            If the kind of a body is not among them.
        """
        missing = {self.kinds[kind] for kind in np.unique(self.kind).tolist()}.difference(kinds)
        if missing:
            raise InvalidValueError(f"there are bodies of the kind {min(missing)}; expected it among {list(kinds)}")
        codes = np.array([kinds.index(name) if name in kinds else -1 for name in self.kinds], np.int8)
        self.kind[:], self.kinds = codes[self.kind], kinds

    def are_to_move(self, rows: np.ndarray) -> np.ndarray:
        """Return whether each of some driven bodies is to move in the next step."""
        moves = (self.aim[rows] != self.position[rows]).any(axis=1)
        return moves | (self.aim_heading[rows] != self.heading[rows])

    def pose_of(self, row: int) -> Pose:
        """Return where a body is: x, y, heading."""
        x, y = self.position[row].tolist()
        return x, y, float(self.heading[row])

    def put(self, row: int, pose: Sequence[float]) -> None:
        """Put a body where it is pushed to, or was before: nothing is checked, and no reading is made anew."""
        *self.position[row], self.heading[row] = *pose[:2], wrap_angle(pose[2])
        self.aim[row], self.aim_heading[row] = self.position[row], self.heading[row]

    def body_of(self, row: int) -> Shape:
        """Return the same as `shape_of`, the corners of what may move in the same order at every pose."""
        form = self.forms[row]
        return self.shape_of(row) if form is None else form.body_at(self.pose_of(row))

    def shape_of(self, row: int) -> Shape:
        """Return the shape of a body where it is."""
        form, (pose, shape) = self.forms[row], self._shape_cache[row]
        if form is None and self.kind[row] != FIRE:
            return shape
        now = self.pose_of(row)
        if pose != now or shape.radius != self.radius[row]:
            shape = disc(now[:2], float(self.radius[row])) if form is None else form.shape_at(now)
            self._shape_cache[row] = now, shape
        return shape


class Body(ArenaAgent):
    """Whatever has a shape and can be seen and bumped into, besides robots; or a mark on the ground.

    `SwarmModel.add_body` makes an `Obstacle`, which stands still, a `Load`, which robots push, or a `Driven` body. A
    `Fire` is one too.

    Attributes
    ----------
    table : BodyTable
        In which it is the row `row`; of a removed body, a table of its own.
    added_as, usual_kind : str
        Of a class of handles: the mode in which `add_body` adds such a body, and the kind that it has if none is given.
    blocked : bool
        Whether a driven body had to stop in the last step; False for all others.
    """

    added_as: ClassVar[str] = ""
    usual_kind: ClassVar[str] = KINDS[OBSTACLE]
    table: BodyTable
    row: int

    def __init__(
        self, space: Arena, model: Model, table: BodyTable, shape: Shape, kind: str, form: Form | None = None,
        **values: Any,
    ) -> None:  # fmt: skip
        super().__init__(space, model)
        table.add(self, shape, form, kind=table.kinds.index(kind), **values)

    @classmethod
    def of_shapes(
        cls, space: Arena, model: Model, table: BodyTable, shapes: Sequence[Shape], kind: str, **values: Any
    ) -> list[Self]:
        """Return bodies of these shapes that do not move by themselves, added to the table together."""
        bodies = [cls.__new__(cls) for _ in shapes]
        for body in bodies:
            super(Body, body).__init__(space, model)
        table.add_all(bodies, shapes, kind=table.kinds.index(kind), **values)
        return bodies

    def __repr__(self) -> str:
        if self.space is None:
            return f"<{type(self).__name__} {self.unique_id}, removed>"
        x, y = (round(float(number), 2) for number in self.position)
        name, mark = type(self).__name__, "" if self.contact else ", a mark"
        own = "" if self.kind in ("obstacle", "load") else f", a {self.kind}"
        return f"<{name} {self.unique_id}, {self.shape.kind} at ({x}, {y}){own}{mark}>"

    @property
    def mode(self) -> str:
        """How it moves: "fixed", "driven", "pushed", or "carried" while a robot carries it."""
        return MODES[self.table.mode[self.row]]

    @property
    def kind(self) -> str:
        """The name of what sensors see, one of `model.kinds`."""
        return self.table.kinds[self.table.kind[self.row]]

    @property
    def pose(self) -> Pose:
        """Where it is: x, y, heading."""
        return self.table.pose_of(self.row)

    @property
    def shape(self) -> Shape:
        """Its shape where it is."""
        return self.table.shape_of(self.row)

    @property
    def form(self) -> Form:
        """Its form whatever its pose, of a body that may move."""
        return self.table.forms[self.row]  # type: ignore[return-value]

    @property
    def contact(self) -> bool:
        """Whether bodies bump into it; False for a mark on the ground."""
        return bool(self.table.contact[self.row])

    @property
    def position(self) -> np.ndarray:
        """Centre of a disc or centroid of a polygon, shape (2,)."""
        return read_only(self.table.position[self.row].copy())

    @position.setter
    def position(self, value: Coordinates) -> None:
        raise InvalidValueError("obstacles do not move; remove this one and add another")

    @property
    def blocked(self) -> bool:
        """Whether it had to stop in the last step: only driven bodies ever do."""
        return False

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
        temperature = float(self.table.temperature[self.row])
        return None if math.isnan(temperature) else temperature

    @temperature.setter
    def temperature(self, value: float | None) -> None:
        temperature = check_temperature(value)
        if self.space is None:
            raise RemovedRobotError("this body has been removed; take one from model.bodies")
        if not math.isnan(temperature) and not self.contact:
            raise InvalidValueError("temperature was given for a mark on the ground, which does not radiate")
        self.table.temperature[self.row] = temperature
        self.model.parts["bodies"].heat_changed()

    def remove(self) -> None:
        """Take the body out of the world, between two steps."""
        if self.space is None:
            raise RemovedRobotError("this obstacle has been removed already; take one from model.obstacles")
        bodies = self.model.parts["bodies"]
        bodies.leave(self)
        super().remove()
        bodies.changed()


def handle_classes() -> dict[str, type[Body]]:
    """Return the classes of handles by the mode in which such bodies are added, sorted.

    Examples
    --------
    >>> from mesa_swarm.world.movers import Driven
    >>> list(handle_classes()), handle_classes()["driven"] is Driven
    (['driven', 'fixed', 'pushed'], True)
    """
    classes = {kind.added_as: kind for kind in reversed(_derived_from(Body)) if "added_as" in vars(kind)}
    return dict(sorted(classes.items()))


def _derived_from(kind: type[Body]) -> list[type[Body]]:
    children: list[type[Body]] = kind.__subclasses__()
    return [derived for child in children for derived in (child, *_derived_from(child))]


def check_temperature(value: float | None) -> float:
    """Return the temperature of a body as a float from 0 to 1, NaN for one that does not radiate."""
    return math.nan if value is None else check_number("temperature", value, minimum=0, maximum=1)


def check_resistance(value: float) -> float:
    """Return a resistance as a float if it is above 0 and at most 1e9."""
    return check_number("resistance", value, above=0, maximum=LARGEST_RESISTANCE)


def check_pose(pose: Sequence[float], space: Arena) -> Pose:
    """Return a pose of the map, x, y and a finite heading, with the heading in [-pi, pi)."""
    numbers = as_numbers(pose)
    if numbers.shape != (3,):
        raise InvalidValueError(f"pose is {shortened(pose)}; expected three numbers (x, y, heading)")
    heading = check_number("heading", float(numbers[2]), minimum=-LARGEST_HEADING, maximum=LARGEST_HEADING)
    x, y = space.checked_point(numbers[:2]).tolist()
    return x, y, wrap_angle(heading)


class Obstacle(Body):
    """A static body, or a mark painted on the ground.

    Created by `SwarmModel.add_obstacle`; take it out with `remove()`. Its `shape` is from `disc`, `rectangle` or
    `polygon`.
    """

    added_as = "fixed"
    _made_by: ClassVar[str] = "model.add_obstacle(disc((x, y), radius))"


class Load(Obstacle):
    """A body that moves while robots push harder than it resists; otherwise an obstacle.

    Created by `SwarmModel.add_load`; take it out with `remove()`. See `physics.loads` for how it moves. Its `shape` is
    that at its present pose; a new one whenever it has moved.
    """

    added_as = "pushed"
    usual_kind = KINDS[LOAD]
    _made_by: ClassVar[str] = "model.add_load(disc((x, y), radius), resistance=0.5)"

    @property
    def position(self) -> np.ndarray:
        """Its centre (of a polygon the centroid), shape (2,)."""
        return read_only(self.table.position[self.row].copy())

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
        self.table.resistance[self.row] = check_resistance(value)

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
        place = check_pose(pose, self.space)
        self.model.parts["bodies"].check_room_for_load(self.form, place, self)
        self.table.put(self.row, place)
        self.model.parts["bodies"].scene_changed()  # sensors that were read already are read again

    def lay(self, pose: Pose) -> None:
        """Move it to (x, y, heading); deprecated, see `move_to`."""
        warnings.warn("Load.lay is called move_to now", DeprecationWarning, stacklevel=2)
        self.move_to(pose)
