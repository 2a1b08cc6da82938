"""Solutions of notebook 2; each part may be pasted into the cell of its exercise."""

# %% exercise-1
# Farther than the 20 units that it moves between two readings, with a margin. On the spot it would turn by 4 radians
# between two readings, past the free direction, and would turn most of the time.
answer = dict(distance=35, turn="translational")

# %% exercise-2
# Half of the readings are off by 6: the variance is 0.5 * 36.
deviation = (0.5 * (0.2 * 30) ** 2) ** 0.5
