"""How a robot steers to what it knows the bearing of."""

from mesa_swarm.geometry.compiled import compiled


@compiled
def approach(bearing, critical_angle, speed, radius):
    """Return wheel speeds that turn on the spot towards a bearing, or go straight if it is ahead.

    Examples
    --------
    >>> approach(0.0, 0.2, 1.0, 5.0)
    (1.0, 1.0)
    """
    if abs(bearing) <= critical_angle:
        return speed, speed
    rim = min(abs(bearing) * radius, speed)
    return (-rim, rim) if bearing > 0.0 else (rim, -rim)
