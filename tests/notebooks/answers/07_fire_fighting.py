"""Answers to the exercises of notebook 7."""

# %% exercise-1 right: five times as long
answer = dict(stay_time=500, rest_time=60)
# %% exercise-1 right: six times as long, a literal, the other value as it was by default
answer = {"stay_time": 600}
# %% exercise-1 right: a float, and hardly a rest
answer = dict(stay_time=1_500.0, rest_time=5)
# %% exercise-1 right: as long as before, but hardly a rest
answer = dict(stay_time=100, rest_time=2)
# %% exercise-1 right: in proportion
longer = 8
answer = {"stay_time": 100 * longer, "rest_time": 60 * longer // 4}
# %% exercise-1 right: a number of numpy
answer = dict(stay_time=np.int64(2_000), rest_time=60)
# %% exercise-1 hint: a robot that stays ten times as long, 1,000 steps
answer = dict(stay_time=1_000, rest_time=60)
# %% exercise-1 wrong: shorter stays
answer = dict(stay_time=20, rest_time=60)
# %% exercise-1 wrong: longer rests
answer = dict(stay_time=100, rest_time=100)
# %% exercise-1 wrong: half as long again
answer = dict(stay_time=150, rest_time=60)
# %% exercise-1 wrong: a fire that one robot puts out
answer = dict(stay_time=1_000, rest_time=60, robots=1)
# %% exercise-1 wrong: the other strategy
answer = dict(stay_time=100, rest_time=60, strategy="B")
# %% exercise-1 wrong: never heated
answer = dict(stay_time=float("inf"), rest_time=60)
# %% exercise-1 wrong: two values without names
answer = (1_000, 60)
# %% exercise-1 wrong: twice as long
answer = dict(stay_time=200, rest_time=60)
# %% exercise-1 wrong: exchanged
answer = dict(stay_time=60, rest_time=100)
# %% exercise-1 wrong: a little longer
answer = dict(stay_time=120, rest_time=60)
# %% exercise-2 right: five
answer = dict(strategy="B", n_robots=5)
# %% exercise-2 right: six
answer = dict(strategy="B", n_robots=6)
# %% exercise-2 right: four
answer = dict(strategy="B", n_robots=4)
# %% exercise-2 right: B by default
answer = {"n_robots": 6}
# %% exercise-2 right: a number of numpy
answer = dict(n_robots=np.int64(5), strategy="B")
# %% exercise-2 right: half of ten
answer = dict(strategy="B", n_robots=10 // 2)
# %% exercise-2 hint: try five
answer = dict(strategy="B", n_robots=5)
# %% exercise-2 wrong: one
answer = dict(strategy="B", n_robots=1)
# %% exercise-2 wrong: two
answer = dict(strategy="B", n_robots=2)
# %% exercise-2 wrong: three
answer = dict(strategy="B", n_robots=3)
# %% exercise-2 wrong: ten
answer = dict(strategy="B", n_robots=10)
# %% exercise-2 wrong: strategy A
answer = dict(strategy="A", n_robots=6)
# %% exercise-2 wrong: calls by radio, which may not be set
answer = dict(strategy="B", n_robots=4, communication="goal")
# %% exercise-2 wrong: a bare number
answer = 5
# %% exercise-2 wrong: A with six
answer = dict(strategy="A", n_robots=6)
# %% exercise-2 wrong: A with five
answer = dict(strategy="A", n_robots=5)
# %% exercise-2 wrong: seven
answer = dict(strategy="B", n_robots=7)
