"""Temperature and discount of the Q-learner, tuned off-line to a goal by CMA-ES (thesis 8.4, 10.3)."""

import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from typing import Any

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_count, check_number, shortened
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.control import Subsumption
from mesa_swarm.experiments.fingerprints import engine_hash, fingerprint, shown_value
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.experiments.run_tables import RunFiles, TableHead
from mesa_swarm.experiments.runs import Run, done_in_order, has_numbers
from mesa_swarm.experiments.sampling import check_different
from mesa_swarm.experiments.statistics import Interval, mean_interval
from mesa_swarm.experiments.worker_pool import checked_jobs
from mesa_swarm.learning.evolution import Evolution
from mesa_swarm.learning.q_learning import QLearning
from mesa_swarm.maps.map import Map
from mesa_swarm.model.gallery import find_model

# What is tuned, within which limits, and the thesis's values (8.3), around which the search begins. All but gamma are
# searched as logarithms; gamma as the logarithm of the steps that it looks ahead, 1 / (1 - gamma).
LIMITS = {
    "first_temperature": (0.02, 5.0),
    "last_temperature": (0.02, 2.0),
    "beta": (1e-5, 0.5),
    "gamma": (0.0, 0.95),
}
THESIS = {"first_temperature": 1.0, "last_temperature": 0.2, "beta": 1e-4, "gamma": 0.7}
# Collisions that count as much as a shortfall of the whole speed, for a robot in 1,000 steps.
SHORTFALL = 1000.0
# The mean forward speed of robots with the thesis's settings in their first 1,000 steps.
LEAST_SPEED = 0.28
# The first seed of tuning, far from those that judge.
FIRST_SEED = 10_000
# Standard deviation of the first candidates, as a share of each interval.
SIGMA = 0.2
MEASURES = ("collisions", "speed")
# Runs depend on this file, on the engine and on the model; after a change they are repeated.
SOURCE = "searches/tuning.py"
IS_MEASURED = partial(has_numbers, names=MEASURES)


@dataclass(frozen=True, kw_only=True, slots=True)
class LearningGoal:
    """The goal that robots collide as rarely as possible in their first steps, while they drive at some speed.

    The cost is the number of collisions a robot and 1,000 steps, and 1000 times what the mean forward speed, a share
    of the full one, lacks of `least_speed`: a robot that stands still does not reach the goal.

    Parameters
    ----------
    steps : int
        At least 1.
    least_speed : float
        Share of the full speed, -1 to 1; by default that of robots with the thesis's settings.
    robots : int
        At least 1.
    map : str

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> LearningGoal(least_speed=0.5).cost(collisions=20.0, speed=0.4)
    120.0
    """

    steps: int = 1_000
    least_speed: float = LEAST_SPEED
    robots: int = 15
    map: str = "original"

    def __post_init__(self) -> None:
        check_count("steps", self.steps, minimum=1)
        check_number("least_speed", self.least_speed, minimum=-1, maximum=1)
        check_count("robots", self.robots, minimum=1)
        if not isinstance(self.map, str):
            raise InvalidValueError(f"map is {shortened(self.map)}; expected the name of a map")

    def cost(self, *, collisions: float, speed: float) -> float:
        """Return what is to be minimised: collisions a robot and 1,000 steps, and what the speed lacks.

        Both are finite, or an InvalidValueError is raised.
        """
        collisions, speed = check_number("collisions", collisions), check_number("speed", speed)
        return round(collisions + SHORTFALL * max(0.0, self.least_speed - speed), 12)

    def head(self) -> TableHead:
        """Return what the first lines of a table of runs state."""
        return TableHead(__name__, "tuning", Map.load(self.map).bounds)

    def runs(self, candidates: Iterable[dict[str, float]], seeds: Sequence[int]) -> list[Run]:
        """Return a run of each candidate, settings of `QLearning`, with each seed."""
        world: dict[str, Any] = {"steps": self.steps, "robots": self.robots, "map": self.map}
        source = engine_hash(SOURCE, models=True), version("mesa-swarm")
        decisive = *source, {**world, "map": shown_value(Map.load(self.map))}
        make = partial(goal_run, **world)
        return [
            Run(make, settings, seed, self.steps, fingerprint(*decisive, settings, seed))
            for settings in candidates
            for seed in seeds
        ]


def goal_run(rng: int, *, steps: int, robots: int, map: str, **settings: Any) -> dict[str, float]:
    """Let robots learn from the first step on with these settings of `QLearning`; return collisions and speed.

    Collisions are those a robot and 1,000 steps; the speed is the mean forward speed that robots command, a share of
    the full one.

    Examples
    --------
    >>> sorted(goal_run(1, steps=20, robots=2, map="original", gamma=0.5))
    ['collisions', 'speed']
    """
    model = find_model("q_learning")(n_robots=robots, map=map, rng=rng)
    model.control = Subsumption(QLearning(**settings))
    model.run(steps)
    collisions = 1000.0 * model.total_collisions / (robots * steps)
    return dict(
        zip(MEASURES, (collisions, float(np.mean(model.datacollector.model_vars["forward_speed"]))), strict=True)
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class Tuned:
    """The result of tuning.

    Parameters
    ----------
    settings : dict
        Settings of `QLearning`: of the candidate that cost least.
    goal : LearningGoal
    costs : tuple
        The cost of the means of each candidate, generation after generation.
    """

    settings: dict[str, float]
    goal: LearningGoal
    costs: tuple[tuple[float, ...], ...]


def tune(
    goal: LearningGoal | None = None,
    *,
    generations: int = 24,
    population: int = 8,
    seeds: Iterable[int] = range(FIRST_SEED, FIRST_SEED + 6),
    rng: int = 1,
    jobs: int = 1,
    progress: bool = False,
    out: str | os.PathLike[str] | None = None,
    tables: Sequence[str] = (),
) -> Tuned:
    """Tune T_0, T_c, beta and gamma of `QLearning` to a goal, off-line: by CMA-ES around the thesis's values.

    All candidates learn in the same worlds, those of the given seeds; the one that costs least is returned, whose cost
    there is therefore too low an estimate: judge it with other seeds. The result does not depend on `jobs`.

    Parameters
    ----------
    goal : LearningGoal, optional
    generations : int
        At least 1.
    population : int
        Candidates a generation, at least 4.
    seeds : iterable of int
        Runs of each candidate.
    rng : int
        Seed of the search.
    jobs : int
        Processes, -1 for one on each core.
    progress : bool
        Whether to show a bar.
    out : path, optional
        Folder in which each run is stored as soon as it is done: a search that was interrupted, or killed, continues
        when it is called again with the same arguments.
    tables : sequence of str
        Forms of tables with a row for each run of each candidate, see `sweep`; they need `out`.

    Returns
    -------
    Tuned

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> goal = LearningGoal(steps=10, robots=2)
    >>> sorted(tune(goal, generations=1, population=4, seeds=[1]).settings)
    ['beta', 'first_temperature', 'gamma', 'last_temperature']
    """
    goal = LearningGoal() if goal is None else goal
    if not isinstance(goal, LearningGoal):
        raise InvalidValueError(f"goal is {shortened(goal)}; expected LearningGoal(...)")
    listed, workers, files = _checked_seeds(seeds), checked_jobs(jobs), RunFiles.checked(out, tables=tables)
    count = check_count("generations", generations, minimum=1, maximum=1_000_000)
    search = Evolution(_placed(THESIS), sigma=SIGMA, population=population, seed=check_count("rng", rng))
    done: list[tuple[Run, Outcome]] = []
    with progress_bar(count, "generations", progress) as bar, files.ledger(fits=IS_MEASURED) as ledger:
        for _ in range(count):
            runs = goal.runs(map(settings_at, search.ask()), listed)
            done += done_in_order(runs, ledger=ledger, workers=workers)
            means = _measures(done[-len(runs) :]).reshape(search.population, len(listed), 2).mean(axis=1)
            search.tell([-goal.cost(collisions=collisions, speed=speed) for collisions, speed in means.tolist()])
            bar.update()
    files.write(goal.head(), lambda: done)
    costs_of_all = tuple(tuple(-fitness for fitness in generation) for generation in search.history)
    best = int(np.argmin(costs_of_all)) * len(listed)
    return Tuned(settings=dict(done[best][0].settings), goal=goal, costs=costs_of_all)


def _measures(done: Sequence[tuple[Run, Outcome]]) -> np.ndarray:
    """Return collisions and speed of each run (runs, 2)."""
    return np.array([[outcome.numbers[name] for name in MEASURES] for _, outcome in done])


@dataclass(frozen=True, kw_only=True, slots=True)
class TuningComparison:
    """Tuned settings beside the thesis's: a table of means with intervals, and remarks on what was not reached.

    Parameters
    ----------
    table : list of list of str
        Collisions and speed with the thesis's settings, with the tuned ones, and their differences.
    remarks : tuple of str
        Whether the goal's speed was missed, and whether collisions do not become fewer.
    """

    table: list[list[str]]
    remarks: tuple[str, ...]


def comparison(
    tuned: Tuned,
    *,
    seeds: Iterable[int],
    jobs: int = 1,
    out: str | os.PathLike[str] | None = None,
    tables: Sequence[str] = (),
) -> TuningComparison:
    """Compare collisions and speed with the thesis's values and the tuned ones, with at least two seeds.

    Differences are paired by seed; intervals are 95 %, Student's t. `out` and `tables` are as for `tune`.

    Examples
    --------
    >>> tuned = Tuned(settings=THESIS, goal=LearningGoal(steps=20, robots=2), costs=())
    >>> [row[0] for row in comparison(tuned, seeds=[1, 2]).table]
    ['', 'thesis', 'tuned', 'difference']
    """
    goal, listed, workers = tuned.goal, _checked_seeds(seeds), checked_jobs(jobs)
    check_count("number of seeds", len(listed), minimum=2)
    files, runs = RunFiles.checked(out, tables=tables), goal.runs((THESIS, tuned.settings), listed)
    with files.ledger(fits=IS_MEASURED) as ledger:
        done = done_in_order(runs, ledger=ledger, workers=workers)
    files.write(goal.head(), lambda: done)
    numbers = _measures(done).reshape(2, len(listed), 2)
    rows = zip(("thesis", "tuned", "difference"), (*numbers, numbers[1] - numbers[0]), strict=True)
    cells = [[name, *(_shown(mean_interval(values)) for values in measured.T)] for name, measured in rows]
    return TuningComparison(
        table=[["", "collisions a robot and 1,000 steps", "forward speed"], *cells], remarks=_remarks(goal, numbers)
    )


def _remarks(goal: LearningGoal, numbers: np.ndarray) -> tuple[str, ...]:
    """Return what the runs (2, seeds, 2) of the thesis's settings and of the tuned ones do not reach."""
    remarks = []
    speed, fewer = float(numbers[1, :, 1].mean()), mean_interval(numbers[1, :, 0] - numbers[0, :, 0])
    if speed < goal.least_speed:
        remarks.append(f"the goal's speed was missed: {speed:.4g} instead of {goal.least_speed:.4g}")
    if fewer.low > 0:
        remarks.append("more collisions than with the thesis's settings")
    elif fewer.high >= 0:
        remarks.append("no difference shown: the interval of the difference in collisions includes 0")
    return tuple(remarks)


def _shown(interval: Interval) -> str:
    return f"{interval.estimate:.3g} [{interval.low:.3g}, {interval.high:.3g}]"


def _checked_seeds(seeds: Iterable[int]) -> list[int]:
    """Return seeds as a list of one or more."""
    try:
        listed = list(seeds)
    except TypeError:
        raise InvalidValueError(f"seeds is {shortened(seeds)}; expected whole numbers, such as range(1, 9)") from None
    if not listed:
        raise InvalidValueError("seeds is empty; give at least one whole number")
    return check_different("seeds", (check_count("seeds", seed, maximum=2**63 - 1) for seed in listed), "ones")


def settings_at(place: np.ndarray) -> dict[str, float]:
    """Return the settings at a place of the search: numbers from 0 to 1 within the limits; beyond, as in a mirror."""
    inside = 1.0 - np.abs(1.0 - np.asarray(place, float) % 2.0)
    found = {}
    for name, share in zip(LIMITS, inside, strict=True):
        low, high = (_scaled(name, limit) for limit in LIMITS[name])
        scaled = low + float(share) * (high - low)
        found[name] = 1.0 - math.exp(-scaled) if name == "gamma" else math.exp(scaled)
    return found


def _placed(settings: dict[str, float]) -> list[float]:
    """Return the place of settings in the search."""
    place = []
    for name, limits in LIMITS.items():
        low, high = (_scaled(name, limit) for limit in limits)
        place.append((_scaled(name, settings[name]) - low) / (high - low))
    return place


def _scaled(name: str, value: float) -> float:
    """Return a setting as it is searched."""
    return -math.log1p(-value) if name == "gamma" else math.log(value)
