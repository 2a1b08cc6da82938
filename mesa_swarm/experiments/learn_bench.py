"""The benchmark of learning: trained at home, measured there, on other maps, and on maps that nobody was trained on."""

import json
import math
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import blake2b
from importlib.metadata import version
from pathlib import Path

import numpy as np

from mesa_swarm.errors import check_choice, check_count
from mesa_swarm.experiments.compare import checked_jobs
from mesa_swarm.experiments.contestants import DESIGN, HOME, PARTS, ROBOTS, Trained, contestants
from mesa_swarm.experiments.driving import MEASURES, drive_measured, driven_world
from mesa_swarm.experiments.experiment import Outcome
from mesa_swarm.experiments.ledger import Ledger
from mesa_swarm.experiments.pool import results_of
from mesa_swarm.files import check_writable
from mesa_swarm.progress import progress_bar
from mesa_swarm.world.map import Map, builtin_maps
from mesa_swarm.world.random_map import random_map

LEDGER = "ledger.jsonl"
PACKAGE = Path(__file__).resolve().parent.parent
# What a result depends on: whoever changes this code does the runs again.
FOLDERS = "geometry", "world", "robots", "physics", "control", "fire", "learning", "analysis"
ENGINE = (*FOLDERS, "streams.py", "world_model.py", "observed_world.py", "model.py")
SOURCES = (*ENGINE, "experiments/contestants.py", "experiments/driving.py", "experiments/evolution.py")
# Generated maps on which nobody was trained, bred or chosen: on GENERATED all are compared, and UNSEEN, at which nobody
# looked before everything else stood, say whether the target is reached.
GENERATED, UNSEEN = range(1, 21), range(40_001, 40_021)
EVERY = "every unseen map"
# Who is measured on every unseen map with every seed: the bred ones, and the rule whose coverage is their mark.
RULE, BRED = "Avoid + Explore", ("evolved reflex", "evolved network")
MODES = ("frozen", "learning")
OF_TRAINING = ("train wall seconds", "train processor seconds", "robot-steps")
# Worlds of the evaluation have other seeds than those of training.
APART = 1_000_000


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """What is to be measured.

    Parameters
    ----------
    seeds : int
        Each contestant is trained with the seeds 1, 2, ...
    steps : int
        Of training, of 15 robots on `original`.
    evaluation_steps : int
        On each map.
    only : sequence of str
        Names of contestants; all by default.

    Raises
    ------
    InvalidValueError, UnknownNameError

    Examples
    --------
    >>> bench = Benchmark(seeds=10)
    >>> len(bench.tasks()), bench.maps(1), bench.maps(10)[-1]
    (100, ('original', 'sparse', 'openspace', 'openspace_fire', 'random 1', 'random 2'), 'random 20')
    """

    seeds: int = 10
    steps: int = 33_000
    evaluation_steps: int = 5000
    only: Sequence[str] = ()

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_count("seeds", self.seeds, minimum=1, maximum=1000)
        check_count("steps", self.steps, minimum=1, maximum=10_000_000)
        check_count("evaluation_steps", self.evaluation_steps, minimum=1, maximum=1_000_000)
        for name in self.only:
            check_choice("contestant", name, contestants())

    @property
    def names(self) -> list[str]:
        """Who takes part, in the order of the table."""
        return [name for name in contestants() if not self.only or name in self.only]

    def maps(self, seed: int) -> tuple[str, ...]:
        """Return the maps on which what was trained with a seed is measured.

        The built-in ones, and two of the 20 generated ones: ten seeds see all of them.
        """
        first = 2 * (seed - 1)
        mine = (GENERATED[k % len(GENERATED)] for k in (first, first + 1))
        return (*builtin_maps(), *(f"random {number}" for number in mine))

    def tasks(self) -> list[tuple[str, int]]:
        """Return the trainings: contestant and seed. Seed by seed, so that an interrupted benchmark is a fair one."""
        return [(name, seed) for seed in range(1, self.seeds + 1) for name in self.names]

    def key(self, name: str, seed: int) -> str:
        """Return the fingerprint of all that decides what comes of a training and its evaluation."""
        said = [name, seed, self.steps, self.evaluation_steps, version("mesa-swarm"), _sources()]
        return blake2b(json.dumps(said).encode(), digest_size=16).hexdigest()


@dataclass(frozen=True, slots=True)
class Run:
    """What came of a training with a seed: results by ``map|mode|measure``, and of the training."""

    name: str
    seed: int
    results: Mapping[str, float | None]

    def rows(self) -> Iterator[tuple[str, str, str, float]]:
        """Yield map, mode, measure and value of the evaluation."""
        for key, value in self.results.items():
            parts = key.split("|")
            if len(parts) == 3 and value is not None:
                yield parts[0], parts[1], parts[2], value

    def curve(self) -> list[float]:
        """Return collisions per robot and 1,000 steps in each part of the training."""
        return [value for key, value in self.results.items() if key.startswith("training|") and value is not None]


def learn_bench(
    benchmark: Benchmark,
    *,
    out: str | os.PathLike[str],
    jobs: int = 1,
    resume: bool = True,
    progress: bool = False,
) -> list[Run]:
    """Train and measure all contestants, and return what came of it.

    Each finished training is on the disk, with its measurements, before the next is waited for. A benchmark that
    was interrupted goes on where it was when it is called again with the same folder.

    Parameters
    ----------
    benchmark : Benchmark
    out : path
        Folder of the ledger.
    jobs : int
        Processes; -1 for one on each core. Results do not depend on it.
    resume : bool
        Whether what the folder holds counts; else it is done again.
    progress : bool

    Raises
    ------
    InvalidValueError
        If the folder cannot be written to, or a training failed.
    """
    workers = checked_jobs(jobs)
    file = check_writable(out) / LEDGER
    tasks = benchmark.tasks()
    with (
        Ledger(file, retry_failed=True, fits=is_training) as ledger,
        progress_bar(len(tasks), "trainings", progress) as bar,
    ):
        if not resume:
            ledger.clear()
        left = [task for task in tasks if benchmark.key(*task) not in ledger]
        bar.update(len(tasks) - len(left))
        for name, seed, results in results_of(workers, measured, ((benchmark, *task) for task in left)):
            ledger.append(benchmark.key(name, seed), Outcome(steps=benchmark.steps, results=results))
            bar.update()
        outcomes = ((name, seed, ledger.outcome(benchmark.key(name, seed))) for name, seed in tasks)
        return [Run(name, seed, outcome.results or {}) for name, seed, outcome in outcomes if outcome]


def is_training(outcome: Outcome) -> bool:
    """Return whether an outcome is one of `measured`: figures of the training, and all measures of each map and mode.

    Examples
    --------
    >>> is_training(Outcome(results={"robot-steps": 15.0}))
    False
    """
    results = outcome.results or {}
    places = {key.rpartition("|")[0] for key in results if key.count("|") == 2}
    wanted = {*OF_TRAINING, *(f"{place}|{measure}" for place in places for measure in MEASURES)}
    curve = [key for key in results if key.startswith("training|")]
    parts = min(PARTS, outcome.steps)
    known = {*wanted, *(f"training|{k:02}" for k in range(parts))}
    numbers = all(isinstance(value, (int, float)) and math.isfinite(value) for value in results.values())
    return numbers and wanted <= results.keys() <= known and len(curve) in (0, parts)


def measured(benchmark: Benchmark, name: str, seed: int) -> tuple[str, int, dict[str, float]]:
    """Train a contestant with a seed, and measure what came of it on all its maps."""
    begun, used = time.perf_counter(), time.process_time()
    trained = contestants()[name](seed, benchmark.steps)
    figures = time.perf_counter() - begun, time.process_time() - used, float(trained.robot_steps)
    results = dict(zip(OF_TRAINING, figures, strict=True))
    results |= {f"training|{k:02}": value for k, value in enumerate(trained.curve)}
    for place in benchmark.maps(seed):
        for mode in MODES:
            for measure, value in _measures(trained, mode, place, seed, benchmark.evaluation_steps).items():
                results[f"{place}|{mode}|{measure}"] = value
    if name in (RULE, *BRED):
        means = on_every_map(trained, seed, benchmark.evaluation_steps)
        results |= {f"{EVERY}|frozen|{measure}": value for measure, value in means.items()}
    return name, seed, results


def on_every_map(trained: Trained, seed: int, steps: int) -> dict[str, float]:
    """Return by measure the means over all unseen maps of what was learned with a seed, frozen."""
    rows = [_measures(trained, "frozen", f"random {number}", seed, steps) for number in UNSEEN]
    return {measure: float(np.mean([row[measure] for row in rows])) for measure in rows[0]}


def _measures(trained: Trained, mode: str, place: str, seed: int, steps: int) -> dict[str, float]:
    control = getattr(trained, mode)
    if control is None:
        return {}
    return drive_measured(driven_world(control, DESIGN, ROBOTS, map_named(place), APART + seed), steps)


def map_named(place: str) -> Map:
    """Return a map by the name that results have.

    Examples
    --------
    >>> map_named("random 3").name, map_named("sparse").name
    ('random 3', 'sparse')
    """
    word, _, number = place.partition(" ")
    return random_map(int(number)) if word == "random" else Map.load(place)


def group_of(place: str) -> str:
    """Return what kind of map it is: where the training was, another that is built in, a generated one, or all unseen.

    Examples
    --------
    >>> [group_of(place) for place in ("original", "sparse", "random 7")]
    ['home', 'built in', 'generated']
    """
    if place in (HOME, EVERY):
        return "home" if place == HOME else "every"
    return "generated" if place.startswith("random") else "built in"


@cache
def _sources() -> str:
    found = blake2b(digest_size=8)
    for name in SOURCES:
        part = PACKAGE / name
        for path in sorted(part.rglob("*.py")) if part.is_dir() else [part]:
            found.update(path.read_bytes())
    return found.hexdigest()
