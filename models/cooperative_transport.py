"""Cooperative transport: robots that together push a load that none of them can move alone.

WHAT IS IT? The arena contains a load too heavy for one robot. Robots that find it push it to a goal, without knowing
the positions of the others or the motion of the load.

HOW IT WORKS. A load gives way when the sum of the robots' pushes exceeds its resistance (quasi-static, with an
ellipsoidal limit surface). A beacon at the goal is heard by robots that are not in the load's shadow. Layers; the first
active layer drives: Avoid (not of loads), Push (push in the shadow, otherwise go round), Explore with random turns.

HOW TO USE IT. `n_robots` and `resistance`: the number of full pushes through its centre that the load withstands. Off
centre there is a lever: a push at a corner of the box counts as up to 1.65. `load` is a disc or a box.

THINGS TO NOTICE. One robot pushes for ever. With as many robots as the resistance requires the load rarely moves: all
must be there at once, and push in the same direction. A box turns.

THINGS TO TRY. Five robots against a resistance of 3.5. Twenty robots: do they help or hinder each other? A box.

EXTENDING IT. Let a robot go round to another place after it has pushed for long without moving the load.

REFERENCE. Chen, Gauci, Li, Kolling and Gross, IEEE Transactions on Robotics 31 (2015); thesis, section 3.2.
"""

import math
from typing import Annotated

import numpy as np

from mesa_swarm import Choice, Radio, Seed, Slider, SwarmModel, all_round, disc, process, rectangle, until, value
from mesa_swarm.control import Avoid, Explore, Push, Subsumption
from mesa_swarm.errors import check_choice, check_count

START, GOAL = (250.0, 300.0), (600.0, 300.0)
HALF = 25.0
# Distance of the load's centre from the goal at which it has arrived.
NEAR = 30.0
LOADS = {
    "disc": disc(START, HALF),
    "box": rectangle((START[0] - HALF, START[1] - HALF), (START[0] + HALF, START[1] + HALF)),
}


@process(memory={"left": math.dist(START, GOAL), "pushers": 0})
def way(
    bodies_position: np.ndarray, bodies_pushers: np.ndarray, left: np.ndarray, pushers: np.ndarray, row: int = 0
) -> None:
    """Measure how far the load's centre is from the goal, map units, and how many robots pushed it in this step."""
    left[0] = math.hypot(bodies_position[row, 0] - GOAL[0], bodies_position[row, 1] - GOAL[1])
    pushers[0] = bodies_pushers[row]


class CooperativeTransport(SwarmModel):
    """Robots that together push a load that none of them can move alone.

    Stops running when the load has arrived.

    Examples
    --------
    >>> CooperativeTransport(n_robots=1, rng=1).run(20).results()["way left"]
    350.0
    """

    compares = "n_robots", (1, 5)
    steps_to_compare = 10_000
    headline = "arrived at", "brought the load to the goal"
    way_left = value("way.left")  # distance of the load's centre from the goal, map units
    pushers = value("way.pushers")  # number of robots that pushed the load in the last step
    stops = until("way_left", at_most=NEAR)

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 50, 1, "robots")] = 5,
        resistance: Annotated[
            float, Slider(0.5, 10, 0.1, "full pushes withstood; one at a corner counts up to 1.65")
        ] = 1.7,
        load: Annotated[str, Choice(tuple(LOADS), "the shape of the load")] = "disc",
        sight: Annotated[float, Slider(20, 200, 5, "range of the infrared sensors, map units")] = 150.0,
        turn_interval: Annotated[int, Slider(0, 1000, 10, "steps between random turns, 0 for none")] = 200,
        avoid_distance: Annotated[float, Slider(0, 30, 0.5, "distance below which robots turn away, map units")] = 3.0,
        rng: Seed = None,
    ) -> None:
        super().__init__(map="openspace", rng=rng, model_reporters={"way_left": "way_left", "pushers": "pushers"})
        self.add_obstacle(disc(GOAL, NEAR, contact=False))  # a mark on the ground at the goal
        self.load = self.add_load(LOADS[check_choice("load", load, LOADS)], resistance=resistance)
        self.add_process(way(row=self.load.row))
        self.communication = Radio(range=2000.0, state=False, occlusion=True, beacons=(GOAL,))
        self.add_robots(all_round(12, range=sight), check_count("n_robots", n_robots))
        self.control = Subsumption(
            Avoid(distance=avoid_distance, loads="never"), Push(), Explore(turn_interval=turn_interval)
        )

    @property
    def arrived_at(self) -> int | None:
        """Step in which the load arrived, or None."""
        return self.stopped_at

    def results(self) -> dict[str, float | None]:
        """Return the measures used by a comparison: the step of arrival or None, and the remaining distance."""
        return {"arrived at": self.arrived_at, "way left": self.way_left}
