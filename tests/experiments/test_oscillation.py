"""Oscillation of trained robots beside and before a wall: what is counted, and the effect of rewards."""

import numpy as np
import pytest

from mesa_swarm import AGENT9
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.experiments.diagnosis import MEASURES, SCENES, flips, oscillation
from mesa_swarm.learning import Networks, QPolicy, SensorLayout


def watched(commands, nearest):
    """The watched steps of a robot with one sensor, these commands and these readings."""
    command = np.array(commands, dtype=float)[:, None, :]
    return {"command": command, "distance": np.array(nearest, dtype=float)[:, None, None]}


def test_flips_are_counted_where_something_is_in_sight_and_per_100_such_steps():
    commands = [(1, -1), (-1, 1), (1, 1), (1, -1), (-1, -1), (1, 1)]
    found = flips(watched(commands, [10, 10, 10, 10, -1, 10]), 50.0)
    assert found["turns to and fro"] == pytest.approx(100 * 2 / 5)  # left after right, and right again after ahead
    assert found["back and forth"] == pytest.approx(100 * 1 / 5)  # the flip to backwards was out of sight
    assert flips(watched(commands, [-1] * 6), 50.0) == {"turns to and fro": 0.0, "back and forth": 0.0}


def always(action):
    """A policy that holds one action best, whatever it reads."""
    blank = QPolicy.untrained(AGENT9, rng=np.random.default_rng(1), actions=4).networks
    bias = np.zeros(4)
    bias[action] = 10.0
    networks = Networks(*(np.zeros_like(w) for w in blank.weights[:3]), bias)
    return QPolicy(sensors=SensorLayout.of(AGENT9), networks=networks, actions=4, steps=1)


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("action", range(4))
def test_who_always_does_the_same_does_not_oscillate(scene, action):
    assert oscillation(always(action), scene=scene, steps=60) == dict.fromkeys(MEASURES, 0.0)


def test_who_chooses_between_forwards_and_backwards_by_chance_is_found_to_go_back_and_forth():
    policy = always(0)
    policy.networks.outer_bias[3] = 10.0
    measured = oscillation(policy, scene="towards a wall", steps=200)
    assert measured["back and forth"] > 30
    assert measured["back-and-forth at a threshold"] > 0.5
    assert measured["turns to and fro"] == 0


def test_the_same_seed_gives_the_same_numbers():
    policy = QPolicy.untrained(AGENT9, rng=np.random.default_rng(1), steps=1)
    first, again, other = (oscillation(policy, scene="beside a wall", steps=50, rng=rng) for rng in (1, 1, 2))
    assert first == again
    assert first != other


def test_an_unknown_scene_is_refused():
    with pytest.raises(SwarmError, match="scene"):
        oscillation(always(3), scene="in a corridor")
