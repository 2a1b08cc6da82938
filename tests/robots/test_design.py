"""Designs: the presets are those of PHYSICS 3, and a wrong value is refused by its name."""

import math
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from mesa_swarm import (
    AGENT3,
    AGENT6,
    AGENT9,
    AGENT_FIRE,
    LineSensor,
    ProximitySensor,
    RadiationSensor,
    RobotDesign,
    bump_sensor,
    laser_sensor,
)
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Subsumption
from mesa_swarm.robots.drive import DifferentialDrive
from mesa_swarm.robots.sensors import mount_of
from support.scenes import ahead, blind, empty

PRESETS = [
    (AGENT3, "AGENT3", {0, 40, -40}, 40),
    (AGENT6, "AGENT6", {0, 60, -60, 120, -120, 180}, 40),
    (AGENT9, "AGENT9", {0, 30, -30, 60, -60, 90, -90, 140, -140}, 30),
    (AGENT_FIRE, "AGENT_FIRE", {0, 30, -30, 60, -60, 90, -90, 140, -140}, 30),
]


@pytest.mark.parametrize(("design", "name", "bearings", "view"), PRESETS, ids=[p[1] for p in PRESETS])
def test_a_preset_is_built_as_documented(design, name, bearings, view):
    assert (design.name, design.radius, design.max_speed) == (name, 5.0, 1.0)
    assert (design.slip_probability, design.slip_magnitude) == (0, 0)
    assert {s.bearing_degrees for s in design.proximity} == bearings
    assert len(design.proximity) == len(bearings)
    for sensor in design.proximity:
        assert (sensor.range, sensor.field_of_view_degrees) == (50, view)
        assert (sensor.error_probability, sensor.error_magnitude) == (0, 0)
        assert (sensor.hold, sensor.period, sensor.rays) == (1, 1, 0)
        assert math.hypot(*mount_of(sensor, 5.0)) == pytest.approx(5.0)


@pytest.mark.parametrize(("design", "name", "bearings", "view"), PRESETS, ids=[p[1] for p in PRESETS])
def test_the_front_left_and_right_sensors_of_a_preset_look_there(design, name, bearings, view):
    looks = [s.bearing_degrees for s in design.proximity]
    beside = min(b for b in bearings if b > 0)
    assert [looks[design.front], looks[design.left], looks[design.right]] == [0, beside, -beside]


def test_only_the_fire_fighter_feels_radiation():
    assert [len(d.radiation) for d in (AGENT3, AGENT6, AGENT9, AGENT_FIRE)] == [0, 0, 0, 1]
    sensor = AGENT_FIRE.radiation[0]
    assert (sensor.bearing_degrees, sensor.range, sensor.field_of_view_degrees) == (0, 80, 60)


def looking(*bearings):
    return RobotDesign(sensors=tuple(ProximitySensor(bearing_degrees=b) for b in bearings))


@pytest.mark.parametrize(
    ("bearings", "front", "left", "right"),
    [
        ((), -1, -1, -1),
        ((180,), -1, -1, -1),
        ((90,), -1, -1, -1),
        ((-89,), 0, -1, -1),
        ((10, -50, 70), 0, 2, 1),
        ((120, 0, -120), 1, -1, -1),
        ((360, 30, -30), 0, 1, 2),
        ((330, 30, 350), 2, 1, 0),
    ],
)
def test_front_left_and_right_are_the_most_forward_sensor_and_its_forward_neighbours(bearings, front, left, right):
    design = looking(*bearings)
    assert (design.front, design.left, design.right) == (front, left, right)


def test_sensors_of_each_kind_stay_in_their_order():
    front, line, heat, back = ProximitySensor(), LineSensor(), RadiationSensor(), ProximitySensor(bearing_degrees=180)
    design = RobotDesign(sensors=[heat, front, line, back])
    assert design.sensors == (heat, front, line, back)
    assert (design.proximity, design.radiation, design.line) == ((front, back), (heat,), (line,))


NOT_NUMBERS = [
    math.nan,
    math.inf,
    -math.inf,
    "5",
    b"5",
    True,
    None,
    [],
    {},
    1j,
    object(),
    np.array([1.0, 2.0]),
    10**400,
]


@pytest.mark.parametrize("value", [*NOT_NUMBERS, 0, -1, 1e7], ids=lambda v: repr(v)[:12])
def test_a_wrong_radius_is_refused_by_name(value):
    with pytest.raises(InvalidValueError, match=r"^radius is .*expected a finite number above 0") as caught:
        RobotDesign(radius=value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200


FIELDS = {
    RobotDesign: {"max_speed": [-1e-9, 5001], "slip_probability": [-0.1, 1.1], "slip_magnitude": [-0.1, 1.1]},
    ProximitySensor: {
        "bearing_degrees": [361, -361],
        "range": [-1, 1e7],
        "field_of_view_degrees": [-1, 361],
        "error_probability": [-0.1, 1.1],
        "error_magnitude": [-0.1, 1e7],
        "hold": [0, -1, 2.5, 10**10],
        "period": [0, -1, 2.5, 10**10],
        "rays": [-1, 2.5, 10_001],
    },
    RadiationSensor: {
        "bearing_degrees": [361, -361],
        "range": [-1, 1e7],
        "field_of_view_degrees": [-1, 361],
    },
}
CASES = [
    (kind, field, value)
    for kind, fields in FIELDS.items()
    for field, values in fields.items()
    for value in [*NOT_NUMBERS, *values]
]


@pytest.mark.parametrize(("kind", "field", "value"), CASES, ids=lambda v: repr(v)[:12])
def test_every_wrong_number_is_refused_by_name_on_one_line(kind, field, value):
    with pytest.raises(InvalidValueError, match=rf"^{field} is ") as caught:
        kind(**{field: value})
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize("kind", [ProximitySensor, RadiationSensor, LineSensor])
@pytest.mark.parametrize(
    "mount", [5, (1,), (1, 2, 3), (1, math.nan), (math.inf, 1), ("1", 2), "ab", (1e7, 0), (True, 0)]
)
def test_a_wrong_mount_is_refused_by_name(kind, mount):
    with pytest.raises(InvalidValueError, match=r"^mount is "):
        kind(mount=mount)


def test_a_line_sensor_must_sit_somewhere():
    with pytest.raises(InvalidValueError, match="mount is None"):
        LineSensor(mount=None)


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("sensors", ("front",), "sensors holds 'front'"),
        ("sensors", (ProximitySensor,), "sensors holds <class"),
        ("sensors", ProximitySensor(), "sensors is ProximitySensor"),
        ("sensors", None, "sensors is None"),
        ("sensors", 5, "sensors is 5"),
        ("sensors", (ProximitySensor(),) * 361, "at most 360"),
        ("drive", "differential", "drive is 'differential'"),
        ("drive", None, "drive is None"),
        ("drive", DifferentialDrive, "drive is <class"),
        ("name", 5, "name is 5"),
        ("name", None, "name is None"),
    ],
)
def test_what_is_not_a_sensor_a_drive_or_a_name_is_refused(field, value, words):
    with pytest.raises(InvalidValueError, match=words) as caught:
        RobotDesign(**{field: value})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", [5, np.float32(5), np.int64(5), np.array(5.0)])
def test_any_real_number_will_do(value):
    model = empty()
    model.add_robots(RobotDesign(radius=value), 1)
    assert next(iter(model.robots)).radius == 5.0


@pytest.mark.parametrize("part", [AGENT9, ProximitySensor(), RadiationSensor(), LineSensor()])
def test_designs_and_sensors_cannot_be_changed(part):
    name = next(iter(part.__dataclass_fields__))
    with pytest.raises(FrozenInstanceError):
        setattr(part, name, getattr(part, name))


def test_equal_designs_are_equal_and_hash_alike_however_their_mounts_were_given():
    mounts = [(5.0, 0.0), [5, 0], np.array([5.0, 0.0])]
    designs = [RobotDesign(sensors=(ProximitySensor(mount=m), LineSensor(mount=m))) for m in mounts]
    assert len(set(designs)) == 1
    model = empty()
    for design in designs:
        model.add_robots(design, 1)
    assert len(model.swarm.designs) == 1


def test_with_proximity_changes_all_proximity_sensors_and_nothing_else():
    changed = AGENT_FIRE.with_proximity(range=16, rays=3)
    assert {(s.range, s.rays) for s in changed.proximity} == {(16, 3)}
    assert [s.bearing_degrees for s in changed.proximity] == [s.bearing_degrees for s in AGENT_FIRE.proximity]
    assert changed.radiation == AGENT_FIRE.radiation
    assert changed.name == "AGENT_FIRE"
    assert AGENT_FIRE.proximity[0].range == 50
    with pytest.raises(InvalidValueError, match="range is -1"):
        AGENT9.with_proximity(range=-1)


def test_with_slip_changes_the_wheels_and_nothing_else():
    changed = AGENT9.with_slip(probability=0.1, magnitude=0.5)
    assert (changed.slip_probability, changed.slip_magnitude) == (0.1, 0.5)
    assert changed.sensors == AGENT9.sensors
    assert AGENT9.slip_probability == 0
    with pytest.raises(InvalidValueError, match="slip_probability is 2"):
        AGENT9.with_slip(probability=2, magnitude=0.5)


def test_a_laser_is_long_and_narrow_and_a_bumper_feels_what_touches():
    laser, bumper = laser_sensor(90), bump_sensor(180)
    assert (laser.bearing_degrees, laser.range, laser.field_of_view_degrees) == (90, 200, 1)
    assert (bumper.bearing_degrees, bumper.range, bumper.field_of_view_degrees) == (180, 0.5, 90)


def test_a_drive_of_ones_own_moves_the_robot_its_way():
    class Crab:
        """Both wheels move the robot to its left."""

        def motion(self, wheels, radius, motion):
            motion[:] = 0.0
            motion[:, 1] = wheels.mean(axis=1)

        def wheels(self, motion, radius, wheels):
            wheels[:] = motion[:, 1:2]

    model = empty()
    model.add_robots(RobotDesign(drive=Crab()), poses=[(200, 150, 0.0), (200, 294.5, 0.0)])
    model.add_robots(blind(), poses=[(100, 150, 0.0)])
    model.control = Subsumption(ahead)
    model.step()
    assert model.swarm.position == pytest.approx(np.array([[200, 151], [200, 295], [101, 150]]), abs=1e-9)
    assert model.swarm.slip == pytest.approx(np.array([[0, 0], [0.5, 0.5], [0, 0]]), abs=1e-9)
