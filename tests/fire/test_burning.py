"""The thermodynamics of fires and of heated robots, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import SwarmModel
from mesa_swarm.fire import FireConstants, design_constants, robots_needed
from mesa_swarm.fire.burning import is_hot, next_temperature
from support.scenes import blind, empty

CONSTANTS = FireConstants(k1=0.001, k2=0.02, k3=0.1, k4=0.5, leave=20.0, join=5.0)


def one_fire(n_robots=1, temperature=0.5, constants=CONSTANTS, area=4.0):
    model = empty(fire_constants=constants)
    model.add_fire((200, 150), area=area, temperature=temperature)
    edge = model.fires[0].radius + 5.0
    angles = 2 * np.pi * np.arange(n_robots) / max(n_robots, 1)
    poses = [(200 + (edge + 4) * math.cos(a), 150 + (edge + 4) * math.sin(a), 0.0) for a in angles]
    if n_robots:
        model.add_robots(blind(), poses=poses)
    return model


def test_an_unattended_fire_grows_from_nothing_to_one_in_the_growth_time_within_one_step():
    constants = design_constants(growth_time=1000)
    model = one_fire(0, 1e-12, constants)
    model.run(1000)
    exact = math.exp(constants.k1 * 1000) - 1
    assert model.fires.temperature[0] == pytest.approx(exact, rel=1e-3)
    model.run(3)
    assert model.fires.temperature[0] == 1.0


def test_each_robot_at_a_fire_lowers_it_by_k2_over_area():
    model = one_fire(3)
    model.step()
    grown = 0.5 + 0.001 * 1.5
    assert model.fires.temperature[0] == pytest.approx(grown - 3 * 0.02 / 4.0, rel=1e-12)
    assert model.fires.robots.tolist() == [3]


def test_a_fire_that_is_out_stays_out_and_never_has_a_negative_temperature():
    model = one_fire(8, temperature=0.001)
    model.step()
    assert model.fires.out.tolist() == [True]
    assert model.fires.temperature.tolist() == [0.0]
    assert model.fires.robots.tolist() == [0]
    model.run(50)
    assert model.fires.temperature.tolist() == [0.0]
    assert model.fires.out_step.tolist() == [1]
    assert (model.fires.history.robots[:, 0] == -1).all()


def test_a_robot_takes_heat_only_near_a_fire_and_cools_at_a_constant_rate():
    model = one_fire(1)
    robot = model.robots[0]
    robot.temperature = 3.0
    model.step()
    assert robot.temperature == pytest.approx(3.0 + 0.1 * 0.5 * 4.0 - 0.5)
    robot.position = (20, 20)
    robot.temperature = 3.0
    model.run(4)
    assert robot.temperature == pytest.approx(1.0)
    model.run(4)
    assert robot.temperature == 0.0


def test_a_hot_robot_fights_again_only_when_it_has_cooled_to_join():
    constants = tuple([0.0] * 4 + [20.0, 5.0])
    assert is_hot(20.0, False, constants)
    assert is_hot(19.9, True, constants)
    assert is_hot(5.1, True, constants)
    assert not is_hot(5.0, True, constants)
    assert not is_hot(19.9, False, constants)


def test_a_robot_that_may_rejoin_at_zero_does_rejoin():
    assert not is_hot(0.0, True, (0.0, 0.0, 0.0, 0.0, 20.0, 0.0))


def test_a_robot_fights_one_fire_at_a_time_the_nearest():
    model = empty(fire_constants=CONSTANTS)
    model.add_fire((100, 150), radius=20)
    model.add_fire((158, 150), radius=20)
    model.add_robots(blind(), poses=[(128, 150, 0.0)])
    model.step()
    assert model.swarm.fire.tolist() == [0]
    assert model.fires.robots.tolist() == [1, 0]


def test_a_robot_just_out_of_range_neither_fights_nor_takes_heat():
    model = empty(fire_constants=CONSTANTS, extinguish_range=10)
    model.add_fire((100, 150), radius=20)
    model.add_robots(blind(), poses=[(100 + 20 + 5 + 10.001, 150, 0.0), (100 - 20 - 5 - 9.999, 150, 0.0)])
    model.step()
    assert model.swarm.fire.tolist() == [-1, 0]
    assert model.swarm.heat[0] == 0.0
    assert model.swarm.heat[1] > 0.0


@given(
    temperature=st.floats(0, 1),
    area=st.floats(0.1, 100),
    robots=st.integers(0, 100),
    k1=st.floats(1e-6, 1),
    k2=st.floats(1e-6, 10),
)
def test_the_temperature_of_a_fire_stays_between_0_and_1(temperature, area, robots, k1, k2):
    assert 0.0 <= next_temperature(temperature, area, robots, (k1, k2, 0.0, 0.0, 1.0, 0.0)) <= 1.0


def test_as_many_robots_as_needed_just_hold_a_fire():
    n = 2
    area = 4.0
    constants = FireConstants(k1=0.001, k2=0.001 * area * 1.5 / n, k3=0.0, k4=0.0, leave=1.0, join=0.0)
    assert robots_needed(constants, area, 0.5) == pytest.approx(n)
    held = next_temperature(0.5, area, n, (constants.k1, constants.k2, 0.0, 0.0, 1.0, 0.0))
    assert held == pytest.approx(0.5, abs=1e-15)


def test_the_history_has_a_row_after_the_steps_that_are_due():
    model = SwarmModel(map="openspace_fire", rng=1, history_every=5)
    model.run(23)
    assert model.fires.history.steps.tolist() == [5, 10, 15, 20]
    assert model.fires.history.temperature.shape == (4, 7)
