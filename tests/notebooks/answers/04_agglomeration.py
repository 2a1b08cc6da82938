"""Answers to the exercises of notebook 4."""


# %% exercise-1 right: a little fewer than twice as many
groups_of_100 = 25
# %% exercise-1 right: growth by the same number and a half again
groups_of_100 = 15 + 1.25 * (15 - 8)
# %% exercise-1 right: a power of the number of robots
groups_of_100 = 15 * 2**0.7
# %% exercise-1 right: a number of numpy
groups_of_100 = np.int64(26)
# %% exercise-1 right: the rate of growth falls
groups_of_100 = round(15 * 1.5)
# %% exercise-1 hint: 15 times 1.6
groups_of_100 = 15 * 1.6
# %% exercise-1 wrong: twice as many as of 50
groups_of_100 = 30
# %% exercise-1 wrong: twice the 14 of the comparison
groups_of_100 = 28
# %% exercise-1 wrong: as many as of 50
groups_of_100 = 15
# %% exercise-1 wrong: more than twice as many
groups_of_100 = 40
# %% exercise-1 wrong: one group
groups_of_100 = 1
# %% exercise-1 wrong: a range
groups_of_100 = (20, 30)
# %% exercise-1 wrong: a text
groups_of_100 = "24"
# %% exercise-1 wrong: half as many again
groups_of_100 = 20
# %% exercise-1 wrong: a few too many
groups_of_100 = 28
# %% exercise-1 wrong: half of them
groups_of_100 = 8
# %% exercise-2 right: robots never stay, and touch
answer = dict(stop_distance=0, avoid_distance=0)
# %% exercise-2 right: half of that hinted
answer = dict(stop_distance=2, avoid_distance=1)
# %% exercise-2 right: a little more room
answer = dict(stop_distance=5, avoid_distance=2)
# %% exercise-2 right: fractions
answer = {"avoid_distance": 1.0, "stop_distance": 3.5}
# %% exercise-2 right: numbers of numpy
answer = dict(stop_distance=np.float64(4), avoid_distance=np.int64(0))
# %% exercise-2 hint: 4 and 1
answer = dict(stop_distance=4, avoid_distance=1)
# %% exercise-2 wrong: as given
answer = dict(stop_distance=12, avoid_distance=4)
# %% exercise-2 wrong: stay as soon as another robot is seen
answer = dict(stop_distance=60, avoid_distance=4)
# %% exercise-2 wrong: keep apart
answer = dict(stop_distance=12, avoid_distance=30)
# %% exercise-2 wrong: farther sight, which is not to be chosen
answer = dict(stop_distance=12, avoid_distance=4, sight=400)
# %% exercise-2 wrong: a negative distance
answer = dict(stop_distance=-1, avoid_distance=1)
# %% exercise-2 wrong: no names
answer = (4, 1)
# %% exercise-2 wrong: one of two is open
answer = dict(stop_distance=4, avoid_distance=...)
# %% exercise-2 wrong: only a smaller distance to avoid
answer = dict(stop_distance=12, avoid_distance=1)
# %% exercise-2 wrong: both larger
answer = dict(stop_distance=20, avoid_distance=8)
# %% exercise-2 wrong: no distance to avoid
answer = dict(stop_distance=12, avoid_distance=0)
