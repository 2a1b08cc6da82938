"""Solutions of notebook 3; each part may be pasted into the cell of its exercise."""

from mesa_swarm.control import PASS, behaviour


# %% exercise-1
@behaviour
def turn_away(me, distance=15.0):
    """Turn to one side only, the robot's own, whichever sensor detects something."""
    for sensor in (me.front, me.left, me.right):
        if 0 <= me.distance[sensor] < distance:
            return -me.tendency * me.max_speed, me.tendency * me.max_speed
    return PASS


# %% exercise-2
# With a large distance both walls of the corridor are near at once, and the robot turns to and fro at the entrance.
# With a very small one it touches the wall before it has turned.
distance = 8
