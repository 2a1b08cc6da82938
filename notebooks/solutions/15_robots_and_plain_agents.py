"""Solutions of notebook 15; each part may be pasted into the cell of its exercise."""

import mesa
import numpy as np

from mesa_swarm.control import PASS, behaviour


# %% exercise-1
class Counter(mesa.Agent):
    """Counts the robots near the middle of the hall."""

    def __init__(self, model):
        super().__init__(model)
        self.near = 0

    def step(self):
        """Count the robots within 60 units of the middle."""
        self.near = int((np.hypot(*(self.model.swarm.position - (200, 150)).T) < 60).sum())


# %% exercise-2
VISITOR = 4


@behaviour
def give_way(me, within=20.0):
    """Turn away from a visitor ahead."""
    for i in range(len(me.kind)):
        if me.kind[i] == VISITOR and me.distance[i] < within and abs(me.bearing[i]) < 1.2:
            if me.bearing[i] >= 0:
                return me.max_speed, -me.max_speed
            return -me.max_speed, me.max_speed
    return PASS
