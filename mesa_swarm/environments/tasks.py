"""The tasks: world, robots, rewards, and when an episode ends."""

import os
from collections.abc import Sequence
from dataclasses import dataclass

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_number, shortened
from mesa_swarm.control import Avoid, Explore, Layer
from mesa_swarm.environments.aggregation import Aggregation
from mesa_swarm.environments.foraging import Foraging
from mesa_swarm.environments.scores import (
    LARGEST_REWARD,
    DrivingScore,
    ExtinguishingScore,
    FindingScore,
    ObservationEncoder,
    Score,
    ThesisScore,
)
from mesa_swarm.environments.task import LASTING, Task
from mesa_swarm.fire import FightFire, FireConstants, design_constants
from mesa_swarm.learning.rewards import CRITICAL, REWARD_STATES, REWARDS, STATE
from mesa_swarm.maps.map import Map
from mesa_swarm.robots.design import AGENT_FIRE, RobotDesign
from mesa_swarm.swarm_model import SwarmModel

__all__ = ["LASTING", "TASKS", "Aggregation", "CollisionAvoidance", "ExtinguishFires", "FindFires", "Foraging", "Task"]


@dataclass(frozen=True, kw_only=True)
class CollisionAvoidance(Task):
    """Drive forward without collisions.

    A step is worth (m_L + m_R) / (2 max_speed), and `collision_cost` less if the robot overlapped anything in it:
    to push on at a wall is worth 1 - `collision_cost`, to spin on the spot 0. Or it is worth the thesis's reward.

    Parameters
    ----------
    n_robots, map, design, encoding, actions, max_steps, variation, team, coverage_reward, messages, message_range
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
            return ThesisScore(model, kind=self.reward, critical=self.critical)
        return DrivingScore(model, collision_cost=self.collision_cost)


@dataclass(frozen=True, kw_only=True)
class FireTask(Task):
    """Base class of tasks with fires: a map with fires, and a small cost of every step."""

    n_robots: int = 10
    map: str | os.PathLike | Map = "openspace_fire"
    design: RobotDesign | Sequence[RobotDesign] = AGENT_FIRE
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
    n_robots, map, design, encoding, actions, max_steps, variation, team, coverage_reward, messages, message_range
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
    n_robots, map, design, encoding, actions, max_steps, variation, team, coverage_reward, messages, message_range
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

    def encoder(self, design: RobotDesign) -> ObservationEncoder:
        """Return the encoder, which includes the robots' heat."""
        leave = self.constants.leave
        return ObservationEncoder(design, encoding=self.encoding, body=True, leave=leave, **self._heard())

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
    "foraging": Foraging,
    "aggregation": Aggregation,
}
