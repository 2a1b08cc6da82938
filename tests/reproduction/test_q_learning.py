"""The thesis's results on learning (8.3), over fixed seeds: collisions fall with the temperature, and stay low."""

import numpy as np
import pytest

from mesa_swarm.models.q_learning import QLearning

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("beta", "share"), [(1e-4, 0.25), (5e-3, 0.5)])
@pytest.mark.parametrize("seed", [0, 1, 3])
def test_collisions_of_15_robots_fall_and_their_total_flattens(beta, share, seed):
    model = QLearning(beta=beta, rng=seed).run(33_000)
    collisions = np.array(model.datacollector.model_vars["collisions"], dtype=float)
    assert collisions[-3_000:].mean() <= share * collisions[:1_000].mean()
    assert collisions[-11_000:].sum() < 0.5 * collisions[:11_000].sum()
