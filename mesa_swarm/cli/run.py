"""One run, or the runs of a job one after the other: run, verify, diagnose; what they wait for once: warm-up."""

import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.base.files import check_apart
from mesa_swarm.cli.lines import print_lines
from mesa_swarm.cli.options import (
    FAILED,
    MOST_STEPS,
    MOST_STORED,
    Force,
    Jobs,
    Model,
    Quiet,
    RecordingFile,
    Seed,
    SeedOrNone,
    Settings,
    Until,
    built_model,
    files_of,
    known_model,
    prepare,
    print_pairs,
)
from mesa_swarm.model.gallery import check_model_name, find_model, short_name

if TYPE_CHECKING:
    from mesa_swarm.analysis.pathology import Pathologies
    from mesa_swarm.experiments.series import Watch
    from mesa_swarm.swarm_model import SwarmModel

JOB = ".toml"
MOST_EPISODES = 20

commands = typer.Typer()


@commands.command("run")
def run_command(
    model: Annotated[
        str, typer.Argument(metavar="MODEL|JOB.toml", help="One of `mesa-swarm list`, an address, or a job file.")
    ],
    *,
    setting: Settings = None,
    steps: Annotated[int | None, typer.Option(min=1, max=MOST_STEPS, help="At most; 3000 by default.")] = None,
    rng: SeedOrNone = None,
    record: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Record every step; {seed} and {name} are filled in.")
    ] = None,
    force: Force = False,
    until: Until = None,
    quiet: Quiet = False,
) -> None:
    """Run a model, or the runs of a job file; print the results and state hash of each."""
    if model.lower().endswith(JOB):
        for name, value in {"--set": setting, "--steps": steps, "--rng": rng}.items():
            if value is not None:
                raise InvalidValueError(f"{name} is given beside a job file, which sets it; leave it out")
        if not run_job(model, record, force, until, progress=not quiet):
            raise typer.Exit(FAILED)
        return
    check_model_name(model)
    seed = 1 if rng is None else rng
    file = None if record is None else recording_named(record, short_name(model), seed)
    if file:
        check_apart(file, files_of(model, setting))
    built = built_model(model, setting, seed)
    watch = None if until is None else watch_of(built, until)
    with built.record(file, overwrite=force) if file else nullcontext():
        try:
            how: dict[str, Any] = {} if watch is None else {"until": watch}  # a model may have a run of its own
            built.run(3000 if steps is None else steps, progress=not quiet, **how)
        except KeyboardInterrupt:
            if file:
                print(f"{built.completed} steps are recorded in {file}")
            raise
    results = built.results() if hasattr(built, "results") else {}
    time = {} if built.scale is None else {"time (s)": built.scale.seconds(built.steps)}
    ended = {} if watch is None else {"ended by": watch.ended_by(built)}
    print_pairs({"steps": built.steps, **ended, **time, **results, "state hash": built.state_hash()})


def watch_of(model: "SwarmModel", until: str) -> "Watch":
    """Return what watches a model until a condition holds; refuse a condition that is not about its reporters."""
    from mesa_swarm.experiments.series import Watch
    from mesa_swarm.experiments.until import EndCondition

    condition = EndCondition.parsed(until)
    condition.check(model)
    return Watch(model, condition)


def recording_named(path: Path, name: str, seed: int) -> Path:
    """Return where a run is recorded."""
    prepare()
    from mesa_swarm.experiments.run_records import filled_in

    return Path(filled_in(str(path), name, seed))


@commands.command("verify")
def verify_command(
    file: RecordingFile,
    *,
    model: Annotated[
        str | None,
        typer.Option(callback=known_model, help="Of a model that is not part of mesa_swarm: its name or address."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Run a recording again; name the first step and robot that differ (exit status 1), if any.

    A damaged recording counts as different, even if the rows before the damage agree. A file never causes an import:
    the model is imported only if it is named here, or is part of mesa_swarm.
    """
    prepare()
    from mesa_swarm.recording.recording import Recording
    from mesa_swarm.recording.resume import class_of, shipped_class_of
    from mesa_swarm.recording.verify import verify as run_again

    recording = Recording(file)
    if not recording.complete and not recording.damage:
        print(f"{file} was not closed: {len(recording)} rows are whole, {recording.lost} bytes after them are not")
    model_class = class_of(recording, find_model(model)) if model else shipped_class_of(recording)
    verification = run_again(recording, model_class, not quiet)
    print_lines([str(verification)], 0)
    if not verification.same:
        raise typer.Exit(FAILED)


@commands.command("warm-up")
def compile_all(*, jobs: Jobs = -1, quiet: Quiet = False) -> None:
    """Compile now, once, what the models need: for images of machines, or before a lesson."""
    from mesa_swarm.experiments.warm_up import warm_up

    print_lines([str(warm_up(jobs=jobs, progress=not quiet))], 0)


def run_job(path: str, record: Path | None, force: bool, until: str | None = None, *, progress: bool) -> bool:
    """Run a job file, recorded to `record` or as it defines; print each run's results; return whether all succeeded."""
    prepare()
    from mesa_swarm.experiments.jobs import named_files, read_job, recorded_to
    from mesa_swarm.experiments.ledger import Outcome
    from mesa_swarm.experiments.reports import LEFT_OUT, OF, sum_of_left_out
    from mesa_swarm.experiments.run_records import recorded
    from mesa_swarm.experiments.runs import attempt, error_in_words

    job = read_job(path, until) if record is None else recorded_to(read_job(path, until), record)
    for experiment in job.experiments:
        if len(experiment.points) > 1:
            raise InvalidValueError(
                f"{experiment.name} has {len(experiment.points)} points; run them with: mesa-swarm sweep {path}"
            )
    parts = zip(job.experiments, job.records, strict=True)
    queue = [(experiment, records, one) for experiment, records in parts for one in experiment.runs()]
    sources = named_files(path)
    for experiment, records, one in queue:
        if records is not None:
            check_apart(records.path(experiment.name, one.rng), sources)
    failed = 0
    for number, (experiment, records, one) in enumerate(queue):
        title = f"{experiment.name}, rng {one.rng}"
        print("\n" * bool(number) + title, flush=True)
        file: Path | None = None
        observer: Callable = nullcontext
        try:
            if records is not None:
                file = records.path(experiment.name, one.rng)
                observer = partial(recorded, path=file, options=records.options, overwrite=force)
            outcome = attempt(one, observer, progress)
        except SwarmError as error:
            outcome = Outcome(error=error_in_words(error))
        except KeyboardInterrupt:
            if file is not None:
                print(f"the steps so far are recorded in {file}")
            raise
        if outcome.error is not None:
            failed += 1
            print(f"mesa-swarm: {title}: {outcome.error}", file=sys.stderr, flush=True)
            continue
        left_out = {f"{LEFT_OUT}{OF}{name}": count for name, count in sum_of_left_out([outcome.numbers]).items()}
        measured = {name: outcome.numbers[name] for name in experiment.measures or outcome.numbers} | left_out
        written = {} if file is None else {"recording": file}
        ended = {} if outcome.ended_by is None else {"ended by": outcome.ended_by}
        print_pairs({"steps": outcome.steps, **ended, **measured, "state hash": outcome.state_hash, **written})
    return not failed


@commands.command("diagnose")
def diagnose_command(
    model: Model,
    *,
    setting: Settings = None,
    steps: Annotated[int, typer.Option(min=1, max=MOST_STORED, help="How many at most.")] = 2000,
    rng: Seed = 1,
    quiet: Quiet = False,
) -> None:
    """Run a model; print where robots made no progress: oscillated, blocked each other, were stuck."""
    prepare()
    from mesa_swarm.experiments.diagnosis import NEEDED, check_wheels, pathologies_of

    built = built_model(model, setting, rng)
    check_wheels(built)
    built.watch(last=None, columns=NEEDED)
    found = pathologies_of(built.run(steps, progress=not quiet))
    layers = built.control.names if built.control else ()
    names = ", ".join(f"{index} {name}" for index, name in enumerate(layers))
    print_pairs({"steps": built.steps, "robots": len(built.swarm), "layers": names, **found.counts()})
    print_lines(["", *described_episodes(found, [robot.unique_id for robot in built.robots])])


def described_episodes(found: "Pathologies", ids: Sequence[int]) -> list[str]:
    """Return the 20 longest episodes as sentences, the longest first."""
    longest = sorted(found, key=lambda episode: -episode.steps)
    sentences = [episode.describe(ids) for episode in longest[:MOST_EPISODES]] or ["No pathology was found."]
    more = len(longest) - MOST_EPISODES
    return [*sentences, f"... and {more} more, none of them longer."] if more > 0 else sentences
