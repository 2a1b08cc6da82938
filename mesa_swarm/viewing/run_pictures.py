"""Pictures of a run: its stages, the traces of robots, an ethogram. Each is one call."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, MaxNLocator, StrMethodFormatter

from mesa_swarm.analysis import layer_shares
from mesa_swarm.base.errors import InvalidValueError, check_count, shortened
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.robots.real_robots import Scale
from mesa_swarm.robots.snapshots import check_watched
from mesa_swarm.viewing.palette import LIGHT, layer_colour
from mesa_swarm.viewing.pictures import Shown, literal, world_figure
from mesa_swarm.viewing.scene import scene_of, step_text
from mesa_swarm.viewing.trails import reach, stride

MOST_TRACES = 8


def stages(
    model: EngineModel, steps: Sequence[int] = (0, 1000, 3000), *, perceived: bool = True, progress: bool = False
) -> Figure:
    """Run a model and return a figure of its world at each of these steps, side by side.

    Parameters
    ----------
    model : SwarmModel
        Steps that it has taken already cannot be shown.
    steps : sequence of int
        Ascending, none before the model's own.
    perceived : bool
        Whether to draw a grey line from each robot to where it perceives the centroid of those that it sees.
    progress : bool
        Whether to show a bar.

    Raises
    ------
    InvalidValueError
        If the steps are not ascending, or past.

    Examples
    --------
    >>> from mesa_swarm.model.gallery import find_model
    >>> len(stages(find_model("agglomeration")(n_robots=5, rng=1), steps=(0, 20)).axes)
    2
    """
    due = [check_count("step", step, minimum=model.steps) for step in steps]
    if not due or sorted(set(due)) != due:
        raise InvalidValueError(f"steps is {shortened(steps)}; expected ascending steps such as (0, 1000, 3000)")
    shown: dict[str, Shown] = {}
    for step in due:
        model.run(step - model.steps, progress)
        frame = frame_of(model, perceived=perceived)
        shown[f"{type(model).__name__}, {step_text(model.steps, model.scale)}"] = frame, scene_of(model)
    return world_figure(shown)


def trace(
    model: EngineModel, steps: int = 10_000, *, robots: int = 1, every: int = 5, progress: bool = False
) -> Figure:
    """Run a model and return a figure of where its first robots went, each from a square to where it is now.

    Parameters
    ----------
    model : SwarmModel
    steps : int
        From now on.
    robots : int
        How many, 1 to 8.
    every : int
        Steps from one point of a trace to the next, at least 1; fewer where a robot may go farther than its radius
        meanwhile, so that no trace crosses a wall that its robot did not cross.
    progress : bool
        Whether to show a bar.

    Examples
    --------
    >>> from mesa_swarm.model.gallery import find_model
    >>> figure = trace(find_model("collision_avoidance")(rng=1), steps=100)
    >>> figure.axes[0].get_title()
    'CollisionAvoidance, 100 steps'
    """
    count = check_count("robots", robots, minimum=1, maximum=MOST_TRACES)
    first, steps = model.steps, check_count("steps", steps, minimum=1)
    spared = min([check_count("every", every, minimum=1), *_strides(model)])
    places = _places(model, first + steps, spared, progress)
    figure = world_figure({f"{type(model).__name__}, {model.steps - first:,} steps": model})
    for row in range(min(count, len(model.swarm))):
        radius, speed = model.swarm.columns["radius"][row], model.swarm.columns["max_speed"][row]
        colour = LIGHT.series[row % len(LIGHT.series)]
        _draw_trace(figure.axes[0], places[:, row], colour, reach(radius, speed, spared))
    return figure


def _strides(model: EngineModel) -> list[int]:
    """Return how many steps may lie between two points of the trace of each robot, see `stride`."""
    radii, speeds = model.swarm.columns["radius"].tolist(), model.swarm.columns["max_speed"].tolist()
    return [stride(radius, speed) for radius, speed in zip(radii, speeds, strict=True)]


def _places(model: EngineModel, last: int, every: int, progress: bool) -> np.ndarray:
    """Run a model until a step; return the robots' positions at the start, every `every` steps, and at the end."""
    places = [model.swarm.position.copy()]
    with progress_bar(last - model.steps, "steps", progress) as bar:
        while model.steps < last and model.running:
            before = model.steps
            model.run(min(every, last - before))
            bar.update(model.steps - before)
            places.append(model.swarm.position.copy())
    return np.array(places)


def _draw_trace(axes: Axes, points: np.ndarray, colour: str, farthest: float) -> None:
    """Draw a trace, but for lines longer than a robot gets: it was put there."""
    lines = np.stack([points[:-1], points[1:]], axis=1)
    lines = lines[np.hypot(*(lines[:, 1] - lines[:, 0]).T) <= farthest]
    axes.add_collection(LineCollection(list(lines), colors=colour, linewidths=0.6, alpha=0.8, zorder=4.5))
    axes.plot(*points[0], "s", color=colour, markersize=4, zorder=4.6)


def ethogram(model: EngineModel, *, robots: int | None = None) -> Figure:
    """Return a figure of the layer that drove each robot in each step, from the snapshots of `model.watch()`.

    Above, a row a robot, named by its unique_id; below, the share of robots that each layer drives.

    Parameters
    ----------
    model : SwarmModel
    robots : int, optional
        Only the first ones, at least 1; all by default.

    Raises
    ------
    InvalidValueError
        If there are no snapshots, the column `layer` is missing, or there is no control.

    Examples
    --------
    >>> from mesa_swarm.model.gallery import find_model
    >>> model = find_model("collision_avoidance")(rng=1)
    >>> snapshots = model.watch(last=None)
    >>> [axes.get_ylabel() for axes in ethogram(model.run(50)).axes]
    ['robot', 'share of robots']
    """
    if model.control is None:
        raise InvalidValueError("model.control is None; set it before the steps to draw")
    snapshots = check_watched(model.watched, ("layer",), "draw", "watch(last=None)")
    if robots is not None:
        check_count("robots", robots, minimum=1)
    names = list(model.control.names)
    ids = [robot.unique_id for robot in model.swarm.agents[:robots]]
    return ethogram_figure(snapshots.steps, snapshots["layer"][:, :robots], names, ids, scale=model.scale)


def ethogram_figure(
    steps: np.ndarray,
    layer: np.ndarray,
    names: Sequence[str],
    ids: Sequence[int] | None = None,
    *,
    scale: Scale | None = None,
) -> Figure:
    """Return the figure of `ethogram` from plain arrays.

    Parameters
    ----------
    steps : ndarray, shape (k,)
    layer : int ndarray, shape (k, n)
        Index of the layer that drove each robot, -1 for none.
    names : sequence of str
        Of the layers.
    ids : sequence of int, optional
        Names of the robots, unique_id in `ethogram`; by default 1, 2, ...
    scale : Scale, optional
        With which the axis is in seconds.
    """
    if scale is not None:
        steps = scale.seconds(np.asarray(steps))
    n = layer.shape[1]
    colours = [layer_colour(k) for k in range(-1, len(names))]
    figure = Figure(figsize=(9.0, 2.6 + min(0.13 * n, 5.0)), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(max(1.0, min(0.13 * n, 5.0)), 1.2))
    edges = 2 * steps[0] - steps[1] if len(steps) > 1 else steps[0] - 1, steps[-1]
    above.imshow(
        layer.T + 1,
        cmap=ListedColormap(colours),
        vmin=-0.5,
        vmax=len(names) + 0.5,
        aspect="auto",
        interpolation="nearest",
        extent=(*edges, n + 0.5, 0.5),
    )
    above.set(ylabel="robot")
    _name_rows(above, range(1, n + 1) if ids is None else ids)
    shares = layer_shares(layer, len(names))
    # Each share is drawn from the step before to its own, the first one too.
    below.stackplot([edges[0], *steps], np.vstack([shares[:1], shares])[:, :-1].T, colors=colours[1:], step="pre")
    below.set(xlabel="step" if scale is None else "time (s)", ylabel="share of robots", xlim=edges, ylim=(0, 1))
    if scale is None:
        below.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    shown = [Patch(color=colour, label=literal(name)) for colour, name in zip(colours[1:], names, strict=True)]
    if (layer < 0).any():
        shown.append(Patch(color=LIGHT.no_layer, label="no layer: it stands"))
    figure.legend(handles=shown, loc="outside upper center", ncols=min(len(shown), 5), fontsize=9, frameon=False)
    return figure


def _name_rows(axes: Axes, ids: Sequence[int]) -> None:
    """Label the rows 1, 2, ... of an axis with ids, as many as there is room for."""

    def label(row: float, _: int | None) -> str:
        return str(ids[int(row) - 1]) if row == int(row) and 1 <= row <= len(ids) else ""

    axes.yaxis.set_major_locator(MaxNLocator(nbins="auto", integer=True, min_n_ticks=1))
    axes.yaxis.set_major_formatter(FuncFormatter(label))
