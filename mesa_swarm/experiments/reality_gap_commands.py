"""What the command reality-gap does with what was typed."""

from collections.abc import Sequence
from pathlib import Path

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.experiments.files import check_writable, write_whole
from mesa_swarm.experiments.pictures import png
from mesa_swarm.experiments.reality_gap import gaps_figure, reality_gap
from mesa_swarm.gallery import find_model, model_names
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


def all_gaps(
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
    """Do so for every model, each in a folder of its own, and draw all pictures as one."""
    if settings or measure is not None:
        what = "--set" if settings else "--measure"
        raise InvalidValueError(f"{what} was given without a model; name the model that it is for")
    folder, found = check_writable(out or Path("results", "reality_gap")), []
    for model in model_names():
        found.append(reality_gap(model, preset=preset, seeds=seeds, steps=steps, jobs=jobs, progress=progress))
        print("\n".join([found[-1].table(), "", *map(str, found[-1].save(folder / model)), ""]))
    print(write_whole(folder / "reality_gap.png", png(gaps_figure(found))))
