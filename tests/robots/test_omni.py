"""Drives declare how many numbers a command has; three omni-wheels go in any direction and turn at once."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, HolonomicDrive, OmniDrive, RobotDesign, omni_speeds
from mesa_swarm.base.errors import BehaviourError, InvalidValueError
from mesa_swarm.control import PASS, Avoid, Explore, Subsumption, VectorSum, behaviour
from support.rules import SEEN
from support.scenes import empty

OMNI = replace(AGENT9, name="omni", drive=OmniDrive())
speeds, radii = st.floats(-2.0, 2.0), st.floats(0.5, 50.0)


@behaviour
def waltz(me, turn=0.05, rests=False):
    """Go ahead and turn at once."""
    if rests:
        return PASS
    return omni_speeds(0.5 * me.max_speed, 0.0, turn, me.radius)


@behaviour
def sideways(me):
    """Return whole and real numbers together."""
    return 1, -2.0, 1


@behaviour
def ahead(me):
    """Command two wheels."""
    return me.max_speed, me.max_speed


class Pedals:
    """A drive of one number, which goes straight on."""

    numbers = 1

    def motion(self, wheels, radius, motion):
        """Go on."""
        motion[:] = 0.0
        motion[:, 0] = wheels[:, 0]

    def wheels(self, motion, radius, wheels):
        """Return the speed ahead."""
        wheels[:, 0] = motion[:, 0]


def only(design=OMNI, heading=0.0):
    """Return an empty world with one robot."""
    model = empty()
    (robot,) = model.add_robots(design, poses=[(200, 150, heading)])
    return model, robot


@given(speeds, speeds, st.floats(-0.5, 0.5), radii)
def test_three_wheels_and_the_motion_that_they_make_are_inverse(forward, aside, turn, radius):
    wheels, motion, again = np.array([omni_speeds(forward, aside, turn, radius)]), np.empty((1, 3)), np.empty((1, 3))
    OmniDrive().motion(wheels, np.array([radius]), motion)
    assert motion[0] == pytest.approx([forward, aside, turn], abs=1e-12)
    OmniDrive().wheels(motion, np.array([radius]), again)
    assert again == pytest.approx(wheels, abs=1e-12)


@given(speeds, speeds, st.floats(-0.5, 0.5), radii, st.sampled_from([60, 180, -60]))
def test_a_wheel_rolls_at_the_speed_of_its_own_point_of_the_rim(forward, aside, turn, radius, azimuth):
    a = math.radians(azimuth)
    point = np.array([forward, aside]) + turn * radius * np.array([-math.sin(a), math.cos(a)])
    along = point @ [-math.sin(a), math.cos(a)]
    assert omni_speeds(forward, aside, turn, radius)[[60, 180, -60].index(azimuth)] == pytest.approx(along, abs=1e-12)


def test_a_robot_that_goes_and_turns_at_once_drives_a_circle():
    model, robot = only()
    model.control = Subsumption(waltz)
    model.run(20)
    curvature = 0.05 / 0.5
    assert robot.heading == pytest.approx(1.0)
    centre = np.array([200, 150 + 1 / curvature])
    assert robot.position == pytest.approx(centre + np.array([math.sin(1.0), -math.cos(1.0)]) / curvature)
    assert robot.slip == pytest.approx([0, 0, 0], abs=1e-12)


@pytest.mark.parametrize("engine", ["compiled", "shapely"])
def test_a_robot_against_a_wall_slips_on_the_wheels_that_would_go_on(engine):
    model = empty(engine=engine)
    (robot,) = model.add_robots(OMNI, poses=[(395, 150, 0.0)])
    model.control = Subsumption(waltz(turn=0.0))
    model.run(1)
    assert robot.position == pytest.approx([395, 150])
    assert robot.slip == pytest.approx([1.0, 0.0, 1.0])


@pytest.mark.slow
def test_each_wheel_is_limited_alone_and_a_sum_of_layers_as_a_whole():
    model, robot = only()
    model.control = Subsumption(sideways)
    model.run(1)
    assert robot.command.tolist() == [1.0, -1.0, 1.0]
    model.control = VectorSum(sideways, weights=[1.5])
    model.run(1)
    assert robot.command == pytest.approx([0.5, -1.0, 0.5])


def test_a_rule_passes_by_the_same_name_whatever_the_drive():
    model, robot = only()
    model.control = Subsumption(waltz(rests=True), sideways)
    model.run(1)
    assert robot.layer == 1


def test_commands_are_as_wide_as_the_widest_drive_and_unused_numbers_are_zero():
    class Scribble:
        """A layer that writes into all numbers."""

        name, numbers = "Scribble", None

        def bind(self, swarm, prefix, rng):
            """Remember nothing."""

        def decide(self, senses, command, layer, index):
            """Write everywhere."""
            command[:], layer[:] = 0.25, index

    model, robot = only(AGENT9)
    assert model.swarm.command.shape == (1, 2)
    model.add_robots(OMNI, poses=[(100, 100, 0.0)])
    model.control = Subsumption(Scribble())
    model.run(2)
    assert model.swarm.command.tolist() == model.swarm.last_command.tolist() == [[0.25, 0.25, 0.0], [0.25] * 3]
    assert model.swarm.slip.shape == (2, 3)
    assert robot.command.tolist() == [0.25, 0.25]
    assert robot.slip.shape == (2,)


def test_a_layer_of_other_numbers_than_the_drive_is_refused_in_one_line():
    model, _ = only()
    with pytest.raises(
        InvalidValueError, match=r"^Avoid commands 2 numbers, but robots of the design omni take 3; .*$"
    ):
        model.control = Subsumption(Avoid(), Explore())
    assert model.control is None
    model, _ = only(AGENT9)
    model.control = Subsumption(Explore())
    with pytest.raises(InvalidValueError, match="Explore commands 2 numbers"):
        model.add_robots(OMNI, 1)


@pytest.mark.parametrize("plain", [False, True], ids=["compiled", "plain"])
def test_a_rule_of_other_numbers_than_a_robots_drive_is_refused_with_the_robot(plain):
    def slow(me):
        SEEN.append("")
        return me.max_speed, me.max_speed

    model, _ = only(AGENT9)
    model.control = Subsumption(behaviour(slow) if plain else ahead)
    (wide,) = model.add_robots(OMNI, poses=[(100, 100, 0.0)])
    with pytest.raises(BehaviourError, match=rf"robot {wide.unique_id} in step 1: .* expected three finite wheel"):
        model.step()


def test_a_drive_of_one_number_uses_the_first():
    @behaviour
    def pedal(me):
        return (0.5 * me.max_speed,)

    model, robot = only(RobotDesign(drive=Pedals()))
    model.control = Subsumption(pedal)
    model.run(4)
    assert robot.position == pytest.approx([202, 150])
    assert robot.command.tolist() == [0.5]
    assert model.swarm.command.tolist() == [[0.5, 0.0]]


@pytest.mark.parametrize("numbers", [0, 13, 2.5, "two", None])
def test_a_drive_of_an_impossible_number_is_refused(numbers):
    drive = Pedals()
    drive.numbers = numbers
    with pytest.raises(InvalidValueError, match="numbers of drive is"):
        RobotDesign(drive=drive)


def test_explanations_describe_where_a_body_goes_and_turns():
    model, robot = only()
    model.control = Subsumption(waltz)
    model.watch()
    model.run(1)
    assert model.explain(robot).does == "moves at 0.5 towards +0 degrees while turning left"
    model.control = Subsumption(sideways)
    model.run(1)
    assert model.explain(robot).does == "moves at 1.3 towards +90 degrees while turning left"


def test_robots_of_several_drives_share_a_world_and_its_recording(tmp_path):
    model, _ = only()
    model.add_robots(replace(AGENT9, name="glider", drive=HolonomicDrive()), poses=[(100, 100, 0.0)])
    model.run(1)
    with model.record(tmp_path / "run.arrow") as recorder:
        model.run(3)
    table = type(model).resume(tmp_path / "run.arrow")
    assert table.state_hash() == model.state_hash()
    assert len(recorder) == 3
