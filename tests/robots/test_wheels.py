"""Wheels, slip and limits of commands, one robot at a time."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from mesa_swarm import DifferentialDrive, HolonomicDrive
from mesa_swarm.robots.drive import alike, limit_command, limit_length, slip_wheels, turn_towards

speeds = st.floats(-5, 5)
pairs = st.lists(st.tuples(speeds, speeds), min_size=1, max_size=5)
extended = st.floats(allow_nan=False)


@given(pairs, st.floats(0.1, 50))
def test_the_motion_of_wheels_is_the_one_that_both_rims_agree_on(rows, radius):
    """A rim at distance r from the centre moves at v -+ omega r."""
    wheels, motion = np.array(rows), np.full((len(rows), 3), math.nan)
    radii = radius + np.arange(len(rows))
    DifferentialDrive().motion(wheels, radii, motion)
    assert motion[:, 0] - motion[:, 2] * radii == pytest.approx(wheels[:, 0], abs=1e-12)
    assert motion[:, 0] + motion[:, 2] * radii == pytest.approx(wheels[:, 1], abs=1e-12)
    assert (motion[:, 1] == 0).all()


@given(pairs)
def test_rollers_move_as_commanded_and_find_the_command_again(rows):
    wheels, motion = np.array(rows), np.full((len(rows), 3), math.nan)
    found = np.full_like(wheels, math.nan)
    HolonomicDrive().motion(wheels, np.ones(len(rows)), motion)
    HolonomicDrive().wheels(motion, np.ones(len(rows)), found)
    assert (motion[:, :2] == wheels).all()
    assert (motion[:, 2] == 0).all()
    assert (found == wheels).all()


@given(st.integers(0, 2**32 - 1))
def test_each_wheel_whose_draw_is_below_the_probability_of_its_design_slips_by_the_magnitude_of_its_design(seed):
    rng = np.random.default_rng(seed)
    command, draws = rng.uniform(-1, 1, (6, 2)), rng.choice([0.0, 0.2, 0.5, 0.9], (6, 2))
    probability, magnitude = np.array([0.0, 0.2, 1.0]), np.array([0.5, 0.25, 0.75])
    design, wheels = rng.integers(3, size=6), np.empty((6, 2))
    slip_wheels(command, probability, magnitude, design, draws, wheels)
    slips = draws < probability[design][:, None]
    assert wheels == pytest.approx(np.where(slips, command * (1 - magnitude[design][:, None]), command))


@pytest.mark.parametrize("sideways", [False, True])
@pytest.mark.parametrize("number", [0, 1])
def test_a_command_with_one_number_missing_is_named_and_those_before_it_are_limited(number, sideways):
    command = np.array([[0.0, 3.0], [0.5, 0.5], [0.0, 3.0]])
    command[1, number] = math.nan
    bad = limit_command(command, np.full(3, 2.0), np.zeros(3, np.int64), np.array([sideways]))
    assert bad == 1
    assert command[[0, 2]].tolist() == [[0.0, 2.0], [0.0, 3.0]]


def test_a_command_at_the_limit_is_left_as_it_is():
    command = np.array([[2.0, -2.0], [np.nextafter(2.0, 3.0), np.nextafter(-2.0, -3.0)], [-math.inf, math.inf]])
    assert limit_command(command, np.full(3, 2.0), np.zeros(3, np.int64), np.array([False])) == -1
    assert command.tolist() == [[2.0, -2.0], [2.0, -2.0], [-2.0, 2.0]]


@pytest.mark.slow
@given(extended, extended, st.floats(0.01, 1e6))
@example(-math.inf, -0.0, 1.0)  # its azimuth may be pi or -pi
def test_a_vector_is_shortened_in_its_direction_and_never_lengthened(x, y, most):
    u, v = limit_length(x, y, most)
    if math.hypot(x, y) <= most:
        assert (u, v) == (x, y)
        return
    assert math.hypot(u, v) == pytest.approx(most)
    # Infinities are equally large, and all else is nothing beside them.
    infinite = math.inf in (abs(x), abs(y))
    x, y = (math.copysign(math.isinf(c), c) for c in (x, y)) if infinite else (x, y)
    assert math.remainder(math.atan2(v, u) - math.atan2(y, x), math.tau) == pytest.approx(0, abs=1e-12)


@given(st.floats(-math.pi, math.pi), st.floats(0, 10), st.floats(0.1, 10))
def test_a_robot_turns_on_the_spot_by_the_bearing_or_as_fast_as_it_can(bearing, speed, radius):
    left, right = turn_towards(bearing, speed, radius)
    assert left == -right
    assert right / radius == pytest.approx(math.copysign(min(abs(bearing), speed / radius), bearing), abs=1e-12)


def test_asking_whether_drives_are_alike_is_comparing_them_and_is_deprecated():
    with pytest.warns(DeprecationWarning, match=r"alike\(one, other\) is one == other now") as caught:
        assert alike(DifferentialDrive(), DifferentialDrive())
    assert caught[0].filename == __file__
    with pytest.warns(DeprecationWarning, match="alike"):
        assert not alike(DifferentialDrive(), HolonomicDrive())


class Geared(DifferentialDrive):
    def __init__(self, **ratios):
        self.__dict__.update(ratios)


def test_drives_with_other_values_or_values_of_other_names_differ():
    assert Geared(a=1, b=np.ones(2)) == Geared(b=np.ones(2), a=1)
    assert Geared(a=1) != Geared(b=1)
    assert Geared(a=1) != Geared(a=1, b=1)
    assert Geared(a=1, b=2) != Geared(a=1, b=3)
    assert Geared() != Geared(a=1)
    assert hash(Geared(a=1)) == hash(Geared(a=2))
