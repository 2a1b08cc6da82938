"""Distances and nearest points of solids, in the arithmetic of GEOS: the bits are those of Shapely.

The order of operations is that of GEOS 3.14: `DistanceOp`, `Distance`, `LineSegment`, `RayCrossingCounter` and
`CGAlgorithmsDD` (Shewchuk 1997, Discrete Comput. Geom. 18, 305-363, for the filter of the sign of a determinant).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import direction_of
from mesa_swarm.kernels.type_names import Flags, Integers, RealRows, Reals

# Share of a sum of products below which the sign of their difference may be that of rounding, as in GEOS.
UNSURE = 1e-15
SPLIT = 134217729.0


class Outlines(NamedTuple):
    """Solids as rings of points: polygons with holes or several of them, lines, and single points, which may be discs.

    Solid s has the rings ``order[solids[s]:solids[s + 1]]``, and ring r the points ``rings[r]`` to ``rings[r + 1]``, of
    which the last of a polygon's repeats the first.

    Parameters
    ----------
    local, points : ndarrays, shape (v, 2)
        About the centre of each solid, and where they are now.
    rings : int64 ndarray, shape (r + 1,)
    shells : bool ndarray, shape (r,)
        Whether a ring is the first of a polygon: those that follow are its holes.
    boxes : ndarray, shape (r, 4)
        x_min, y_min, x_max, y_max of each ring.
    order : int64 ndarray, shape (r,)
    solids : int64 ndarray, shape (s + 1,)
    radius : ndarray, shape (s,)
        Of discs, 0 for all others.
    """

    local: RealRows
    points: RealRows
    rings: Integers
    shells: Flags
    boxes: RealRows
    order: Integers
    solids: Integers
    radius: Reals


def outlines_of(geometries: Sequence[BaseGeometry], radius: Sequence[float] | np.ndarray) -> Outlines:
    """Return the outlines of points, lines of one segment, polygons, and several of these, as they are."""
    chains, shells, solids = [], [], [0]
    for geometry in geometries:
        for part in shapely.get_parts(geometry):
            rings = [part.exterior, *part.interiors] if part.geom_type == "Polygon" else [part]
            chains += [shapely.get_coordinates(ring) for ring in rings]
            shells += [part.geom_type == "Polygon" and place == 0 for place in range(len(rings))]
        solids.append(len(chains))
    local = np.concatenate([np.empty((0, 2)), *chains])
    starts = np.cumsum([0, *map(len, chains)])
    boxes = np.array([[*chain.min(axis=0), *chain.max(axis=0)] for chain in chains]).reshape(-1, 4)
    return Outlines(
        local=local,
        points=local.copy(),
        rings=starts,
        shells=np.array(shells, bool),
        boxes=boxes,
        order=np.arange(len(chains)),
        solids=np.array(solids),
        radius=np.array(radius, float),
    )


@compiled(apart=True)
def place_solid(solid, x, y, heading, outlines):
    """Write where the points of a solid are, in the order of `local`, when its centre and its heading are these."""
    local, points, rings, boxes = outlines.local, outlines.points, outlines.rings, outlines.boxes
    cosine, sine = direction_of(heading)
    for r in range(outlines.solids[solid], outlines.solids[solid + 1]):
        boxes[r, 0] = boxes[r, 1] = math.inf
        boxes[r, 2] = boxes[r, 3] = -math.inf
        for v in range(rings[r], rings[r + 1]):
            px, py = cosine * local[v, 0] - sine * local[v, 1] + x, sine * local[v, 0] + cosine * local[v, 1] + y
            points[v, 0], points[v, 1] = px, py
            boxes[r, 0], boxes[r, 2] = min(boxes[r, 0], px), max(boxes[r, 2], px)
            boxes[r, 1], boxes[r, 3] = min(boxes[r, 1], py), max(boxes[r, 3], py)


@compiled(apart=True)
def normalize_solid(solid, outlines):
    """Bring a placed polygon into Shapely's normal form: each ring begins at its least point, holes descend by it.

    The rings of `local` run as those of the normal form do: a shell clockwise, holes the other way round.
    """
    first, last, order = outlines.solids[solid], outlines.solids[solid + 1], outlines.order
    for r in range(first, last):
        roll_ring(outlines.rings[r], outlines.rings[r + 1] - 1, outlines.points)
        order[r] = r
    for k in range(first + 2, last):
        place = k
        while place > first + 1 and is_before(
            outlines.rings[order[place - 1]], outlines.rings[order[place]], outlines.points
        ):
            order[place - 1], order[place] = order[place], order[place - 1]
            place -= 1


@compiled
def roll_ring(first, last, points):
    """Roll points until the least comes first, in x and then in y; the point `last` repeats the first."""
    least = first
    for v in range(first + 1, last):
        if is_before(v, least, points):
            least = v
    # Three reversals roll in place.
    for begin, end in ((first, least), (least, last), (first, last)):
        for k in range((end - begin) // 2):
            a, b = begin + k, end - 1 - k
            x, y = points[a, 0], points[a, 1]
            points[a, 0], points[a, 1] = points[b, 0], points[b, 1]
            points[b, 0], points[b, 1] = x, y
    points[last, 0], points[last, 1] = points[first, 0], points[first, 1]


@compiled
def is_before(a, b, points):
    """Return whether point a comes before point b, by x and then by y."""
    return points[a, 0] < points[b, 0] or (points[a, 0] == points[b, 0] and points[a, 1] < points[b, 1])


@compiled(apart=True)
def gap_to_point(solid, x, y, limit, outlines):
    """Return the distance of a point from a solid, and the first point of the nearest segment, -1 if it is inside.

    The distance is `limit` if it is not less.
    """
    points, boxes = outlines.points, outlines.boxes
    if is_covered(x, y, solid, outlines):
        return 0.0, -1
    gap, nearest = limit, -1
    for k in range(outlines.solids[solid], outlines.solids[solid + 1]):
        r = outlines.order[k]
        first, last = outlines.rings[r], outlines.rings[r + 1]
        if last - first == 1:
            d = distance_of(x, y, points[first, 0], points[first, 1])
            if d < gap:
                gap, nearest = d, first
        elif math.sqrt(squared_box_gap(boxes[r, 0], boxes[r, 1], boxes[r, 2], boxes[r, 3], x, y, x, y)) <= gap:
            for v in range(first, last - 1):
                d = gap_to_segment(x, y, points[v, 0], points[v, 1], points[v + 1, 0], points[v + 1, 1])
                if d < gap:
                    gap, nearest = d, v
    return gap, nearest


@compiled(apart=True)
def gap_between(a, b, limit, outlines):
    """Return the distance of two solids, and the first points of their nearest segments, -1 if one is inside.

    The distance is `limit` if it is not less. Neither solid is a point.
    """
    boxes, rings = outlines.boxes, outlines.rings
    if is_first_point_in(a, b, outlines) or is_first_point_in(b, a, outlines):
        return 0.0, -1, -1
    gap, of_a, of_b = limit, -1, -1
    for k in range(outlines.solids[a], outlines.solids[a + 1]):
        for m in range(outlines.solids[b], outlines.solids[b + 1]):
            r, s = outlines.order[k], outlines.order[m]
            squared_gap = squared_box_gap(
                boxes[r, 0], boxes[r, 1], boxes[r, 2], boxes[r, 3], boxes[s, 0], boxes[s, 1], boxes[s, 2], boxes[s, 3]
            )
            if math.sqrt(squared_gap) > gap:
                continue
            chains = rings[r], rings[r + 1], rings[s], rings[s + 1]
            gap, of_a, of_b = gap_of_rings(chains, boxes[s], outlines.points, gap, of_a, of_b)
            if gap <= 0.0:
                return gap, of_a, of_b
    return gap, of_a, of_b


@compiled
def gap_of_rings(chains, box, points, gap, of_a, of_b):
    """Return gap, of_a and of_b, the best so far, or those of these rings, the second in a box, if they are nearer."""
    first_a, last_a, first_b, last_b = chains
    for i in range(first_a, last_a - 1):
        ax, ay, bx, by = points[i, 0], points[i, 1], points[i + 1, 0], points[i + 1, 1]
        x_min, y_min, x_max, y_max = min(ax, bx), min(ay, by), max(ax, bx), max(ay, by)
        if squared_box_gap(x_min, y_min, x_max, y_max, box[0], box[1], box[2], box[3]) > gap * gap:
            continue
        for j in range(first_b, last_b - 1):
            cx, cy, dx, dy = points[j, 0], points[j, 1], points[j + 1, 0], points[j + 1, 1]
            squared_gap = squared_box_gap(
                x_min, y_min, x_max, y_max, min(cx, dx), min(cy, dy), max(cx, dx), max(cy, dy)
            )
            if squared_gap > gap * gap:
                continue
            d = gap_between_segments(ax, ay, bx, by, cx, cy, dx, dy)
            if d < gap:
                gap, of_a, of_b = d, i, j
                if gap <= 0.0:
                    return gap, of_a, of_b
    return gap, of_a, of_b


@compiled
def squared_box_gap(a_left, a_low, a_right, a_high, b_left, b_low, b_right, b_high):
    """Return the squared distance of two boxes."""
    dx = max(a_right, b_right) - min(a_left, b_left) - (a_right - a_left) - (b_right - b_left)
    dy = max(a_high, b_high) - min(a_low, b_low) - (a_high - a_low) - (b_high - b_low)
    dx, dy = max(0.0, dx), max(0.0, dy)
    return dx * dx + dy * dy


@compiled
def distance_of(ax, ay, bx, by):
    """Return the distance of two points."""
    dx, dy = ax - bx, ay - by
    return math.sqrt(dx * dx + dy * dy)


@compiled
def gap_to_segment(x, y, ax, ay, bx, by):
    """Return the distance of a point from a segment a-b."""
    if ax == bx and ay == by:
        return distance_of(x, y, ax, ay)
    square = (bx - ax) * (bx - ax) + (by - ay) * (by - ay)
    share = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / square
    if share <= 0.0:
        return distance_of(x, y, ax, ay)
    if share >= 1.0:
        return distance_of(x, y, bx, by)
    return abs(((ay - y) * (bx - ax) - (ax - x) * (by - ay)) / square) * math.sqrt(square)


@compiled
def gap_between_segments(ax, ay, bx, by, cx, cy, dx, dy):
    """Return the distance of the segments a-b and c-d, 0 if they meet."""
    if ax == bx and ay == by:
        return gap_to_segment(ax, ay, cx, cy, dx, dy)
    if cx == dx and cy == dy:
        return gap_to_segment(dx, dy, ax, ay, bx, by)
    apart = max(ax, bx) < min(cx, dx) or max(cx, dx) < min(ax, bx) or max(ay, by) < min(cy, dy)
    determinant = (bx - ax) * (dy - cy) - (by - ay) * (dx - cx)
    if not apart and not max(cy, dy) < min(ay, by) and determinant != 0.0:
        r = ((ay - cy) * (dx - cx) - (ax - cx) * (dy - cy)) / determinant
        s = ((ay - cy) * (bx - ax) - (ax - cx) * (by - ay)) / determinant
        if not (r < 0.0 or r > 1.0 or s < 0.0 or s > 1.0):
            return 0.0
    of_first = min(gap_to_segment(ax, ay, cx, cy, dx, dy), gap_to_segment(bx, by, cx, cy, dx, dy))
    of_second = min(gap_to_segment(cx, cy, ax, ay, bx, by), gap_to_segment(dx, dy, ax, ay, bx, by))
    return min(of_first, of_second)


@compiled
def nearest_on_line(x, y, ax, ay, bx, by):
    """Return the point of the segment a-b nearest to (x, y): GEOS rounds otherwise than `nearest_on_segment`."""
    if not ((x == ax and y == ay) or (x == bx and y == by)):
        dx, dy = bx - ax, by - ay
        share = ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy)
        if 0.0 < share < 1.0:
            return ax + share * dx, ay + share * dy
    return (ax, ay) if distance_of(ax, ay, x, y) < distance_of(bx, by, x, y) else (bx, by)


@compiled
def nearest_of_segments(i, j, points):
    """Return the nearest points of two segments, named by their first points, that do not meet: px, py, qx, qy."""
    ax, ay, bx, by = points[i, 0], points[i, 1], points[i + 1, 0], points[i + 1, 1]
    cx, cy, dx, dy = points[j, 0], points[j, 1], points[j + 1, 0], points[j + 1, 1]
    gap, px, py, qx, qy = math.inf, 0.0, 0.0, 0.0, 0.0
    for x, y in ((cx, cy), (dx, dy)):
        nx, ny = nearest_on_line(x, y, ax, ay, bx, by)
        d = distance_of(nx, ny, x, y)
        if d < gap:
            gap, px, py, qx, qy = d, nx, ny, x, y
    for x, y in ((ax, ay), (bx, by)):
        nx, ny = nearest_on_line(x, y, cx, cy, dx, dy)
        d = distance_of(nx, ny, x, y)
        if d < gap:
            gap, px, py, qx, qy = d, x, y, nx, ny
    return px, py, qx, qy


@compiled
def is_first_point_in(a, b, outlines):
    """Return whether the first point of solid a, or of a polygon of it, is in or on a polygon of b."""
    if not outlines.shells[outlines.solids[b]]:
        return False
    for k in range(outlines.solids[a], outlines.solids[a + 1]):
        if k == outlines.solids[a] or outlines.shells[k]:
            v = outlines.rings[k]
            if is_covered(outlines.points[v, 0], outlines.points[v, 1], b, outlines):
                return True
    return False


@compiled
def is_covered(x, y, solid, outlines):
    """Return whether a point is in or on a polygon of a solid."""
    within = False  # of the shell of the present polygon
    for k in range(outlines.solids[solid], outlines.solids[solid + 1]):
        r = outlines.order[k]
        if outlines.shells[r]:
            if within:
                return True
        elif not within:
            continue
        where = locate_in_ring(x, y, r, outlines)
        if where == 0 and (outlines.shells[r] or within):
            return True
        within = where > 0 if outlines.shells[r] else where < 0
    return within


@compiled
def locate_in_ring(x, y, ring, outlines):
    """Return 1 if a point is in a ring, 0 if it is on it, -1 if it is outside."""
    points, box = outlines.points, outlines.boxes[ring]
    if not (box[0] <= x <= box[2] and box[1] <= y <= box[3]):
        return -1
    where = -1
    for v in range(outlines.rings[ring], outlines.rings[ring + 1] - 1):
        ax, ay, bx, by = points[v, 0], points[v, 1], points[v + 1, 0], points[v + 1, 1]
        if ax < x and bx < x:
            continue
        if x == bx and y == by:
            return 0
        if ay == y and by == y:
            if min(ax, bx) <= x <= max(ax, bx):
                return 0
        elif (ay > y and by <= y) or (by > y and ay <= y):
            side = side_of(ax, ay, bx, by, x, y)
            if side == 0:
                return 0
            if (side > 0) == (by > ay):
                where = -where
    return where


@compiled
def side_of(ax, ay, bx, by, x, y):
    """Return 1 if a point is to the left of the line from a to b, -1 if it is to the right, 0 if it is on it."""
    left, right = (ax - x) * (by - y), (ay - y) * (bx - x)
    determinant = left - right
    same_sign = (left > 0.0 and right > 0.0) or (left < 0.0 and right < 0.0)
    if not same_sign or abs(determinant) >= UNSURE * abs(left + right):
        return sign_of(determinant, 0.0)
    first = multiply_exactly(*add_exactly(bx, -ax), *add_exactly(y, -by))
    second = multiply_exactly(*add_exactly(by, -ay), *add_exactly(x, -bx))
    return sign_of(*subtract_exactly(*first, *second))


@compiled
def sign_of(high, low):
    """Return the sign of a number in two parts: -1, 0 or 1."""
    part = high if high != 0.0 else low
    return 1 if part > 0.0 else (-1 if part < 0.0 else 0)


@compiled
def add_exactly(a, b):
    """Return the sum of two numbers and what rounding has taken from it, without error."""
    high = a + b
    shift = high - a
    return high, (a - (high - shift)) + (b - shift)


@compiled
def subtract_exactly(high, low, other_high, other_low):
    """Return the difference of two numbers in two parts, in two parts."""
    total, error = add_exactly(high, -other_high)
    low_total, low_lost = add_exactly(low, -other_low)
    error += low_total
    big = total + error
    rest = low_lost + (error + (total - big))
    result = big + rest
    return result, rest + (big - result)


@compiled
def multiply_exactly(high, low, other_high, other_low):
    """Return the product of two numbers in two parts, in two parts (Dekker 1971)."""
    a, b = split_digits(high)
    c, d = split_digits(other_high)
    total = high * other_high
    error = ((((a * c - total) + a * d) + b * c) + b * d) + (high * other_low + low * other_high)
    result = total + error
    return result, error + (total - result)


@compiled
def split_digits(number):
    """Return the upper and the lower half of the digits of a number."""
    scaled = SPLIT * number
    upper = scaled - (scaled - number)
    return upper, number - upper


@compiled
def is_point(solid, outlines):
    """Return whether a solid is a point, or a disc."""
    ring = outlines.solids[solid]
    return outlines.rings[ring + 1] - outlines.rings[ring] == 1


@compiled
def first_point(solid, outlines):
    """Return the first point of a solid, all of a point."""
    v = outlines.rings[outlines.solids[solid]]
    return outlines.points[v, 0], outlines.points[v, 1]


@compiled
def gap_of(a, b, limit, outlines):
    """Return the distance of two solids, of a disc of its centre; `limit` if it is not less."""
    if is_point(b, outlines):
        x, y = first_point(b, outlines)
        return gap_to_point(a, x, y, limit, outlines)[0]
    if is_point(a, outlines):
        x, y = first_point(a, outlines)
        return gap_to_point(b, x, y, limit, outlines)[0]
    return gap_between(a, b, limit, outlines)[0]


@compiled
def nearest_to_point(solid, x, y, limit, outlines):
    """Return the point of a solid nearest to (x, y), itself if it is inside or not nearer than `limit`."""
    v = gap_to_point(solid, x, y, limit, outlines)[1]
    points = outlines.points
    if v < 0:
        return x, y
    if is_point(solid, outlines):
        return points[v, 0], points[v, 1]
    return nearest_on_line(x, y, points[v, 0], points[v, 1], points[v + 1, 0], points[v + 1, 1])


@compiled
def nearest_points(a, b, outlines):
    """Return the nearest points of two solids that are not both points, px, py, qx, qy; equal ones if they meet.

    Segments that touch but for rounding, where GEOS might take them to cross, are apart here.
    """
    if is_point(b, outlines):
        x, y = first_point(b, outlines)
        px, py = nearest_to_point(a, x, y, math.inf, outlines)
        return px, py, x, y
    if is_point(a, outlines):
        x, y = first_point(a, outlines)
        px, py = nearest_to_point(b, x, y, math.inf, outlines)
        return x, y, px, py
    gap, i, j = gap_between(a, b, math.inf, outlines)
    return nearest_of_segments(i, j, outlines.points) if gap > 0.0 else (0.0, 0.0, 0.0, 0.0)
