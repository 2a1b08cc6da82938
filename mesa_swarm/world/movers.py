"""Driven bodies: their poses in one table, and a Mesa agent as the handle of each."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, ClassVar

import numpy as np
import shapely
from mesa import Agent, Model
from shapely.geometry.base import BaseGeometry

from mesa_swarm.errors import InvalidValueError, RemovedRobotError, check_number, shortened
from mesa_swarm.geometry.overlap import wrapped
from mesa_swarm.world.arena import Arena
from mesa_swarm.world.bodies import Body, BodyTable, Form, Pose
from mesa_swarm.world.read_only import read_only
from mesa_swarm.world.shapes import Coordinates, Shape, as_numbers

LARGEST_HEADING = 1e9


class Movers(BodyTable):
    """The poses of all driven bodies of a model, one row each, in the order in which they were added.

    A pose that is set is a request: the body goes there in the phase move of the next step, as far as robots
    can give way. A body that was added after the last step is placed at once.

    Attributes
    ----------
    agents : list of Driven
    position, heading : ndarrays, shape (m, 2), (m,) rad
        Where the bodies are.
    aim, aim_heading : ndarrays, shape (m, 2), (m,) rad
        Where they go in the next step.
    blocked : bool ndarray, shape (m,)
        Whether a body stopped in the last step, because robots or a load could not give way.
    fresh : bool ndarray, shape (m,)
        Whether it was added after the last step.
    carried : bool ndarray, shape (m,)
        Whether a robot carries it: it is where the robot is, and nothing sees it or bumps into it.
    reach : ndarray, shape (m,)
        Distance of its centre from its farthest point.
    """

    columns: ClassVar[dict[str, np.ndarray]] = BodyTable.columns | {
        "aim": np.empty((0, 2)),
        "aim_heading": np.empty(0),
        "blocked": np.empty(0, bool),
        "fresh": np.empty(0, bool),
        "carried": np.empty(0, bool),
        "reach": np.empty(0),
    }
    aim: np.ndarray
    aim_heading: np.ndarray
    blocked: np.ndarray
    fresh: np.ndarray
    carried: np.ndarray
    reach: np.ndarray

    def __init__(self) -> None:
        super().__init__()
        self.followers: list[Driven] = []

    def add(self, body: "Driven", **values: Any) -> None:
        """Append the row of a body."""
        super().add(body, **values)
        self.list_followers()

    def drop(self, body: "Driven") -> None:
        """Remove the row of a body."""
        super().drop(body)
        self.list_followers()

    def list_followers(self) -> None:
        """Update the list of bodies that follow an agent."""
        self.followers = [body for body in self.agents if body.agent is not None]

    @property
    def asked(self) -> np.ndarray:
        """Whether each body is to move in the next step, shape (m,)."""
        return (self.aim != self.position).any(axis=1) | (self.aim_heading != self.heading)

    @property
    def poses(self) -> tuple[np.ndarray, ...]:
        """Where all bodies are and where they go: position, heading, aim, aim_heading."""
        return self.position, self.heading, self.aim, self.aim_heading

    def rest(self) -> None:
        """Forget all requests: those of the step that ends are done or were blocked."""
        self.aim[:], self.aim_heading[:] = self.position, self.heading

    def carry_along(self) -> None:
        """Put carried bodies where their robots are."""
        for row in np.flatnonzero(self.carried).tolist():
            robot = self.agents[row].carrier
            self.position[row], self.heading[row] = robot.position, robot.heading
            self.aim[row], self.aim_heading[row] = self.position[row], self.heading[row]

    def begin_step(self) -> None:
        """Forget which bodies are new: from now on all travel."""
        self.fresh[:] = False


class Driven(Body):
    """A body that goes where its user puts it: a door, a predator, a sheep that robots see.

    Created by `SwarmModel.add_body`; take it out with `remove()`. Its `carrier` is the robot that carries it, or None.

    ``body.position = (x, y)``, ``body.heading = h`` and ``body.move_to((x, y, heading))`` ask for a pose, to which the
    body travels in the phase move of the next step. Robots are pushed out of its way; where they have no room, or a
    load is in the way, it stops, and `blocked` is True until the next step. A request holds for one step. Before the
    first step after it was added, a body is placed at once.
    """

    mode = "driven"
    form: Form
    movers: Movers
    row: int
    agent: Any
    carrier: Any  # the robot that carries it
    _shown: tuple[Pose, Shape] | None

    def __init__(
        self, space: Arena, model: Model, shape: Shape, kind: str, movers: Movers, agent: Agent | None = None
    ) -> None:
        self.form = Form.of(shape)
        self.agent = agent
        self.movers = movers
        self.row = -1
        self.carrier = None
        self._shown = None
        super().__init__(space, model, kind)
        movers.add(self, position=shape.position, aim=shape.position, fresh=True, reach=self.form.reach)

    @property
    def pose(self) -> Pose:
        """Where it is: x, y, heading."""
        row = self.alive()
        x, y = self.movers.position[row].tolist()
        return x, y, float(self.movers.heading[row])

    @property
    def shape(self) -> Shape:  # type: ignore[override]
        """Its shape where it is."""
        pose = self.pose
        if self._shown is None or self._shown[0] != pose:
            self._shown = pose, self.form.shape_at(pose)
        return self._shown[1]

    @property
    def contact(self) -> bool:
        """True: marks on the ground cannot be driven."""
        return True

    @property
    def position(self) -> np.ndarray:
        """Where its centre is, shape (2,); when set, where it is to go."""
        return read_only(self.movers.position[self.alive()].copy())

    @position.setter
    def position(self, value: Coordinates) -> None:
        row = self.alive()
        self._ask(self.space.checked_point(value), float(self.movers.aim_heading[row]))

    @property
    def heading(self) -> float:
        """Its turn since it was added, rad in [-pi, pi), counter-clockwise; when set, the one that it is to take."""
        return float(self.movers.heading[self.alive()])

    @heading.setter
    def heading(self, value: float) -> None:
        heading = check_number("heading", value, minimum=-LARGEST_HEADING, maximum=LARGEST_HEADING)
        self._ask(self.movers.aim[self.alive()].copy(), wrapped(heading))

    @property
    def blocked(self) -> bool:
        """Whether it had to stop in the last step, because robots or a load could not give way."""
        return bool(self.movers.blocked[self.alive()])

    def move_to(self, pose: Sequence[float]) -> None:
        """Ask for a position and a heading, as (x, y, heading).

        Raises
        ------
        InvalidValueError
            If the pose is not three finite numbers, or not on the map.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel, rectangle
        >>> model = SwarmModel(rng=1)
        >>> door = model.add_body(rectangle((100, 100), (110, 160)), kind="door")
        >>> door = model.run(1).bodies[-1]
        >>> door.move_to((105, 140, 0.0))
        >>> door.position, model.run(1).bodies[-1].position
        (array([105., 130.]), array([105., 140.]))
        """
        self.alive()
        numbers = as_numbers(pose)
        if numbers.shape != (3,):
            raise InvalidValueError(f"pose is {shortened(pose)}; expected three numbers (x, y, heading)")
        heading = check_number("heading", float(numbers[2]), minimum=-LARGEST_HEADING, maximum=LARGEST_HEADING)
        self._ask(self.space.checked_point(numbers[:2]), wrapped(heading))

    def seen_from(self, point: np.ndarray) -> tuple[float, float]:
        """Return the distance from a point, and the azimuth (rad) of the nearest point, of a disc of its centre.

        Examples
        --------
        >>> from mesa_swarm import SwarmModel, disc
        >>> body = SwarmModel(rng=1).add_body(disc((100, 100), 5))
        >>> body.seen_from(np.array([80.0, 100.0]))
        (15.0, 0.0)
        """
        line = shapely.shortest_line(shapely.Point(point), self.shape.geometry)
        (ax, ay), (bx, by) = shapely.get_coordinates(line).tolist()
        return math.hypot(bx - ax, by - ay) - self.shape.radius, math.atan2(by - ay, bx - ax)

    def remove(self) -> None:
        """Take the body out of the world, between two steps."""
        self.alive()
        self.movers.drop(self)
        super().remove()

    def alive(self) -> int:
        """Return its row, or raise `RemovedRobotError` if it was removed."""
        if self.row < 0:
            raise RemovedRobotError("this body has been removed; take one from model.bodies")
        return self.row

    def _ask(self, position: np.ndarray, heading: float) -> None:
        movers, row = self.movers, self.row
        if movers.fresh[row] or movers.carried[row]:
            self.model.move_bodies([self], [(*position.tolist(), heading)])
        else:  # both are checked: many doors have to be quick
            movers.aim[row], movers.aim_heading[row] = position, heading


def occupied(bodies: Iterable[Body]) -> Iterator[tuple[BaseGeometry, float]]:
    """Iterate over what solid bodies occupy until the end of the next step, as geometries and radii about them.

    A driven body occupies its way, see `way_of`; what a robot carries occupies nothing.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel, disc
    >>> model = SwarmModel(map="openspace", rng=1)
    >>> body = model.add_body(disc((100, 100), 5))
    >>> [radius for _, radius in occupied(model.bodies)]  # with four walls
    [0.0, 0.0, 0.0, 0.0, 5.0]
    """
    for body in bodies:
        if isinstance(body, Driven):
            if body.carrier is None:
                yield way_of(body)
        elif body.contact:
            yield body.shape.geometry, body.shape.radius


def way_of(body: Driven) -> tuple[BaseGeometry, float]:
    """Return a geometry, and a radius about it, that hold a body where it is and on its way to where it is to go.

    Of a body that turns it is what the disc about its centre sweeps over that holds the body at every heading.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel, rectangle
    >>> body = SwarmModel(rng=1).run(1).add_body(rectangle((100, 100), (110, 140)))
    >>> body.model.run(1).move_bodies([body], [(115, 120, 0.0)])
    >>> way, radius = way_of(body)
    >>> way.bounds, radius
    ((100.0, 100.0, 120.0, 140.0), 0.0)
    """
    movers, row, shape = body.movers, body.alive(), body.shape
    step = movers.aim[row] - movers.position[row]
    if movers.aim_heading[row] != movers.heading[row]:
        return swept(shapely.Point(movers.position[row]), step), body.form.reach
    return (swept(shape.geometry, step) if step.any() else shape.geometry), shape.radius


def swept(outline: BaseGeometry, step: Sequence[float] | np.ndarray) -> BaseGeometry:
    """Return what a point or a convex polygon sweeps over when it is displaced; of other polygons, its convex hull.

    Examples
    --------
    >>> swept(shapely.box(0, 0, 1, 1), (2.0, 0.0)).area
    3.0
    """
    points = shapely.get_coordinates(outline)
    return shapely.convex_hull(shapely.multipoints(np.vstack([points, points + step])))


def poses_of_agents(followers: Sequence[Driven], space: Arena) -> np.ndarray:
    """Return the poses (k, 3) of the agents that bodies follow; an agent without a heading leaves that of its body."""
    poses = np.array([(*_place_of(body), _heading_of(body)) for body in followers]).reshape(-1, 3)
    low, high = space.dimensions.T
    wrong = ~((poses[:, :2] >= low) & (poses[:, :2] <= high)).all(axis=1) | ~np.isfinite(poses[:, 2])
    if wrong.any():
        body = followers[int(np.argmax(wrong))]
        raise InvalidValueError(
            f"agent {body.agent.unique_id} of body {body.unique_id} is at {shortened(_place_of(body))}; expected a "
            f"finite heading and x and y within {space.dimensions.tolist()}"
        )
    return poses


def _place_of(body: Driven) -> tuple[float, float]:
    """Return where the agent of a body is: its `position`, or its `pos`; without either where the body is to go."""
    agent: Any = body.agent
    place = getattr(agent, "position", None)
    place = getattr(agent, "pos", None) if place is None else place
    if place is None:
        return tuple(body.movers.aim[body.row].tolist())
    try:
        x, y = place
        return float(x), float(y)
    except (TypeError, ValueError):
        return math.nan, math.nan


def _heading_of(body: Driven) -> float:
    heading = getattr(body.agent, "heading", None)
    if heading is None:
        return float(body.movers.aim_heading[body.row])
    try:
        return wrapped(float(heading))
    except (TypeError, ValueError):
        return math.nan
