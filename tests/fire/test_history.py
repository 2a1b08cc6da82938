"""The fires' history when fires come and go."""

import numpy as np

from mesa_swarm import SwarmModel


def test_every_fire_has_the_same_column_when_another_is_removed():
    model = SwarmModel(map="openspace_fire", rng=1)
    for k, fire in enumerate(model.fires):
        fire.temperature = 0.1 * (k + 1)
    model.run(1)
    model.fires[0].remove()
    model.run(1)
    before, after = model.fires.history.temperature
    assert np.isnan(after[0])
    assert np.abs(after[1:] - before[1:]).max() < 0.01
    assert model.fires.history.robots[1, 0] == -1
