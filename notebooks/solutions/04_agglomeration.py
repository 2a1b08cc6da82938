"""Solutions of notebook 4; each part may be pasted into the cell of its exercise."""

# %% exercise-1
# More robots form more groups, but in the same arena they also meet more often: fewer than twice as many.
groups_of_100 = 24

# %% exercise-2
# The centroid is rarely nearer than 4 units, so that robots continue to move inwards; and moving groups meet others.
answer = dict(stop_distance=4, avoid_distance=1)
