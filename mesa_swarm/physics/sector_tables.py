"""Tables by which most sensors are sorted out that a body cannot reach, several at a time, and the loops that do it.

A row of a table is a field of `LANES` sensors: of constantly many a compiler makes instructions for several at once.
What is left is looked at exactly; nothing that a sensor would read may be sorted out here.
"""

import math

import numpy as np

from mesa_swarm.geometry import Bounds
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.robots.design import AXIS_X, AXIS_Y, COS_HALF, MOUNT_X, MOUNT_Y, RANGE, SIN_HALF

# Sensors of a group; bits of an integer mark some of them.
LANES = 8
# Fields of a group. Three sides of a narrow sector: the normal of each, outwards, and how far along it nothing is seen
# from there on, 0 and infinite for a sector of more than half a circle; mounts; and ranges.
LEFT_X, LEFT_Y, LEFT, RIGHT_X, RIGHT_Y, RIGHT, BACK_X, BACK_Y, BACK, AT_X, AT_Y, FAR, FIELDS = range(13)
# How far beside its sector, in radii of the largest robot and in sizes of what is near, a body has to be: farther than
# rounding and touch reach.
OF_RADIUS, OF_SIZE = 1e-3, 1e-9
# Of squares, and of lengths, for the same reason.
LARGER, SLACK = 1.0 + 1e-6, 1e-6


def groups_of(count: int) -> int:
    """Return how many groups this number of sensors are, at least one."""
    return max(-(-count // LANES), 1)


def clearance_of(radius: float, reach: np.ndarray, bounds: Bounds) -> float:
    """Return how far beside a sector a body has to be, for the largest radius and sensors that see this far.

    Examples
    --------
    >>> clearance_of(1.0, np.zeros(1), (0.0, 0.0, 300.0, 400.0))
    0.0010005
    """
    west, south, east, north = bounds
    return OF_RADIUS * radius + OF_SIZE * (float(reach.max(initial=0.0)) + math.hypot(east - west, north - south))


def tables_of_sectors(sensors: np.ndarray, clearance: float) -> np.ndarray:
    """Return the table (designs times groups, fields, lanes) of these sensors (d, s, 9), see `Swarm.table.proximity`.

    Examples
    --------
    >>> tables_of_sectors(np.zeros((2, 9, 9)), 0.1).shape
    (4, 12, 8)
    """
    designs, count, _ = sensors.shape
    groups = groups_of(count)
    table = np.zeros((designs, groups * LANES, FIELDS))
    # Where there is not any sensor, all is beside it.
    table[..., LEFT], table[..., FAR] = -np.inf, -1.0
    is_sensor = np.zeros((designs, groups * LANES), bool)
    is_sensor[:, :count] = sensors[..., RANGE] >= 0.0
    table[is_sensor] = fields_of_sectors(sensors[sensors[..., RANGE] >= 0.0], clearance)
    rows = table.reshape(designs * groups, LANES, FIELDS)
    return np.ascontiguousarray(rows.transpose(0, 2, 1))


def fields_of_sectors(sensors: np.ndarray, clearance: float) -> np.ndarray:
    """Return the fields of sensors (s, 9), a row a sensor."""
    mount, axis = sensors[:, [MOUNT_X, MOUNT_Y]], sensors[:, [AXIS_X, AXIS_Y]]
    cosine, sine = sensors[:, [COS_HALF]], sensors[:, [SIN_HALF]]
    across = np.column_stack([-axis[:, 1], axis[:, 0]])
    wide = np.where(sensors[:, COS_HALF] < 0.0, np.inf, 0.0)
    sides = []
    for normal in (cosine * across - sine * axis, -cosine * across - sine * axis, -axis):
        outwards = np.where(cosine < 0.0, 0.0, normal)
        sides += [outwards, np.sum(outwards * mount, axis=1) + clearance + wide]
    return np.column_stack([*sides, mount, sensors[:, RANGE]])


@compiled
def lanes_at_edge(table, group, near, k, g, ax, ay, bx, by, clearance):
    """Return a bit for each sensor of a group that the edge a-b may reach, within what it reads so far.

    The edge is in the frame of the robot, of whose readings those of the group are ``near[k, g]``.
    """
    dx, dy = bx - ax, by - ay
    side, length, lanes = ax * dy - ay * dx, math.sqrt(dx * dx + dy * dy), 0
    slack = SLACK * length
    for s in range(LANES):
        left_x, left_y = table[group, LEFT_X, s], table[group, LEFT_Y, s]
        right_x, right_y = table[group, RIGHT_X, s], table[group, RIGHT_Y, s]
        back_x, back_y = table[group, BACK_X, s], table[group, BACK_Y, s]
        left = min(left_x * ax + left_y * ay, left_x * bx + left_y * by) - table[group, LEFT, s]
        right = min(right_x * ax + right_y * ay, right_x * bx + right_y * by) - table[group, RIGHT, s]
        behind = min(back_x * ax + back_y * ay, back_x * bx + back_y * by) - table[group, BACK, s]
        across = side - (table[group, AT_X, s] * dy - table[group, AT_Y, s] * dx)
        x, y = (dx, dy) if across >= 0.0 else (-dx, -dy)
        # The line is nearest at its foot, if that is within the sector, else along the left or the right side of it.
        outside = max(left_x * y - left_y * x, right_x * y - right_y * x, back_x * y - back_y * x)
        along_sides = max(left_x * x + left_y * y, -right_x * x - right_y * y)
        nearing = (length if outside <= slack else along_sides) + slack
        beyond = abs(across) - max(near[k, g, s] * nearing, clearance * length)
        lanes |= np.int64(not max(left, right, behind, beyond) > 0.0) << s
    return lanes
