"""Boids: Reynolds's three rules on robots that move in any direction.

WHAT IS IT? The best known model of a flock, for comparison: the sum of separation, alignment and cohesion. The bodies
can move sideways (a holonomic drive); see the model flocking for wheels.

HOW IT WORKS. Each rule returns a velocity, and the weighted sum drives the robot (VectorSum). Separate moves away from
near bodies, including walls. Align moves as the visible centroid moves. Cohere moves towards the centroid. Cruise
maintains the velocity. Robots perceive each other by infrared only, without communication.

HOW TO USE IT. The four weights. 0 switches a rule off.

THINGS TO NOTICE. The bodies never turn; the light half of each is drawn in its direction of motion. Flocks split at
walls and rejoin.

THINGS TO TRY. Alignment alone. Cohesion without separation. What is the smallest sufficient cruise weight?

EXTENDING IT. Add a predator: a robot of another design from which the others separate.

REFERENCE. C. W. Reynolds, Flocks, herds and schools: a distributed behavioral model, SIGGRAPH 1987.
"""

from math import isnan
from typing import Annotated

import numpy as np

from mesa_swarm import Choice, HolonomicDrive, Previous, Seed, Slider, SwarmModel, all_round, held, measure
from mesa_swarm.analysis import alignment_within, later_mean, order_of, travel_of
from mesa_swarm.control import Align, Cohere, Cruise, Separate, VectorSum
from mesa_swarm.errors import check_count, check_number

SENSORS = 12


class Boids(SwarmModel):
    """Reynolds's three rules on robots that move in any direction.

    Examples
    --------
    >>> Boids(n_robots=10, rng=1).run(5).steps
    5
    """

    compares = "alignment_weight", (0.0, 1.0)
    steps_to_compare = 3_000

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(2, 200, 1, "robots")] = 50,
        separation_weight: Annotated[float, Slider(0, 5, 0.1, "weight of moving away from near bodies")] = 3.0,
        alignment_weight: Annotated[float, Slider(0, 5, 0.1, "weight of moving as the neighbours do")] = 1.0,
        cohesion_weight: Annotated[float, Slider(0, 5, 0.1, "weight of moving towards the neighbours")] = 0.5,
        cruise_weight: Annotated[float, Slider(0, 5, 0.1, "weight of maintaining the velocity")] = 1.0,
        separation: Annotated[float, Slider(1, 40, 1, "distance below which robots separate, map units")] = 15.0,
        sight: Annotated[float, Slider(20, 200, 5, "range of the infrared sensors, map units")] = 60.0,
        memory: Annotated[float, Slider(1, 100, 1, "steps over which the neighbours' motion is averaged")] = 10.0,
        map: Annotated[str, Choice(("openspace", "sparse", "original"), "walls and obstacles")] = "openspace",
        rng: Seed = None,
    ) -> None:
        super().__init__(map=map, rng=rng, model_reporters=held("alignment", "polarization"))
        self.sight = check_number("sight", sight, above=0, maximum=1000)
        boid = all_round(SENSORS, range=sight, name="boid", drive=HolonomicDrive())
        self.add_robots(boid, check_count("n_robots", n_robots))
        self.add_part(Previous("position"))
        self.control = VectorSum(
            Separate(distance=separation),
            Align(memory=memory),
            Cohere(distance=sight),
            Cruise(),
            weights=(separation_weight, alignment_weight, cohesion_weight, cruise_weight),
        )

    @property
    def travel(self) -> np.ndarray:
        """Azimuth of each robot's motion in the last step, rad, nan without motion, shape (n,)."""
        return travel_of(self.parts["previous"].columns()["position"].array, self.swarm.position)

    @measure
    @staticmethod
    def alignment(position: np.ndarray, previous_position: np.ndarray, sight: float) -> float:
        """Return the mean cosine of the angle between the directions of travel of robots in sight of each other."""
        return alignment_within(position, travel_of(previous_position, position), sight)

    @measure
    @staticmethod
    def polarization(position: np.ndarray, previous_position: np.ndarray) -> float:
        """Return the length of the mean of all directions of travel: near 0 for random, 1 for equal directions."""
        return order_of(travel_of(previous_position, position))

    def results(self) -> dict[str, float | None]:
        """Return the measures used by a comparison: means over the second half, None without data."""
        means = {name: later_mean(self.datacollector.model_vars[name]) for name in ("alignment", "polarization")}
        return {name: None if isnan(mean) else mean for name, mean in means.items()}
