"""Solutions of notebook 7; each part may be pasted into the cell of its exercise."""

# %% exercise-1
# A robot that can stay ten times as long is still there when the next one arrives by chance.
answer = dict(stay_time=1_000, rest_time=60)

# %% exercise-2
answer = dict(strategy="B", n_robots=5)
