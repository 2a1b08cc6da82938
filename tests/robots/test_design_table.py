"""Designs stacked into arrays: every number is the design's, and what a design lacks is padded with nothing."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import (
    AGENT3,
    AGENT9,
    AGENT_FIRE,
    HolonomicDrive,
    LineSensor,
    ProximitySensor,
    RadiationSensor,
    RobotDesign,
)
from mesa_swarm.robots.design import HOLD, MAGNITUDE, PERIOD, PROBABILITY, DesignTable

mounts = st.none() | st.tuples(st.floats(-20, 20), st.floats(-20, 20))
sectors = {
    "bearing_degrees": st.floats(-360, 360),
    "range": st.floats(0, 100),
    "field_of_view_degrees": st.floats(0, 360),
    "mount": mounts,
}
eyes = st.builds(
    ProximitySensor,
    **sectors,
    error_probability=st.floats(0, 1),
    error_magnitude=st.floats(0, 2),
    hold=st.integers(1, 9),
    period=st.integers(1, 9),
    rays=st.integers(0, 9),
)
heats = st.builds(RadiationSensor, **sectors)
lines = st.builds(LineSensor, mount=st.tuples(st.floats(-20, 20), st.floats(-20, 20)))
designs = st.builds(
    RobotDesign,
    radius=st.floats(0.5, 20),
    sensors=st.lists(eyes | heats | lines, max_size=5),
    slip_probability=st.floats(0, 1),
    slip_magnitude=st.floats(0, 1),
)


def sector(sensor, radius):
    """Return mount, axis, cosine and sine of the half angle, range, rays and half angle, by complex numbers."""
    axis = np.exp(1j * math.radians(sensor.bearing_degrees))
    mount = complex(*sensor.mount) if sensor.mount is not None else radius * axis
    half = math.radians(sensor.field_of_view_degrees / 2)
    rays = sensor.rays if isinstance(sensor, ProximitySensor) else 0
    edge = np.exp(1j * half)
    return [mount.real, mount.imag, axis.real, axis.imag, edge.real, edge.imag, sensor.range, rays, half]


@given(st.lists(designs, min_size=1, max_size=4))
def test_every_number_of_every_sensor_is_in_the_row_of_its_design_and_the_rest_is_padding(stacked):
    table = DesignTable.of(stacked)
    for d, design in enumerate(stacked):
        seeing, feeling, below = (len(part) for part in (design.proximity, design.radiation, design.line))
        assert table.counts[d] == seeing
        for s, sensor in enumerate(design.proximity):
            assert table.proximity[d, s] == pytest.approx(sector(sensor, design.radius), abs=1e-12)
            turned = table.bearing[d, s] - math.radians(sensor.bearing_degrees)
            assert math.remainder(turned, 2 * math.pi) == pytest.approx(0, abs=1e-12)
            assert -math.pi <= table.bearing[d, s] <= math.pi
            noise = table.noise[d, s, [PROBABILITY, MAGNITUDE, HOLD, PERIOD]].tolist()
            assert noise == [sensor.error_probability, sensor.error_magnitude, sensor.hold, sensor.period]
        for s, sensor in enumerate(design.radiation):
            assert table.radiation[d, s] == pytest.approx(sector(sensor, design.radius), abs=1e-12)
        assert table.line[d, :below].tolist() == [list(sensor.mount) for sensor in design.line]
        assert (table.proximity[d, seeing:] == -1).all()
        assert (table.radiation[d, feeling:] == -1).all()
        assert (table.noise[d, seeing:] == 0).all()
        assert np.isnan(table.line[d, below:]).all()
        assert table.forward[d].tolist() == [design.front, design.left, design.right]
        assert table.slip[:, d].tolist() == [design.slip_probability, design.slip_magnitude]
        farthest = [math.hypot(*sector(s, design.radius)[:2]) + s.range for s in design.proximity]
        assert table.reach[d] == pytest.approx(max(farthest, default=0.0))


@given(st.lists(designs, min_size=1, max_size=4))
def test_what_no_robot_has_costs_nothing(stacked):
    table = DesignTable.of(stacked)
    sensors = [(sensor, design.radius) for design in stacked for sensor in design.proximity]
    assert table.slips == any(design.slip_probability * design.slip_magnitude > 0 for design in stacked)
    assert table.noisy == any(sensor.error_probability * sensor.error_magnitude > 0 for sensor, _ in sensors)
    assert table.slow == any(sensor.period > 1 for sensor, _ in sensors)
    outside = [sensor.mount is not None and math.hypot(*sensor.mount) > radius for sensor, radius in sensors]
    assert table.exposed == any(outside)


def test_a_table_without_designs_has_no_rows_and_no_columns_of_sensors():
    table = DesignTable.of(())
    assert (table.proximity.shape, table.radiation.shape, table.line.shape) == ((0, 0, 9), (0, 0, 9), (0, 0, 2))
    assert (table.bearing.shape, table.noise.shape, table.forward.shape) == ((0, 0), (0, 0, 4), (0, 3))
    assert (table.slip.shape, table.reach.shape, table.sideways.shape) == ((2, 0), (0,), (0,))
    assert not any((table.slips, table.noisy, table.slow, table.exposed))


def test_a_sensor_on_the_rim_is_not_exposed_and_one_beyond_it_is():
    for mount, exposed in (((0.0, 5.0), False), ((0.0, -5.0001), True), ((4.0, 3.01), True), ((0.0, 0.0), False)):
        assert DesignTable.of([RobotDesign(sensors=[ProximitySensor(mount=mount)])]).exposed == exposed
    assert not DesignTable.of([AGENT3, AGENT9, AGENT_FIRE]).exposed


def test_only_robots_whose_drive_never_turns_go_sideways():
    class Neither(HolonomicDrive):
        turns = None

    class Silent:
        motion = wheels = HolonomicDrive.motion

    drives = [HolonomicDrive(), Neither(), Silent()]
    stacked = [RobotDesign(), *(RobotDesign(drive=drive) for drive in drives)]
    assert [design.turns for design in stacked] == [True, False, None, True]
    assert DesignTable.of(stacked).sideways.tolist() == [False, True, False, False]


@given(st.lists(st.integers(-36, 36).map(lambda k: 10.0 * k), max_size=8))
def test_front_is_most_nearly_ahead_and_left_and_right_are_the_next_forward_ones_on_its_sides(bearings):
    design = RobotDesign(sensors=[ProximitySensor(bearing_degrees=b) for b in bearings])
    turned = [round((b + 180) % 360 - 180) for b in bearings]
    forward = {i: b for i, b in enumerate(turned) if abs(b) <= 90}
    front = min((i for i, b in forward.items() if abs(b) < 90), key=lambda i: (abs(forward[i]), i), default=-1)
    beside = [-1, -1]
    if front >= 0:
        for k, side in enumerate((1, -1)):
            offsets = {i: side * (b - forward[front]) for i, b in forward.items()}
            beside[k] = min((i for i, o in offsets.items() if o > 0), key=lambda i: (offsets[i], i), default=-1)
    assert abs(turned[design.front]) == abs(turned[front]) if front >= 0 else design.front == -1
    if len(set(map(abs, turned))) == len(turned):
        assert [design.front, design.left, design.right] == [front, *beside]


def test_a_sensor_at_a_right_angle_is_beside_the_front_one_and_is_not_a_front_one():
    design = RobotDesign(sensors=[ProximitySensor(bearing_degrees=b) for b in (90, 0, -90)])
    assert [design.front, design.left, design.right] == [1, 0, 2]


def test_a_drive_needs_methods_for_motion_and_for_wheels():
    class Half:
        def motion(self, wheels, radius, motion):
            motion[:] = 0.0

    with pytest.raises(ValueError, match=r"expected a drive such as DifferentialDrive\(\)"):
        RobotDesign(drive=Half())
