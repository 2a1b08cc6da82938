"""What the commands run and sweep do with a job file."""

import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from mesa_swarm.cli.commands import print_pairs
from mesa_swarm.errors import InvalidValueError, SwarmError
from mesa_swarm.experiments.experiment import Experiment
from mesa_swarm.experiments.jobs import Job, read_job, recorded_to
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.experiments.pool import checked_jobs
from mesa_swarm.experiments.run_records import RunRecords, recorded
from mesa_swarm.experiments.runs import Run, attempt, error_in_words
from mesa_swarm.experiments.sweep import check_recorded, done_before, run_experiment
from mesa_swarm.files import check_writable


@dataclass(frozen=True, slots=True)
class _Run:
    """A run of the queue, and the file it is recorded to, if any."""

    experiment: Experiment
    run: Run
    records: RunRecords | None

    @property
    def file(self) -> Path | None:
        """Looked for anew each time: somebody may have put a link there meanwhile."""
        return None if self.records is None else self.records.path(self.experiment.name, self.run.rng)

    def observer(self, force: bool) -> Callable:
        """Return what is entered around the run."""
        file = self.file
        if self.records is None or file is None:
            return nullcontext
        return partial(recorded, path=file, options=self.records.options, overwrite=force)

    def __str__(self) -> str:
        return f"{self.experiment.name}, rng {self.run.rng}"


def run(path: str, *, progress: bool, record: Path | None = None, force: bool = False) -> bool:
    """Do the runs of a job one after the other, print what came of each, and return whether none failed.

    Parameters
    ----------
    path : str
        Of the job file.
    progress : bool
        Whether to show a bar for each run.
    record : Path, optional
        Where to record them, whatever the job says.
    force : bool
        Whether recordings that are there are replaced. Else the runs that would have to are not done.
    """
    job = read_job(path) if record is None else recorded_to(read_job(path), record)
    for experiment in job.experiments:
        if len(experiment.points) > 1:
            raise InvalidValueError(
                f"{experiment.name} has {len(experiment.points)} points; do them with: mesa-swarm sweep {path}"
            )
    queue = [
        _Run(experiment, run, records)
        for experiment, records in zip(job.experiments, job.records, strict=True)
        for run in experiment.runs()
    ]
    failed = 0
    for number, one in enumerate(queue):
        print("\n" * bool(number) + str(one), flush=True)
        outcome = _outcome(one, progress, force)
        failed += outcome.error is not None
        _tell(one, outcome)
    return not failed


def _outcome(one: _Run, progress: bool, force: bool) -> Outcome:
    """Do a run, recorded if its job says so; what was recorded of it before Ctrl-C stays."""
    try:
        observed = one.observer(force)
    except SwarmError as error:
        return Outcome(error=error_in_words(error))
    try:
        return attempt(one.run, observed, progress)
    except KeyboardInterrupt:
        if one.file is not None:
            print(f"what was recorded so far is kept in {one.file}")
        raise


def _tell(one: _Run, outcome: Outcome) -> None:
    """Print what came of a run; an error is one line where errors go."""
    if outcome.error is not None:
        print(f"mesa-swarm: {one}: {outcome.error}", file=sys.stderr, flush=True)
        return
    results = {name: outcome.numbers[name] for name in one.experiment.measures or outcome.numbers}
    written = {} if one.file is None else {"recording": one.file}
    print_pairs({"steps": outcome.steps, **results, "state hash": outcome.state_hash, **written})


def sweep(
    path: str, *, jobs: int, out: Path | None, record: bool = False, progress: bool, retry_failed: bool = False
) -> bool:
    """Do all runs of a job on several processes, each experiment in a folder of its own, and print the paths.

    What failed, now or in an earlier call, is told where errors go. Returns whether nothing did.
    """
    job, folder = _job_and_folder(path, out)
    check_writable(folder)
    workers = checked_jobs(jobs)
    failures = 0
    for experiment, home, options in _parts(job, folder, record):
        made = run_experiment(experiment, home, workers, progress, options, retry_failed)
        before = f", {made.done_before:,} of them before" if made.done_before else ""
        failed = f", {made.failed:,} ended in an error" if made.failed else ""
        print(f"{made.path}: {made.runs:,} runs{before}{failed}", flush=True)
        for error in made.errors:
            print(f"mesa-swarm: {made.path}: {error}", file=sys.stderr, flush=True)
        failures += made.failed
    if failures:
        print("mesa-swarm: what failed is done again with --retry-failed", file=sys.stderr, flush=True)
    return not failures


def plan(path: str, *, out: Path | None, record: bool = False) -> None:
    """Print how many runs a sweep of a job would do, and how many are done; write nothing."""
    job, folder = _job_and_folder(path, out)
    for experiment, home, options in _parts(job, folder, record):
        runs, done = len(experiment), done_before(experiment, home, options)
        size = f"{len(experiment.points):,} points x {len(experiment.seeds):,} seeds, {experiment.steps:,} steps each"
        print(f"{home}: {runs:,} runs ({size}), {done:,} done, {runs - done:,} to do")


def _job_and_folder(path: str, out: Path | None) -> tuple[Job, Path]:
    job = read_job(path)
    return job, out or Path("results", job.name)


def _parts(job: Job, folder: Path, record: bool) -> Iterator[tuple[Experiment, Path, dict | None]]:
    """Yield the experiments of a job, the folder of each, and the options of its recordings if it is recorded."""
    for experiment in job.experiments if record else ():
        check_recorded(experiment)
    for experiment, records in zip(job.experiments, job.records, strict=True):
        home = folder if len(job.experiments) == 1 else folder / experiment.name
        yield experiment, home, dict(records.options if records else {}) if record else None
