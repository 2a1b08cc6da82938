"""Avoid and Explore: which way robots turn, and the corridor in which turning on the spot never ends."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, SwarmModel, disc, rectangle
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.control import Avoid, Explore, Subsumption
from support.scenes import corridor, empty, nine


def decision(obstacles, tendency="left", **options):
    """Return the command and the winning layer of one robot at (200, 150) that heads right."""
    model = empty()
    for shape in obstacles:
        model.add_obstacle(shape)
    model.add_robots(AGENT3, poses=[(200, 150, 0.0)], tendency=tendency)
    model.control = Subsumption(Avoid(**options), Explore())
    model.step()
    return model.swarm.command[0].tolist(), int(model.swarm.layer[0])


AHEAD = disc((220, 150), 5)
LEFT = disc((200 + 18 * math.cos(0.9), 150 + 18 * math.sin(0.9)), 3)
RIGHT = disc((200 + 18 * math.cos(0.9), 150 - 18 * math.sin(0.9)), 3)


def test_nothing_near_lets_the_robot_explore_straight_on():
    assert decision([]) == ([1.0, 1.0], 1)


@pytest.mark.parametrize(
    ("obstacles", "command"),
    [([LEFT], [1.0, 0.0]), ([RIGHT], [0.0, 1.0]), ([LEFT, RIGHT], [0.0, 1.0])],
    ids=["left turns right", "right turns left", "of both the right one is checked last"],
)
def test_the_side_that_is_activated_last_decides_the_turn(obstacles, command):
    assert decision(obstacles) == (command, 0)


def test_what_is_straight_ahead_turns_the_robot_to_its_own_side():
    assert decision([AHEAD], "left")[0] == [0.0, 1.0]
    assert decision([AHEAD], "right")[0] == [1.0, 0.0]


def test_a_stationary_turn_runs_the_inner_wheel_backwards():
    assert decision([AHEAD], "left", turn="stationary")[0] == [-1.0, 1.0]


def test_what_is_just_as_far_as_the_distance_does_not_activate():
    gap = 220 - 5 - 205
    assert decision([AHEAD], distance=gap)[1] == 1
    assert decision([AHEAD], distance=gap + 1e-9)[1] == 0


def test_a_robot_without_sensors_only_explores():
    model = empty()
    model.add_robots(AGENT9.with_proximity(range=0), poses=[(200, 150, 0.0)])
    model.control = Subsumption(Avoid(), Explore(speed=0.5))
    model.step()
    assert model.swarm.command.tolist() == [[0.5, 0.5]]


def oscillations(turn):
    """Return how often the command of a robot in a blind alley changes sides, and how far it came."""
    model = corridor(width=22.0)
    model.add_robots(AGENT3, poses=[(150, 150, 0.1)], tendency="left")
    model.control = Subsumption(Avoid(distance=15, turn=turn), Explore())
    turns = []
    for _ in range(3000):
        model.step()
        left, right = model.swarm.command[0]
        turns.append(np.sign(right - left))
    turning = [side for side in turns if side]
    changes = np.count_nonzero(np.diff(turning))
    return changes, float(np.hypot(*(model.swarm.position[0] - (150, 150))))


def test_turning_on_the_spot_in_a_narrow_corridor_never_ends_and_stopping_one_wheel_does():
    stuck, nowhere = oscillations("stationary")
    _, somewhere = oscillations("translational")
    assert stuck > 1000
    assert nowhere < 60
    assert somewhere > 100


def test_random_turns_come_at_the_interval_asked_for_and_are_of_every_angle():
    model = SwarmModel(map="openspace", rng=3)
    model.add_robots(nine(0), 30)
    model.control = Subsumption(Explore(turn_interval=50))
    headings = [model.swarm.heading.copy()]
    for _ in range(49):
        model.step()
    assert (model.swarm.command[:, 0] == model.swarm.command[:, 1]).all()
    model.run(60)
    headings.append(model.swarm.heading)
    turned = np.abs(np.angle(np.exp(1j * (headings[1] - headings[0]))))
    assert turned.min() < 0.6
    assert turned.max() > 2.5


def test_random_turns_do_not_change_where_robots_start():
    starts = []
    for interval in (0, 50):
        model = SwarmModel(map="openspace", rng=3)
        model.add_robots(AGENT9, 10)
        model.control = Subsumption(Explore(turn_interval=interval))
        starts.append(model.swarm.position.copy())
    assert (starts[0] == starts[1]).all()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Avoid(distance=-1), "distance is -1"),
        (lambda: Avoid(distance=math.nan), "distance is nan"),
        (lambda: Explore(speed=1.5), "speed is 1.5"),
        (lambda: Explore(turn_interval=2.5), "whole number"),
        (Subsumption, "0 layers"),
        (lambda: Subsumption(Avoid), "expected layers"),
        (lambda: Subsumption("Avoid"), "expected layers"),
    ],
)
def test_wrong_parameters_are_refused_in_words(make, words):
    with pytest.raises(InvalidValueError, match=words):
        make()


def test_an_unknown_turn_suggests_the_nearest():
    with pytest.raises(UnknownNameError, match="did you mean 'stationary'"):
        Avoid(turn="stationery")


def test_one_arbiter_may_drive_two_models_without_mixing_them():
    control = Subsumption(Avoid(), Explore(turn_interval=20))
    hashes = []
    for _ in range(2):
        model = SwarmModel(map="sparse", rng=5)
        model.add_robots(AGENT9, 5)
        model.control = control
        hashes.append(model)
    for _ in range(60):
        for model in hashes:
            model.step()
    assert hashes[0].state_hash() == hashes[1].state_hash()


def test_a_wall_in_front_is_not_run_into():
    model = empty()
    model.add_obstacle(rectangle((300, 0), (320, 300)))
    model.add_robots(AGENT9, poses=[(200, 150, 0.0)])
    model.control = Subsumption(Avoid(), Explore())
    model.run(400)
    assert model.total_collisions == 0
