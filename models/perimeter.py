"""Perimeter: robots that form a ring and face outwards.

WHAT IS IT? Musk oxen do this around their calves. Here the ring is empty: robots keep a distance from the centroid of
the visible robots, and turn their backs to it. A ring emerges, or several arcs, though no robot can see one.

HOW IT WORKS. Three layers; the first active layer drives. Avoid turns away from very near bodies. Perimeter drives
towards the perceived centroid from outside the ring distance, away from it from inside, and on the ring turns round
and stays. Explore drives straight on while no robot is in sight.

HOW TO USE IT. `ring` is the distance that each robot keeps from its perceived centroid; since nearer
robots hide farther ones, the resulting ring is wider. `sight` must reach across it.

THINGS TO NOTICE. The ring is not round, and its robots do not all face straight outwards: each has its own centroid,
of the robots that it sees. Latecomers settle in a second row behind a gap.

THINGS TO TRY. Sight of 100: how many rings are there? A ring of 20 for 50 robots. A tolerance of 0.

EXTENDING IT. Put a load in the middle, and let robots form the ring around it.

REFERENCE. Thesis, sections 3.2 and 10.2 (named there as future work).
"""

import math
from typing import Annotated

import numpy as np

from mesa_swarm import Choice, Seed, Slider, SwarmModel, all_round, control, held, measure
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.errors import check_count

# A full circle of narrow sensors: robots on the ring must see backwards.
SENSORS = 36


class Perimeter(SwarmModel):
    """Robots that form a ring and face outwards.

    Examples
    --------
    >>> Perimeter(n_robots=10, rng=1).run(5).steps
    5
    """

    compares = "sight", (100.0, 400.0)
    steps_to_compare = 2_000

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(2, 100, 1, "robots")] = 24,
        ring: Annotated[float, Slider(0, 200, 5, "distance to keep from the perceived centroid, map units")] = 70.0,
        tolerance: Annotated[float, Slider(0, 50, 1, "half the width of the ring, map units")] = 4.0,
        sight: Annotated[float, Slider(20, 1000, 10, "range of the infrared sensors, map units")] = 400.0,
        avoid_distance: Annotated[float, Slider(0, 30, 0.5, "distance below which robots turn away, map units")] = 4.0,
        map: Annotated[str, Choice(("openspace", "sparse", "original"), "walls and obstacles")] = "openspace",
        rng: Seed = None,
    ) -> None:
        super().__init__(map=map, rng=rng, model_reporters=held("roundness", "outwards"))
        self.add_robots(all_round(SENSORS, range=sight), check_count("n_robots", n_robots))
        layer = control.Perimeter(ring=ring, tolerance=tolerance)
        self.control = Subsumption(Avoid(distance=avoid_distance), layer, Explore())

    @measure
    @staticmethod
    def roundness(position: np.ndarray) -> float:
        """Return how uniform distances from the true centroid are: 1 - standard deviation / mean, at least 0."""
        x, y = np.mean(position[:, 0]), np.mean(position[:, 1])
        distance = np.array([math.hypot(place[0] - x, place[1] - y) for place in position])
        return max(0.0, 1.0 - np.std(distance) / np.mean(distance)) if len(distance) > 1 else 0.0

    @measure
    @staticmethod
    def outwards(position: np.ndarray, heading: np.ndarray) -> float:
        """Return the mean cosine of the angle between the robots' headings and straight outwards."""
        x, y, total = np.mean(position[:, 0]), np.mean(position[:, 1]), 0.0
        for i in range(len(heading)):
            total += math.cos(math.atan2(position[i, 1] - y, position[i, 0] - x) - heading[i])
        return total / len(heading) if len(heading) > 0 else 0.0

    def results(self) -> dict[str, float]:
        """Return the measures used by a comparison."""
        return {"roundness": self.roundness, "facing outwards": self.outwards}
