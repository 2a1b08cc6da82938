import numpy as np
import pytest

from mesa_swarm import Map
from mesa_swarm.analysis import (
    chains,
    clark_evans,
    clusters,
    collision_frequency,
    coverage,
    cumulative_collisions,
    directions,
    dispersion,
    find_pathologies,
    follow_chains,
    layer_shares,
    milling,
    nearest_neighbour_distances,
    polarization,
    reachable_cells,
    time_to,
    visited_cells,
)

N = 10_000
SIDE = 1000.0


def reach(neighbours):
    """Return the distance within which a robot has about this many others."""
    return SIDE * np.sqrt(neighbours / (np.pi * N))


def one_dense_crowd():
    """Return a triangular lattice with 18 neighbours within two of its distances."""
    rows = np.arange(100)
    x = rows[None, :] + 0.5 * (rows[:, None] % 2)
    return np.column_stack([x.ravel(), np.repeat(rows * np.sqrt(0.75), 100)])


RNG = np.random.default_rng(0)
BEFORE, AFTER = RNG.random((2, N, 2)) * SIDE
HEADING = RNG.uniform(-np.pi, np.pi, N)
CROWD = one_dense_crowd()
MEASURES = {
    "clusters, 1 neighbour": lambda: clusters(BEFORE, reach(1)),
    "clusters, 10 neighbours": lambda: clusters(BEFORE, reach(10)),
    "clusters, 30 neighbours": lambda: clusters(BEFORE, reach(30)),
    "clusters, lattice of 18 neighbours": lambda: clusters(CROWD, 2.01),
    "nearest_neighbour_distances": lambda: nearest_neighbour_distances(BEFORE),
    "clark_evans": lambda: clark_evans(BEFORE, SIDE**2),
    "dispersion": lambda: dispersion(BEFORE),
    "polarization": lambda: polarization(HEADING),
    "milling": lambda: milling(BEFORE, HEADING),
    "directions": lambda: directions(BEFORE, AFTER),
    "visited_cells": lambda: visited_cells(BEFORE, (0, 0, SIDE, SIDE), (40, 40)),
    "coverage": lambda: coverage(BEFORE, np.ones((40, 40), bool), (0, 0, SIDE, SIDE)),
    "collision_frequency": lambda: collision_frequency(HEADING[None] > 0),
    "cumulative_collisions": lambda: cumulative_collisions(HEADING[None] > 0),
    "layer_shares": lambda: layer_shares(np.sign(HEADING)[None].astype(int), 4),
    "time_to": lambda: time_to(np.sort(HEADING), 3.0, for_good=True),
}


@pytest.mark.parametrize("name", MEASURES)
def test_measure_of_ten_thousand_robots(benchmark, name):
    MEASURES[name]()
    assert benchmark(MEASURES[name]) is not None


@pytest.mark.parametrize("name", ["original", "sparse", "openspace"])
def test_reachable_cells_of_a_map_of_the_thesis(benchmark, name):
    world = Map.load(name)
    solids = [(shape.geometry, shape.radius) for shape in world.obstacles if shape.contact]
    cells = benchmark(reachable_cells, world.bounds, solids, 5.0, (60.0, 60.0))
    assert cells.any()


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


@pytest.mark.slow
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
