"""The dial between ideal robots and imperfect ones, and the presets at its end."""

from dataclasses import asdict, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.robots.imperfections import (
    MEASURED,
    PRESETS,
    ROBOTARIUM,
    ROBOTARIUM_ROBOT,
    Imperfection,
    Imperfections,
    is_ideal,
)

steps = st.integers(1, 1000)
imperfections = st.builds(
    Imperfection,
    error=st.floats(0, 10),
    dropout=st.floats(0, 0.5),
    outliers=st.floats(0, 0.5),
    hold=steps,
    period=steps,
    lag=st.floats(0, 100),
)


@given(imperfections, st.floats(0, 1))
def test_the_dial_goes_in_a_straight_line_from_ideal_to_all(one, dial):
    assert one.at(0) == Imperfection()
    assert one.at(1) == one
    ideal, all_of_it = asdict(Imperfection()), asdict(one)
    for name, value in asdict(one.at(dial)).items():
        tolerance = 0.5 + 1e-9 if name in {"hold", "period"} else 1e-12
        assert value == pytest.approx(ideal[name] + dial * (all_of_it[name] - ideal[name]), abs=tolerance), name


@given(imperfections)
def test_compiled_functions_take_the_values_in_the_order_of_the_fields(one):
    assert one.limits == tuple(asdict(one).values())
    assert [type(value) for value in one.limits] == [float, float, float, int, int, float]


@given(imperfections)
def test_an_imperfection_is_ideal_where_it_changes_no_value(one):
    assert is_ideal(one) == (one.limits[:3] == (0, 0, 0) and one.limits[4:] == (1, 0))


@pytest.mark.parametrize("name", ["error", "dropout", "outliers", "period", "lag"])
def test_each_value_alone_makes_robots_imperfect_but_hold(name):
    assert not is_ideal(Imperfection(**{name: 2 if name == "period" else 0.25}))
    assert is_ideal(Imperfection(hold=2))


@given(imperfections, st.floats(0, 1e6), st.floats(0, 1), st.floats(1e-3, 1))
def test_a_dial_turned_down_makes_charges_last_longer_and_failures_rarer(driving, battery, failure, dial):
    whole = Imperfections(sensing=replace(driving, lag=0.0), driving=driving, battery=battery, failure=failure)
    found = whole.at(dial) or Imperfections()
    assert found.sensing == whole.sensing.at(dial)
    assert found.driving == whole.driving.at(dial)
    assert found.battery * dial == pytest.approx(battery)
    assert found.failure == pytest.approx(dial * failure)


def test_ideal_robots_cost_nothing_at_any_place_of_the_dial():
    assert Imperfections().at(0.5) is None
    assert Imperfections().at(1) is None
    assert Imperfections(failure=0.5).at(0) is None
    assert Imperfections(failure=0.5).at(1) == Imperfections(failure=0.5)


@pytest.mark.parametrize("dial", [-1e-9, 1 + 1e-9])
def test_the_dial_ends_at_0_and_1(dial):
    with pytest.raises(InvalidValueError, match=r"^dial is "):
        MEASURED.at(dial)


@pytest.mark.parametrize("name", ["sensing", "driving"])
@pytest.mark.parametrize("value", [0.5, None, {"error": 0.1}, Imperfection])
def test_sensing_and_driving_are_imperfections(name, value):
    with pytest.raises(InvalidValueError, match=rf"^{name} is .*; expected Imperfection\(\.\.\.\)$"):
        Imperfections(**{name: value})


def test_only_readings_may_not_lag():
    assert Imperfections(driving=Imperfection(lag=2.0)).driving.lag == 2.0
    with pytest.raises(InvalidValueError, match=r"^lag of sensing is 2.0; expected 0"):
        Imperfections(sensing=Imperfection(lag=2.0))


def test_the_presets_have_the_errors_that_the_documentation_names():
    for preset in (ROBOTARIUM, MEASURED):
        assert (preset.sensing.error, preset.sensing.dropout, preset.sensing.outliers) == (0.03, 0.035, 0.014)
    assert Imperfections(sensing=ROBOTARIUM.sensing) == ROBOTARIUM
    assert (ROBOTARIUM.sensing.hold, ROBOTARIUM.sensing.period) == (1, 1)
    assert (MEASURED.sensing.hold, MEASURED.sensing.period) == (2, 2)
    assert MEASURED.driving == Imperfection(error=0.05, dropout=0.02, lag=2.0)
    assert (MEASURED.battery, MEASURED.failure) == (20_000, 1e-5)
    assert PRESETS == {"measured": MEASURED, "robotarium": ROBOTARIUM}


def test_the_robot_of_the_robotarium_has_seven_sensors_of_which_left_and_right_are_mirror_images():
    bearings = [sensor.bearing_degrees for sensor in ROBOTARIUM_ROBOT.sensors]
    assert sorted(bearings) == sorted(-bearing for bearing in bearings)
    assert [abs(bearing) for bearing in bearings] == [0, 35, 35, 75, 75, 140, 140]
    assert {sensor.field_of_view_degrees for sensor in ROBOTARIUM_ROBOT.sensors} == {25}
    assert [ROBOTARIUM_ROBOT.front, ROBOTARIUM_ROBOT.left, ROBOTARIUM_ROBOT.right] == [0, 1, 2]
