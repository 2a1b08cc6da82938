"""Push: from behind the load, as seen from the goal, or from anywhere; else round the load."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import ProximitySensor, Radio, RobotDesign, all_round, disc
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.control import Explore, Push, Subsumption
from mesa_swarm.control.push import MOST_CORRECTION, way_round
from support.scenes import empty

EYES = all_round(36, range=150)
LOAD, GOAL = (200.0, 150.0), (380.0, 150.0)


def decision(place, heading, *, goal=GOAL, load=LOAD, tendency="left", **options):
    """Return the command and the winning layer of one robot about a load that belongs at the goal."""
    model = empty(communication=Radio(range=2000, state=False, occlusion=True, beacons=[] if goal is None else [goal]))
    if load is not None:
        model.add_load(disc(load, 25), resistance=100)
    model.add_robots(EYES, poses=[(*place, heading)], tendency=tendency)
    model.control = Subsumption(Push(**options), Explore(speed=0.5))
    model.step()
    return model.swarm.command[0].tolist(), int(model.swarm.layer[0])


def test_a_robot_that_sees_no_load_is_left_to_the_layers_below():
    assert decision((100, 150), 0.0, load=None) == ([0.5, 0.5], 1)


def test_behind_the_load_a_robot_drives_at_it():
    assert decision((100, 150), 0.0) == ([1.0, 1.0], 0)


@pytest.mark.parametrize(("heading", "command"), [(-1.0, [-1, 1]), (1.0, [1, -1]), (-2.5, [-1, 1]), (2.5, [1, -1])])
def test_behind_the_load_a_robot_turns_to_it_on_the_spot_the_short_way(heading, command):
    assert decision((100, 150), heading) == (command, 0)


@pytest.mark.parametrize("tendency", ["left", "right"])
def test_a_robot_that_hears_the_goal_goes_round_with_the_load_on_the_side_of_its_tendency(tendency):
    side = 1 if tendency == "left" else -1
    # In front of the load, 20 from its face: it goes along the face when the load is just beside it.
    assert decision((250, 150), side * math.pi / 2, tendency=tendency) == ([1.0, 1.0], 0)
    assert decision((250, 150), -side * math.pi / 2, tendency=tendency)[0] in ([1.0, -1.0], [-1.0, 1.0])


def test_from_anywhere_a_robot_pushes_though_it_hears_the_goal():
    assert decision((300, 150), math.pi, side="anywhere") == ([1.0, 1.0], 0)
    assert decision((300, 150), math.pi)[0] != [1.0, 1.0]


def test_without_a_beacon_all_push():
    assert decision((300, 150), math.pi, goal=None) == ([1.0, 1.0], 0)


def test_what_is_just_within_the_critical_angle_is_driven_at():
    assert decision((100, 150), 0.35, critical_angle_degrees=21)[0] == [1.0, 1.0]
    assert decision((100, 150), 0.35, critical_angle_degrees=19)[0] == [1.0, -1.0]


def test_of_two_loads_the_nearer_is_pushed():
    model = empty()
    model.add_load(disc((100, 150), 25), resistance=100)
    model.add_load(disc((230, 150), 25), resistance=100)
    model.add_robots(EYES, poses=[(170, 150, 0.0), (160, 80, 0.0)])
    model.control = Subsumption(Push())
    model.step()
    assert model.swarm.command[0].tolist() == [1.0, 1.0]


def test_a_layer_above_drives_its_robots():
    model = empty()
    model.add_load(disc(LOAD, 25), resistance=100)
    model.add_robots(EYES, poses=[(100, 150, 0.0)])
    model.control = Subsumption(Explore(speed=0.25), Push())
    model.step()
    assert (model.swarm.command.tolist(), model.swarm.layer.tolist()) == ([[0.25, 0.25]], [0])


@given(
    bearing=st.floats(-math.pi, math.pi),
    reading=st.floats(0, 300),
    clearance=st.floats(0, 100),
    side=st.sampled_from([1, -1]),
)
def test_the_way_round_is_across_the_bearing_and_corrects_the_distance(bearing, reading, clearance, side):
    way = way_round(bearing, reading, clearance, side)
    off = math.remainder(way - (bearing - side * math.pi / 2), 2 * math.pi)
    assert -math.pi <= way <= math.pi
    assert abs(off) <= MOST_CORRECTION + 1e-12
    # Too far off turns it towards the load, too near away from it.
    assert off * side == pytest.approx(np.clip((reading - clearance) / max(clearance, 1), -0.6, 0.6), abs=1e-9)


@given(bearing=st.floats(-3.1, 3.1), reading=st.floats(0, 300), clearance=st.floats(0, 100))
def test_the_way_round_on_the_left_is_the_mirror_image_of_that_on_the_right(bearing, reading, clearance):
    apart = way_round(-bearing, reading, clearance, -1.0) + way_round(bearing, reading, clearance, 1.0)
    assert math.remainder(apart, 2 * math.pi) == pytest.approx(0, abs=1e-9)


def test_a_robot_that_goes_round_holds_its_clearance_and_comes_behind_the_load():
    model = empty(communication=Radio(range=2000, state=False, occlusion=True, beacons=[GOAL]))
    model.add_load(disc(LOAD, 25), resistance=100)
    model.add_robots(EYES, poses=[(250, 150, math.pi / 2)], tendency="left")
    model.control = Subsumption(Push(clearance=20), Explore())
    gaps = []
    for _ in range(400):
        model.step()
        if np.isnan(model.swarm.heard_goal[0, 0]):
            break
        gaps.append(math.dist(model.swarm.position[0], LOAD) - 30)
    assert len(gaps) < 400
    assert min(gaps) > 12
    assert max(gaps) < 28
    assert model.swarm.position[0, 0] < LOAD[0]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"clearance": -1}, "clearance is -1"),
        ({"clearance": math.nan}, "clearance is nan"),
        ({"critical_angle_degrees": 181}, "Push's critical_angle_degrees is 181"),
    ],
)
def test_a_wrong_parameter_is_refused(options, words):
    with pytest.raises(InvalidValueError, match=words):
        Push(**options)


def test_an_unknown_side_suggests_the_nearest():
    with pytest.raises(UnknownNameError, match="did you mean 'behind'"):
        Push(side="behnd")


def test_a_sensor_may_be_given_by_any_bearing_that_means_its_direction():
    commands = []
    for bearing in (-60, 300):
        eye = ProximitySensor(bearing_degrees=bearing, range=150, field_of_view_degrees=20)
        model = empty()
        model.add_load(disc(LOAD, 25), resistance=100)
        model.add_robots(RobotDesign(sensors=(eye,)), poses=[(100, 150, math.radians(60))])
        model.control = Subsumption(Push())
        model.step()
        commands.append(model.swarm.command[0].tolist())
    assert commands == [[1.0, -1.0]] * 2
