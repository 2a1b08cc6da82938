"""What a sector sees among discs that are scattered by chance, beside the void probability of a Boolean model."""

import math
from functools import cache

import numpy as np
import shapely
from matplotlib.figure import Figure

from mesa_swarm import Map, ProximitySensor, RobotDesign, SwarmModel, disc
from mesa_swarm.viewing import LIGHT
from mesa_swarm_studies.drawing import draw_means, plain_axes
from mesa_swarm_studies.judging import Result, judged_theory
from mesa_swarm_studies.laboratory import Laboratory, Numbers
from mesa_swarm_studies.registry import items_of_theory
from mesa_swarm_studies.theory.courses import apart

SEEDS = 20
ROBOTS, RADIUS, DISC = 400, 5.0, 5.0
RANGE, FIELDS_OF_VIEW = 50.0, (30.0, 40.0, 120.0, 300.0)
DENSITIES = (0.02, 0.05)
DISTANCES = (10.0, 20.0, 30.0, 40.0, 50.0)
JUDGED = (20.0, 50.0)
# Corners of arcs, and of a quarter of a circle: areas are too small by less than 1e-4.
CORNERS, QUARTER = 400, 64


@cache
def counted_area(distance: float, degrees: float) -> float:
    """Return the area of all centres of discs that a sector of this range meets, other than those within the robot.

    The sector grown by the discs' radius, less the disc around the robot in which no other disc has its centre.

    Examples
    --------
    >>> round(counted_area(50.0, 40.0))
    1535
    """
    half = math.radians(degrees) / 2.0
    arc = np.linspace(-half, half, CORNERS)
    corners = np.column_stack((RADIUS + distance * np.cos(arc), distance * np.sin(arc)))
    sector = shapely.Polygon([(RADIUS, 0.0), *corners])
    own = shapely.Point(0.0, 0.0).buffer(RADIUS + DISC, quad_segs=QUARTER)
    return float(sector.buffer(DISC, quad_segs=QUARTER).difference(own).area)


def seen(distance: float, degrees: float, density: float) -> float:
    """Return the probability that a sensor reads at most a distance."""
    return 1.0 - math.exp(-density / (math.pi * DISC**2) * counted_area(distance, degrees))


def look_run(rng: int, *, density: float, robots: int = ROBOTS) -> Numbers:
    """Return the share of robots that read at most each of `DISTANCES`, by field of view.

    Each robot has its own part of the world, so large that it sees no disc of another part, with a Poisson number of
    discs that may overlap each other but not the robot.
    """
    chance = np.random.default_rng(rng)
    places, width = apart(robots, reach=RADIUS + RANGE + 2.0 * DISC)
    discs = [
        disc(tuple(centre), DISC) for place in places for centre in place + scattered(chance, density, places[0, 0])
    ]
    world = Map(name="scattered discs", bounds=(0.0, 0.0, width, width), obstacles=tuple(discs))
    model = SwarmModel(map=world, rng=rng)
    sensors = [ProximitySensor(range=RANGE, field_of_view_degrees=view) for view in FIELDS_OF_VIEW]
    heading = chance.uniform(-math.pi, math.pi, robots)
    model.add_robots(
        RobotDesign(name="looking", radius=RADIUS, sensors=tuple(sensors)), poses=np.column_stack((places, heading))
    )
    model.sense()
    reading = model.swarm.distance
    return {
        "shares": [
            [float(((reading[:, s] >= 0) & (reading[:, s] <= most)).mean()) for most in DISTANCES]
            for s in range(len(sensors))
        ]
    }


def scattered(chance: np.random.Generator, density: float, half: float) -> np.ndarray:
    """Return centres of discs in a square of this half side around a robot, shape (n, 2)."""
    number = chance.poisson(density * (2.0 * half) ** 2 / (math.pi * DISC**2))
    centres = chance.uniform(-half, half, (number, 2))
    return centres[np.hypot(*centres.T) > RADIUS + DISC]


def hits(laboratory: Laboratory) -> Result:
    """Measure the probability that a sector meets a disc."""
    points = [{"density": density} for density in DENSITIES]
    made = dict(zip(DENSITIES, laboratory.grid(look_run, points, laboratory.fresh_seeds(SEEDS)), strict=True))
    checks = [
        judged_theory(
            f"probability of a reading of at most {most:g}: field of view {view:g} degrees, density {density:g}",
            seen(most, view, density),
            [row["shares"][s][DISTANCES.index(most)] for row in rows],
            within=0.2 if most < RANGE else 0.1,
        )
        for density, rows in made.items()
        for s, view in enumerate(FIELDS_OF_VIEW)
        for most in JUDGED
    ]
    return Result(
        checks=tuple(checks),
        pictures={"": hit_figure(made)},
        settings=(
            f"{ROBOTS} robots of radius {RADIUS:g}, far from each other, among fixed discs of radius {DISC:g} that "
            "may overlap each other; "
            f"sensors on the rim, ahead, of range {RANGE:g}; {SEEDS} seeds, each a new world"
        ),
        remarks=(
            "The four sensors of a robot look at the same discs, so that the checks of one density are correlated.",
            "Among robots, which never overlap each other, the formula is the limit of a low density.",
        ),
    )


def hit_figure(made: dict[float, list[dict]]) -> Figure:
    """Return a figure of the distribution of readings at the lower density, by field of view."""
    density = DENSITIES[0]
    figure, axes = plain_axes("distance", f"share of readings of at most that, density {density:g}")
    fine = np.linspace(1.0, RANGE, 40)
    for s, view in enumerate(FIELDS_OF_VIEW):
        axes.plot(fine, [seen(x, view, density) for x in fine], color=LIGHT.soft, linewidth=1.2, zorder=0)
        measured = [[row["shares"][s][i] for row in made[density]] for i in range(len(DISTANCES))]
        draw_means(axes, DISTANCES, measured, f"field of view {view:g} degrees", s, joined=False)
    axes.plot([], [], color=LIGHT.soft, linewidth=1.2, label="theory")
    axes.set_ylim(0.0, 1.0)
    axes.legend(frameon=False)
    return figure


ITEMS = items_of_theory(sector_hits=hits)
