"""What the command reality-gap does with what was typed."""

from collections.abc import Sequence
from pathlib import Path

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.experiments.reality_gap import gaps_figure, reality_gap
from mesa_swarm.files import check_writable, write_whole
from mesa_swarm.gallery import find_model, model_names
from mesa_swarm.parameters import parsed_settings
from mesa_swarm.viewing.pictures import png


def gap(
    model: str | None,
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
    """Do all runs of a model, or of all models, write pictures and tables, and print the scores and the paths."""
    if model is None and (settings or measure is not None):
        what = "--set" if settings else "--measure"
        raise InvalidValueError(f"{what} was given without a model; name the model that it is for")
    folder = check_writable(out or Path("results", f"reality_gap_{model}" if model else "reality_gap"))
    found = []
    for name in (model,) if model else model_names():
        given = parsed_settings(find_model(name), settings)
        home = folder if model else folder / name
        one = reality_gap(
            name,
            preset=preset,
            measure=measure,
            seeds=seeds,
            steps=steps,
            settings=given,
            jobs=jobs,
            progress=progress,
            out=home,
        )
        found.append(one)
        print("\n".join([one.table(), "", *map(str, one.save(home))]))
    if model is None:
        print(write_whole(folder / "reality_gap.png", png(gaps_figure(found))))
