import numpy as np
import pytest

from mesa_swarm.analysis import chains, find_pathologies, follow_chains


@pytest.mark.parametrize("n", [50, 1000, 10_000])
def test_chains_in_one_frame(benchmark, n):
    rng = np.random.default_rng(0)
    position, heading = rng.uniform(0, 20 * n**0.5, (n, 2)), rng.normal(0, 0.5, n)
    found = benchmark(chains, position, heading, link_distance=30.0)
    assert found.count > 0


def wandering(k=3000, n=50):
    """Return positions and headings of robots that wander about a square of 600."""
    rng = np.random.default_rng(0)
    heading = rng.uniform(-np.pi, np.pi, n) + rng.normal(0, 0.1, (k, n)).cumsum(axis=0)
    step = np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    return (rng.uniform(0, 600, (n, 2)) + step.cumsum(axis=0)) % 600, heading


def test_chains_over_time(benchmark):
    position, heading = wandering()
    found = benchmark(follow_chains, position, heading, np.arange(3000), link_distance=30.0)
    assert len(found.events) > 0


def test_pathologies_of_robots_that_flip_all_the_time(benchmark):
    k, n, s = 3000, 50, 9
    side = np.where(np.arange(k) % 2, 1.0, -1.0)[:, None] * np.ones(n)
    position, heading = wandering(k, n)
    found = benchmark(
        find_pathologies,
        steps=np.arange(k),
        position=np.broadcast_to(position[0], position.shape),
        heading=np.zeros_like(heading),
        command=np.stack([-side, side], axis=-1),
        layer=np.zeros((k, n)),
        distance=np.full((k, n, s), 10.0),
        kind=np.zeros((k, n, s)),
        radius=np.full(n, 5.0),
        max_speed=np.ones(n),
        forward=np.tile([0, 1, 2], (n, 1)),
    )
    assert len(found) == n
