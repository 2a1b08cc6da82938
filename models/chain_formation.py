"""Chain formation: robots that follow the nearest robot ahead, and thereby form chains.

WHAT IS IT? A robot follows the nearest robot ahead; no robot is designated as leader. A robot that follows none and is
followed is a leader, without knowing it.

HOW IT WORKS. Layers; the first active layer drives. HeadOn (if switched on) turns round on the spot when another robot
approaches head-on: at a random speed, so that the slower one follows, or by a number that both broadcast. Avoid turns
away from very near bodies. Follow turns on the spot towards the nearest robot ahead and drives after it: at full speed
while it is farther than the gap, otherwise at cruise speed. Explore drives straight on at cruise speed, so that
followers can catch up.

HOW TO USE IT. `gap` and `gap_rule`: without the rule all robots drive equally fast and followers remain at the limit
of their sight. `head_on` chooses the leader rule: on for random turning speeds, number for communicated numbers, chain
for robots without followers that turn round before a chain and become its head.

THINGS TO NOTICE. Chains bend at walls and stay intact if they arrive at an angle; a leader that turns for long meets
its own followers. Chains that meet head-on split into two others. A ring can follow itself for ever.

THINGS TO TRY. The gap rule off: how long do chains get? Nine sensors instead of three: why do pairs now block each
other for ever? (An ethogram shows it.) Sensors with a range of only 30 units. Twenty robots, or a hundred.

EXTENDING IT. Let the last robot of a chain drop out when no robot has followed it for long.

REFERENCE. Thesis, sections 5.2.3.2, 5.3.3 and 10.2.
"""

from typing import Annotated

import numpy as np

from mesa_swarm import AGENT3, AGENT6, AGENT9, Choice, Radio, Seed, Slider, SwarmModel, held, measure
from mesa_swarm.analysis import Chains, chain_lengths, chains
from mesa_swarm.control import Avoid, Explore, Follow, HeadOn, Subsumption
from mesa_swarm.control.head_on import NUMBERS
from mesa_swarm.errors import check_choice, check_count

DESIGNS = {"AGENT3": AGENT3, "AGENT6": AGENT6, "AGENT9": AGENT9}
SWITCH = ("on", "off")
# The parameters of HeadOn, if any.
LEADERS: dict[str, dict] = {
    "off": {},
    "on": {"leader": "speed"},
    **{how: {"leader": how} for how in ("number", "chain")},
}


class ChainFormation(SwarmModel):
    """Robots that follow the nearest robot ahead, and thereby form chains.

    Examples
    --------
    >>> ChainFormation(n_robots=10, rng=1).run(5).steps
    5
    """

    compares = "gap_rule", SWITCH
    steps_to_compare = 3_000

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(2, 200, 1, "robots")] = 50,
        gap_rule: Annotated[str, Choice(SWITCH, "whether distant followers drive faster")] = "on",
        gap: Annotated[float, Slider(0, 50, 1, "distance above which followers drive faster, map units")] = 15.0,
        head_on: Annotated[str, Choice(tuple(LEADERS), "how robots that meet head-on choose a leader")] = "off",
        cruise_speed: Annotated[float, Slider(0.1, 1, 0.05, "fraction of the maximum speed")] = 0.7,
        design: Annotated[str, Choice(tuple(DESIGNS), "the robots' bodies and sensors")] = "AGENT3",
        sight: Annotated[float, Slider(10, 200, 5, "range of the infrared sensors, map units")] = 50.0,
        avoid_distance: Annotated[float, Slider(0, 30, 0.5, "distance below which robots turn away, map units")] = 4.0,
        map: Annotated[str, Choice(("openspace", "sparse", "original"), "walls and obstacles")] = "openspace",
        rng: Seed = None,
    ) -> None:
        super().__init__(map=map, rng=rng, model_reporters=held("chains", "mean_chain", "chained", every=25))
        body = DESIGNS[check_choice("design", design, DESIGNS)].with_proximity(range=sight)
        self.add_robots(body, check_count("n_robots", n_robots))
        self.link_distance = sight + 2.0 * body.radius
        hurries = check_choice("gap_rule", gap_rule, SWITCH) == "on"
        rule = LEADERS[check_choice("head_on", head_on, LEADERS)]
        if head_on in ("number", "chain"):
            self.communication = Radio(range=self.link_distance, state=False, goal=False, message=NUMBERS)
        chooses = (HeadOn(**rule),) if rule else ()
        self.control = Subsumption(
            *chooses,
            Avoid(distance=avoid_distance),
            Follow(gap=gap if hurries else None, cruise_speed=cruise_speed),
            Explore(speed=cruise_speed),
        )

    def find_chains(self) -> Chains:
        """Return the links between followers and leaders in the current step."""
        return chains(self.swarm.position, self.swarm.heading, link_distance=self.link_distance)

    @measure
    @staticmethod
    def chains(position: np.ndarray, heading: np.ndarray, link_distance: float) -> int:
        """Return the number of chains of at least two robots."""
        return len(chain_lengths(position, heading, link_distance))

    @measure
    @staticmethod
    def mean_chain(position: np.ndarray, heading: np.ndarray, link_distance: float) -> float:
        """Return the mean number of robots in a chain, 0 without chains."""
        lengths = chain_lengths(position, heading, link_distance)
        return np.mean(lengths) if len(lengths) > 0 else 0.0

    @measure
    @staticmethod
    def chained(position: np.ndarray, heading: np.ndarray, link_distance: float) -> float:
        """Return the fraction of all robots that are in a chain."""
        return np.sum(chain_lengths(position, heading, link_distance)) / max(len(heading), 1)

    def results(self) -> dict[str, float]:
        """Return the measures used by a comparison."""
        chains = self.find_chains()
        return {
            "chains": chains.count,
            "mean chain": self.mean_chain,
            "longest chain": chains.longest,
            "chained": self.chained,
        }
