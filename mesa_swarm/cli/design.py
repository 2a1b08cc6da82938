"""Automatic design: design, design-gap, diversity."""

from pathlib import Path
from typing import Annotated

import typer

from mesa_swarm.base.files import check_writable
from mesa_swarm.cli.options import MOST_STORED, Folder, Jobs, Quiet, Tables, print_files, print_study, resumable

commands = typer.Typer()

MissionName = Annotated[str, typer.Option("--mission", help="aggregation or avoidance.")]
Generations = Annotated[int, typer.Option(min=1, max=100_000, help="Of the search.")]
Population = Annotated[int, typer.Option(min=4, max=10_000, help="Candidates a generation.")]
Robots = Annotated[int, typer.Option(min=1, max=1000, help="In each run.")]
Steps = Annotated[int, typer.Option(min=1, max=MOST_STORED, help="Of each run.")]
FirstSeed = Annotated[int, typer.Option("--rng", min=0, max=2**31 - 1, help="Seed; of several designs the first.")]


@commands.command("design")
def design_command(
    *,
    mission: MissionName = "aggregation",
    robots: Robots = 12,
    steps: Steps = 400,
    states: Annotated[int, typer.Option(min=2, max=4, help="At most.")] = 4,
    transitions: Annotated[int, typer.Option(min=1, max=4, help="Out of each state, at most.")] = 4,
    generations: Generations = 40,
    population: Population = 20,
    rng: FirstSeed = 1,
    jobs: Jobs = 1,
    out: Folder = Path("results", "design"),
    table: Tables = None,
    quiet: Quiet = False,
) -> None:
    """Search for a state machine that does a mission; continue there after an interruption."""
    from mesa_swarm.searches.automatic_design import MachineSpace, Mission, design_machine
    from mesa_swarm.searches.design_gap import search_maps
    from mesa_swarm.viewing.machine_drawing import machine_figure
    from mesa_swarm.viewing.pictures import png

    with resumable(check_writable(out)):
        found = design_machine(
            Mission(name=mission, robots=robots, steps=steps),
            space=MachineSpace(states=states, transitions=transitions),
            maps=search_maps(),
            generations=generations,
            population=population,
            rng=rng,
            jobs=jobs,
            file=out / "search.json",
            progress=not quiet,
            tables=table or (),
        )
    print(f"{found.machine}\nmean score {found.worth:.4g} in the final trials")
    files: dict[str, str | bytes] = {
        "machine.txt": found.machine.text(),
        "machine.png": png(machine_figure(found.machine)),
    }
    print_files(out, files, table)


@commands.command("design-gap")
def design_gap_command(
    *,
    mission: MissionName = "aggregation",
    robots: Robots = 12,
    steps: Steps = 400,
    designs: Annotated[int, typer.Option(min=2, max=1000, help="Controllers of each kind.")] = 20,
    seeds: Annotated[int, typer.Option(min=1, max=1000, help="Runs of each at each place of the dial.")] = 30,
    generations: Generations = 20,
    population: Population = 12,
    preset: Annotated[str, typer.Option(help="measured or robotarium.")] = "measured",
    rng: FirstSeed = 101,
    jobs: Jobs = 1,
    out: Folder = Path("results", "design_gap"),
    table: Tables = None,
    quiet: Quiet = False,
) -> None:
    """Design state machines and networks for ideal robots, and compare what they lose on imperfect ones."""
    from mesa_swarm.experiments.run_tables import RunFiles, checked_forms
    from mesa_swarm.searches import design_gap as gaps
    from mesa_swarm.searches.automatic_design import Mission

    with resumable(check_writable(out)):
        gap = gaps.design_gap(
            Mission(name=mission, robots=robots, steps=steps),
            budget=gaps.Budget(generations=generations, population=population),
            designs=designs,
            seeds=seeds,
            preset=preset,
            rng=rng,
            jobs=jobs,
            out=out,
            progress=not quiet,
            tables=table or (),
        )
    print_study(gap, out, RunFiles(out, forms=checked_forms(table or ())).tables)


@commands.command("diversity")
def diversity_command(
    *,
    measures: Annotated[
        str, typer.Option(metavar="A,B", help="Two of coverage, speed, largest group.")
    ] = "coverage,largest group",
    robots: Robots = 10,
    steps: Steps = 400,
    cells: Annotated[int, typer.Option(min=2, max=200, help="Along each measure.")] = 20,
    generations: Generations = 40,
    rng: FirstSeed = 1,
    jobs: Jobs = 1,
    out: Folder = Path("results", "diversity"),
    table: Tables = None,
    quiet: Quiet = False,
) -> None:
    """Search for reflexes that behave differently (pyribs), and draw the best of each cell; continue there."""
    from mesa_swarm.searches.design_gap import search_maps
    from mesa_swarm.searches.diversity import behaviour_figure, diversify
    from mesa_swarm.searches.evolved_controllers import Trial
    from mesa_swarm.viewing.pictures import png

    with resumable(check_writable(out)):
        found = diversify(
            Trial(robots=robots, steps=steps, units=0, encoding="typed"),
            measures=[name.strip() for name in measures.split(",")],
            cells=cells,
            generations=generations,
            world=search_maps()[0],
            rng=rng,
            jobs=jobs,
            progress=not quiet,
            out=out,
            tables=table or (),
        )
    print(f"{found.filled:.1%} of the cells filled by {found.tried:,} controllers")
    files: dict[str, str | bytes] = {"diversity.csv": found.csv(), "diversity.png": png(behaviour_figure(found))}
    print_files(out, files, table)
    found.save(out / "diversity.json")
