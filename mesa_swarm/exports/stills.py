"""Stills: pictures of single steps, as PNG or SVG."""

import io
from collections.abc import Sequence
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from mesa_swarm.errors import ExportError
from mesa_swarm.experiments.pictures import DOTS_PER_INCH, png, world_figure
from mesa_swarm.exports.look import Look
from mesa_swarm.exports.portraits import Portraits
from mesa_swarm.exports.trails import draw_trails
from mesa_swarm.files import write_whole
from mesa_swarm.progress import progress_bar


def still_paths(path: Path, steps: Sequence[int], sheet: bool) -> dict[Path, list[int]]:
    """Return which steps each file shows: one file is named as it was asked for, several by their steps too.

    Examples
    --------
    >>> {str(name): shown for name, shown in still_paths(Path("out.png"), [0, 500], sheet=False).items()}
    {'out_0.png': [0], 'out_500.png': [500]}
    """
    if sheet or len(steps) == 1:
        return {path: list(steps)}
    return {path.with_name(f"{path.stem}_{step}{path.suffix}"): [step] for step in steps}


def export_stills(portraits: Portraits, files: dict[Path, list[int]], look: Look, progress: bool) -> None:
    """Draw the pictures, each of which is written whole.

    Parameters
    ----------
    portraits : Portraits
    files : dict
        Steps by path, see `still_paths`; an ending .svg gives vectors, any other a PNG.
    look : Look
    progress : bool
        Whether to show a bar.
    """
    with progress_bar(len(files), "pictures", progress) as bar:
        for path, steps in files.items():
            figure = still_figure(portraits, steps, look)
            write_whole(path, svg(figure) if path.suffix.lower() == ".svg" else png(figure), ExportError)
            bar.update(1)


def still_figure(portraits: Portraits, steps: Sequence[int], look: Look) -> Figure:
    """Return a figure of steps, side by side if they are several."""
    shown = {f"{portraits.scene.name}, step {step:,}": portraits.at(step) for step in steps}
    figure = world_figure(shown, look.sectors)
    if look.trails:
        for axes, step in zip(figure.axes, steps, strict=False):
            draw_trails(axes, portraits, step, look.trails)
    if look.size is not None:
        width, height = look.size
        figure.set_size_inches(width / DOTS_PER_INCH, height / DOTS_PER_INCH)
    return figure


def svg(figure: Figure) -> bytes:
    """Return a figure as SVG; the same figure gives the same bytes.

    Examples
    --------
    >>> svg(Figure(figsize=(1, 1)))[:5]
    b'<?xml'
    """
    file = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": "mesa_swarm"}):
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    return file.getvalue()
