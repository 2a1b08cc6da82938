"""What a rule reads is of its own robot and its own design: compiled, and in plain Python."""

import math

import numpy as np
import pytest

from mesa_swarm import ProximitySensor, RadiationSensor, RobotDesign
from mesa_swarm.base.errors import BehaviourError
from mesa_swarm.control import PASS, Subsumption, behaviour
from mesa_swarm.control.rule import distances
from mesa_swarm.robots.devices import extract_reason
from mesa_swarm.robots.sensors import LineSensor
from support.made_senses import ROBOTS, decided, known_to, made_drivers, made_senses, model_of_three_designs
from support.rules import SEEN, facing_a_disc, step_with

FIELDS = [
    *("front", "left", "right", "radius", "max_speed", "tendency", "heat", "hot", "extinguishing", "heard_x"),
    *("heard_y", "goal_x", "goal_y", "temperature", "heard_layer", "heard_task"),
]


def read(me, field=0):
    """Return the number of one field, and the sum of the readings with their places as weights."""
    total = 0.0
    for s in range(len(me.distance)):
        total += (s + 1) * (me.distance[s] + 100.0 * me.kind[s] + 0.01 * me.bearing[s])
    values = (
        me.front, me.left, me.right, me.radius, me.max_speed, me.tendency, me.heat, 1.0 * me.hot,
        1.0 * me.extinguishing, me.heard_x, me.heard_y, me.goal_x, me.goal_y, me.temperature, me.heard_layer,
        me.heard_task,
    )  # fmt: skip
    return (7777.0 if math.isnan(values[field]) else 1.0 * values[field]), total


def read_slowly(me, field=0):
    SEEN.append(f"{me.radius}")
    return read(me, field)


@pytest.mark.filterwarnings("ignore::mesa_swarm.base.errors.UncompiledBehaviourWarning")
@pytest.mark.parametrize("rule", [behaviour(read), behaviour(read_slowly)], ids=["compiled", "plain"])
def test_every_field_is_that_of_the_robot_itself(rule):
    senses, drivers = made_senses(3), made_drivers(3)
    senses.temperature[:] = np.arange(ROBOTS)
    senses.heard_layer[:] = np.arange(ROBOTS) % 5
    senses.heard_task[:] = np.arange(ROBOTS) % 7
    model = model_of_three_designs()
    for number, field in enumerate(FIELDS):
        model.control = Subsumption(rule(field=number))
        command, won = decided(model.control.layers[0], senses, drivers)
        for i in np.flatnonzero(drivers < 0)[:: 1 if number == 0 else 7]:
            me = known_to(senses, i)
            there = np.flatnonzero(me.sensors[:, 6] > 0)  # a range
            readings = me.distance[there] + 100.0 * me.kind[there] + 0.01 * me.bearing[there]
            expected = {
                "front": me.forward[0], "left": me.forward[1], "right": me.forward[2], "extinguishing": me.fire >= 0,
                "heard_x": me.heard_from[0], "heard_y": me.heard_from[1],
                "goal_x": me.heard_goal[0], "goal_y": me.heard_goal[1],
                "temperature": i, "heard_layer": i % 5, "heard_task": i % 7,
            }  # fmt: skip
            value = float(expected.get(field, getattr(me, field, math.nan)))
            assert won[i] == 7
            assert command[i, 0] == (7777.0 if math.isnan(value) else value)
            assert command[i, 1] == pytest.approx(((there + 1) * readings).sum())
    assert (won[drivers >= 0] == drivers[drivers >= 0]).all()


@pytest.mark.filterwarnings("ignore::mesa_swarm.base.errors.UncompiledBehaviourWarning")
def test_radiation_and_lines_have_as_many_entries_as_its_own_design_has_sensors_of_them():
    eye, warm, line = ProximitySensor(bearing_degrees=0, range=20), RadiationSensor(), LineSensor()
    designs = [RobotDesign(sensors=(eye, warm, line, line)), RobotDesign(sensors=(eye, eye, warm, warm, line))]
    model = facing_a_disc()[0]
    model.remove_robots(model.robots)
    for k, design in enumerate(designs):
        model.add_robots(design, poses=[(50 + 60 * k, 60, 0.0)])

    @behaviour
    def counts(me):
        return len(me.distance) / 10 + len(me.radiation) / 100, len(me.line) / 10

    model.control = Subsumption(counts)
    model.step()
    assert model.swarm.command == pytest.approx(np.array([[0.11, 0.2], [0.22, 0.1]]))


def reads_plainly(me, which=0):
    SEEN.append("")
    return 0.01 * me.distance[which], 0.5


@pytest.mark.filterwarnings("ignore::mesa_swarm.base.errors.UncompiledBehaviourWarning")
@pytest.mark.parametrize("which", [-2, 9])
def test_plain_rules_too_cannot_read_a_sensor_that_does_not_exist(which):
    with pytest.raises(BehaviourError, match=rf"IndexError: sensor {which} does not exist; expected an index below 9"):
        step_with(behaviour(reads_plainly)(which=which))


@pytest.mark.filterwarnings("ignore::mesa_swarm.base.errors.UncompiledBehaviourWarning")
@pytest.mark.parametrize("which", [0, 8, -1])
def test_plain_rules_read_the_first_sensor_the_last_and_nothing(which):
    model = step_with(behaviour(reads_plainly)(which=which))
    reading = -1.0 if which == -1 else model.swarm.distance[0, which]
    assert model.swarm.command[0, 0] == pytest.approx(0.01 * reading)


def test_readings_are_a_view_that_cannot_be_written_and_sums_of_them_are_ordinary():
    readings = distances[0](np.array([3.0, 1.0, 2.0]))
    assert [readings[k] for k in (0, 1, 2, -1)] == [3.0, 1.0, 2.0, -1.0]
    assert readings[-2:].tolist() == [1.0, 2.0]
    assert (readings + 1.0)[-1] == 3.0
    with pytest.raises(TypeError, match="change a copy"):
        readings[0] = 1.0


def test_whole_parameters_stay_whole_as_far_as_floats_represent_them():
    @behaviour
    def rule(me, count=1):
        return PASS if count else (0.0, 0.0)

    for value in (2.0**53, -(2.0**53), 0):
        assert type(rule(count=value).parameters["count"]) is int
    for value in (2.0**54, -(2.0**54), 0.5):
        assert type(rule(count=value).parameters["count"]) is float


@pytest.mark.parametrize(
    ("problem", "words"),
    [
        ("", "no reason is known"),
        ("Failed in nopython mode\n\n  a reason\nanother", "a reason"),
        ("first\nRejected as something:\n  the reason\nafter", "the reason"),
        ('why\nFile "a.py", line 12:\n', "why (line 12)"),
        ("x" * 300, "x" * 200),
        ("y" * 300 + '\nFile "a.py", line 3:', "y" * 200 + " (line 3)"),
    ],
)
def test_an_explanation_of_the_compiler_is_shortened_to_its_most_specific_line(problem, words):
    assert extract_reason(problem) == words
