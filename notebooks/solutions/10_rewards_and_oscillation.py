"""Solutions of notebook 10; each part may be pasted into the cell of its exercise."""

import numpy as np


# %% exercise-1
def reward_b(nearest, left, right, critical=0.08):
    """Return the reward, a number from -1 to 1."""
    if nearest < critical:
        return np.log((np.e - 1) / critical * nearest + 1) - 1
    return 1.0 if left == right == 1.0 else -1.0


# %% exercise-2
leaps = {
    ("a", "ahead"): 1,
    ("a", "turning"): 0,
    ("b", "ahead"): 1,
    ("b", "turning"): -1,
    ("c", "ahead"): 0,
    ("c", "turning"): 0,
}
