"""Pathologies: each scene provokes one kind, in the simulator, and the others stay silent."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, disc
from mesa_swarm.analysis.pathology import find_pathologies
from mesa_swarm.control import Avoid, Explore, Subsumption, behaviour
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from support.scenes import ahead, blind, circle, corridor, empty
from support.tracks import CENTROID, CORRIDOR, HEAD_ON, KEPT, STUCK, THRESHOLD, only, recorded


@behaviour
def shy(me, distance=20.0):
    """Drive ahead, and backwards from what is too near."""
    speed = -me.max_speed if 0.0 <= me.distance[me.front] < distance else me.max_speed
    return speed, speed


@behaviour
def drawn(me, kind_of_robots=1.0):
    """Turn on the spot to the side on which a robot is seen."""
    if me.left < 0:
        return 0.0, 0.0
    if me.kind[me.left] == kind_of_robots:
        return -me.max_speed, me.max_speed
    if me.kind[me.right] == kind_of_robots:
        return me.max_speed, -me.max_speed
    return 0.0, 0.0


def in_corridor(turn, width=22.0):
    model = corridor(width=width)
    model.add_robots(AGENT3, poses=[(150, 150, 0.1)], tendency="left")
    model.control = Subsumption(Avoid(distance=15, turn=turn), Explore())
    return recorded(model, 2000)


def test_turning_on_the_spot_in_a_narrow_corridor_is_one_long_corridor_flip():
    (episode,) = only(find_pathologies(**in_corridor("stationary")), CORRIDOR)
    assert episode.robots == (0,)
    assert episode.first_step < 10
    assert episode.last_step == 2000
    assert episode.flips > 1900
    assert episode.layers == (0,)


@pytest.mark.parametrize("width", [16, 22, 26, 30])
def test_stopping_one_wheel_in_the_same_corridor_is_no_pathology(width):
    assert len(find_pathologies(**in_corridor("translational", width))) == 0


@pytest.mark.parametrize("seed", [0, 1])
def test_robots_that_avoid_each_other_in_open_space_are_healthy(seed):
    model = CollisionAvoidance(n_robots=10, map="openspace", rng=seed)
    assert len(find_pathologies(**recorded(model, 2000))) == 0


def driving_at_each_other():
    model = empty()
    model.add_robots(AGENT9, poses=[(100, 150, 0.0), (200, 150, math.pi)])
    model.control = Subsumption(ahead)
    return recorded(model, 300)


def test_two_robots_that_drive_at_each_other_are_a_head_on_pair():
    (episode,) = only(find_pathologies(**driving_at_each_other()), HEAD_ON)
    assert episode.robots == (0, 1)
    assert 40 <= episode.first_step <= 50
    assert episode.last_step == 300


def test_a_robot_that_drives_at_a_wall_is_stuck():
    model = empty()
    model.add_robots(AGENT9, poses=[(300, 150, 0.0)])
    model.control = Subsumption(ahead)
    (episode,) = only(find_pathologies(**recorded(model, 300)), STUCK)
    assert 90 <= episode.first_step <= 100
    assert episode.last_step == 300


def test_a_robot_that_goes_back_at_a_threshold_goes_back_and_forth():
    model = empty()
    model.add_obstacle(disc((300, 150), 20))
    model.add_robots(AGENT9, poses=[(200, 150, 0.0)])
    model.control = Subsumption(shy)
    (episode,) = only(find_pathologies(**recorded(model, 300)), THRESHOLD)
    assert 50 <= episode.first_step <= 60
    assert episode.last_step == 300
    assert episode.flips == 301 - episode.first_step


def test_a_robot_that_is_drawn_to_two_robots_by_turns_flips_towards_their_centroid():
    model = empty()
    model.add_robots(AGENT3, poses=[(200, 150, 0.1)])
    beside = 40 * np.array([math.cos(math.radians(15)), math.sin(math.radians(15))])
    model.add_robots(blind(), poses=[(200 + beside[0], 150 + side * beside[1], 0.0) for side in (1, -1)])
    model.control = Subsumption(drawn)
    (episode,) = only(find_pathologies(**recorded(model, 200)), CENTROID)
    assert episode.robots == (0,)
    assert episode.flips > 150


@pytest.mark.parametrize("radius", [10.0, 30.0])
def test_a_robot_that_drives_in_a_circle_comes_back_but_is_not_stuck(radius):
    model = empty()
    model.add_robots(AGENT9, poses=[(200, 150, 0.0)])
    model.control = Subsumption(circle(left=(radius - 5) / (radius + 5), right=1.0))
    steps = round(2 * math.pi * (radius + 5))
    found = find_pathologies(**recorded(model, 3 * steps), fewest_steps=steps)
    assert len(found) == 0


def test_a_robot_that_slides_along_a_disc_is_not_stuck():
    model = empty()
    model.add_obstacle(disc((300, 150), 60))
    model.add_robots(AGENT9, poses=[(200, 170, 0.0)])
    model.control = Subsumption(ahead)
    assert not find_pathologies(**recorded(model, 170)).of(0)


@pytest.fixture(scope="module")
def crowd():
    return recorded(CollisionAvoidance(n_robots=30, map="original", rng=1, turn="stationary"), 400)


def test_who_stands_in_which_row_is_nothing(crowd):
    order = np.random.default_rng(0).permutation(30)
    by_row = {name: crowd[name][order] for name in ("radius", "max_speed", "forward")}
    there = {name: crowd[name][:, order] for name in KEPT}
    here, other = find_pathologies(**crowd), find_pathologies(**{**crowd, **by_row, **there})
    assert len(here) > 5

    def outline(found, row):
        return sorted(
            (e.kind, sorted(int(row[r]) for r in e.robots), e.first_step, e.last_step, e.flips) for e in found
        )

    assert outline(here, np.arange(30)) == outline(other, order)


@settings(max_examples=10)
@given(st.floats(-math.pi, math.pi), st.tuples(st.floats(-500, 500), st.floats(-500, 500)))
def test_where_it_happens_is_nothing(crowd, turn, shift):
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    moved = {"position": crowd["position"] @ rotation.T + shift, "heading": crowd["heading"] + turn}
    assert find_pathologies(**{**crowd, **moved}) == find_pathologies(**crowd)


def test_left_and_right_are_alike(crowd):
    mirrored = {
        "position": crowd["position"] * [1, -1],
        "heading": -crowd["heading"],
        "command": crowd["command"][..., ::-1],
        "forward": crowd["forward"][:, [0, 2, 1]],
    }
    assert find_pathologies(**{**crowd, **mirrored}) == find_pathologies(**crowd)


def test_every_step_of_a_robot_belongs_to_one_episode_at_most(crowd):
    found = find_pathologies(**crowd)
    after_another = []
    for row in range(30):
        episodes = sorted((e.first_step, e.last_step) for e in found.of(row))
        after_another += [a[1] < b[0] for a, b in pairwise(episodes)]
    assert len(after_another) > 2
    assert all(after_another)
