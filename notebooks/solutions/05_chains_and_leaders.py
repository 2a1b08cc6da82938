"""Solutions of notebook 5; each part may be pasted into the cell of its exercise."""

import numpy as np


# %% exercise-1
def leaders(leader):
    """Return the indices of the robots that follow none and are followed."""
    followed = np.unique(leader[leader >= 0])
    return followed[leader[followed] < 0]


# %% exercise-2
# With the leader rule, robots that meet turn instead of passing, and chains do not grow.
answer = dict(gap=15, head_on="on", cruise_speed=0.7, sight=50)
