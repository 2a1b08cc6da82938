"""Runs of one and of many robots (thesis 5.3) that return numbers."""

from typing import Any

import numpy as np

from mesa_swarm.analysis import (
    clark_evans,
    clusters,
    coverage,
    follow_chains,
    kept_together,
    nearest_neighbour_distances,
    reachable_cells,
)
from mesa_swarm.gallery import find_model
from mesa_swarm.model import SwarmModel

Numbers = dict[str, float | None]
# Who stands within this distance of another is in one group with it, whatever made the group.
GROUP = 40.0
# Steps after which one looks who is still together.
WINDOW = 200
FRAME = 5
EARLY, LATE = 1_000, 3_000
# Groups of pairs and threes.
SMALL = 3
# Of the map openspace, within its walls.
INNER_AREA = 760.0 * 560.0
# A robot that sees all that is ahead of it, is quick, and turns on the spot where it would else touch something.
EXPLORER = {
    "n_robots": 1,
    "map": "original",
    "design": "WIDE3",
    "max_speed": 4.0,
    "distance": 7.0,
    "spot_distance": 3.5,
}


def exploration_run(rng: int, steps: int = 60_000, **settings: Any) -> Numbers:
    """Let one robot explore the map `original`; return which share of the cells within its reach it visited.

    Cells are those of a 40 x 40 grid in which the robot's centre can be. The robot is the `EXPLORER`, if the
    settings of `CollisionAvoidance` do not say otherwise.

    Examples
    --------
    >>> sorted(exploration_run(1, steps=100))
    ['collisions', 'coverage']
    """
    model = find_model("collision_avoidance")(rng=rng, **{**EXPLORER, **settings})
    solids = [(obstacle.shape.geometry, obstacle.shape.radius) for obstacle in model.obstacles if obstacle.contact]
    radius, start = float(model.swarm.radius[0]), model.swarm.position[0].copy()
    cells = reachable_cells(model.map.bounds, solids, radius, start)
    kept = model.watch(last=None, columns=("position",))
    model.run(steps)
    return {
        "coverage": coverage(kept["position"], cells, model.map.bounds),
        "collisions": float(model.total_collisions),
    }


def agglomeration_run(rng: int, **settings: Any) -> Numbers:
    """Let robots agglomerate; return their spacing relative to the start, groups, and who keeps together.

    Examples
    --------
    >>> agglomeration_run(1, n_robots=5)["spacing at 1000"] > 0
    True
    """
    model = find_model("agglomeration")(rng=rng, **settings)
    spacing = nearest_neighbour_distances(model.swarm.position).mean()
    numbers: Numbers = {"randomness at 0": float(clark_evans(model.swarm.position, INNER_AREA))}
    for step in (EARLY, LATE):
        kept = kept_while(model, step)
        groups = clusters(model.swarm.position, GROUP)
        numbers[f"spacing at {step}"] = float(nearest_neighbour_distances(model.swarm.position).mean() / spacing)
        numbers[f"groups at {step}"] = float(groups.count)
        numbers[f"size at {step}"] = groups.mean_size
        numbers[f"small groups at {step}"] = float(np.count_nonzero(groups.sizes <= SMALL))
        numbers[f"largest at {step}"] = float(groups.sizes.max(initial=0))
        numbers[f"local convergence at {step}"] = groups.local_convergence
        numbers[f"kept together at {step}"] = kept
    return known(numbers)


def kept_while(model: SwarmModel, until: int) -> float:
    """Run a model until a step; return the share of pairs in one group that still were after the last 200 steps."""
    model.run(until - WINDOW - model.steps)
    before = clusters(model.swarm.position, GROUP).label
    model.run(WINDOW)
    return kept_together(before, clusters(model.swarm.position, GROUP).label)


def chain_run(rng: int, **settings: Any) -> Numbers:
    """Let robots form chains; return how long they are, what became of head-on meetings, and who keeps together.

    Lengths and shares are means over the 200 steps before step 1,000 and before step 3,000.

    Examples
    --------
    >>> chain_run(1, n_robots=5)["meetings"] >= 0
    True
    """
    model = find_model("chain_formation")(rng=rng, **settings)
    kept = model.watch(last=None, every=FRAME, columns=("position", "heading"))
    together = {f"kept together at {step}": kept_while(model, step) for step in (EARLY, LATE)}
    history = follow_chains(
        kept["position"], kept["heading"], kept.steps, link_distance=model.link_distance, patience=3
    )
    numbers: Numbers = dict(together)
    for step in (EARLY, LATE):
        frames = (kept.steps > step - WINDOW) & (kept.steps <= step)
        numbers[f"length at {step}"] = mean_or_one(history.mean_length[frames])
        numbers[f"chained at {step}"] = float(history.chained[frames].mean())
    outcomes = history.outcomes()
    met = sum(outcomes.values())
    kinds = [event.kind for event in history.events]
    numbers.update({f"{kind}s": float(kinds.count(kind)) for kind in ("merge", "split")})
    numbers["meetings"] = float(met)
    numbers["dispersals"] = float(outcomes["dispersed"])
    numbers["share dispersed"] = outcomes["dispersed"] / met if met else None
    return known(numbers)


def mean_or_one(lengths: np.ndarray) -> float:
    """Return the mean length of chains; a robot alone counts as a chain of one where there is none."""
    return float(np.where(np.isnan(lengths), 1.0, lengths).mean())


def known(numbers: Numbers) -> Numbers:
    """Return the same with None for what could not be measured, which JSON has no word for.

    Examples
    --------
    >>> known({"a": float("nan"), "b": 0.5})
    {'a': None, 'b': 0.5}
    """
    return {name: None if value is None or np.isnan(value) else value for name, value in numbers.items()}
