"""Slip is the truth about what was achieved: wheels that slip by chance, and wheels that are held (PHYSICS 4)."""

import math

import numpy as np
import pytest

from mesa_swarm.control import Subsumption
from support.driving import alone, at_wall, pose_of
from support.scenes import blind, circle, empty

# ---- slip of wheels by chance


def slipping(probability, magnitude, n=1, steps=1, rng=1):
    model = empty(4000, 4000, rng=rng)
    model.add_robots(blind().with_slip(probability=probability, magnitude=magnitude), n)
    model.control = Subsumption(circle(left=1.0, right=1.0))
    start = model.swarm.position.copy()
    return model.run(steps), start


def test_wheels_that_always_slip_roll_at_the_rest_which_slip_reports():
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
