"""The tasks: world, robots, rewards, and when an episode ends."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from mesa_swarm.control import Avoid, Explore, Layer
from mesa_swarm.environments.actions import checked_choice
from mesa_swarm.environments.scores import (
    DrivingScore,
    ExtinguishingScore,
    FindingScore,
    ObservationEncoder,
    Score,
    ThesisScore,
)
from mesa_swarm.environments.variation import Conditions, Variation
from mesa_swarm.errors import (
    InvalidValueError,
    UnknownNameError,
    check_choice,
    check_count,
    check_number,
    shortened,
    unknown_name,
)
from mesa_swarm.fire import FightFire, FireConstants, design_constants
from mesa_swarm.learning.rewards import CRITICAL, REWARD_STATES, REWARDS, STATE
from mesa_swarm.robots.design import AGENT9, AGENT_FIRE, RobotDesign
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.world.map import Map

LARGEST_REWARD = 1e6
# Fires that neither grow nor can be put out, and heat no robot: they only have to be found.
LASTING = FireConstants(k1=1e-9, k2=1e-12, k3=0.0, k4=0.0, leave=1.0, join=0.0)


@dataclass(frozen=True, kw_only=True)
class Task:
    """Base class of the tasks; see `CollisionAvoidance`, `FindFires` and `ExtinguishFires`.

    Parameters
    ----------
    n_robots : int
        At least 1, at free random poses of their own in every episode.
    map : str, path or Map
    design : RobotDesign
        Of all robots, with at least one proximity sensor.
    encoding : str
        What robots observe: "distance", or "typed": the kinds of things as well, see `ObservationEncoder`.
    actions : "continuous", 4 or 8
        "continuous": two wheel speeds from -1 to 1, shares of the greatest; otherwise the number of one of the first
        4 or 8 actions of the thesis (8.1).
    max_steps : int
        After which an episode is truncated.
    variation : Variation, optional
        What is drawn anew for every episode: maps, numbers of robots, speeds, imperfections.
    """

    n_robots: int = 15
    map: str | os.PathLike | Map = "original"
    design: RobotDesign = AGENT9
    encoding: str = "distance"
    actions: str | int = "continuous"
    max_steps: int = 1000
    variation: Variation | None = None

    def __post_init__(self) -> None:
        check_count("n_robots", self.n_robots, minimum=1)
        check_count("max_steps", self.max_steps, minimum=1)
        checked_choice(self.actions)
        object.__setattr__(self, "map", Map.load(self.map))
        if not isinstance(self.design, RobotDesign):
            raise InvalidValueError(f"design is {shortened(self.design)}; expected a RobotDesign such as AGENT9")
        self.observer()
        if self.variation is not None:
            self._check_variation(self.variation)

    @classmethod
    def of(cls, parameters: Mapping[str, Any]) -> "Task":
        """Return the task with these parameters."""
        known = [field.name for field in fields(cls)]
        for name in parameters:
            if name not in known:
                raise UnknownNameError(unknown_name(f"parameter of {cls.__name__}", name, known))
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
        design = replace(self.design, max_speed=float(self.design.max_speed) * conditions.speed)
        return replace(self, map=conditions.map, n_robots=conditions.n_robots, design=design, variation=None)

    def _check_variation(self, variation: Variation) -> None:
        """Refuse what some episode could not be."""
        if not isinstance(variation, Variation):
            raise InvalidValueError(f"variation is {shortened(variation)}; expected Variation(...)")
        maps: Any = () if callable(variation.maps) else variation.maps
        for chart in maps or (self.chart,):
            self.under(Conditions(map=chart, n_robots=self.most_robots, speed=variation.speed[1]))

    def observer(self) -> ObservationEncoder:
        """Return what turns readings into observations."""
        return ObservationEncoder(self.design, encoding=self.encoding)

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


@dataclass(frozen=True, kw_only=True)
class CollisionAvoidance(Task):
    """Drive forward without collisions.

    A step is worth (m_L + m_R) / (2 max_speed), and `collision_cost` less if the robot overlapped anything in it:
    to push on at a wall is worth 1 - `collision_cost`, to spin on the spot 0. Or it is worth the thesis's reward.

    Parameters
    ----------
    n_robots, map, design, encoding, actions, max_steps, variation
        As for `Task`.
    collision_cost : float
        At least 0; of the reward "speed" only.
    reward : str
        "speed" as above, or "a", "b" or "c": the thesis's, see `learning.reward`.
    critical : float
        Of the thesis's rewards: the reading below which only nearness counts, a share of the range.
    reward_of : str
        Of the thesis's rewards: "state", of the readings before the step, or "next state", of those after it.

    Examples
    --------
    >>> CollisionAvoidance(n_robots=50, actions=8, reward="b").encoding
    'distance'
    """

    collision_cost: float = 2.0
    reward: str = "speed"
    critical: float = CRITICAL
    reward_of: str = STATE

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number("collision_cost", self.collision_cost, minimum=0, maximum=LARGEST_REWARD)
        check_choice("reward", self.reward, ("speed", *REWARDS))
        check_number("critical", self.critical, above=0, maximum=1)
        check_choice("reward_of", self.reward_of, REWARD_STATES)

    @property
    def rewards_state(self) -> bool:
        """Whether the reward is of the readings with which robots acted."""
        return self.reward in REWARDS and self.reward_of == STATE

    def score(self, model: SwarmModel, count: int) -> Score:
        """Return what rewards the first `count` robots of a new world."""
        if self.reward in REWARDS:
            ranges = np.array([float(sensor.range) for sensor in self.design.proximity])
            return ThesisScore(model, kind=self.reward, critical=self.critical, ranges=ranges)
        return DrivingScore(model, collision_cost=self.collision_cost)


@dataclass(frozen=True, kw_only=True)
class FireTask(Task):
    """Base class of tasks with fires: a map with fires, and a small cost of every step."""

    n_robots: int = 10
    map: str | os.PathLike | Map = "openspace_fire"
    design: RobotDesign = AGENT_FIRE
    encoding: str = "typed"
    max_steps: int = 2000
    step_cost: float = 0.01

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number("step_cost", self.step_cost, minimum=0, maximum=LARGEST_REWARD)
        if not self.chart.fires:
            raise InvalidValueError(
                f"map {self.chart.name} has no fires; choose one with fires, such as openspace_fire"
            )


@dataclass(frozen=True, kw_only=True)
class FindFires(FireTask):
    """Find the fires, each of which stays as it is.

    A step costs `step_cost`; a robot's first step at a fire, its body within 10 of the fire's edge, is worth
    `arrival` more, once for every robot and fire. Finished when each fire was found by a robot that is commanded.

    Parameters
    ----------
    n_robots, map, design, encoding, actions, max_steps, variation
        As for `Task`.
    step_cost, arrival : float
        At least 0.

    Examples
    --------
    >>> FindFires().map.name
    'openspace_fire'
    """

    arrival: float = 10.0

    def __post_init__(self) -> None:
        super().__post_init__()
        check_number("arrival", self.arrival, minimum=0, maximum=LARGEST_REWARD)

    def score(self, model: SwarmModel, count: int) -> Score:
        """Return what rewards the first `count` robots of a new world."""
        return FindingScore(model, count, arrival=self.arrival, step_cost=self.step_cost)


@dataclass(frozen=True, kw_only=True)
class ExtinguishFires(FireTask):
    """Put all fires out, the largest of which takes more than one robot.

    A step costs `step_cost` and is worth `work` more to a robot that extinguishes; when a fire goes out, the step is
    worth `put_out` more to each robot that was fighting it. Finished when all fires are out. Robots also
    observe their own heat. Robots that are not commanded use the thesis's strategy B.

    Choose a small `work`: a robot that lets a fire burn on is paid for it again and again.

    Parameters
    ----------
    n_robots, map, design, encoding, actions, max_steps, variation
        As for `Task`.
    step_cost, put_out, work : float
        At least 0.
    fire_constants : FireConstants, optional
        `design_constants()` by default.

    Examples
    --------
    >>> ExtinguishFires().observer().width
    41
    """

    max_steps: int = 5000
    put_out: float = 10.0
    work: float = 0.05
    fire_constants: FireConstants | None = None

    def __post_init__(self) -> None:
        constants = self.constants
        if not isinstance(constants, FireConstants):
            raise InvalidValueError(
                f"fire_constants is {shortened(constants)}; expected a FireConstants, such as from design_constants()"
            )
        object.__setattr__(self, "fire_constants", constants)
        super().__post_init__()
        check_number("put_out", self.put_out, minimum=0, maximum=LARGEST_REWARD)
        check_number("work", self.work, minimum=0, maximum=LARGEST_REWARD)

    @property
    def constants(self) -> FireConstants:
        """How its fires burn."""
        return design_constants() if self.fire_constants is None else self.fire_constants

    def observer(self) -> ObservationEncoder:
        """Return the observer, which includes the robots' heat."""
        return ObservationEncoder(self.design, encoding=self.encoding, body=True, leave=self.constants.leave)

    def others(self) -> tuple[Layer, ...]:
        """Return the layers of strategy B."""
        return Avoid(fires="never"), FightFire(strategy="B"), Explore()

    def score(self, model: SwarmModel, count: int) -> Score:
        """Return what rewards the first `count` robots of a new world."""
        return ExtinguishingScore(model, count, put_out=self.put_out, work=self.work, step_cost=self.step_cost)


TASKS: dict[str, type[Task]] = {
    "collision_avoidance": CollisionAvoidance,
    "find_fires": FindFires,
    "extinguish_fires": ExtinguishFires,
}
