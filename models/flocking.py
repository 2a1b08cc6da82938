"""Flocking: robots on two wheels that drive as their neighbours drive.

WHAT IS IT? Robots do not know their neighbours' velocities; each tracks the centroid of the visible robots and moves
with it. Neighbours align their motion and form flocks, which are split and turned by walls.

HOW IT WORKS. Three layers; the first active layer drives. Avoid turns away from near bodies. MatchVelocity
estimates the velocity of the visible centroid, over several steps because a sensor sees no motion across its
sector, and drives the arc with the same displacement. Explore drives straight on.

HOW TO USE IT. `matching` off shows the same robots without the rule. `memory` is the time over which the neighbours'
motion is averaged, `sensors` the number of sectors of the circle, `sight` their range.

THINGS TO NOTICE. `alignment` (neighbours' headings) rises from about 0.3, the effect of walls and Avoid alone, to 0.6;
`polarization` of all robots hardly rises: there are several flocks, and each is turned by walls.

THINGS TO TRY. Fewer sensors; a longer memory: why does it not help? Fifteen robots, or a hundred: when do flocks meet?

EXTENDING IT. Put Gather below MatchVelocity, so that flocks stay together. Compare with the model boids.

REFERENCE. Thesis, section 5.3.4; Vicsek et al., Physical Review Letters 75 (1995), for polarization.
"""

from math import isnan
from typing import Annotated

import numpy as np

from mesa_swarm import Choice, Seed, Slider, SwarmModel, all_round, held, measure
from mesa_swarm.analysis import alignment_within, later_mean, order_of
from mesa_swarm.control import Avoid, Explore, MatchVelocity, Subsumption
from mesa_swarm.errors import check_choice, check_count, check_number


class Flocking(SwarmModel):
    """Robots on two wheels that drive as their neighbours drive.

    Examples
    --------
    >>> Flocking(n_robots=10, rng=1).run(5).steps
    5
    """

    compares = "matching", ("off", "on")
    steps_to_compare = 3_000

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(2, 200, 1, "robots")] = 50,
        matching: Annotated[str, Choice(("on", "off"), "whether robots match their neighbours' velocity")] = "on",
        memory: Annotated[float, Slider(1, 100, 1, "steps over which the neighbours' motion is averaged")] = 10.0,
        sight: Annotated[float, Slider(20, 200, 5, "range of the infrared sensors, map units")] = 60.0,
        sensors: Annotated[int, Slider(6, 36, 1, "number of infrared sensors, all round")] = 24,
        speed: Annotated[float, Slider(0.1, 1, 0.05, "speed of exploring robots, fraction of the maximum")] = 0.7,
        avoid_distance: Annotated[float, Slider(0, 30, 0.5, "distance below which robots turn away, map units")] = 8.0,
        map: Annotated[str, Choice(("openspace", "sparse", "original"), "walls and obstacles")] = "openspace",
        rng: Seed = None,
    ) -> None:
        super().__init__(map=map, rng=rng, model_reporters=held("alignment", "polarization"))
        self.sight = check_number("sight", sight, above=0, maximum=1000)
        self.add_robots(all_round(sensors, range=sight), check_count("n_robots", n_robots))
        match = (MatchVelocity(memory=memory),) if check_choice("matching", matching, ("on", "off")) == "on" else ()
        self.control = Subsumption(Avoid(distance=avoid_distance), *match, Explore(speed=speed))

    @measure
    @staticmethod
    def alignment(position: np.ndarray, heading: np.ndarray, sight: float) -> float:
        """Return the mean cosine of the angle between the headings of robots that are in sight of each other."""
        return alignment_within(position, heading, sight)

    @measure
    @staticmethod
    def polarization(heading: np.ndarray) -> float:
        """Return the length of the mean of all headings: near 0 for random, 1 for equal headings."""
        return order_of(heading)

    def results(self) -> dict[str, float | None]:
        """Return the measures used by a comparison: means over the second half, None without data."""
        means = {name: later_mean(self.datacollector.model_vars[name]) for name in ("alignment", "polarization")}
        return {name: None if isnan(mean) else mean for name, mean in means.items()}
