"""What one types to study models: many runs, comparisons, pictures, learners, the thesis's results."""

from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Annotated

import typer

from mesa_swarm.errors import InvalidValueError, check_choice
from mesa_swarm.files import check_writable
from mesa_swarm.gallery import model_names

# Typer checks limits before anything slow is imported.
MOST_STEPS = 100_000_000
# Steps that are kept take memory.
MOST_KEPT = 1_000_000

# Exit status when all was done but some runs ended in an error.
FAILED = 1

study = typer.Typer()

Model = Annotated[str, typer.Argument(help="One of those that `mesa-swarm list` shows.", metavar="MODEL")]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Set a parameter; may be repeated.")
]
StepsOfRuns = Annotated[
    int | None, typer.Option(min=1, max=MOST_STEPS, help="At most, in each run; by default what the model says.")
]
Jobs = Annotated[int, typer.Option(min=-1, max=1024, help="Processes at a time, -1 for one on each core.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress bar.")]
Folder = Annotated[Path, typer.Option(help="Folder for the table and the picture.")]


def work(module: str = "commands", folder: str = "cli") -> ModuleType:
    """Import what does the work only when it is to be done, so that --help and misspelt names are quick."""
    return import_module(f"mesa_swarm.{folder}.{module}")


@study.command()
def sweep(
    job: Annotated[str, typer.Argument(help="A job file, which may have a grid or a sample.", metavar="JOB.toml")],
    *,
    jobs: Jobs = -1,
    out: Annotated[Path | None, typer.Option(help="Folder of the results; by default results/JOB.")] = None,
    record: Annotated[bool, typer.Option("--record", help="Record every run, to recordings/ in that folder.")] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only say how many runs there are, and how many are done.")
    ] = False,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Do runs again that ended in an error.")] = False,
    quiet: Quiet = False,
) -> None:
    """Do all runs of a job file; go on where an earlier call was interrupted. Exit status 1 if some failed."""
    does = work("job_commands")
    if dry_run:
        does.plan(job, out=out, record=record)
        return
    if not does.sweep(job, jobs=jobs, out=out, record=record, progress=not quiet, retry_failed=retry_failed):
        raise typer.Exit(FAILED)


@study.command()
def compare(
    model: Model,
    *,
    parameter: Annotated[str | None, typer.Option(help="What to vary; by default what the model says.")] = None,
    values: Annotated[str | None, typer.Option(metavar="A,B,...", help="Its values.")] = None,
    seeds: Annotated[int, typer.Option(min=1, max=100_000, help="Runs with each value; the same seeds for all.")] = 30,
    steps: StepsOfRuns = None,
    setting: Settings = None,
    jobs: Jobs = -1,
    out: Annotated[
        Path | None, typer.Option(help="Folder for tables, pictures and the runs; by default results/compare_MODEL.")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Compare values of a parameter over the same seeds; go on where an earlier call was interrupted."""
    check_choice("model", model, model_names())
    work().compare(
        model,
        setting or [],
        parameter=parameter,
        values=values,
        seeds=seeds,
        steps=steps,
        jobs=jobs,
        out=out,
        progress=not quiet,
    )


@study.command("reality-gap")
def reality_gap(
    model: Annotated[str | None, typer.Argument(help="Without one, all models.", metavar="[MODEL]")] = None,
    *,
    preset: Annotated[str, typer.Option(help="What 1 on the dial is: measured or robotarium.")] = "measured",
    measure: Annotated[
        str | None, typer.Option(help="The result that is the score; else the model's headline, or the first.")
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, max=100_000, help="Runs at each place; the same seeds for all.")] = 10,
    steps: StepsOfRuns = None,
    setting: Settings = None,
    jobs: Jobs = -1,
    out: Annotated[
        Path | None,
        typer.Option(help="For table and picture; by default results/reality_gap_MODEL, of all results/reality_gap."),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Turn a dial from ideal to imperfect robots, draw what a model scores; go on where a call was interrupted."""
    if model is not None:
        check_choice("model", model, model_names())
    work("reality_gap_commands").gap(
        model,
        setting or [],
        preset=preset,
        measure=measure,
        seeds=seeds,
        steps=steps,
        jobs=jobs,
        out=out,
        progress=not quiet,
    )


@study.command()
def picture(
    model: Model,
    *,
    kind: Annotated[str, typer.Option(help="stages, trace or ethogram.")] = "stages",
    steps: Annotated[
        str | None, typer.Option(metavar="A,B,...", help="Stages at these steps (0,1000,3000); else how many steps.")
    ] = None,
    robots: Annotated[int | None, typer.Option(min=1, help="Traces of, or ethogram of, so many.")] = None,
    setting: Settings = None,
    rng: Annotated[int, typer.Option(min=0, max=2**63 - 1, help="Seed; the same one gives the same picture.")] = 1,
    out: Annotated[Path | None, typer.Option(help="A .png file; by default results/MODEL_KIND.png.")] = None,
    quiet: Quiet = False,
) -> None:
    """Draw a run: its stages, where robots went, which layer drove them when."""
    check_choice("model", model, model_names())
    work("picture_commands").picture(
        model, setting or [], kind=kind, steps=steps, robots=robots, rng=rng, out=out, progress=not quiet
    )


@study.command()
def diagnose(
    model: Model,
    *,
    setting: Settings = None,
    steps: Annotated[int, typer.Option(min=1, max=MOST_KEPT, help="How many at most.")] = 2000,
    rng: Annotated[int, typer.Option(min=0, max=2**63 - 1, help="Seed; the same one gives the same run.")] = 1,
    quiet: Quiet = False,
) -> None:
    """Run a model; print where its robots got nowhere: turned to and fro, blocked each other, were stuck."""
    check_choice("model", model, model_names())
    work("diagnose_commands").diagnose(model, setting or [], steps=steps, rng=rng, progress=not quiet)


@study.command("reward-lab")
def reward_lab(
    *,
    rewards: Annotated[str, typer.Option(metavar="A,B,...", help="Of a, b and c.")] = "a,b,c",
    actions: Annotated[int, typer.Option(help="What robots can do: 4 or 8 actions.")] = 4,
    steps: Annotated[int, typer.Option(min=1, max=MOST_KEPT, help="How long 15 robots learn.")] = 20_000,
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Runs with each reward.")] = 1,
    rng: Annotated[int, typer.Option(min=0, max=2**31 - 1, help="The first seed.")] = 1,
    out: Folder = Path("results", "reward_lab"),
    quiet: Quiet = False,
) -> None:
    """Draw reward, learned values and choice over the distance ahead; measure where robots dither."""
    work("reward_commands").reward_lab(
        rewards=rewards, actions=actions, steps=steps, seeds=seeds, rng=rng, out=out, progress=not quiet
    )


@study.command()
def bench(
    *,
    quick: Annotated[bool, typer.Option("--quick", help="A few seconds, and rougher.")] = False,
    out: Folder = Path("results", "bench"),
) -> None:
    """Measure steps, beside targets and other simulators."""
    folder = check_writable(out)
    for line in work("bench", "experiments").report(folder, quick):
        print(line, flush=True)


@study.command("learn-bench")
def learn_bench(
    *,
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Each contestant is trained with so many.")] = 10,
    steps: Annotated[int, typer.Option(min=1, max=10_000_000, help="Of training, of 15 robots.")] = 33_000,
    evaluation_steps: Annotated[int, typer.Option(min=1, max=MOST_KEPT, help="On each map.")] = 5000,
    only: Annotated[str | None, typer.Option(metavar="'A;B;...'", help="Contestants; all by default.")] = None,
    jobs: Jobs = -1,
    out: Annotated[Path, typer.Option(help="Folder for tables and pictures.")] = Path("results", "learn_bench"),
    resume: Annotated[
        bool, typer.Option("--resume/--afresh", help="Whether to go on where an earlier call was interrupted.")
    ] = True,
    quiet: Quiet = False,
) -> None:
    """Train all learners, then measure them, frozen and still learning, also on maps they never saw."""
    work("learn_commands").bench(
        seeds=seeds,
        steps=steps,
        evaluation_steps=evaluation_steps,
        only=only,
        jobs=jobs,
        out=out,
        resume=resume,
        progress=not quiet,
    )


@study.command()
def reproduce(
    *,
    figure: Annotated[
        list[str] | None, typer.Option(metavar="NUMBER", help="Such as 8.3; may be repeated; else all of them.")
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="All of them, which is so anyway.")] = False,
    names: Annotated[bool, typer.Option("--list", help="Only list them.")] = False,
    out: Annotated[Path, typer.Option(help="Folder for pictures, tables and the runs, which are kept.")] = Path(
        "results", "reproduction"
    ),
    quick: Annotated[
        bool, typer.Option("--quick", help="Few seeds and short runs, in files of their own: to see that it works.")
    ] = False,
    jobs: Jobs = -1,
    report: Annotated[Path | None, typer.Option(metavar="FILE.md", help="Write a page of what came of them.")] = None,
    quiet: Quiet = False,
) -> None:
    """Make the thesis's results again, each with a verdict; go on where an earlier call was interrupted."""
    does = work("reproduce_commands")
    if every and figure:
        raise InvalidValueError("--all and --figure are given at once; leave one out")
    if names:
        does.list_figures()
        return
    does.reproduce(figure or [], out=out, quick=quick, jobs=jobs, report_to=report, progress=not quiet)
