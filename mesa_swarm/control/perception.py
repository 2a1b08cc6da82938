"""What robots make of their readings: where, in their own frame, the things are that their sensors see.

A sensor tells a distance, not a direction: what it sees is taken to be in the middle of its sector. That
error is part of the model (PHYSICS 3).
"""

import math

import numpy as np

from mesa_swarm.control.layer import Senses
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.robots.table import AXIS_X, AXIS_Y, MOUNT_X, MOUNT_Y
from mesa_swarm.world.statics import ROBOT


def centroids(senses: Senses) -> tuple[np.ndarray, np.ndarray]:
    """Return where each robot perceives the centroid of the robots that it sees, and by how many sensors.

    The mean of the reconstructed positions over the sensors that see a robot now (5.1, corrected: not over
    all sensors).

    Returns
    -------
    centroid : ndarray, shape (n, 2), map units
        In the robot's own frame: x ahead, y to the left of its centre; (0, 0) where no robot is seen.
    seen : int64 ndarray, shape (n,)
        How many sensors see a robot.

    Examples
    --------
    >>> from mesa_swarm.model import SwarmModel
    >>> from mesa_swarm.robots.design import AGENT9
    >>> model = SwarmModel(rng=1)
    >>> robots = model.add_robots(AGENT9, poses=[(100, 100, 0.0), (130, 100, 0.0)])
    >>> model.sense()
    >>> centroids(Senses.of(model.swarm))[0][0]  # the other's near side, 25 ahead
    array([25.,  0.])
    """
    n = len(senses.distance)
    centroid, seen = np.empty((n, 2)), np.empty(n, np.int64)
    perceive_robots(senses.distance, senses.kind, senses.sensors, senses.design, centroid, seen)
    return centroid, seen


@compiled
def perceive_robots(distance, kind, sensors, design, centroid, seen):
    """Write the mean reconstructed position (n, 2) of what sees a robot, and the number of such sensors (n,)."""
    for i in range(distance.shape[0]):
        d, count, x, y = design[i], 0, 0.0, 0.0
        for s in range(distance.shape[1]):
            if kind[i, s] == ROBOT:
                count += 1
                x += sensors[d, s, MOUNT_X] + distance[i, s] * sensors[d, s, AXIS_X]
                y += sensors[d, s, MOUNT_Y] + distance[i, s] * sensors[d, s, AXIS_Y]
        seen[i] = count
        centroid[i, 0] = x / count if count else 0.0
        centroid[i, 1] = y / count if count else 0.0


@compiled
def nearest_ahead(distance, kind, bearing, design, nearest):
    """Write which sensor with |bearing| < 90 degrees sees the nearest robot (n,), -1 if none does (5.2, corrected).

    Of equal distances the sensor that looks more nearly ahead counts, then the first.
    """
    for i in range(distance.shape[0]):
        d, best = design[i], -1
        for s in range(distance.shape[1]):
            if kind[i, s] != ROBOT or abs(bearing[d, s]) >= 0.5 * math.pi - 1e-9:
                continue
            if (
                best < 0
                or distance[i, s] < distance[i, best]
                or (distance[i, s] == distance[i, best] and abs(bearing[d, s]) < abs(bearing[d, best]))
            ):
                best = s
        nearest[i] = best
