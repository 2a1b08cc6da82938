"""Gripper: what robots pick up, carry and put down, and that nothing else ever meets it meanwhile."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT9, Carried, Gripper, RobotDesign, SwarmModel, disc, rectangle
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Subsumption, behaviour

DESIGN = RobotDesign(
    name="picker", sensors=(*AGENT9.sensors, Carried()), actuators=(Gripper(reach=3.0, kinds=("puck",)),)
)
OPENED, CLOSED = 0.0, 1.0


@behaviour
def set_grip(me, grip=0.0, speed=0.0):
    me.act.grip = grip
    return speed, speed


def world(poses, grip=CLOSED, speed=0.0, engine="compiled"):
    """Return a model with robots that all set their grippers to the same and drive ahead."""
    model = SwarmModel(rng=1, engine=engine)
    model.add_robots(DESIGN, poses=poses)
    model.control = Subsumption(set_grip(grip=grip, speed=speed))
    return model


def puck(model, x, y, radius=2.0):
    return model.add_body(disc((x, y), radius), kind="puck")


@pytest.mark.parametrize("engine", ["compiled", "shapely"])
def test_a_robot_grips_carries_and_puts_down_a_puck(engine):
    model = world([(100, 100, 0.0)], speed=1.0, engine=engine)
    one = puck(model, 108, 100)
    model.step()
    (robot,) = model.robots
    assert one.carrier is robot is model.robots[0]
    assert model.carried_by(robot) is one
    model.run(10)
    assert (one.position == robot.position).all()
    model.sense()
    assert robot.carried.tolist() == [model.kind_code("puck")]
    assert robot.distance.max() == -1
    model.control = Subsumption(set_grip(grip=OPENED))
    model.step()
    assert one.carrier is None
    assert one.position == pytest.approx(robot.position + np.array([7.0, 0.0]), abs=1e-4)
    model.sense()
    assert robot.carried.tolist() == [-1]
    assert robot.distance[0] == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize(
    ("x", "y", "grips"), [(110, 100, True), (110.1, 100, False), (100, 108, False), (92, 100, False), (105, 105, True)]
)
def test_a_gripper_reaches_what_is_near_and_ahead(x, y, grips):
    model = world([(100, 100, 0.0)])
    one = puck(model, x, y)
    model.step()
    assert (one.carrier is not None) == grips


def test_of_two_pucks_the_nearer_is_gripped_and_of_two_robots_the_nearer_one_gets_it():
    model = world([(100, 100, 0.0), (116.5, 100, math.pi)])
    near, far = puck(model, 108, 101, 1.0), puck(model, 108, 98, 0.9)
    model.step()
    assert {body.carrier.unique_id for body in (near, far)} == {robot.unique_id for robot in model.robots}
    model = world([(100, 100, 0.0), (115.5, 100, math.pi)])
    only = puck(model, 108, 100)
    model.step()
    assert only.carrier is model.robots[1]


def test_other_kinds_and_bodies_of_agents_are_not_gripped():
    model = world([(100, 100, 0.0)])
    model.add_kind("puck")
    door = model.add_body(disc((108, 100), 2), kind="door")
    model.step()
    assert door.carrier is None


def test_where_there_is_no_room_the_puck_is_carried_on():
    model = world([(100, 100, 0.0)])
    one = puck(model, 108, 100)
    model.step()
    model.add_obstacle(rectangle((105.1, 50), (150, 150)))
    (robot,) = model.robots
    assert not model.release(robot)
    assert one.carrier is robot


def test_a_puck_is_put_down_beside_what_is_straight_ahead():
    model = world([(100, 100, 0.0)])
    one = puck(model, 108, 100)
    model.step()
    puck(model, 107, 100)
    assert model.release(model.robots[0])
    assert np.hypot(*(one.position - (107, 100))) >= 4.0
    assert np.hypot(*(one.position - (100, 100))) == pytest.approx(7.0, abs=1e-4)


def test_a_carried_puck_is_neither_seen_nor_met():
    model = world([(100, 100, 0.0), (120, 100, math.pi)], grip=CLOSED)
    one = puck(model, 108, 100, 7.5 / 3)
    model.step()
    model.sense()
    second = model.robots[1]
    assert one.carrier is model.robots[0]
    assert set(second.kind.tolist()) <= {-1, 1}
    assert not model.contacts.robot.size


def test_the_puck_of_a_removed_robot_stays_where_it_was():
    model = world([(100, 100, 0.0), (300, 300, 0.0)])
    one = puck(model, 108, 100)
    model.step()
    model.robots[0].remove()
    model.step()
    assert one.carrier is None
    assert one.position.tolist() == [100, 100]


@pytest.mark.parametrize("engine", ["compiled", "shapely"])
def test_the_puck_of_a_removed_robot_is_free_at_once_and_no_other_robot_reads_that_it_carries_it(engine):
    model = world([(100, 100, 0.0), (100, 130, -math.pi / 2)], grip=OPENED, engine=engine)
    one = puck(model, 300, 300)
    model.attach(model.robots[0], one)
    model.remove_robots([model.robots[0]])
    assert one.carrier is None
    assert not model.movers.carried.any()
    model.sense()
    assert model.robots[0].carried.tolist() == [-1]
    assert model.robots[0].kind[0] == model.kind_code("puck")


def test_a_recording_resumes_after_a_robot_that_carries_something_was_removed(tmp_path):
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, poses=[(100, 100, 0.0), (300, 300, 0.0)])
    model.attach(model.robots[0], puck(model, 108, 100))
    with model.record(tmp_path / "run.arrow"):
        model.run(2)
        model.robots[0].remove()
        model.run(3)
    assert SwarmModel.resume(tmp_path / "run.arrow", step=2).bodies[-1].carrier is None
    assert SwarmModel.resume(tmp_path / "run.arrow", step=4).run(1).state_hash() == model.state_hash()


def test_a_carried_body_cannot_be_moved_or_taken_by_another():
    model = world([(100, 100, 0.0), (300, 300, 0.0)])
    one, other = puck(model, 108, 100), puck(model, 200, 200)
    model.step()
    with pytest.raises(InvalidValueError, match="carries"):
        one.position = (50, 50)
    with pytest.raises(InvalidValueError, match="taken"):
        model.attach(model.robots[1], one)
    with pytest.raises(InvalidValueError, match="taken"):
        model.attach(model.robots[0], other)
    with pytest.raises(InvalidValueError, match="body"):
        model.attach(model.robots[1], model.obstacles[0] if len(model.obstacles) else None)
    assert not model.release(model.robots[1])


@pytest.mark.parametrize(
    "given", [{"reach": 0}, {"reach": math.nan}, {"kinds": "puck"}, {"kinds": ()}, {"kinds": (1,)}]
)
def test_a_wrong_gripper_is_refused(given):
    with pytest.raises(InvalidValueError):
        Gripper(**given)


class Pickers(SwarmModel):
    """Robots that pick up pucks and carry them."""

    def __init__(self, rng=None):
        super().__init__(rng=rng)
        for k in range(12):
            self.add_body(disc((60 + 50 * k, 300), 2), kind="puck")
        self.add_robots(DESIGN, poses=[(52 + 50 * k, 300, 0.0) for k in range(5)])
        self.control = Subsumption(set_grip(grip=CLOSED, speed=1.0))


def test_a_recorded_world_with_carried_pucks_verifies_and_resumes(tmp_path):
    model = Pickers(rng=1)
    recorder = model.record(tmp_path / "run.swarm", checkpoint_every=10)
    model.run(15)
    recorder.close()
    assert model.movers.carried.sum() == 5
    assert Pickers.verify(tmp_path / "run.swarm").same
    again = Pickers.resume(tmp_path / "run.swarm", step=10).run(5)
    assert again.state_hash() == model.state_hash()
    assert [body.carrier.unique_id for body in again.movers.agents if body.carrier] == [
        body.carrier.unique_id for body in model.movers.agents if body.carrier
    ]
