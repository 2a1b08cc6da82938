"""Solutions of notebook 6; each part may be pasted into the cell of its exercise."""

import numpy as np


# %% exercise-1
def my_polarization(heading):
    """Return the length of the mean of all unit vectors."""
    return np.hypot(np.cos(heading).mean(), np.sin(heading).mean())


# %% exercise-2
# Without the rule, boids are still aligned by giving way to each other; a strong course of their own prevents it.
answer = dict(separation_weight=3.0, alignment_weight=0.0, cohesion_weight=0.5, cruise_weight=3.0)
