"""Exact distances from the apex of a sector to discs and segments inside it.

A sector is what an infrared sensor sees: all points within `limit` of its apex and within half its field
of view of its axis. Every function here works in the sensor's own frame: the apex is the origin, the axis
points along +x, y is to the left. The half angle h is given as (cos h, sin h), from `half_angle`, so that
0, pi/2 and pi are exact. A distance of `inf` means that no part is seen.
"""

import math

from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import direction_of

# A segment nearer than this (rad) to a ray's direction is taken as parallel to it.
PARALLEL = 1e-12


def half_angle(field_of_view: float) -> tuple[float, float]:
    """Return (cos, sin) of half a field of view, exact at 0, pi and 2 pi.

    Parameters
    ----------
    field_of_view : float
        Full angle in radians, 0 to 2 pi.

    Examples
    --------
    >>> half_angle(2 * math.pi)
    (-1.0, 0.0)
    """
    exact = {0.0: (1.0, 0.0), math.pi: (0.0, 1.0), 2 * math.pi: (-1.0, 0.0)}
    half = field_of_view / 2
    return exact.get(field_of_view, direction_of(half))


@compiled
def is_in_cone(x: float, y: float, cos_half: float, sin_half: float) -> bool:
    """Return whether the direction (x, y) lies within the half angle of the +x axis, edges included.

    Examples
    --------
    >>> is_in_cone(1.0, 1.0, *half_angle(math.pi))
    True
    """
    return abs(y) * cos_half <= x * sin_half and (x >= 0.0 or cos_half < 0.0)


@compiled
def ray_to_disc(x: float, y: float, radius: float, ray_x: float, ray_y: float) -> float:
    """Return how far along a unit ray from the origin a disc is first met, `inf` if never (A.12, A.13).

    Examples
    --------
    >>> ray_to_disc(10.0, 0.0, 4.0, 1.0, 0.0)
    6.0
    """
    if x * x + y * y <= radius * radius:
        return 0.0
    along = x * ray_x + y * ray_y
    across = x * ray_y - y * ray_x
    inside = radius * radius - across * across
    if along <= 0.0 or inside < 0.0:
        return math.inf
    return along - math.sqrt(inside)


@compiled
def ray_to_segment(ax: float, ay: float, bx: float, by: float, ray_x: float, ray_y: float) -> float:
    """Return how far along a unit ray from the origin the segment a-b is met, `inf` if never.

    A segment parallel to the ray is met at most in an end point, which the callers check themselves.

    Examples
    --------
    >>> ray_to_segment(5.0, -1.0, 5.0, 1.0, 1.0, 0.0)
    5.0
    """
    dx, dy = bx - ax, by - ay
    across = ray_x * dy - ray_y * dx
    # Within rounding of parallel, the crossing of the lines is arbitrary, even behind the origin.
    if across * across <= PARALLEL * PARALLEL * (dx * dx + dy * dy):
        return math.inf
    along = (ax * dy - ay * dx) / across
    share = (ax * ray_y - ay * ray_x) / across
    if along < 0.0 or share < 0.0 or share > 1.0:
        return math.inf
    return along


@compiled
def sector_to_disc(x: float, y: float, radius: float, cos_half: float, sin_half: float, limit: float) -> float:
    """Return the distance from the apex to the nearest point of a disc inside the sector.

    Parameters
    ----------
    x, y, radius : float
        The disc, in the sensor's frame.
    cos_half, sin_half : float
        The half angle of the sector.
    limit : float
        The range; a disc farther than this is not seen.

    Returns
    -------
    float
        0 if the apex is in the disc, `inf` if no part of the disc is in the sector.

    Examples
    --------
    >>> sector_to_disc(20.0, 0.0, 5.0, *half_angle(0.5), 50.0)
    15.0
    """
    # Most discs are beside a narrow sector, or behind it: farther than a radius from its nearer edge.
    if cos_half >= 0.0 and (abs(y) * cos_half - x * sin_half > radius or x < -radius):
        return math.inf
    square = x * x + y * y
    if square > (limit + radius) * (limit + radius):
        return math.inf
    if square <= radius * radius:
        return 0.0
    if is_in_cone(x, y, cos_half, sin_half):
        distance = math.sqrt(square) - radius
    else:
        # The farther from the centre's direction, the farther the rim: only the nearer edge matters.
        distance = ray_to_disc(x, abs(y), radius, cos_half, sin_half)
    return distance if distance <= limit else math.inf


@compiled
def sector_to_segment(
    ax: float, ay: float, bx: float, by: float, cos_half: float, sin_half: float, limit: float
) -> float:
    """Return the distance from the apex to the nearest point of the segment a-b inside the sector.

    Returns
    -------
    float
        `inf` if no part of the segment is in the sector and within `limit`.

    Examples
    --------
    >>> sector_to_segment(10.0, -30.0, 10.0, 30.0, *half_angle(0.5), 50.0)
    10.0
    """
    dx, dy = bx - ax, by - ay
    length = dx * dx + dy * dy
    share = 0.0 if length == 0.0 else min(max(-(ax * dx + ay * dy) / length, 0.0), 1.0)
    x, y = ax + share * dx, ay + share * dy
    square = x * x + y * y
    if square > limit * limit:
        return math.inf
    if is_in_cone(x, y, cos_half, sin_half):
        return math.sqrt(square)
    upper = ray_to_segment(ax, ay, bx, by, cos_half, sin_half)
    nearest = min(upper, ray_to_segment(ax, ay, bx, by, cos_half, -sin_half))
    if is_in_cone(ax, ay, cos_half, sin_half):
        nearest = min(nearest, math.sqrt(ax * ax + ay * ay))
    if is_in_cone(bx, by, cos_half, sin_half):
        nearest = min(nearest, math.sqrt(bx * bx + by * by))
    return nearest if nearest <= limit else math.inf


@compiled
def rays_to_disc(x: float, y: float, radius: float, half: float, rays: int, limit: float) -> float:
    """Return what `sector_to_disc` does, with the sector replaced by evenly spread rays (A.11-A.14).

    Parameters
    ----------
    half : float
        Half the field of view, rad.
    rays : int
        How many rays, at least 1; the outermost lie on the edges.

    Examples
    --------
    >>> rays_to_disc(20.0, 0.0, 5.0, 0.25, 3, 50.0)
    15.0
    """
    nearest = math.inf
    for k in range(rays):
        azimuth = ray_azimuth(k, rays, half)
        cosine, sine = direction_of(azimuth)
        nearest = min(nearest, ray_to_disc(x, y, radius, cosine, sine))
    return nearest if nearest <= limit else math.inf


@compiled
def rays_to_segment(ax: float, ay: float, bx: float, by: float, half: float, rays: int, limit: float) -> float:
    """Return what `sector_to_segment` does, with evenly spread rays (A.15-A.16, signs corrected).

    Examples
    --------
    >>> rays_to_segment(10.0, -30.0, 10.0, 30.0, 0.25, 1, 50.0)
    10.0
    """
    nearest = math.inf
    for k in range(rays):
        azimuth = ray_azimuth(k, rays, half)
        cosine, sine = direction_of(azimuth)
        nearest = min(nearest, ray_to_segment(ax, ay, bx, by, cosine, sine))
    return nearest if nearest <= limit else math.inf


@compiled
def ray_azimuth(k: int, rays: int, half: float) -> float:
    """Return the direction of the k-th of evenly spread rays; a single ray lies on the axis.

    Examples
    --------
    >>> ray_azimuth(0, 3, 0.5)
    -0.5
    """
    if rays == 1:
        return 0.0
    return half * (2.0 * k / (rays - 1) - 1.0)
