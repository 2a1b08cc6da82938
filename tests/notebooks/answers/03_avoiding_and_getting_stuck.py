"""Answers to the exercises of notebook 3."""


# %% exercise-1 right: always to the left
@behaviour
def turn_away(me, distance=15.0):
    if (
        0 <= me.distance[me.right] < distance
        or 0 <= me.distance[me.left] < distance
        or 0 <= me.distance[me.front] < distance
    ):
        return -me.max_speed, me.max_speed
    return PASS
# %% exercise-1 right: always to the right, and straight on by itself
@behaviour
def turn_away(me):
    for sensor in (me.front, me.right, me.left):
        if me.distance[sensor] >= 0 and me.distance[sensor] < 14:
            return me.max_speed, -me.max_speed
    return me.max_speed, me.max_speed
# %% exercise-1 right: on to the side of the last turn, until all three are free
@behaviour(memory={"side": 0})
def turn_away(me, distance=15.0):
    left = 0 <= me.distance[me.left] < distance
    right = 0 <= me.distance[me.right] < distance
    front = 0 <= me.distance[me.front] < distance
    if not (left or right or front):
        me.memory.side = 0
        return PASS
    if me.memory.side == 0:
        me.memory.side = -1 if left else 1
    return -me.memory.side * me.max_speed, me.memory.side * me.max_speed
# %% exercise-1 right: to the side of the first turn, for ever
@behaviour(memory={"side": 0.0})
def turn_away(me, distance=15.0):
    if me.memory.side == 0.0:
        if 0 <= me.distance[me.right] < distance:
            me.memory.side = 1.0
        elif 0 <= me.distance[me.left] < distance:
            me.memory.side = -1.0
    for sensor in (me.front, me.left, me.right):
        if 0 <= me.distance[sensor] < distance:
            side = me.memory.side if me.memory.side != 0.0 else me.tendency
            return -side * me.max_speed, side * me.max_speed
    return PASS
# %% exercise-1 right: slowly, and at another distance
@behaviour
def turn_away(me, distance=20.0):
    near = False
    for sensor in (me.front, me.left, me.right):
        near = near or 0 <= me.distance[sensor] < distance
    if near:
        return 0.5 * me.max_speed, -0.5 * me.max_speed
    return PASS
# %% exercise-1 right: a plain function with the robot's own side
def turn_away(me):
    v = me.tendency * me.max_speed
    if 0 <= me.distance[me.front] < 15:
        return -v, v
    if 0 <= me.distance[me.left] < 15:
        return -v, v
    if 0 <= me.distance[me.right] < 15:
        return -v, v
    return PASS
# %% exercise-1 hint: to the robot's own side, whichever sensor detects something
@behaviour
def turn_away(me, distance=15.0):
    for sensor in (me.front, me.left, me.right):
        if 0 <= me.distance[sensor] < distance:
            return -me.tendency * me.max_speed, me.tendency * me.max_speed
    return PASS
# %% exercise-1 wrong: reversing
@behaviour
def turn_away(me, distance=15.0):
    for sensor in (me.front, me.left, me.right):
        if 0 <= me.distance[sensor] < distance:
            return -me.max_speed, -0.5 * me.max_speed
    return PASS
# %% exercise-1 wrong: reversing straight, for a time, then turning
@behaviour(memory={"steps": 0})
def turn_away(me, distance=15.0):
    for sensor in (me.front, me.left, me.right):
        if 0 <= me.distance[sensor] < distance and me.memory.steps == 0:
            me.memory.steps = 60
    if me.memory.steps == 0:
        return PASS
    me.memory.steps -= 1
    if me.memory.steps > 20:
        return -me.max_speed, -me.max_speed
    return -me.max_speed, me.max_speed
# %% exercise-1 wrong: backwards from the start
@behaviour
def turn_away(me):
    return -0.1 * me.max_speed, -0.1 * me.max_speed
# %% exercise-1 wrong: on a curve instead of the spot
turn_away = Avoid(distance=15, turn="translational")
# %% exercise-1 wrong: the package's layer that turns on the spot
turn_away = Avoid(distance=15, turn="stationary")
# %% exercise-1 wrong: the other order of left and right
@behaviour
def turn_away(me, distance=15.0):
    if 0 <= me.distance[me.left] < distance:
        return me.max_speed, -me.max_speed
    if 0 <= me.distance[me.right] < distance:
        return -me.max_speed, me.max_speed
    if 0 <= me.distance[me.front] < distance:
        return -me.max_speed, me.max_speed
    return PASS
# %% exercise-1 wrong: to a side drawn anew in every step
@behaviour
def turn_away(me, distance=15.0):
    side = 1.0 if me.chance < 0.5 else -1.0
    for sensor in (me.front, me.left, me.right):
        if 0 <= me.distance[sensor] < distance:
            return -side * me.max_speed, side * me.max_speed
    return PASS
# %% exercise-1 wrong: blind
@behaviour
def turn_away(me):
    return PASS
# %% exercise-1 wrong: never near the corner
@behaviour
def turn_away(me):
    return -me.max_speed, me.max_speed
# %% exercise-1 wrong: a smaller distance
@behaviour
def turn_away(me, distance=8.0):
    if 0 <= me.distance[me.right] < distance:
        return -me.max_speed, me.max_speed
    if 0 <= me.distance[me.left] < distance:
        return me.max_speed, -me.max_speed
    if 0 <= me.distance[me.front] < distance:
        return -me.tendency * me.max_speed, me.tendency * me.max_speed
    return PASS
# %% exercise-1 wrong: blind, by a count of steps
@behaviour(memory={"steps": 0})
def turn_away(me):
    me.memory.steps += 1
    if me.memory.steps <= 70:
        return 1.0, 1.0
    if me.memory.steps <= 70 + 16:
        return -1.0, 1.0
    if me.memory.steps <= 70 + 16 + 150:
        return 1.0, 1.0
    return 0.0, 0.0
# %% exercise-1 wrong: turning for ever once something was near
@behaviour(memory={"met": 0})
def turn_away(me):
    for sensor in (me.front, me.left, me.right):
        if 0 <= me.distance[sensor] < 15.0:
            me.memory.met = 1
    if me.memory.met == 1:
        return -me.max_speed, me.max_speed
    return PASS
# %% exercise-1 wrong: stopping
@behaviour
def turn_away(me, distance=15.0):
    for sensor in (me.front, me.left, me.right):
        if 0 <= me.distance[sensor] < distance:
            return 0.0, 0.0
    return PASS
# %% exercise-2 right: six
distance = 6
# %% exercise-2 right: seven and a half
distance = 7.5
# %% exercise-2 right: ten
distance = 10
# %% exercise-2 right: a NumPy number
distance = np.float64(9)
# %% exercise-2 right: a NumPy integer
distance = np.int64(7)
# %% exercise-2 right: from the width of the corridor
distance = (30 / 2 - AGENT9.radius) - 2
# %% exercise-2 right: half the corridor
distance = 15
# %% exercise-2 hint: from 6 to 10
distance = 8
# %% exercise-2 wrong: as before
distance = 20
# %% exercise-2 wrong: a little more than half the corridor
distance = 17
# %% exercise-2 wrong: nothing
distance = 0
# %% exercise-2 wrong: very little
distance = 1
# %% exercise-2 wrong: as far as the sensors reach
distance = 50
# %% exercise-2 wrong: as a setting by name
distance = {"distance": 8}
# %% exercise-2 wrong: a text
distance = "8"
# %% exercise-2 wrong: 3 units
distance = 3
# %% exercise-2 wrong: 16 units
distance = 16
# %% exercise-2 wrong: the width of the corridor
distance = 30
