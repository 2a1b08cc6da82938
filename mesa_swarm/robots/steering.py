"""Steering two wheels towards something."""

from mesa_swarm.geometry.compiled import compiled


@compiled
def turn_towards(bearing: float, speed: float, radius: float) -> tuple[float, float]:
    """Return wheel speeds that turn on the spot towards a bearing (rad), in one step if `speed` allows it.

    Examples
    --------
    >>> turn_towards(-1.0, 2.0, 5.0)
    (2.0, -2.0)
    """
    rim = min(abs(bearing) * radius, speed)
    return (-rim, rim) if bearing > 0.0 else (rim, -rim)


@compiled
def approach(bearing: float, critical_angle: float, speed: float, radius: float) -> tuple[float, float]:
    """Return wheel speeds that turn on the spot towards a bearing, or go straight if it is ahead.

    Examples
    --------
    >>> approach(0.0, 0.2, 1.0, 5.0)
    (1.0, 1.0)
    """
    if abs(bearing) <= critical_angle:
        return speed, speed
    return turn_towards(bearing, speed, radius)
