"""Driven bodies: the handle of each, their columns together, and what they occupy on their way."""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import shapely
from mesa import Agent
from shapely.geometry.base import BaseGeometry

from mesa_swarm.base.errors import InvalidValueError, RemovedRobotError, check_number, shortened
from mesa_swarm.geometry.overlap import wrap_angle
from mesa_swarm.kernels.elementary import atan2, hypot
from mesa_swarm.world.arena import Arena
from mesa_swarm.world.bodies import LARGEST_HEADING, Body, BodyTable, Pose, check_pose
from mesa_swarm.world.read_only import locked_view, read_only
from mesa_swarm.world.shapes import Coordinates, Shape
from mesa_swarm.world.statics import CARRIED, DRIVEN, MODES


class Movers:
    """The driven bodies of a model, one row each in the order in which they were added, read from its table of bodies.

    A pose that is set is a request: the body goes there in the phase move of the next step, as far as robots
    can give way. A body that was added after the last step is placed at once. Columns are copies, as they are now.

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

    def __init__(self, table: BodyTable) -> None:
        self._table = table

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> "Iterator[Driven]":
        return iter(self.agents)

    def __getitem__(self, index: int) -> "Driven":
        return self._table.agents[self.rows[index]]

    def __getattr__(self, name: str) -> np.ndarray:
        """Return a column of the table in the rows of driven bodies."""
        if name not in BodyTable.columns:
            raise AttributeError(f"Movers has no attribute {name}")
        return locked_view(getattr(self._table, name)[self.rows])

    @property
    def rows(self) -> np.ndarray:
        """Rows of the driven bodies in the table of all bodies, shape (m,)."""
        return self._table.rows(DRIVEN, CARRIED)

    @property
    def agents(self) -> "list[Driven]":
        """The bodies."""
        return [self._table.agents[row] for row in self.rows.tolist()]

    @property
    def carried(self) -> np.ndarray:
        """Whether a robot carries each, shape (m,)."""
        return read_only(self.mode == CARRIED)

    @property
    def asked(self) -> np.ndarray:
        """Whether each is to move in the next step, shape (m,)."""
        return self._table.are_to_move(self.rows)

    @property
    def poses(self) -> tuple[np.ndarray, ...]:
        """Where all bodies are and where they go: position, heading, aim, aim_heading."""
        rows, table = self.rows, self._table
        return table.position[rows], table.heading[rows], table.aim[rows], table.aim_heading[rows]


class Driven(Body):
    """A body that goes where its user puts it: a door, a predator, a sheep that robots see.

    Created by `SwarmModel.add_body`; take it out with `remove()`. Its `carrier` is the robot that carries it, or None.

    ``body.position = (x, y)``, ``body.heading = h`` and ``body.move_to((x, y, heading))`` ask for a pose, to which the
    body travels in the phase move of the next step. Robots are pushed out of its way; where they have no room, or a
    load is in the way, it stops, and `blocked` is True until the next step. A request holds for one step. Before the
    first step after it was added, a body is placed at once.
    """

    added_as = "driven"
    agent: Any

    def __init__(self, *arguments: Any, agent: Agent | None = None, **keywords: Any) -> None:
        self.agent = agent
        super().__init__(*arguments, **keywords)

    @property
    def carrier(self) -> Any:
        """The robot that carries it, or None."""
        row = int(self.table.carrier[self.row])
        return None if row < 0 else self.model.swarm.agents[row]

    @property
    def movers(self) -> BodyTable:
        """The table in which it is the row `row`."""
        return self.table

    @property
    def pose(self) -> Pose:
        """Where it is: x, y, heading."""
        return self.table.pose_of(self.alive())

    @property
    def shape(self) -> Shape:
        """Its shape where it is."""
        return self.table.shape_of(self.alive())

    @property
    def position(self) -> np.ndarray:
        """Where its centre is, shape (2,); when set, where it is to go."""
        return read_only(self.table.position[self.alive()].copy())

    @position.setter
    def position(self, value: Coordinates) -> None:
        row = self.alive()
        self._ask(self.space.checked_point(value), float(self.table.aim_heading[row]))

    @property
    def heading(self) -> float:
        """Its turn since it was added, rad in [-pi, pi), counter-clockwise; when set, the one that it is to take."""
        return float(self.table.heading[self.alive()])

    @heading.setter
    def heading(self, value: float) -> None:
        heading = check_number("heading", value, minimum=-LARGEST_HEADING, maximum=LARGEST_HEADING)
        self._ask(self.table.aim[self.alive()].copy(), wrap_angle(heading))

    @property
    def blocked(self) -> bool:
        """Whether it had to stop in the last step, because robots or a load could not give way."""
        return bool(self.table.blocked[self.alive()])

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
        *place, heading = check_pose(pose, self.space)
        self._ask(np.array(place), heading)

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
        return hypot(bx - ax, by - ay) - self.shape.radius, atan2(by - ay, bx - ax)

    def remove(self) -> None:
        """Take the body out of the world, between two steps."""
        row = self.alive()
        self.table.mode[row], self.table.carrier[row] = DRIVEN, -1
        super().remove()

    def alive(self) -> int:
        """Return its row, or raise `RemovedRobotError` if it was removed."""
        if self.space is None:
            raise RemovedRobotError("this body has been removed; take one from model.bodies")
        return self.row

    def _ask(self, position: np.ndarray, heading: float) -> None:
        table, row = self.table, self.row
        if table.fresh[row] or table.mode[row] == CARRIED:
            self.model.move_bodies([self], [(*position.tolist(), heading)])
        else:  # both are checked: many doors have to be quick
            table.aim[row], table.aim_heading[row] = position, heading


def find_occupied_room(bodies: Iterable[Body]) -> Iterator[tuple[BaseGeometry, float]]:
    """Iterate over what solid bodies occupy until the end of the next step, as geometries and radii about them.

    A driven body occupies its way, see `room_on_way`; what a robot carries occupies nothing.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel, disc
    >>> model = SwarmModel(map="openspace", rng=1)
    >>> body = model.add_body(disc((100, 100), 5))
    >>> [radius for _, radius in find_occupied_room(model.bodies)]  # with four walls
    [0.0, 0.0, 0.0, 0.0, 5.0]
    """
    for body in bodies:
        if isinstance(body, Driven):
            if body.mode != MODES[CARRIED]:
                yield room_on_way(body)
        elif body.contact:
            yield body.shape.geometry, body.shape.radius


def room_on_way(body: Driven) -> tuple[BaseGeometry, float]:
    """Return a geometry, and a radius about it, that hold a body where it is and on its way to where it is to go.

    Of a body that turns it is what the disc about its centre sweeps over that holds the body at every heading.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel, rectangle
    >>> body = SwarmModel(rng=1).run(1).add_body(rectangle((100, 100), (110, 140)))
    >>> body.model.run(1).move_bodies([body], [(115, 120, 0.0)])
    >>> way, radius = room_on_way(body)
    >>> way.bounds, radius
    ((100.0, 100.0, 120.0, 140.0), 0.0)
    """
    table, row, shape = body.table, body.alive(), body.shape
    step = table.aim[row] - table.position[row]
    if table.aim_heading[row] != table.heading[row]:
        return sweep_geometry(shapely.Point(table.position[row]), step), body.form.reach
    return (sweep_geometry(shape.geometry, step) if step.any() else shape.geometry), shape.radius


def sweep_geometry(outline: BaseGeometry, step: Sequence[float] | np.ndarray) -> BaseGeometry:
    """Return what a point or a convex polygon sweeps over when it is displaced; of other polygons, its convex hull.

    Examples
    --------
    >>> sweep_geometry(shapely.box(0, 0, 1, 1), (2.0, 0.0)).area
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


def is_led_elsewhere(body: Driven) -> bool:
    """Return whether a body that follows an agent is sent elsewhere than that leads it.

    An agent without a place leaves it where it is sent, and one without a heading its turn.
    """
    table, row = body.table, body.row
    place, heading = table.aim[row], table.aim_heading[row]
    goes = (place != table.position[row]).any() and not np.array_equal(place, _place_of(body), equal_nan=True)
    turns = heading != table.heading[row] and not np.array_equal(heading, _heading_of(body), equal_nan=True)
    return bool(goes or turns)


def _place_of(body: Driven) -> tuple[float, float]:
    """Return where the agent of a body is: its `position`, or its `pos`; without either where the body is to go."""
    agent: Any = body.agent
    place = getattr(agent, "position", None)
    place = getattr(agent, "pos", None) if place is None else place
    if place is None:
        return tuple(body.table.aim[body.row].tolist())
    try:
        x, y = place
        return float(x), float(y)
    except (TypeError, ValueError):
        return math.nan, math.nan


def _heading_of(body: Driven) -> float:
    heading = getattr(body.agent, "heading", None)
    if heading is None:
        return float(body.table.aim_heading[body.row])
    try:
        return wrap_angle(float(heading))
    except (TypeError, ValueError):
        return math.nan
