"""Runs of robots that fight fires (thesis chapter 9): the thesis's two, and what lies around them."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from mesa_swarm.fire import design_constants
from mesa_swarm.gallery import find_model
from mesa_swarm.model import SwarmModel
from mesa_swarm.world.map import Map

MOST_STEPS = 15_000
# The second fire of the map, large and in the middle.
LARGEST = 1
# A robot works so many steps for every one that it rests, at the largest fire: of the default constants.
WORK_TO_REST = 100.0 / 60.0


def fire_run(
    rng: int, *, strategy: str, robots: int = 10, size: float = 1.0, rest: float = 60.0, steps: int = MOST_STEPS
) -> dict[str, Any]:
    """Let robots fight the seven fires; return how many they put out, when, and who was at the largest.

    Parameters
    ----------
    rng : int
    strategy : str
        "A" or "B".
    robots : int
    size : float
        All fires' areas are so many times those of the map; robots and constants are the same.
    rest : float
        Steps that a hot robot rests. It can work 5/3 times as long, as with the default constants, so that
        only the rhythm changes.
    steps : int
        At most.

    Examples
    --------
    >>> run = fire_run(1, strategy="B", steps=20)
    >>> run["out"], run["all out at"]
    (0, None)
    """
    model = fire_model(rng, strategy, robots, size, rest).run(steps)
    out = model.fires.out_step
    history = model.fires.history.robots
    others = np.delete(model.fires.out, LARGEST)
    return {
        "out": int(model.fires.out.sum()),
        "others out": int(others.sum()),
        "largest out": bool(model.fires.out[LARGEST]),
        "all out at": int(out.max()) if model.fires.out.all() else None,
        "largest out at": int(out[LARGEST]) if out[LARGEST] >= 0 else None,
        "most at the largest": int(history[:, LARGEST].max(initial=0)),
        "together at the largest": float(np.mean(history[:, LARGEST] >= 2)) if len(history) else 0.0,
    }


def fire_model(rng: int, strategy: str, robots: int = 10, size: float = 1.0, rest: float = 60.0) -> SwarmModel:
    """Return the model of a run before its first step.

    Examples
    --------
    >>> fire_model(1, "A", size=4.0).fires.area[LARGEST]
    np.float64(64.0)
    """
    return find_model("fire_fighting")(rng=rng, strategy=strategy, n_robots=robots, map=grown_map(size), **rhythm(rest))


def grown_map(size: float) -> Map | str:
    """Return the map with fires of so many times the area; areas are (radius / 10)^2.

    Examples
    --------
    >>> grown_map(1.0)
    'openspace_fire'
    """
    if size == 1.0:
        return "openspace_fire"
    plain = Map.load("openspace_fire")
    fires = tuple(replace(fire, radius=fire.radius * size**0.5) for fire in plain.fires)
    return replace(plain, name=f"openspace_fire times {size:g}", fires=fires)


def rhythm(rest: float) -> Mapping[str, float]:
    """Return the constants of robots that rest so long, and work in proportion.

    Examples
    --------
    >>> rhythm(60.0) == {"leave": 100.0, "join": 10.0}
    True
    """
    constants = design_constants(stay_time=WORK_TO_REST * rest, rest_time=rest)
    return {"leave": round(constants.leave, 9), "join": round(constants.join, 9)}
