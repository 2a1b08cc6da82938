"""What robots did in every step, run or written by hand, as the detector of pathologies takes it."""

import numpy as np

from mesa_swarm.analysis.pathology import KINDS

CORRIDOR, CENTROID, HEAD_ON, THRESHOLD, STUCK = KINDS
KEPT = ("position", "heading", "command", "layer", "distance", "kind")


def recorded(model, steps):
    """Run a model and return what the detector takes."""
    kept = {name: [] for name in KEPT}
    for _ in range(steps):
        model.step()
        for name in KEPT:
            kept[name].append(getattr(model.swarm, name).copy())
    swarm = model.swarm
    return {
        **{name: np.array(frames) for name, frames in kept.items()},
        "steps": np.arange(model.steps - steps + 1, model.steps + 1),
        "radius": swarm.radius,
        "max_speed": swarm.max_speed,
        "forward": swarm.table.forward[swarm.design],
    }


def only(found, kind):
    """Return the episodes, asserting that there are some and that all are of this kind."""
    assert found.counts() == {**dict.fromkeys(KINDS, 0), kind: len(found)}
    assert len(found) > 0
    return found


def still(k=100, n=1, **changes):
    """Return what robots did that stood still at the origin, with one sensor ahead that reads nothing."""
    return {
        "steps": np.arange(1, k + 1),
        "position": np.zeros((k, n, 2)),
        "heading": np.zeros((k, n)),
        "command": np.zeros((k, n, 2)),
        "layer": np.zeros((k, n), int),
        "distance": np.full((k, n, 3), -1.0),
        "kind": np.full((k, n, 3), -1),
        "radius": np.full(n, 5.0),
        "max_speed": np.ones(n),
        "forward": np.tile([0, 1, 2], (n, 1)),
        **changes,
    }


def flipping(flips, period=1, k=100, kind=0, distance=10.0):
    """Return a robot that turns away from its left and its right by turns, this number of times, from step 11 on."""
    track = still(k)
    for turn in range(flips + 1):
        now = slice(10 + turn * period, 10 + (turn + 1) * period)
        side = 1 if turn % 2 else -1
        track["command"][now, 0] = [-side, side]
        seen = 2 if side > 0 else 1
        track["distance"][now, 0, seen], track["kind"][now, 0, seen] = distance, kind
    return track
