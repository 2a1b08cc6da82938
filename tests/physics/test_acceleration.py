"""Drives of limited acceleration: motors need time, and slip shows what was commanded against what rolled."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, DifferentialDrive, HolonomicDrive, OmniDrive, RobotDesign, SwarmModel
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Cruise, Explore, Subsumption
from mesa_swarm.robots.drive import accelerate
from mesa_swarm.robots.imperfections import Imperfection, Imperfections
from support.scenes import ahead, circle, empty

HEAVY = replace(AGENT9, name="heavy", drive=DifferentialDrive(acceleration=0.125))


def moving(design, layer=ahead, **options):
    """Return a world with one robot that is driven by a layer."""
    model = empty(**options)
    (robot,) = model.add_robots(design, poses=[(100, 150, 0.0)])
    model.control = Subsumption(layer)
    return model, robot


@pytest.mark.parametrize("engine", ["compiled", "shapely"])
def test_speed_grows_by_the_acceleration_each_step_and_the_way_is_that_of_a_ramp(engine):
    model, robot = moving(HEAVY, engine=engine)
    for k in range(1, 8):
        model.step()
        speed = 0.125 * k
        assert model.swarm.columns["drive.speed"].tolist() == [[speed, speed]]
        assert robot.position.tolist() == [100 + 0.125 * k * (k + 1) / 2, 150]
        assert robot.command.tolist() == [1.0, 1.0]
        assert robot.slip.tolist() == [1 - speed, 1 - speed]
    model.run(3)
    assert robot.position.tolist() == [100 + 0.125 * 36 + 2, 150]
    assert robot.slip.tolist() == [0.0, 0.0]


def test_a_robot_that_is_to_stand_rolls_out():
    model, robot = moving(HEAVY)
    model.run(8)
    model.control = Subsumption(ahead(speed=0.0))
    before = robot.position[0]
    model.run(10)
    assert robot.position[0] - before == 0.125 * (7 * 8 / 2)
    assert robot.slip.tolist() == [0.0, 0.0]


def test_a_velocity_changes_as_a_whole_and_wheels_each_alone():
    command, speed = np.array([[3.0, 4.0]]), np.zeros((1, 2))
    accelerate(command, np.array([1.0]), np.zeros(1, np.int64), np.array([True]), speed)
    assert speed == pytest.approx(np.array([[0.6, 0.8]]))
    speed = np.array([[0.0, 3.5]])
    accelerate(command, np.array([1.0]), np.zeros(1, np.int64), np.array([False]), speed)
    assert speed.tolist() == [[1.0, 4.0]]


@given(
    st.lists(st.tuples(*[st.floats(-1, 1)] * 2), min_size=1, max_size=20),
    st.floats(0.01, 3.0),
    st.booleans(),
)
def test_no_step_changes_speed_by_more_and_what_is_in_reach_is_reached_exactly(commands, most, as_whole):
    speed = np.zeros((1, 2))
    for command in np.array(commands):
        before = speed.copy()
        accelerate(command[None], np.array([most]), np.zeros(1, np.int64), np.array([as_whole]), speed)
        change, wanted = (np.abs(x - before) if not as_whole else np.hypot(*(x - before).T) for x in (speed, command))
        assert (change <= most * (1 + 1e-12)).all()
        assert np.abs(speed).max() <= np.sqrt(2)
        if (wanted <= most).all():
            assert speed[0].tolist() == command.tolist()


@pytest.mark.parametrize(("drive", "layer"), [(DifferentialDrive, Explore()), (HolonomicDrive, Cruise())])
def test_an_acceleration_beyond_any_change_is_as_none(drive, layer):
    model, _ = moving(replace(AGENT9, drive=drive()), layer)
    limited, _ = moving(replace(AGENT9, drive=drive(acceleration=2.0)), layer)
    for world in (model, limited):
        world.run(400)
    assert limited.swarm.position.tolist() == model.swarm.position.tolist()
    assert limited.swarm.slip.tolist() == model.swarm.slip.tolist()
    assert "drive.speed" not in model.swarm.columns


def test_ideal_robots_beside_limited_ones_reach_their_speed_at_once():
    model, _ = moving(HEAVY)
    (ideal,) = model.add_robots(AGENT9, poses=[(100, 50, 0.0)])
    model.run(1)
    assert ideal.position.tolist() == [101, 50]
    assert model.swarm.columns["drive.speed"].tolist() == [[0.125, 0.125], [1.0, 1.0]]


def test_the_speed_of_motors_is_state_that_hash_recording_and_resume_know(tmp_path):
    model, _ = moving(HEAVY, Explore(speed=0.9, turn_interval=2))
    with model.record(tmp_path / "run.arrow", checkpoint_every=3):
        model.run(3)
        again = SwarmModel.resume(tmp_path / "run.arrow")
        model.run(3)
    assert again.state_hash() != model.state_hash()
    assert again.run(3).state_hash() == model.state_hash()
    before = model.state_hash()
    model.swarm.columns["drive.speed"][0, 0] += 0.1
    assert model.state_hash() != before


def test_another_control_does_not_stop_the_motors():
    model, _ = moving(HEAVY)
    model.run(4)
    model.control = Subsumption(circle)
    model.imperfections = Imperfections()
    model.imperfections = None
    assert model.swarm.columns["drive.speed"].tolist() == [[0.5, 0.5]]


def test_slip_of_imperfect_robots_is_the_command_against_what_rolled():
    model, robot = moving(HEAVY)
    model.imperfections = Imperfections(driving=Imperfection(error=0.1))
    for _ in range(12):
        before = robot.position[0]
        model.step()
        rolled = robot.command * (1 - robot.slip)
        assert rolled.mean() == pytest.approx(robot.position[0] - before, rel=1e-2)


def test_a_motor_that_drives_at_a_wall_goes_on_turning():
    model = empty()
    (robot,) = model.add_robots(HEAVY, poses=[(395, 150, 0.0)])
    model.control = Subsumption(ahead)
    model.run(9)
    assert model.swarm.columns["drive.speed"].tolist() == [[1.0, 1.0]]
    assert robot.slip == pytest.approx([1.0, 1.0])


@pytest.mark.parametrize("drive", [DifferentialDrive, HolonomicDrive, OmniDrive])
@pytest.mark.parametrize("acceleration", [0, -1.0, float("nan"), float("inf"), "fast"])
def test_an_impossible_acceleration_is_refused(drive, acceleration):
    with pytest.raises(InvalidValueError, match="acceleration is"):
        drive(acceleration=acceleration)


def test_an_impossible_acceleration_of_a_custom_drive_is_refused():
    class Own(DifferentialDrive):
        """A drive that checks nothing."""

        def __init__(self):
            self.acceleration = -1.0

    with pytest.raises(InvalidValueError, match="acceleration of drive is"):
        RobotDesign(drive=Own())


def test_drives_are_equal_if_their_accelerations_are():
    assert DifferentialDrive(acceleration=0.2) == DifferentialDrive(acceleration=0.2) != DifferentialDrive()
