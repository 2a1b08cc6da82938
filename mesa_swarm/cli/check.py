"""What does not work: diagnose."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from mesa_swarm.cli.lines import print_lines
from mesa_swarm.cli.options import (
    MOST_STORED,
    Model,
    Quiet,
    Seed,
    Settings,
    built_model,
    prepare,
    print_pairs,
)

if TYPE_CHECKING:
    from mesa_swarm.analysis.pathology import Pathologies

MOST_EPISODES = 20

commands = typer.Typer()


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
