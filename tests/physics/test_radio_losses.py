"""Broadcasts that are lost: how often, to whom, and what they do not disturb."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT9, Radio, SwarmModel
from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.model.state_hash import written_state_hash
from support.messages import heard


def counts(probability, steps=300, n=10):
    """Return, in rows of steps, which of n robots about a speaker heard it."""
    azimuths = 2 * math.pi * np.arange(n) / n
    poses = [(200, 150, 0.0), *((200 + 50 * math.cos(a), 150 + 50 * math.sin(a), 0.0) for a in azimuths)]
    model = heard(poses, Radio(loss_probability=probability), [1] + [-1] * n)
    return np.array([model.run(1).swarm.heard_task[1:] == 1 for _ in range(steps)])


def test_nothing_is_lost_with_probability_0_and_everything_with_1():
    assert counts(0.0, steps=3).all()
    assert not counts(1.0, steps=3).any()


def test_broadcasts_are_lost_with_the_given_probability_to_each_hearer_and_in_each_step_alone():
    arrived = counts(0.3)
    sigma = math.sqrt(0.3 * 0.7 / arrived.size)
    assert arrived.mean() == pytest.approx(0.7, abs=4 * sigma)
    both = (arrived[:, 0::2] & arrived[:, 1::2]).mean(), (arrived[:-1] & arrived[1:]).mean()
    assert both == pytest.approx((0.49, 0.49), abs=8 * sigma)


def test_to_hear_and_to_be_heard_are_lost_independently():
    model = heard([(100, 100, 0.0), (150, 100, 0.0)], Radio(loss_probability=0.5), [1, 1])
    pairs = np.array([model.run(1).swarm.heard_task == 1 for _ in range(400)])
    assert (pairs[:, 0] != pairs[:, 1]).mean() == pytest.approx(0.5, abs=0.1)


def test_the_same_seed_loses_the_same_and_another_seed_something_else():
    poses = [(40 + 30 * k, 100, 0.0) for k in range(10)]
    runs = [heard(poses, Radio(loss_probability=0.5), range(10), rng=rng).run(20).state_hash() for rng in (1, 1, 2)]
    assert runs[0] == runs[1] != runs[2]


def test_a_robot_that_goes_changes_nothing_of_what_the_others_lose():
    poses, tasks = [(40 + 30 * k, 100, 0.0) for k in range(10)], [-1, *range(1, 10)]
    stays, goes = (heard(poses, Radio(loss_probability=0.5), tasks) for _ in range(2))
    goes.remove_robots([goes.robots[0]])
    received = []
    for _ in range(20):
        received.append(stays.run(1).swarm.heard_task[1:].tolist())
        assert goes.run(1).swarm.heard_task.tolist() == received[-1]
    assert len({tuple(row) for row in received}) > 10  # something is lost


def test_losses_disturb_no_other_random_stream_and_looking_loses_nothing_more():
    def run(radio, look=False):
        model = SwarmModel(map="original", rng=1, communication=radio)
        model.add_robots(AGENT9.with_slip(probability=0.2, magnitude=0.5), 10)
        model.control = Subsumption(Explore(turn_interval=20))
        for _ in range(30):
            if look:
                model.sense()
                model.state_hash()
            model.step()
        return written_state_hash(model)  # that of the state alone, without what a model was made with

    assert run(Radio(loss_probability=0.5)) == run(None) == run(Radio(loss_probability=0.5), look=True)
