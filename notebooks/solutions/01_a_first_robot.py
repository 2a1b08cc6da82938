"""Solutions of notebook 1; each part may be pasted into the cell of its exercise."""

from mesa_swarm.control import PASS, behaviour


# %% exercise-1
@behaviour
def careful(me, distance=15.0):
    """Turn away in time."""
    if 0 <= me.distance[me.left] < distance:
        return me.max_speed, -me.max_speed
    if 0 <= me.distance[me.front] < distance or 0 <= me.distance[me.right] < distance:
        return -me.max_speed, me.max_speed
    return PASS


# %% exercise-2
@behaviour
def circle(me):
    """Drive round a circle of radius 50: (left + right) / (right - left) = 50 / 5."""
    return me.max_speed * 45.0 / 55.0, me.max_speed
