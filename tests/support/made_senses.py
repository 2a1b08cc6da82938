"""Readings made by hand, of many robots at once: round numbers, so that every limit is also met exactly."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np

from mesa_swarm import AGENT9, ProximitySensor, RobotDesign
from mesa_swarm.control.layer import Senses
from support.scenes import empty

OBSTACLE, ROBOT, FIRE, LOAD = range(4)
# In other orders than usual: the first sensor is the right one, or the left one where there is none on the right.
SHUFFLED, SIDE = (
    RobotDesign(name=name, sensors=tuple(ProximitySensor(bearing_degrees=b, range=50) for b in bearings))
    for name, bearings in (("shuffled", (-40, 0, 40)), ("side", (40, 0, 180)))
)
EACH = 40
ROBOTS = 3 * EACH
NOTHING_WRITTEN = 99.0


def model_of_three_designs(control=None, **options):
    """Return a model with forty robots of each of three designs, one of which has no sensor on the right."""
    model = empty(2000, 2000, **options)
    places = [(20.0 + 40 * (k % 40), 20.0 + 40 * (k // 40), 0.0) for k in range(ROBOTS)]
    for number, design in enumerate((AGENT9, SHUFFLED, SIDE)):
        model.add_robots(design, poses=places[number * EACH : (number + 1) * EACH])
    model.control = control
    return model


@cache
def _blank() -> Senses:
    model = model_of_three_designs()
    model.sense()
    return Senses.of(model.swarm)


def made_senses(seed: int, before: Senses | None = None) -> Senses:
    """Return random readings of `ROBOTS` robots; about half of the robots go on to read what they read before."""
    rng, blank = np.random.default_rng(seed), _blank()
    n, s = blank.distance.shape
    there = np.arange(s) < np.array([9, 3, 3])[blank.design][:, None]
    kind = np.where(there & (rng.random((n, s)) < rng.choice([0.2, 0.7], (n, 1))), rng.integers(0, 4, (n, s)), -1)
    places = rng.choice([-80.0, -60.0, -20.0, 0.0, 20.0, 60.0, 80.0], (2, n, 2))
    places[rng.random((2, n)) < 0.4] = np.nan
    made = {
        "distance": np.where(kind < 0, -1.0, 5.0 * rng.integers(0, 10, (n, s))),
        "kind": kind.astype(blank.kind.dtype),
        "heat": rng.choice([0.0, 1.5], n),
        "hot": rng.random(n) < 0.3,
        "fire": rng.choice([-1, 0, 3], n, p=[0.6, 0.2, 0.2]),
        "last_command": rng.choice([0.0, 0.5, 4.5], (n, 2)),
        "heard_from": places[0],
        "heard_goal": places[1],
    }
    if before is not None:
        goes_on = rng.random(n) < 0.5
        for name, column in made.items():
            column[goes_on] = getattr(before, name)[goes_on]
    own = np.random.default_rng(1)
    return replace(
        blank,
        **made,
        radius=own.choice([3.0, 5.0], n),
        max_speed=own.choice([0.5, 1.0, 2.0], n),
        tendency=own.choice([-1.0, 1.0], n),
    )


def made_drivers(seed: int) -> np.ndarray:
    """Return which layer drives each robot already, -1 for none."""
    return np.random.default_rng(seed).choice([-1, 0, 3], ROBOTS, p=[0.6, 0.2, 0.2])


def known_to(senses: Senses, i: int) -> SimpleNamespace:
    """Return what one robot knows, by name."""
    of_robots = "distance kind heat hot fire last_command heard_from heard_goal radius max_speed tendency"
    of_designs = "forward sensors bearing"
    known = {name: getattr(senses, name)[i] for name in of_robots.split()}
    return SimpleNamespace(**known, **{name: getattr(senses, name)[senses.design[i]] for name in of_designs.split()})


def decided(layer, senses: Senses, drivers: np.ndarray, index: int = 7) -> tuple[np.ndarray, np.ndarray]:
    """Return what a layer commands, and which layer drives each robot afterwards."""
    command, won = np.full((ROBOTS, 2), NOTHING_WRITTEN), drivers.copy()
    layer.decide(senses, command, won, index)
    return command, won
