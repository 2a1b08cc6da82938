"""Commands have limits, and a drive may be one's own (PHYSICS 2)."""

import math
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import RobotDesign
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Subsumption, behaviour
from mesa_swarm.physics.arcs import sinc
from mesa_swarm.robots.drive import DifferentialDrive, limit_command
from support.driving import alone, pose_of
from support.scenes import blind, circle, empty

wheel = st.floats(-1, 1)


@given(left=wheel, right=wheel, radius=st.floats(0.1, 50))
def test_wheels_are_found_again_from_the_motion_that_they_make(left, right, radius):
    motion, wheels = np.empty((1, 3)), np.empty((1, 2))
    DifferentialDrive().motion(np.array([[left, right]]), np.array([radius]), motion)
    DifferentialDrive().wheels(motion, np.array([radius]), wheels)
    assert wheels[0] == pytest.approx((left, right), abs=1e-12)


# ---- limits of commands


def on_wheels(n):
    return np.zeros(n, np.int64), np.array([False, True])


def on_rollers(n):
    return np.ones(n, np.int64), np.array([False, True])


@given(st.lists(st.tuples(st.floats(allow_nan=False), st.floats(allow_nan=False)), min_size=1, max_size=5))
def test_commands_are_limited_to_the_greatest_speed_with_the_same_sign(rows):
    command = np.array(rows)
    asked, limit = command.copy(), np.arange(len(rows)) + 0.5
    assert limit_command(command, limit, *on_wheels(len(rows))) == -1
    assert (command == np.clip(asked, -limit[:, None], limit[:, None])).all()


def test_the_first_robot_whose_command_is_nan_is_named():
    for kind in (on_wheels, on_rollers):
        assert limit_command(np.array([[0.0, 1.0], [0.0, np.nan], [np.nan, 0.0]]), np.ones(3), *kind(3)) == 1
        for command in ([np.nan, 0.0], [0.0, np.nan]):
            assert limit_command(np.array([command]), np.ones(1), *kind(1)) == 0


@given(st.lists(st.tuples(st.floats(allow_nan=False), st.floats(allow_nan=False)), min_size=1, max_size=5))
def test_velocities_are_limited_as_a_whole_in_the_same_direction(rows):
    command = np.array(rows)
    asked, limit = command.copy(), np.arange(len(rows)) + 0.5
    assert limit_command(command, limit, *on_rollers(len(rows))) == -1
    for (x, y), (u, v), most in zip(asked, command, limit, strict=True):
        assert math.hypot(u, v) <= most * (1 + 1e-15)
        if math.hypot(x, y) <= most:
            assert (u, v) == (x, y)
        elif np.isfinite((x, y)).all():
            assert math.hypot(u, v) == pytest.approx(most)
            assert math.atan2(v, u) == pytest.approx(math.atan2(y, x))


def test_a_robot_made_slower_drives_slower():
    model = alone(0.0, 0.0, 0)
    next(iter(model.robots)).max_speed = 0.25

    @behaviour
    def racer(me):
        return 9.0, 9.0

    model.control = Subsumption(racer)
    model.run(4)
    assert model.swarm.position[0] == pytest.approx((201, 150), abs=1e-12)


# ---- custom drives


class Bicycle:
    """A car: its speed, and how fast its front wheel, held at an angle, makes it turn for its speed.

    A command is (speed, steering): with steering s the body turns by s / max_speed x speed / wheelbase, so that a
    car that stands does not turn. As speeds and steering are both limited to 1 here, the steering is the tangent
    of the angle of the front wheel, up to 45 degrees (the kinematic bicycle).
    """

    turns = None

    def motion(self, wheels, radius, motion):
        """Write forward speed and turn."""
        motion[:, 0] = wheels[:, 0]
        motion[:, 1] = 0.0
        motion[:, 2] = wheels[:, 0] * wheels[:, 1] / (2.0 * radius)

    def wheels(self, motion, radius, wheels):
        """Write speed and steering; the steering of a standing car is unknown."""
        speed = motion[:, 0]
        wheels[:, 0] = speed
        wheels[:, 1] = np.divide(2.0 * radius * motion[:, 2], speed, out=np.zeros_like(speed), where=speed != 0)


CAR = RobotDesign(name="car", drive=Bicycle())


@pytest.mark.slow
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


class Worn(DifferentialDrive):
    """Wheels of which each has lost a share of its size."""

    def __init__(self, left, right=0.0):
        self.share = 1.0 - np.array([left, right])

    def motion(self, wheels, radius, motion):
        super().motion(wheels * self.share, radius, motion)

    def wheels(self, motion, radius, wheels):
        super().wheels(motion, radius, wheels)
        wheels /= self.share


@pytest.mark.parametrize("engine", ["compiled", "shapely"])
@pytest.mark.parametrize("name", ["blind", "worn"])
@pytest.mark.parametrize("order", list(permutations([0.0, 0.1, 0.4])))
def test_each_robot_has_its_own_drive_however_like_the_others_its_design_is(order, name, engine):
    model = empty(engine=engine)
    for k, lost in enumerate(order):
        design = replace(blind(), name=name, drive=Worn(lost)) if lost else blind()
        model.add_robots(design, poses=[(100, 50 + 80 * k, 0.0)])
    model.control = Subsumption(circle(left=1.0, right=1.0))
    model.run(20)
    assert model.swarm.heading == pytest.approx([20 * lost / 10 for lost in order], abs=1e-12)


def test_drives_are_equal_if_they_are_of_one_class_and_hold_the_same():
    assert Worn(0.1) == Worn(0.1)
    assert hash(Worn(0.1)) == hash(Worn(0.1))
    assert Worn(0.1) != Worn(0.2)
    assert Worn(0.0) != DifferentialDrive()
    assert DifferentialDrive() != Worn(0.0)


@dataclass
class Weak:
    """A custom drive that has no hash."""

    share: float

    def motion(self, wheels, radius, motion):
        DifferentialDrive().motion(self.share * wheels, radius, motion)

    def wheels(self, motion, radius, wheels):
        DifferentialDrive().wheels(motion, radius, wheels)
        wheels /= self.share


def test_a_drive_without_a_hash_drives_beside_others():
    model = empty()
    for k, share in enumerate([0.5, 1.0, 0.25]):
        model.add_robots(RobotDesign(drive=Weak(share)), poses=[(100, 50 + 80 * k, 0.0)])
    model.control = Subsumption(circle(left=1.0, right=1.0))
    model.run(20)
    assert model.swarm.position[:, 0] == pytest.approx([110, 120, 105], abs=1e-12)


@pytest.mark.parametrize("drive", [Bicycle, None, object(), "wheels"])
def test_other_objects_than_drives_are_refused(drive):
    with pytest.raises(InvalidValueError, match=r"expected a drive such as DifferentialDrive\(\)"):
        RobotDesign(drive=drive)
