"""What rules write: memory, actuators and messages."""

import math
import warnings
from dataclasses import dataclass

import numpy as np
import pytest

from mesa_swarm import AGENT9, Actuator, Lamp, RobotDesign, SwarmModel
from mesa_swarm.base.errors import BehaviourError, InvalidValueError
from mesa_swarm.control import PASS, Subsumption, behaviour


@dataclass(frozen=True, kw_only=True)
class Horn(Actuator):
    name: str = "horn"
    width: int = 2

    def apply(self, model, rows):
        model.heard_horns = (*getattr(model, "heard_horns", ()), model.swarm.columns["act.horn"][rows].tolist())


@dataclass(frozen=True, kw_only=True)
class Drops(Actuator):
    name: str = "drops"

    @staticmethod
    def act(value, rows, position, floor):
        for i in range(len(rows)):
            floor[rows[i]] += value[i] * position[i, 0]

    def arguments(self, model):
        return {"floor": model.floor}


LOUD = RobotDesign(name="loud", sensors=AGENT9.sensors, actuators=(Horn(), Lamp()))
FIRST = {"count": 0, "last": math.nan, "path": (0.0, 1.0), "even": True}


@behaviour(memory=FIRST)
def counts(me, by=1):
    me.memory.count += by
    me.memory.last = me.max_speed
    me.memory.path[1] += 0.5
    me.memory.even = me.memory.count % 2 == 0
    return PASS


@behaviour(memory=FIRST)
def counts_slowly(me, by=1):
    assert str(open)
    me.memory.count += by
    me.memory.last = me.max_speed
    me.memory.path[1] += 0.5
    me.memory.even = me.memory.count % 2 == 0
    return PASS


@behaviour
def honks(me, volume=3.0):
    me.act.horn[1] = volume
    me.act.lamp = 7.0
    return 1.0, 1.0


def columns_of(rule, model):
    return {n.partition(".")[2].partition(".")[2]: c.tolist() for n, c in model.swarm.columns.items() if rule.name in n}


@pytest.mark.parametrize("rule", [counts, counts_slowly])
def test_a_rule_remembers_numbers_of_each_robot_compiled_or_not(rule):
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 2)
    model.control = Subsumption(rule(by=2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.run(2)
        model.add_robots(AGENT9, 1)
        model.run(1)
    assert columns_of(rule, model) == {
        "count": [6, 6, 2],
        "last": [1.0, 1.0, 1.0],
        "path": [[0.0, 2.5], [0.0, 2.5], [0.0, 1.5]],
        "even": [True, True, True],
    }
    model.control = Subsumption(rule)
    assert model.swarm.columns[f"0.{rule.name}.count"].tolist() == [0, 0, 0]


def test_two_layers_of_one_rule_remember_apart():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 1)
    model.control = Subsumption(counts(by=1), counts(by=10))
    model.run(3)
    assert [model.swarm.columns[f"{k}.counts.count"].item() for k in (0, 1)] == [3, 30]


def test_memory_is_part_of_the_state():
    def make(by):
        model = SwarmModel(rng=1)
        model.add_robots(AGENT9, 1)
        model.control = Subsumption(counts(by=by))
        return model.run(1).state_hash()

    assert make(1) == make(1) != make(2)


@pytest.mark.parametrize(
    ("memory", "words"),
    [
        (3, "expected names"),
        ({"two words": 1}, "expected one word"),
        ({"x": "text"}, "expected a number"),
        ({"x": [[1.0]]}, "expected a number"),
        ({"x": []}, "expected a number"),
        ({"x": object()}, "expected a number"),
    ],
)
def test_memory_that_is_not_named_numbers_is_refused(memory, words):
    with pytest.raises(InvalidValueError, match=words):
        behaviour(memory=memory)(lambda me: (1.0, 1.0))


@pytest.mark.slow
def test_actuators_get_what_is_set_and_begin_each_decision_at_nothing_unless_they_hold():
    model = SwarmModel(rng=1)
    model.add_robots(LOUD, 1)
    model.add_robots(AGENT9, 1)
    model.control = Subsumption(honks)
    model.step()
    assert model.heard_horns == ([[0.0, 3.0]],)
    model.control = Subsumption(behaviour(lambda me: (1.0, 1.0)))
    model.step()
    assert model.heard_horns[1:] == ([[0.0, 0.0]],)
    assert model.swarm.columns["act.lamp"].tolist() == [7.0, 7.0]


def test_a_compiled_actuator_writes_to_arrays_of_the_model():
    @behaviour
    def drop(me):
        me.act.drops = 2.0
        return 0.0, 0.0

    model = SwarmModel(rng=1)
    model.floor = np.zeros(3)
    model.add_robots(AGENT9, poses=[(50, 50, 0)])
    model.add_robots(RobotDesign(actuators=(Drops(),)), poses=[(100, 100, 0), (200, 100, 0)])
    model.control = Subsumption(drop)
    model.run(2)
    assert model.floor.tolist() == [0.0, 400.0, 800.0]


def test_a_layer_that_is_a_class_sets_actuators_too():
    class Horns:
        name = "horns"

        def bind(self, swarm, prefix, rng):
            pass

        def decide(self, senses, command, layer, index):
            senses.act["horn"][:] = 5.0

    model = SwarmModel(rng=1)
    model.add_robots(LOUD, 1)
    model.control = Subsumption(Horns())
    model.step()
    assert model.heard_horns == ([[5.0, 5.0]],)


def test_a_number_that_is_not_finite_is_refused_before_it_takes_effect():
    model = SwarmModel(rng=1)
    model.add_robots(LOUD, 2)
    model.control = Subsumption(honks(volume=1.0))
    model.step()
    model.control = Subsumption(behaviour(nan_horn))
    with pytest.raises(BehaviourError, match=r"act.horn of robot 5 is \[nan, 0.0\] in step 2; expected finite numbers"):
        model.step()
    assert len(model.heard_horns) == 1


def nan_horn(me):
    me.act.horn[0] = math.nan
    return 1.0, 1.0


def unknown_memory(me):
    me.memory.cont += 1
    return 1.0, 1.0


def unknown_memory_somewhere(me):
    if me.max_speed > 10:
        me.memory.cont += 1
    return 1.0, 1.0


def unknown_actuator(me):
    me.act.hrn = 1.0
    return 1.0, 1.0


def unknown_field(me):
    return me.compas[0], 1.0


@pytest.mark.parametrize(
    ("rule", "words"),
    [
        (unknown_memory, "unknown field of me.memory 'cont'; did you mean 'count'"),
        (unknown_memory_somewhere, "unknown field of me.memory 'cont'; did you mean 'count'"),
        (unknown_actuator, "unknown field of me.act 'hrn'; did you mean 'horn'"),
        (unknown_field, "unknown field of me 'compas'"),
    ],
)
def test_an_unknown_field_is_refused_with_the_nearest_name(rule, words):
    model = SwarmModel(rng=1)
    model.add_robots(LOUD, 2)
    model.control = Subsumption(behaviour(memory={"count": 0})(rule))
    with pytest.raises(BehaviourError, match=words):
        model.step()


@pytest.mark.parametrize("actuators", [(3,), 3, (Horn(name="two words"),), (Horn(width=0),), (Horn(), Horn(width=3))])
def test_a_design_refuses_what_is_no_actuator(actuators):
    with pytest.raises(InvalidValueError):
        RobotDesign(actuators=actuators)


def test_designs_that_mean_different_things_by_one_name_are_refused_in_one_model():
    model = SwarmModel(rng=1)
    model.add_robots(LOUD, 1)
    with pytest.raises(InvalidValueError, match="actuators named horn differ"):
        model.add_robots(RobotDesign(actuators=(Horn(width=3),)), 1)
    assert len(model.swarm) == 1
