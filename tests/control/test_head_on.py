"""HeadOn: of two robots that meet, one comes to lead and one to follow."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT9, Radio
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.control import Avoid, Explore, Follow, HeadOn, Subsumption
from support.scenes import empty

CHAIN = Avoid(distance=6), Follow(), Explore(speed=0.7)


def meeting(rng: int, *layers, offset: float = 0.0):
    """Return a world in which two robots drive at each other."""
    model = empty(width=1600, height=1200, rng=rng)
    poses = [(750, 600, 0.0), (850, 600 + offset, math.pi)]
    model.add_robots(AGENT9, poses=poses, tendency="left")
    model.control = Subsumption(*layers)
    return model


def leads_the_other(model) -> bool:
    """Return whether one of two robots sees the other ahead, and is not seen ahead by it."""
    (ax, ay), (bx, by) = model.swarm.position
    bearings = np.array([math.atan2(by - ay, bx - ax), math.atan2(ay - by, ax - bx)]) - model.swarm.heading
    ahead = np.cos(bearings) > 0.7
    return bool(math.hypot(ax - bx, ay - by) < 60 and ahead.sum() == 1)


@pytest.mark.slow
def test_one_of_two_that_meet_head_on_comes_to_lead_the_other():
    led = sum(leads_the_other(meeting(rng, HeadOn(), *CHAIN).run(300)) for rng in range(20))
    assert led >= 16


@pytest.mark.slow
def test_without_the_rule_they_part():
    assert sum(leads_the_other(meeting(rng, *CHAIN).run(300)) for rng in range(20)) <= 4


def test_both_turn_on_the_spot_at_speeds_of_their_own():
    model = meeting(1, HeadOn(), *CHAIN)
    while (model.swarm.layer != 0).any():
        model.step()
    command = model.swarm.command
    assert (command[:, 0] == -command[:, 1]).all()
    assert abs(command[0, 1]) != abs(command[1, 1])
    assert (np.abs(command) >= 0.1).all()


def test_a_robot_that_overtakes_another_does_not_meet_it_head_on():
    model = empty(width=1600, rng=1)
    model.add_robots(AGENT9, poses=[(200, 150, 0.0), (150, 150, 0.0)])
    model.control = Subsumption(HeadOn(), *CHAIN)
    for _ in range(300):
        model.step()
        assert (model.swarm.layer != 0).all()


def test_a_robot_that_drives_at_one_that_stands_does_not_meet_it_head_on():
    model = empty(rng=1)
    model.add_robots(AGENT9, poses=[(100, 150, 0.0)])
    model.add_robots(AGENT9.with_proximity(range=0), poses=[(200, 150, math.pi)])
    model.swarm.columns["max_speed"][1] = 0.0
    model.control = Subsumption(HeadOn(), Explore())
    for _ in range(80):
        model.step()
        assert model.swarm.layer[0] != 0


def test_draws_are_the_same_for_the_same_seed_and_others_for_another():
    first, again, other = (meeting(rng, HeadOn(), *CHAIN).run(120).state_hash() for rng in (3, 3, 4))
    assert first == again != other


@pytest.mark.parametrize("bad", [{"slowest": 0}, {"slowest": 1.1}, {"distance": -1}, {"margin": -0.1}])
def test_parameters_out_of_range_are_refused_by_name(bad):
    with pytest.raises(InvalidValueError, match=next(iter(bad))):
        HeadOn(**bad)


def test_without_messages_a_leader_by_number_is_refused_in_one_line():
    model = meeting(1, HeadOn(leader="number"), *CHAIN)
    with pytest.raises(InvalidValueError, match=r"HeadOn decides by number, .* model\.communication = Radio"):
        model.step()


def test_an_unknown_way_to_choose_a_leader_is_refused():
    with pytest.raises(UnknownNameError, match="leader"):
        HeadOn(leader="rank")


def by_number(rng: int, poses: list, design=AGENT9, leader="number"):
    """Return a world of robots that decide by number, or by chain."""
    model = empty(width=1600, height=1200, rng=rng)
    model.add_robots(design, poses=poses, tendency="left")
    model.communication = Radio(range=80, state=False, goal=False, message=("number", "follows"))
    model.control = Subsumption(HeadOn(leader=leader, distance=40), *CHAIN)
    return model


PAIR = [(750, 600, 0.0), (850, 600, math.pi)]


def test_by_number_the_one_with_the_higher_number_leads_and_the_other_waits_and_follows():
    for rng in range(10):
        model = by_number(rng, PAIR)
        while (model.swarm.layer != 0).all():
            model.step()
        number = model.swarm.columns["0.HeadOn.number"].copy()
        higher = int(number.argmax())
        assert model.swarm.command[higher, 0] == -model.swarm.command[higher, 1] != 0.0
        assert model.swarm.command[1 - higher].tolist() == [0.0, 0.0]
        model.run(120)
        assert leads_the_other(model)
        ahead = model.swarm.position[higher] - model.swarm.position[1 - higher]
        heading = model.swarm.heading[1 - higher]
        assert ahead @ np.array([math.cos(heading), math.sin(heading)]) > 0.0
        assert (model.swarm.columns["0.HeadOn.number"] == number).all()


@pytest.mark.slow
@pytest.mark.parametrize("leader", ["number", "chain"])
def test_a_robot_that_is_followed_gains_the_head_that_none_follows(leader):
    for rng in range(10):
        # Two robots in a chain, and one that comes towards it, whatever its number.
        model = by_number(rng, [(700, 600, 0.0), (675, 600, 0.0), (800, 600, math.pi)], leader=leader)
        turned = set()
        for _ in range(200):
            model.step()
            on_the_spot = (model.swarm.command[:, 0] == -model.swarm.command[:, 1]) & (model.swarm.command[:, 1] != 0)
            turned |= set(np.flatnonzero(on_the_spot & (model.swarm.layer == 0)).tolist())
        assert turned == {2}
        assert math.cos(model.swarm.heading[2]) > 0.9
        assert np.argsort(model.swarm.position[:, 0]).tolist() == [1, 0, 2]


def test_by_chain_two_that_none_follows_go_on_as_without_the_layer():
    ruled, free = (by_number(3, PAIR, leader="chain") for _ in range(2))
    free.control = Subsumption(*CHAIN)
    for _ in range(120):
        ruled.step()
        free.step()
        assert (ruled.swarm.layer != 0).all()
        assert (ruled.swarm.position == free.swarm.position).all()


@pytest.mark.parametrize("leader", ["number", "chain"])
def test_where_both_are_followed_neither_turns_round_or_waits(leader):
    poses = [(700, 600, 0.0), (675, 600, 0.0), (800, 600, math.pi), (825, 600, math.pi)]
    model = by_number(1, poses, leader=leader)
    for _ in range(100):
        model.step()
        heads = model.swarm.layer[[0, 2]]
        if abs(model.swarm.position[0, 0] - model.swarm.position[2, 0]) < 20:
            break
        assert (heads != 0).all()


def test_robots_by_number_are_the_same_for_the_same_seed():
    first, again, other = (by_number(rng, PAIR).run(100).state_hash() for rng in (3, 3, 4))
    assert first == again != other
