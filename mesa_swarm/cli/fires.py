"""Policies that were learned at fires: fire-policies."""

from pathlib import Path
from typing import Annotated

import typer

from mesa_swarm.cli.options import MOST_STORED, Folder, Jobs, Quiet
from mesa_swarm.files import check_writable, write_all

commands = typer.Typer()


@commands.command("fire-policies")
def fire_policies(
    *,
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Trainings, each with an unseen map.")] = 30,
    skill_steps: Annotated[int, typer.Option(min=10, max=10_000_000, help="Of training of skills.")] = 60_000,
    wheel_steps: Annotated[int, typer.Option(min=10, max=10_000_000, help="Of training of wheel actions.")] = 30_000,
    steps: Annotated[int, typer.Option(min=10, max=MOST_STORED, help="On the unseen map.")] = 8000,
    only: Annotated[str | None, typer.Option(metavar="'A;B;...'", help="Contenders; all by default.")] = None,
    jobs: Jobs = -1,
    out: Folder = Path("results", "fire_policies"),
    quiet: Quiet = False,
) -> None:
    """Train policies at fires, freeze them, and compare them with strategies A and B on maps they never saw."""
    from mesa_swarm.experiments import fire_policies as trials
    from mesa_swarm.experiments.tables import csv_text

    folder = check_writable(out)
    chosen = tuple(name.strip() for name in only.split(";")) if only else ()
    trial = trials.FireTrial(skill_steps=skill_steps, wheel_steps=wheel_steps, steps=steps)
    results = trials.fire_policies(seeds, trial=trial, only=chosen, jobs=jobs)
    table = trials.fire_table(results)
    rows: list[tuple] = [("contender", "seed", *trials.MEASURES)]
    rows += [(name, seed, *run.values()) for name, runs in results.items() for seed, run in enumerate(runs, 1)]
    written = write_all(folder, {"fire_policies.md": f"{table}\n", "fire_policies.csv": csv_text(rows)})
    print("\n".join([table, *map(str, written)] if not quiet else [table]))
