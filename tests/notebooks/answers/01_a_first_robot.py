"""Answers to the exercises of notebook 1."""


# %% exercise-1 right: the package's own layer
careful = Avoid(distance=15)
# %% exercise-1 right: the package's own layer, turning on the spot
careful = Avoid(distance=12, turn="stationary")
# %% exercise-1 right: one wheel stops in a turn
@behaviour
def careful(me, distance=15.0):
    if me.distance[me.left] != -1 and me.distance[me.left] < distance:
        return me.max_speed, 0
    if me.distance[me.right] != -1 and me.distance[me.right] < distance:
        return 0, me.max_speed
    if me.distance[me.front] != -1 and me.distance[me.front] < distance:
        return 0, me.max_speed
    return PASS
# %% exercise-1 right: to one side only, in a loop
@behaviour
def careful(me, distance=15.0):
    for sensor in (me.front, me.left, me.right):
        if 0 <= me.distance[sensor] < distance:
            return -me.max_speed, me.max_speed
    return PASS
# %% exercise-1 right: away from the nearest of all sensors ahead
@behaviour
def careful(me, distance=15.0):
    nearest, side = distance, 0.0
    for sensor in range(len(me.distance)):
        if 0 <= me.distance[sensor] < nearest and abs(me.bearing[sensor]) < 1.6:
            nearest, side = me.distance[sensor], 1.0 if me.bearing[sensor] <= 0 else -1.0
    if side == 0.0:
        return PASS
    return -side * me.max_speed, side * me.max_speed
# %% exercise-1 right: without PASS and without the decorator
def careful(me):
    left, front, right = me.distance[me.left], me.distance[me.front], me.distance[me.right]
    if (left >= 0 and left < 12) or (front >= 0 and front < 12):
        return 1.0, -1.0
    if right >= 0 and right < 12:
        return -1.0, 1.0
    return 1.0, 1.0
# %% exercise-1 right: each robot's own side for what is ahead
@behaviour
def careful(me, distance=18.0):
    if 0 <= me.distance[me.right] < distance:
        return -0.5 * me.max_speed, me.max_speed
    if 0 <= me.distance[me.left] < distance:
        return me.max_speed, -0.5 * me.max_speed
    if 0 <= me.distance[me.front] < distance:
        return -me.tendency * me.max_speed, me.tendency * me.max_speed
    return PASS
# %% exercise-1 hint: turn right for the left sensor, left for the other two
@behaviour
def careful(me, distance=15.0):
    if 0 <= me.distance[me.left] < distance:
        return me.max_speed, -me.max_speed
    if 0 <= me.distance[me.front] < distance or 0 <= me.distance[me.right] < distance:
        return -me.max_speed, me.max_speed
    return PASS
# %% exercise-1 wrong: reversing
@behaviour
def careful(me, distance=15.0):
    if 0 <= me.distance[me.front] < distance:
        return -me.max_speed, -me.max_speed
    return PASS
# %% exercise-1 wrong: stopping for ever
@behaviour
def careful(me, distance=15.0):
    for sensor in (me.front, me.left, me.right):
        if 0 <= me.distance[sensor] < distance:
            return 0.0, 0.0
    return PASS
# %% exercise-1 wrong: standing still from the start
@behaviour
def careful(me, distance=15.0):
    return 0.0, 0.0
# %% exercise-1 wrong: turning on the spot from the start
@behaviour
def careful(me, distance=15.0):
    return -me.max_speed, me.max_speed
# %% exercise-1 wrong: towards what is near
@behaviour
def careful(me, distance=15.0):
    if 0 <= me.distance[me.left] < distance:
        return -me.max_speed, me.max_speed
    if 0 <= me.distance[me.front] < distance or 0 <= me.distance[me.right] < distance:
        return me.max_speed, -me.max_speed
    return PASS
# %% exercise-1 wrong: a reading of -1 taken for something near
@behaviour
def careful(me, distance=15.0):
    if me.distance[me.left] < distance:
        return me.max_speed, -me.max_speed
    if me.distance[me.front] < distance or me.distance[me.right] < distance:
        return -me.max_speed, me.max_speed
    return PASS
# %% exercise-1 wrong: too late
careful = Avoid(distance=0.5)
# %% exercise-1 wrong: nothing returned
@behaviour
def careful(me, distance=15.0):
    if 0 <= me.distance[me.left] < distance:
        me.max_speed, -me.max_speed
# %% exercise-1 wrong: drive on blindly for a time, then stand for ever
@behaviour(memory={"steps": 0})
def careful(me):
    me.memory.steps += 1
    if me.memory.steps < 460:
        return 1.0, 1.0
    return 0.0, 0.0
# %% exercise-1 wrong: turning now and then, by chance, without looking
@behaviour
def careful(me):
    if me.chance < 0.05:
        return -me.max_speed, me.max_speed
    return PASS
# %% exercise-1 wrong: driving in circles
@behaviour
def careful(me):
    return 0.8 * me.max_speed, me.max_speed
# %% exercise-2 right: a share of the maximal speed for each wheel
@behaviour
def circle(me):
    return 0.45 * me.max_speed, 0.55 * me.max_speed
# %% exercise-2 right: numbers
@behaviour
def circle(me):
    return 0.9 / 1.1, 1.0
# %% exercise-2 right: slowly
@behaviour
def circle(me):
    return 0.09, 0.11
# %% exercise-2 right: from speed and turn
@behaviour
def circle(me, radius=50.0):
    speed = 0.7 * me.max_speed
    turn = speed / radius
    return speed - 5 * turn, speed + 5 * turn
# %% exercise-2 right: without the decorator
def circle(me):
    right = me.max_speed
    return right * 9 / 11, right
# %% exercise-2 right: rounded to three digits
@behaviour
def circle(me):
    return 0.818, 1
# %% exercise-2 hint: 9 / 11 of the right wheel
@behaviour
def circle(me):
    return me.max_speed * 9 / 11, me.max_speed
# %% exercise-2 wrong: clockwise
@behaviour
def circle(me):
    return me.max_speed, 9 / 11 * me.max_speed
# %% exercise-2 wrong: a circle of radius 100
@behaviour
def circle(me):
    return me.max_speed * 19 / 21, me.max_speed
# %% exercise-2 wrong: a circle of radius 25
@behaviour
def circle(me):
    return me.max_speed * 4 / 6, me.max_speed
# %% exercise-2 wrong: faster than the wheels can turn
@behaviour
def circle(me):
    return 0.9 * me.max_speed, 1.1 * me.max_speed
# %% exercise-2 wrong: on the spot
@behaviour
def circle(me):
    return -me.max_speed, me.max_speed
# %% exercise-2 wrong: not moving
@behaviour
def circle(me):
    return 0.0, 0.0
# %% exercise-2 wrong: nine of ten
@behaviour
def circle(me):
    return 0.9 * me.max_speed, me.max_speed
# %% exercise-2 wrong: straight on and on the spot by turns, of that curvature in the mean
@behaviour(memory={"steps": 0})
def circle(me):
    me.memory.steps += 1
    if me.memory.steps % 100 < 91:
        return 1.0, 1.0
    return -1.0, 1.0
# %% exercise-2 wrong: standing still after four steps
@behaviour(memory={"steps": 0})
def circle(me):
    me.memory.steps += 1
    if me.memory.steps > 4:
        return 0.0, 0.0
    return 0.9 / 1.1, 1.0
# %% exercise-2 wrong: standing still after a quarter of the circle
@behaviour(memory={"steps": 0})
def circle(me):
    me.memory.steps += 1
    if me.memory.steps > 87:
        return 0.0, 0.0
    return 0.9 / 1.1, 1.0
# %% exercise-2 wrong: hardly moving at all
@behaviour
def circle(me):
    return 0.0009, 0.0011
# %% exercise-2 wrong: to and fro on the arc
@behaviour(memory={"steps": 0})
def circle(me):
    me.memory.steps += 1
    if me.memory.steps % 20 < 13:
        return 0.9 / 1.1, 1.0
    return -0.9 / 1.1, -1.0
