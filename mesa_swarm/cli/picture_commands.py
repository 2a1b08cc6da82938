"""What the command picture does with what was typed."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from mesa_swarm.errors import InvalidValueError, check_choice, check_count
from mesa_swarm.files import checked_file, write_whole
from mesa_swarm.gallery import find_model
from mesa_swarm.parameters import parsed_settings
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.pictures import png
from mesa_swarm.viewing.run_pictures import ethogram, stages, trace

KINDS = ("stages", "trace", "ethogram")
STEPS = {"stages": "0,1000,3000", "trace": "10000", "ethogram": "500"}
MOST_STEPS = 10_000_000


def picture(
    model: str,
    settings: Sequence[str],
    *,
    kind: str,
    steps: str | None,
    robots: int | None,
    rng: int,
    out: Path | None,
    progress: bool,
) -> None:
    """Run a model, write the picture, and print its path."""
    check_choice("kind", kind, KINDS)
    if robots is not None and kind == "stages":
        raise InvalidValueError(f"robots is {robots}; stages show all of them; leave it out, or ask for another kind")
    wanted = parsed_steps(STEPS[kind] if steps is None else steps, several=kind == "stages")
    path = checked_file(out or Path("results", f"{model}_{kind}.png"), ".png")
    model_class = find_model(model)
    built = model_class(**parsed_settings(model_class, settings), rng=rng)
    figure = drawn(built, kind, wanted, robots, progress)
    print(write_whole(path, png(figure)))


def drawn(model: SwarmModel, kind: str, steps: list[int], robots: int | None, progress: bool) -> Figure:
    """Return the figure of this kind of a model that is run for it."""
    if kind == "stages":
        return stages(model, steps, progress=progress)
    if kind == "trace":
        return trace(model, steps[0], robots=robots or 1, progress=progress)
    model.watch(last=None, columns=("layer",))
    return ethogram(model.run(check_count("steps", steps[0], minimum=1), progress), robots=robots)


def parsed_steps(text: str, several: bool) -> list[int]:
    """Return the steps that were typed with commas between them.

    Raises
    ------
    InvalidValueError
        If they are not whole numbers, or several where one is expected.

    Examples
    --------
    >>> parsed_steps("0, 1000", several=True)
    [0, 1000]
    """
    parts = text.split(",")
    whole = all(part.strip().isdecimal() and int(part) <= MOST_STEPS for part in parts)
    if not whole or (len(parts) > 1 and not several):
        expected = "steps such as 0,1000,3000" if several else "one number of steps"
        raise InvalidValueError(f"steps is {text!r:.60}; expected {expected}, at most {MOST_STEPS:,}")
    return [int(part) for part in parts]
