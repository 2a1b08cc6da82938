"""Runs of the regression (thesis 6.3) and of choices by chance (7.4)."""

from collections.abc import Callable

import numpy as np

from mesa_swarm.learning.actions import chosen
from mesa_swarm.learning.networks import fit

POINTS = 30
NOISE = 0.05
# So many times the noise is a bad fit: the thesis calls it bias.
BAD = 3.0

Curve = Callable[[np.ndarray], np.ndarray]


def our_curve(x: np.ndarray) -> np.ndarray:
    """Return a curve that a 1-2-1 network can say exactly (6.1).

    Examples
    --------
    >>> round(float(our_curve(np.array([0.0]))[0]), 3)
    0.843
    """
    return 0.6 * np.tanh(4 * x + 1) - 0.4 * np.tanh(3 * x - 2)


def drawn_curve(rng: np.random.Generator) -> Curve:
    """Return y = f tanh(d x + b) + g tanh(e x + c) (6.1) with weights drawn at random."""
    d, e = rng.uniform(1, 5, 2)
    b, c = rng.uniform(-2, 2, 2)
    f, g = rng.uniform(-0.8, 0.8, 2)
    return lambda x: f * np.tanh(d * x + b) + g * np.tanh(e * x + c)


def noisy_points(rng: np.random.Generator, curve: Curve) -> tuple[np.ndarray, np.ndarray]:
    """Return the points that are shown.

    Examples
    --------
    >>> noisy_points(np.random.default_rng(1), our_curve)[0].shape
    (30,)
    """
    x = np.linspace(-1, 1, POINTS)
    return x, curve(x) + rng.normal(0, NOISE, POINTS)


def regression_run(rng: int, *, networks: int, curve: str) -> dict[str, float]:
    """Fit networks to points of one curve; return which share fits badly, and the middle one's error over the noise.

    Examples
    --------
    >>> sorted(regression_run(1, networks=2, curve="ours"))
    ['bad', 'median']
    """
    random = np.random.default_rng(rng)
    true = our_curve if curve == "ours" else drawn_curve(random)
    x, y = noisy_points(random, true)
    fitted = fit(x, y, rng=random, networks=networks)
    said = np.array([fitted.outputs(np.full((networks, 1), at)) for at in x])
    errors = np.sqrt(((said - true(x)[:, None]) ** 2).mean(axis=0)) / NOISE
    return {"bad": float(np.mean(errors > BAD)), "median": float(np.median(errors))}


def choice_run(rng: int, *, draws: int) -> dict[str, float]:
    """Let chance choose among Q = (3, 2, 1) at T = 1; return how much oftener than it should the best was chosen.

    Examples
    --------
    >>> abs(choice_run(1, draws=1000)["excess"]) < 0.1
    True
    """
    values = np.array([3.0, 2.0, 1.0])
    taken = np.array([chosen(values, 1.0, chance) for chance in np.random.default_rng(rng).random(draws)])
    return {"excess": float(np.mean(taken == 0) - np.exp(3) / np.exp(values).sum())}
