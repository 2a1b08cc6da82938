"""Cooperative transport: what one robot cannot move, several bring to the goal."""

import math

import numpy as np
import pytest
from joblib import Parallel, delayed

from mesa_swarm import all_round
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.control import Subsumption
from mesa_swarm.models.cooperative_transport import GOAL, NEAR, START, CooperativeTransport
from support.scenes import ahead

SEEDS = range(20)


@pytest.mark.slow
@pytest.mark.parametrize("load", ["disc", "box"])
@pytest.mark.parametrize("seed", range(3))
def test_one_robot_never_moves_the_load(seed, load):
    model = CooperativeTransport(n_robots=1, load=load, rng=seed)
    model.run(3000)
    assert tuple(model.load.position) == START
    assert model.load.heading == 0.0
    assert model.results() == {"arrived at": None, "way left": GOAL[0] - START[0]}


def pushing(n, resistance, side=math.pi):
    """Return the model with this number of robots side by side behind the load, or on another side of it, facing it."""
    model = CooperativeTransport(n_robots=1, resistance=resistance, rng=1)
    model.remove_robots(model.robots)
    for k in range(n):
        azimuth = side + (k - (n - 1) / 2) * 0.45
        place = START[0] + 30.5 * math.cos(azimuth), START[1] + 30.5 * math.sin(azimuth)
        model.add_robots(all_round(12, range=150), poses=[(*place, side + math.pi)])
    return model


@pytest.mark.parametrize(("n", "moves"), [(1, False), (2, True), (3, True)])
def test_the_load_gives_way_when_there_are_more_pushes_than_it_withstands(n, moves):
    model = pushing(n, 1.5).run(60)
    assert model.pushers == n
    assert (model.way_left < GOAL[0] - START[0]) == moves
    assert model.load.position[1] == pytest.approx(START[1], abs=3.0)


def test_robots_between_the_load_and_the_goal_do_not_push_it_away():
    model = pushing(3, 1.5, side=0.0).run(60)
    assert tuple(model.load.position) == START


def test_it_stops_when_the_load_is_near_the_goal_and_has_the_step_of_that():
    model = pushing(3, 0.9).run(3000)
    assert not model.running
    assert model.arrived_at == model.steps < 3000
    assert NEAR - 2 < model.way_left <= NEAR
    assert model.results() == {"arrived at": model.steps, "way left": model.way_left}
    assert model.run(5).steps == model.arrived_at


def test_the_way_left_and_the_pushers_are_collected():
    model = pushing(2, 1.5).run(30)
    table = model.datacollector.get_model_vars_dataframe()
    assert table["way_left"].is_monotonic_decreasing
    assert table["pushers"].max() == 2
    assert table["way_left"].iloc[-1] == model.way_left


def test_an_unknown_load_suggests_the_nearest():
    with pytest.raises(SwarmError, match="did you mean 'disc'"):
        CooperativeTransport(load="disk", rng=1)


@pytest.mark.slow
@pytest.mark.parametrize("heading", np.radians([0, 15, 30, 45]))
@pytest.mark.parametrize("height", [0.0, 15.0, 22.0, 25.0, 27.0])
def test_one_robot_does_not_move_the_box_wherever_it_pushes(height, heading):
    model = CooperativeTransport(n_robots=1, load="box", rng=1)
    model.remove_robots(model.robots)
    model.add_robots(all_round(12), poses=[(START[0] - 31, START[1] + height, -heading)])
    model.control = Subsumption(ahead)
    most = 0
    for _ in range(30):
        model.step()
        most = max(most, model.pushers)
    assert most == 1
    assert tuple(model.load.position) == START
    assert model.load.heading == 0.0


def arrived(n_robots, seed, load):
    return CooperativeTransport(n_robots=n_robots, load=load, rng=seed).run(10_000).arrived_at is not None


@pytest.mark.long
@pytest.mark.parametrize("load", ["disc", "box"])
def test_five_robots_bring_the_load_to_the_goal_and_one_does_not(load):
    brought = {n: np.array(Parallel(2)(delayed(arrived)(n, seed, load) for seed in SEEDS)) for n in (1, 5)}
    assert brought[5].sum() >= 18
    assert not brought[1].any()
