"""Rules of one's own: compiled where they can be, plain with a warning where not, never wrong in silence."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT9, RobotDesign, disc
from mesa_swarm.control import PASS, Explore, Subsumption, behaviour
from mesa_swarm.errors import (
    BehaviourError,
    InvalidValueError,
    UncompiledBehaviourWarning,
    UnknownNameError,
)
from scenes import empty

SEEN = []


@behaviour
def timid(me, distance=20.0):
    """Back away from whatever is ahead."""
    if 0 <= me.distance[me.front] < distance:
        return -me.max_speed, -me.max_speed
    return PASS


@behaviour
def chatty(me):
    """Cannot be compiled: it appends to a list."""
    SEEN.append(f"{me.radius}")
    return me.max_speed, 0.0


@behaviour
def dizzy(me):
    """Divide nothing by nothing."""
    return me.heat / me.heat, me.max_speed


@behaviour
def careless(me, which=99.0):
    """Read a sensor that is not there."""
    return me.distance[int(which)], 0.0


def facing_a_disc():
    model = empty()
    model.add_obstacle(disc((222, 150), 5))
    return model, model.add_robots(AGENT9, poses=[(200, 150, 0.0)])[0]


def test_a_rule_drives_the_robot_where_it_has_something_to_say_and_passes_otherwise():
    model, _ = facing_a_disc()
    model.control = Subsumption(timid, Explore())
    model.step()
    assert model.swarm.command.tolist() == [[-1.0, -1.0]]
    model.control = Subsumption(timid(distance=5), Explore())
    model.step()
    assert model.swarm.layer.tolist() == [1]


def test_a_compiled_rule_does_what_the_plain_function_does():
    model, _ = facing_a_disc()
    model.control = Subsumption(timid(distance=13.0), Explore())
    for _ in range(20):
        model.step()
        ahead = model.swarm.distance[0, 0]
        assert model.swarm.layer[0] == (0 if 0 <= ahead < 13.0 else 1)


def test_a_rule_that_cannot_be_compiled_runs_as_plain_python_with_one_warning():
    model, _ = facing_a_disc()
    model.control = Subsumption(chatty)
    with pytest.warns(UncompiledBehaviourWarning, match="rule chatty cannot be compiled"):
        model.step()
    model.step()
    assert SEEN[-2:] == ["5.0", "5.0"]
    assert model.swarm.command.tolist() == [[1.0, 0.0]]


def test_a_rule_that_returns_nan_is_reported_with_the_robot_and_the_rule():
    model, robot = facing_a_disc()
    model.control = Subsumption(dizzy)
    with pytest.raises(BehaviourError, match=rf"rule dizzy returned \(nan, 1\) for robot {robot.unique_id}"):
        model.step()


def test_a_rule_that_returns_too_many_wheels_is_reported():
    @behaviour
    def three_legged(me):
        SEEN.append("")
        return 1.0, 1.0, 1.0

    model, _ = facing_a_disc()
    model.control = Subsumption(three_legged)
    with pytest.warns(UncompiledBehaviourWarning), pytest.raises(BehaviourError, match="three_legged"):
        model.step()


def test_a_rule_that_reads_a_sensor_that_is_not_there_fails_instead_of_reading_elsewhere():
    model, _ = facing_a_disc()
    model.control = Subsumption(careless)
    with pytest.raises(IndexError):
        model.step()


def test_a_rule_may_ask_for_less_than_full_speed_and_is_limited_to_it():
    @behaviour
    def racer(me):
        return 9.0 * me.max_speed, -9.0 * me.max_speed

    model, _ = facing_a_disc()
    model.control = Subsumption(racer)
    model.step()
    assert model.swarm.command.tolist() == [[1.0, -1.0]]


def test_a_rule_knows_all_that_it_is_promised():
    @behaviour
    def curious(me):
        known = me.distance[me.left] + me.distance[me.right] + me.bearing[me.left] + me.tendency + me.radius
        if me.hot or me.extinguishing or me.kind[me.front] > 9:
            return PASS
        return 0.0 * (known + me.temperature + me.heat + me.line.size + me.radiation.size), me.max_speed

    model, _ = facing_a_disc()
    model.control = Subsumption(curious)
    model.step()
    assert model.swarm.command.tolist() == [[0.0, 1.0]]


def test_parameters_without_a_number_are_refused():
    with pytest.raises(InvalidValueError, match="without a default"):
        behaviour(lambda me, distance: PASS)
    with pytest.raises(InvalidValueError, match="distance"):
        timid(distance=math.nan)
    with pytest.raises(UnknownNameError, match="did you mean 'distance'"):
        timid(distanse=3)


def test_robots_for_which_no_layer_is_active_stop():
    model, _ = facing_a_disc()
    model.control = Subsumption(timid(distance=1))
    model.step()
    assert model.swarm.command.tolist() == [[0.0, 0.0]]
    assert model.swarm.layer.tolist() == [-1]
    assert np.array_equal(model.swarm.position, [[200, 150]])


def test_a_rule_works_for_designs_without_any_sensor_of_a_kind():
    model = empty()
    model.add_robots(RobotDesign(sensors=()), poses=[(50, 50, 0.0)])

    @behaviour
    def blind(me):
        return me.max_speed, me.max_speed

    model.control = Subsumption(blind)
    model.step()
    assert model.swarm.position[0] == pytest.approx((51, 50))
