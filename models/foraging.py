"""Foraging: robots that bring food to a nest, and rest there while the nest has enough energy.

WHAT IS IT? The nest stores energy. Robots use it up, more of it outside than in the nest, and each item of food that
they bring adds to it. More robots bring more food, but are in each other's way.

HOW IT WORKS. A robot explores, sees food, goes there, grips it and carries it to the nest, which it finds by a beacon;
there the item becomes energy, and another one appears elsewhere. A robot in the nest reads how far the store is below
its own threshold, and rests while it is not. Thresholds are spread evenly from 0 to the full store.

HOW TO USE IT. `n_robots`; `thresholds`, without which all robots always work; `items` of food that lie around.
THINGS TO TRY. Twenty robots with and without thresholds: how much energy does an item cost? Let robots recruit others.

REFERENCE. Krieger, Billeter and Keller, Nature 406, 992-995 (2000).
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numba import njit

from mesa_swarm import (
    Carried,
    Choice,
    Gripper,
    LineSensor,
    Map,
    Radio,
    RobotDesign,
    Seed,
    Sensor,
    Slider,
    SwarmModel,
    all_round,
    disc,
    draw_number,
    process,
    value,
)
from mesa_swarm.control import Subsumption, behaviour
from mesa_swarm.errors import check_choice, check_count

SIDE = 400.0
FIELD = Map(name="field", bounds=(0, 0, SIDE, SIDE))
NEST, NEST_RADIUS, FOOD_RADIUS, ROOM = (200.0, 200.0), 45.0, 2.5, 12.0
# The greatest store of energy, that of an item, and what a robot uses in a step outside and in the nest.
FULL, GAIN, OUTSIDE, INSIDE = 500.0, 20.0, 0.05, 0.005
COLLECTED = ("energy", "outside")


@dataclass(frozen=True, kw_only=True)
class Need(Sensor):
    """How much energy is missing to the robot's own threshold."""

    name: str = "need"

    @staticmethod
    def read(rows: np.ndarray, nest_thresholds: np.ndarray, nest_energy: np.ndarray, out: np.ndarray) -> None:
        """Write it for the robots in these rows."""
        for i in range(len(out)):
            out[i, 0] = nest_thresholds[rows[i] % len(nest_thresholds)] - nest_energy[0]


@behaviour(memory={"turn": 0, "side": 1.0})
def forage(me: Any, food: int = 0, near: float = 4.0, safe: float = 6.0) -> tuple[float, float]:
    """Rest, avoid, grip food, carry it home, or look for it, in this order."""
    carries, memory, nearest, blocked = me.carried[0] >= 0, me.memory, -1, False
    me.act.grip = 1.0 if carries else 0.0
    for s in range(len(me.distance)):
        if me.kind[s] == food and not carries:
            if nearest < 0 or me.distance[s] < me.distance[nearest]:
                nearest = s
        elif me.kind[s] >= 0 and abs(me.bearing[s]) < 0.8 and me.distance[s] < safe:
            blocked = True
    rests = me.line[0] and not carries and me.need[0] <= 0
    if rests and (blocked or math.hypot(me.goal_x, me.goal_y) < 10):
        return 0.0, 0.0
    if blocked and memory.turn == 0:
        memory.turn, memory.side = 5 + int(25 * me.chance), 1.0 if me.chance < 0.5 else -1.0
    if memory.turn > 0:
        memory.turn -= 1
        return -memory.side * me.max_speed, memory.side * me.max_speed
    aim = math.atan2(me.goal_y, me.goal_x) if carries or rests else 0.0
    if nearest >= 0 and not rests:
        aim = me.bearing[nearest]
        if abs(aim) < 0.3 and me.distance[nearest] < near:
            me.act.grip = 1.0
            return 0.0, 0.0
    turn = max(-1.0, min(1.0, aim))
    return me.max_speed * min(1.0, 1 - 2 * turn), me.max_speed * min(1.0, 1 + 2 * turn)


@njit
def is_free(x: float, y: float, places: np.ndarray) -> bool:
    """Return whether food may appear at a place: not in the nest, nor near any of some other places."""
    for k in range(len(places)):
        if math.hypot(x - places[k, 0], y - places[k, 1]) <= ROOM:
            return False
    return math.hypot(x - NEST[0], y - NEST[1]) > NEST_RADIUS + ROOM


def nest(
    position: np.ndarray, bodies_aim: np.ndarray, bodies_carrier: np.ndarray, delivered: np.ndarray,
    energy: np.ndarray, spent: np.ndarray, items: np.ndarray, outside: np.ndarray, stream: Any,
) -> None:  # fmt: skip
    """Use the nest's energy, and turn food that was brought there into energy: it appears elsewhere as other food."""
    outside[0] = 0
    for i in range(len(position)):
        outside[0] += math.hypot(position[i, 0] - NEST[0], position[i, 1] - NEST[1]) > NEST_RADIUS
    used = OUTSIDE * outside[0] + INSIDE * (len(position) - outside[0])
    for b in range(len(bodies_carrier)):
        robot = bodies_carrier[b]
        if robot < 0:
            continue
        x, y = position[robot]
        if math.hypot(x - NEST[0], y - NEST[1]) >= NEST_RADIUS - FOOD_RADIUS:
            continue
        while not (is_free(x, y, position) and is_free(x, y, bodies_aim)):
            x, y = ROOM + (SIDE - 2 * ROOM) * draw_number(stream), ROOM + (SIDE - 2 * ROOM) * draw_number(stream)
        bodies_aim[b, 0], bodies_aim[b, 1] = x, y
        delivered[robot] = GAIN
        items[0] += 1
        energy[0] += GAIN
    spent[0] += used
    energy[0] = min(max(energy[0] - used, 0.0), FULL)


class Foraging(SwarmModel):
    """Robots that bring food to a nest.

    Examples
    --------
    >>> Foraging(n_robots=3, rng=1).run(10).results()["items"]
    0.0
    """

    compares = "thresholds", ("yes", "no")
    steps_to_compare = 4_000

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 40, 1, "robots")] = 12,
        thresholds: Annotated[str, Choice(("yes", "no"), "whether robots rest while there is enough energy")] = "yes",
        items: Annotated[int, Slider(1, 60, 1, "items of food in the arena")] = 20,
        rng: Seed = None,
    ) -> None:
        super().__init__(map=FIELD, rng=rng, model_reporters={name: value(f"nest.{name}") for name in COLLECTED})
        self.add_obstacle(disc(NEST, NEST_RADIUS, contact=False))  # a mark on the ground
        self.communication = Radio(range=1000.0, state=False, beacons=(NEST,))
        eyes = (*all_round(12, range=40.0).sensors, LineSensor(), Carried(), Need())
        design = RobotDesign(sensors=eyes, actuators=(Gripper(kinds=("food",), reach=5.0),))
        n = len(self.add_robots(design, check_count("n_robots", n_robots)))
        rests = check_choice("thresholds", thresholds, ("yes", "no")) == "yes"
        limits = np.linspace(0.0, FULL, n) if rests else np.full(n, 2 * FULL)
        for _ in range(check_count("items", items, maximum=200)):
            self.add_food()
        memory = {"energy": FULL / 2, "spent": 0.0, "items": 0, "outside": self.outside, "thresholds": limits}
        self.nest = self.add_process(process(memory=memory, events=("delivered",))(nest))
        self.control = Subsumption(forage(food=self.add_kind("food")))

    def add_food(self) -> None:
        """Add an item of food at a random place where there is room, not in the nest."""
        x, y = NEST
        while not (is_free(x, y, self.swarm.position) and is_free(x, y, self.movers.position)):
            x, y = self.streams["food"].uniform(ROOM, SIDE - ROOM, 2).tolist()
        self.add_body(disc((x, y), FOOD_RADIUS), kind="food")

    @property
    def energy(self) -> float:
        """The energy that the nest has stored."""
        return self.nest.energy

    @property
    def outside(self) -> int:
        """Number of robots outside the nest."""
        return int(np.count_nonzero(((self.swarm.position - NEST) ** 2).sum(axis=1) > NEST_RADIUS**2))

    def results(self) -> dict[str, float | None]:
        """Return the measures used by a comparison: items that were brought, energy at the end, energy used an item."""
        items, energy = self.nest.items, self.nest.spent
        return {"items": float(items), "energy": self.energy, "energy used per item": energy / items if items else None}
