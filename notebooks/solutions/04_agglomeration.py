"""Solutions of notebook 4; each part may be pasted into the cell of its exercise."""

# %% exercise-1
# More robots make more groups, but in the same room they also meet more often: fewer than twice as many.
groups_of_100 = 24

# %% exercise-2
# The centroid is hardly ever nearer than 4 units, so that robots keep on pushing inwards; and groups that keep on
# moving meet others.
answer = dict(stop_distance=4, avoid_distance=1)
