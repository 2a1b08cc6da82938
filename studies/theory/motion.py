"""Wheels that slip, and walkers, beside closed forms: diffusion of headings and positions, and coverage."""

import math
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from mesa_swarm import Map, RobotDesign, SwarmModel
from mesa_swarm.analysis import coverage
from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.viewing import LIGHT
from mesa_swarm_studies.drawing import column, count_steps, draw_means, name_places, plain_axes
from mesa_swarm_studies.judging import Check, Result, judged_theory
from mesa_swarm_studies.laboratory import Laboratory, Numbers
from mesa_swarm_studies.registry import items_of_theory
from mesa_swarm_studies.theory.courses import Course, apart, torus

SEEDS = 20
# Walks are short, and vary more from run to run.
WALKS = 40
# Wheels: robots that drive straight on at speed 1 for a number of steps, looked at after some of them.
WHEELED, DRIVEN_STEPS = 400, 400
LOOKS = (1, 10, 30, 100, 200, 400)


class Slip(NamedTuple):
    """How wheels slip, and how far they are from the robot's centre."""

    probability: float
    magnitude: float
    radius: float

    @property
    def words(self) -> str:
        """The slip in words."""
        return f"probability {self.probability:g}, magnitude {self.magnitude:g}, radius {self.radius:g}"


SLIPS = (Slip(0.3, 1.0, 2.0), Slip(0.5, 0.5, 2.0), Slip(0.1, 0.5, 5.0))


def turn_of(slip: Slip) -> float:
    """Return by how much a robot turns in a step in which one of its wheels slips, rad."""
    return slip.magnitude / (2.0 * slip.radius)


def diffusion_of(slip: Slip) -> float:
    """Return the coefficient of rotational diffusion, rad^2 a step.

    Examples
    --------
    >>> round(diffusion_of(Slip(probability=0.5, magnitude=1.0, radius=5.0)), 6)
    0.0025
    """
    return slip.probability * (1.0 - slip.probability) * turn_of(slip) ** 2


def memory_of(slip: Slip) -> float:
    """Return the mean cosine of the turn of one step."""
    return 1.0 - 2.0 * slip.probability * (1.0 - slip.probability) * (1.0 - math.cos(turn_of(slip)))


def chords(slip: Slip) -> tuple[float, float]:
    """Return the mean displacement of a step along the heading before it, and the mean of its square."""
    p, s = slip.probability, slip.magnitude
    turned = (1.0 - s / 2.0) * np.sinc(turn_of(slip) / (2.0 * math.pi))
    both = p * p * (1.0 - s) + (1.0 - p) ** 2
    square = p * p * (1.0 - s) ** 2 + (1.0 - p) ** 2
    once = 2.0 * p * (1.0 - p)
    return both + once * turned * math.cos(turn_of(slip) / 2.0), square + once * turned**2


def cosine_after(slip: Slip, steps: int) -> float:
    """Return the mean cosine of the turn of a number of steps."""
    return memory_of(slip) ** steps


def square_after(slip: Slip, steps: int) -> float:
    """Return the mean squared displacement after a number of steps, exactly.

    Examples
    --------
    >>> square_after(Slip(probability=0.0, magnitude=1.0, radius=5.0), 20)
    400.0
    """
    (ahead, square), c = chords(slip), memory_of(slip)
    pairs = steps * (steps - 1) / 2 if c == 1.0 else steps / (1 - c) - (1 - c**steps) / (1 - c) ** 2
    return float(steps * square + 2.0 * ahead**2 * pairs)


def ahead_after(slip: Slip, steps: int) -> float:
    """Return the mean displacement along the first heading after a number of steps, exactly."""
    c = memory_of(slip)
    return chords(slip)[0] * (steps if c == 1.0 else (1.0 - c**steps) / (1.0 - c))


def drive_run(
    rng: int, *, probability: float, magnitude: float, radius: float, robots: int = WHEELED, steps: int = DRIVEN_STEPS
) -> Numbers:
    """Return means over robots on slipping wheels, after `LOOKS` steps: of the turn and of the displacement."""
    places, width = apart(robots, reach=steps + 2.0 * radius)
    model = SwarmModel(map=Map(name="plane", bounds=(0.0, 0.0, width, width)), rng=rng)
    wheels = RobotDesign(
        name="blind", radius=radius, sensors=(), slip_probability=probability, slip_magnitude=magnitude
    )
    first = np.random.default_rng(rng).uniform(-math.pi, math.pi, robots)
    model.add_robots(wheels, poses=np.column_stack((places, first)))
    model.control = Subsumption(Explore())
    turned, heading = np.zeros(robots), model.swarm.heading.copy()
    seen: list[tuple[np.ndarray, ...]] = []
    for step in range(1, steps + 1):
        model.step()
        # A step turns far less than half a circle, so that turns can be added up.
        turned += np.mod(model.swarm.heading - heading + math.pi, 2.0 * math.pi) - math.pi
        heading = model.swarm.heading.copy()
        if step in LOOKS:
            seen.append((turned.copy(), model.swarm.position - places))
    along = np.column_stack((np.cos(first), np.sin(first)))
    return {
        "looks": [step for step in LOOKS if step <= steps],
        "diffusion": float((turned**2).mean() / (2.0 * steps)),
        "cosine": [float(np.cos(turn).mean()) for turn, _ in seen],
        "square": [float((way**2).sum(axis=1).mean()) for _, way in seen],
        "ahead": [float((way * along).sum(axis=1).mean()) for _, way in seen],
    }


def drives(laboratory: Laboratory) -> dict[Slip, list[dict]]:
    """Return the runs of all wheels; two items use the same."""
    rows = laboratory.grid(drive_run, [slip._asdict() for slip in SLIPS], laboratory.fresh_seeds(SEEDS))
    return dict(zip(SLIPS, rows, strict=True))


def at_look(rows: list[dict], name: str, steps: int) -> list[float]:
    """Return a number of every run after a number of steps."""
    return [row[name][row["looks"].index(steps)] for row in rows]


WHEEL_SETTINGS = (
    f"{WHEELED} robots on wheels far from each other and from walls, both wheels at speed 1, for {DRIVEN_STEPS} steps; "
    f"{SEEDS} seeds; a run gives the mean over its robots"
)


def rotation(laboratory: Laboratory) -> Result:
    """Measure rotational diffusion."""
    made = drives(laboratory)
    diffusion = [
        judged_theory(
            f"rotational diffusion, rad^2 a step: {slip.words}",
            diffusion_of(slip),
            column(rows, "diffusion"),
            within=0.1,
        )
        for slip, rows in made.items()
    ]
    cosines = [
        judged_theory(
            f"mean cosine of the turn after {steps} steps: {slip.words}",
            cosine_after(slip, steps),
            at_look(rows, "cosine", steps),
            within=0.1,
        )
        for slip, rows in made.items()
        for steps in (10, 100)
    ]
    figure, axes = plain_axes("step", "mean cosine of the turn since the start")
    _draw_curves(axes, made, "cosine", cosine_after)
    axes.legend(frameon=False, fontsize=8)
    return Result(checks=(*diffusion, *cosines), pictures={"": figure}, settings=WHEEL_SETTINGS)


def displacement(laboratory: Laboratory) -> Result:
    """Measure the mean squared displacement."""
    made = drives(laboratory)
    squares = [
        judged_theory(
            f"mean squared displacement after {steps} steps: {slip.words}",
            square_after(slip, steps),
            at_look(rows, "square", steps),
            within=0.1,
        )
        for slip, rows in made.items()
        for steps in (10, 100, 400)
    ]
    ahead = [
        judged_theory(
            f"mean displacement along the first heading after {DRIVEN_STEPS} steps: {slip.words}",
            ahead_after(slip, DRIVEN_STEPS),
            at_look(rows, "ahead", DRIVEN_STEPS),
            within=0.15,
            main=False,
        )
        for slip, rows in made.items()
    ]
    figure, axes = plain_axes("step", "mean squared displacement, square units")
    _draw_curves(axes, made, "square", square_after)
    axes.set(xscale="log", yscale="log")
    axes.legend(frameon=False, fontsize=8)
    return Result(checks=(*squares, *ahead), pictures={"": figure}, settings=WHEEL_SETTINGS)


def _draw_curves(axes: Any, made: dict[Slip, list[dict]], name: str, theory: Any) -> None:
    fine = np.unique(np.geomspace(1, DRIVEN_STEPS, 100).astype(int))
    for i, (slip, rows) in enumerate(made.items()):
        axes.plot(fine, [theory(slip, int(t)) for t in fine], color=LIGHT.soft, linewidth=1.2, zorder=0)
        draw_means(axes, LOOKS, [at_look(rows, name, t) for t in LOOKS], slip.words, i, joined=False)
    axes.plot([], [], color=LIGHT.soft, linewidth=1.2, label="theory")
    count_steps(axes)


# Coverage: a torus of as many cells a side, of this size; a straight walker never comes back to a cell.
CELLS, CELL = 20, 10.0
SIDE = CELLS * CELL
STRAIGHT_STEPS = 100
HOPS = (25, 100)
SWARMS = (5, 20, 80)
FULL = 0.99


class LatticeWalk(Course):
    """Drive for `every` steps in one of the four directions of the axes, then draw the next."""

    name = "LatticeWalk"

    def __init__(self, *, every: int) -> None:
        self.every, self.step = every, 0

    def turn(self, azimuth: np.ndarray) -> None:
        """Draw a direction when it is due."""
        if self.step % self.every == 0:
            azimuth[:] = self._rng.integers(4, size=len(azimuth)) * (math.pi / 2.0)
        self.step += 1


def walk_run(rng: int, *, robots: int, straight: bool) -> Numbers:
    """Return the share of the cells that robots on a torus visited, after some steps."""
    chance = np.random.default_rng(rng)
    steps = STRAIGHT_STEPS if straight else round(max(HOPS) * CELL)
    places = (
        chance.uniform(0.0, SIDE, (robots, 2)) if straight else CELL * (chance.integers(CELLS, size=(robots, 2)) + 0.5)
    )
    layer = Course() if straight else LatticeWalk(every=round(CELL))
    model = torus(layer, places, side=SIDE, speed=1.0, steps=steps, rng=rng)
    start = model.swarm.position[None].copy()
    watched = model.watch(last=None, columns=("position",))
    model.run(steps)
    ways = np.concatenate([start, watched["position"]])
    looks = [STRAIGHT_STEPS] if straight else [round(hops * CELL) for hops in HOPS]
    cells = np.ones((CELLS, CELLS), bool)
    folded = np.mod(ways, SIDE)
    return {
        "covered": [coverage(folded[: look + 1], cells, (0.0, 0.0, SIDE, SIDE)) for look in looks],
    }


def straight_visit(steps: int, *, step: float = 1.0) -> float:
    """Return the probability that a walker that drives straight on is seen in a given cell.

    The cell grown backwards along the way, seen at whole steps only, relative to the torus: for a square of side a and
    the direction (x, y), a^2 + steps (a u (|x| + |y|) - u^2 |x y|), over all directions.

    Examples
    --------
    >>> straight_visit(0) == 1 / CELLS**2
    True
    """
    swept = steps * (4.0 * CELL * step / math.pi - step**2 / math.pi)
    return (CELL**2 + swept) / SIDE**2


@cache
def lattice_visit(hops: int) -> float:
    """Return the probability that a random walk on the lattice of the torus visits a given site.

    By renewal (Dvoretzky and Erdős 1951): of each visit of a site one is the last within the time, so that the sum over
    k of P(back after k hops) P(not back within the other hops) is 1; a new site is met with the second probability.

    Examples
    --------
    >>> lattice_visit(0) == 1 / CELLS**2, lattice_visit(1) == 2 / CELLS**2
    (True, True)
    """
    wave = np.cos(2.0 * math.pi * np.arange(CELLS) / CELLS)
    each = (wave[:, None] + wave[None, :]) / 2.0
    back = [float((each**k).mean()) for k in range(hops + 1)]
    never: list[float] = []
    for k in range(hops + 1):
        never.append(1.0 - sum(back[k - i] * never[i] for i in range(k)))
    return sum(never) / CELLS**2


def walks(laboratory: Laboratory) -> Result:
    """Measure the coverage of walkers that drive straight on, and of random walkers."""
    points = [{"robots": n, "straight": straight} for straight in (True, False) for n in SWARMS]
    rows = laboratory.grid(walk_run, points, laboratory.fresh_seeds(WALKS))
    made = {(point["straight"], point["robots"]): row for point, row in zip(points, rows, strict=True)}
    return Result(
        checks=(*straight_checks(made), *lattice_checks(made)),
        pictures={"": coverage_figure(made)},
        settings=(
            f"a torus of {CELLS} x {CELLS} cells of {CELL:g} units; robots at speed 1 from random places; straight on "
            f"for {STRAIGHT_STEPS} steps, or for {max(HOPS)} hops of {CELL:g} steps from cell to cell; {WALKS} seeds"
        ),
        remarks=(
            "Worlds have walls. For a torus each robot drives on a plane of its own, where it meets nothing, and its "
            "position is taken modulo the side; `analysis.coverage` counts cells of these positions.",
        ),
    )


def straight_checks(made: dict[tuple, list[dict]]) -> list[Check]:
    """Return the checks of walkers that drive straight on."""
    return [
        judged_theory(
            f"share of cells that {n} robots visit, straight on for {STRAIGHT_STEPS} steps",
            covered_by(n, straight_visit(STRAIGHT_STEPS)),
            [row["covered"][0] for row in made[True, n]],
            within=0.08,
        )
        for n in SWARMS
    ]


def lattice_checks(made: dict[tuple, list[dict]]) -> list[Check]:
    """Return the checks of random walkers."""
    return [
        judged_theory(
            f"share of cells that {n} random walkers visit in {hops} hops",
            covered_by(n, lattice_visit(hops)),
            [row["covered"][i] for row in made[False, n]],
            within=0.15,
        )
        for n in SWARMS
        for i, hops in enumerate(HOPS)
        # Where all cells are visited there is nothing to compare.
        if covered_by(n, lattice_visit(hops)) < FULL
    ]


def covered_by(robots: ArrayLike, visit: float) -> Any:
    """Return the share of cells that independent walkers visit in the mean, each a given one with a probability."""
    return 1.0 - (1.0 - visit) ** np.asarray(robots)


def coverage_figure(made: dict[tuple, list[dict]]) -> Figure:
    """Return a figure of coverage over the number of robots."""
    figure, axes = plain_axes("robots", "share of cells visited")
    fine = np.geomspace(SWARMS[0] / 1.3, SWARMS[-1] * 1.3, 100)
    curves = [
        (True, 0, straight_visit(STRAIGHT_STEPS), f"straight on, {STRAIGHT_STEPS} steps"),
        *((False, i, lattice_visit(hops), f"random walk, {hops} hops") for i, hops in enumerate(HOPS)),
    ]
    for place, (straight, i, visit, label) in enumerate(curves):
        axes.plot(fine, covered_by(fine, visit), color=LIGHT.soft, linewidth=1.2, zorder=0)
        measured = [[row["covered"][i] for row in made[straight, n]] for n in SWARMS]
        draw_means(axes, SWARMS, measured, label, place, joined=False)
    axes.plot([], [], color=LIGHT.soft, linewidth=1.2, label="theory")
    axes.set(xscale="log", ylim=(0.0, 1.03))
    name_places(axes, SWARMS)
    axes.legend(frameon=False)
    return figure


ITEMS = items_of_theory(rotational_diffusion=rotation, squared_displacement=displacement, walker_coverage=walks)
