"""Robots at fires under strategies A and B, and the outcome for the fires."""

import math

import numpy as np
import pytest
from joblib import Parallel, delayed

from mesa_swarm import AGENT_FIRE
from mesa_swarm.models.fire_fighting import FireFighting

LARGE = 1


def at_the_large_fire(strategy, places, steps, gap=0):
    """Return a model in which robots were put at the large fire, one after the other."""
    model = FireFighting(n_robots=1, strategy=strategy, rng=1)
    model.remove_robots(model.robots)
    (x, y), reach = model.fires.position[LARGE], model.fires.radius[LARGE] + 6
    for k in range(places):
        side = 2 * math.pi * k / places
        pose = (x + reach * math.cos(side), y + reach * math.sin(side), side + math.pi)
        model.add_robots(AGENT_FIRE, poses=[pose])
        model.run(gap)
    return model.run(steps)


def test_a_hot_robot_leaves_under_a_and_waits_in_front_of_the_fire_under_b():
    distances = {}
    for strategy in "AB":
        model = at_the_large_fire(strategy, 1, 150)
        assert model.swarm.hot.tolist() == [True]
        centre = model.fires.position[LARGE]
        distances[strategy] = np.hypot(*(model.swarm.position[0] - centre)) - model.fires.radius[LARGE] - 5
    assert 10.0 < distances["B"] < 13.0
    assert distances["A"] > 13.0


def test_under_b_the_robot_returns_to_the_same_fire_when_it_has_cooled():
    model = at_the_large_fire("B", 1, 130)
    fought = []
    for _ in range(200):
        model.step()
        fought.append(int(model.swarm.fire[0]))
    assert LARGE in fought
    assert set(fought) <= {-1, LARGE}


@pytest.mark.parametrize("steps", [5, 150], ids=["that extinguishes", "that waits until it has cooled"])
def test_a_robot_at_a_fire_broadcasts_where_it_sees_the_fire(steps):
    model = at_the_large_fire("B", 1, steps)
    assert model.swarm.task.tolist() == [0]
    (x, y), (ahead, left), heading = model.swarm.position[0], model.swarm.goal[0], model.swarm.heading[0]
    cosine, sine = math.cos(heading), math.sin(heading)
    place = np.array([x + cosine * ahead - sine * left, y + sine * ahead + cosine * left])
    assert np.hypot(*(place - model.fires.position[LARGE])) == pytest.approx(model.fires.radius[LARGE], abs=1.0)


@pytest.mark.parametrize("strategy", ["A", "B"])
def test_robots_that_neither_extinguish_nor_wait_broadcast_nothing(strategy):
    model = FireFighting(strategy=strategy, rng=2)
    for _ in range(600):
        before = model.swarm.fire >= 0, model.swarm.hot.copy()
        model.step()
        silent = ~(before[0] | (before[1] & (strategy == "B")))
        assert (model.swarm.task[silent] == -1).all()
        assert np.isnan(model.swarm.goal[silent]).all()
        assert (model.swarm.task[before[0] & ~before[1] & (model.swarm.layer == 1)] == 0).all()
    assert silent.any()
    assert not silent.all()


@pytest.mark.slow
def test_one_robot_cannot_put_out_the_largest_fire():
    model = at_the_large_fire("B", 1, 15_000)
    assert not model.fires.out[LARGE]


@pytest.mark.slow
@pytest.mark.parametrize("gap", [0, 40, 90, 150])
def test_two_robots_that_meet_at_the_largest_fire_put_it_out_under_b(gap):
    model = at_the_large_fire("B", 2, 15_000, gap)
    assert model.fires.out[LARGE]


def test_the_model_stops_running_when_all_fires_are_out():
    model = FireFighting(strategy="B", rng=1).run(15_000)
    assert not model.running
    assert model.fires.out.all()
    steps = model.steps
    assert model.run(10).steps == steps


def fires_out(strategy, seed, communication="none"):
    model = FireFighting(strategy=strategy, rng=seed, communication=communication).run(15_000)
    return model.fires.out.copy()


@pytest.mark.long
@pytest.mark.parametrize("communication", ["state", "goal"])
def test_over_12_paired_seeds_calling_for_help_puts_out_the_large_fire_under_a(communication):
    out = np.array(Parallel(2)(delayed(fires_out)("A", seed, communication) for seed in range(12)))
    assert out[:, LARGE].mean() >= 0.8


@pytest.mark.long
def test_over_30_paired_seeds_b_puts_out_all_fires_and_a_leaves_the_large_one():
    out = {s: np.array(Parallel(2)(delayed(fires_out)(s, seed) for seed in range(30))) for s in "AB"}
    assert out["B"].all(axis=1).mean() >= 0.9
    assert (~out["A"][:, LARGE]).mean() >= 0.8
    assert np.delete(out["A"], LARGE, axis=1).mean() > 0.9
