"""Agglomeration: robots that gather without a common goal position.

WHAT IS IT? Robots explore until they see others, drive to the centroid of the visible robots, and stay there. Fifty
of them end up in many groups rather than in one, which the thesis calls local convergence.

HOW IT WORKS. Three layers; the first active layer drives. Avoid turns away from very near bodies. Gather turns on the
spot towards the perceived centroid of the visible robots when its bearing exceeds the critical angle, and stays when it
is ahead and near. Explore drives straight on. With `moving`, groups do not stay: a robot of the lowest rank within
range leads (lead), robots drive as the visible robots do (match), or both with a head-on rule (together).

HOW TO USE IT. `sight` is the range at which robots see each other, `stop_distance` the distance of the centroid at
which they stay, `avoid_distance` the range of Avoid: above `stop_distance` minus a radius, robots never come to rest.

THINGS TO NOTICE. Pairs and triples that no robot joins. Robots whose neighbour is in a blind spot, which swing to and
fro between two sensors. A robot that is followed by all others, until it turns round.

THINGS TO TRY. Longer sight: are there fewer groups? Random turns: do groups grow afterwards? A larger stop distance:
why are there only pairs?

EXTENDING IT. Let a leader that has met no robot for long turn at random.

REFERENCE. Thesis, sections 5.2.3.1, 5.3.2 and 5.3.4.
"""

from typing import Annotated

import numpy as np

from mesa_swarm import AGENT9, Choice, Radio, Seed, Slider, SwarmModel, held, measure
from mesa_swarm.analysis import group_sizes, mean_gap
from mesa_swarm.control import Avoid, Explore, Gather, HeadOn, Lead, MatchVelocity, Subsumption
from mesa_swarm.control.head_on import NUMBERS
from mesa_swarm.errors import check_choice, check_count

# Greatest distance between the centres of linked robots: two robot diameters and a margin.
LINK = 25.0
# How groups move; the last two are the first two and a head-on rule, by number or by chain.
MOVING = "off", "lead", "match", "together", "together by chain"


class Agglomeration(SwarmModel):
    """Robots that gather in groups.

    Examples
    --------
    >>> Agglomeration(n_robots=10, rng=1).run(5).steps
    5
    """

    compares = "sight", (50.0, 100.0)
    steps_to_compare = 3_000

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(2, 200, 1, "robots")] = 50,
        sight: Annotated[float, Slider(10, 200, 5, "range of the infrared sensors, map units")] = 50.0,
        stop_distance: Annotated[float, Slider(0, 60, 1, "centroid distance at which robots stay, map units")] = 12.0,
        critical_angle: Annotated[float, Slider(0, 90, 1, "centroid bearing that makes robots turn, degrees")] = 10.0,
        avoid_distance: Annotated[float, Slider(0, 30, 0.5, "distance below which robots turn away, map units")] = 4.0,
        turn_interval: Annotated[int, Slider(0, 1000, 10, "steps between random turns, 0 for none")] = 0,
        moving: Annotated[str, Choice(MOVING, "how groups move")] = "off",
        map: Annotated[str, Choice(("openspace", "sparse", "original"), "walls and obstacles")] = "openspace",
        rng: Seed = None,
    ) -> None:
        super().__init__(map=map, rng=rng, model_reporters=held("groups", "largest_group", "neighbour_distance"))
        together = check_choice("moving", moving, MOVING).startswith("together")
        self.add_robots(AGENT9.with_proximity(range=sight), check_count("n_robots", n_robots))
        if together or moving == "lead":
            self.communication = Radio(range=2 * sight, state=False, goal=False, message=("rank", *NUMBERS), most=50)
        self.control = Subsumption(
            *((HeadOn(leader="chain" if "chain" in moving else "number"),) if together else ()),
            Avoid(distance=avoid_distance),
            *((Lead(speed=0.3),) if together or moving == "lead" else ()),
            *((MatchVelocity(),) if together or moving == "match" else ()),
            Gather(critical_angle_degrees=critical_angle, stop_distance=stop_distance),
            Explore(turn_interval=turn_interval),
        )

    @measure
    @staticmethod
    def groups(position: np.ndarray) -> int:
        """Return the number of groups of at least two robots."""
        return np.sum(group_sizes(position, LINK) > 1)

    @measure
    @staticmethod
    def largest_group(position: np.ndarray) -> float:
        """Return the fraction of all robots that are in the largest group."""
        sizes = group_sizes(position, LINK)
        return np.max(sizes) / len(position) if (sizes > 1).any() else 0.0

    @measure
    @staticmethod
    def neighbour_distance(position: np.ndarray) -> float:
        """Return the mean distance to the nearest other robot, between centres, map units; NaN for fewer than two."""
        return mean_gap(position)

    def results(self) -> dict[str, float | None]:
        """Return the measures used by a comparison."""
        return {
            "groups": self.groups,
            "largest group": self.largest_group,
            "mean distance to the nearest robot": self.neighbour_distance if len(self.swarm) > 1 else None,
        }
