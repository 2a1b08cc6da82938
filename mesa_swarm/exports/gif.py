"""Animated GIFs: one palette for all frames, and of each frame only what differs from the one before."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb
from PIL import GifImagePlugin, Image, ImageChops

from mesa_swarm.errors import ExportError
from mesa_swarm.experiments import pictures
from mesa_swarm.exports.look import Look
from mesa_swarm.exports.portraits import Portraits
from mesa_swarm.exports.screen import EDGE, PAPER, Screen, film_frames
from mesa_swarm.files import draft_of

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
    with draft_of(path, ExportError) as draft, draft.open("wb") as file:
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
    flat = [pictures.COOL, pictures.HOT, pictures.FRONT, pictures.OBSTACLE, pictures.LOAD, pictures.MARK]
    flat += [pictures.SECTOR, EDGE, "#555555"]
    paper, ink, front = (np.array(to_rgb(colour)) for colour in (PAPER, pictures.INK, pictures.FRONT))
    exact = [to_rgb(colour) for colour in (*flat, PAPER, pictures.INK, pictures.OUT)]
    heat = [colour[:3] for colour in pictures.TEMPERATURE(np.linspace(0, 1, 48))]
    # Pillow takes the colour nearest to a small cube of them: greys near the paper would take its place.
    greys = [(grey, grey, grey) for grey in np.linspace(0, 0.88, 40)]
    mixed = [_mixed(colour, ground) for colour in flat for ground in (paper, ink)]
    mixed += [_mixed(back, front) for back in (pictures.COOL, pictures.HOT)]
    table = np.rint(255 * np.concatenate([exact, heat, greys, *mixed])).astype(np.uint8)[:256]
    image = Image.new("P", (1, 1))
    image.putpalette(np.resize(table, (256, 3)).tobytes())
    return image


def _mixed(colour: str, ground: np.ndarray) -> np.ndarray:
    return np.array([share * np.array(to_rgb(colour)) + (1 - share) * ground for share in BETWEEN])
