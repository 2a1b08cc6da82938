"""The benchmark of learning: train, and measure on maps that were not used for training."""

import math
import os
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from mesa_swarm import Map, __version__
from mesa_swarm.errors import InvalidValueError, check_choice, check_count, shortened
from mesa_swarm.experiments import (
    Controller,
    Outcome,
    Run,
    RunFiles,
    TableHead,
    checked_jobs,
    content_of,
    done_in_order,
    engine_hash,
    fingerprint,
    load_controller,
)
from mesa_swarm_studies.benchmarks.benchmark_tasks import TEST, benchmark_tasks
from mesa_swarm_studies.benchmarks.contestants import HOME, PARTS, Trained, validated
from mesa_swarm_studies.benchmarks.task_contestants import contestants_of, optional

LEDGER = "ledger.jsonl"
LARGEST = sys.float_info.max
# Results depend on these files and on the engine; after a change the runs are repeated.
SOURCES = (
    str(Path(__file__).parent),
    "experiments/controllers.py",
    *(f"searches/{name}.py" for name in ("automatic_design", "design_gap", "drive_measures", "evolved_controllers")),
    "searches/validation_gate.py",
    "environments",
)
MODES = ("frozen", "learning")
OF_TRAINING = ("train wall seconds", "train processor seconds", "robot-steps", "trainings", "passed")
# On how many test maps robots are measured that are still learning.
LEARNING_MAPS = 10
# Of a benchmark of minutes.
QUICK = {"seeds": 2, "steps": 3300, "evaluation_steps": 1000, "maps": 5}
# Of an experiment about networks of robots' own, which takes as long as half of avoidance: they take part when named.
NAMED_ONLY = ("own Q (b), cooled, with replay", "own Q (b), cooled, short replay", "shared Q (b), cooled, 1/15")
# Contestants that every foreign controller is compared with, which need no training.
BESIDES = ("random",)


@dataclass(frozen=True, kw_only=True, slots=True)
class Benchmark:
    """A benchmark of learning: contestants, all by default, trained with the seeds 1, 2, ...

    Parameters
    ----------
    seeds : int
        Trainings of each contestant; a controller without training drives with each seed in other worlds.
    steps : int
        Of each training, of 15 robots.
    evaluation_steps : int
        At most, on each map: a task may be done earlier, and most have fewer.
    maps : int
        At most, of the 50 test maps; tasks but "avoid" have 20.
    tasks, only : sequence of str
        Names of tasks and of contestants; all by default but those of `NAMED_ONLY`. With `policies` those without
        training by default.
    policies : sequence of str
        Controllers from outside, see `controllers.load_controller`; they take part in each of the tasks.

    Raises
    ------
    InvalidValueError, UnknownNameError, LearningError
        Also if a controller from outside does not fit one of the tasks.

    Examples
    --------
    >>> [run.settings["name"] for run in Benchmark(seeds=1, tasks=("avoid",), only=("random",)).runs()]
    ['random']
    """

    seeds: int = 10
    steps: int = 33_000
    evaluation_steps: int = 8000
    maps: int = len(TEST)
    tasks: Sequence[str] = ()
    only: Sequence[str] = ()
    policies: Sequence[str] = ()

    def __post_init__(self) -> None:
        """Check the parameters."""
        check_count("seeds", self.seeds, minimum=1, maximum=1000)
        check_count("steps", self.steps, minimum=1, maximum=10_000_000)
        check_count("evaluation_steps", self.evaluation_steps, minimum=1, maximum=1_000_000)
        check_count("maps", self.maps, minimum=1, maximum=len(TEST))
        for field in ("tasks", "only", "policies"):
            object.__setattr__(self, field, _checked_texts(field, getattr(self, field)))
        for name in self.tasks:
            check_choice("task", name, benchmark_tasks())
        known = {name for task in self.task_names for name in contestants_of(task)}
        for name in self.only:
            check_choice("contestant", name, sorted(known))
        for task in self.task_names:
            for address in self.policies:
                check_fits(load_controller(address), task)

    @property
    def task_names(self) -> list[str]:
        """The tasks, in the order of the tables."""
        return [name for name in benchmark_tasks() if not self.tasks or name in self.tasks]

    def names(self, task: str) -> list[str]:
        """Return the contestants in a task, in the order of its table; controllers from outside by their address."""
        ours = contestants_of(task)
        every = [name for name in ours if not optional(name) and name not in NAMED_ONLY]
        wanted = self.only or ((benchmark_tasks()[task].rule, *BESIDES) if self.policies else every)
        return [*(name for name in ours if name in wanted), *self.policies]

    def places(self, task: str) -> tuple[str, ...]:
        """Return the names of the maps on which a task is measured: in avoidance also that of the training."""
        home = (HOME,) if task == "avoid" else ()
        count = min(self.maps, benchmark_tasks()[task].tests)
        return (*home, *(f"random {number}" for number in TEST[:count]))

    def key(self, task: str, name: str, seed: int) -> str:
        """Return the fingerprint of all that decides the outcome of a training and its evaluation."""
        content = content_of(name) if name in self.policies else ""
        settings = self.steps, self.evaluation_steps, self.maps
        return fingerprint(task, name, seed, settings, content, __version__, engine_hash(*SOURCES, models=True))

    def runs(self) -> Iterator[Run]:
        """Yield the trainings: seed by seed, so that an interrupted benchmark is a fair one."""
        for seed in range(1, self.seeds + 1):
            for task in self.task_names:
                for name in self.names(task):
                    settings = {"task": task, "name": name}
                    yield Run(partial(measured, self), settings, seed, self.steps, self.key(task, name, seed))


@dataclass(frozen=True, slots=True, kw_only=True)
class Training(Outcome):
    """The outcome of a training with a seed: results by ``map|mode|measure``, and of the training."""

    task: str
    name: str
    seed: int

    def rows(self) -> Iterator[tuple[str, str, str, float]]:
        """Yield map, mode, measure and value of the evaluation; NaN for what did not happen."""
        for key, value in self.numbers.items():
            parts = key.split("|")
            if len(parts) == 3:
                yield parts[0], parts[1], parts[2], math.nan if value is None else value

    def curve(self) -> list[float]:
        """Return collisions per robot and 1,000 steps in each part of the training."""
        return [value for key, value in self.numbers.items() if key.startswith("training|") and value is not None]


def learn_bench(
    benchmark: Benchmark,
    *,
    out: str | os.PathLike[str],
    jobs: int = 1,
    resume: bool = True,
    progress: bool = False,
    tables: Sequence[str] = (),
) -> list[Training]:
    """Train and measure all contestants.

    Each finished training is on the disk, with its measurements, before the next is waited for. A benchmark that
    was interrupted continues when it is called again with the same folder, unless `resume` is False: then all is done
    again. Results do not depend on the number of jobs. `tables` are forms of tables with a row for each training, see
    `sweep`.
    """
    workers, files = checked_jobs(jobs), replace(RunFiles.checked(out, tables=tables), file=LEDGER)
    with files.ledger(fits=is_training) as ledger:
        if not resume and ledger is not None:
            ledger.clear()
        runs = list(benchmark.runs())
        done = done_in_order(runs, ledger=ledger, workers=workers, progress=progress, unit="trainings")
    files.write(TableHead(__name__, "learn-bench", Map.load(HOME).bounds), lambda: done)
    return [Training(**outcome.stored(), **run.settings, seed=run.rng) for run, outcome in done]


def is_training(outcome: Outcome) -> bool:
    """Return whether an outcome is one of `measured`: figures of the training, all measures of each map and mode."""
    results = outcome.numbers
    measures = {key.rpartition("|")[2] for key in results if key.count("|") == 2}
    wanted = next((task.measures for task in benchmark_tasks().values() if set(task.measures) == measures), None)
    if wanted is None:
        return False
    places = {key.rpartition("|")[0] for key in results if key.count("|") == 2}
    required = {*OF_TRAINING, *(f"{place}|{measure}" for place in places for measure in wanted)}
    curve = [key for key in results if key.startswith("training|")]
    parts = min(PARTS, outcome.steps)
    known = {*required, *(f"training|{k:02}" for k in range(parts))}
    values = [value for value in results.values() if value is not None]
    finite = all(isinstance(value, int | float) and abs(value) <= LARGEST for value in values)
    trained = all(results.get(name) is not None for name in OF_TRAINING[:-1])
    return finite and trained and required <= results.keys() <= known and len(curve) in (0, parts)


def measured(benchmark: Benchmark, *, task: str, name: str, rng: int) -> dict[str, float | None]:
    """Train a contestant with a seed, and measure it on all maps of its task."""
    setting = benchmark_tasks()[task]
    begun, used = time.perf_counter(), time.process_time()
    trained = prepared(benchmark, task, name, rng)
    times = time.perf_counter() - begun, time.process_time() - used
    trained = validated(task, trained, benchmark.steps)
    passed = None if trained.passed is None else float(trained.passed)
    figures = *times, float(trained.robot_steps), float(trained.trainings), passed
    results: dict[str, float | None] = dict(zip(OF_TRAINING, figures, strict=True))
    results |= {f"training|{k:02}": value for k, value in enumerate(trained.curve)}
    for number, place in enumerate(benchmark.places(task)):
        for mode in MODES:
            controller = getattr(trained, mode)
            if controller is not None and (mode == "frozen" or number <= LEARNING_MAPS):
                found = setting.drive(controller, place, rng, benchmark.evaluation_steps)
                results |= {f"{place}|{mode}|{m}": None if math.isnan(v) else v for m, v in found.items()}
    return results


def prepared(benchmark: Benchmark, task: str, name: str, seed: int) -> Trained:
    """Return a contestant after its training, or a controller from outside, which needs none."""
    if name in benchmark.policies:
        return Trained(frozen=load_controller(name))
    return contestants_of(task)[name](seed, benchmark.steps)


def _checked_texts(name: str, texts: object) -> tuple[str, ...]:
    """Return texts, each once: of a contestant that takes part twice, intervals would be too narrow."""
    if not isinstance(texts, list | tuple) or not all(isinstance(text, str) for text in texts):
        raise InvalidValueError(f"{name} is {shortened(texts)}; expected a list of texts")
    return tuple(dict.fromkeys(texts))


def check_fits(controller: Controller, task: str) -> None:
    """Refuse a controller from outside that takes another number of observations than a task has."""
    width = benchmark_tasks()[task].task.observer().width
    if controller.width not in (None, width):
        raise InvalidValueError(
            f"{controller.name} takes {controller.width} observations of a robot and the task {task!r} has {width}; "
            "choose the task with --task"
        )
