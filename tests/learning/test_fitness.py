"""Fitness: the equation of Floreano and Mondada, collisions, and squares visited, of drives that are known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, Map, SwarmModel, rectangle
from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.learning.actions import ranges_of
from mesa_swarm.learning.fitness import Fitness, Tally, floreano

HALL = Map(name="hall", bounds=(0, 0, 400, 200))
WHEEL = st.floats(-1, 1)


def tallied(poses, steps, world=HALL, control=None, **options):
    model = SwarmModel(map=world, rng=1)
    model.add_robots(AGENT9, poses=poses)
    model.control = control or Subsumption(Explore())
    tally = Tally(len(poses), model.map.bounds, ranges_of(model.swarm.table.proximity), **options)
    for _ in range(steps):
        model.step()
        tally.add(model.swarm.columns)
    return tally


@pytest.mark.parametrize(
    ("left", "right", "nearest", "worth"),
    [
        (1, 1, 0, 1),  # fast, straight, far
        (-1, -1, 0, 1),  # back is as good as ahead: V has no sign
        (1, -1, 0, 0),  # on the spot
        (1, 0, 0, 0.5 * (1 - math.sqrt(0.5))),
        (0.5, 0.5, 0.25, 0.5 * 0.75),
        (1, 1, 1, 0),
        (0, 0, 0, 0),
    ],
)
def test_floreanos_product_of_known_motions(left, right, nearest, worth):
    assert floreano(left, right, nearest) == pytest.approx(worth, abs=1e-15)


@given(WHEEL, WHEEL, st.floats(0, 1))
def test_floreanos_product_is_within_0_and_1_and_the_same_for_mirrored_wheels(left, right, nearest):
    worth = floreano(left, right, nearest)
    assert 0 <= worth <= 1
    assert worth == floreano(right, left, nearest) == floreano(-left, -right, nearest)


def test_a_robot_alone_on_its_way_has_all_of_both_fitnesses_and_has_been_in_the_squares_that_it_crossed():
    means = tallied([(100, 100, 0.0)], 100).means()
    assert (means["floreano"], means["ahead"], means["collisions"]) == (1.0, 1.0, 0.0)
    assert means["covered"] == 4 / 50  # x from 101 to 200: columns 2 to 4, and 5 begins at 200
    assert Fitness(kind="floreano").of(**means) == 1.0
    assert Fitness(collision_cost=3, coverage_worth=10).of(**means) == pytest.approx(1.8)
    assert Fitness(collision_cost=3, coverage_worth=10, speed_worth=5).of(**means) == pytest.approx(5.8)


def test_small_squares_are_counted_where_they_are_asked_for():
    tally = tallied([(100, 100, 0.0)], 99, square=10)  # x from 101 to 199, columns 10 to 19
    assert tally.visited.shape == (20, 40)
    assert np.flatnonzero(tally.visited.any(axis=0)).tolist() == list(range(10, 20))
    assert tally.means()["covered"] == 10 / 800


def test_a_robot_that_drives_against_a_wall_collides_in_each_step_and_earns_nothing_of_floreanos():
    wall = Map(name="wall", bounds=(0, 0, 400, 200), obstacles=[rectangle((200, 0), (220, 200))])
    tally = tallied([(195, 100, 0.0), (50, 100, math.pi)], 20, wall)
    assert tally.sums[0, 2] == 20
    assert tally.sums[0, 0] == pytest.approx(0, abs=1e-9)
    assert tally.sums[1, 2] == 0
    means = tally.means()
    assert means["collisions"] == 0.5
    assert Fitness(collision_cost=100, coverage_worth=0).of(**means) == pytest.approx(means["ahead"] - 50)


def test_nearness_lowers_floreanos_product_by_the_nearest_reading():
    wall = Map(name="wall", bounds=(0, 0, 400, 200), obstacles=[rectangle((200, 0), (220, 200))])
    tally = tallied([(160, 100, 0.0)], 1, wall)  # the body ends 35 before the wall, of a range of 50
    reading = 35 / 50
    assert tally.sums[0, 0] == pytest.approx(reading, abs=0.11)  # where on the body the sensor sits
    assert tally.sums[0, 0] < 0.81


@pytest.mark.parametrize(
    "wrong",
    [
        {"kind": "nice"},
        {"collision_cost": -1},
        {"collision_cost": math.nan},
        {"coverage_worth": "much"},
        {"square": 0},
        {"speed_worth": -1},
    ],
)
def test_what_is_no_fitness_is_refused_in_one_line(wrong):
    with pytest.raises(SwarmError) as caught:
        Fitness(**wrong)
    assert "\n" not in str(caught.value)


def test_nothing_driven_has_no_fitness():
    with pytest.raises(InvalidValueError, match="0 steps of 2 robots"):
        Tally(2, (0, 0, 10, 10), np.ones((1, 9))).means()
    with pytest.raises(InvalidValueError, match="left is 2"):
        floreano(2, 0, 0)
