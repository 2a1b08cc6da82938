"""Robots that learn: reward-lab, tune."""

from pathlib import Path
from typing import Annotated, Any

import typer

from mesa_swarm.cli.lines import print_lines, terminal_width
from mesa_swarm.cli.options import (
    MOST_STORED,
    Folder,
    Jobs,
    Quiet,
    Series,
    Tables,
    Until,
    print_files,
    print_study,
    resumable,
)

commands = typer.Typer()


@commands.command("reward-lab")
def reward_lab_command(
    *,
    rewards: Annotated[str, typer.Option(metavar="A,B,...", help="Of a, b and c.")] = "a,b,c",
    actions: Annotated[int, typer.Option(help="How many actions robots choose from: 4 or 8.")] = 8,
    critical: Annotated[float, typer.Option(help="Critical distance as a share of the range.")] = 0.08,
    steps: Annotated[int, typer.Option(min=1, max=MOST_STORED, help="How long 15 robots learn.")] = 20_000,
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Runs with each reward; the first is drawn.")] = 1,
    rng: Annotated[int, typer.Option(min=0, max=2**31 - 1, help="The first seed.")] = 1,
    jobs: Jobs = 1,
    out: Folder = Path("results", "reward_lab"),
    until: Until = None,
    series: Series = None,
    table: Tables = None,
    quiet: Quiet = False,
) -> None:
    """Draw reward, learned values and choice over the distance ahead; measure where robots oscillate."""
    from mesa_swarm.experiments.reward_study import reward_study

    with resumable(out):
        study = reward_study(
            [part.strip() for part in rewards.split(",")],
            actions=actions,
            critical=critical,
            steps=steps,
            seeds=seeds,
            rng=rng,
            jobs=jobs,
            progress=not quiet,
            out=out,
            until=until,
            series=series or False,
            tables=table or (),
        )
    print_study(study, out, study.files.stored)


@commands.command("tune")
def tune_command(
    *,
    steps: Annotated[int, typer.Option(min=1, max=MOST_STORED, help="In which collisions count.")] = 1_000,
    least_speed: Annotated[
        float | None,
        typer.Option(min=-1, max=1, help="Mean forward speed, share of the full one; by default the thesis's robots'."),
    ] = None,
    robots: Annotated[int, typer.Option(min=1, max=1000, help="How many learn together.")] = 15,
    generations: Annotated[int, typer.Option(min=1, max=10_000, help="Of CMA-ES.")] = 24,
    population: Annotated[int, typer.Option(min=4, max=1000, help="Candidates a generation.")] = 8,
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Runs of each candidate.")] = 6,
    judged: Annotated[int, typer.Option(min=2, max=1000, help="Runs with other seeds that judge the result.")] = 24,
    rng: Annotated[int, typer.Option(min=0, max=2**31 - 1, help="Seed of the search.")] = 1,
    jobs: Jobs = 1,
    out: Folder = Path("results", "tune"),
    table: Tables = None,
    quiet: Quiet = False,
) -> None:
    """Tune T and gamma of the Q-learner to few collisions at a speed, and compare; continue an interrupted call."""
    from mesa_swarm.experiments.tables import fitting
    from mesa_swarm.searches import tuning
    from mesa_swarm.searches.calibration import FRESH

    least_speed = tuning.LEAST_SPEED if least_speed is None else least_speed
    goal = tuning.LearningGoal(steps=steps, least_speed=least_speed, robots=robots)
    files: dict[str, Any] = {"jobs": jobs, "tables": table or ()}
    first = tuning.FIRST_SEED
    with resumable(out):
        tuned = tuning.tune(
            goal,
            generations=generations,
            population=population,
            seeds=range(first, first + seeds),
            rng=rng,
            progress=not quiet,
            out=out,
            **files,
        )
        print("\n".join(f"{name} = {value:.4g}" for name, value in tuned.settings.items()))
        judgement = tuning.comparison(tuned, seeds=range(1, judged + 1), out=out / FRESH, **files)
    print_lines([*fitting(judgement.table, terminal_width()), *judgement.remarks], 0)
    for folder in (out, out / FRESH):
        print_files(folder, {}, table)
