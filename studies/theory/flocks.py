"""Vicsek's model beside what can be computed of it: limits without and with all neighbours, and its dependences."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import cKDTree

from mesa_swarm.analysis import polarization
from mesa_swarm.viewing import LIGHT
from mesa_swarm_studies.drawing import column, draw_means, name_places, plain_axes
from mesa_swarm_studies.judging import Check, Result, judged_mean, judged_measure, judged_theory
from mesa_swarm_studies.laboratory import Laboratory, Numbers
from mesa_swarm_studies.registry import items_of_theory
from mesa_swarm_studies.theory.courses import Course, torus

SEEDS = 20
# Speed relative to the range within which robots are neighbours: Vicsek's 0.03.
RANGE, SPEED = 10.0, 0.3
SETTLING, STEPS = 200, 300
NOISES = (0.1, 0.3, 0.5, 0.7, 0.9)
DENSITIES = (0.25, 0.5, 1.0, 2.0, 4.0)
SMALL, LARGE = 64, 256
USUAL_DENSITY, USUAL_NOISE = 2.0, 0.4
# Sizes between which it is measured how order depends on size, at noises without and with order.
SIZES = (64, 512)
WITHOUT_ORDER, WITH_ORDER = 0.9, 0.1
# Noises of the limit in which all robots are neighbours.
ALL_NOISES = (0.2, 0.4, 0.6, 0.8)


class AlignWithNoise(Course):
    """Vicsek's rule on a torus: the direction of the mean of all robots within a range, oneself too, and noise.

    The noise is uniform between plus and minus `noise` times pi.
    """

    name = "AlignWithNoise"

    def __init__(self, *, side: float, range: float, noise: float) -> None:
        self.side, self.range, self.noise = side, range, noise

    def turn(self, azimuth: np.ndarray) -> None:
        """Turn each robot as its neighbours drive."""
        unit = np.exp(1j * azimuth)
        mean = unit + self._of_others(unit)
        azimuth[:] = np.angle(mean) + self.noise * self._rng.uniform(-math.pi, math.pi, len(azimuth))

    def _of_others(self, unit: np.ndarray) -> np.ndarray:
        """Return the sum of the unit vectors of each robot's neighbours, as complex numbers."""
        tree = cKDTree(np.mod(self._swarm.position, self.side), boxsize=self.side)
        first, second = tree.query_pairs(self.range, output_type="ndarray").T
        n, total = len(unit), np.zeros(len(unit), complex)
        for here, there in ((first, second), (second, first)):
            total += np.bincount(here, unit.real[there], n) + 1j * np.bincount(here, unit.imag[there], n)
        return total


def flock_run(
    rng: int,
    *,
    robots: int,
    noise: float,
    density: float = USUAL_DENSITY,
    range: float = RANGE,
    settling: int = SETTLING,
    steps: int = STEPS,
) -> Numbers:
    """Return the mean of the order, of its square, and the robots' number times its variance over a run."""
    side = RANGE * math.sqrt(robots / density)
    places = np.random.default_rng(rng).uniform(0.0, side, (robots, 2))
    # What is within half the side is seen once, not through the border as well.
    layer = AlignWithNoise(side=side, range=min(range, 0.75 * side), noise=noise)
    model = torus(layer, places, side=side, speed=SPEED, steps=settling + steps, rng=rng)
    model.run(settling)
    order: list[float] = []
    while len(order) < steps:
        model.step()
        order.append(polarization(np.arctan2(*model.swarm.command.T[::-1]) + model.swarm.heading))
    squares = np.square(order)
    return {
        "order": float(np.mean(order)),
        "square": float(squares.mean()),
        "fluctuation": float(robots * np.var(order)),
    }


# Ranges with which no robot has a neighbour, and with which all are neighbours.
NO_RANGE, EVERY_RANGE = 1e-6, 1e6


def square_of_all(robots: int, noise: float) -> float:
    """Return the mean squared order of robots that all have one direction but for noise: 1 / N + (1 - 1 / N) sinc^2.

    Examples
    --------
    >>> square_of_all(64, 1.0) == 1 / 64, square_of_all(64, 0.0)
    (True, 1.0)
    """
    # Exactly 0 at full noise, for which the sine of pi is not.
    common = 0.0 if noise == 1.0 else float(np.sinc(noise))
    return 1.0 / robots + (1.0 - 1.0 / robots) * common**2


def limits(laboratory: Laboratory) -> Result:
    """Measure order where it is known: at full noise, without neighbours, and where all are neighbours."""
    seeds = laboratory.fresh_seeds(SEEDS)
    sizes = (SMALL, LARGE)
    full, alone = (
        dict(zip(sizes, laboratory.grid(flock_run, [{"robots": n, **other} for n in sizes], seeds), strict=True))
        for other in ({"noise": 1.0}, {"noise": USUAL_NOISE, "range": NO_RANGE})
    )
    every = laboratory.grid(
        flock_run, [{"robots": SMALL, "noise": noise, "range": EVERY_RANGE} for noise in ALL_NOISES], seeds
    )
    named = {"full noise": full, f"no neighbours, noise {USUAL_NOISE:g}": alone}
    chance = [
        judged_theory(
            f"mean squared order, {words}: {n} robots", square_of_all(n, 1.0), column(rows, "square"), within=0.15
        )
        for words, by_size in named.items()
        for n, rows in by_size.items()
    ]
    common = [
        judged_theory(
            f"mean squared order, all are neighbours, noise {noise:g}: {SMALL} robots",
            square_of_all(SMALL, noise),
            column(rows, "square"),
            within=0.05,
        )
        for noise, rows in zip(ALL_NOISES, every, strict=True)
    ]
    return Result(checks=(*chance, *common), pictures={"": limit_figure(every)}, settings=FLOCK_SETTINGS)


FLOCK_SETTINGS = (
    f"robots at speed {SPEED:g} on a torus, neighbours within {RANGE:g}; density is robots on the square of that "
    f"range; {SETTLING} steps before {STEPS} that count; {SEEDS} seeds"
)


def limit_figure(every: Sequence[list[dict]]) -> Figure:
    """Return a figure of the mean squared order over noise where all are neighbours."""
    figure, axes = plain_axes("noise, share of half a circle", "mean squared order")
    fine = np.linspace(0.0, 1.0, 101)
    axes.plot(fine, [square_of_all(SMALL, x) for x in fine], color=LIGHT.soft, linewidth=1.2, label="theory")
    rows = [column(made, "square") for made in every]
    draw_means(axes, ALL_NOISES, rows, f"{SMALL} robots, all neighbours", 0, joined=False)
    axes.legend(frameon=False)
    return figure


def transition(laboratory: Laboratory) -> Result:
    """Measure the direction in which noise, density and size change the order."""
    seeds = laboratory.fresh_seeds(SEEDS)
    over_noise = {
        n: dict(
            zip(NOISES, laboratory.grid(flock_run, [{"robots": n, "noise": x} for x in NOISES], seeds), strict=True)
        )
        for n in (SMALL, LARGE)
    }
    dense = [{"robots": LARGE, "noise": USUAL_NOISE, "density": density} for density in DENSITIES]
    over_density = dict(zip(DENSITIES, laboratory.grid(flock_run, dense, seeds), strict=True))
    over_size = {
        noise: laboratory.grid(flock_run, [{"robots": n, "noise": noise} for n in SIZES], seeds)
        for noise in (WITHOUT_ORDER, WITH_ORDER)
    }
    return Result(
        checks=(
            *noise_checks(over_noise[LARGE]),
            *density_checks(over_density),
            *size_checks(over_size, over_noise),
        ),
        pictures={"": noise_figure(over_noise), "density": density_figure(over_density)},
        settings=(
            f"{FLOCK_SETTINGS}; density {USUAL_DENSITY:g} where noise varies, noise {USUAL_NOISE:g} where density does"
        ),
        remarks=(
            "Whether the transition is continuous is not judged: the order at which it is decided depends on sizes far "
            "beyond these (Grégoire and Chaté 2004).",
        ),
    )


def noise_checks(by_noise: dict[float, list[dict]]) -> list[Check]:
    """Return the checks of how order falls with noise."""
    return [
        judged_measure(
            f"order falls with noise, {LARGE} robots: {less:g} to {more:g}",
            "falls",
            "order",
            {f"noise {more:g}": by_noise[more], f"noise {less:g}": by_noise[less]},
        )
        for less, more in pairwise(NOISES)
    ]


def density_checks(by_density: dict[float, list[dict]]) -> list[Check]:
    """Return the checks of how order rises with density."""
    return [
        judged_measure(
            f"order rises with density, {LARGE} robots: {less:g} to {more:g}",
            "rises",
            "order",
            {f"density {less:g}": by_density[less], f"density {more:g}": by_density[more]},
        )
        for less, more in pairwise(DENSITIES)
    ]


def size_checks(
    over_size: dict[float, list[list[dict]]], over_noise: dict[int, dict[float, list[dict]]]
) -> list[Check]:
    """Return the checks of how order depends on size."""
    small, large = (column(rows, "square") for rows in over_size[WITHOUT_ORDER])
    falls = [math.log(b / a) / math.log(SIZES[1] / SIZES[0]) for a, b in zip(small, large, strict=True)]
    middle = NOISES[len(NOISES) // 2]
    return [
        judged_theory(
            f"without order its square is a power of size: exponent at noise {WITHOUT_ORDER:g}, "
            f"{SIZES[0]} to {SIZES[1]} robots",
            -1.0,
            falls,
            within=0.1,
        ),
        judged_mean(
            f"with order it stays: order of {SIZES[1]} robots at noise {WITH_ORDER:g}",
            "above 0",
            column(over_size[WITH_ORDER][1], "order"),
            low=0.5,
        ),
        judged_measure(
            f"in a larger swarm order ends at less noise: order at noise {middle:g}",
            "less in the larger",
            "order",
            {f"{LARGE} robots": over_noise[LARGE][middle], f"{SMALL} robots": over_noise[SMALL][middle]},
        ),
        judged_measure(
            f"in a larger swarm order fluctuates more: N var(order) at noise {middle:g}",
            "more in the larger",
            "fluctuation",
            {f"{SMALL} robots": over_noise[SMALL][middle], f"{LARGE} robots": over_noise[LARGE][middle]},
        ),
    ]


def noise_figure(over_noise: dict[int, dict[float, list[dict]]]) -> Figure:
    """Return a figure of order over noise by size."""
    figure, axes = plain_axes("noise, share of half a circle", f"order, density {USUAL_DENSITY:g}")
    for i, (n, by_noise) in enumerate(over_noise.items()):
        draw_means(axes, NOISES, [column(rows, "order") for rows in by_noise.values()], f"{n} robots", i)
    axes.set_ylim(0.0, 1.0)
    axes.legend(frameon=False)
    return figure


def density_figure(by_density: dict[float, list[dict]]) -> Figure:
    """Return a figure of order over density."""
    figure, axes = plain_axes("robots on the square of the range", f"order, noise {USUAL_NOISE:g}")
    draw_means(axes, DENSITIES, [column(rows, "order") for rows in by_density.values()], f"{LARGE} robots", 0)
    axes.set(xscale="log", ylim=(0.0, 1.03))
    name_places(axes, DENSITIES)
    axes.legend(frameon=False)
    return figure


ITEMS = items_of_theory(vicsek_limits=limits, vicsek_transition=transition)
