"""Solutions of notebook 6; each part may be pasted into the cell of its exercise."""

import numpy as np


# %% exercise-1
def my_polarization(heading):
    """Return the length of the mean of all unit vectors."""
    return np.hypot(np.cos(heading).mean(), np.sin(heading).mean())


# %% exercise-2
# A longer range, and less cohesion, since dense groups turn on the spot.
answer = dict(
    n_robots=30, sight=100, alignment_weight=1.0, cohesion_weight=0.3, separation_weight=3.0, cruise_weight=1.0
)
