"""What one robot knew in one step, in words and as positions."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, ProximitySensor, RobotDesign, SwarmModel, disc
from mesa_swarm.control import Avoid, Subsumption
from mesa_swarm.control.explain import moment_of
from mesa_swarm.robots.design import DesignTable
from mesa_swarm.robots.reasons import TINY, Moment, Reason


def moment(distance, kind, design=AGENT9, command=(0.0, 0.0), turns=True):
    table = DesignTable.of((design,))
    return Moment(
        np.array(distance, float), np.array(kind), table.proximity[0], table.bearing[0],
        tuple(table.forward[0].tolist()), np.array(command), turns, {},
    )  # fmt: skip


readings = st.lists(st.tuples(st.sampled_from([0.0, 5.0, 9.5, 50.0]), st.integers(-1, 3)), min_size=9, max_size=9)


@given(readings, st.integers(0, 3))
def test_the_sensors_that_see_a_thing_are_listed_from_the_nearest_and_of_equals_the_first(rows, kind):
    now = moment(*zip(*rows, strict=True))
    seen = sorted((distance, s) for s, (distance, what) in enumerate(rows) if what == kind)
    assert now.seeing(kind) == [s for _, s in seen]
    assert now.nearest(kind) == now.seeing(kind)[:1]


@given(readings, st.integers(0, 3))
def test_of_the_sensors_ahead_the_one_that_is_most_nearly_so_counts_among_equals(rows, kind):
    now = moment(*zip(*rows, strict=True))
    aside = [abs(sensor.bearing_degrees) for sensor in AGENT9.proximity]
    seen = sorted((d, aside[s], s) for s, (d, what) in enumerate(rows) if what == kind and aside[s] < 90)
    assert now.seeing(kind, ahead=True) == [s for _, _, s in seen]
    assert now.nearest(kind, ahead=True) == now.seeing(kind, ahead=True)[:1]


def test_a_sensor_at_a_right_angle_does_not_look_ahead_and_one_just_before_it_does():
    design = RobotDesign(sensors=[ProximitySensor(bearing_degrees=b) for b in (90, -90, 89.999, -89.999)])
    now = moment([1.0] * 4, [0] * 4, design)
    assert now.seeing(0, ahead=True) == [2, 3]
    assert now.seeing(0) == [0, 1, 2, 3]


@given(readings, st.lists(st.integers(0, 8), min_size=1, max_size=9, unique=True))
def test_the_position_of_what_sensors_see_is_the_mean_of_where_their_axes_end(rows, sensors):
    now = moment(*zip(*rows, strict=True))
    ends = [
        (5.0 + rows[s][0]) * np.exp(1j * math.radians(AGENT9.proximity[s].bearing_degrees)) for s in sensors
    ]  # from the rim, as far as is read
    assert now.position_of(sensors) == pytest.approx([np.mean(ends).real, np.mean(ends).imag], abs=1e-9)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ((0.0, 0.0), "stays"),
        ((TINY / 4, -TINY / 4), "stays"),
        ((TINY, 0.0), "turns right while moving"),
        ((0.7, 0.7), "goes ahead at 0.7"),
        ((0.7, 0.7 + TINY / 2), "goes ahead at 0.7"),
        ((0.7, 0.7 - TINY / 2), "goes ahead at 0.7"),
        ((-0.25, -0.25), "backs up at 0.25"),
        ((0.5, -0.5), "turns right on the spot"),
        ((-0.5, 0.5), "turns left on the spot"),
        ((-0.5, 0.5 + TINY / 2), "turns left on the spot"),
        ((0.5, 1.0), "turns left while moving"),
        ((1.0, 0.5), "turns right while moving"),
        ((-1.0, -0.5), "turns left while moving"),
        ((0.0, 0.5), "turns left while moving"),
    ],
)
def test_wheel_speeds_are_described_by_how_the_robot_moves(command, words):
    assert moment([], [], RobotDesign(), command).motion == words


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ((0.0, 0.0), "stays"),
        ((0.6, 0.8), "moves at 1 towards +53 degrees"),
        ((0.5, 0.0), "moves at 0.5 towards +0 degrees"),
        ((0.0, -0.25), "moves at 0.25 towards -90 degrees"),
        ((0.5, 0.5), "moves at 0.71 towards +45 degrees"),
    ],
)
def test_velocities_are_described_by_speed_and_bearing(command, words):
    assert moment([], [], RobotDesign(), command, turns=False).motion == words


def test_a_sensor_is_named_by_its_place_or_its_bearing():
    now = moment([0.0] * 9, [0] * 9)
    names = ["front sensor", "left sensor", "right sensor", "sensor at +60 degrees", "sensor at -60 degrees"]
    assert [now.name(s) for s in range(5)] == names
    assert now.name(8) == "sensor at -140 degrees"


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (-1, "front sensor nothing"),
        (0, "front sensor 9.3 (an obstacle)"),
        (1, "front sensor 9.3 (a robot)"),
        (2, "front sensor 9.3 (a fire)"),
        (3, "front sensor 9.3 (a load)"),
        (7, "front sensor 9.3 (another body)"),
    ],
)
def test_a_reading_is_described_with_what_is_seen(kind, words):
    assert moment([9.26] * 9, [kind] * 9).reading(0) == words


def test_a_reading_names_kinds_of_a_model_s_own():
    model = SwarmModel(map="openspace", rng=1)
    (robot,) = model.add_robots(AGENT9, poses=[(300, 300, 0.0)])
    model.add_body(disc((330, 300), 6), kind="amphora")
    model.control = Subsumption(Avoid(distance=40))
    model.watch(last=1)
    model.run(1)
    now = moment_of(model.swarm, model.swarm.columns, robot.row, model.kinds)[0]
    assert now.reading(0).endswith("(an amphora)")


def test_a_reason_names_no_sensors_unless_some_triggered_the_layer():
    assert Reason("it is hot").sensors == ()
