"""Solutions of notebook 13; each part may be pasted into the cell of its exercise."""

import numpy as np


# %% exercise-1
def mean_difference(first, second):
    """Return the mean of second - first over pairs in which neither is None."""
    return np.mean([b - a for a, b in zip(first, second, strict=True) if a is not None and b is not None])


# %% exercise-2
pairs = 50
