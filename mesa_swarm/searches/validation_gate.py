"""Training that is repeated with other seeds until its outcome passes on validation maps."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, check_number, shortened
from mesa_swarm.control import Subsumption
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.environments.task import Task
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.environments.tasks import CollisionAvoidance
from mesa_swarm.experiments.controllers import Controller, control_of, played
from mesa_swarm.experiments.worker_pool import checked_jobs, in_order
from mesa_swarm.learning.fire_learning import SkillPolicy
from mesa_swarm.learning.fire_wheels import FireWheelPolicy
from mesa_swarm.learning.policy import Policy
from mesa_swarm.maps.random_map import random_map
from mesa_swarm.searches.evolved_controllers import Maps, checked_maps

# Generated maps that are used for validation only, and the seed of the worlds on them.
VALIDATION, WORLDS = range(30_000, 30_010), 3_000_000
LARGEST = 1e9
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True, slots=True)
class Criteria:
    """What measures of a task have to reach; a measure that is NaN does not.

    Parameters
    ----------
    most, least : mapping of measure and number
    of_rule : mapping of measure and share
        At least this share, 0 to 10, of what the task's rule reaches in the same worlds.

    Examples
    --------
    >>> Criteria(most={"collisions": 0.5}, of_rule={"coverage": 0.9}).met(
    ...     {"collisions": 0.2, "coverage": 0.7}, {"coverage": 0.8}
    ... )
    (True, False)
    """

    most: Mapping[str, float] = field(default_factory=dict)
    least: Mapping[str, float] = field(default_factory=dict)
    of_rule: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the parameters."""
        for name, lowest, highest in (("most", -LARGEST, LARGEST), ("least", -LARGEST, LARGEST), ("of_rule", 0, 10)):
            limits = getattr(self, name)
            if not isinstance(limits, Mapping):
                raise InvalidValueError(f"{name} is {shortened(limits)}; expected a dict such as {{'collisions': 0.5}}")
            for measure, value in limits.items():
                check_number(f"{name}[{measure!r}]", value, minimum=lowest, maximum=highest)
        if not self.measures:
            raise InvalidValueError("there are no criteria; expected at least one of most, least and of_rule")

    @property
    def measures(self) -> tuple[str, ...]:
        """The measures, in the order of `met`."""
        return (*self.most, *self.least, *self.of_rule)

    def met(self, found: Mapping[str, float], rule: Mapping[str, float]) -> tuple[bool, ...]:
        """Return which criteria are met by measures, given those of the rule."""
        return (
            *(found[name] <= limit for name, limit in self.most.items()),
            *(found[name] >= limit for name, limit in self.least.items()),
            *(found[name] >= share * rule[name] for name, share in self.of_rule.items()),
        )

    def better(self, found: Mapping[str, float]) -> tuple[float, ...]:
        """Return numbers that are the smaller, the better measures are; infinity for NaN."""
        numbers = (*(found[name] for name in self.most), *(-found[name] for name in (*self.least, *self.of_rule)))
        return tuple(math.inf if math.isnan(number) else number for number in numbers)


# Required of controllers that avoid: few collisions, most of the greatest speed, and the coverage of the rule.
AVOIDING = Criteria(most={"collisions": 0.5}, least={"speed ahead": 0.6}, of_rule={"coverage": 1.0})


@dataclass(frozen=True, kw_only=True, slots=True)
class Validation:
    """Means over validation maps of the measures with criteria, those of the rule, and which criteria are met."""

    measures: dict[str, float]
    rule: dict[str, float]
    met: tuple[bool, ...]
    robot_steps: int

    @property
    def passed(self) -> bool:
        """Whether all criteria are met."""
        return all(self.met)


@dataclass(frozen=True, kw_only=True, eq=False)
class ValidationGate:
    """The criteria that a controller has to meet on validation maps, on which nothing is trained or chosen otherwise.

    By default those of the benchmark of learning in avoidance.

    Parameters
    ----------
    task : Task
        What robots do, without a variation; its map is replaced. Its `others` are the rule.
    maps : sequence of map, name or path, or a single one
        Ten generated ones by default, `VALIDATION`.
    criteria : Criteria
        Of measures of `TaskWorld.measures`.
    rng : int
        Seed of the worlds.

    Raises
    ------
    SwarmError

    Examples
    --------
    >>> from mesa_swarm.control import Subsumption, Explore
    >>> task = CollisionAvoidance(n_robots=3, max_steps=50)
    >>> gate = ValidationGate(task=task, maps="openspace", criteria=Criteria(least={"speed ahead": 0.6}))
    >>> gate.validate(Subsumption(Explore())).measures
    {'speed ahead': 1.0}
    """

    task: Task = field(default_factory=lambda: CollisionAvoidance(encoding="typed", max_steps=5000))
    maps: Maps = field(default_factory=lambda: [random_map(number) for number in VALIDATION])
    criteria: Criteria = AVOIDING
    rng: int = WORLDS

    def __post_init__(self) -> None:
        """Check the parameters."""
        if not isinstance(self.task, Task) or not isinstance(self.criteria, Criteria):
            raise InvalidValueError(
                f"task is {shortened(self.task)}, criteria {shortened(self.criteria)}; expected a task of environments "
                "and Criteria(...)"
            )
        if self.task.variation is not None:
            raise InvalidValueError("the task has a variation; validation has fixed maps and robots: leave it out")
        object.__setattr__(self, "maps", tuple(checked_maps("maps", self.maps)))
        object.__setattr__(self, "rng", check_count("rng", self.rng, maximum=2**63 - 1))
        known = TaskWorld(task=self._tasks[0], rng=self.rng).measures()
        for name in self.criteria.measures:
            check_choice("measure", name, known)

    @cached_property
    def _tasks(self) -> list[Task]:
        return [replace(self.task, map=world) for world in checked_maps("maps", self.maps)]

    @cached_property
    def _rule(self) -> dict[str, float]:
        return self._means(Subsumption(*self.task.others()), 1)[0]

    def _means(self, control: Arbiter | Controller, jobs: int) -> tuple[dict[str, float], int]:
        """Return means over the maps, and the robot-steps of all drives."""
        rows = in_order(jobs, played, [(control, task, self.rng) for task in self._tasks])
        means = {name: float(np.mean([row[name] for row in rows])) for name in self.criteria.measures}
        return means, round(sum(row["steps"] for row in rows)) * self.task.n_robots

    def validate(self, control: Arbiter | Controller, *, jobs: int = 1) -> Validation:
        """Return the measures of a controller on all maps, and which criteria they meet.

        The result does not depend on `jobs`, the number of processes, -1 for one on each core.

        Raises
        ------
        InvalidValueError
            If `control` is neither an arbiter nor a `Controller`.
        """
        if not isinstance(control, Arbiter | Controller):
            raise InvalidValueError(
                f"control is {shortened(control)}; expected a control such as Subsumption(PolicyLayer(policy=policy)), "
                "or a Controller"
            )
        means, robot_steps = self._means(control, checked_jobs(jobs))
        met = self.criteria.met(means, self._rule)
        return Validation(measures=means, rule=self._rule, met=met, robot_steps=robot_steps)

    def rank(self, found: Validation) -> tuple[float, ...]:
        """Return numbers by which validations are ordered, the best first: by criteria that are met, by measures."""
        return -sum(found.met), *self.criteria.better(found.measures)


@dataclass(frozen=True, kw_only=True, slots=True)
class Gated(Generic[T]):
    """The outcome of a gated training: all results in the order of their training, and the one that was chosen.

    `seeds` and `validations` belong to `results`. A single training missed where its validation did not pass, so that
    the share of those is a result too, to be reported beside means of the chosen ones.
    """

    results: tuple[T, ...]
    seeds: tuple[int, ...]
    validations: tuple[Validation, ...]
    chosen: int

    @property
    def result(self) -> T:
        """The result that passed; where none did, the one that the gate ranks first."""
        return self.results[self.chosen]

    @property
    def passed(self) -> bool:
        """Whether the chosen result passed."""
        return self.validations[self.chosen].passed

    @property
    def trainings(self) -> int:
        """The number of trainings."""
        return len(self.results)


def driven_by(result: Policy | SkillPolicy | FireWheelPolicy | Arbiter | Controller) -> Arbiter | Controller:
    """Return a control of a policy, see `control_of`; a control or controller is returned as it is."""
    return result if isinstance(result, Arbiter | Controller) else control_of(result)


def gated(
    train: Callable[[int], T],
    gate: ValidationGate | None = None,
    *,
    control: Callable[[Any], Any] = driven_by,
    rng: int = 1,
    most: int = 5,
    jobs: int = 1,
) -> Gated[T]:
    """Train with one seed after the other until the outcome passes on validation maps.

    The first training has the seed `rng`, so that it is the training without a gate; those that follow have seeds
    derived from it. Learning is a random process: a few trainings in a hundred end with robots that get stuck in some
    corner, or drive backwards. Validation finds these before the controller is used; its maps must not be those of a
    test.

    Parameters
    ----------
    train : callable
        Given a seed, returns what was learned: by default a policy of any learner, or a control.
    gate : ValidationGate, optional
        Maps and criteria; by default those of avoidance.
    control : callable, optional
        Given what `train` returns, returns the control that drives frozen.
    rng : int
        The first seed, at least 0.
    most : int
        Trainings at most, 1 to 1,000.
    jobs : int
        Processes of validation, -1 for one on each core; the result does not depend on it.

    Returns
    -------
    Gated
        Also if none passed.

    Raises
    ------
    SwarmError
        Before the first training, if a parameter is wrong; and what `train` raises.

    Examples
    --------
    >>> from mesa_swarm.control import Explore
    >>> task = CollisionAvoidance(n_robots=3, max_steps=20)
    >>> gate = ValidationGate(task=task, maps="openspace", criteria=Criteria(least={"speed ahead": 0.6}))
    >>> gated(lambda seed: Subsumption(Explore()), gate, rng=7).seeds
    (7,)
    """
    gate = ValidationGate() if gate is None else gate
    for name, value in (("train", train), ("control", control)):
        if not callable(value):
            raise InvalidValueError(f"{name} is {shortened(value)}; expected a function of one argument")
    if not isinstance(gate, ValidationGate):
        raise InvalidValueError(f"gate is {shortened(gate)}; expected ValidationGate(...)")
    first, most = check_count("rng", rng, maximum=2**63 - 1), check_count("most", most, minimum=1, maximum=1000)
    workers = checked_jobs(jobs)
    results: list[T] = []
    validations: list[Validation] = []
    seeds = [first, *np.random.SeedSequence(first).generate_state(most - 1, np.uint32).tolist()]
    for seed in seeds:
        results.append(train(seed))
        validations.append(gate.validate(control(results[-1]), jobs=workers))
        if validations[-1].passed:
            break
    chosen = min(range(len(results)), key=lambda k: gate.rank(validations[k]))
    return Gated(
        results=tuple(results), seeds=tuple(seeds[: len(results)]), validations=tuple(validations), chosen=chosen
    )
