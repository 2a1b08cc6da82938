"""Scattered obstacles: discs and rectangles at random free places, which stand still or wander."""

import math
from collections.abc import Iterable, Sequence
from weakref import WeakKeyDictionary, ref

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from mesa_swarm.base.errors import InvalidValueError, PlacementError, check_choice, check_count, check_number, shortened
from mesa_swarm.geometry.free_room import room_to_try
from mesa_swarm.kernels.elementary import direction_of
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.processes import Process
from mesa_swarm.world.bodies import Body, BodyTable, placed
from mesa_swarm.world.movers import Driven, find_occupied_room, sweep_geometry
from mesa_swarm.world.placement import QUARTER_SEGMENTS, place_apart
from mesa_swarm.world.shapes import LARGEST_COORDINATE, Shape, disc, rectangle

FORMS = ("both", "discs", "rectangles")
MOST_OBSTACLES = 10_000
# The least size as a share of the greatest, and the direction of a rectangle's diagonal.
SMALLEST = 0.5
DIAGONALS = math.radians(20.0), math.radians(70.0)
# Directions that a wandering body tries before it stands for a step.
TRIES = 12
# Wandering bodies stay so far from all else, as a share of their own reach.
CLEAR = 1e-3
# What sensors see of bodies that wander, unless it is given.
MOVING = "moving_obstacle"
# A share of a step.
NUDGE = 0.01
# The table of the bodies of each process made by its constructor: which model they are of does not belong to its state.
TABLES: "WeakKeyDictionary[Wander, ref[BodyTable]]" = WeakKeyDictionary()


def scatter(
    model: EngineModel,
    count: int,
    *,
    size: float = 20.0,
    gap: float = 12.0,
    forms: str = "both",
    speed: float = 0.0,
    kind: str | None = None,
) -> list[Body]:
    """Add obstacles of random sizes at random free places, and return them; with a `speed` they wander, see `Wander`.

    Parameters
    ----------
    model : SwarmModel
        Robots that are added later are placed beside the obstacles.
    count : int
        How many, at most 10,000.
    size : float
        Radius of the disc that encloses the largest, map units, above 0; the smallest are half as large.
    gap : float
        Least distance from obstacles and robots that are there, half of the least distance from each other, at least 0.
    forms : str
        "discs", "rectangles" or "both".
    speed : float
        Map units a step, at least 0.
    kind : str, optional
        What sensors see, by default "obstacle", of those that wander "moving_obstacle".

    Raises
    ------
    PlacementError
        If they do not fit; none is added then.
    InvalidValueError
        If a value is out of its range.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel, scatter
    >>> model = SwarmModel(map="openspace", rng=1)
    >>> still, moving = scatter(model, 12), scatter(model, 5, speed=0.5)
    >>> len(model.bodies), len(model.run(10).movers)  # with four walls
    (21, 5)
    """
    number = check_count("count", count, maximum=MOST_OBSTACLES)
    check_number("size", size, above=0, maximum=LARGEST_COORDINATE)
    check_number("gap", gap, minimum=0, maximum=LARGEST_COORDINATE)
    check_number("speed", speed, minimum=0, maximum=LARGEST_COORDINATE)
    check_choice("forms", forms, FORMS)
    if not number:
        return []
    rng = model.streams["scatter"]
    places = _free_places(model, number, size, gap, rng).tolist()
    shapes = [_random_shape(x, y, size, forms, rng) for x, y in places]
    mode = "driven" if speed > 0 else "fixed"
    name = MOVING if kind is None and speed > 0 else kind
    bodies = [model.add_body(shape, kind=name, mode=mode) for shape in shapes]
    if speed > 0:
        model.add_process(Wander(bodies, speed=speed))
    return bodies


def _free_places(model: EngineModel, number: int, size: float, gap: float, rng: np.random.Generator) -> np.ndarray:
    """Return places (number, 2) of obstacles of this size."""
    radius = size * (1.0 + 2.0 * CLEAR) + gap
    space = room_to_try(model.map.bounds, list(find_occupied_room(model.bodies)), radius, QUARTER_SEGMENTS)
    try:
        return place_apart(number, radius, space, model.swarm.position, model.swarm.radius, rng)
    except PlacementError:
        raise PlacementError(
            f"{number} obstacles of size {size:g} with gaps of {gap:g} do not fit on map {model.map.name}; ask for "
            "fewer, smaller ones or a smaller gap"
        ) from None


def _random_shape(x: float, y: float, size: float, forms: str, rng: np.random.Generator) -> Shape:
    """Return a disc or a rectangle within the disc of this size; always from as many random numbers."""
    share, which, turn = rng.random(3).tolist()
    reach = size * (SMALLEST + (1.0 - SMALLEST) * share)
    if forms == "discs" or (forms == "both" and which < 0.5):
        return disc((x, y), reach)
    diagonal = DIAGONALS[0] + (DIAGONALS[1] - DIAGONALS[0]) * turn
    cosine, sine = direction_of(diagonal)
    half_width, half_height = reach * cosine, reach * sine
    return rectangle((x - half_width, y - half_height), (x + half_width, y + half_height))


class Wander(Process):
    """A process that moves driven bodies: straight on, and in a new random direction where something is in the way.

    They do not turn about their centres. They never overlap each other, bodies of other such processes, what stands or
    the edge of the map, also not during a step: all that a body sweeps over in a step is free. Of bodies that move in
    other ways they keep clear where these are, and where an earlier process sends them; a body that later is moved by
    hand, by a later process or by the agent that it follows may run into them. Robots they push, see `add_body`; a body
    that was blocked, because robots had no room, turns away.

    Parameters
    ----------
    bodies : sequence of Driven
        From `add_body`, without agents; convex, as discs and rectangles are. Those that are removed or carried later
        are left out.
    speed : float
        Map units a step, above 0.

    Attributes
    ----------
    speed : float
    ids : int ndarray, shape (m,)
        The bodies' unique_id.
    azimuth : ndarray, shape (m,), rad
        Where each goes, NaN before its first step.

    Raises
    ------
    InvalidValueError
        If a body is not driven, or follows an agent, or the speed is out of its range; by `add_process` if the bodies
        are not of that model.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel, disc
    >>> model = SwarmModel(map="openspace", rng=1)
    >>> sheep = model.add_body(disc((100, 100), 5), kind="sheep")
    >>> wander = model.add_process(Wander([sheep], speed=0.5))
    >>> round(float(np.hypot(*(model.run(21).movers.position[0] - (100, 100)))), 6)  # from the second step on
    10.0
    """

    speed: float
    ids: np.ndarray
    azimuth: np.ndarray

    def __init__(self, bodies: Sequence[Body], *, speed: float) -> None:
        self.speed = check_number("speed", speed, above=0, maximum=LARGEST_COORDINATE)
        if not isinstance(bodies, Iterable):
            raise InvalidValueError(f"bodies is {shortened(bodies)}; expected a list of driven ones, from add_body")
        members = list(bodies)
        for body in members:
            if not isinstance(body, Driven) or body.agent is not None:
                raise InvalidValueError(f"bodies holds {shortened(body)}; expected driven ones without an agent")
        tables = {id(body.table): body.table for body in members}
        if len(tables) > 1:
            raise InvalidValueError("bodies of Wander are of several models; expected a process for each model")
        if tables:
            TABLES[self] = ref(members[0].table)
        self.ids = np.array([body.unique_id for body in members], np.int64)
        self.azimuth = np.full(len(members), math.nan)

    def check_model(self, model: EngineModel) -> None:
        """Refuse a model of which its bodies are not: it may have others with the same unique_id."""
        table = TABLES.get(self)
        if table is not None and table() is not model.parts.bodies.table:
            raise InvalidValueError("bodies of Wander are not of this model; expected some of its add_body")

    def step(self, model: EngineModel) -> None:
        """Ask for the next pose of each body."""
        by_id = {body.unique_id: body for body in model.movers.agents if body.carrier is None}
        places = [place for place, number in enumerate(self.ids.tolist()) if number in by_id]
        bodies = [by_id[int(self.ids[place])] for place in places]
        if not bodies:
            return
        obstacles = _Obstacles(model, bodies)
        rng, poses = model.streams["wander"], []
        for row, (place, body) in enumerate(zip(places, bodies, strict=True)):
            step = self._free_step(place, body, obstacles, row, rng)
            x, y, heading = body.pose
            poses.append((x + step[0], y + step[1], heading))
        model.move_bodies(bodies, poses)

    def _free_step(
        self, place: int, body: Driven, obstacles: "_Obstacles", row: int, rng: np.random.Generator
    ) -> tuple[float, float]:
        """Return the displacement of a body, in a new direction if the way is not free; (0, 0) if none is found."""
        if body.blocked or math.isnan(self.azimuth[place]):
            self.azimuth[place] = rng.uniform(-math.pi, math.pi)
        for _ in range(TRIES):
            x, y = direction_of(self.azimuth[place])
            step = self.speed * x, self.speed * y
            if obstacles.permit(row, step):
                return step
            self.azimuth[place] = rng.uniform(-math.pi, math.pi)
        return 0.0, 0.0


class _Obstacles:
    """What is in the way of bodies in a step: those that stand, and what those that go sweep over.

    Others may have been sent already, by a process before this one.
    """

    def __init__(self, model: EngineModel, bodies: Sequence[Driven]) -> None:
        moving = {body.unique_id for body in bodies}
        others = list(find_occupied_room(body for body in model.bodies if body.unique_id not in moving))
        outlines = [placed(body.form.outline, body.pose) for body in bodies]
        self.swept = np.array([*outlines, *(geometry for geometry, _ in others)], object)
        self.radius = np.array([*(body.form.radius for body in bodies), *(radius for _, radius in others)])
        self.clear = [CLEAR * body.form.reach for body in bodies]
        self.bounds = model.map.bounds

    def permit(self, row: int, step: tuple[float, float]) -> bool:
        """Return whether the way of a body is free, and if so note that it goes there."""
        path, radius = sweep_geometry(self.swept[row], step), self.radius[row]
        x_min, y_min, x_max, y_max = path.bounds
        low_x, low_y, high_x, high_y = self.bounds
        if x_min - radius < low_x or y_min - radius < low_y or x_max + radius > high_x or y_max + radius > high_y:
            return False
        near = self._gaps(row, path) < self.clear[row]
        if near.any() and not self._departs(row, step, near):
            return False
        self.swept[row] = path
        return True

    def _departs(self, row: int, step: tuple[float, float], near: np.ndarray) -> bool:
        """Return whether a body is near to these already, as a load may be that robots have pushed, and leaves them.

        The distance of convex bodies is a convex function of a displacement: if it grows at first, it always does.
        """
        here = self._gaps(row, self.swept[row])
        nudged = self._gaps(row, shapely.transform(self.swept[row], lambda points: points + np.multiply(NUDGE, step)))
        return bool((~near | ((here < self.clear[row]) & (nudged > here))).all())

    def _gaps(self, row: int, outline: BaseGeometry) -> np.ndarray:
        """Return the distances of a body with this outline from all others."""
        gaps = shapely.distance(outline, self.swept) - self.radius - self.radius[row]
        gaps[row] = math.inf
        return gaps
