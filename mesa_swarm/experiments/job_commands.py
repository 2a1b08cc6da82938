"""What the commands run and sweep do with a job file."""

from pathlib import Path

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.experiments.commands import print_pairs
from mesa_swarm.experiments.compare import checked_jobs
from mesa_swarm.experiments.experiment import Experiment, Task, carried_out
from mesa_swarm.experiments.files import check_writable
from mesa_swarm.experiments.jobs import read_job
from mesa_swarm.experiments.sweep import run_experiment
from mesa_swarm.progress import progress_bar


def run(path: str, *, progress: bool) -> None:
    """Do the runs of a job one after the other, and print what came of each."""
    job = read_job(path)
    for experiment in job.experiments:
        if len(experiment.points) > 1:
            raise InvalidValueError(
                f"{experiment.name} has {len(experiment.points)} points; do them with: mesa-swarm sweep {path}"
            )
    queue = [(experiment, task) for experiment in job.experiments for task in experiment.tasks()]
    failed = 0
    with progress_bar(len(queue), "runs", progress) as bar:
        bar.refresh()
        for number, (experiment, task) in enumerate(queue):
            said = _said(experiment, task)
            bar.clear()
            print("\n" * bool(number) + f"{experiment.name}, rng {task.rng}")
            print_pairs(said)
            failed += "error" in said
            bar.update()
    if failed:
        raise InvalidValueError(f"{failed} of {len(queue)} runs ended in an error; see above")


def sweep(path: str, *, jobs: int, out: Path | None, progress: bool, retry_failed: bool = False) -> None:
    """Do all runs of a job on several processes, each experiment in a folder of its own, and print the paths."""
    job = read_job(path)
    folder = check_writable(out or Path("results", job.name))
    workers = checked_jobs(jobs)
    for experiment in job.experiments:
        home = folder if len(job.experiments) == 1 else folder / experiment.name
        made = run_experiment(experiment, home, workers, progress, retry_failed)
        before = f", {made.done_before:,} of them before" if made.done_before else ""
        failed = f", {made.failed:,} ended in an error" if made.failed else ""
        print(f"{made.path}: {made.runs:,} runs{before}{failed}", flush=True)


def _said(experiment: Experiment, task: Task) -> dict[str, object]:
    """Return what came of a run, as pairs to print."""
    outcome = carried_out(experiment.model_class, task)
    if outcome.error is not None:
        return {"error": outcome.error}
    wanted = experiment.measure or outcome.results
    results = {name: outcome.results[name] for name in wanted}
    return {"steps": outcome.steps, **results, "state hash": outcome.state_hash}
