"""Answers to the exercises of notebook 12."""


# %% exercise-1 right: the outer edge, with gentle curves
@behaviour
def one_eye(me):
    if me.line[0]:
        return me.max_speed, 0.8 * me.max_speed
    return 0.8 * me.max_speed, me.max_speed


# %% exercise-1 right: the inner edge
@behaviour
def one_eye(me):
    if me.line[0]:
        return 0.7 * me.max_speed, me.max_speed
    return me.max_speed, 0.7 * me.max_speed


# %% exercise-1 right: straight on the line, back to the left off it
@behaviour
def one_eye(me, inner=0.3):
    if me.line[0]:
        return me.max_speed, me.max_speed
    return inner * me.max_speed, me.max_speed


# %% exercise-1 right: one wheel stands
@behaviour
def one_eye(me):
    return (1.0, 0.0) if me.line[0] else (0.0, 1.0)


# %% exercise-1 right: a plain function without a decorator, by a condition turned round
def one_eye(me):
    if not me.line[0]:
        return 0.5 * me.max_speed, 1.0 * me.max_speed
    return 1.0 * me.max_speed, 0.5 * me.max_speed


# %% exercise-1 right: with memory, sharper the longer the line is lost
@behaviour(memory={"lost": 0})
def one_eye(me):
    if me.line[0]:
        me.memory.lost = 0
        return me.max_speed, 0.8 * me.max_speed
    me.memory.lost += 1
    return max(0.0, 0.9 - 0.02 * me.memory.lost) * me.max_speed, me.max_speed


# %% exercise-1 right: slowly
@behaviour
def one_eye(me):
    slow, fast = 0.45 * me.max_speed, 0.75 * me.max_speed
    if me.line[0]:
        return fast, slow
    return slow, fast


# %% exercise-1 hint: the wheels of the last stage
@behaviour
def one_eye(me):
    if me.line[0]:
        return (me.max_speed, 0.6 * me.max_speed)
    return (0.6 * me.max_speed, me.max_speed)


# %% exercise-1 wrong: always straight on
@behaviour
def one_eye(me):
    return me.max_speed, me.max_speed


# %% exercise-1 wrong: two sensors, of which there is one
@behaviour
def one_eye(me):
    if me.line[0] and not me.line[1]:
        return 0.5 * me.max_speed, me.max_speed
    if me.line[1] and not me.line[0]:
        return me.max_speed, 0.5 * me.max_speed
    return PASS


# %% exercise-1 wrong: waiting on the line
@behaviour
def one_eye(me):
    if me.line[0]:
        return 0.0, 0.0
    return me.max_speed, 0.5 * me.max_speed


# %% exercise-1 wrong: turning round on the spot
@behaviour
def one_eye(me):
    return -me.max_speed, me.max_speed


# %% exercise-1 wrong: curving to one side, on the line or off it
@behaviour
def one_eye(me):
    return 0.97 * me.max_speed, me.max_speed


# %% exercise-1 wrong: forward and back
@behaviour
def one_eye(me):
    if me.line[0]:
        return me.max_speed, me.max_speed
    return -me.max_speed, -me.max_speed


# %% exercise-1 wrong: nothing is returned
@behaviour
def one_eye(me):
    if me.line[0]:
        me.max_speed, 0.6 * me.max_speed
# %% exercise-1 wrong: in a circle, without looking
@behaviour
def one_eye(me):
    return 0.92 * me.max_speed, me.max_speed
# %% exercise-1 wrong: at random
@behaviour
def one_eye(me):
    if me.chance < 0.5:
        return 0.5, 1.0
    return 1.0, 0.5
# %% exercise-1 wrong: waits on the line, then explores with turns
@behaviour(memory={"steps": 0})
def one_eye(me):
    me.memory.steps += 1
    if me.memory.steps < 420:
        return 0.0, 0.0
    return 0.93 * me.max_speed, me.max_speed
# %% exercise-2 right: one sensor that looks everywhere
watchman = RobotDesign(name="watchman", sensors=(ProximitySensor(field_of_view_degrees=360, range=30),))


# %% exercise-2 right: two sensors of more than half a circle, in a list
watchman = RobotDesign(
    sensors=[ProximitySensor(bearing_degrees=b, field_of_view_degrees=220, range=40) for b in (0, 180)]
)


# %% exercise-2 right: three wide ones
watchman = RobotDesign(
    name="three",
    sensors=tuple(ProximitySensor(bearing_degrees=b, field_of_view_degrees=130, range=25.0) for b in (0, 120, -120)),
)


# %% exercise-2 right: six that just touch
watchman = RobotDesign(
    name="watchman",
    sensors=tuple(ProximitySensor(bearing_degrees=60 * k, field_of_view_degrees=60, range=30) for k in range(6)),
)


# %% exercise-2 right: the package's own design of this kind
from mesa_swarm import all_round

watchman = all_round(5)


# %% exercise-2 right: a smaller robot with four eyes
watchman = RobotDesign(
    radius=3,
    sensors=tuple(
        ProximitySensor(bearing_degrees=float(b), field_of_view_degrees=95.0, range=50)
        for b in np.arange(4) * 90.0
    ),
)


# %% exercise-2 hint: its last stage
watchman = RobotDesign(
    name="watchman",
    sensors=tuple(
        ProximitySensor(bearing_degrees=b, field_of_view_degrees=70, range=30) for b in (0, 60, 120, 180, 240, 300)
    ),
)


# %% exercise-2 wrong: seven sensors
watchman = RobotDesign(
    sensors=tuple(ProximitySensor(bearing_degrees=51.5 * k, field_of_view_degrees=52, range=30) for k in range(7)),
)


# %% exercise-2 wrong: too short a range
watchman = RobotDesign(
    sensors=tuple(ProximitySensor(bearing_degrees=60 * k, field_of_view_degrees=70, range=10) for k in range(6)),
)


# %% exercise-2 wrong: gaps between the sectors
from mesa_swarm import AGENT6

watchman = AGENT6


# %% exercise-2 wrong: six sensors, all ahead
watchman = RobotDesign(sensors=tuple(ProximitySensor(field_of_view_degrees=60, range=30) for _ in range(6)))


# %% exercise-2 wrong: bearings in radians
watchman = RobotDesign(
    sensors=tuple(
        ProximitySensor(bearing_degrees=k * np.pi / 3, field_of_view_degrees=60, range=30) for k in range(6)
    ),
)


# %% exercise-2 wrong: the robot of the thesis with nine sensors
from mesa_swarm import AGENT9

watchman = AGENT9


# %% exercise-2 wrong: sensors without a robot
watchman = [ProximitySensor(bearing_degrees=60 * k, field_of_view_degrees=70, range=30) for k in range(6)]


# %% exercise-2 wrong: line sensors
watchman = RobotDesign(sensors=tuple(LineSensor(mount=(k, 0)) for k in range(6)))


# %% exercise-2 wrong: two half circles that begin at the rim, with a gap between them
watchman = RobotDesign(
    sensors=[ProximitySensor(bearing_degrees=b, field_of_view_degrees=180, range=40) for b in (0, 180)]
)


# %% exercise-2 wrong: blind
watchman = RobotDesign(name="watchman")
# %% exercise-2 wrong: three wide ones ahead
watchman = RobotDesign(name="watchman", sensors=tuple(ProximitySensor(bearing_degrees=b, field_of_view_degrees=60, range=30) for b in (0, 60, -60)))
# %% exercise-2 wrong: six sensors to one side
watchman = RobotDesign(name="watchman", sensors=tuple(ProximitySensor(bearing_degrees=30 * k, field_of_view_degrees=70, range=30) for k in range(6)))
# %% exercise-2 wrong: twelve narrow ones
watchman = RobotDesign(name="watchman", sensors=tuple(ProximitySensor(bearing_degrees=30 * k, field_of_view_degrees=35, range=30) for k in range(12)))
