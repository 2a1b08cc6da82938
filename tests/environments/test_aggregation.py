"""Aggregation: clusters, what they are worth, how they are measured, and the rule that gathers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import Map
from mesa_swarm.analysis import clusters, nearest_neighbour_distances
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.environments import Aggregation
from mesa_swarm.environments.scores import cluster_sizes
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.maps.random_map import random_map
from support.task_worlds import rewarded, world_of

BLANK = Map(name="blank", bounds=(0, 0, 400, 400))


@given(st.integers(0, 2**32), st.integers(1, 40), st.floats(1.0, 60.0))
def test_the_size_of_each_robot_s_cluster_is_that_of_the_analysis(seed, n, link):
    position = np.random.default_rng(seed).uniform(0, 200, (n, 2))
    sizes = np.empty(n, np.int64)
    cluster_sizes(position, link, sizes)
    found = clusters(position, link, fewest=1)
    assert np.array_equal(sizes, found.sizes[found.label])


def test_a_robot_is_paid_for_the_share_of_the_others_in_its_cluster():
    task = Aggregation(map=BLANK, collision_cost=0.5)
    world = world_of(task, [(100, 100, 0.0), (120, 100, 0.0), (140, 100, 0.0), (300, 300, 0.0)])
    assert rewarded(world, [(0, 0)] * 4) == [2 / 3, 2 / 3, 2 / 3, 0.0]
    assert world.measures()["largest cluster"] == 0.75
    pair = world_of(task, [(100, 100, 0.0), (110.5, 100, np.pi)])
    assert rewarded(pair, [(1, 1), (0, 0)]) == [0.5, 0.5]
    assert not pair.finished


def test_a_robot_alone_is_a_cluster_of_its_own_and_has_no_neighbour():
    world = world_of(Aggregation(map=BLANK), [(100, 100, 0.0)])
    assert rewarded(world, [(1, 1)]) == [0.0]
    measured = world.measures()
    assert measured["largest cluster"] == 1.0
    assert np.isnan(measured["neighbour distance"])


def test_measures_are_those_of_the_analysis_at_the_end_and_over_the_last_quarter():
    world = TaskWorld(task=Aggregation(n_robots=8, map=BLANK), commanded=0, rng=2)
    assert np.isnan(world.measures()["largest cluster, last quarter"])
    largest, reward = [], np.empty(8)
    for _ in range(80):
        world.advance(None, reward)
        largest.append(clusters(world.swarm.position, 25.0, fewest=1).largest_fraction)
    measured = world.measures()
    assert measured["largest cluster"] == largest[-1]
    assert measured["largest cluster, last quarter"] == pytest.approx(np.mean(largest[60:]))
    assert measured["neighbour distance"] == pytest.approx(nearest_neighbour_distances(world.swarm.position).mean())


def test_the_rule_brings_robots_nearer_to_each_other():
    worlds = [TaskWorld(task=Aggregation(n_robots=6, map=BLANK, max_steps=800), commanded=0, rng=k) for k in range(4)]
    before = [world.measures() for world in worlds]
    after = [world.play() for world in worlds]
    for name, better in (("largest cluster", 1.5), ("neighbour distance", 0.5)):
        ratio = np.mean([one[name] for one in after]) / np.mean([one[name] for one in before])
        assert ratio >= better if better > 1 else ratio <= better


def test_robots_gather_on_random_maps():
    world = TaskWorld(task=Aggregation(n_robots=5, map=random_map(7), max_steps=30), commanded=0, rng=1)
    measured = world.play()
    assert measured["steps"] == 30
    assert 0.2 <= measured["largest cluster"] <= 1.0


@pytest.mark.parametrize("wrong", [{"link": 0}, {"collision_cost": -1}])
def test_wrong_parameters_are_refused_by_name(wrong):
    with pytest.raises(InvalidValueError, match=f"^{next(iter(wrong))} is"):
        Aggregation(**wrong)
