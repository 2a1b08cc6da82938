"""Foraging: bring food to a nest, which robots find by a beacon."""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import shapely

from mesa_swarm.base.errors import InvalidValueError, PlacementError, check_choice, check_count, check_number
from mesa_swarm.control import Layer, behaviour
from mesa_swarm.environments.actions import CONTINUOUS
from mesa_swarm.environments.scores import CARRIED, LARGEST_REWARD, NEST, ObservationEncoder, Score
from mesa_swarm.environments.task import Task
from mesa_swarm.geometry.free_room import find_part_around, room_for_disc
from mesa_swarm.kernels.elementary import atan2, direction_of, hypot, vector_lengths
from mesa_swarm.maps.map import Map
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.gripper import Carried, Gripper
from mesa_swarm.robots.sensors import LARGEST_RANGE, LineSensor, Sensor
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.world.shapes import disc
from mesa_swarm.world.statics import KINDS as BUILT_IN_KINDS
from mesa_swarm.world.statics import OBSTACLE, ROBOT

FOOD, GRIP = "food", "grip"
# The code of food: the first kind of body besides the built-in ones.
FOOD_CODE = len(BUILT_IN_KINDS)
FOOD_RADIUS, REACH = 2.5, 5.0
# Free space around new food, from its centre; the beacon carries this far; corners of a grown quarter circle.
ROOM, BEACON_RANGE, SEGMENTS = 12.0, 1000.0, 16
MOST_ITEMS, TRIES = 200, 2_000
GRIPS = "automatic", "commanded"


@dataclass(frozen=True, kw_only=True, slots=True)
class NestSensor(Sensor):
    """Range and bearing of the nest's beacon, centre to centre: map units, and rad from the robot's heading.

    Parameters
    ----------
    range : float
        Beyond which both read NaN, map units, above 0.
    name : str

    Examples
    --------
    >>> NestSensor().width
    2
    """

    range: float = BEACON_RANGE
    name: str = NEST

    def __post_init__(self) -> None:
        """Check the range."""
        check_number("range", self.range, above=0, maximum=LARGEST_RANGE)

    @property
    def width(self) -> int:
        """How many numbers it reads."""
        return 2

    def arguments(self, model: Any) -> dict[str, np.ndarray]:
        """Return where the nest is."""
        return {"place": model.state[NEST]}

    @staticmethod
    def read(position: np.ndarray, heading: np.ndarray, place: np.ndarray, range: float, out: np.ndarray) -> None:
        """Write range and bearing."""
        for i in np.arange(len(out)):
            dx, dy = place[0] - position[i, 0], place[1] - position[i, 1]
            away = hypot(dx, dy)
            if away <= range:
                turn = atan2(dy, dx) - heading[i]
                cosine, sine = direction_of(turn)
                out[i, 0], out[i, 1] = away, atan2(sine, cosine)


@behaviour(memory={"turn": 0, "side": 1.0})
def forage(me: Any, food: int = FOOD_CODE, near: float = 4.0, safe: float = 6.0) -> tuple[float, float]:
    """Avoid what is near, grip food, carry it to the nest, or look for it, in this order."""
    carries, memory, nearest, blocked = me.carried[0] >= 0, me.memory, -1, False
    me.act.grip = 1.0 if carries else 0.0
    for s in range(len(me.distance)):
        if me.kind[s] == food and not carries:
            if nearest < 0 or me.distance[s] < me.distance[nearest]:
                nearest = s
        elif me.kind[s] >= 0 and abs(me.bearing[s]) < 0.8 and me.distance[s] < safe:
            blocked = True
    if blocked and memory.turn == 0:
        memory.turn, memory.side = 5 + int(me.chance * 1000 % 25), 1.0 if me.chance < 0.5 else -1.0
    if memory.turn > 0:
        memory.turn -= 1
        return -memory.side * me.max_speed, memory.side * me.max_speed
    aim = me.nest[1] if carries and not math.isnan(me.nest[1]) else 0.0
    if nearest >= 0:
        aim = me.bearing[nearest]
        if abs(aim) < 0.3 and me.distance[nearest] < near:
            me.act.grip = 1.0
            return 0.0, 0.0
    turn = max(-1.0, min(1.0, aim))
    return me.max_speed * min(1.0, 1 - 2 * turn), me.max_speed * min(1.0, 1 + 2 * turn)


@dataclass(frozen=True, kw_only=True)
class Foraging(Task):
    """Bring food to the nest, a disc on the ground with a beacon; food that was brought appears elsewhere again.

    A step costs `step_cost`. To pick up an item is worth `pick_up`, to put it down outside the nest costs as much, and
    to carry it into the nest is worth `delivery` to the robot that does. Never finished.

    Robots see food as bodies of their third kind, know whether they carry an item and whether the ground below is the
    nest's, and read range and bearing of the beacon. Robots that are not commanded explore, avoid, grip food that they
    see, and carry it to the nest.

    Parameters
    ----------
    n_robots, map, design, encoding, actions, max_steps, variation, team, coverage_reward, messages, message_range
        As for `Task`; designs get a gripper, a line sensor, and sensors of what they carry and of the beacon.
    items : int
        Of food that lie around or are carried at any time, 1 to 200.
    nest : (x, y), optional
        Its centre; by default the place nearest to the middle of the map at which it touches no obstacle.
    nest_radius : float
        Map units, 10 to 1,000.
    grip : str
        "automatic": the gripper closes where a proximity sensor sees food within its reach, 5, and holds it.
        "commanded": it is closed where a third number of the action, after the wheel speeds, is above 0.
    step_cost, pick_up, delivery : float
        At least 0.

    Examples
    --------
    >>> Foraging().observer().width, Foraging(grip="commanded").numbers
    (41, 3)
    """

    map: str | os.PathLike | Map = "openspace"
    encoding: str = "typed"
    max_steps: int = 2000
    items: int = 30
    nest: tuple[float, float] | None = None
    nest_radius: float = 45.0
    grip: str = GRIPS[0]
    step_cost: float = 0.01
    pick_up: float = 1.0
    delivery: float = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        designs = tuple(map(equip_design, self.designs))
        object.__setattr__(self, "design", designs[0] if len(designs) == 1 else designs)
        check_count("items", self.items, minimum=1, maximum=MOST_ITEMS)
        check_number("nest_radius", self.nest_radius, minimum=10, maximum=1000)
        for name in ("step_cost", "pick_up", "delivery"):
            check_number(name, getattr(self, name), minimum=0, maximum=LARGEST_REWARD)
        if check_choice("grip", self.grip, GRIPS) != GRIPS[0] and self.actions != CONTINUOUS:
            raise InvalidValueError(
                f"grip is 'commanded' with actions={self.actions}; expected 'continuous' actions, or grip='automatic'"
            )
        self.food_space()

    @property
    def numbers(self) -> int:
        """How many numbers a continuous action has: with the grip one more."""
        return super().numbers + (self.grip != GRIPS[0])

    @property
    def acts(self) -> tuple[str, ...]:
        """The gripper."""
        return (GRIP,)

    def nest_place(self) -> tuple[float, float]:
        """Return the centre of the nest."""
        return nest_in(self.chart, float(self.nest_radius), self.nest)

    def food_space(self) -> shapely.Geometry:
        """Return where food appears: room that robots can reach from the nest, and that is not in it."""
        radius = min(float(design.radius) for design in self.designs)
        return space_of_food(self.chart, self.nest_place(), float(self.nest_radius), radius)

    def set_acts(self, model: SwarmModel, actions: np.ndarray, acts: np.ndarray) -> None:
        """Close the grippers that are commanded to, or that have food within reach or hold it."""
        if self.grip != GRIPS[0]:
            acts[:, 0] = actions[:, 2] > 0
            return
        columns, k = model.swarm.columns, len(acts)
        sees = (columns["kind"][:k] == FOOD_CODE) & (columns["distance"][:k] <= REACH)
        acts[:, 0] = sees.any(axis=1) | (columns[CARRIED][:k, 0] >= 0)

    def encoder(self, design: RobotDesign) -> ObservationEncoder:
        """Return the encoder, which includes what the robot carries and where the nest is."""
        beacon = next((float(s.range) for s in design.sensors if isinstance(s, NestSensor)), BEACON_RANGE)
        kinds = (OBSTACLE, ROBOT, FOOD_CODE)
        design = equip_design(design)
        return ObservationEncoder(design, encoding=self.encoding, kinds=kinds, home=beacon, **self._heard())

    def furnish(self, model: SwarmModel) -> None:
        """Add the nest and the food."""
        place = self.nest_place()
        model.state[NEST] = np.array(place)
        model.add_obstacle(disc(place, float(self.nest_radius), contact=False))
        delivering = Delivering(self.food_space(), float(self.nest_radius), model.swarm.unique_ids.tolist())
        for _ in range(self.items):
            delivering.add_food(model)
        model.add_process(delivering)

    @property
    def most_things(self) -> int:
        """The nest and the items."""
        return 1 + self.items

    def things(self, model: SwarmModel) -> np.ndarray:
        """Return the places of the nest and of the items."""
        return np.vstack([model.state[NEST], model.movers.position])

    def others(self) -> tuple[Layer, ...]:
        """Return the rule that forages."""
        return (forage,)

    def score(self, model: SwarmModel, count: int) -> Score:
        """Return what rewards the first `count` robots of a new world."""
        return ForagingScore(
            model, count, delivery=float(self.delivery), pick_up=float(self.pick_up), step_cost=float(self.step_cost)
        )


class Delivering:
    """The process by which food that robots carry into the nest is delivered, and appears elsewhere again.

    `delivered` (n,) counts the items of each robot with which the world began.
    """

    def __init__(self, space: shapely.Geometry, nest_radius: float, robots: Sequence[int]) -> None:
        self._space, self._radius = space, nest_radius
        self._number = {unique_id: number for number, unique_id in enumerate(robots)}
        self.delivered = np.zeros(len(robots), np.int64)

    def checkpoint(self) -> dict[str, np.ndarray]:
        """Return what later steps depend on."""
        return {"delivered": self.delivered}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take back what `checkpoint` returned."""
        self.delivered[:] = state["delivered"]

    def step(self, model: SwarmModel) -> None:
        """Deliver what is carried in the nest."""
        movers, nest = model.movers, model.state[NEST]
        if not movers.carried.any():
            return
        carried = [movers.agents[row] for row in np.flatnonzero(movers.carried)]
        for body in [item for item in carried if item.kind == FOOD]:
            robot = body.carrier
            if hypot(*(robot.position - nest)) < self._radius - FOOD_RADIUS:
                model.event("delivered", robot=robot)
                self.delivered[self._number[robot.unique_id]] += 1
                body.remove()
                self.add_food(model)

    def add_food(self, model: SwarmModel) -> None:
        """Add an item of food that robots can reach from the nest, not in it, and away from robots and other food."""
        x_min, y_min, x_max, y_max = self._space.bounds
        neighbours = np.vstack([model.movers.position, model.swarm.position])
        for _ in range(TRIES):
            place = model.streams[FOOD].uniform((x_min, y_min), (x_max, y_max))
            apart = (vector_lengths(*(neighbours - place).T) > ROOM).all()
            if apart and shapely.contains_xy(self._space, *place):
                model.add_body(disc(tuple(place.tolist()), FOOD_RADIUS), kind=FOOD)
                return
        raise PlacementError(
            f"no room for another item of food on map {model.map.name}; use fewer items or robots, or a larger map"
        )


class ForagingScore:
    """`delivery` for an item that a robot delivers, `pick_up` for gripping one, less `step_cost` a step."""

    finished = False

    def __init__(self, model: SwarmModel, count: int, *, delivery: float, pick_up: float, step_cost: float) -> None:
        self._model = model
        self._worth = delivery, pick_up, step_cost
        self._process = next(process for process in model.processes if isinstance(process, Delivering))
        self._carried, self._delivered = np.zeros(count), np.zeros(count)
        self._count, self._numbers = count, np.arange(count)  # of robots with rewards, those that are left
        self._robot_steps = 0

    def remove_robots(self, rows: np.ndarray) -> None:
        """Forget what removed robots carried, not what they delivered: those behind them move up."""
        self._carried, self._delivered = np.delete(self._carried, rows), np.delete(self._delivered, rows)
        self._numbers = np.delete(self._numbers, rows)

    def reward(self, out: np.ndarray) -> None:
        """Write the rewards of the last step."""
        delivery, pick_up, step_cost = self._worth
        k = len(out)
        delivered = self._process.delivered[self._numbers].astype(float)
        carried = (self._model.swarm.columns[CARRIED][:k, 0] >= 0).astype(float)
        new = delivered - self._delivered
        # What was delivered in this step was picked up before, or in this very step, and is not put down.
        out[:] = delivery * new + pick_up * (carried - self._carried + new) - step_cost
        self._carried, self._delivered = carried, delivered
        self._robot_steps += k

    def measures(self) -> dict[str, float]:
        """Return the number of items delivered, and that per 1,000 robot-steps, NaN without steps."""
        items, steps = float(self._process.delivered[: self._count].sum()), self._robot_steps
        return {"items delivered": items, "items per 1,000 robot-steps": 1000.0 * items / steps if steps else math.nan}


def equip_design(design: RobotDesign) -> RobotDesign:
    """Return a design with what foraging takes, unless it has it: gripper, line sensor, sensors of nest and load.

    Examples
    --------
    >>> from mesa_swarm import AGENT9
    >>> equip_design(AGENT9).actuators[0].kinds, equip_design(equip_design(AGENT9)) == equip_design(AGENT9)
    (('food',), True)
    """
    kinds = LineSensor, Carried, NestSensor
    sensors = [kind() for kind in kinds if not any(isinstance(sensor, kind) for sensor in design.sensors)]
    grips = any(isinstance(actuator, Gripper) and actuator.name == GRIP for actuator in design.actuators)
    gripper = () if grips else (Gripper(kinds=(FOOD,), reach=REACH),)
    if not sensors and grips:
        return design
    return replace(design, sensors=(*design.sensors, *sensors), actuators=(*design.actuators, *gripper))


@lru_cache(maxsize=256)
def nest_in(chart: Map, radius: float, centre: tuple[float, float] | None) -> tuple[float, float]:
    """Return the centre of a nest: as wanted, or nearest to the middle of the map where it touches no obstacle."""
    room = room_for_disc(chart.bounds, _solids(chart), radius, SEGMENTS)
    x_min, y_min, x_max, y_max = chart.bounds
    place = shapely.Point(((x_min + x_max) / 2, (y_min + y_max) / 2) if centre is None else centre)
    if room.is_empty:
        raise InvalidValueError(f"map {chart.name} has no room for a nest of radius {radius:g}; give a smaller one")
    if centre is not None and not shapely.intersects(room, place):
        raise InvalidValueError(
            f"nest is ({place.x:g}, {place.y:g}), where one of radius {radius:g} touches an obstacle or the border of "
            f"map {chart.name}; move it, or make it smaller"
        )
    x, y = shapely.get_coordinates(shapely.shortest_line(room, place))[0].tolist()
    return x, y


@lru_cache(maxsize=256)
def space_of_food(chart: Map, nest: tuple[float, float], nest_radius: float, radius: float) -> shapely.Geometry:
    """Return where food may appear: with room around, away from the nest, and reached from it by robots of a radius."""
    solids = _solids(chart)
    part = find_part_around(room_for_disc(chart.bounds, solids, radius, SEGMENTS), np.array(nest), nest_radius)
    roomy = room_for_disc(chart.bounds, solids, max(ROOM, radius), SEGMENTS)
    space = shapely.difference(roomy, shapely.Point(nest).buffer(nest_radius + ROOM))
    if part is not None:
        space = shapely.intersection(space, part)
    if part is None or not space.area:
        raise InvalidValueError(f"map {chart.name} has no room for food that can be reached from its nest")
    shapely.prepare(space)
    return space


def _solids(chart: Map) -> list[tuple[shapely.Geometry, float]]:
    """Return what robots cannot drive through."""
    solids: list[tuple[shapely.Geometry, float]] = [
        (shape.geometry, shape.radius) for shape in chart.obstacles if shape.contact
    ]
    return solids + [(shapely.Point(spot.position), spot.radius) for spot in chart.fires]
