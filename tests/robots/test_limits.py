"""Both ends of each documented range are permitted, the next number beyond is not, and defaults are ideal."""

import math
from dataclasses import fields

import numpy as np
import pytest

from mesa_swarm import LineSensor, ProximitySensor, RadiationSensor, Radio, RobotDesign, bump_sensor, laser_sensor
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.robots.design import all_round
from mesa_swarm.robots.imperfections import Imperfection, Imperfections

BILLION = 10**9
SECTOR = {"bearing_degrees": (-360, 360), "range": (0, 1e6), "field_of_view_degrees": (0, 360)}
RANGES = {
    ProximitySensor: {
        **SECTOR,
        "error_probability": (0, 1),
        "error_magnitude": (0, 1e6),
        "hold": (1, BILLION),
        "period": (1, BILLION),
        "rays": (0, 10_000),
    },
    RadiationSensor: SECTOR,
    RobotDesign: {"max_speed": (0, 5000), "slip_probability": (0, 1), "slip_magnitude": (0, 1), "battery": (0, 1e12)},
    Radio: {"range": (0, 1e6), "loss_probability": (0, 1)},
    Imperfection: {
        "error": (0, 10),
        "dropout": (0, 1),
        "outliers": (0, 1),
        "hold": (1, BILLION),
        "period": (1, BILLION),
        "lag": (0, 1e6),
    },
    Imperfections: {
        "battery": (0, 1e12),
        **dict.fromkeys(("failure", "sensor_failure", "wheel_failure", "slip_probability", "slip_magnitude"), (0, 1)),
    },
    all_round: {"count": (3, 72), "range": (0, 1e6)},
}
WHOLE = {"hold", "period", "rays", "count"}
CASES = [(part, name, *ends) for part, ranges in RANGES.items() for name, ends in ranges.items()]


@pytest.mark.parametrize(("part", "name", "least", "most"), CASES, ids=lambda v: getattr(v, "__name__", str(v)))
def test_both_ends_of_a_range_are_permitted_and_the_next_number_beyond_either_is_not(part, name, least, most):
    below, above = (least - 1, most + 1) if name in WHOLE else np.nextafter([least, most], [-math.inf, math.inf])
    for value in (least, most):
        part(**{name: value})
    for value in (below, above):
        with pytest.raises(InvalidValueError, match=f"^{name} is "):
            part(**{name: value})


def test_the_largest_body_is_permitted_and_its_speed_is_limited_to_a_thousand_radii():
    assert RobotDesign(radius=1e6, max_speed=1e9).radius == 1e6
    assert RobotDesign(radius=0.5, max_speed=500.0).max_speed == 500.0
    for values in ({"radius": np.nextafter(1e6, 2e6)}, {"radius": 0.5, "max_speed": np.nextafter(500.0, 501.0)}):
        with pytest.raises(InvalidValueError, match=f"^{list(values)[-1]} is "):
            RobotDesign(**values)


def test_a_body_smaller_than_any_other_number_is_permitted():
    assert RobotDesign(radius=5e-324, max_speed=0).radius == 5e-324


@pytest.mark.parametrize("kind", [ProximitySensor, RadiationSensor, LineSensor])
@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("side", [-1e6, 1e6])
def test_a_sensor_sits_at_most_a_million_units_from_the_centre_along_each_axis(kind, axis, side):
    mount = [3.0, 4.0]
    mount[axis] = side
    assert kind(mount=mount).mount == tuple(mount)
    mount[axis] = np.nextafter(side, 2 * side)
    with pytest.raises(InvalidValueError, match=r"^mount is "):
        kind(mount=mount)


def test_a_design_has_at_most_360_sensors():
    assert len(RobotDesign(sensors=(LineSensor(),) * 360).sensors) == 360
    with pytest.raises(InvalidValueError, match=r"^sensors has 361 of them; expected at most 360"):
        RobotDesign(sensors=(LineSensor(),) * 361)


def test_losses_and_outliers_may_share_all_probability_and_no_more():
    assert Imperfection(dropout=0.25, outliers=0.75).outliers == 0.75
    with pytest.raises(InvalidValueError, match=r"^dropout \+ outliers is "):
        Imperfection(dropout=0.25, outliers=0.75 + 2**-52)


def test_a_sensor_is_ideal_by_default_and_looks_straight_ahead_from_the_rim():
    near, heat = ProximitySensor(), RadiationSensor()
    assert (near.bearing_degrees, near.range, near.field_of_view_degrees, near.mount) == (0, 50, 40, None)
    assert (near.error_probability, near.error_magnitude, near.hold, near.period, near.rays) == (0, 0, 1, 1, 0)
    assert (heat.bearing_degrees, heat.range, heat.field_of_view_degrees, heat.mount) == (0, 80, 60, None)
    assert LineSensor().mount == (0, 0)


def test_lasers_and_bumpers_look_straight_ahead_unless_another_bearing_and_size_are_given():
    assert laser_sensor() == ProximitySensor(range=200, field_of_view_degrees=1)
    assert laser_sensor(20, 90) == ProximitySensor(bearing_degrees=20, range=90, field_of_view_degrees=1)
    assert bump_sensor() == ProximitySensor(range=0.5, field_of_view_degrees=90)
    assert bump_sensor(20, 45) == ProximitySensor(bearing_degrees=20, range=0.5, field_of_view_degrees=45)


def test_a_design_is_a_blind_robot_without_slip_by_default():
    design = RobotDesign()
    assert (design.name, design.radius, design.max_speed, design.sensors) == ("robot", 5, 1, ())
    assert (design.slip_probability, design.slip_magnitude, design.turns) == (0, 0, True)


def test_a_design_with_sensors_all_round_divides_the_circle_from_straight_ahead():
    design = all_round()
    assert (design.name, len(design.sensors)) == ("all-round", 12)
    assert [sensor.bearing_degrees for sensor in design.sensors] == [30.0 * k for k in range(12)]
    assert {(sensor.range, sensor.field_of_view_degrees) for sensor in design.sensors} == {(50.0, 30.0)}
    assert all_round(5, name="five", radius=2.0).radius == 2.0
    assert all_round(5, name="five").name == "five"


# ---- radio


def test_a_radio_sends_state_and_goal_a_hundred_units_far_through_everything_by_default():
    radio = Radio()
    assert (radio.range, radio.loss_probability, radio.beacons) == (100.0, 0.0, ())
    assert (radio.state, radio.goal, radio.occlusion) == (True, True, False)


@pytest.mark.parametrize("name", ["state", "goal", "occlusion"])
@pytest.mark.parametrize("value", [None, 0, 1, "yes", [True]])
def test_what_a_radio_does_is_true_or_false_and_nothing_else(name, value):
    with pytest.raises(InvalidValueError, match=f"^{name} is .*; expected True or False$"):
        Radio(**{name: value})


def test_a_radio_broadcasts_state_or_goal_or_both():
    assert not Radio(state=False).state
    assert not Radio(goal=False).goal
    with pytest.raises(InvalidValueError, match=r"^Radio broadcasts neither state nor goal"):
        Radio(state=False, goal=False)


def test_beacons_are_points_and_need_goals():
    assert Radio(beacons=[(1, 2), np.array([3.5, -4.0])], state=False).beacons == ((1.0, 2.0), (3.5, -4.0))
    with pytest.raises(InvalidValueError, match=r"^beacons broadcast goals, but goal is False"):
        Radio(beacons=[(1, 2)], goal=False)
    for wrong in (5, None, [1, 2], [(1, 2, 3)], "ab"):
        with pytest.raises(InvalidValueError, match=r"^beacons is "):
            Radio(beacons=wrong)
    for axis, point in (("x", (math.nan, 0)), ("y", (0, math.inf))):
        with pytest.raises(InvalidValueError, match=f"^beacon's {axis} is "):
            Radio(beacons=[(0, 0), point])


def test_a_radio_has_at_most_ten_thousand_beacons():
    assert len(Radio(beacons=[(0, 0)] * 10_000).beacons) == 10_000
    with pytest.raises(InvalidValueError, match=r"^beacons has 10001 of them; expected at most 10000"):
        Radio(beacons=[(0, 0)] * 10_001)


def test_an_imperfection_is_none_at_all_by_default():
    assert [getattr(Imperfection(), field.name) for field in fields(Imperfection)] == [0, 0, 0, 1, 1, 0]
    ideal = Imperfections()
    assert (ideal.sensing, ideal.driving, ideal.battery, ideal.failure) == (Imperfection(), Imperfection(), 0, 0)
