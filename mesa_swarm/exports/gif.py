"""Animated GIFs: one palette for all frames, and of each frame only what differs from the one before."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb
from PIL import GifImagePlugin, Image, ImageChops

from mesa_swarm.experiments import pictures
from mesa_swarm.experiments.files import draft_of
from mesa_swarm.exports.look import Look
from mesa_swarm.exports.portraits import Portraits
from mesa_swarm.exports.screen import EDGE, PAPER, Screen, film_frames
from mesa_swarm.exports.trails import TRAIL

END = b";"
KEEP = 1
# Colours that touch paper or ink get so many steps in between, for smooth edges.
BETWEEN = (0.25, 0.5, 0.75)


def export_gif(
    portraits: Portraits, path: Path, steps: Sequence[int], *, fps: float, look: Look, progress: bool
) -> None:
    """Write steps as an animated GIF that repeats, whole or not at all.

    Parameters
    ----------
    portraits : Portraits
    path : Path
    steps : sequence of int
        One a frame.
    fps : float
        Frames a second; the format rounds to hundredths of a second a frame.
    look : Look
    progress : bool
        Whether to show a bar.
    """
    screen = Screen(portraits, look)
    with draft_of(path) as draft, draft.open("wb") as file:
        for part in _parts(film_frames(screen, steps, progress), 10 * round(100 / fps)):
            file.write(part)


def _parts(frames: Iterator[np.ndarray], milliseconds: int) -> Iterator[bytes]:
    """Yield a GIF in pieces, so that no more than two frames are in memory."""
    colours = palette()
    last = None
    for pixels in frames:
        image = Image.fromarray(pixels[..., :3]).quantize(palette=colours, dither=Image.Dither.NONE)
        if last is None:
            yield from GifImagePlugin.getheader(image.copy(), info={"loop": 0})[0]
        box = _changed(last, image)
        yield from GifImagePlugin.getdata(image.crop(box), box[:2], duration=milliseconds, disposal=KEEP)
        last = image
    yield END


def _changed(last: Image.Image | None, image: Image.Image) -> tuple[int, int, int, int]:
    """Return the box in which an image differs from the last; a pixel where they are equal: frames have some."""
    if last is None:
        return (0, 0, *image.size)
    before, now = (Image.frombytes("L", image.size, shown.tobytes()) for shown in (last, image))
    return ImageChops.difference(before, now).getbbox() or (0, 0, 1, 1)


def palette() -> Image.Image:
    """Return the colours of all pictures, with some steps between them, as an image with 256 of them.

    Examples
    --------
    >>> palette().mode
    'P'
    """
    heat = [tuple(colour[:3]) for colour in pictures.TEMPERATURE(np.linspace(0, 1, 48))]
    flat = [pictures.COOL, pictures.HOT, pictures.FRONT, pictures.OBSTACLE, pictures.LOAD, pictures.MARK]
    flat += [pictures.OUT, pictures.SECTOR, TRAIL, EDGE, "#555555"]
    paper, ink = np.array(to_rgb(PAPER)), np.array(to_rgb(pictures.INK))
    mixed = [
        share * np.array(to_rgb(c)) + (1 - share) * ground for c in flat for share in BETWEEN for ground in (paper, ink)
    ]
    # Pillow takes the colour nearest to a small cube of them: greys near the paper would take its place.
    greys = [(grey, grey, grey) for grey in np.linspace(0, 0.88, 40)]
    cool, front, hot = (np.array(to_rgb(c)) for c in (pictures.COOL, pictures.FRONT, pictures.HOT))
    halves = [share * back + (1 - share) * front for back in (cool, hot) for share in BETWEEN]
    exact = [to_rgb(c) for c in (*flat, PAPER, pictures.INK)]
    table = np.rint(255 * np.array([*exact, *heat, *greys, *mixed, *halves])).astype(np.uint8)[:256]
    image = Image.new("P", (1, 1))
    image.putpalette(np.resize(table, (256, 3)).tobytes())
    return image
