"""From required properties to constants, and their remarks."""

import math
import re
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.base.errors import FireConstantsWarning, InvalidValueError
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


def test_constants_follow_from_the_requirements_that_are_the_defaults():
    constants, share = design_constants(), 1 / (1 - math.exp(-math.log(2) * 1600 / 2000))
    assert constants.k1 == pytest.approx(math.log(2) / 2000)
    assert constants.k2 == pytest.approx(constants.k1 * 16 / 2 * (1 + share))
    assert constants.k3 == pytest.approx(1 / (16 * 0.4))
    assert constants.k4 == pytest.approx(1.5)
    assert (constants.leave, constants.join) == (100.0, pytest.approx(10.0))


LARGEST = {
    "growth_time": 1e12,
    "robots": 1e9,
    "extinguish_time": 1e12,
    "initial_temperature": 1.0,
    "largest_area": 1e12,
    "area": 16.0,
    "balance_temperature": 0.999999,
    "stay_time": 1e12,
    "rest_time": 1e12,
}


@pytest.mark.parametrize("name", LARGEST)
def test_every_requirement_is_above_zero_and_at_most_its_limit(name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FireConstantsWarning)
        design_constants(**{name: LARGEST[name]})
    for wrong in (0, -1, LARGEST[name] * 1.000001, math.inf):
        with pytest.raises(InvalidValueError, match=f"^{name} is"):
            design_constants(**{name: wrong})


RIGHT = {"k1": 1e6, "k2": 1e12, "k3": 1e6, "k4": 1e6, "leave": 1e12, "join": 9e11}


@pytest.mark.parametrize(("name", "may_be_zero"), [(k, k in ("k3", "k4", "join")) for k in RIGHT])
def test_every_constant_has_a_least_and_a_largest_value(name, may_be_zero):
    FireConstants(**RIGHT)
    beyond = 1.1e12 if name == "join" else 1.000001 * RIGHT[name]
    for wrong in (-1e-9, beyond, math.nan, *([] if may_be_zero else [0])):
        with pytest.raises(InvalidValueError, match=f"^{name} is"):
            FireConstants(**{**RIGHT, name: wrong})
    if may_be_zero:
        assert getattr(FireConstants(**{**RIGHT, name: 0}), name) == 0


def test_constants_of_other_kinds_of_numbers_become_floats_and_remarks_are_not_compared():
    plain = FireConstants(0.5, 0.25, 0.5, 0.25, 10, 5)
    other = FireConstants(*map(np.float32, (0.5, 0.25, 0.5, 0.25, 10, 5)), remarks=("a remark",))
    assert [type(getattr(other, name)) for name in RIGHT] == [float] * 6
    assert plain == other
    assert plain.remarks == ()


def test_a_fire_at_its_hottest_needs_the_robots_that_are_needed_by_default():
    constants = design_constants()
    assert robots_needed(constants, 7.0) == robots_needed(constants, 7.0, 1.0) == 2 * constants.k1 * 7 / constants.k2


@pytest.mark.parametrize("balance", [0.2, 0.6, 0.9])
def test_the_remarks_state_what_follows_from_the_constants(balance):
    constants = quiet(balance_temperature=balance, largest_area=9, area=4)
    heat, robots, alone = constants.remarks[-3:]
    numbers = [
        float(word) for remark in (heat, robots, alone) for word in re.findall(r"\d+\.\d+|(?<=below )\d+", remark)
    ]
    needed = robots_needed(constants, 9)
    # Of its time a robot fights the balance temperature's share: it cools k4 a step, and warms by 1 at most.
    (product, plain, with_rests, temperature) = (number for number in numbers if number != 1.0)
    assert product == pytest.approx(balance * 9, abs=1e-3)
    assert plain == pytest.approx(needed, abs=0.006)
    assert with_rests == pytest.approx(needed / balance, abs=0.006)
    assert temperature == pytest.approx(max(constants.k2 / (constants.k1 * 9) - 1, 0), abs=0.006)
    if temperature:
        assert robots_needed(constants, 9, temperature) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize(("robots", "suffices"), [(1.0, True), (1.01, False)])
def test_one_robot_suffices_if_with_its_rests_it_counts_as_many_as_are_needed(robots, suffices):
    # The largest fire takes 0.597 robots for each required one, and one counts as the balance temperature, 0.6.
    constants = quiet(robots=robots)
    assert (robots_needed(constants, 16) <= 0.6) is suffices
    found = [remark for remark in constants.remarks if "one robot suffices" in remark]
    assert len(found) == suffices
    if suffices:
        assert f"takes {robots_needed(constants, 16):.2f} robots" in found[0]
        assert "counts as 0.60" in found[0]


@pytest.mark.parametrize(("robots", "too_many"), [(990, False), (1010, True)])
def test_more_than_a_thousand_robots_are_more_than_can_put_a_fire_out(robots, too_many):
    short = quiet(robots=1, extinguish_time=1e9).k2
    constants = quiet(robots=robots * short / (2 * math.log(2) / 2000 * 16), extinguish_time=1e9)
    assert robots_needed(constants, 16) == pytest.approx(robots)
    assert any("cannot put it out" in remark for remark in constants.remarks) is too_many


@pytest.mark.parametrize(("rest", "completely"), [(66.6, False), (66.7, True)])
def test_a_robot_that_would_have_to_cool_below_zero_cools_down_completely(rest, completely):
    # It cools by 1.5 a step from 100.
    remarks = [remark for remark in quiet(rest_time=rest).remarks if "join is 0" in remark]
    assert len(remarks) == completely
    if completely:
        assert "in 67 steps, less than the rest_time of 67" in remarks[0]


def test_a_warning_points_at_the_line_that_asked_for_the_constants():
    with pytest.warns(FireConstantsWarning, match="one robot") as caught:
        design_constants(robots=1, extinguish_time=100)
    assert [warning.filename for warning in caught] == [__file__]


@given(
    areas=st.lists(st.floats(0.5, 50), min_size=1, max_size=9),
    robots=st.floats(1, 100),
    initial=st.floats(0.05, 1),
    larger=st.floats(1, 3),
    hotter=st.floats(0, 1),
)
def test_where_no_fire_shall_fall_to_one_robot_one_cannot_stop_any_growing(areas, robots, initial, larger, hotter):
    c = quiet(areas=areas, robots=robots, initial_temperature=initial, alone=False)
    values = (c.k1, c.k2, 0.0, 0.0, 1.0, 0.0)
    temperature = initial + hotter * (1 - initial)
    for area in (larger * min(areas), *areas):
        assert robots_needed(c, area, temperature) > 1.0
        now = next_temperature(temperature, area, 1, values)
        assert now > temperature or now == 1.0


def test_where_no_fire_shall_fall_to_one_robot_the_smallest_needs_just_more_than_one():
    assert robots_needed(quiet(areas=(16, 1.69), alone=False), 1.69) == pytest.approx(1 / 0.95)


def test_enough_robots_meet_both_requirements_and_too_few_are_remarked_on():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        enough = design_constants(areas=(16, 1.69), robots=17, alone=False)
    assert enough == design_constants(robots=17)
    with pytest.warns(FireConstantsWarning, match="2 robots cannot put out area 16 in 1600 .* at least 17"):
        design_constants(areas=(16, 1.69), alone=False)


def test_areas_are_those_of_the_largest_fire_and_of_the_one_that_is_put_out():
    assert quiet(areas=[4, 9]) == quiet(area=9, largest_area=9)


def test_the_first_remark_names_the_area_that_falls_to_one_robot():
    c = design_constants()
    area = float(re.search(r"below (\d+\.\d+)$", next(r for r in c.remarks if r.startswith("one robot, at")))[1])
    assert robots_needed(c, area) == pytest.approx(1.0, abs=0.001)
    assert steps_until_out(c, 0.99 * area, 1, 1.0) is not None
    assert steps_until_out(c, 1.01 * area, 1, 1.0) is None


@pytest.mark.parametrize("areas", [(), 5, "16", [0.0], [math.nan], [4, None]])
def test_wrong_areas_are_refused_in_one_line(areas):
    with pytest.raises(InvalidValueError, match="areas"):
        design_constants(areas=areas)


def test_alone_is_true_or_false():
    with pytest.raises(InvalidValueError, match="alone"):
        design_constants(alone="no")
