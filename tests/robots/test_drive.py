"""Wheels become motion by exact arcs, and slip is the truth about what was achieved (PHYSICS 2 and 4)."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import HolonomicDrive, RobotDesign, disc, rectangle
from mesa_swarm.control import Subsumption, behaviour
from mesa_swarm.errors import InvalidValueError
from mesa_swarm.physics.motion import advance, sinc
from mesa_swarm.robots.drive import DifferentialDrive, limit_command
from scenes import blind, circle, empty

wheel = st.floats(-1, 1)


def alone(left, right, steps=1, pose=(200, 150, 0.0), design=None, **options):
    """Drive one robot at constant rim speeds (shares of its greatest) and return the model."""
    model = empty(**options)
    model.add_robots(design or blind(), poses=[pose])
    model.control = Subsumption(circle(left=left, right=right))
    return model.run(steps)


def pose_of(model):
    return (*model.swarm.position[0], model.swarm.heading[0])


def test_equal_wheels_drive_straight_along_the_heading():
    x, y, heading = pose_of(alone(0.5, 0.5, 40, (200, 150, 2.0)))
    assert (x, y) == pytest.approx((200 + 20 * math.cos(2), 150 + 20 * math.sin(2)), abs=1e-12)
    assert heading == 2.0


def test_opposite_wheels_turn_on_the_spot_by_the_rim_speed_over_the_radius():
    x, y, heading = pose_of(alone(-0.5, 0.5, 10))
    assert (x, y) == (200, 150)
    assert heading == pytest.approx(10 * 0.5 / 5, abs=1e-12)


@given(left=wheel, right=wheel, heading=st.floats(-3, 3))
def test_one_step_goes_along_the_arc_around_the_instantaneous_centre(left, right, heading):
    x, y, turned = pose_of(alone(left, right, 1, (200, 150, heading)))
    speed, omega = (left + right) / 2, (right - left) / 10
    if abs(omega) > 1e-3:
        centre = speed / omega
        dx = centre * (math.sin(heading + omega) - math.sin(heading))
        dy = -centre * (math.cos(heading + omega) - math.cos(heading))
        assert (x, y) == pytest.approx((200 + dx, 150 + dy), abs=1e-11)
    assert math.hypot(x - 200, y - 150) <= abs(speed) + 1e-12
    assert math.remainder(turned - heading - omega, 2 * math.pi) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("steps", [3, 4, 7, 100, 629])
@pytest.mark.parametrize("side", [1, -1])
def test_a_circle_of_any_number_of_steps_closes(steps, side):
    omega = side * 2 * math.pi / steps
    position, heading = np.array([[0.0, 0.0]]), np.array([0.3])
    farthest = 0.0
    for _ in range(steps):
        advance(position, heading, np.array([[4.0, 0.0, omega]]), 1)
        farthest = max(farthest, np.hypot(*position[0]))
    assert position[0] == pytest.approx((0, 0), abs=1e-9)
    assert math.remainder(heading[0] - 0.3, 2 * math.pi) == pytest.approx(0, abs=1e-9)
    assert farthest > 1.9 * 4.0 / abs(omega) * math.sin(math.pi / 3)


def test_a_robot_that_drives_a_full_circle_is_back_where_it_was():
    # omega = (1 - left) / 10 = 2 pi / 100
    left = 1 - 10 * 2 * math.pi / 100
    half, whole = alone(left, 1.0, 50), alone(left, 1.0, 100)
    radius = (1 + left) / 2 * 100 / (2 * math.pi)
    assert pose_of(half)[:2] == pytest.approx((200, 150 + 2 * radius), abs=1e-9)
    assert pose_of(whole) == pytest.approx((200, 150, 0), abs=1e-9)
    assert whole.total_collisions == 0


@given(left=wheel, right=wheel, parts=st.integers(2, 200))
def test_one_long_step_ends_where_many_short_ones_of_the_same_ratio_do(left, right, parts):
    def drive(steps, share):
        position, heading, motion = np.zeros((1, 2)), np.array([0.7]), np.empty((1, 3))
        DifferentialDrive().motion(share * np.array([[left, right]]), np.array([5.0]), motion)
        for _ in range(steps):
            advance(position, heading, motion, 1)
        return (*position[0], heading[0])

    assert drive(1, 1.0) == pytest.approx(drive(parts, 1.0 / parts), abs=1e-11)


@given(left=wheel, right=wheel, pieces=st.integers(1, 50))
def test_cutting_a_step_into_pieces_changes_nothing(left, right, pieces):
    ends = []
    for rounds in (1, pieces):
        position, heading = np.zeros((1, 2)), np.array([0.7])
        for _ in range(rounds):
            advance(position, heading, np.array([[(left + right) / 2, 0.0, (right - left) / 10]]), rounds)
        ends.append((*position[0], heading[0]))
    assert ends[0] == pytest.approx(ends[1], abs=1e-12)


@given(angle=st.floats(-3, 3))
def test_sinc_is_smooth_where_it_changes_its_formula(angle):
    assert sinc(angle) == pytest.approx(float(np.sinc(angle / math.pi)), abs=1e-15)
    assert sinc(angle * 1e-4) == pytest.approx(float(np.sinc(angle * 1e-4 / math.pi)), abs=1e-15)


@given(left=wheel, right=wheel, radius=st.floats(0.1, 50))
def test_wheels_are_found_again_from_the_motion_that_they_make(left, right, radius):
    motion, wheels = np.empty((1, 3)), np.empty((1, 2))
    DifferentialDrive().motion(np.array([[left, right]]), np.array([radius]), motion)
    DifferentialDrive().wheels(motion, np.array([radius]), wheels)
    assert wheels[0] == pytest.approx((left, right), abs=1e-12)


# ---- limits of commands


@given(st.lists(st.tuples(st.floats(allow_nan=False), st.floats(allow_nan=False)), min_size=1, max_size=5))
def test_commands_are_limited_to_the_greatest_speed_with_their_sign_kept(rows):
    command = np.array(rows)
    asked, limit = command.copy(), np.arange(len(rows)) + 0.5
    assert limit_command(command, limit) == -1
    assert (command == np.clip(asked, -limit[:, None], limit[:, None])).all()


def test_the_first_robot_whose_command_is_nan_is_named():
    assert limit_command(np.array([[0.0, 1.0], [0.0, np.nan], [np.nan, 0.0]]), np.ones(3)) == 1


def test_a_robot_made_slower_drives_slower():
    model = alone(0.0, 0.0, 0)
    next(iter(model.robots)).max_speed = 0.25

    @behaviour
    def racer(me):
        return 9.0, 9.0

    model.control = Subsumption(racer)
    model.run(4)
    assert model.swarm.position[0] == pytest.approx((201, 150), abs=1e-12)


# ---- slip of wheels by chance


def slipping(probability, magnitude, n=1, steps=1, rng=1):
    model = empty(4000, 4000, rng=rng)
    model.add_robots(blind().with_slip(probability=probability, magnitude=magnitude), n)
    model.control = Subsumption(circle(left=1.0, right=1.0))
    start = model.swarm.position.copy()
    return model.run(steps), start


def test_wheels_that_always_slip_roll_at_the_rest_and_say_so():
    model, start = slipping(1.0, 0.25, n=20, steps=4)
    assert (model.swarm.slip == 0.25).all()
    assert np.hypot(*(model.swarm.position - start).T) == pytest.approx(np.full(20, 3.0), abs=1e-9)


def test_wheels_that_slip_wholly_do_not_move_the_robot():
    model, start = slipping(1.0, 1.0, n=5, steps=3)
    assert (model.swarm.position == start).all()
    assert (model.swarm.slip == 1.0).all()


@pytest.mark.parametrize(("probability", "magnitude"), [(0.0, 0.7), (0.7, 0.0)])
def test_wheels_that_never_slip_or_by_nothing_roll_as_commanded(probability, magnitude):
    model, start = slipping(probability, magnitude, n=5, steps=3)
    assert np.hypot(*(model.swarm.position - start).T) == pytest.approx(np.full(5, 3.0), abs=1e-9)
    assert (model.swarm.slip == 0.0).all()


def test_each_wheel_slips_by_its_own_chance_in_each_step():
    model = slipping(0.3, 0.5, n=1500)[0]
    slips = []
    for _ in range(10):
        slips.append(model.swarm.slip.copy())
        model.step()
    slips = np.array(slips) > 0
    sigma = math.sqrt(0.3 * 0.7 / slips.size)
    assert slips.mean() == pytest.approx(0.3, abs=4 * sigma)
    for one, other in ((slips[..., 0], slips[..., 1]), (slips[1:], slips[:-1]), (slips[:, 1:], slips[:, :-1])):
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 4 / math.sqrt(one.size)


def test_slip_of_one_wheel_turns_the_robot():
    model = slipping(0.5, 1.0, n=200)[0]
    left, right = model.swarm.slip.T
    before = slipping(0.5, 1.0, n=200, steps=0)[0].swarm.heading
    turned = np.angle(np.exp(1j * (model.swarm.heading - before)))
    assert turned == pytest.approx((left - right) / 10, abs=1e-12)
    assert {-0.1, 0.0, 0.1} == set(np.round(turned, 6) + 0.0)


# ---- slip of wheels that are held


def at_wall(heading, command=(1.0, 1.0), steps=1, **options):
    """Return a model in which a robot touched the right-hand border (a flat face) before the last steps."""
    pose = (395, 150, heading)
    return alone(*command, steps, pose, **options)


@pytest.mark.parametrize("command", [(1.0, 1.0), (0.3, 0.3)])
def test_wheels_of_a_robot_head_on_against_a_wall_slip_wholly(command):
    model = at_wall(0.0, command)
    assert model.swarm.slip[0] == pytest.approx((1, 1), abs=1e-9)
    assert pose_of(model) == pytest.approx((395, 150, 0), abs=1e-9)


def test_wheels_in_the_open_do_not_slip():
    assert (alone(0.7, -0.2).swarm.slip == 0).all()


@pytest.mark.parametrize("degrees", [5, 20, 29.9, -10, 44.999])
def test_sliding_along_a_wall_the_wheels_slip_by_what_the_wall_takes_of_the_way_ahead(degrees):
    # The robot moves sin(a) along the face, of which sin(a)**2 is along its heading, where wheels roll.
    model = at_wall(math.radians(degrees))
    along = math.sin(math.radians(degrees))
    assert pose_of(model) == pytest.approx((395, 150 + along, math.radians(degrees)), abs=1e-9)
    assert model.swarm.slip[0] == pytest.approx([1 - along**2] * 2, abs=1e-9)


def test_wheels_that_are_not_commanded_do_not_slip_whatever_happens_to_the_robot():
    model = empty()
    model.add_robots(blind(), poses=[(200, 150, 0.0)])
    model.add_robots(blind(), poses=[(191, 150, 0.0)])
    model.swarm.disturbed = False  # leave the overlap to the step itself

    model.control = Subsumption(circle(left=0.0, right=0.0))
    model.step()
    assert model.swarm.collided.all()
    assert (model.swarm.slip == 0).all()


def test_a_robot_that_turns_at_a_wall_does_not_slip():
    model = at_wall(0.0, (-1.0, 1.0))
    assert model.swarm.slip[0] == pytest.approx((0, 0), abs=1e-9)
    assert pose_of(model)[2] == pytest.approx(0.2)


# ---- faces turn who grazes them


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(("from_normal", "turns"), [(0, False), (30, False), (59.9, False), (60.1, True), (85, True)])
def test_only_a_grazing_robot_is_turned_parallel_to_a_flat_face(from_normal, turns, side, reverse):
    heading = side * math.radians(from_normal)
    if reverse:
        heading, speed = heading - side * math.pi, -1.0
    else:
        speed = 1.0
    model = at_wall(heading, (speed, speed))
    turned = model.swarm.heading[0]
    if turns:
        parallel = side * math.pi / 2 * (-1 if reverse else 1)
        assert math.remainder(turned - parallel, 2 * math.pi) == pytest.approx(0, abs=1e-9)
    else:
        assert math.remainder(turned - heading, 2 * math.pi) == pytest.approx(0, abs=1e-12)
    assert model.swarm.position[0, 1] == pytest.approx(150 + side * math.sin(math.radians(from_normal)), abs=1e-9)


@pytest.mark.parametrize(("turn_angle", "turns"), [(0.0, True), (44.0, True), (46.0, False), (90.0, False)])
def test_the_angle_from_which_faces_turn_robots_is_the_one_asked_for(turn_angle, turns):
    model = at_wall(math.radians(45), turn_angle_degrees=turn_angle)
    assert (model.swarm.heading[0] == pytest.approx(math.pi / 2)) == turns


def test_an_obstacle_s_face_turns_like_the_border_s():
    model = empty()
    model.add_obstacle(rectangle((0, 0), (400, 100)))
    model.add_robots(blind(), poses=[(200, 105, -0.2)])
    model.control = Subsumption(circle(left=1.0, right=1.0))
    model.step()
    assert model.swarm.heading[0] == pytest.approx(0, abs=1e-9)
    assert model.swarm.position[0] == pytest.approx((200 + math.cos(0.2), 105), abs=1e-9)


@pytest.mark.parametrize("heading", [-1.5, -1.0, -0.6, -0.1])
def test_a_disc_never_turns_a_robot(heading):
    model = empty()
    model.add_obstacle(disc((200, 100), 30))
    model.add_robots(blind(), poses=[(200, 135, heading)])
    model.control = Subsumption(circle(left=1.0, right=1.0))
    for _ in range(10):
        model.step()
        assert model.swarm.heading[0] == heading
    assert model.total_collisions > 0


def test_a_vertex_never_turns_a_robot():
    model = empty()
    model.add_obstacle(rectangle((0, 0), (200, 100)))
    model.add_robots(blind(), poses=[(203, 103.9, math.pi + 0.3)])
    model.control = Subsumption(circle(left=1.0, right=1.0))
    model.step()
    assert model.swarm.collided[0]
    assert model.swarm.heading[0] == pytest.approx(-math.pi + 0.3, abs=1e-12)


# ---- robots that meet


@pytest.mark.parametrize("gap", [20.0, 21.7, 0.5])
def test_robots_that_meet_head_on_stop_exactly_in_the_middle(gap):
    model = empty()
    model.add_robots(blind(), poses=[(195 - gap / 2, 150, 0.0), (205 + gap / 2, 150, math.pi)])
    model.control = Subsumption(circle(left=1.0, right=1.0))
    model.run(40)
    assert model.swarm.position == pytest.approx(np.array([[195, 150], [205, 150]]), abs=1e-6)
    assert model.swarm.position.mean(axis=0) == pytest.approx((200, 150), abs=1e-12)
    assert model.swarm.slip == pytest.approx(np.ones((2, 2)), abs=1e-6)


def test_reversing_robots_meet_in_the_middle_too():
    model = empty()
    model.add_robots(blind(), poses=[(180, 150, math.pi), (220, 150, 0.0)])
    model.control = Subsumption(circle(left=-1.0, right=-1.0))
    model.run(40)
    assert model.swarm.position == pytest.approx(np.array([[195, 150], [205, 150]]), abs=1e-6)


def test_the_faster_of_two_robots_pushes_the_slower_back_by_half_of_each_overlap():
    model = empty()
    model.add_robots(blind(max_speed=1.0), poses=[(195, 150, 0.0)])
    model.add_robots(blind(max_speed=0.5), poses=[(205, 150, math.pi)])
    model.control = Subsumption(circle(left=1.0, right=1.0))
    model.step()
    # They overlap by 1.5 after the move; each gives way by 0.75.
    assert model.swarm.position[:, 0] == pytest.approx((195.25, 205.25), abs=1e-9)
    assert model.swarm.slip == pytest.approx(np.array([[0.75, 0.75], [1.5, 1.5]]), abs=1e-9)


# ---- bodies that go sideways


GLIDER = RobotDesign(name="glider", drive=HolonomicDrive())


@given(x=st.floats(-1, 1), y=st.floats(-1, 1), heading=st.floats(-3, 3))
def test_a_holonomic_robot_goes_exactly_where_it_is_told_in_its_own_frame_and_does_not_turn(x, y, heading):
    model = alone(x, y, 7, (200, 150, heading), GLIDER)
    cosine, sine = math.cos(heading), math.sin(heading)
    place = 200 + 7 * (cosine * x - sine * y), 150 + 7 * (sine * x + cosine * y)
    assert pose_of(model) == pytest.approx((*place, heading), abs=1e-11)
    assert model.swarm.heading[0] == heading
    assert (model.swarm.slip == 0).all()


def test_each_direction_is_limited_to_the_greatest_speed_so_that_a_diagonal_is_faster():
    design = RobotDesign(max_speed=0.5, drive=HolonomicDrive())
    model = alone(3.0, -4.0, 1, design=design)
    assert pose_of(model) == pytest.approx((200.5, 149.5, 0.0), abs=1e-12)


@given(x=st.floats(-1, 1), y=st.floats(-1, 1), radius=st.floats(0.1, 50))
def test_speeds_are_found_again_from_the_motion_that_they_make(x, y, radius):
    motion, speeds = np.full((1, 3), 9.0), np.empty((1, 2))
    HolonomicDrive().motion(np.array([[x, y]]), np.array([radius]), motion)
    HolonomicDrive().wheels(motion, np.array([radius]), speeds)
    assert motion[0].tolist() == [x, y, 0.0]
    assert speeds[0].tolist() == [x, y]


@pytest.mark.parametrize("command", [(0.6, 0.8), (1.0, -0.3), (0.5, 0.0)])
def test_the_slip_of_a_holonomic_robot_at_a_wall_is_all_of_what_goes_into_it_and_none_of_what_goes_along(command):
    model = alone(*command, 1, (395, 150, 0.0), GLIDER, turn_angle_degrees=90)
    assert pose_of(model) == pytest.approx((395, 150 + command[1], 0.0), abs=1e-9)
    assert model.swarm.slip[0] == pytest.approx((1, 0), abs=1e-9)


@pytest.mark.parametrize("heading", [0.3, -0.7, 0.9])
def test_slip_is_told_in_the_frame_of_a_holonomic_robot(heading):
    # It asks for (1, 0.5) in its own frame; of that the wall leaves what is along it, the direction +y.
    model = alone(1.0, 0.5, 1, (395, 150, heading), GLIDER, turn_angle_degrees=90)
    along = math.sin(heading) + 0.5 * math.cos(heading)
    left = along * math.sin(heading), along * math.cos(heading)
    assert pose_of(model) == pytest.approx((395, 150 + along, heading), abs=1e-9)
    assert model.swarm.slip[0] == pytest.approx((1 - left[0], (0.5 - left[1]) / 0.5), abs=1e-9)


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
    model = alone(1.0, 0.5, 1, design=GLIDER.with_slip(probability=1.0, magnitude=0.25))
    assert pose_of(model) == pytest.approx((200.75, 150.375, 0.0), abs=1e-12)
    assert model.swarm.slip[0] == pytest.approx((0.25, 0.25))


def test_holonomic_drives_are_all_the_same_and_differ_from_wheels():
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


# ---- a drive of one's own


class Bicycle:
    """A car: its speed, and how fast its front wheel, held at an angle, makes it turn for its speed.

    A command is (speed, steering): with steering s the body turns by s / max_speed x speed / wheelbase, so that a
    car that stands does not turn. As speeds and steering are both limited to 1 here, the steering is the tangent
    of the angle of the front wheel, up to 45 degrees (the kinematic bicycle).
    """

    turns = False

    def motion(self, wheels, radius, motion):
        """Write forward speed and turn."""
        motion[:, 0] = wheels[:, 0]
        motion[:, 1] = 0.0
        motion[:, 2] = wheels[:, 0] * wheels[:, 1] / (2.0 * radius)

    def wheels(self, motion, radius, wheels):
        """Write speed and steering; of a car that stands nobody knows how it steers."""
        speed = motion[:, 0]
        wheels[:, 0] = speed
        wheels[:, 1] = np.divide(2.0 * radius * motion[:, 2], speed, out=np.zeros_like(speed), where=speed != 0)


CAR = RobotDesign(name="car", drive=Bicycle())


@given(speed=st.floats(-1, 1), steering=st.floats(-1, 1))
def test_a_drive_of_ones_own_drives_circles_of_the_radius_that_its_steering_gives(speed, steering):
    model = alone(speed, steering, 5, (200, 150, 0.0), CAR)
    turned = 5 * speed * steering / 10
    assert model.swarm.heading[0] == pytest.approx(turned, abs=1e-12)
    chord = 5 * speed * sinc(turned / 2)
    place = 200 + chord * math.cos(turned / 2), 150 + chord * math.sin(turned / 2)
    assert model.swarm.position[0] == pytest.approx(place, abs=1e-11)


def test_a_car_that_stands_cannot_turn():
    assert pose_of(alone(0.0, 1.0, 10, design=CAR)) == (200, 150, 0.0)


def test_a_car_at_a_wall_slips_and_its_steering_does_not():
    model = alone(0.5, 0.0, 3, (395, 150, 0.0), CAR)
    assert model.swarm.slip[0] == pytest.approx((1, 0), abs=1e-9)


def test_both_engines_drive_a_drive_of_ones_own():
    hashes = []
    for engine in ("compiled", "shapely"):
        model = empty(engine=engine)
        model.add_robots(CAR, poses=[(200, 150, 0.0), (230, 150, math.pi)])
        model.control = Subsumption(circle(left=0.8, right=0.3))
        hashes.append(model.run(60).swarm.position.copy())
    assert model.total_collisions > 0
    assert hashes[0] == pytest.approx(hashes[1], abs=1e-9)


@pytest.mark.parametrize("drive", [Bicycle, None, object(), "wheels"])
def test_what_is_no_drive_is_refused(drive):
    with pytest.raises(InvalidValueError, match=r"expected a drive such as DifferentialDrive\(\)"):
        RobotDesign(drive=drive)
