"""Slip that depends on the direction of motion: closed forms, both engines, and that nothing else changes."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, DirectedSlip, HolonomicDrive, RobotDesign, SwarmModel
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import PASS, Avoid, Explore, Subsumption, behaviour
from support.scenes import empty, worst_overlap

SLIP = DirectedSlip(forward=0.1, backward=0.3, sideways=0.4, turn=0.5)


@behaviour
def driven(me, left=1.0, right=1.0):
    """Command these wheels."""
    if left > 9.0:
        return PASS
    return left, right


def one(left, right, slip=SLIP, **more):
    """Return a model of one robot in the open after one step with this command."""
    model = empty()
    model.add_robots(RobotDesign(directed_slip=slip, **more), poses=[(200, 150, 0.0)])
    model.control = Subsumption(driven(left=left, right=right))
    return model.run(1)


class Crowd(SwarmModel):
    """Robots on a floor that holds them back, as a model that can be recorded."""

    def __init__(self, *, n_robots=30, engine="compiled", rng=None):
        super().__init__(map="original", rng=rng, engine=engine)
        self.add_robots(replace(AGENT9, directed_slip=SLIP), n_robots)
        self.add_robots(AGENT3, 5)
        self.control = Subsumption(Avoid(distance=15), Explore())


@pytest.mark.parametrize(
    ("left", "right", "moved", "turned"),
    [(1.0, 1.0, 0.9, 0.0), (-1.0, -1.0, -0.7, 0.0), (-1.0, 1.0, 0.0, 0.1), (0.5, 0.5, 0.45, 0.0)],
)
def test_each_direction_loses_its_share(left, right, moved, turned):
    model = one(left, right)
    assert model.swarm.position[0] == pytest.approx([200 + moved, 150])
    assert model.swarm.heading[0] == pytest.approx(turned)


def test_the_slip_of_the_wheels_is_that_of_the_motion():
    assert one(1.0, 1.0).swarm.slip[0] == pytest.approx([0.1, 0.1])
    assert one(-1.0, 1.0).swarm.slip[0] == pytest.approx([0.5, 0.5])
    # Ahead 0.5 (1 - 0.1), turning 0.1 (1 - 0.5) rad: wheels at 0.45 -+ 0.25.
    assert one(0.0, 1.0).swarm.slip[0] == pytest.approx([0.0, 0.3])


def test_a_body_that_slides_sideways_loses_more_of_that_than_ahead():
    model = one(0.5, 0.5, drive=HolonomicDrive())
    assert model.swarm.position[0] == pytest.approx([200 + 0.45, 150 + 0.3])


@given(st.tuples(*[st.floats(0, 1)] * 4), st.floats(-1, 1), st.floats(-1, 1))
@settings(max_examples=20, deadline=None)
def test_a_robot_moves_as_one_without_slip_that_is_commanded_the_wheels_that_are_left(shares, left, right):
    names = ("forward", "backward", "sideways", "turn")
    slip = DirectedSlip(**dict(zip(names, shares, strict=True)))
    ahead, turn = (left + right) / 2, (right - left) / 2
    ahead *= 1 - (slip.forward if ahead > 0 else slip.backward)
    turn *= 1 - slip.turn
    model, plain = one(left, right, slip), one(ahead - turn, ahead + turn, None)
    assert model.swarm.position == pytest.approx(plain.swarm.position, abs=1e-12)
    assert model.swarm.heading == pytest.approx(plain.swarm.heading, abs=1e-12)


@pytest.mark.slow
def test_both_engines_agree_and_nothing_overlaps():
    models = [Crowd(rng=3, engine=engine).run(40) for engine in ("compiled", "shapely")]
    assert models[0].swarm.position == pytest.approx(models[1].swarm.position, abs=1e-9)
    assert models[0].swarm.slip == pytest.approx(models[1].swarm.slip, abs=1e-9)
    assert worst_overlap(models[0]) <= 1e-6


def test_shares_of_0_move_robots_as_none_does():
    model, plain = one(0.3, 0.8, DirectedSlip()), one(0.3, 0.8, None)
    assert model.swarm.position == pytest.approx(plain.swarm.position, abs=1e-15)


def test_random_slip_and_imperfections_come_on_top():
    model = empty()
    model.add_robots(RobotDesign(directed_slip=SLIP, slip_probability=1.0, slip_magnitude=0.5), poses=[(200, 150, 0.0)])
    model.control = Subsumption(driven())
    assert model.run(1).swarm.position[0, 0] == pytest.approx(200.45)


def test_a_recorded_run_is_verified_and_resumed(tmp_path):
    model = Crowd(rng=2)
    with model.record(tmp_path / "run.arrow", checkpoint_every=10):
        model.run(30)
    assert Crowd.verify(tmp_path / "run.arrow").same
    assert Crowd.resume(tmp_path / "run.arrow", step=15).run(15).state_hash() == model.state_hash()


@pytest.mark.parametrize("name", ["forward", "backward", "sideways", "turn"])
@pytest.mark.parametrize("wrong", [-0.1, 1.1, np.nan, "much"])
def test_wrong_shares_are_refused_in_one_line(name, wrong):
    with pytest.raises(InvalidValueError, match=rf"^slip {name} is "):
        DirectedSlip(**{name: wrong})


def test_anything_else_is_refused_by_the_design():
    with pytest.raises(InvalidValueError, match=r"^directed_slip is 0.1; expected DirectedSlip"):
        RobotDesign(directed_slip=0.1)
