"""The thesis's results on learning (8.3): collisions fall with the temperature, and their total flattens.

The seeds had no part in the choice of four actions over eight as the model's default. A single run may do
worse than the mean: of seeds 10 to 29, 17 of 20 fell to a quarter with beta 1e-4, and 19 of 20 to a half
with 5e-3; one that hardly collided at first has nothing to fall from. With eight actions and 1e-4 it was 8 of 20.
"""

import numpy as np
import pytest

from mesa_swarm.models.q_learning import QLearning

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("beta", "share"), [(1e-4, 0.25), (5e-3, 0.5)])
def test_collisions_of_15_robots_fall_in_the_mean_of_runs_and_their_total_flattens(beta, share):
    runs = [QLearning(beta=beta, rng=seed).run(33_000) for seed in range(10, 16)]
    collisions = np.array([run.datacollector.model_vars["collisions"] for run in runs], dtype=float)
    assert collisions[:, -3_000:].mean() <= share * collisions[:, :1_000].mean()
    assert collisions[:, -11_000:].sum() < 0.5 * collisions[:, :11_000].sum()
