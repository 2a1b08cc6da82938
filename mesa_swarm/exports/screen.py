"""Frames of films as pixels: what stands is drawn once, what changes in each frame."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from mesa_swarm.experiments.pictures import INK, draw_what_changes, draw_what_stands, literal
from mesa_swarm.experiments.portrait import Portrait
from mesa_swarm.exports.look import CAPTION, MARGIN, Look, film_size
from mesa_swarm.exports.portraits import Portraits
from mesa_swarm.exports.trails import draw_trails
from mesa_swarm.progress import progress_bar

DOTS_PER_INCH = 100
PAPER, EDGE = "#ffffff", "#888888"


class Screen:
    """A canvas of the film's size on which its steps are drawn.

    Parameters
    ----------
    portraits : Portraits
    look : Look

    Attributes
    ----------
    size : (width, height)
        Pixels.
    """

    def __init__(self, portraits: Portraits, look: Look) -> None:
        self.size = look.size or film_size(portraits.scene.bounds)
        self._portraits, self._look = portraits, look
        width, height = self.size
        figure = Figure(figsize=(width / DOTS_PER_INCH, height / DOTS_PER_INCH), dpi=DOTS_PER_INCH, facecolor=PAPER)
        self._canvas = FigureCanvasAgg(figure)
        self._axes = self._world(figure)
        self._name, self._count, self._step = self._captions(figure)
        self._obstacles: tuple | None = None
        self._standing: list[Artist] = []
        self._behind: Any = None

    def show(self, step: int) -> np.ndarray:
        """Return a step as pixels, uint8 of shape (height, width, 4), valid until the next one is shown."""
        axes, portrait = self._axes, self._portraits.at(step)
        if portrait.obstacles is not self._obstacles:
            self._stand(portrait)
        self._canvas.restore_region(self._behind)
        standing = set(axes.get_children())
        draw_what_changes(axes, portrait, self._look.sectors)
        if self._look.trails:
            draw_trails(axes, self._portraits, step, self._look.trails)
        new = sorted((artist for artist in axes.get_children() if artist not in standing), key=lambda a: a.zorder)
        for artist in new:
            axes.draw_artist(artist)
            artist.remove()
        self._write_captions(portrait)
        return np.asarray(self._canvas.buffer_rgba())

    def _world(self, figure: Figure) -> Axes:
        width, height = self.size
        inner = max(1, width - 2 * MARGIN), max(1, height - 2 * MARGIN - CAPTION)
        axes = figure.add_axes((MARGIN / width, MARGIN / height, inner[0] / width, inner[1] / height))
        axes.set(xticks=[], yticks=[], xlabel="", ylabel="")
        for spine in axes.spines.values():
            spine.set(color=EDGE, linewidth=0.8)
        return axes

    def _stand(self, portrait: Portrait) -> None:
        """Draw what stands behind the next frames."""
        axes = self._axes
        for artist in self._standing:
            artist.remove()
        before = set(axes.get_children())
        draw_what_stands(axes, portrait)
        axes.set(xlabel="", ylabel="")
        self._standing = [artist for artist in axes.get_children() if artist not in before]
        self._canvas.draw()
        self._behind = self._canvas.copy_from_bbox(axes.figure.bbox)
        self._obstacles = portrait.obstacles

    def _captions(self, figure: Figure) -> list:
        y = 1 - (CAPTION + MARGIN) / 2 / self.size[1]
        places = {"left": 2 * MARGIN / self.size[0], "center": 0.5, "right": 1 - 2 * MARGIN / self.size[0]}
        size = max(6, min(10.5, self.size[0] / 50))
        return [
            figure.text(x, y, "", ha=side, va="center", size=size, color=INK, animated=True)
            for side, x in places.items()
        ]

    def _write_captions(self, portrait: Portrait) -> None:
        out = portrait.fires["out"]
        self._name.set_text(literal(self._portraits.scene.name))
        self._count.set_text(f"{out.sum()} of {len(out)} fires out" if len(out) else "")
        self._step.set_text(f"step {portrait.steps:,}")
        for text in (self._name, self._count, self._step):
            self._axes.draw_artist(text)


def film_frames(screen: Screen, steps: Sequence[int], progress: bool) -> Iterator[np.ndarray]:
    """Yield the pixels of steps, with a bar if wanted; each is valid until the next."""
    with progress_bar(len(steps), "frames", progress) as bar:
        for step in steps:
            yield screen.show(step)
            bar.update(1)
