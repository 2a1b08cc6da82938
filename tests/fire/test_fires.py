"""Fires as agents and as columns: what may be asked of them, how they come and go, and their history."""

import inspect
import math
from types import SimpleNamespace

import numpy as np
import pytest

from mesa_swarm import SwarmModel, disc
from mesa_swarm.base.errors import InvalidValueError, RemovedRobotError
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.fire import FireConstants, Fires, design_constants
from mesa_swarm.maps.map import FireSpot
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.world.statics import FIRE, FIXED
from support.scenes import blind, empty

NO_HEAT = FireConstants(k1=1e-9, k2=1.0, k3=0.0, k4=0.0, leave=1.0, join=0.0)


def test_a_fires_area_follows_from_its_radius_and_its_radius_from_its_area_unless_both_are_given():
    model = empty()
    by_radius, by_area = model.add_fire((100, 100), radius=30), model.add_fire((200, 100), area=9)
    both = model.add_fire((300, 100), radius=30, area=2.5)
    assert [(fire.radius, fire.area) for fire in (by_radius, by_area, both)] == [(30, 9), (30, 9), (30, 2.5)]
    assert [fire.temperature for fire in model.fires] == [1.0] * 3
    assert FireSpot((100, 100), 30).area == by_radius.area


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ({"radius": 1e6}, {"radius": 1.1e6}),
        ({"radius": 1e-3}, {"radius": 0}),
        ({"radius": 5, "area": 1e12}, {"radius": 5, "area": 1.1e12}),
        ({"radius": 5, "area": 1e-9}, {"radius": 5, "area": 0}),
        ({"area": 1e-9}, {"area": 0}),
        ({"area": 1e10}, {"area": 1.1e12}),
        ({"radius": 5, "temperature": 1}, {"radius": 5, "temperature": 1.001}),
        ({"radius": 5, "temperature": 1e-9}, {"radius": 5, "temperature": 0}),
    ],
)
def test_a_fire_has_a_size_and_a_temperature_within_their_limits(right, wrong):
    model = empty()
    model.add_fire((200, 150), **right)
    with pytest.raises(InvalidValueError, match=f"^{list(wrong)[-1]} is"):
        model.add_fire((200, 150), **wrong)
    assert len(model.fires) == 1


def test_a_fire_of_neither_radius_nor_area_is_refused():
    with pytest.raises(InvalidValueError, match="neither radius nor area"):
        empty().add_fire((200, 150))


@pytest.mark.parametrize(("extinguish_range", "fights"), [(0, [0, -1]), (1e9, [0, 0])])
def test_the_range_at_which_a_fire_is_fought_is_from_nothing_to_a_thousand_million(extinguish_range, fights):
    model = empty(extinguish_range=extinguish_range, fire_constants=NO_HEAT)
    model.add_fire((200, 150), radius=20)
    model.add_robots(blind(), poses=[(225, 150, 0.0), (226, 150, math.pi)])
    model.step()
    assert model.swarm.fire.tolist() == fights
    for beyond in (-1e-9, 1.1e9):
        with pytest.raises(InvalidValueError, match="extinguish_range is"):
            empty(extinguish_range=beyond)


def test_the_temperature_of_a_fire_may_be_set_within_its_limits_while_it_burns():
    model = empty(fire_constants=NO_HEAT)
    fire = model.add_fire((200, 150), radius=20, temperature=0.5)
    for value in (1.0, 1e-3):
        fire.temperature = value
        assert model.fires.temperature.tolist() == [value]
    for value in (0, 1.001, math.nan):
        with pytest.raises(InvalidValueError, match="temperature is"):
            fire.temperature = value
    model.add_robots(blind(), poses=[(200 + 26, 150, 0.0)])
    model.step()
    assert fire.out
    with pytest.raises(InvalidValueError, match="this fire is out"):
        fire.temperature = 0.5
    assert fire.temperature == 0.0


def test_what_is_not_a_set_of_constants_is_refused_and_the_default_is_the_designed_one():
    model = empty()
    assert model.fire_constants == design_constants()
    with pytest.raises(InvalidValueError, match=r"^fire_constants is 5; expected what design_constants"):
        model.fire_constants = 5


def test_a_fire_model_has_the_defaults_of_a_swarm_model():
    swarm = inspect.signature(SwarmModel).parameters
    for name, own in inspect.signature(EngineModel).parameters.items():
        assert swarm[name].default == own.default, name


def test_the_columns_are_read_only_and_a_removed_fire_leaves_the_others_theirs():
    model = SwarmModel(map="openspace_fire", rng=1, fire_constants=NO_HEAT)
    first, *others = list(model.fires)
    before = {name: getattr(model.fires, name)[1:].tolist() for name in ("position", "radius", "area", "temperature")}
    first.remove()
    assert len(model.fires) == len(others) == 6
    assert [model.fires[k] for k in range(6)] == others
    assert {name: getattr(model.fires, name).tolist() for name in before} == before
    assert [fire.radius for fire in others] == before["radius"]
    with pytest.raises(ValueError, match="read-only"):
        model.fires.temperature[0] = 0.5
    for name in ("position", "radius", "area", "temperature", "out", "robots"):
        with pytest.raises(RemovedRobotError, match="this fire has been removed"):
            getattr(first, name)
    assert "removed" in repr(first)
    assert "removed" not in repr(others[0])


def test_robots_at_a_fire_are_released_when_another_one_is_removed():
    model = empty(fire_constants=NO_HEAT)
    other, fire = model.add_fire((50, 50), radius=20), model.add_fire((200, 150), radius=20, area=1e9)
    model.add_robots(blind(), poses=[(226, 150, 0.0)])
    model.step()
    assert (model.swarm.fire.tolist(), fire.robots, other.robots) == ([1], 1, 0)
    other.remove()
    assert model.swarm.fire.tolist() == [-1]
    model.step()
    assert (model.swarm.fire.tolist(), fire.robots) == ([0], 1)


def test_a_fire_that_is_added_cold_is_out_from_the_start_and_any_other_burns():
    fires = Fires()
    for x in (0.0, 1.0):
        fire = SimpleNamespace(temperature=x / 10)
        fires.table.add(fire, disc((x, 2.0), 5.0), mode=FIXED, kind=FIRE, temperature=fire.temperature)
        fires.add(fire, 0.25)
    assert fires.out.tolist() == [True, False]
    assert fires.out_step.tolist() == [0, -1]
    assert fires.robots.tolist() == [0, 0]
    assert fires.discs.tolist() == [[0, 2, 5], [1, 2, 5]]


def test_a_fire_that_comes_later_has_no_past_in_the_history_and_one_that_went_no_future():
    model = empty(fire_constants=NO_HEAT)
    first = model.add_fire((50, 50), radius=20, temperature=0.25)
    model.run(2)
    model.add_fire((200, 150), radius=20, temperature=0.5)
    model.run(1)
    first.remove()
    model.run(1)
    history = model.fires.history
    assert history.steps.tolist() == [1, 2, 3, 4]
    assert np.isnan(history.temperature).tolist() == [[False, True], [False, True], [False, False], [True, False]]
    assert history.robots.tolist() == [[0, -1], [0, -1], [0, 0], [-1, 0]]
    assert history.temperature[2] == pytest.approx([0.25, 0.5], abs=1e-6)
    history.forget(1)
    assert history.steps.tolist() == [4]
    history.forget(7)
    assert history.steps.tolist() == [4]
    assert history.temperature.shape == history.robots.shape == (1, 2)
    history.forget(0)
    assert history.temperature.shape == (0, 0)


def test_how_often_the_history_gets_a_row_may_be_changed_and_is_every_step_by_default():
    model = empty()
    model.run(1)
    assert model.fires.history.steps.tolist() == []
    model.add_fire((200, 150), radius=20)
    assert model.fires.history.every == Fires().history.every == 1
    model.run(2)
    model.fires.history.every = 0
    model.run(2)
    model.fires.history.every = Trigger(every=3)
    assert model.fires.history.every == 3
    model.run(4)
    assert model.fires.history.steps.tolist() == [2, 3, 6, 9]
