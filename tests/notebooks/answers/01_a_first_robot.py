"""Answers to the exercises of notebook 1."""


# %% exercise-1 right: the package's own layer
careful = Avoid(distance=15)
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
