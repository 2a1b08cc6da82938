"""Figures of one style, with axes that have no frame above and at the right, and the files that they become.

The same figure gives the same bytes.
"""

import io
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure, SubFigure

DOTS_PER_INCH = 200


def plain_figure(
    size: tuple[float, float], rows: int = 1, columns: int = 1, *, letters: float = 10, grid: bool = False, **more: Any
) -> tuple[Figure, np.ndarray]:
    """Return a figure with panels, see `plain_panels`.

    Parameters
    ----------
    size : (width, height)
        Inches.
    rows, columns : int
        Of panels.
    letters : float
        Size of the numbers at axes, points.
    grid : bool
        Whether faint lines cross the panels.
    **more
        As `matplotlib.figure.Figure.subplots` takes it.

    Examples
    --------
    >>> figure, ((left, right),) = plain_figure((8, 4), columns=2, sharey=True)
    >>> left.spines["top"].get_visible()
    False
    """
    figure = Figure(figsize=size, layout="constrained")
    return figure, plain_panels(figure, rows, columns, letters=letters, grid=grid, **more)


def plain_panels(
    figure: Figure | SubFigure, rows: int = 1, columns: int = 1, *, letters: float = 10, grid: bool = False, **more: Any
) -> np.ndarray:
    """Return panels in a figure or a part of it, an array of `Axes` of shape (rows, columns)."""
    panels = figure.subplots(rows, columns, squeeze=False, **more)
    for axes in panels.flat:
        make_plain(axes, letters, grid)
    return panels


def make_plain(axes: Axes, letters: float = 10, grid: bool = False) -> None:
    """Take the frame above and at the right away, and set the size of the numbers at the axes, points."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=letters)
    if grid:
        axes.grid(alpha=0.25)


def literal(text: str) -> str:
    """Return a text that Matplotlib shows as it is: between dollars it would parse mathematics."""
    return text.replace("$", "\\$")


def png(figure: Figure, dots_per_inch: float = DOTS_PER_INCH) -> bytes:
    """Return a figure as a PNG; the same figure gives the same bytes."""
    file = io.BytesIO()
    FigureCanvasAgg(figure)
    figure.savefig(file, format="png", dpi=dots_per_inch, metadata={"Software": None})
    return file.getvalue()


def svg(figure: Figure, *, words: bool = False) -> bytes:
    """Return a figure as SVG, its letters as outlines or as `words`; the same figure gives the same bytes."""
    file = io.BytesIO()
    FigureCanvasSVG(figure)
    with matplotlib.rc_context({"svg.hashsalt": "mesa_swarm", "svg.fonttype": "none" if words else "path"}):
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    return file.getvalue()
