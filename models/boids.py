"""Boids: Reynolds's three rules on robots that move in any direction.

WHAT IS IT? The best known model of a flock, for comparison: separation, alignment and cohesion, added up. The bodies
can go sideways (a holonomic drive), as birds on a screen can; see the model flocking for wheels.

HOW IT WORKS. Each rule asks for a velocity, and the weighted sum of all drives the robot (VectorSum). Separate moves
away from what is near, walls too. Align moves as the visible centroid moves. Cohere moves towards the centroid.
Cruise goes on as before. What the robots know of each other they see by infrared; nobody tells them anything.

HOW TO USE IT. The four weights. 0 switches a rule off.

THINGS TO NOTICE. Bodies keep their heading: the white half shows where the front is, not where the robot goes. Flocks
part at walls and meet again.

THINGS TO TRY. Alignment alone. Cohesion without separation. How little cruising is enough?

EXTENDING IT. Give the flock a predator: a robot of another design that the others separate from.

REFERENCE. C. W. Reynolds, Flocks, herds and schools: a distributed behavioral model, SIGGRAPH 1987.
"""

from math import isnan
from typing import Annotated

import numpy as np

from mesa_swarm import HolonomicDrive, SwarmModel, all_round
from mesa_swarm.analysis import directions, later_mean, neighbour_alignment, polarization
from mesa_swarm.control import Align, Cohere, Cruise, Separate, VectorSum
from mesa_swarm.errors import check_count, check_number
from mesa_swarm.parameters import Choice, Slider
from mesa_swarm.reporters import held
from mesa_swarm.streams import Seed

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
        separation_weight: Annotated[float, Slider(0, 5, 0.1, "of moving away from what is near")] = 3.0,
        alignment_weight: Annotated[float, Slider(0, 5, 0.1, "of moving as the neighbours do")] = 1.0,
        cohesion_weight: Annotated[float, Slider(0, 5, 0.1, "of moving towards the neighbours")] = 0.5,
        cruise_weight: Annotated[float, Slider(0, 5, 0.1, "of going on as before")] = 1.0,
        separation: Annotated[float, Slider(1, 40, 1, "what is nearer than this is near, map units")] = 15.0,
        sight: Annotated[float, Slider(20, 200, 5, "range of the infrared sensors, map units")] = 60.0,
        memory: Annotated[float, Slider(1, 100, 1, "steps over which the neighbours' motion is averaged")] = 10.0,
        map: Annotated[str, Choice(("openspace", "sparse", "original"), "the world")] = "openspace",
        rng: Seed = None,
    ) -> None:
        super().__init__(map=map, rng=rng, model_reporters=held("alignment", "polarization"))
        self.sight = check_number("sight", sight, above=0, maximum=1000)
        boid = all_round(SENSORS, range=sight, name="boid", drive=HolonomicDrive())
        self.add_robots(boid, check_count("n_robots", n_robots))
        self._before = self.swarm.position.copy()
        self.control = VectorSum(
            Separate(distance=separation),
            Align(memory=memory),
            Cohere(distance=sight),
            Cruise(),
            weights=(separation_weight, alignment_weight, cohesion_weight, cruise_weight),
        )

    def step(self) -> None:
        """Advance by one step, and remember where everybody was."""
        self._before = self.swarm.position.copy()
        super().step()

    @property
    def travel(self) -> np.ndarray:
        """Azimuth in which each robot moved in the last step, rad, nan where it did not, shape (n,)."""
        # Who has come or gone since has not travelled yet.
        before = self._before if len(self._before) == len(self.swarm) else self.swarm.position
        return directions(before, self.swarm.position)

    @property
    def alignment(self) -> float:
        """Mean cosine of the angle between the directions of travel of robots in sight of each other."""
        return neighbour_alignment(self.swarm.position, self.travel, self.sight)

    @property
    def polarization(self) -> float:
        """Length of the mean of all directions of travel: 0 for none alike, 1 for all alike."""
        return polarization(self.travel)

    def results(self) -> dict[str, float | None]:
        """Return what a comparison compares: means over the second half, None for nothing to measure."""
        means = {name: later_mean(self.datacollector.model_vars[name]) for name in ("alignment", "polarization")}
        return {name: None if isnan(mean) else mean for name, mean in means.items()}
