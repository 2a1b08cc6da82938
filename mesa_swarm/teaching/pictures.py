"""Pictures as notebooks show them, for full or quick runs."""

import math
import os
from typing import TYPE_CHECKING, Any

from mesa_swarm.base.errors import InvalidValueError, check_number, shortened
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.viewing.pictures import png, world_figure
from mesa_swarm.viewing.scene import scene_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Set, it makes what notebooks show small: enough to see that every cell runs, too little to see what it is about.
VARIABLE = "MESA_SWARM_QUICK"


def sized(full: int, quick: int) -> int:
    """Return the full size of something, or the quick one where the environment asks for small runs.

    Parameters
    ----------
    full, quick : int
        Steps, seeds, robots: whatever takes time.

    Examples
    --------
    >>> sized(3_000, 30) in (3_000, 30)
    True
    """
    return quick if os.environ.get(VARIABLE, "") not in ("", "0") else full


class Picture:
    """A figure that a notebook shows; made by `picture`."""

    def __init__(self, figure: "Figure") -> None:
        self.figure = figure

    def __repr__(self) -> str:
        width, height = self.figure.get_size_inches()
        return f"<Picture of {width:.1f} x {height:.1f} inches>"

    def _repr_png_(self) -> bytes:
        """Return what Jupyter shows."""
        return png(self.figure)


def picture(
    *shown: Any,
    titles: tuple[str, ...] = (),
    sectors: bool = False,
    perceived: bool = False,
    around: Any = None,
    reach: float = 75.0,
) -> Picture:
    """Return a picture of one or more models side by side, as they are now, or of a figure.

    Parameters
    ----------
    *shown : SwarmModel, or one matplotlib Figure
        Such as `stages`, `trace` and `ethogram` return.
    titles : tuple of str
        Of the models; by default their classes and steps.
    sectors : bool
        Whether to show where the robots' sensors look.
    perceived : bool
        Whether to draw a line from each robot to where it perceives the centroid of those that it sees.
    around : robot or point, optional
        The centre of the part of each world that is shown, in which headings are visible; by default all is shown.
    reach : float
        From there to the edges of the picture, map units, above 0.

    Raises
    ------
    InvalidValueError
        If `around` is neither a robot nor a point, or `reach` is out of its range.

    Examples
    --------
    >>> from mesa_swarm import SwarmModel
    >>> picture(SwarmModel(rng=1), around=(100, 100), reach=50)._repr_png_()[1:4]
    b'PNG'
    """
    if len(shown) == 1 and hasattr(shown[0], "get_size_inches"):
        return Picture(_part_of(shown[0], around, reach))
    names = titles or [f"{type(model).__name__}, step {model.steps:,}" for model in shown]
    worlds = {
        name: (frame_of(model, perceived=perceived), scene_of(model)) for name, model in zip(names, shown, strict=True)
    }
    return Picture(_part_of(world_figure(worlds, sectors), around, reach))


def _part_of(figure: "Figure", around: Any, reach: float) -> "Figure":
    """Return a figure of worlds, each cut to the part around a robot or point, if one is given."""
    if around is None:
        return figure
    reach = check_number("reach", reach, above=0)
    try:
        x, y = (float(number) for number in getattr(around, "position", around))
    except (TypeError, ValueError):
        x = y = math.nan
    if not math.isfinite(x + y):
        raise InvalidValueError(f"around is {shortened(around)}; expected a robot or a point such as (100, 50)")
    for axes in figure.axes:
        axes.set(xlim=(x - reach, x + reach), ylim=(y - reach, y + reach))
    return figure
