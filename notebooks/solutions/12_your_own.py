"""Solutions of notebook 12; each part may be pasted into the cell of its exercise."""

from mesa_swarm import ProximitySensor, RobotDesign
from mesa_swarm.control import behaviour


# %% exercise-1
@behaviour
def one_eye(me):
    """Follow the line's edge: on the line curve to the right, off it to the left."""
    if me.line[0]:
        return me.max_speed, 0.6 * me.max_speed
    return 0.6 * me.max_speed, me.max_speed


# %% exercise-2
watchman = RobotDesign(
    name="watchman",
    sensors=tuple(ProximitySensor(bearing_degrees=60.0 * k, field_of_view_degrees=70, range=30) for k in range(6)),
)
