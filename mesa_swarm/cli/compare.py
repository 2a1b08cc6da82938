"""Many runs, resumed where an earlier call stopped: sweep, compare, reality-gap."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.base.files import check_writable, write_whole
from mesa_swarm.base.wording import quantity
from mesa_swarm.cli.lines import print_lines
from mesa_swarm.cli.options import (
    FAILED,
    Jobs,
    Model,
    Quiet,
    Series,
    Settings,
    StepsOfRuns,
    Tables,
    Until,
    known_model,
    prepare,
    print_study,
    resumable,
)
from mesa_swarm.model.gallery import find_model, loaded_models, short_name

if TYPE_CHECKING:
    from mesa_swarm.experiments.experiment import Experiment
    from mesa_swarm.experiments.jobs import Job
    from mesa_swarm.experiments.reality_gap import Gap
    from mesa_swarm.experiments.run_tables import RunFiles
    from mesa_swarm.experiments.sweep import Shard, Sweep

commands = typer.Typer()


@commands.command("sweep")
def sweep_command(
    job: Annotated[str, typer.Argument(metavar="JOB.toml", help="A job file, which may have a grid or a sample.")],
    *,
    jobs: Jobs = -1,
    out: Annotated[Path | None, typer.Option(help="Folder of the results; results/JOB by default.")] = None,
    record: Annotated[bool, typer.Option("--record", help="Record every run, to recordings/ in that folder.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only count the runs, and those that are done.")] = False,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Repeat runs that ended in an error.")] = False,
    shard: Annotated[
        str | None,
        typer.Option(metavar="NUMBER/SHARDS", help="Do this part only, such as 3/10; without it, collect all parts."),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Of a dask scheduler, whose workers do the runs.")
    ] = None,
    until: Until = None,
    series: Series = None,
    table: Tables = None,
    quiet: Quiet = False,
) -> None:
    """Do all runs of a job file; continue an interrupted sweep. Exit status 1 if some runs failed."""
    prepare()
    from mesa_swarm.experiments.jobs import read_job
    from mesa_swarm.experiments.run_tables import RunFiles, checked_forms
    from mesa_swarm.experiments.series import checked_series
    from mesa_swarm.experiments.sweep import WHOLE, Shard, done_before, run_experiment
    from mesa_swarm.experiments.worker_pool import checked_jobs, on_scheduler

    part = WHOLE if shard is None else Shard.parsed(shard)
    forms, parts = checked_forms(table or ()), checked_series(series)
    read = read_job(job, until)
    folder = out or Path("results", read.name)
    files = RunFiles(folder, parts, forms)
    if dry_run:
        for experiment, home, options in _parts(read, files, record):
            _print_size(experiment, home, part, done_before(experiment, home, options, part))
        return
    check_writable(folder)
    workers = checked_jobs(jobs)
    if scheduler is not None and jobs != -1:
        raise InvalidValueError("--jobs counts processes of this machine; leave it out with --scheduler")
    failures = 0
    with nullcontext() if scheduler is None else on_scheduler(scheduler):
        for experiment, home, options in _parts(read, files, record):
            made = run_experiment(experiment, home, workers, not quiet, options, retry_failed, shard=part)
            _print_made(made)
            failures += made.failed
    if failures:
        print("mesa-swarm: --retry-failed repeats the runs that failed", file=sys.stderr, flush=True)
        raise typer.Exit(FAILED)


def _print_size(experiment: "Experiment", home: "RunFiles", part: "Shard", done: int) -> None:
    """Print how many runs an experiment has, and how many of them are done."""
    points, seeds, runs = len(experiment.points), len(experiment.seeds), part.count(experiment)
    size = f"{quantity(points, 'point')} x {quantity(seeds, 'seed')}, {quantity(experiment.steps, 'step')} each"
    print_lines([f"{home.folder}: {quantity(runs, 'run')} ({size}), {done:,} done, {runs - done:,} to do"])


def _print_made(made: "Sweep") -> None:
    """Print what a sweep has done and written, and the first errors."""
    from mesa_swarm.experiments.reports import notes_on_rows

    before = f", {made.done_before:,} of them before" if made.done_before else ""
    failed = f", {made.failed:,} ended in an error" if made.failed else ""
    size = f"{made.path}: {quantity(made.runs, 'run')}{before}{failed}"
    print_lines([size, *map(str, made.written), *notes_on_rows(made.left_out)])
    for error in made.errors:
        print(f"mesa-swarm: {made.path}: {error}", file=sys.stderr, flush=True)


def _parts(job: "Job", files: "RunFiles", record: bool) -> "Iterator[tuple[Experiment, RunFiles, dict | None]]":
    """Yield the experiments of a job, the files of each, and the options of its recordings if it is recorded."""
    from mesa_swarm.experiments.sweep import check_columns_of

    for experiment in job.experiments:
        check_columns_of(experiment, recorded=record, series=files.parts)
    for experiment, records in zip(job.experiments, job.records, strict=True):
        home = files if len(job.experiments) == 1 else files.within(experiment.name)
        yield experiment, home, dict(records.options if records else {}) if record else None


@commands.command("compare")
def compare_command(
    model: Model,
    *,
    parameter: Annotated[str | None, typer.Option(help="What to vary; the model's choice by default.")] = None,
    values: Annotated[str | None, typer.Option(metavar="A,B,...", help="Its values.")] = None,
    seeds: Annotated[int, typer.Option(min=1, max=100_000, help="Runs with each value; the same seeds for all.")] = 30,
    steps: StepsOfRuns = None,
    setting: Settings = None,
    measure: Annotated[
        list[str] | None, typer.Option(help="A result, or a report such as 'mean of NAME'; all results by default.")
    ] = None,
    jobs: Jobs = -1,
    out: Annotated[
        Path | None, typer.Option(help="Folder of tables, pictures and runs; results/compare_MODEL by default.")
    ] = None,
    until: Until = None,
    series: Series = None,
    table: Tables = None,
    quiet: Quiet = False,
) -> None:
    """Compare values of a parameter over the same seeds; continue an interrupted comparison."""
    prepare()
    from mesa_swarm.experiments.compare import run_plan
    from mesa_swarm.experiments.ledger import RUNS
    from mesa_swarm.experiments.plan import checked_plan
    from mesa_swarm.experiments.run_tables import RunFiles
    from mesa_swarm.experiments.worker_pool import checked_jobs
    from mesa_swarm.model.parameters import parse_settings

    model_class, folder = find_model(model), out or Path("results", f"compare_{short_name(model)}")
    files, workers = RunFiles.checked(folder, series=series, tables=table or ()), checked_jobs(jobs)
    plan = checked_plan(
        model_class,
        parameter=parameter,
        values=None if values is None else parsed_values(model_class, parameter, values),
        seeds=seeds,
        steps=steps,
        settings=parse_settings(model_class, setting or ()),
        measures=measure or (),
        until=until,
    )
    with resumable(folder / RUNS):
        comparison = run_plan(plan, workers, not quiet, folder=files)
    if comparison.done_before:
        done = f"{comparison.done_before:,} of {len(comparison.runs):,} runs were done before, see {folder / RUNS}"
        print_lines([done])
    print_study(comparison, folder, files.written, finding=True)


def parsed_values(model_class: type, parameter: str | None, values: str) -> list:
    """Return values separated by commas, as the parameter's type."""
    from mesa_swarm.model.parameters import parse_settings

    name = parameter or getattr(model_class, "compares", (None,))[0]
    if name is None:
        raise InvalidValueError("--values is given without --parameter; give both")
    return [parse_settings(model_class, [f"{name}={text.strip()}"])[name] for text in values.split(",")]


@commands.command("reality-gap")
def reality_gap_command(
    model: Annotated[
        str | None, typer.Argument(callback=known_model, metavar="[MODEL]", help="All models by default.")
    ] = None,
    *,
    preset: Annotated[str, typer.Option(help="The imperfections at 1 on the dial: measured or robotarium.")] = (
        "measured"
    ),
    measure: Annotated[
        str | None, typer.Option(help="The result to score; by default the model's headline, or the first.")
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, max=100_000, help="Runs at each place; the same seeds for all.")] = 10,
    steps: StepsOfRuns = None,
    setting: Settings = None,
    jobs: Jobs = -1,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder; results/reality_gap_MODEL by default, for all models results/reality_gap."),
    ] = None,
    until: Until = None,
    series: Series = None,
    table: Tables = None,
    quiet: Quiet = False,
) -> None:
    """Turn a dial from ideal to imperfect robots and draw the model's score; continue an interrupted call."""
    prepare()
    of_one = {"--set": setting, "--measure": measure, "--until": until}
    option = next((name for name, value in of_one.items() if value), None)
    if model is None and option is not None:
        raise InvalidValueError(f"{option} is given without a model; name the model that it is for")
    folder = check_writable(out or Path("results", f"reality_gap_{short_name(model)}" if model else "reality_gap"))
    options: dict[str, Any] = {
        "preset": preset,
        "measure": measure,
        "seeds": seeds,
        "steps": steps,
        "jobs": jobs,
        "until": until,
    }
    options |= {"series": series or False, "tables": table or (), "progress": not quiet}
    if model is not None:
        _print_gap(model, setting, folder, options)
        return
    from mesa_swarm.experiments.reality_gap import gaps_figure
    from mesa_swarm.viewing.pictures import png

    gaps = [_print_gap(name, setting, folder / name, options) for name in loaded_models()[0]]
    print(write_whole(folder / "reality_gap.png", png(gaps_figure(gaps))))


def _print_gap(model: str, setting: Sequence[str] | None, folder: Path, options: dict[str, Any]) -> "Gap":
    """Measure the reality gap of a model, write its files, and print its table and their paths."""
    from mesa_swarm.experiments.reality_gap import reality_gap
    from mesa_swarm.model.parameters import parse_settings

    gap = reality_gap(model, settings=parse_settings(find_model(model), setting or ()), out=folder, **options)
    print_study(gap, folder, gap.stored)
    return gap
