"""Answers to the exercises of notebook 14."""


# %% exercise-1 right: with a list of both numbers
def ants_on_the_left(draws, k):
    went = [0, 0]
    for draw in draws:
        left, right = (k + went[0]) ** 2, (k + went[1]) ** 2
        went[0 if draw < left / (left + right) else 1] += 1
    return went[0]


# %% exercise-1 right: the trail begins at k, and is subtracted in the end
def ants_on_the_left(draws, k):
    left = right = k
    for draw in draws:
        if draw * (left**2 + right**2) < left**2:
            left += 1
        else:
            right += 1
    return left - k


# %% exercise-1 right: by the number of the ant
def ants_on_the_left(draws, k):
    left = 0
    for ant, draw in enumerate(draws):
        right = ant - left
        left += bool(draw < 1 / (1 + ((k + right) / (k + left)) ** 2))
    return left


# %% exercise-1 right: as a float, with NumPy
def ants_on_the_left(draws, k):
    went = np.zeros(2)
    for draw in np.asarray(draws):
        weight = np.square(k + went)
        went += (1, 0) if draw < weight[0] / weight.sum() else (0, 1)
    return went[0]


# %% exercise-1 right: an array of one number less its dimension
def ants_on_the_left(draws, k):
    left, right = np.int64(0), np.int64(0)
    for i in range(len(draws)):
        p = pow(k + left, 2) / (pow(k + left, 2) + pow(k + right, 2))
        left, right = (left + 1, right) if draws[i] < p else (left, right + 1)
    return np.array(left)


# %% exercise-1 hint: its last stage
def ants_on_the_left(draws, k):
    left = right = 0
    for draw in draws:
        if draw < (k + left) ** 2 / ((k + left) ** 2 + (k + right) ** 2):
            left += 1
        else:
            right += 1
    return left


# %% exercise-1 wrong: without the square
def ants_on_the_left(draws, k):
    left = right = 0
    for draw in draws:
        if draw < (k + left) / (2 * k + left + right):
            left += 1
        else:
            right += 1
    return left


# %% exercise-1 wrong: the branch with fewer ants
def ants_on_the_left(draws, k):
    left = right = 0
    for draw in draws:
        if draw > (k + left) ** 2 / ((k + left) ** 2 + (k + right) ** 2):
            left += 1
        else:
            right += 1
    return left


# %% exercise-1 wrong: the right branch is not counted
def ants_on_the_left(draws, k):
    left = right = 0
    for draw in draws:
        if draw < (k + left) ** 2 / ((k + left) ** 2 + (k + right) ** 2):
            left += 1
    return left


# %% exercise-1 wrong: the share
def ants_on_the_left(draws, k):
    left = right = 0
    for draw in draws:
        if draw < (k + left) ** 2 / ((k + left) ** 2 + (k + right) ** 2):
            left += 1
        else:
            right += 1
    return left / len(draws)


# %% exercise-1 wrong: without k, which divides by zero
def ants_on_the_left(draws, k):
    left = right = 0
    for draw in draws:
        if draw < left**2 / (left**2 + right**2):
            left += 1
        else:
            right += 1
    return left


# %% exercise-1 wrong: half of them
def ants_on_the_left(draws, k):
    return len(draws) // 2


# %% exercise-1 wrong: printed, not returned
def ants_on_the_left(draws, k):
    print(sum(draw < 0.5 for draw in draws))
# %% exercise-1 wrong: the sum squared
def ants_on_the_left(draws, k):
    left = right = 0
    for draw in draws:
        if draw < (k + left) ** 2 / (2 * k + left + right) ** 2:
            left += 1
        else:
            right += 1
    return left
# %% exercise-1 wrong: k is always 1
def ants_on_the_left(draws, k):
    left = right = 0
    for draw in draws:
        if draw < (1 + left) ** 2 / ((1 + left) ** 2 + (1 + right) ** 2):
            left += 1
        else:
            right += 1
    return left
# %% exercise-1 wrong: for 200 ants
def ants_on_the_left(draws, k):
    left = right = 0
    for i in range(200):
        if draws[i] < (k + left) ** 2 / ((k + left) ** 2 + (k + right) ** 2):
            left += 1
        else:
            right += 1
    return left
# %% exercise-2 right: in proportion to the difference
@behaviour
def clean(me):
    me.act.trail = 1.0
    left, right = me.trail[0], me.trail[1]
    if left + right < 0.001:
        return PASS
    turn = 0.5 * (right - left) / (left + right)
    return me.max_speed * min(1.0, 1.0 - turn), me.max_speed * min(1.0, 1.0 + turn)


# %% exercise-2 right: the notebook's own rule
@behaviour
def clean(me, attraction=-0.5, least=0.001):
    me.act.trail = 1.0
    left, right = me.trail[0], me.trail[1]
    if attraction == 0.0 or left + right < least:
        return PASS
    turn = 2.0 * attraction * (left - right) / (left + right)
    return me.max_speed * min(1.0, 1.0 - turn), me.max_speed * min(1.0, 1.0 + turn)


# %% exercise-2 right: a plain function, twice as much trail
def clean(me):
    me.act.trail = 2.0
    if me.trail[0] > me.trail[1]:
        return 1.0 * me.max_speed, 0.6 * me.max_speed
    if me.trail[1] > me.trail[0]:
        return 0.6 * me.max_speed, 1.0 * me.max_speed
    return PASS


# %% exercise-2 right: sharp turns where one side has much more
@behaviour
def clean(me):
    me.act.trail = 1.0
    left, right = me.trail[0], me.trail[1]
    if left > 1.2 * right:
        return me.max_speed, 0.4 * me.max_speed
    if right > 1.2 * left:
        return 0.4 * me.max_speed, me.max_speed
    return me.max_speed, me.max_speed


# %% exercise-2 right: gently, with a sensor's difference clipped
@behaviour
def clean(me):
    me.act.trail = 0.5
    difference = me.trail[0] - me.trail[1]
    turn = max(-0.3, min(0.3, 5.0 * difference))
    return me.max_speed * min(1.0, 1.0 + turn), me.max_speed * min(1.0, 1.0 - turn)


# %% exercise-2 hint: its last stage
@behaviour
def clean(me):
    me.act.trail = 1.0
    if me.trail[0] > me.trail[1]:
        return me.max_speed, 0.5 * me.max_speed
    if me.trail[0] < me.trail[1]:
        return 0.5 * me.max_speed, me.max_speed
    return PASS


# %% exercise-2 wrong: towards the trail
@behaviour
def clean(me):
    me.act.trail = 1.0
    if me.trail[0] > me.trail[1]:
        return 0.5 * me.max_speed, me.max_speed
    if me.trail[0] < me.trail[1]:
        return me.max_speed, 0.5 * me.max_speed
    return PASS


# %% exercise-2 wrong: the mark is forgotten
@behaviour
def clean(me):
    if me.trail[0] > me.trail[1]:
        return me.max_speed, 0.5 * me.max_speed
    if me.trail[0] < me.trail[1]:
        return 0.5 * me.max_speed, me.max_speed
    return PASS


# %% exercise-2 wrong: at random
@behaviour
def clean(me):
    me.act.trail = 1.0
    turn = me.chance - 0.5
    return me.max_speed * (0.75 - turn / 2), me.max_speed * (0.75 + turn / 2)


# %% exercise-2 wrong: in a circle
@behaviour
def clean(me):
    me.act.trail = 1.0
    return 0.9 * me.max_speed, me.max_speed


# %% exercise-2 wrong: back from every trail
@behaviour
def clean(me):
    me.act.trail = 1.0
    if me.trail[0] + me.trail[1] > 0.001:
        return -me.max_speed, -me.max_speed
    return PASS


# %% exercise-2 wrong: standing
@behaviour
def clean(me):
    return 0.0, 0.0
# %% exercise-2 wrong: one antenna
@behaviour
def clean(me):
    me.act.trail = 1.0
    if me.trail[0] > 0.5:
        return me.max_speed, 0.5 * me.max_speed
    return PASS
# %% exercise-2 wrong: always to the left of a mark
@behaviour
def clean(me):
    me.act.trail = 1.0
    if me.trail[0] + me.trail[1] > 0.0:
        return 0.5 * me.max_speed, me.max_speed
    return PASS
# %% exercise-2 wrong: standing where a mark is
@behaviour
def clean(me):
    me.act.trail = 1.0
    if me.trail[0] > 0.0:
        return 0.0, 0.0
    return PASS
