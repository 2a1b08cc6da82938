"""Puck clustering: robots that gather scattered pucks in one cluster, though each sees only pucks ahead of it.

WHAT IS IT? Robots pick up pucks that have few others near, and put them down where many are. Small clusters lose pucks
and large ones gain them, until one is left. Robots do not communicate: what one has done to the pucks decides what the
next does, which is called stigmergy.

HOW IT WORKS. A robot goes straight on. When it comes to a puck with an empty gripper, it picks it up with a probability
that falls with the number of others in view, to 0 at `many`. When it comes to a puck with its gripper full, it puts its
own down with a probability that grows with the number in view, to 1 at `enough`. Then, and where it meets a wall or
another robot, it goes back a little and turns to one side by an angle, both at random.

HOW TO USE IT. `n_robots`; `rows` of four pucks; `many`, `enough`. Two pucks are in one cluster if no robot can pass
between them. The work is done when nine tenths of the pucks are in one cluster; pucks that are carried are in none.
THINGS TO TRY. Ten robots: why are they slower than four? `many` at 3: why do two clusters remain?
EXTENDING IT. Pucks of two kinds, which robots sort. Robots with scoops that push pucks, as in the paper.
REFERENCE. Beckers, Holland and Deneubourg, Artificial Life IV, 181-189 (1994).
"""

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from mesa_swarm import (
    Carried,
    Gripper,
    Map,
    ProximitySensor,
    RobotDesign,
    Seed,
    Sensor,
    Slider,
    SwarmModel,
    disc,
    held,
    measure,
    until,
)
from mesa_swarm.analysis import group_sizes
from mesa_swarm.control import Subsumption, behaviour
from mesa_swarm.errors import check_count

APART, COLUMNS, PUCK, ROBOT = 30.0, 4, 2.0, 7.0  # distance of pucks, how many a row; radii
LINK = 2 * (ROBOT + PUCK)  # pucks whose centres are nearer are in one cluster: no robot passes between them
DONE = 0.9  # share of the pucks in the largest cluster
EVERY = 25  # steps between looks at the clusters
BEARINGS = (-45.0, -15.0, 15.0, 45.0)


@dataclass(frozen=True, kw_only=True)
class PucksAhead(Sensor):
    """How many pucks lie in the half-disc ahead of the robot's centre; `puck` is the code of their kind."""

    name: str = "pucks"
    puck: int
    view: float = 30.0

    @staticmethod
    def read(
        position: np.ndarray, heading: np.ndarray, bodies_position: np.ndarray, bodies_kind: np.ndarray,
        bodies_carrier: np.ndarray, puck: int, view: float, out: np.ndarray,
    ) -> None:  # fmt: skip
        """Write the number for each robot."""
        for i in range(len(out)):
            cosine, sine, count = math.cos(heading[i]), math.sin(heading[i]), 0
            for b in range(len(bodies_kind)):
                if bodies_kind[b] == puck and bodies_carrier[b] < 0:
                    x, y = bodies_position[b, 0] - position[i, 0], bodies_position[b, 1] - position[i, 1]
                    count += x * cosine + y * sine > 0 and math.hypot(x, y) < view
            out[i, 0] = count


@behaviour(memory={"back": 0, "turn": 0, "side": 1.0})
def gather(
    me: Any, puck: int = 0, many: float = 7.0, enough: float = 4.0, near: float = 5.0, safe: float = 6.0
) -> tuple[float, float]:
    """Pick up a puck where few are seen, put it down where many are."""
    carries, memory, met, blocked = me.carried[0] >= 0, me.memory, False, False
    me.act.grip = 1.0 if carries else 0.0
    if memory.back > 0:
        memory.back -= 1
        return -me.max_speed, -me.max_speed
    if memory.turn > 0:
        memory.turn -= 1
        return -memory.side * me.max_speed, memory.side * me.max_speed
    for s in range(len(me.distance)):
        if me.kind[s] == puck:
            met = met or me.distance[s] < near
        elif me.kind[s] >= 0:
            blocked = blocked or me.distance[s] < safe
    if met and not carries and me.chance > ((me.pucks[0] - 1) / many) ** 2:
        me.act.grip = 1.0
    elif met or blocked:
        if met and carries and me.chance < me.pucks[0] / enough:
            me.act.grip = 0.0
        memory.back, memory.turn = 3, 3 + int(20 * me.chance)
        memory.side = 1.0 if me.chance < 0.5 else -1.0
    else:
        return me.max_speed, me.max_speed
    return 0.0, 0.0


class PuckClustering(SwarmModel):
    """Robots that gather pucks in one cluster; stops running when nine tenths of the pucks are in one.

    Examples
    --------
    >>> PuckClustering(rng=1).run(0).results()
    {'one cluster at': None, 'clusters': 12}
    """

    compares = "n_robots", (2, 6, 12)
    steps_to_compare = 20_000
    headline = "one cluster at", "gathered the pucks in one cluster"
    stops = until("largest", at_least=DONE, every=EVERY)

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 16, 1, "robots")] = 4,
        rows: Annotated[int, Slider(1, 8, 1, "rows of four pucks")] = 3,
        many: Annotated[int, Slider(1, 30, 1, "other pucks in view from which on none is picked up")] = 7,
        enough: Annotated[int, Slider(1, 30, 1, "pucks in view from which on one is always put down")] = 4,
        rng: Seed = None,
    ) -> None:
        size = APART * COLUMNS, APART * check_count("rows", rows, maximum=30)
        reporters = held("clusters", "largest", every=EVERY)
        super().__init__(map=Map(name="arena", bounds=(0, 0, *size)), rng=rng, model_reporters=reporters)
        for column, row in np.ndindex(COLUMNS, rows):
            self.add_body(disc((APART * (column + 0.5), APART * (row + 0.5)), PUCK), kind="puck")
        eyes = [ProximitySensor(bearing_degrees=b, field_of_view_degrees=30.0, range=12.0) for b in BEARINGS]
        gripper = Gripper(reach=6.0, field_of_view_degrees=180.0)  # more than it sees
        self.puck = puck = self.add_kind("puck")
        sensors = (*eyes, Carried(), PucksAhead(puck=puck))
        robot = RobotDesign(radius=ROBOT, max_speed=2.0, sensors=sensors, actuators=(gripper,))
        self.add_robots(robot, check_count("n_robots", n_robots))
        limits = {"many": check_count("many", many), "enough": check_count("enough", enough)}
        self.control = Subsumption(gather(puck=puck, **limits))

    @property
    def lying(self) -> np.ndarray:
        """Where pucks lie that no robot carries, shape (k, 2)."""
        return self.movers.position[~self.movers.carried]

    @measure
    @staticmethod
    def clusters(bodies_position: np.ndarray, bodies_kind: np.ndarray, bodies_carrier: np.ndarray, puck: int) -> int:
        """Return the number of clusters, single pucks included; those that are carried are in none."""
        return len(group_sizes(bodies_position[(bodies_kind == puck) & (bodies_carrier < 0)], LINK))

    @measure
    @staticmethod
    def largest(bodies_position: np.ndarray, bodies_kind: np.ndarray, bodies_carrier: np.ndarray, puck: int) -> float:
        """Return the share of all pucks that are in the largest cluster."""
        sizes = group_sizes(bodies_position[(bodies_kind == puck) & (bodies_carrier < 0)], LINK)
        return np.max(sizes) / np.sum(bodies_kind == puck) if len(sizes) > 0 else 0.0

    @property
    def done_at(self) -> int | None:
        """Step in which the pucks were found in one cluster, or None."""
        return self.stopped_at

    def results(self) -> dict[str, float | None]:
        """Return the measures used by a comparison: when there was one cluster, or None, and how many there are."""
        return {"one cluster at": self.done_at, "clusters": self.clusters}
