"""Sorting out sensors several at a time never loses a reading: beside the exact functions."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import ProximitySensor, RobotDesign
from mesa_swarm.kernels.bits import lowest_bit
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.physics.sector_tables import LANES, clearance_of, lanes_at_edge, tables_of_sectors
from mesa_swarm.physics.sensing import TOUCH, is_line_within, look_at_segment
from mesa_swarm.robots.design import (
    AXIS_X,
    AXIS_Y,
    COS_HALF,
    HALF,
    MOUNT_X,
    MOUNT_Y,
    RANGE,
    RAYS,
    SIN_HALF,
    DesignTable,
)

RADIUS, SIZE = 5.0, 200.0
BOUNDS = (0.0, 0.0, SIZE, SIZE)
bearings = st.one_of(st.sampled_from([0.0, 45.0, 90.0, 180.0, -90.0]), st.floats(-180, 180))
views = st.one_of(st.sampled_from([0.0, 90.0, 180.0, 360.0]), st.floats(0, 360))
sensors = st.builds(
    lambda bearing, view, far, rays: ProximitySensor(
        bearing_degrees=bearing, field_of_view_degrees=view, range=far, rays=rays
    ),
    bearings,
    views,
    st.floats(1, 60),
    st.sampled_from([0, 0, 1, 3]),
)
designs = st.lists(st.lists(sensors, min_size=1, max_size=11), min_size=1, max_size=2)
coordinates = st.one_of(st.integers(-20, 20).map(float), st.floats(-80, 80))
points = st.tuples(coordinates, coordinates)
shares = st.one_of(st.sampled_from([0.0, 1e-9, 1.0]), st.floats(0, 1))


def table_of(designs):
    """Return the sensors of robots with these sensors."""
    return DesignTable.of([RobotDesign(radius=RADIUS, sensors=tuple(sensors)) for sensors in designs]).proximity


def seen_by(sensor, a, b, limit):
    """Return the distance of an edge that a sensor of the table sees, infinite without any."""
    mount = sensor[[MOUNT_X, MOUNT_Y]]
    view = sensor[[AXIS_X, AXIS_Y, COS_HALF, SIN_HALF, HALF, RAYS]]
    return look_at_segment(*(a - mount), *(b - mount), *view, limit, TOUCH * RADIUS)


def edges_about(sensor, a, b, way):
    """Return an edge as it is, and moved so that it goes through the mount, ends there, or passes a hair beside it."""
    mount, a, b = sensor[[MOUNT_X, MOUNT_Y]], np.array(a), np.array(b)
    for beside in (0.0, 1e-12, 4e-6, 6e-6, 1e-3, -1e-9):
        to_mount = mount - (a + way * (b - a)) + beside
        yield a + to_mount, b + to_mount
    yield a, b


@given(designs, points, points, shares, shares)
def test_no_sensor_is_sorted_out_that_an_edge_would_give_another_reading(designs, a, b, way, near):
    table = table_of(designs)
    clearance = clearance_of(RADIUS, table[..., RANGE].max(axis=1), BOUNDS)
    rows = tables_of_sectors(table, clearance)
    groups = len(rows) // len(table)
    for d, row in enumerate(table):
        limits = np.zeros((1, groups, LANES))
        limits.reshape(-1)[: len(row)] = near * row[:, RANGE]
        for sensor in row[: len(designs[d])]:
            for begin, end in edges_about(sensor, a, b, way):
                kept = [
                    lanes_at_edge(rows, groups * d + g, limits, 0, g, *begin, *end, clearance) for g in range(groups)
                ]
                for s in range(len(row)):
                    is_kept = bool(kept[s // LANES] >> s % LANES & 1)
                    limit = near * row[s, RANGE]
                    if s >= len(designs[d]):
                        assert not is_kept
                    elif not is_kept:
                        assert not seen_by(row[s], begin, end, limit) <= limit


@given(points, points, st.floats(0, 60))
def test_a_line_that_is_not_within_a_distance_is_farther(a, b, far):
    (ax, ay), (bx, by) = a, b
    if not is_line_within(ax, ay, bx, by, far):
        assert abs(ax * by - ay * bx) > far * math.hypot(bx - ax, by - ay)


def test_most_sensors_are_sorted_out_at_a_wall_that_is_far_on_one_side():
    table = table_of([[ProximitySensor(bearing_degrees=40 * k, range=16) for k in range(9)]])
    clearance = clearance_of(RADIUS, table[..., RANGE].max(axis=1), BOUNDS)
    rows, limits = tables_of_sectors(table, clearance), np.full((1, 2, LANES), 16.0)
    kept = [lanes_at_edge(rows, g, limits, 0, g, 15.0, 90.0, 15.0, -90.0, clearance) for g in range(2)]
    assert [s for s in range(9) if kept[s // LANES] >> s % LANES & 1] == [0, 1, 8]


@compiled
def lowest_place(number):
    """Return the place as compiled functions find it."""
    return lowest_bit(number)


@given(st.integers(1, 2**40))
def test_the_lowest_bit_is_that_of_the_largest_power_of_2_that_divides_a_number(number):
    assert 2 ** lowest_place(number) == number & -number
