"""Task: what all tasks have: a world, robots, what they observe, and how their rewards are shared."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from mesa_swarm.base.errors import (
    InvalidValueError,
    UnknownNameError,
    check_count,
    check_number,
    shortened,
    unknown_name,
)
from mesa_swarm.control import Avoid, Explore, Layer
from mesa_swarm.environments.actions import CONTINUOUS, checked_choice
from mesa_swarm.environments.scores import LARGEST_REWARD, MESSAGE, ObservationEncoder, Score, TeamEncoder
from mesa_swarm.environments.variation import Conditions, Variation
from mesa_swarm.fire import FireConstants
from mesa_swarm.maps.map import Map
from mesa_swarm.robots.design import AGENT9, RobotDesign
from mesa_swarm.robots.radio import Radio
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.swarm_model import SwarmModel

# Fires that neither grow nor can be put out, and heat no robot: they only have to be found.
LASTING = FireConstants(k1=1e-9, k2=1e-12, k3=0.0, k4=0.0, leave=1.0, join=0.0)
# That robots broadcast in a step.
MOST_NUMBERS_SENT = 100


@dataclass(frozen=True, kw_only=True)
class Task:
    """Base class of the tasks: `CollisionAvoidance`, `FindFires`, `ExtinguishFires`, `Foraging` and `Aggregation`.

    Parameters
    ----------
    n_robots : int
        At least 1, at free random poses of their own in every episode.
    map : str, path or Map
    design : RobotDesign, or sequence of them
        Of all robots, with at least one proximity sensor. Of several designs the first robots have the first, and so
        on, each the same number of robots, the first ones one more where that does not come out even. A design that
        is named twice has twice the robots.
    encoding : str
        What robots observe: "distance", or "typed": the kinds of things as well, see `ObservationEncoder`.
    actions : "continuous", 4 or 8
        "continuous": two wheel speeds from -1 to 1, shares of the greatest; otherwise the number of one of the first
        4 or 8 actions of the thesis (8.1).
    max_steps : int
        After which an episode is truncated.
    variation : Variation, optional
        What is drawn anew for every episode: maps, numbers of robots, speeds, imperfections. Teams of several designs
        have a fixed number of robots.
    team : float
        Share of each robot's reward that is the mean of all rewarded robots, 0 to 1: 0 pays robots for what they do
        themselves, 1 all for what the team does.
    coverage_reward : float
        At least 0: what it is worth to a robot to be the first of all rewarded robots in one of 40 x 40 cells.
    messages : int
        How many numbers each commanded robot broadcasts in each step, 0 to 100: the last ones of its action, from -1
        to 1, which has to be continuous. Robots observe those of the nearest robot that they hear.
    message_range : float
        How far messages carry, centre to centre, map units, above 0.
    """

    n_robots: int = 15
    map: str | os.PathLike | Map = "original"
    design: RobotDesign | Sequence[RobotDesign] = AGENT9
    encoding: str = "distance"
    actions: str | int = "continuous"
    max_steps: int = 1000
    variation: Variation | None = None
    team: float = 0.0
    coverage_reward: float = 0.0
    messages: int = 0
    message_range: float = 150.0

    def __post_init__(self) -> None:
        check_count("n_robots", self.n_robots, minimum=1)
        check_count("max_steps", self.max_steps, minimum=1)
        checked_choice(self.actions)
        object.__setattr__(self, "map", Map.load(self.map))
        object.__setattr__(self, "design", self._checked_design())
        check_number("team", self.team, minimum=0, maximum=1)
        check_number("coverage_reward", self.coverage_reward, minimum=0, maximum=LARGEST_REWARD)
        check_count("messages", self.messages, maximum=MOST_NUMBERS_SENT)
        check_number("message_range", self.message_range, above=0, maximum=LARGEST_RANGE)
        if self.messages and self.actions != CONTINUOUS:
            raise InvalidValueError(
                f"messages is {self.messages} with actions={self.actions}; expected 'continuous' actions, the last "
                "numbers of which are broadcast"
            )
        self.observer()
        if self.variation is not None:
            self._check_variation(self.variation)

    def _checked_design(self) -> RobotDesign | tuple[RobotDesign, ...]:
        """Return one design, or as many as there are robots at most."""
        designs = [self.design] if isinstance(self.design, (RobotDesign, str)) else self.design
        if not isinstance(designs, Sequence) or not designs or not all(isinstance(d, RobotDesign) for d in designs):
            raise InvalidValueError(
                f"design is {shortened(self.design)}; expected a RobotDesign such as AGENT9, or several in a tuple"
            )
        if len(designs) > self.n_robots:
            raise InvalidValueError(
                f"design has {len(designs)} of them for {self.n_robots} robots; expected one for each robot at most"
            )
        return designs[0] if len(designs) == 1 else tuple(designs)

    @classmethod
    def of(cls, parameters: Mapping[str, Any]) -> "Task":
        """Return the task with these parameters."""
        names = [field.name for field in fields(cls)]
        for name in parameters:
            if name not in names:
                raise UnknownNameError(unknown_name(f"parameter of {cls.__name__}", name, names))
        return cls(**parameters)

    @property
    def chart(self) -> Map:
        """The map itself."""
        return Map.load(self.map)

    @property
    def constants(self) -> FireConstants:
        """How its fires burn."""
        return LASTING

    @property
    def most_robots(self) -> int:
        """The number of robots, or the largest that is drawn."""
        varied = None if self.variation is None else self.variation.n_robots
        return self.n_robots if varied is None else varied[1]

    def under(self, conditions: Conditions) -> "Task":
        """Return the task of one episode: with the map, the number of robots and the speed of these conditions."""
        designs = tuple(
            replace(design, max_speed=float(design.max_speed) * conditions.speed) for design in self.designs
        )
        return replace(self, map=conditions.map, n_robots=conditions.n_robots, design=designs, variation=None)

    def _check_variation(self, variation: Variation) -> None:
        """Refuse what some episode could not be."""
        if not isinstance(variation, Variation):
            raise InvalidValueError(f"variation is {shortened(variation)}; expected Variation(...)")
        if variation.n_robots is not None and len(self.designs) > 1:
            raise InvalidValueError(
                f"variation draws the number of robots of {len(self.designs)} designs; expected one design, or a fixed "
                "number: an agent always has the same observations"
            )
        maps: Any = () if callable(variation.maps) else variation.maps
        for chart in maps or (self.chart,):
            self.under(Conditions(map=chart, n_robots=self.most_robots, speed=variation.speed[1]))

    @property
    def designs(self) -> tuple[RobotDesign, ...]:
        """The design, or all of them, in the order in which robots have them."""
        return (self.design,) if isinstance(self.design, RobotDesign) else tuple(self.design)

    def blocks(self) -> Iterator[tuple[RobotDesign, int]]:
        """Yield each design with the number of robots that have it, in the order of the robots."""
        count, more = divmod(self.n_robots, len(self.designs))
        for k, design in enumerate(self.designs):
            yield design, count + (k < more)

    @property
    def numbers(self) -> int:
        """How many numbers a continuous action has: two wheel speeds, and those that are broadcast."""
        return 2 + self.messages

    @property
    def acts(self) -> tuple[str, ...]:
        """The names of the actuators that commanded robots use."""
        return ()

    def set_acts(self, model: SwarmModel, actions: np.ndarray, acts: np.ndarray) -> None:
        """Write what the actuators of the commanded robots are set to, shape (k, number of `acts`)."""

    @property
    def radio(self) -> Radio | None:
        """How robots broadcast, None without messages."""
        if not self.messages:
            return None
        return Radio(range=self.message_range, state=False, goal=False, message={MESSAGE: self.messages}, most=1)

    def observer(self) -> ObservationEncoder | TeamEncoder:
        """Return what turns readings into observations; of several designs, for robots in the order of `blocks`."""
        if isinstance(self.design, RobotDesign):
            return self.encoder(self.design)
        return TeamEncoder([(self.encoder(design), count) for design, count in self.blocks()])

    def encoder(self, design: RobotDesign) -> ObservationEncoder:
        """Return what turns readings of robots of one design into observations."""
        return ObservationEncoder(design, encoding=self.encoding, **self._heard())

    def _heard(self) -> dict[str, Any]:
        """Return what observations hold of messages."""
        return {"messages": self.messages, "message_range": float(self.message_range)}

    def furnish(self, model: SwarmModel) -> None:
        """Add to a new world what the task needs besides its map and its robots, which are there; nothing here."""

    @property
    def most_things(self) -> int:
        """How many places `things` returns at most."""
        return 0

    def things(self, model: SwarmModel) -> np.ndarray:
        """Return places, shape (m, 2), of what the task has added, for the state that a central critic sees."""
        return np.empty((0, 2))

    def others(self) -> tuple[Layer, ...]:
        """Return the layers that drive the robots that are not commanded."""
        return Avoid(), Explore()

    @property
    def rewards_state(self) -> bool:
        """Whether the score is of the readings with which robots acted, and not of those after the step."""
        return False

    def score(self, model: SwarmModel, count: int) -> Score:
        """Return what rewards the first `count` robots of a new world."""
        raise NotImplementedError
