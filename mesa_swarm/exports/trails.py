"""Trails: where robots were in the steps before."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection

from mesa_swarm.exports.portraits import Portraits

TRAIL = "#0072b2"
# So many points a trail at most: films draw them in every frame.
MOST_POINTS = 60


def trails_of(portraits: Portraits, step: int, length: int) -> list[np.ndarray]:
    """Return the places of each robot from `length` steps before until a step, oldest first.

    Parameters
    ----------
    portraits : Portraits
    step : int
        One of those that were recorded.
    length : int
        Steps, at least 1.

    Returns
    -------
    list of ndarray, shapes (k, 2)
        Of the robots that are there at the step, in the order of the rows.
    """
    past = portraits.steps[(portraits.steps >= step - length) & (portraits.steps <= step)]
    chosen = past[:: -max(1, -(-len(past) // MOST_POINTS))][::-1].tolist()
    frames = [portraits.frame(number) for number in chosen]
    robots = frames[-1].robots
    if all(np.array_equal(frame.robots, robots) for frame in frames):
        return list(np.stack([frame["position"] for frame in frames], axis=1))
    places: dict[int, list] = {robot: [] for robot in robots.tolist()}
    for frame in frames:
        for robot, place in zip(frame.robots.tolist(), frame["position"].tolist(), strict=True):
            places.get(robot, []).append(place)
    return [np.array(places[robot]) for robot in robots.tolist()]


def draw_trails(axes: Axes, portraits: Portraits, step: int, length: int) -> None:
    """Draw trails as thin lines below the robots."""
    lines = trails_of(portraits, step, length)
    axes.add_collection(LineCollection(lines, colors=TRAIL, linewidths=0.8, alpha=0.45, zorder=4.5, label="trails"))
