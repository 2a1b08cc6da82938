"""What a robot at a fire is commanded to do, under each strategy, and the reason that it gives."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT_FIRE
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.control import Subsumption
from mesa_swarm.fire import FightFire, FireConstants
from mesa_swarm.fire.strategy import nearest_seen
from mesa_swarm.world.statics import FIRE, OBSTACLE
from support.scenes import empty

CONSTANTS = FireConstants(k1=1e-9, k2=1e-9, k3=0.1, k4=0.01, leave=50.0, join=5.0)


def decided(gap, temperature=0.0, strategy="B"):
    """Return a model in which a robot at such a gap from a fire has decided once more."""
    model = empty(fire_constants=CONSTANTS)
    model.add_fire((200, 150), radius=20)
    robot = model.add_robots(AGENT_FIRE, poses=[(200 - 20 - AGENT_FIRE.radius - gap, 150, 0.0)])[0]
    model.control = Subsumption(FightFire(strategy=strategy))
    model.step()
    robot.temperature = temperature
    model.step()
    before = robot.position[0]
    model.step()
    return model, robot, robot.position[0] - before


def test_a_robot_goes_to_a_fire_and_stands_there_to_put_it_out():
    model, robot, moved = decided(25)
    assert moved == pytest.approx(robot.max_speed)
    assert (model.swarm.task[0], model.swarm.layer[0], model.swarm.fire[0]) == (-1, 0, -1)
    model, robot, moved = decided(5)
    assert moved == 0.0
    assert (model.swarm.task[0], model.swarm.layer[0], model.swarm.fire[0]) == (0, 0, 0)


@pytest.mark.parametrize(("options", "drives"), [({}, False), ({"limit": 29.9}, False), ({"limit": 30.1}, True)])
@pytest.mark.parametrize("side", [1, -1])
def test_a_fire_seen_farther_from_straight_ahead_than_the_critical_angle_is_turned_to_on_the_spot(
    options, drives, side
):
    model = empty(fire_constants=CONSTANTS)
    model.add_fire((200, 150), radius=20)
    turn = side * math.radians(30)
    robot = model.add_robots(AGENT_FIRE, poses=[(150, 150, turn)])[0]
    limits = {"critical_angle_degrees": options["limit"]} if options else {}
    model.control = Subsumption(FightFire(**limits))
    model.step()
    assert math.dist(robot.position, (150, 150)) == pytest.approx(robot.max_speed if drives else 0.0)
    assert (robot.heading == turn) is drives
    assert abs(robot.heading) <= abs(turn)


def test_too_hot_a_robot_backs_off_and_then_waits_under_b_and_does_nothing_of_the_kind_under_a():
    model, robot, moved = decided(5, temperature=60.0)
    assert moved == pytest.approx(-robot.max_speed)
    assert (model.swarm.task[0], model.swarm.layer[0], model.swarm.fire[0]) == (0, 0, -1)
    model.run(20)
    here = robot.position.copy()
    model.run(5)
    assert robot.position.tolist() == here.tolist()
    assert here[0] == pytest.approx(200 - 20 - robot.radius - 11, abs=1.0)
    assert model.swarm.task[0] == 0
    model, _, moved = decided(5, temperature=60.0, strategy="A")
    assert (moved, model.swarm.layer[0], model.swarm.task[0]) == (0.0, -1, -1)


def test_a_layer_leaves_the_robots_alone_that_see_no_fire():
    model = empty()
    model.add_robots(AGENT_FIRE, 3)
    model.control = Subsumption(FightFire())
    model.step()
    assert model.swarm.layer.tolist() == [-1] * 3


@pytest.mark.parametrize(
    ("gap", "temperature", "words"),
    [(25, 0.0, "it goes to a fire"), (5, 0.0, "it puts out a fire"), (5, 60.0, "too hot, at 61, and backs out of")],
)
def test_a_robot_gives_its_reason(gap, temperature, words):
    model, robot, _ = decided(gap, temperature=temperature)
    model.watch()
    model.step()
    assert words in str(model.explain(robot))


def test_the_nearest_fire_that_is_seen_is_the_first_of_the_nearest():
    kind = np.array([OBSTACLE, FIRE, FIRE, FIRE, FIRE], np.int8)
    assert nearest_seen(np.array([1.0, 9.0, 5.0, 5.0, 7.0]), kind) == 2
    assert nearest_seen(np.array([1.0, 2.0, 5.0, 5.0, 7.0]), kind) == 1
    assert nearest_seen(np.array([1.0]), kind[:1]) == -1


def test_a_strategy_is_a_or_b_and_the_critical_angle_at_most_half_a_turn():
    assert FightFire() == FightFire(strategy="B", critical_angle_degrees=10.0, name="FightFire")
    for degrees in (0, 180):
        assert FightFire(critical_angle_degrees=degrees).critical_angle_degrees == degrees
    for degrees in (-1, 181, math.nan):
        with pytest.raises(InvalidValueError, match="critical_angle_degrees is"):
            FightFire(critical_angle_degrees=degrees)
    with pytest.raises(UnknownNameError, match="unknown strategy 'C'"):
        FightFire(strategy="C")
