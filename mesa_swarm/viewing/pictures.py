"""Pictures of the world, and of single steps of a recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection, PatchCollection, PathCollection
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.legend import Legend
from matplotlib.legend_handler import HandlerBase
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle, Wedge
from matplotlib.path import Path as Outline
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import ExportError, InvalidValueError, check_count, shortened
from mesa_swarm.base.files import write_whole
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.geometry import Bounds
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.looks import LABEL_BYTES
from mesa_swarm.recording.frames import Frame, field_levels, frame_of
from mesa_swarm.robots.real_robots import Scale, length_unit
from mesa_swarm.robots.sensors import ProximitySensor, mount_of
from mesa_swarm.viewing.drawing import tracks
from mesa_swarm.viewing.figures import DOTS_PER_INCH, literal, png, svg
from mesa_swarm.viewing.final_state import FinalState
from mesa_swarm.viewing.legend import LegendEntry
from mesa_swarm.viewing.palette import LIGHT, MEANINGS, kind_colour, scalar_pixels
from mesa_swarm.viewing.recorded_steps import PicturedSteps
from mesa_swarm.viewing.scene import PART_OPACITY, USUAL, Painted, Scene, in_one_scale, looks_in, scene_of, step_text
from mesa_swarm.viewing.trails import reach, stride
from mesa_swarm.world.shapes import Shape

SMALLEST, LARGEST = 64, 4096
# Above the world of a film stands its name and step; around it is a margin.
CAPTION, MARGIN = 32, 4
# What can be drawn: a model as it is now, a stored final state, or a frame and the scene behind it.
Shown = EngineModel | FinalState | tuple[Frame, Scene]
# Points of a trail, from which on some are left out: films draw them in every frame.
MOST_POINTS = 60
# Around labels of robots, which may stand on fields and on other robots.
HALO = [withStroke(linewidth=1.6, foreground=LIGHT.ground)]


@dataclass(frozen=True, kw_only=True, slots=True)
class Look:
    """Options of a drawing."""

    size: tuple[int, int] | None = None  # width and height, pixels
    sectors: bool = False  # where the robots' proximity sensors look
    trails: int = 0  # over how many steps to show where robots were

    def __post_init__(self) -> None:
        """Check every value."""
        check_count("trails", self.trails)
        if self.size is None:
            return
        if isinstance(self.size, str) or len(self.size) != 2:
            raise InvalidValueError(f"size is {shortened(self.size)}; expected (width, height) such as (800, 600)")
        for name, length in zip(("width", "height"), self.size, strict=True):
            check_count(name, length, minimum=SMALLEST, maximum=LARGEST)


def film_size(bounds: Bounds) -> tuple[int, int]:
    """Return the pixels of a film that shows a world of these bounds, both even as films want them."""
    width, height = bounds[2] - bounds[0], bounds[3] - bounds[1]
    scale = USUAL / max(width, height)
    return _even(width * scale + 2 * MARGIN), _even(height * scale + 2 * MARGIN + CAPTION)


def _even(length: float) -> int:
    return max(SMALLEST, 2 * round(length / 2))


def parsed_size(text: str) -> tuple[int, int]:
    """Return a text such as 800x600 as (width, height)."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() and len(part) < 6 for part in parts):
        raise InvalidValueError(f"size is {text!r:.60}; expected WIDTHxHEIGHT such as 800x600")
    return int(parts[0]), int(parts[1])


def _tracks(drawn: PicturedSteps, step: int, length: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return recorded steps (k,) and positions (k, 2) of each robot of a step, in the last `length` steps up to it."""
    steps = drawn.steps[(drawn.steps >= step - length) & (drawn.steps <= step)]
    frames = [drawn.frame(number) for number in steps.tolist()]
    robots = frames[-1].robots
    if all(np.array_equal(frame.robots, robots) for frame in frames):
        return [(steps, track) for track in np.stack([frame["position"] for frame in frames], axis=1)]
    by_number = {track.number: track for track in tracks((frame.robots, frame["position"]) for frame in frames)}
    last = (by_number[robot] for robot in robots.tolist())
    return [(steps[track.present], track.values[track.present]) for track in last]


def _spared(drawn: PicturedSteps, ways: Sequence[tuple[np.ndarray, np.ndarray]]) -> int:
    """Return of how many points one is drawn: all of short trails, and of long ones as many as lines need."""
    designs = drawn.scene.designs[:-1] or drawn.scene.designs  # the last one is that of unknown robots
    longest = max((len(steps) for steps, _ in ways), default=1)
    return min(-(-longest // MOST_POINTS), *(stride(design.radius, design.max_speed) for design in designs))


def trail_parts(drawn: PicturedSteps, step: int, length: int) -> tuple[list[np.ndarray], np.ndarray]:
    """Return trails as lines (k, 2) through places of successive steps, and places (m, 2) between which it is unknown.

    Where a robot was put somewhere else, a line ends and another begins.
    """
    designs = drawn.scene.designs
    ways, lines, dots = _tracks(drawn, step, length), [], [np.empty((0, 2))]
    spared, kinds = _spared(drawn, ways), drawn.scene.design_of(drawn.frame(step).robots)
    for (steps, places), kind in zip(ways, kinds.tolist(), strict=True):
        gaps, way = np.diff(steps), np.hypot(*np.diff(places, axis=0).T)
        design = designs[kind]
        jumps = way > [reach(design.radius, design.max_speed, gap) for gap in gaps.tolist()]
        unknown = ~jumps & (gaps > 1)
        dots.append(places[np.append(unknown, False) | np.append(False, unknown)])
        parts = np.split(places, np.flatnonzero(jumps | unknown) + 1)
        lines += [np.vstack([part[:-1:spared], part[-1:]]) for part in parts if len(part) > 1]
    return lines, np.concatenate(dots)


def draw_trails(axes: Axes, drawn: PicturedSteps, step: int, length: int) -> None:
    """Draw trails as thin lines below the robots, and as dots where not every step was recorded."""
    lines, dots = trail_parts(drawn, step, length)
    axes.add_collection(LineCollection(lines, colors=LIGHT.trail, linewidths=0.8, zorder=4.5, label="trails"))
    if len(dots):
        axes.plot(*dots.T, ".", color=LIGHT.trail, markersize=3.4, markeredgewidth=0, zorder=4.5, label="places")


def trail_legend(drawn: PicturedSteps, steps: Sequence[int], length: int) -> list[Artist]:
    """Return the entry of a legend about dots, if trails of these steps have any."""
    recorded = drawn.steps[(drawn.steps >= min(steps) - length) & (drawn.steps <= max(steps))]
    if not length or (np.diff(recorded) == 1).all():
        return []
    return [Line2D([], [], color=LIGHT.trail, marker=".", linestyle="", label=MEANINGS["places"])]


def draw_world(shown: Shown, axes: Axes, sectors: bool = False) -> None:
    """Draw a world, everything to scale, y up.

    Fires go from black to red with their temperature and are pale once they are out; the front half of a
    robot is pale, its back blue, or orange while it is too hot to fight.
    """
    frame, scene = frame_and_scene(shown)
    draw_scene(axes, scene, frame.step)
    draw_frame(axes, frame, scene, sectors)


def frame_and_scene(shown: Shown) -> tuple[Frame, Scene]:
    """Return the frame and the scene of what is shown; a model's are those of now."""
    if isinstance(shown, tuple):
        return shown
    return (shown.frame, shown.scene) if isinstance(shown, FinalState) else (frame_of(shown), scene_of(shown))


def draw_scene(axes: Axes, scene: Scene, step: int) -> None:
    """Draw the ground, obstacles and marks of a step, which a film shows behind all its frames."""
    x_min, y_min, x_max, y_max = scene.bounds
    axes.set(xlim=(x_min, x_max), ylim=(y_min, y_max), aspect="equal", facecolor=LIGHT.ground)
    axes.set(xlabel="x (map units)", ylabel="y (map units)")
    if scene.scale is not None:
        _in_metres(axes, scene.scale, scene.bounds)
        _draw_ruler(axes, scene.scale, scene.bounds)
    for height, label in ((1, "marks"), (2, "obstacles")):
        chosen = [pair for pair in scene.standing(step) if pair[0].contact == (height == 2)]
        _draw_shapes(axes, chosen, height, label)


def _in_metres(axes: Axes, scale: Scale, bounds: Bounds) -> None:
    """Label the axes in metres, or another unit of length that suits the world."""
    x_min, y_min, x_max, y_max = bounds
    name, size = length_unit(scale.metres(max(x_max - x_min, y_max - y_min)) / 2)
    unit = size * scale.units_per_metre

    def number(at: float, _: int | None) -> str:
        return f"{round(at / unit, 6) + 0.0:g}"

    for axis, letter, low, high in ((axes.xaxis, "x", x_min, x_max), (axes.yaxis, "y", y_min, y_max)):
        marks = np.asarray(MaxNLocator(nbins=8, steps=[1, 2, 5, 10]).tick_values(low / unit, high / unit)) * unit
        axis.set_major_locator(FixedLocator(marks[(low <= marks) & (marks <= high)].tolist()))
        axis.set_major_formatter(FuncFormatter(number))
        axis.set_label_text(f"{letter} ({name})")


def _draw_ruler(axes: Axes, scale: Scale, bounds: Bounds) -> None:
    """Draw a scale bar at the lower left, above all else."""
    x_min, y_min, x_max, y_max = bounds
    length, text = scale.ruler(x_max - x_min)
    x, y = x_min + 0.04 * (x_max - x_min), y_min + 0.05 * (y_max - y_min)
    ends = Line2D([x, x + length], [y, y], marker="|", color=LIGHT.ink, linewidth=1.5, zorder=9, path_effects=HALO)
    axes.add_artist(ends)
    words = axes.text(x + length / 2, y, text, size=8, color=LIGHT.ink, ha="center", va="bottom", zorder=9)
    words.set(path_effects=HALO)


def draw_frame(axes: Axes, frame: Frame, scene: Scene, sectors: bool = False) -> None:
    """Draw fields, discs of parts, loads, fires and robots."""
    _draw_fields(axes, frame, scene)
    _draw_parts(axes, frame, scene)
    _draw_loads(axes, frame, scene)
    _draw_fires(axes, scene.fires(frame))
    if sectors:
        _draw_sectors(axes, frame, scene)
    _draw_robots(axes, scene.robots(frame))
    if "label" in scene.columns:
        _draw_labels(axes, frame, scene)
    if "perceived" in frame.columns:
        _draw_perceived(axes, frame)


def _draw_loads(axes: Axes, frame: Frame, scene: Scene) -> None:
    """Draw loads below robots, and small ones, which robots may carry, above."""
    loads = scene.loads(frame)
    rows = zip(loads.ids.tolist(), loads.poses.tolist(), loads.colours[:, 0].tolist(), strict=True)
    shapes = [(load in scene.small, scene.forms[load].shape_at(tuple(pose)), colour) for load, pose, colour in rows]
    for height, above in ((2, False), (8, True)):
        _draw_shapes(axes, [pair for is_small, *pair in shapes if is_small is above], height, "loads")


def _draw_fields(axes: Axes, frame: Frame, scene: Scene) -> None:
    """Draw fields below all else, a pixel a cell."""
    x_min, y_min, x_max, y_max = scene.bounds
    for place, name in enumerate(scene.fields):
        pixels = scalar_pixels(field_levels(frame, name), place)
        if not pixels.size:  # the field was not there then
            continue
        image = AxesImage(axes, extent=(x_min, x_max, y_min, y_max), origin="lower", interpolation="nearest")
        image.set_data(pixels)
        image.set(zorder=0.5, label="fields", clip_path=axes.patch)
        axes.add_image(image)


def _draw_parts(axes: Axes, frame: Frame, scene: Scene) -> None:
    """Draw what parts of the model's own show, on the ground and what stands on it."""
    discs = scene.discs(frame)
    if len(discs):
        colours = [scene.parts[place][1] for place in discs[:, 0].astype(int).tolist()]
        _add_discs(axes, discs[:, 1:3], discs[:, 3], to_rgba_array(colours, PART_OPACITY), colours, 2.5, label="parts")


def _draw_shapes(axes: Axes, shapes: Sequence[Sequence], height: int, label: str) -> None:
    """Draw shapes, each with its colour."""
    if shapes:
        outlines, colours = zip(*shapes, strict=True)
        paths = [_outline(shape) for shape in outlines]
        axes.add_collection(PathCollection(paths, facecolors=colours, linewidths=0, zorder=height, label=label))


def _outline(shape: Shape) -> Outline:
    """Return a shape as a path; its holes stay open."""
    if shape.is_disc:
        return Outline.circle((shape.geometry.x, shape.geometry.y), shape.radius)
    rings = [shape.geometry.exterior, *shape.geometry.interiors]
    # normal form turns holes the other way round than the outline, which leaves them unfilled
    return Outline.make_compound_path(*(Outline(shapely.get_coordinates(ring), closed=True) for ring in rings))


def _draw_fires(axes: Axes, fires: Painted) -> None:
    discs, rims, inks = fires.colours.T
    _add_discs(axes, fires.poses[:, :2], fires.radii, to_rgba_array(discs.tolist()), rims, 3, label="fires")
    for number, ((x, y, _), ink) in enumerate(zip(fires.poses.tolist(), inks, strict=True), start=1):
        axes.text(x, y, str(number), color=ink, size=7, ha="center", va="center", zorder=4, clip_on=True)


def _add_discs(
    axes: Axes, centres: np.ndarray, radii: np.ndarray, colours: ArrayLike, edge: ArrayLike, height: float, **more: Any
) -> None:
    """Draw discs to scale; the collection's sizes are in the units of the axes."""
    sizes = 2 * np.asarray(radii)
    discs = EllipseCollection(sizes, sizes, np.zeros(len(sizes)), units="xy", offsets=centres, **more)
    discs.set(offset_transform=axes.transData, facecolor=colours, edgecolor=edge, linewidth=0.6, zorder=height)
    axes.add_collection(discs)


def _draw_robots(axes: Axes, robots: Painted) -> None:
    if not len(robots.ids):
        return
    position, facing = robots.poses[:, :2], robots.poses[:, 2]
    _add_discs(axes, position, robots.radii, robots.colours[:, 0], LIGHT.robot_outline, 5, label="robots")
    ahead = robots.radii[:, None] * np.column_stack([np.cos(facing), np.sin(facing)])
    fronts = _half_discs(position, 0.92 * ahead)
    axes.add_collection(PathCollection(fronts, facecolors=LIGHT.robot_front, linewidths=0, zorder=6, label="fronts"))
    lines = np.stack([position, position + ahead], axis=1)
    axes.add_collection(LineCollection(list(lines), colors=LIGHT.robot_outline, linewidths=0.7, zorder=7))


def _draw_labels(axes: Axes, frame: Frame, scene: Scene) -> None:
    """Write a robot's text above it."""
    radius, texts = scene.radius_of(frame.robots), looks_in(frame, scene)[1]
    for (x, y), r, text in zip(frame["position"].tolist(), radius.tolist(), texts.tolist(), strict=True):
        if text:
            axes.annotate(
                literal(str(text)[:LABEL_BYTES]),
                (x, y + r),
                (0, 1.5),
                textcoords="offset points",
                ha="center",
                size=6,
                color=LIGHT.ink,
                zorder=8,
                annotation_clip=True,
                label="robot labels",
                path_effects=HALO,
            )


def _half_discs(position: np.ndarray, ahead: np.ndarray) -> list[Outline]:
    """Return half discs about positions, of the length of `ahead` and towards it; films have many of them."""
    half = Outline.wedge(-90, 90)
    left = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    vertices = np.asarray(half.vertices, float)
    x, y = vertices[:, :1], vertices[:, 1:]
    outlines = position[:, None] + x * ahead[:, None] + y * left[:, None]
    return [Outline(outline, half.codes) for outline in outlines]


def _draw_perceived(axes: Axes, frame: Frame) -> None:
    """Draw a grey line from each robot to where it perceives the centroid of those that it sees."""
    lines = np.stack([frame["position"], frame["perceived"]], axis=1)
    lines = lines[np.isfinite(lines).all(axis=(1, 2))]
    axes.add_collection(
        LineCollection(list(lines), colors=LIGHT.perceived, linewidths=0.9, zorder=4.6, label="perceived")
    )


def _draw_sectors(axes: Axes, frame: Frame, scene: Scene) -> None:
    poses = zip(frame["position"].astype(float), frame["heading"].astype(float), strict=True)
    designs = [scene.designs[place] for place in scene.design_of(frame.robots)]
    wedges = [
        _sector(sensor, position, heading, design.radius)
        for (position, heading), design in zip(poses, designs, strict=True)
        for sensor in design.proximity
    ]
    axes.add_collection(PatchCollection(wedges, facecolors=LIGHT.sector, linewidths=0, zorder=4, label="sectors"))


def _sector(sensor: ProximitySensor, position: np.ndarray, heading: float, radius: float) -> Wedge:
    x, y = mount_of(sensor, radius)
    cos, sin = np.cos(heading), np.sin(heading)
    centre = position[0] + cos * x - sin * y, position[1] + sin * x + cos * y
    axis, half = np.degrees(heading) + sensor.bearing_degrees, sensor.field_of_view_degrees / 2
    return Wedge(centre, sensor.range, axis - half, axis + half)


def legend_of(shown: Shown) -> list[Artist]:
    """Return the entries of a legend for what is drawn of a model, or of (Frame, Scene), and nothing else."""
    frame, scene = frame_and_scene(shown)
    entries: list[Artist] = [entry_artist(entry) for entry in scene.legend(frame)]
    if len(frame.robots) and "value" not in scene.columns:
        entries += [_robot_entry(MEANINGS["robot"], kind_colour(scene.looks, "robot", LIGHT.robot))]
    if np.isfinite(frame.columns.get("perceived", np.nan)).any():
        entries.append(Line2D([], [], color=LIGHT.perceived, label=MEANINGS["perceived"]))
    if frame["hot"].any():
        entries.append(_robot_entry(MEANINGS["robot_hot"], LIGHT.robot_hot))
    if len(frame.columns.get("fires", ())):
        entries.append(ColourBar(LIGHT.fire[::4], f"{MEANINGS['fire']} 0 to 1"))
        entries.append(Patch(facecolor=LIGHT.ashes, edgecolor=LIGHT.border, label=MEANINGS["ashes"]))
    return entries


class ColourBar(Patch):
    """The entry of a legend that shows colours from a least to a greatest value; `_ColourBarHandler` draws it."""

    def __init__(self, colours: Sequence[str], label: str) -> None:
        super().__init__(color=colours[-1], label=label)
        self.colours = tuple(colours)

    def get_path(self) -> Outline:
        """Return the outline of a unit square."""
        return Outline.unit_rectangle()


class _ColourBarHandler(HandlerBase):
    """Draws a `ColourBar`, twice as wide as other entries."""

    def legend_artist(self, legend: Any, orig_handle: Any, fontsize: float, handlebox: Any) -> Any:
        handlebox.width *= 2
        return super().legend_artist(legend, orig_handle, fontsize, handlebox)

    def create_artists(
        self, legend: Any, orig_handle: Any, xdescent: float, ydescent: float, width: float, height: float, *more: Any
    ) -> list[Artist]:
        colours, trans = orig_handle.colours, more[1]
        step = width / len(colours)
        slices = [
            Rectangle((k * step - xdescent, -ydescent), 1.05 * step, height, color=colour, linewidth=0, transform=trans)
            for k, colour in enumerate(colours)
        ]
        frame = Rectangle((-xdescent, -ydescent), width, height, fill=False, edgecolor=LIGHT.border, linewidth=0.5)
        frame.set_transform(trans)
        return [*slices, frame]


Legend.update_default_handler_map({ColourBar: _ColourBarHandler()})


def entry_artist(entry: LegendEntry) -> Artist:
    """Return an entry of a legend as Matplotlib takes it."""
    if entry.form == "body":
        return Patch(color=entry.light[0], label=literal(entry.label))
    return ColourBar(entry.light, literal(entry.text))


def _robot_entry(label: str, colour: str) -> Line2D:
    style: dict[str, Any] = {
        "marker": "o",
        "linestyle": "",
        "fillstyle": "left",
        "markersize": 8,
        "markeredgecolor": LIGHT.robot_outline,
    }
    return Line2D([], [], color=colour, markerfacecoloralt=LIGHT.robot_front, label=label, **style)


def world_figure(shown: Mapping[str, Shown], sectors: bool = False, more: Sequence[Artist] = ()) -> Figure:
    """Return a figure of worlds side by side, by title, with one legend for all, and more entries in it."""
    worlds = in_one_scale({title: frame_and_scene(source) for title, source in shown.items()})
    columns = min(len(worlds), 3)
    rows = -(-len(worlds) // columns)
    bounds = [scene.bounds for _, scene in worlds.values()]
    tallest = max((y_max - y_min) / (x_max - x_min) for x_min, y_min, x_max, y_max in bounds)
    height = min(4.9 * tallest, 12.0) + 0.8
    figure = Figure(figsize=(5.6 * columns, height * rows + 0.4), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, (title, world) in zip(grid, worlds.items(), strict=False):
        draw_world(world, axes, sectors)
        axes.set_title(literal(title), fontsize=11)
    for axes in grid[len(worlds) :]:
        axes.set_axis_off()
    listed = [entry for world in worlds.values() for entry in legend_of(world)]
    entries = {entry.get_label(): entry for entry in (*listed, *more)}
    figure.legend(
        handles=list(entries.values()),
        loc="outside lower center",
        ncols=4 if columns > 1 else 3,
        fontsize=8,
        frameon=False,
    )
    return figure


def still_paths(path: Path, steps: Sequence[int], sheet: bool) -> dict[Path, list[int]]:
    """Return which steps each file shows: a single file has the given name, several have their steps added.

    Steps have equally many digits, so that the names sort as the steps do.

    Examples
    --------
    >>> [file.name for file in still_paths(Path("run.png"), [0, 300], sheet=False)]
    ['run_000.png', 'run_300.png']
    """
    if sheet or len(steps) == 1:
        return {path: list(steps)}
    digits = len(str(max(steps)))
    return {path.with_name(f"{path.stem}_{step:0{digits}}{path.suffix}"): [step] for step in steps}


def export_stills(drawn: PicturedSteps, files: dict[Path, list[int]], look: Look, progress: bool) -> None:
    """Draw the pictures, each of which is written whole."""
    with progress_bar(len(files), "pictures", progress) as bar:
        for path, steps in files.items():
            figure = still_figure(drawn, steps, look)
            write_whole(path, svg(figure) if path.suffix.lower() == ".svg" else png(figure), ExportError)
            bar.update(1)


def still_figure(drawn: PicturedSteps, steps: Sequence[int], look: Look) -> Figure:
    """Return a figure of steps, side by side if they are several."""
    scene = drawn.scene
    shown = {f"{scene.name}, {step_text(step, scene.scale)}": (drawn.frame(step), scene) for step in steps}
    figure = world_figure(shown, look.sectors, trail_legend(drawn, steps, look.trails))
    if look.trails:
        for axes, step in zip(figure.axes, steps, strict=False):
            draw_trails(axes, drawn, step, look.trails)
    if look.size is not None:
        width, height = look.size
        figure.set_size_inches(width / DOTS_PER_INCH, height / DOTS_PER_INCH)
    return figure
