"""Nearest points, crossings and insides of segments and polygons."""

import math

import numpy as np

from mesa_swarm.kernels.compiled import compiled


@compiled
def wrap_angle(heading: float) -> float:
    """Return a heading, bearing or turn in [-pi, pi).

    Examples
    --------
    >>> wrap_angle(math.pi)
    -3.141592653589793
    """
    if -math.pi <= heading < math.pi:
        return heading
    turned = heading - 2.0 * math.pi * math.floor((heading + math.pi) / (2.0 * math.pi))
    return turned if turned < math.pi else -math.pi


@compiled
def nearest_on_segment(x: float, y: float, ax: float, ay: float, bx: float, by: float) -> tuple[float, float, bool]:
    """Return the point of the segment a-b nearest to (x, y), and whether it lies between the end points.

    Examples
    --------
    >>> nearest_on_segment(3.0, 4.0, 0.0, 0.0, 10.0, 0.0)
    (3.0, 0.0, True)
    """
    dx, dy = bx - ax, by - ay
    along = (x - ax) * dx + (y - ay) * dy
    length = dx * dx + dy * dy
    if along <= 0.0 or length == 0.0:
        return ax, ay, False
    if along >= length:
        return bx, by, False
    share = along / length
    return ax + share * dx, ay + share * dy, True


@compiled
def segments_meet(ax: float, ay: float, bx: float, by: float, cx: float, cy: float, dx: float, dy: float) -> bool:
    """Return whether the segments a-b and c-d have a point in common, end points included.

    Examples
    --------
    >>> segments_meet(0.0, 0.0, 2.0, 2.0, 0.0, 2.0, 2.0, 0.0), segments_meet(0.0, 0.0, 1.0, 0.0, 2.0, 0.0, 3.0, 0.0)
    (True, False)
    """
    # Without this, segments on one line would seem to meet wherever they are.
    if max(ax, bx) < min(cx, dx) or max(cx, dx) < min(ax, bx) or max(ay, by) < min(cy, dy) or max(cy, dy) < min(ay, by):
        return False
    c_side = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    d_side = (bx - ax) * (dy - ay) - (by - ay) * (dx - ax)
    a_side = (dx - cx) * (ay - cy) - (dy - cy) * (ax - cx)
    b_side = (dx - cx) * (by - cy) - (dy - cy) * (bx - cx)
    return c_side * d_side <= 0.0 and a_side * b_side <= 0.0


@compiled
def is_in_polygon(x: float, y: float, edges: np.ndarray, first: int, last: int) -> bool:
    """Return whether (x, y) is inside the polygon whose rings' edges are rows first..last-1 (even-odd rule).

    Parameters
    ----------
    edges : ndarray, shape (m, 4)
        ax, ay, bx, by; any order, holes included.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 4, 0], [4, 0, 4, 4], [4, 4, 0, 4], [0, 4, 0, 0]])
    >>> is_in_polygon(1.0, 1.0, square, 0, 4)
    True
    """
    inside = False
    for e in range(first, last):
        ay, by = edges[e, 1], edges[e, 3]
        if (ay > y) != (by > y):
            ax, bx = edges[e, 0], edges[e, 2]
            if x < ax + (y - ay) / (by - ay) * (bx - ax):
                inside = not inside
    return inside
