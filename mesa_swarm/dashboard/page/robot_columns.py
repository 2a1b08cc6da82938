"""Quantities that have one value a robot, of a model or of a recorded step, for histograms."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from mesa_swarm.dashboard.page.session import Session, custom_columns
from mesa_swarm.model.looks import VALUE, ColourMap, looks_of
from mesa_swarm.recording.frames import Frame
from mesa_swarm.recording.layout import is_table, robot_columns
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.swarm import COLUMNS, LASTING
from mesa_swarm.viewing.scene import Scene
from mesa_swarm.world.statics import ROBOT

SPEED = "map units/step"
# Columns that are measured as they are, with their units.
PLAIN = {"temperature": "", "heat": "", "max_speed": SPEED}
# Begins the names of columns that are no quantity: of looks, and of imperfect bodies.
INTERNAL = ("looks.", LASTING)
# A reading of more numbers has no histogram.
MOST_PARTS = 8
MOST_BINS, MOST_WHOLE = 20, 40
# Beyond this a half is lost beside a whole number, in the end.
LARGEST_WHOLE = 1e9
# Degrees of a bin of headings.
SECTOR = 15.0


@dataclass(frozen=True, slots=True, eq=False)
class Quantity:
    """What each robot has one value of.

    Parameters
    ----------
    name : str
    unit : str
        Empty without a known unit.
    measure : callable
        Returns the values, shape (n,), NaN where a robot has no value.
    is_direction : bool
        Whether it is in degrees from -180 to 180, where both ends are the same.
    """

    name: str
    unit: str
    measure: Callable[[], np.ndarray]
    is_direction: bool = False

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} ({self.unit})" if self.unit else self.name


@dataclass(frozen=True, slots=True, eq=False)
class RobotValues:
    """The quantities of all robots at one step, by name, and why others of the model are missing."""

    step: int
    quantities: dict[str, Quantity] = field(default_factory=dict)
    missing: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Bins:
    """A histogram: edges, shape (b + 1,), numbers of robots, shape (b,), and how many robots have no value."""

    edges: np.ndarray
    counts: np.ndarray
    without: int


def bin_values(values: np.ndarray, *, log: bool = False, is_direction: bool = False) -> Bins:
    """Return a histogram of the finite values; its counts sum to their number.

    Whole numbers of a small range have a bin each, directions bins of `SECTOR` degrees; logarithmic bins need values
    above 0.

    Examples
    --------
    >>> bins = bin_values(np.array([2.0, 3.0, 3.0, np.nan]))
    >>> bins.edges, bins.counts, bins.without
    (array([1.5, 2.5, 3.5]), array([1, 2]), 1)
    """
    finite = values[np.isfinite(values)].astype(float)
    edges = _edges(finite, log, is_direction)
    return Bins(edges, np.histogram(finite, edges)[0], len(values) - len(finite))


def _edges(numbers: np.ndarray, log: bool, is_direction: bool) -> np.ndarray:
    if not len(numbers):
        return np.array([0.0, 1.0])
    low, high = float(numbers.min()), float(numbers.max())
    if is_direction and low >= -180.0 and high <= 180.0:
        return np.arange(-180.0, 180.0 + SECTOR, SECTOR)
    is_whole = max(-low, high) < LARGEST_WHOLE and bool((numbers == np.rint(numbers)).all())
    if not log and is_whole and high - low < MOST_WHOLE:
        return np.arange(low - 0.5, high + 1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        edges = np.geomspace(low, high, MOST_BINS + 1) if log else np.linspace(low, high, MOST_BINS + 1)
    if np.isfinite(edges).all() and (np.diff(edges) > 0).all():
        return edges
    # All values are the same to the last digits, or farther apart than numbers reach.
    reach = max(abs(low), abs(high), 1.0) * 1e-3
    return np.array([low, high]) if high - low > reach else np.array([low - reach, high + reach])


def values_of_session(session: Session, *, at_present: bool = False) -> RobotValues:
    """Return the quantities of the robots of a session at the displayed step, or at the present one."""
    model, moment = session.model, session.past.shown
    if model is None or not len(model.swarm):
        return RobotValues(0)
    at_present = at_present or moment is None or session.past.is_present
    step = model.completed if at_present or moment is None else moment.step
    swarm, snapshots = model.swarm, model.watched
    is_stored = snapshots is not None and bool(len(snapshots)) and step in snapshots.steps
    columns = dict(robot_columns(model)) if step == model.completed else {}
    if is_stored and snapshots is not None:  # what the inspector shows; a robot may have been moved by hand since
        columns = {**columns, **snapshots.at(step), **{n: columns[n] for n in ("position", "heading") if n in columns}}
    if not columns:
        return RobotValues(step, missing=f"the values of robots at step {step:,} are no longer stored")
    designs, design = swarm.designs, swarm.columns["design"]
    names = custom_columns(model)
    quantities = quantities_in(columns, designs, design, reach_of(designs), names, has_fires=bool(len(model.fires)))
    since = f" since step {session.series.since:,}" if session.series.since else ""
    counts = session.series.collisions_of(model, step)
    if counts is not None:
        quantities["collisions so far"] = Quantity(f"collisions so far{since}", "steps", lambda: counts.astype(float))
    if step == model.completed and (swarm.battery_life > 0 or any(design.battery > 0 for design in designs)):
        quantities["battery"] = Quantity("battery", "share of a charge", lambda: swarm.battery)
    looks = looks_of(model)
    if looks is not None and isinstance(looks.column, ColourMap) and step == model.completed:
        label = looks.column.label
        by_looks = Quantity(label, "", lambda: np.ravel(looks.columns_of(model)[VALUE]).astype(float))
        quantities.setdefault(label, by_looks)
    return RobotValues(step, quantities, f"at step {step:,} it is not known; the present step has it")


def values_of_frame(frame: Frame, scene: Scene, counts: np.ndarray | None) -> RobotValues:
    """Return the quantities of the robots of a recorded step; `counts` are their collisions so far, if known."""
    columns = {name: column for name, column in frame.columns.items() if not is_table(name)}
    fires = len(frame.columns.get("fires", ()))
    designs, design = scene.designs, scene.design_of(frame.robots)
    reach = float(scene.world(frame.step)["reach"])
    quantities = quantities_in(columns, designs, design, reach, (), has_fires=bool(fires)) if len(frame.robots) else {}
    if counts is not None:
        quantities["collisions so far"] = Quantity("collisions so far", "steps", lambda: counts.astype(float))
    return RobotValues(frame.step, quantities, f"it was not recorded at step {frame.step:,}")


def reach_of(designs: Sequence[RobotDesign]) -> float:
    """Return the longest range of a proximity sensor, 1 without sensors: the same as a scene's."""
    return max((sensor.range for design in designs for sensor in design.proximity), default=0.0) or 1.0


def quantities_in(
    columns: Mapping[str, np.ndarray],
    designs: Sequence[RobotDesign],
    design: np.ndarray,
    reach: float,
    custom: Iterable[str],
    *,
    has_fires: bool,
) -> dict[str, Quantity]:
    """Return the quantities that columns of robots have, by name: usual ones first, then those of custom columns."""
    quantities = [*_usual(columns, designs, design, reach)]
    for name, unit in PLAIN.items():
        if name in columns and (has_fires or name not in ("temperature", "heat")):
            quantities += _parts(name, columns[name], unit)
    if has_fires or any(design.radiation for design in designs):
        quantities += _parts("radiation", columns["radiation"], "") if "radiation" in columns else []
    other = (name for name in columns if name not in COLUMNS and not name.startswith(INTERNAL))
    for name in dict.fromkeys((*custom, *other)):
        if name in columns:
            quantities += _parts(name, columns[name], "")
    return {quantity.name: quantity for quantity in quantities}


def _usual(
    columns: Mapping[str, np.ndarray], designs: Sequence[RobotDesign], design: np.ndarray, reach: float
) -> Iterable[Quantity]:
    if "heading" in columns:
        yield Quantity("heading", "degrees", lambda: np.degrees(columns["heading"].astype(float)), is_direction=True)
    if "command" in columns:
        yield Quantity("commanded speed", SPEED, lambda: commanded_speeds(columns["command"], designs, design))
    if "position" in columns:
        place = columns["position"].astype(float)
        yield Quantity("x", "map units", lambda: place[:, 0])
        yield Quantity("y", "map units", lambda: place[:, 1])
        yield Quantity("neighbours", f"robots within {reach:g} map units", lambda: neighbours(place, reach))
    if "distance" in columns and columns["distance"].shape[1]:
        yield Quantity("smallest distance reading", "map units", lambda: smallest(columns["distance"]))
    if "kind" in columns and columns["kind"].shape[1]:
        yield Quantity("sensors that see a robot", "", lambda: (columns["kind"] == ROBOT).sum(axis=1).astype(float))


def neighbours(place: np.ndarray, reach: float) -> np.ndarray:
    """Return how many other robots have their centres within reach of each."""
    tree = cKDTree(place)
    return np.asarray(tree.query_ball_point(place, reach, return_length=True), float) - 1.0


def smallest(distance: np.ndarray) -> np.ndarray:
    """Return the least reading of each robot, NaN where its sensors read nothing."""
    least = np.where(distance >= 0, distance.astype(float), np.inf).min(axis=1)
    return np.where(np.isfinite(least), least, np.nan)


def commanded_speeds(command: np.ndarray, designs: Sequence[RobotDesign], design: np.ndarray) -> np.ndarray:
    """Return the speed of the centre that each robot's last command asks for."""
    speeds = np.full(len(command), np.nan)
    for d, robot_design in enumerate(designs):
        rows = design == d
        if not rows.any() or command.shape[1] < robot_design.numbers:
            continue
        wheels = np.ascontiguousarray(command[rows, : robot_design.numbers], float)
        if robot_design.turns:
            speeds[rows] = np.abs(wheels.sum(axis=1)) / 2
        elif robot_design.turns is not None:
            speeds[rows] = np.hypot(*wheels.T)
        else:
            motion = np.zeros((len(wheels), 3))
            robot_design.drive.motion(wheels, np.full(len(wheels), robot_design.radius), motion)
            speeds[rows] = np.hypot(motion[:, 0], motion[:, 1])
    return speeds


def column_title(column: str) -> str:
    """Return a column's name in words; that of a memory begins with the index of its layer."""
    first, *rest = column.split(".")
    return f"{rest[0]} remembers {' '.join(rest[1:])}" if first.isdigit() and rest else " ".join((first, *rest))


def _parts(name: str, column: np.ndarray, unit: str) -> list[Quantity]:
    """Return the quantities of a column of numbers, one for each number that a robot has; parts are numbered from 1."""
    if column.dtype.kind not in "biuf" or not len(column) or not 0 < column.size // len(column) <= MOST_PARTS:
        return []
    flat, title = column.reshape(len(column), -1).T.astype(float), column_title(name).replace("_", " ")
    names = [title] if len(flat) == 1 else [f"{title} {k}" for k in range(1, len(flat) + 1)]
    return [Quantity(name, unit, partial(np.asarray, part)) for name, part in zip(names, flat, strict=True)]
