"""Blind robots beside the kinetic theory of hard discs: collisions, free paths, and time in contact, over densities."""

import math

import numpy as np
from matplotlib.figure import Figure

from mesa_swarm import Map, SwarmModel
from mesa_swarm.control import Subsumption
from mesa_swarm.experiments import mean_interval, with_limits
from mesa_swarm.viewing import LIGHT
from mesa_swarm_studies.drawing import column, draw_means, plain_axes
from mesa_swarm_studies.judging import Check, Result, judged_difference, judged_mean, judged_theory
from mesa_swarm_studies.laboratory import Laboratory, Numbers
from mesa_swarm_studies.registry import items_of_theory, table_of
from mesa_swarm_studies.theory.courses import Course, disc_robot

SEEDS = 20
ROBOTS, RADIUS = 400, 5.0
# Only robots farther from the walls than this, in radii, count: near walls discs stand in layers.
MARGIN = 8.0
# Collisions of a robot in a step: so few that a step is short beside the way between two collisions.
RATE = 0.003
SETTLING, STEPS = 1_000, 3_000
DENSITIES = (0.01, 0.05, 0.1, 0.2, 0.3, 0.4)
# Robots that keep their course on contact, at most so dense that a third robot hardly meets a pair; and a dense swarm.
DILUTE, DENSE = (0.005, 0.01), 0.1
# Slower robots move less in a step: the time in contact is a whole number of steps.
DILUTE_SPEED, DENSE_SPEED, DENSE_STEPS = 0.5, 1.0, 1_000
# The unit of paths: collisions are counted over this number of diameters.
WAY = 100
# The code of robots in `swarm.contact_kind`: their place in `model.kinds`.
ROBOT = 1


class Rebound(Course):
    """Robots that leave walls, and each other if `robots`, in random directions.

    From a wall by Lambert's law: the sine from the normal is uniform. Two robots leave each other in directions a, b
    that are drawn with a density proportional to the speed of separation, (e(a) - e(b)) . n for unit vectors e and the
    normal n between them. Both laws leave a gas in equilibrium as it is: uniform places and directions.
    """

    name = "Rebound"

    def __init__(self, *, robots: bool) -> None:
        self.robots = robots

    def turn(self, azimuth: np.ndarray) -> None:
        """Draw new azimuths for the robots that collided in the last step."""
        swarm, done = self._swarm, set()
        normal = np.arctan2(swarm.contact_normal[:, 1], swarm.contact_normal[:, 0])
        for i in np.flatnonzero(swarm.collided).tolist():
            j = int(swarm.contact_index[i])
            if swarm.contact_kind[i] != ROBOT:
                azimuth[i] = normal[i] + math.asin(self._rng.uniform(-1.0, 1.0))
            elif self.robots and i not in done:
                azimuth[i], other = self._parting(normal[i])
                # The deepest contact of the other may be another robot, with which it then parts.
                if swarm.contact_kind[j] == ROBOT and swarm.contact_index[j] == i:
                    azimuth[j] = other
                    done.add(j)

    def _parting(self, normal: float) -> tuple[float, float]:
        while True:
            first, second = self._rng.uniform(-math.pi, math.pi, 2).tolist()
            if 2.0 * self._rng.random() < math.cos(first - normal) - math.cos(second - normal):
                return first, second


def contact_value(density: float) -> float:
    """Return g, by how much more often than in an ideal gas hard discs touch, at a share of area (Henderson 1975).

    Examples
    --------
    >>> round(contact_value(0.3), 3)
    1.773
    """
    return (1.0 - 7.0 * density / 16.0) / (1.0 - density) ** 2


def collisions_in_theory(density: float) -> float:
    """Return the collisions of a robot over `WAY` diameters: 8 d n g / pi over a unit, n = 4 density / (pi d^2).

    Examples
    --------
    >>> round(collisions_in_theory(0.01), 3)
    3.294
    """
    return WAY * 32.0 * density * contact_value(density) / math.pi**2


def in_contact(density: float) -> float:
    """Return the share of time for which a robot that keeps its course is in contact with others.

    Examples
    --------
    >>> round(in_contact(0.01), 4)
    0.0392
    """
    return 1.0 - math.exp(-4.0 * density)


def speed_at(density: float) -> float:
    """Return the speed at which a robot has `RATE` collisions in a step, at most 1."""
    return min(1.0, RATE * WAY * 2.0 * RADIUS / collisions_in_theory(density))


def gas(rng: int, density: float, robots: int, speed: float, rebound: bool) -> tuple[SwarmModel, float]:
    """Return blind robots in a square box, and its side."""
    side = RADIUS * math.sqrt(robots * math.pi / density)
    model = SwarmModel(map=Map(name="box", bounds=(0.0, 0.0, side, side)), rng=rng)
    model.add_robots(disc_robot(radius=RADIUS, speed=speed), robots)
    model.control = Subsumption(Rebound(robots=rebound))
    return model.run(0), side


def gas_run(
    rng: int,
    *,
    density: float,
    rebound: bool,
    speed: float,
    robots: int = ROBOTS,
    settling: int = SETTLING,
    steps: int = STEPS,
) -> Numbers:
    """Return the density, and collisions, meetings and steps in contact of robots far from walls."""
    model, side = gas(rng, density, robots, speed, rebound)
    model.run(settling)
    near, far = MARGIN * RADIUS, side - MARGIN * RADIUS
    before = partners(model)
    count = np.zeros(3)
    for _ in range(steps):
        counted = ((model.swarm.position > near) & (model.swarm.position < far)).all(axis=1)
        model.step()
        now = partners(model)
        touching = counted & (now >= 0)
        count += counted.sum(), touching.sum(), (touching & (now != before)).sum()
        before = now
    inside, contacts, meetings = count.tolist()
    here = inside / steps * math.pi * RADIUS**2 / (far - near) ** 2
    return {"density": here, "contacts": contacts / inside, "meetings": meetings / inside}


def partners(model: SwarmModel) -> np.ndarray:
    """Return the row of the robot that each robot touched deepest in the last step, -1 for none."""
    swarm = model.swarm
    return np.where(swarm.collided & (swarm.contact_kind == ROBOT), swarm.contact_index, -1)


def over_way(rows: list[dict], name: str, speed: float) -> list[float]:
    """Return events of a robot over `WAY` diameters, of each run."""
    return [row[name] * WAY * 2.0 * RADIUS / speed for row in rows]


def collisions(laboratory: Laboratory) -> Result:
    """Measure the collisions and free paths of robots that rebound, over densities."""
    points = [{"density": density, "rebound": True, "speed": speed_at(density)} for density in DENSITIES]
    made = dict(zip(DENSITIES, laboratory.grid(gas_run, points, laboratory.fresh_seeds(SEEDS)), strict=True))
    measured = {density: over_way(rows, "contacts", speed_at(density)) for density, rows in made.items()}
    return Result(
        checks=tuple(collision_checks(made, measured)),
        pictures={"": collision_figure(made, measured)},
        settings=(
            f"{ROBOTS} robots of radius {RADIUS:g} in a square box, {SEEDS} seeds, {SETTLING:,} steps before "
            f"{STEPS:,} that count; speed such that theory expects {RATE:g} collisions of a robot in a step, at most "
            f"1; robots within {MARGIN:g} radii of walls do not count, and theory is computed for the density of the "
            "rest"
        ),
        remarks=(
            "A collision is a step in which a robot overlaps another robot before contact is resolved.",
            f"A step is not infinitely short: {RATE:.1%} of the time between two collisions. A pair that is pushed "
            "apart loses on average about half of that, which is less than the intervals show.",
        ),
        table=collision_table(made, measured),
    )


def collision_checks(made: dict[float, list[dict]], measured: dict[float, list[float]]) -> list[Check]:
    """Return the checks of collisions and free paths; each run is compared with the theory for its own density."""
    checks = []
    for density, rows in made.items():
        theory = [collisions_in_theory(here) for here in column(rows, "density")]
        checks.append(
            judged_theory(
                f"collisions of a robot over {WAY} diameters: density {density:g}",
                theory,
                measured[density],
                within=0.03,
            )
        )
    for density, rows in made.items():
        theory = [WAY / collisions_in_theory(here) for here in column(rows, "density")]
        paths = [WAY / number for number in measured[density]]
        checks.append(
            judged_theory(f"mean free path, diameters: density {density:g}", theory, paths, within=0.03, main=False)
        )
    densest = DENSITIES[-1]
    ideal = [
        number / (WAY * 32.0 * row["density"] / math.pi**2)
        for number, row in zip(measured[densest], made[densest], strict=True)
    ]
    checks.append(
        judged_mean(
            f"an ideal gas does not describe it: collisions relative to its theory, density {densest:g}",
            f"{contact_value(densest):.3f}",
            ideal,
            low=1.5,
            main=False,
        )
    )
    return checks


def collision_table(made: dict[float, list[dict]], measured: dict[float, list[float]]) -> str:
    """Return densities, speeds, contact values and measured relative to theoretical collisions."""
    lines = []
    for density, rows in made.items():
        inside = column(rows, "density")
        relative = [n / collisions_in_theory(x) for n, x in zip(measured[density], inside, strict=True)]
        here = mean_interval(inside).estimate
        numbers = f"{density:g}", f"{here:.4f}", f"{contact_value(here):.3f}", f"{speed_at(density):.4f}"
        lines.append((*numbers, with_limits(mean_interval(relative))))
    return table_of(("density", "far from walls", "g", "speed", "measured / theory"), lines)


def collision_figure(made: dict[float, list[dict]], measured: dict[float, list[float]]) -> Figure:
    """Return a figure of the mean free path over density, with that of hard discs and of an ideal gas."""
    figure, axes = plain_axes("density, share of the area", "mean free path, diameters")
    fine = np.geomspace(DENSITIES[0] / 1.3, DENSITIES[-1] * 1.2, 100)
    axes.plot(fine, [WAY / collisions_in_theory(x) for x in fine], color=LIGHT.soft, linewidth=1.2, label="hard discs")
    axes.plot(fine, math.pi**2 / (32.0 * fine), "--", color=LIGHT.soft, linewidth=1.2, label="ideal gas")
    paths = [[WAY / number for number in numbers] for numbers in measured.values()]
    places = [mean_interval(column(rows, "density")).estimate for rows in made.values()]
    draw_means(axes, places, paths, "blind robots", 0, joined=False)
    axes.set(xscale="log", yscale="log")
    axes.legend(frameon=False)
    return figure


def contact(laboratory: Laboratory) -> Result:
    """Measure meetings and time in contact of robots that keep their course, which slide along each other."""
    densities = (*DILUTE, DENSE)
    points = [{"density": density, "rebound": False, "speed": DILUTE_SPEED} for density in DILUTE]
    points.append({"density": DENSE, "rebound": False, "speed": DENSE_SPEED, "steps": DENSE_STEPS})
    made = dict(zip(densities, laboratory.grid(gas_run, points, laboratory.fresh_seeds(SEEDS)), strict=True))
    return Result(
        checks=tuple(contact_checks(made)),
        pictures={"": contact_figure(made)},
        settings=(
            f"{ROBOTS} robots of radius {RADIUS:g} in a square box, {SEEDS} seeds; speed {DILUTE_SPEED:g}, "
            f"{SETTLING:,} steps before {STEPS:,} that count; in the dense swarm speed {DENSE_SPEED:g}, "
            f"{SETTLING:,} before {DENSE_STEPS:,}; robots leave walls in random directions but keep their course on "
            f"contact with each other; those within {MARGIN:g} radii of walls do not count, and theory is computed "
            "for the density of the rest"
        ),
        remarks=(
            "The theory is one of pairs, the limit of a low density. It ends where a third robot meets a pair before "
            f"the two have passed each other: at a density of {DENSE:g} robots that keep their course block each "
            "other, in groups that grow with time.",
        ),
    )


def contact_checks(made: dict[float, list[dict]]) -> list[Check]:
    """Return the checks of meetings and of the share of time in contact."""
    checks = []
    for density in DILUTE:
        rows = made[density]
        meetings = [collisions_in_theory(here) / contact_value(here) for here in column(rows, "density")]
        measured = over_way(rows, "meetings", DILUTE_SPEED)
        claim = f"meetings of a robot over {WAY} diameters: density {density:g}"
        checks.append(judged_theory(claim, meetings, measured, within=0.1))
    for density in DILUTE:
        rows = made[density]
        theory = [in_contact(here) for here in column(rows, "density")]
        claim = f"share of steps in contact: density {density:g}"
        checks.append(judged_theory(claim, theory, column(rows, "contacts"), within=0.1))
    jammed = made[DENSE]
    checks.append(
        judged_difference(
            f"robots in a dense swarm are longer in contact than pairs would be: density {DENSE:g}",
            "not described",
            {
                "theory of pairs": [in_contact(here) for here in column(jammed, "density")],
                "measured": column(jammed, "contacts"),
            },
            main=False,
        )
    )
    return checks


def contact_figure(made: dict[float, list[dict]]) -> Figure:
    """Return a figure of the share of steps in contact over density, with the theory of pairs."""
    figure, axes = plain_axes("density, share of the area", "share of steps in contact")
    fine = np.geomspace(DILUTE[0] / 1.3, DENSE * 1.2, 100)
    axes.plot(fine, [in_contact(x) for x in fine], color=LIGHT.soft, linewidth=1.2, label="theory of pairs")
    places = [mean_interval(column(rows, "density")).estimate for rows in made.values()]
    draw_means(
        axes,
        places,
        [column(rows, "contacts") for rows in made.values()],
        "robots that keep their course",
        0,
        joined=False,
    )
    axes.set(xscale="log", yscale="log")
    axes.legend(frameon=False)
    return figure


ITEMS = items_of_theory(kinetic_collisions=collisions, blind_contact=contact)
