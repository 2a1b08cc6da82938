"""Films: MP4 and GIF from frames drawn as pixels."""

import math
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any, cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import GifImagePlugin, Image, ImageChops

from mesa_swarm.base.errors import ExportError, InvalidValueError
from mesa_swarm.base.extras import missing_package_line
from mesa_swarm.base.files import draft_of
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.recording.frames import NO_ROWS, Frame
from mesa_swarm.viewing.palette import LIGHT, rgb, scalar_pixels, value_colours
from mesa_swarm.viewing.pictures import (
    CAPTION,
    MARGIN,
    Look,
    draw_frame,
    draw_scene,
    draw_trails,
    entry_artist,
    film_size,
    literal,
    trail_legend,
)
from mesa_swarm.viewing.recorded_steps import PicturedSteps
from mesa_swarm.viewing.scene import Scene, peaks_of, scaled, step_text
from mesa_swarm.world.fields import LEVELS

DOTS_PER_INCH = 100
END = b";"
# Colours of fields in a GIF: for all of them, and of each of the first two where both are.
FIELD_SHADES = 64
TOGETHER = 8
# Of kinds of bodies and of values, which a GIF has exactly.
MOST_OWN = 24
# GIF: the next frame is drawn over this one.
IN_PLACE = 1
# Shares of a colour in the steps between it and paper or ink, for smooth edges.
BETWEEN = (0.25, 0.5, 0.75)
# yuv420p is the one that every player shows; faststart lets browsers begin before all is loaded.
ENCODING = ["-c:v", "libx264", "-preset", "veryfast", "-crf", "20", "-pix_fmt", "yuv420p"]
RAW = ["-f", "rawvideo", "-pix_fmt", "rgba"]
CONTAINER = ["-movflags", "+faststart", "-f", "mp4"]


class Screen:
    """A canvas of the film's size on which its steps are drawn."""

    def __init__(self, drawn: PicturedSteps, look: Look, last: int | None = None) -> None:
        """Prepare a film whose colours of fields are those of the last step, by default the last that was recorded."""
        self._drawn, self._look = drawn, look
        scene, frame = drawn.scene, drawn.frame(int(drawn.steps[-1]) if last is None else last)
        self._largest = peaks_of(frame, scene)
        width, height = self.size = look.size or film_size(scene.bounds)
        figure = Figure(
            figsize=(width / DOTS_PER_INCH, height / DOTS_PER_INCH), dpi=DOTS_PER_INCH, facecolor=LIGHT.field
        )
        self._canvas = FigureCanvasAgg(figure)
        entries = [*map(entry_artist, scene.own_legend(frame)), *trail_legend(drawn, drawn.steps.tolist(), look.trails)]
        self._strip = _write_legend(figure, self._canvas, entries)
        if look.size is None:  # the world is as large as without a legend
            self.size = width, height + self._strip
            figure.set_size_inches(self.size[0] / DOTS_PER_INCH, self.size[1] / DOTS_PER_INCH)
        self._axes = self._world(figure)
        self._name, self._count, self._step = self._captions(figure)
        self._obstacles: tuple | None = None
        self._standing: list[Artist] = []
        self._behind: Any = None

    def show(self, step: int) -> np.ndarray:
        """Return a step as pixels, uint8 of shape (height, width, 4), valid until the next one is shown."""
        axes, scene = self._axes, self._drawn.scene
        frame = scaled(self._drawn.frame(step), scene, self._largest)
        if scene.obstacles(step) is not self._obstacles:
            self._stand(scene, step)
        self._canvas.restore_region(self._behind)
        standing = set(axes.get_children())
        draw_frame(axes, frame, scene, self._look.sectors)
        if self._look.trails:
            draw_trails(axes, self._drawn, step, self._look.trails)
        new = [artist for artist in axes.get_children() if artist not in standing]
        new = sorted([*new, *(self._standing if scene.fields else [])], key=lambda artist: artist.zorder)
        for artist in new:
            axes.draw_artist(artist)
            if artist not in standing:
                artist.remove()
        self._write_captions(frame)
        return np.asarray(self._canvas.buffer_rgba())

    def _world(self, figure: Figure) -> Axes:
        width, height = self.size
        inner = max(1, width - 2 * MARGIN), max(1, height - 2 * MARGIN - CAPTION - self._strip)
        axes = figure.add_axes((MARGIN / width, (MARGIN + self._strip) / height, inner[0] / width, inner[1] / height))
        axes.set(xticks=[], yticks=[], xlabel="", ylabel="")
        for spine in axes.spines.values():
            spine.set(color=LIGHT.border, linewidth=0.8)
        return axes

    def _stand(self, scene: Scene, step: int) -> None:
        """Draw what stands behind the next frames."""
        axes = self._axes
        for artist in self._standing:
            artist.remove()
        before = set(axes.get_children())
        draw_scene(axes, scene, step)
        axes.set(xlabel="", ylabel="", xticks=[], yticks=[])  # with a scale they are in metres
        self._standing = [artist for artist in axes.get_children() if artist not in before]
        self._canvas.draw()
        self._behind = self._canvas.copy_from_bbox(axes.figure.bbox)
        self._obstacles = scene.obstacles(step)

    def _captions(self, figure: Figure) -> list:
        y = 1 - (CAPTION + MARGIN) / 2 / self.size[1]
        places = {"left": 2 * MARGIN / self.size[0], "center": 0.5, "right": 1 - 2 * MARGIN / self.size[0]}
        size = max(6, min(10.5, self.size[0] / 50))
        return [
            figure.text(x, y, "", ha=side, va="center", size=size, color=LIGHT.ink, animated=True)
            for side, x in places.items()
        ]

    def _write_captions(self, frame: Frame) -> None:
        out = frame.columns.get("fires", NO_ROWS["fires"])["out"]
        self._name.set_text(literal(self._drawn.scene.name))
        self._count.set_text(f"{out.sum()} of {len(out)} fires out" if len(out) else "")
        self._step.set_text(step_text(frame.step, self._drawn.scene.scale))
        for text in (self._name, self._count, self._step):
            self._axes.draw_artist(text)


def _write_legend(figure: Figure, canvas: FigureCanvasAgg, artists: Sequence[Artist]) -> int:
    """Write a legend at the foot of a figure, in as few rows as fit; return its height in pixels, an even number."""
    for columns in range(len(artists), 0, -1):
        legend = figure.legend(
            handles=artists,
            loc="lower center",
            bbox_to_anchor=(0.5, 0.0),
            ncols=columns,
            fontsize=8,
            frameon=False,
            borderpad=0.2,
            labelcolor=LIGHT.ink,
        )
        box = legend.get_window_extent(canvas.get_renderer())
        if box.width <= figure.bbox.width or columns == 1:
            return min(2 * math.ceil(box.height / 2), int(figure.bbox.height) // 2)
        legend.remove()
    return 0


def film_frames(screen: Screen, steps: Sequence[int], progress: bool) -> Iterator[np.ndarray]:
    """Yield the pixels of steps, with a bar if wanted; each is valid until the next."""
    with progress_bar(len(steps), "frames", progress) as bar:
        for step in steps:
            yield screen.show(step)
            bar.update(1)


def export_gif(
    drawn: PicturedSteps, path: Path, steps: Sequence[int], *, fps: float, look: Look, progress: bool
) -> None:
    """Write steps as an animated GIF that repeats, whole or not at all; frames last whole hundredths of a second."""
    screen = Screen(drawn, look, steps[-1])
    colours = palette(len(drawn.scene.fields), own_colours(drawn.scene))
    with draft_of(path, ExportError) as draft, draft.open("wb") as file:
        for part in _parts(film_frames(screen, steps, progress), 10 * round(100 / fps), colours):
            file.write(part)


def _parts(frames: Iterator[np.ndarray], milliseconds: int, colours: Image.Image) -> Iterator[bytes]:
    """Yield a GIF in pieces, so that no more than two frames are in memory."""
    last = None
    for pixels in frames:
        image = Image.fromarray(pixels[..., :3]).quantize(palette=colours, dither=Image.Dither.NONE)
        if last is None:
            yield from GifImagePlugin.getheader(image.copy(), info={"loop": 0})[0]
        box = _changed(last, image)
        yield from GifImagePlugin.getdata(image.crop(box), box[:2], duration=milliseconds, disposal=IN_PLACE)
        last = image
    yield END


def _changed(last: Image.Image | None, image: Image.Image) -> tuple[int, int, int, int]:
    """Return the box in which an image differs from the last; a pixel where they are equal: frames have some."""
    if last is None:
        return (0, 0, *image.size)
    before, now = (Image.frombytes("L", image.size, shown.tobytes()) for shown in (last, image))
    return ImageChops.difference(before, now).getbbox() or (0, 0, 1, 1)


def own_colours(scene: Scene) -> list[str]:
    """Return the colours that a model's looks give to kinds of bodies and to values of robots."""
    kinds = [pair[0] for pair in scene.looks.get("kinds", {}).values()]
    values = value_colours(scene.looks, "light") if "value" in scene.columns else ()
    return list(dict.fromkeys([*kinds, *values]))[:MOST_OWN]


def palette(fields: int = 0, own: Sequence[str] = ()) -> Image.Image:
    """Return the colours of all pictures, with some steps between them, as an image with 256 of them.

    With scalar fields, or colours of a model's own, there are fewer greys and colours of fires; shades of each field,
    and of the first two together, and these colours instead.
    """
    flat = [LIGHT.robot, LIGHT.robot_hot, LIGHT.robot_front, LIGHT.obstacle, LIGHT.load, LIGHT.mark]
    flat += [LIGHT.sector, LIGHT.border, LIGHT.robot_outline, LIGHT.fire_rim]
    more = bool(fields or own)
    ground, outline, front = rgb(LIGHT.ground), rgb(LIGHT.robot_outline), rgb(LIGHT.robot_front)
    exact = [rgb(colour) for colour in (*flat, LIGHT.ground, LIGHT.field, LIGHT.ink, LIGHT.ashes, *own)]
    heat = [rgb(colour) for colour in LIGHT.fire[:: 4 if more else 1]]
    # Pillow takes the colour nearest to a small cube of them: greys near the paper would take its place.
    greys = [(grey, grey, grey) for grey in np.linspace(0, 224, 8 if more else 40)]
    mixed = [_mixed(colour, other) for colour in flat for other in (ground, outline)]
    mixed += [_mixed(back, front) for back in (LIGHT.robot, LIGHT.robot_hot)]
    places = range(min(fields, len(LIGHT.scalars)))
    mixed += [_shades(place, ground, FIELD_SHADES // len(places)) for place in places]
    mixed += [_shades(1, colour, TOGETHER, 1.5) for colour in (_shades(0, ground, TOGETHER, 1.5) if fields > 1 else ())]
    table = np.rint(np.concatenate([exact, heat, greys, *mixed])).astype(np.uint8)[:256]
    image = Image.new("P", (1, 1))
    image.putpalette(np.resize(table, (256, 3)).tobytes())
    return image


def _shades(place: int, ground: np.ndarray, number: int, power: float = 1.0) -> np.ndarray:
    """Return colours of a field on the ground, from none to its largest value; more of faint ones with a power."""
    opaque = scalar_pixels(np.array([LEVELS]), place)[0] / 255
    shares = opaque[3] * np.linspace(0, 1, number + 1)[1:, None] ** power
    return ground + shares * (255 * opaque[:3] - ground)


def _mixed(colour: str, ground: np.ndarray) -> np.ndarray:
    return np.array([share * rgb(colour) + (1 - share) * ground for share in BETWEEN])


def export_film(
    drawn: PicturedSteps, path: Path, steps: Sequence[int], *, fps: float, look: Look, progress: bool
) -> None:
    """Write steps as a film, whole or not at all."""
    program = ffmpeg()
    check_even(look)
    screen = Screen(drawn, look, steps[-1])
    source = [*RAW, "-s", "{}x{}".format(*screen.size), "-r", f"{fps:g}", "-i", "-"]
    with draft_of(path, ExportError) as draft:
        command = [program, "-y", "-v", "error", *source, *ENCODING, *CONTAINER, str(draft)]
        _encode(command, film_frames(screen, steps, progress), path)


def ffmpeg() -> str:
    """Return the path of ffmpeg."""
    try:
        import imageio_ffmpeg  # noqa: PLC0415 - an extra, which only films need

        return imageio_ffmpeg.get_ffmpeg_exe()
    except (ModuleNotFoundError, RuntimeError):
        raise InvalidValueError(
            missing_package_line("films need", "imageio-ffmpeg", "video") + ", or export a .gif"
        ) from None


def check_even(look: Look) -> None:
    """Refuse sizes that H.264 cannot have."""
    if look.size is not None and any(length % 2 for length in look.size):
        width, height = look.size
        raise InvalidValueError(f"size is {width}x{height}; films need an even width and height")


def _encode(command: list[str], frames: Iterable[np.ndarray], path: Path) -> None:
    """Send frames to ffmpeg and wait for it; Ctrl-C reaches only this process, which then cleans up."""
    with TemporaryFile() as complaints:
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=complaints, start_new_session=True)
        try:
            _send(cast(IO[bytes], process.stdin), frames)  # which is a pipe
            status = process.wait()
        finally:
            process.kill()
            process.wait()
        if status:
            complaints.seek(0)
            reason = complaints.read(2000).decode(errors="replace").strip().splitlines() or [f"status {status}"]
            raise ExportError(f"{path} cannot be written: ffmpeg reports: {reason[-1]:.200}")


def _send(pipe: IO[bytes], frames: Iterable[np.ndarray]) -> None:
    try:
        with pipe:
            for pixels in frames:
                pipe.write(pixels.data)
    except BrokenPipeError:  # ffmpeg has ended; its status shows why
        return
