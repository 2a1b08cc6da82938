"""Puck clustering: pucks are neither lost nor pushed together, and end in one cluster."""

import numpy as np
import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.models.puck_clustering import APART, DONE, EVERY, LINK, PUCK, PuckClustering


@pytest.mark.slow
def test_the_stored_runs_come_out_again():
    runs = [PuckClustering(n_robots=4, rng=rng).run(4_000).done_at for rng in (10_000, 10_001)]
    assert runs == [1150, 3250]


@pytest.mark.slow
def test_a_run_ends_when_nine_tenths_of_the_pucks_are_in_one_cluster():
    model = PuckClustering(n_robots=4, rng=10_001).run(4_000)
    assert not model.running
    assert model.steps % EVERY == 0
    assert model.largest >= DONE
    assert model.results()["one cluster at"] == model.steps


def test_no_puck_is_lost_and_none_overlaps_another():
    model = PuckClustering(n_robots=6, rows=2, rng=1)
    for _ in range(20):
        model.run(10)
        gaps = np.hypot(*(model.lying[:, None] - model.lying).T) + np.eye(len(model.lying)) * APART
        assert len(model.movers) == 8
        assert gaps.min() >= 2 * PUCK


def test_at_first_each_puck_is_a_cluster():
    model = PuckClustering(rows=2, rng=1)
    assert (model.clusters, model.largest) == (8, 1 / 8)


def test_pucks_between_which_a_robot_cannot_pass_are_in_one_cluster():
    model = PuckClustering(rows=1, rng=1)
    model.remove_robots(model.robots)
    x, y = model.lying[0]
    model.movers.agents[1].position = x + LINK - 0.1, y
    assert (model.clusters, model.largest) == (3, 2 / 4)


def test_robots_count_the_pucks_ahead_that_lie_within_their_view():
    model = PuckClustering(n_robots=1, rows=2, rng=1)
    (robot,) = model.robots
    robot.position, robot.heading = (30, 30), 0.0  # in the middle of four
    model.sense()
    assert robot.pucks == [2]
    robot.position, robot.heading = (31, 31), np.pi / 4  # two of them are now behind its sides, one is ahead
    model.sense()
    assert robot.pucks == [1]


def placed_before(n_others: int, rng: int = 1) -> PuckClustering:
    """Return a model whose robot has a puck right before it, and others behind that."""
    model = PuckClustering(n_robots=1, rows=3, rng=rng)
    (robot,) = model.robots
    for body in model.movers.agents:
        body.position = 5.0 + 9 * body.row, 5.0
    robot.position, robot.heading = (30, 45), 0.0
    model.movers.agents[0].position = 41, 45
    for k in range(n_others):
        model.movers.agents[1 + k].position = 47 + 5 * (k // 4), 38 + 5 * (k % 4)
    return model


def test_a_single_puck_is_picked_up_at_once():
    model = placed_before(0).run(2)
    assert model.movers.carried.tolist() == [True] + [False] * 11


def test_a_puck_among_as_many_others_as_the_limit_is_never_picked_up():
    for rng in range(3):
        assert not placed_before(7, rng).run(2).movers.carried.any()


def test_where_enough_are_seen_a_puck_is_put_down_at_once():
    model = placed_before(7)
    (robot,) = model.robots
    model.attach(robot, model.movers.agents[-1])
    robot.position = 28, 45
    model.run(2)
    assert not model.movers.carried.any()


@pytest.mark.parametrize("name", ["n_robots", "rows", "many", "enough"])
def test_numbers_that_are_not_counts_are_refused_by_name(name):
    with pytest.raises(SwarmError, match=name):
        PuckClustering(**{name: -1, "rng": 1})
