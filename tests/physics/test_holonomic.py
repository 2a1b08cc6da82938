"""Bodies that go sideways: where they go, what they slip, and what walls do to them."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import HolonomicDrive, RobotDesign, rectangle
from mesa_swarm.control import Subsumption, VectorSum
from mesa_swarm.physics.arcs import sinc
from mesa_swarm.robots.drive import DifferentialDrive
from mesa_swarm.robots.imperfections import Imperfection, Imperfections
from support.driving import alone, pose_of
from support.scenes import blind, circle, empty

GLIDER = RobotDesign(name="glider", drive=HolonomicDrive())


@pytest.mark.slow
@given(speed=st.floats(0, 1), azimuth=st.floats(-3, 3), heading=st.floats(-3, 3))
def test_a_holonomic_robot_moves_exactly_as_commanded_in_its_own_frame_and_does_not_turn(speed, azimuth, heading):
    x, y = 0.999 * speed * math.cos(azimuth), 0.999 * speed * math.sin(azimuth)
    model = alone(x, y, 7, (200, 150, heading), GLIDER)
    cosine, sine = math.cos(heading), math.sin(heading)
    place = 200 + 7 * (cosine * x - sine * y), 150 + 7 * (sine * x + cosine * y)
    assert pose_of(model) == pytest.approx((*place, heading), abs=1e-11)
    assert model.swarm.heading[0] == heading
    assert (model.swarm.slip == 0).all()


@pytest.mark.parametrize("engine", ["compiled", "shapely"])
@pytest.mark.parametrize("heading", [0.0, 0.4, -math.pi / 4])
def test_no_holonomic_robot_is_faster_than_its_greatest_speed_however_its_body_lies(heading, engine):
    design = RobotDesign(max_speed=0.5, drive=HolonomicDrive())
    model = alone(3.0, -4.0, 1, (200, 150, heading), design, engine=engine)
    azimuth = math.atan2(-4, 3) + heading
    place = 200 + 0.5 * math.cos(azimuth), 150 + 0.5 * math.sin(azimuth)
    assert pose_of(model) == pytest.approx((*place, heading), abs=1e-12)


@pytest.mark.parametrize("arbiter", [Subsumption, VectorSum])
def test_imperfect_holonomic_robots_are_no_faster_either(arbiter):
    model = empty(1000, 1000)
    model.add_robots(GLIDER, 20)
    model.imperfections = Imperfections(driving=Imperfection(error=0.5, outliers=0.3, lag=2.0))
    model.control = arbiter(circle(left=0.7, right=0.7))
    fastest = 0.0
    for _ in range(30):
        before = model.swarm.position.copy()
        model.step()
        free = ~model.swarm.collided
        fastest = max(fastest, np.hypot(*(model.swarm.position - before)[free].T).max())
    assert 0.999 < fastest <= 1 + 1e-12


@given(x=st.floats(-1, 1), y=st.floats(-1, 1), radius=st.floats(0.1, 50))
def test_speeds_are_found_again_from_the_motion_that_they_make(x, y, radius):
    motion, speeds = np.full((1, 3), 9.0), np.empty((1, 2))
    HolonomicDrive().motion(np.array([[x, y]]), np.array([radius]), motion)
    HolonomicDrive().wheels(motion, np.array([radius]), speeds)
    assert motion[0].tolist() == [x, y, 0.0]
    assert speeds[0].tolist() == [x, y]


@pytest.mark.parametrize("command", [(0.6, 0.8), (0.9, -0.3), (0.5, 0.0)])
def test_the_slip_of_a_holonomic_robot_at_a_wall_is_all_of_what_goes_into_it_and_none_of_what_goes_along(command):
    model = alone(*command, 1, (395, 150, 0.0), GLIDER, turn_angle_degrees=90)
    assert pose_of(model) == pytest.approx((395, 150 + command[1], 0.0), abs=1e-9)
    assert model.swarm.slip[0] == pytest.approx((1, 0), abs=1e-9)


@pytest.mark.parametrize("heading", [0.3, -0.7, 0.9])
def test_slip_is_measured_in_the_frame_of_a_holonomic_robot(heading):
    # It asks for (0.8, 0.5) in its own frame; of that the wall leaves what is along it, the direction +y.
    model = alone(0.8, 0.5, 1, (395, 150, heading), GLIDER, turn_angle_degrees=90)
    along = 0.8 * math.sin(heading) + 0.5 * math.cos(heading)
    left = along * math.sin(heading), along * math.cos(heading)
    assert pose_of(model) == pytest.approx((395, 150 + along, heading), abs=1e-9)
    assert model.swarm.slip[0] == pytest.approx(((0.8 - left[0]) / 0.8, (0.5 - left[1]) / 0.5), abs=1e-9)


@pytest.mark.parametrize("degrees", [50, 70, -80])
def test_a_wall_that_a_holonomic_robot_grazes_turns_it_so_that_it_travels_along_the_wall(degrees):
    direction = math.radians(degrees)
    model = alone(math.cos(direction), math.sin(direction), 1, (395, 150, 0.0), GLIDER)
    parallel = math.copysign(math.pi / 2, direction) - direction if abs(degrees) > 60 else 0.0
    assert model.swarm.heading[0] == pytest.approx(parallel, abs=1e-9)
    assert model.swarm.position[0] == pytest.approx((395, 150 + math.sin(direction)), abs=1e-9)


@pytest.mark.parametrize(("x", "y"), [(3, 0), (0, 3), (2, -2)])
def test_a_fast_holonomic_robot_is_stopped_by_a_thin_wall_on_any_side(x, y):
    model = empty()
    for wall in [(215, 100, 215.1, 200), (100, 165, 300, 165.1), (100, 134.9, 300, 135)]:
        model.add_obstacle(rectangle(wall[:2], wall[2:]))
    design = RobotDesign(max_speed=30, drive=HolonomicDrive())
    model.add_robots(design, poses=[(200, 150, 0.0)])
    model.control = Subsumption(circle(left=float(x), right=float(y)))
    model.run(3)
    assert model.swarm.position[0, 0] <= 210 + 1e-6
    assert 140 - 1e-6 <= model.swarm.position[0, 1] <= 160 + 1e-6
    assert model.swarm.collided[0]


def test_wheels_of_a_holonomic_robot_slip_by_chance_too():
    model = alone(0.8, 0.5, 1, design=GLIDER.with_slip(probability=1.0, magnitude=0.25))
    assert pose_of(model) == pytest.approx((200.6, 150.375, 0.0), abs=1e-12)
    assert model.swarm.slip[0] == pytest.approx((0.25, 0.25))


def test_plain_holonomic_drives_are_all_the_same_and_differ_from_wheels():
    assert HolonomicDrive() == HolonomicDrive()
    assert hash(HolonomicDrive()) == hash(HolonomicDrive())
    assert HolonomicDrive() != DifferentialDrive()
    assert DifferentialDrive() == DifferentialDrive()


def test_robots_of_both_drives_in_one_world_go_each_its_own_way():
    model = empty()
    for k, design in enumerate((blind(), GLIDER, blind(), GLIDER)):
        model.add_robots(design, poses=[(100, 50 + 50 * k, 0.5)])
    model.control = Subsumption(circle(left=0.4, right=0.8))
    model.step()
    turned = model.swarm.heading - 0.5
    assert turned == pytest.approx([0.04, 0, 0.04, 0], abs=1e-12)
    ways = model.swarm.position - [(100, 50 + 50 * k) for k in range(4)]
    assert np.hypot(*ways.T) == pytest.approx([0.6 * sinc(0.02), math.hypot(0.4, 0.8)] * 2, abs=1e-12)
