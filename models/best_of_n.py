"""Best of n: robots that agree on the better of two sites by spreading opinions for a time that grows with quality.

WHAT IS IT? Two sites left and right of a nest differ in quality. No robot compares them: each knows the quality of one
site at a time, and hears the opinions of robots near it. Together they choose the better site, or at least one site.

HOW IT WORKS. A robot goes to the site of its opinion, stays for a random time, and measures its quality. Back in the
nest it broadcasts its opinion for a random time whose mean is proportional to that quality. Then it decides: by the
voter rule it takes the opinion of a random one of the robots that it hears, by the majority rule that of most of them,
its own included. It goes to the site of its new opinion, and so on. A light at the right shows where the sites are.

HOW TO USE IT. `rule` is how robots decide, `quality` that of the right site, relative to the left one; `range` is how
far a broadcast carries, `first_share` the share of robots for the left site at first.

THINGS TO NOTICE. The better site gains because its robots broadcast for longer. The majority rule is faster; the voter
rule errs less often if most robots begin with the wrong opinion.

THINGS TO TRY. Equal qualities. A range of 20, and of 200. A first share of 0.2. EXTENDING IT. A third site.

REFERENCE. Valentini, Ferrante, Hamann and Dorigo, Autonomous Agents and Multi-Agent Systems 30 (2016) 553-580.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from mesa_swarm import (
    AGENT9,
    Actuator,
    Choice,
    Map,
    Radio,
    RobotDesign,
    Seed,
    Sensor,
    Slider,
    SwarmModel,
    rectangle,
    share,
    until,
)
from mesa_swarm.control import PASS, Avoid, Explore, Subsumption, behaviour
from mesa_swarm.errors import check_choice, check_count, check_number

# Where the nest begins and ends; the sites are left and right of it.
WIDTH, HEIGHT, NEST = 600.0, 300.0, (200.0, 400.0)
RULES = ("voter", "majority")


@dataclass(frozen=True, kw_only=True)
class Ground(Sensor):
    """The bearing of the light; the place: -1 left, 0 nest, 1 right; its quality; the robot's first opinion."""

    name: str = "ground"
    width: int = 4
    quality: float = 1.0
    first: int = 1

    @staticmethod
    def read(position: np.ndarray, heading: np.ndarray, quality: float, first: int, out: np.ndarray) -> None:
        """Fill `out` (n, 4)."""
        x = position[:, 0]
        out[:, 0], out[:, 1] = -heading, np.sign(x - NEST[0]) / 2 + np.sign(x - NEST[1]) / 2
        out[:, 2], out[:, 3] = np.where(x < NEST[0], 1.0, quality), first


@dataclass(frozen=True, kw_only=True)
class Opinion(Actuator):
    """What a robot displays: -1 for the left site, 1 for the right one."""

    name: str = "opinion"


BODY = RobotDesign(max_speed=2.0, actuators=(Opinion(),))


@behaviour(memory={"opinion": 0, "in_nest": False, "left": -1.0, "quality": 0.0})
def choose(me: Any, majority: bool = True, exploring: float = 50.0, advertising: float = 200.0) -> Any:
    """Explore a site, advertise it in the nest, decide; wander where this is done, and go there from elsewhere."""
    bearing, place, memory = me.ground[0], me.ground[1], me.memory
    if memory.opinion == 0:
        memory.opinion = int(me.ground[3])
    goal = 0 if memory.in_nest else memory.opinion
    if memory.left < 0.0:  # a new stay: for how long?
        memory.left = -math.log(1.0 - me.chance) * (advertising * memory.quality if memory.in_nest else exploring)
    elif place == goal:
        memory.left -= 1.0
        if memory.left < 0.0:
            if not memory.in_nest:
                memory.quality = me.ground[2]
            elif me.heard.n > 0 and not majority:
                memory.opinion = int(me.heard.opinion[int(me.chance * me.heard.n)])
            elif me.heard.n > 0:
                balance = memory.opinion
                for j in range(me.heard.n):
                    balance += int(me.heard.opinion[j])
                memory.opinion = memory.opinion if balance == 0 else (1 if balance > 0 else -1)
            memory.in_nest = not memory.in_nest
    if memory.in_nest and place == 0:
        me.send.opinion = memory.opinion
    me.act.opinion = memory.opinion
    blocked = 0.0 <= me.distance[me.front] < 12.0 or 0.0 <= me.distance[me.left] < 8.0
    if place == goal or blocked or 0.0 <= me.distance[me.right] < 8.0:
        return PASS
    turn = math.sin(bearing if goal > place else bearing + math.pi)
    return me.max_speed * min(1.0, 1.0 - turn), me.max_speed * min(1.0, 1.0 + turn)


class BestOfN(SwarmModel):
    """Robots that agree on the better of two sites; stops running when all have one opinion.

    Examples
    --------
    >>> BestOfN(n_robots=6, rng=1).run(5).steps
    5
    """

    compares = "rule", RULES
    steps_to_compare = 20_000
    headline = "agreed at", "agreed"
    for_left = share("act.opinion", below=0, empty=0.5)  # of robots
    stops = until("for_left", equals=0), until("for_left", equals=1)

    def __init__(
        self,
        *,
        n_robots: Annotated[int, Slider(1, 200, 1, "robots")] = 40,
        rule: Annotated[str, Choice(RULES, "how robots decide")] = "majority",
        quality: Annotated[float, Slider(0, 1, 0.05, "quality of the right site; the left one has 1")] = 0.8,
        first_share: Annotated[float, Slider(0, 1, 0.05, "share of robots for the left site at the start")] = 0.5,
        exploring: Annotated[float, Slider(0, 1000, 10, "mean time at a site, steps")] = 50.0,
        advertising: Annotated[float, Slider(10, 2000, 10, "mean time of broadcasting for quality 1, steps")] = 200.0,
        range: Annotated[float, Slider(10, 300, 5, "how far a broadcast carries, map units")] = 60.0,
        rng: Seed = None,
    ) -> None:
        marks = (rectangle((x, 0), (x + 2, HEIGHT), contact=False) for x in NEST)
        arena = Map(name="two sites", bounds=(0, 0, WIDTH, HEIGHT), obstacles=tuple(marks))
        super().__init__(map=arena, rng=rng, model_reporters={"for_left": "for_left"})
        count = check_count("n_robots", n_robots)
        first_count = round(count * check_number("first_share", first_share, minimum=0, maximum=1))
        for first, size in ((-1, first_count), (1, count - first_count)):
            ground = Ground(quality=check_number("quality", quality, minimum=0, maximum=1), first=first)
            self.add_robots(replace(BODY, sensors=(*AGENT9.sensors, ground)), size)
        self.communication = Radio(range=range, state=False, goal=False, message=("opinion",))
        is_majority = check_choice("rule", rule, RULES) == "majority"
        deciding = choose(majority=is_majority, exploring=exploring, advertising=advertising)
        self.control = Subsumption(deciding, Avoid(distance=12), Explore(turn_interval=50))

    @property
    def agreed_at(self) -> int | None:
        """Step in which all robots had one opinion for the first time, or None."""
        return self.stopped_at

    def results(self) -> dict[str, float | None]:
        """Return the measures used by a comparison: the step of agreement or None, and the share for the left."""
        return {"agreed at": self.agreed_at, "share for the left site": self.for_left}
