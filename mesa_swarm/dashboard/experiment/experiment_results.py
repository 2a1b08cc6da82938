"""Runs of an experiment of the page, done in the background, and what is shown and stored of them."""

import io
import math
import re
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from hashlib import blake2b
from pathlib import Path
from sys import intern
from typing import Any

import numpy as np

from mesa_swarm.base.errors import place_of_error
from mesa_swarm.dashboard.experiment.many_runs import Send
from mesa_swarm.experiments.experiment import POINT, Experiment
from mesa_swarm.experiments.jobs import job_text
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.experiments.reports import LEFT_OUT, OF, counted, split_measure, sum_of_left_out
from mesa_swarm.experiments.run_tables import RunFiles
from mesa_swarm.experiments.runs import Run, error_in_words
from mesa_swarm.experiments.statistics import Interval, bootstrap_mean, share_interval
from mesa_swarm.experiments.sweep import run_experiment, stored_runs
from mesa_swarm.experiments.tables import csv_text
from mesa_swarm.maps.map import Map
from mesa_swarm.model.gallery import is_address, short_name
from mesa_swarm.viewing.error_lines import print_traceback

MEAN, SHARE = "mean", "share of runs in which it occurred"
# Intervals that are stored, of all experiments of this server.
MOST_STORED = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class SeedBySeed(Experiment):
    """An experiment whose runs are done with the first seed at all points, then with the next: early runs show all."""

    def order(self) -> Iterator[tuple[int, int]]:
        """Yield the numbers of a point and a seed of each run: seed by seed."""
        return ((point, seed) for seed in range(len(self.seeds)) for point in range(len(self.points)))


@dataclass(frozen=True, slots=True)
class GridRuns:
    """The runs of an experiment, to be done in the background; those that its folder has are done already.

    With `retry_failed` those that ended in an error are done again.
    """

    experiment: SeedBySeed
    folder: Path
    retry_failed: bool = False

    def __len__(self) -> int:
        return len(self.experiment)

    def do(self, workers: int, send: Send) -> None:
        """Send the number of each run and its outcome: those done earlier at once, each other one when it is done."""
        places = {run.key: number for number, run in enumerate(self.experiment.runs())}
        results = stored_runs(self.experiment, self.folder)
        outcomes = [(run, outcome) for run, outcome in results if not (self.retry_failed and outcome.error is not None)]
        send("before", [(places[run.key], outcome) for run, outcome in outcomes])

        def send_run(run: Run, outcome: Outcome) -> None:
            send("run", (places[run.key], outcome))

        how: dict[str, Any] = {
            "retry_failed": self.retry_failed,
            "heard": send_run,
            "words": partial(describe_failed_run, self.folder),
        }
        report = run_experiment(self.experiment, RunFiles(self.folder), workers, **how)
        send("report", report)


def describe_failed_run(folder: Path, error: BaseException) -> str:
    """Return one line about the error of a run, with its place; the first of all processes prints the traceback."""
    place, line = place_of_error(error), error_in_words(error)
    about = blake2b(f"{place} {line}".encode(), digest_size=8).hexdigest()
    with suppress(FileExistsError):
        (folder / f"{about}.printed").touch(exist_ok=False)
        print_traceback(error)
    return f"{place}: {line}" if place else line


@dataclass(frozen=True, slots=True)
class GridCell:
    """A measure at one point: an estimate with its interval over `counted` of `done` runs, `failed` of which failed."""

    interval: Interval
    counted: int
    done: int
    failed: int


@dataclass(kw_only=True, eq=False)
class GridResults:
    """The outcomes of an experiment so far.

    `settings` are parameters that differ from the model's defaults and are the same in all runs, as the session names
    them (uploaded maps by name); `values` those of the varied parameters.
    """

    experiment: SeedBySeed
    model: str
    values: dict[str, list]
    settings: dict[str, Any]
    maps: dict[str, Map]
    outcomes: dict[int, Outcome] = field(default_factory=dict)

    def take(self, numbered: tuple[int, Outcome]) -> None:
        """Store the outcome of a run."""
        number, outcome = numbered
        # Names arrive anew with each outcome: thousands of runs share them.
        numbers = {intern(name): value for name, value in outcome.numbers.items()}
        self.outcomes[number] = replace(outcome, results=None if outcome.results is None else numbers)

    @property
    def signature(self) -> tuple:
        """What the results are of; of two experiments the same only if their runs are the same."""
        # Values as text: True, 1 and 1.0 are equal.
        return (self.model, repr(self.values), repr(self.settings), len(self.experiment.seeds), self.experiment.steps)

    @property
    def is_complete(self) -> bool:
        """Whether all runs are done."""
        return len(self.outcomes) == len(self.experiment)

    @property
    def failed(self) -> list[int]:
        """The numbers of the runs that ended in an error."""
        return [number for number, outcome in self.outcomes.items() if outcome.error is not None]

    @property
    def results(self) -> list[str]:
        """The names of the model's own results, in order."""
        return [name for name in self.experiment.measures if not split_measure(name)]

    def point(self, place: int) -> dict[str, Any]:
        """Return the values of the varied parameters at a point, as the session names them."""
        places = np.unravel_index(place, [len(values) for values in self.values.values()])
        return {name: values[k] for (name, values), k in zip(self.values.items(), places, strict=True)}

    def cells(self, measure: str, summary: str) -> list[GridCell]:
        """Return the estimate of a measure at each point."""
        numbers: list[list[float]] = [[] for _ in self.experiment.points]
        finished_runs, failures = np.zeros((2, len(numbers)), int)
        for number, outcome in sorted(self.outcomes.items()):
            place = number % len(numbers)
            finished_runs[place] += 1
            failures[place] += outcome.error is not None
            if (value := outcome.numbers.get(measure)) is not None:
                numbers[place].append(value)
        counts = zip(numbers, finished_runs.tolist(), failures.tolist(), strict=True)
        if summary == SHARE:
            return [GridCell(_share(len(n), runs - wrong), runs - wrong, runs, wrong) for n, runs, wrong in counts]
        return [GridCell(_mean(tuple(n)), len(n), runs, wrong) for n, runs, wrong in counts]

    def errors(self) -> dict[int, str]:
        """Return the first error at each point that has one."""
        errors: dict[int, str] = {}
        for number, outcome in sorted(self.outcomes.items()):
            if outcome.error is not None:
                errors.setdefault(number % len(self.experiment.points), outcome.error)
        return dict(sorted(errors.items()))

    def columns(self, measure: str) -> list[str]:
        """Return the measures of tables: the model's results, and this one if it is another."""
        return list(dict.fromkeys([*self.results, measure]))

    def left_out(self, measure: str) -> dict[str, int]:
        """Return how many rows of the reporter that a measure names are left out in all finished runs, if any are."""
        names = counted([measure])[1:]
        return sum_of_left_out({name: run.numbers.get(name) for name in names} for run in self.outcomes.values())

    def csv(self, measure: str) -> str:
        """Return one line for each finished run, point by point."""
        names = [*self.columns(measure), *(f"{LEFT_OUT}{OF}{name}" for name in self.left_out(measure))]
        lines: list[Sequence] = [[POINT, *self.values, "rng", "steps", "state_hash", *names, "error"]]
        points = len(self.experiment.points)
        for number in sorted(self.outcomes, key=lambda number: (number % points, number)):
            outcome, seed = self.outcomes[number], self.experiment.seeds[number // points]
            fixed = [seed, None if outcome.error else outcome.steps, outcome.state_hash]
            numbers = [outcome.numbers.get(name) for name in names]
            lines.append([number % points, *self.point(number % points).values(), *fixed, *numbers, outcome.error])
        return csv_text(lines)

    @property
    def job_name(self) -> str:
        """The name of the job file, and of the folder of its results."""
        return f"experiment_{re.sub(r'[^A-Za-z0-9_-]+', '_', short_name(self.model))[:40]}"

    @property
    def command(self) -> str:
        """The command that repeats the experiment."""
        return f"mesa-swarm sweep {self.job_name}.toml"

    def job(self, measure: str) -> str:
        """Return the job file that repeats the experiment."""
        columns, remarks = self.columns(measure), [f"An experiment of the dashboard; run it with: {self.command}"]
        if ".py" in self.model:
            remarks.append("The file of the model must be in the folder of this file.")
        return job_text(
            _in_the_same_folder(self.model),
            remarks,
            steps=self.experiment.steps,
            seeds=len(self.experiment.seeds),
            measure=[] if columns == self.results else columns,
            parameters={name: self._to_job_value(name, value) for name, value in self.settings.items()},
            grid={name: [self._to_job_value(name, value) for value in values] for name, values in self.values.items()},
        )

    def job_file(self, measure: str) -> tuple[str, bytes]:
        """Return a name and the content of the job file; with uploaded maps, of a ZIP file that has it and the maps."""
        job = self.job(measure).encode()
        if not self.maps:
            return f"{self.job_name}.toml", job
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(f"{self.job_name}.toml", job)
            for name, chart in self.maps.items():
                archive.writestr(self._map_file(name), chart.to_toml())
        return f"{self.job_name}.zip", content.getvalue()

    def _to_job_value(self, name: str, value: Any) -> Any:
        """Return a value as a job file has it: of an uploaded map the name of its file."""
        return self._map_file(value) if name == "map" and value in self.maps else value

    def _map_file(self, name: str) -> str:
        return f"map_{list(self.maps).index(name) + 1}.toml"


def _in_the_same_folder(model: str) -> str:
    """Return a model's name or address, without the folder of its file."""
    if not is_address(model) or ".py" not in model:
        return model
    file, ending, class_name = model.rpartition(".py")
    return f"./{Path(file).name}{ending}{class_name}"


@lru_cache(maxsize=MOST_STORED)
def _mean(numbers: tuple[float, ...]) -> Interval:
    """Return a mean with its interval, which takes milliseconds: only that of a cell with a new run is computed."""
    return bootstrap_mean(numbers)


def _share(happened: int, runs: int) -> Interval:
    return share_interval(happened, runs) if runs else Interval(math.nan, math.nan, math.nan)
