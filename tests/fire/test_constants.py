"""From required properties to constants, and their remarks."""

import math
import warnings

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.errors import FireConstantsWarning, InvalidValueError
from mesa_swarm.fire import FireConstants, design_constants, robots_needed
from mesa_swarm.fire.burning import next_temperature


def quiet(**required):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FireConstantsWarning)
        return design_constants(**required)


def steps_until_out(constants, area, robots, temperature):
    values = (constants.k1, constants.k2, 0.0, 0.0, 1.0, 0.0)
    for step in range(1, 100_000):
        temperature = next_temperature(temperature, area, robots, values)
        if temperature <= 0.0:
            return step
    return None


def test_equation_b9_as_corrected_gives_the_value_that_was_checked_by_hand():
    constants = quiet(growth_time=1000, robots=3, extinguish_time=200, area=1, largest_area=1)
    assert constants.k2 == pytest.approx(0.0020159, abs=5e-8)
    assert steps_until_out(constants, 1.0, 3, 1.0) in (200, 201)


@given(
    robots=st.integers(1, 20),
    time=st.floats(200, 3000),
    growth=st.floats(300, 5000),
    area=st.floats(0.5, 30),
    temperature=st.floats(0.1, 1),
)
def test_the_robots_asked_for_put_the_fire_out_in_the_time_asked_for(robots, time, growth, area, temperature):
    constants = quiet(
        growth_time=growth,
        robots=robots,
        extinguish_time=time,
        area=area,
        largest_area=area,
        initial_temperature=temperature,
    )
    # The rule goes in whole steps; the equation is continuous.
    assert steps_until_out(constants, area, robots, temperature) == pytest.approx(time, rel=0.01, abs=3)


def test_heating_and_cooling_balance_at_the_balance_temperature_of_the_largest_fire():
    c = quiet(balance_temperature=0.3, largest_area=16, area=16)
    assert c.k3 * 0.3 * 16 == pytest.approx(c.k4)
    assert c.k3 * 1.0 * 16 - c.k4 == pytest.approx(1.0)


def test_the_stay_at_the_largest_fire_at_its_hottest_is_the_stay_time():
    c = quiet(stay_time=150)
    heat, steps = 0.0, 0
    while heat < c.leave:
        heat = max(heat + c.k3 * 16 - c.k4, 0.0)
        steps += 1
    assert steps in (150, 151)


def test_a_robot_that_left_may_return_after_the_rest_time():
    c = quiet(stay_time=150, rest_time=60)
    steps = math.ceil((c.leave - c.join) / c.k4 - 1e-9)
    assert steps == 60


def test_a_long_time_and_a_short_one_neither_overflow_nor_cancel():
    assert math.isfinite(quiet(extinguish_time=1e9).k2)
    limit = quiet(growth_time=1e9, robots=2, extinguish_time=10, area=4, largest_area=4).k2
    assert limit == pytest.approx(4 / (2 * 10), rel=1e-6)


def test_the_defaults_need_more_than_one_robot_and_fewer_than_two():
    assert 1.0 < robots_needed(design_constants(), 16.0) < 2.0


def test_the_defaults_come_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert design_constants().remarks


@pytest.mark.parametrize(
    ("required", "words"),
    [
        ({"robots": 1, "extinguish_time": 100}, "one robot suffices"),
        ({"robots": 5000, "extinguish_time": 1e5}, "the robots cannot put it out"),
        ({"rest_time": 1e6}, "join is 0"),
    ],
)
def test_requirements_that_defeat_the_task_are_remarked_on(required, words):
    with pytest.warns(FireConstantsWarning, match=words):
        constants = design_constants(**required)
    assert any(words in remark for remark in constants.remarks)


@pytest.mark.parametrize(
    "required",
    [
        {"growth_time": 0},
        {"growth_time": math.nan},
        {"robots": -1},
        {"balance_temperature": 1.0},
        {"area": 20, "largest_area": 16},
        {"stay_time": math.inf},
    ],
)
def test_requirements_out_of_range_are_refused_by_name(required):
    with pytest.raises(InvalidValueError, match=next(iter(required))):
        design_constants(**required)


def test_leaving_and_joining_at_the_same_heat_is_refused():
    with pytest.raises(InvalidValueError, match="below leave"):
        FireConstants(0.001, 0.02, 0.1, 0.2, 10, 10)
