"""Training that is repeated with other seeds until its outcome passes on validation maps."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np

from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.errors import InvalidValueError, check_count, check_number, shortened
from mesa_swarm.experiments.driving import MEASURES, drive_measured, driven_world
from mesa_swarm.experiments.evolution import Maps, checked_maps
from mesa_swarm.experiments.pool import checked_jobs, in_order
from mesa_swarm.learning.policy import Policy, PolicyLayer
from mesa_swarm.robots.design import AGENT9, RobotDesign
from mesa_swarm.world.map import Map
from mesa_swarm.world.random_map import random_map

# Generated maps that are used for validation only, and the seed of the worlds on them.
VALIDATION, WORLDS = range(30_000, 30_010), 2_000_000
T = TypeVar("T")


@dataclass(frozen=True, kw_only=True, slots=True)
class Validation:
    """Means over validation maps: collisions per robot and 1,000 steps, speed ahead, coverage, and that of the rule.

    `passed` is whether these meet the criteria of the gate.
    """

    collisions: float
    ahead: float
    coverage: float
    rule_coverage: float
    passed: bool


class Passing(Protocol):
    """The outcome of a validation."""

    @property
    def passed(self) -> bool:
        """Whether it meets the criteria."""


V = TypeVar("V", bound=Passing)


@runtime_checkable
class TrainingGate(Protocol[V]):
    """Criteria that what was trained has to meet before it is used, such as a `ValidationGate`."""

    def validate(self, control: Any, *, jobs: int = 1) -> V:
        """Return what was measured, and whether that passes."""

    def rank(self, found: V) -> tuple[float, ...]:
        """Return numbers by which validations are ordered, the best first."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ValidationGate:
    """The criteria that a controller has to meet on validation maps, on which nothing is trained or chosen otherwise.

    The default criteria are those of the benchmark of learning.

    Parameters
    ----------
    maps : sequence of map, name or path, or a single one
        Ten generated ones by default, `VALIDATION`.
    design : RobotDesign
    robots, steps : int
        Of each drive, at least 1.
    most_collisions : float
        Per robot and 1,000 steps, at least 0; mean over maps, as are the others.
    least_ahead : float
        Forward speed, a share of max_speed, -1 to 1: robots that drive backwards do not pass.
    least_coverage : float
        A share, 0 to 10, of the coverage of `Avoid` and `Explore` in the same worlds.
    rng : int
        Seed of the worlds.

    Raises
    ------
    SwarmError

    Examples
    --------
    >>> from mesa_swarm.control import Subsumption, Explore
    >>> gate = ValidationGate(maps="openspace", robots=3, steps=50)
    >>> round(gate.validate(Subsumption(Explore())).ahead, 1)
    1.0
    """

    maps: Maps = field(default_factory=lambda: [random_map(number) for number in VALIDATION])
    design: RobotDesign = AGENT9
    robots: int = 15
    steps: int = 5000
    most_collisions: float = 0.5
    least_ahead: float = 0.6
    least_coverage: float = 1.0
    rng: int = WORLDS

    def __post_init__(self) -> None:
        """Check the parameters."""
        object.__setattr__(self, "maps", tuple(checked_maps("maps", self.maps)))
        if not isinstance(self.design, RobotDesign):
            raise InvalidValueError(f"design is {shortened(self.design)}; expected RobotDesign(...)")
        for name in ("robots", "steps"):
            object.__setattr__(self, name, check_count(name, getattr(self, name), minimum=1))
        check_number("most_collisions", self.most_collisions, minimum=0, maximum=1000)
        check_number("least_ahead", self.least_ahead, minimum=-1, maximum=1)
        check_number("least_coverage", self.least_coverage, minimum=0, maximum=10)
        object.__setattr__(self, "rng", check_count("rng", self.rng, maximum=2**63 - 1))

    @property
    def robot_steps(self) -> int:
        """The robot-steps of one validation."""
        return len(self._worlds) * self.robots * self.steps

    @property
    def _worlds(self) -> list[Map]:
        return checked_maps("maps", self.maps)

    @cached_property
    def _rule_coverage(self) -> float:
        return float(self._means(Subsumption(Avoid(), Explore()), 1)["coverage"])

    def _means(self, control: Arbiter, jobs: int) -> dict[str, float]:
        tasks = [(control, self.design, self.robots, world, self.rng, self.steps) for world in self._worlds]
        rows = in_order(jobs, _driven, tasks)
        return {measure: float(np.mean([row[measure] for row in rows])) for measure in MEASURES}

    def validate(self, control: Arbiter, *, jobs: int = 1) -> Validation:
        """Return the measures of a controller on all maps, and whether they meet the criteria.

        The result does not depend on `jobs`, the number of processes, -1 for one on each core.
        """
        means = self._means(control, checked_jobs(jobs))
        collisions, _, ahead, coverage = (means[measure] for measure in MEASURES)
        return Validation(
            collisions=collisions,
            ahead=ahead,
            coverage=coverage,
            rule_coverage=self._rule_coverage,
            passed=self._is_few(collisions) and self._is_fast(ahead) and self._is_wide(coverage),
        )

    def rank(self, found: Validation) -> tuple[float, ...]:
        """Return numbers by which validations are ordered, the best first: by criteria that are met, by collisions."""
        met = self._is_few(found.collisions) + self._is_fast(found.ahead) + self._is_wide(found.coverage)
        return -met, found.collisions

    def _is_few(self, collisions: float) -> bool:
        return collisions <= self.most_collisions

    def _is_fast(self, ahead: float) -> bool:
        return ahead >= self.least_ahead

    def _is_wide(self, coverage: float) -> bool:
        return coverage >= self.least_coverage * self._rule_coverage


def _driven(control: Arbiter, design: RobotDesign, robots: int, world: Map, rng: int, steps: int) -> dict[str, float]:
    return drive_measured(driven_world(control, design, robots, world, rng), steps)


@dataclass(frozen=True, kw_only=True, slots=True)
class Gated(Generic[T, V]):
    """The outcome of a gated training: all results in the order of their training, and the one that was chosen.

    `seeds` and `validations` belong to `results`. A single training missed where its validation did not pass, so that
    the share of those is a result too, to be reported beside means of the chosen ones.
    """

    results: tuple[T, ...]
    seeds: tuple[int, ...]
    validations: tuple[V, ...]
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


def driven_by(result: Policy | Arbiter) -> Arbiter:
    """Return a control of a policy alone; a control is returned as it is."""
    return result if isinstance(result, Arbiter) else Subsumption(PolicyLayer(policy=result))


def gated(
    train: Callable[[int], T],
    gate: TrainingGate | None = None,
    *,
    control: Callable[[Any], Any] = driven_by,
    rng: int = 1,
    most: int = 5,
    jobs: int = 1,
) -> Gated[T, Any]:
    """Train with one seed after the other until the outcome passes on validation maps.

    The first training has the seed `rng`, so that it is the training without a gate; those that follow have seeds
    derived from it. Learning is a random process: a few trainings in a hundred end with robots that get stuck in some
    corner, or drive backwards. Validation finds these before the controller is used; its maps must not be those of a
    test.

    Parameters
    ----------
    train : callable
        Given a seed, returns what was learned: by default a policy, or a control.
    gate : TrainingGate, optional
        Maps and criteria, a `ValidationGate` by default.
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
    >>> gate = ValidationGate(maps="openspace", robots=3, steps=20, least_coverage=0, most_collisions=1000)
    >>> gated(lambda seed: Subsumption(Explore()), gate, rng=7).seeds
    (7,)
    """
    gate = ValidationGate() if gate is None else gate
    if isinstance(gate, type) or not isinstance(gate, TrainingGate) or not callable(train):
        raise InvalidValueError(
            f"train is {shortened(train)} and gate {shortened(gate)}; expected a function and ValidationGate"
        )
    first, most = check_count("rng", rng, maximum=2**63 - 1), check_count("most", most, minimum=1, maximum=1000)
    workers = checked_jobs(jobs)
    results: list[T] = []
    validations: list[Any] = []
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
