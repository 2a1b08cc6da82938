"""Kernels of rules: the same bits and the same errors as the rule that is called from Python."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import AGENT9, Actuator, HolonomicDrive, Radio, SwarmModel
from mesa_swarm.base.errors import BehaviourError
from mesa_swarm.control import PASS, Explore, StateMachine, Subsumption, VectorSum, behaviour
from mesa_swarm.control.behaviour import Behaviour
from mesa_swarm.kernels.draws import draw_at
from support.kernels import assert_equal_columns, columns_after, decides_by


class Horn(Actuator):
    """What sounds in the steps in which it is set."""

    name = "horn"

    def apply(self, model, rows): ...


@behaviour(memory={"steps": 0, "turned": False, "way": [0.0, 0.0, 0.0]})
def wander(me, often=0.3):
    me.memory.steps += 1
    me.memory.way[1] += me.chance
    if me.chance < often or 0 <= me.distance[me.front] < 20:
        me.memory.turned = True
        me.act.horn = 1.0 + me.chance
        me.send.count = me.heard.n + 1.0
        return me.max_speed, -0.5 * me.max_speed * me.chance
    return PASS


@behaviour
def shy(me, distance=20.0):
    if 0 <= me.distance[me.front] < distance:
        return -me.max_speed, me.max_speed
    return PASS


def crowd(control, design=AGENT9, n=12, **arguments):
    model = SwarmModel(rng=4, **arguments)
    model.add_robots(replace(design, actuators=(Horn(),)), n)
    model.control = control
    return model


@pytest.fixture
def in_python(monkeypatch):
    """Return what makes a value while rules have no kernels."""

    def run(function, *arguments):
        with monkeypatch.context() as patched:
            patched.setattr(Behaviour, "kernel_for", lambda *_: None)
            return function(*arguments)

    return run


CONTROLS = {
    "subsumption": lambda: Subsumption(wander, shy, Explore(turn_interval=9)),
    "sum": lambda: VectorSum(wander, shy(distance=30), Explore(), weights=(1, 2, 0.5)),
    "machine": lambda: StateMachine({"here": (shy, wander, Explore())}),
}


@pytest.mark.parametrize("make_control", CONTROLS.values(), ids=CONTROLS)
def test_a_rule_decides_by_its_kernel_as_it_does_from_python(make_control, in_python):
    models = [crowd(make_control(), communication=Radio(range=80, message=("count",))) for _ in range(2)]
    usual, others = columns_after(models[0]), in_python(columns_after, models[1])
    assert decides_by(models[0]).kernel is not None
    assert_equal_columns(usual, others)
    for model in models:
        model.robots[3].remove()
        model.add_robots(model.robots[0].design, 2)
    assert_equal_columns(columns_after(models[0]), in_python(columns_after, models[1]))


def test_a_rule_has_a_kernel_after_its_first_step_in_which_it_is_compiled():
    model = crowd(Subsumption(shy, Explore()))
    assert decides_by(model).python == "shy"
    assert decides_by(model.run(1)).kernel is not None
    assert "Python" not in next(line for line in str(model.plan).splitlines() if "layers decide" in line)


def test_a_rule_that_stays_plain_python_is_named_by_the_plan():
    @behaviour
    def slow(me):
        return tuple([float(str(me.max_speed)), me.max_speed])

    model = crowd(Subsumption(slow, Explore()))
    with pytest.warns(UserWarning, match="rule slow"):
        model.run(3)
    assert decides_by(model).python == "slow"


def test_a_parameter_of_a_rule_that_is_set_between_steps_counts_from_the_next_on():
    models = [crowd(Subsumption(shy(distance=distance), Explore())) for distance in (0.0, 1000.0)]
    for model in models:
        model.run(3)
    models[0].control.layers[0].parameters["distance"] = 1000.0
    seen = models[0].swarm.columns["distance"][:, 0] >= 0
    layer = models[0].run(1).swarm.layer
    assert seen.any()
    assert (layer[seen] == 0).any()


@behaviour(memory={"steps": 0})
def reads_too_far(me):
    me.memory.steps += 1
    if me.memory.steps == 5 and me.chance < 0.5:
        return me.distance[100], 0.0
    return me.max_speed, me.chance


@behaviour(memory={"steps": 0})
def never_ends(me):
    me.memory.steps += 1
    while me.memory.steps == 5 and me.max_speed < 10.0:
        me.memory.steps += 0
    return PASS


@behaviour(memory={"steps": 0})
def remembers_halves(me):
    me.memory.steps += 0.5 * (me.memory.steps == 4) + 1
    return PASS


@behaviour(memory={"steps": 0})
def raises(me):
    me.memory.steps += 1
    if me.memory.steps == 5:
        raise ValueError("five steps are too many")
    return PASS


@behaviour(memory={"steps": 0})
def commands_nan(me):
    me.memory.steps += 1
    return (math.nan, 1.0) if me.memory.steps == 5 and me.chance < 0.5 else (1.0, 1.0)


@behaviour(memory={"steps": 0})
def divides(me):
    me.memory.steps += 1
    return 1.0 / (me.memory.steps - 5.0), 1.0


RULES = (reads_too_far, never_ends, remembers_halves, raises, commands_nan, divides)


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.name)
@pytest.mark.parametrize("arbiter", [Subsumption, VectorSum])
def test_an_error_of_a_rule_is_the_same_by_its_kernel_and_leaves_the_same_state(arbiter, rule, in_python):
    models = [crowd(arbiter(rule, Explore())) for _ in range(2)]

    def columns_after_error(model):
        with pytest.raises(BehaviourError, match=f"rule {rule.name} failed.* in step 5: it") as raised:
            model.run(20)
        assert model.steps == 5
        columns = {name: column.copy() for name, column in model.swarm.columns.items()}
        return str(raised.value), type(raised.value.__cause__), columns

    words, cause, columns = columns_after_error(models[0])
    others = in_python(columns_after_error, models[1])
    assert (words, cause) == others[:2]
    assert_equal_columns(columns, others[2])


def test_a_rule_for_wheels_is_refused_by_its_kernel_for_robots_that_are_added_with_another_drive(in_python):
    @behaviour
    def turns(me):
        return me.max_speed, me.max_speed, 0.0

    def error_of(design):
        model = crowd(Subsumption(turns), design)
        with pytest.raises(BehaviourError) as raised:
            model.run(3)
        return str(raised.value)

    design = replace(AGENT9, drive=HolonomicDrive())
    assert error_of(design) == in_python(error_of, design)


def test_a_kernel_draws_its_key_as_numpys_generator_does_in_each_step():
    @behaviour(memory={"chance": 0.0})
    def remember(me):
        me.memory.chance = me.chance
        return PASS

    model = crowd(Subsumption(Explore(), remember), n=5)
    model.control = Subsumption(remember, Explore())
    stream = np.random.Generator(np.random.PCG64())
    stream.bit_generator.state = model.streams["decide.remember"].bit_generator.state
    for _ in range(4):
        model.run(1)
        key = stream.integers(2**64, dtype=np.uint64)
        expected = [draw_at(key, robot, 0) for robot in model.swarm.number]
        np.testing.assert_array_equal(model.swarm.columns["0.remember.chance"], expected)
