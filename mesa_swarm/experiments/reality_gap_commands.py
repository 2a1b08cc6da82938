"""What the command reality-gap does with what was typed."""

from collections.abc import Sequence
from pathlib import Path

from mesa_swarm.experiments.files import check_writable
from mesa_swarm.experiments.reality_gap import reality_gap
from mesa_swarm.gallery import find_model
from mesa_swarm.parameters import parsed_settings


def gap(
    model: str,
    settings: Sequence[str],
    *,
    preset: str,
    measure: str | None,
    seeds: int,
    steps: int | None,
    jobs: int,
    out: Path | None,
    progress: bool,
) -> None:
    """Do all runs, write the picture and the table, and print the scores and the paths."""
    folder = check_writable(out or Path("results", f"reality_gap_{model}"))
    found = reality_gap(
        model,
        preset=preset,
        seeds=seeds,
        steps=steps,
        measure=measure,
        settings=parsed_settings(find_model(model), settings),
        jobs=jobs,
        progress=progress,
    )
    print("\n".join([found.table(), "", *map(str, found.save(folder))]))
