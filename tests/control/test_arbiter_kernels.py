"""Kernels of arbiters: the same bits as their definition in Python, layers in Python between compiled ones, errors."""

from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import AGENT9, Actuator, Lamp, OmniDrive, Radio, RobotDesign, SwarmModel
from mesa_swarm.control import (
    Avoid,
    Chance,
    Condition,
    Explore,
    Gather,
    Halt,
    Seen,
    StateMachine,
    Subsumption,
    Transition,
    VectorSum,
)
from mesa_swarm.control.arbiter import Arbiter, add_weighted, slow_down
from support.kernels import assert_equal_columns, columns_after, decides_by


class PlainSubsumption(Arbiter):
    """Layers one after the other, in Python."""

    def decide(self, senses, command, layer):
        command.fill(0.0)
        self.clear(layer)
        for index, part in enumerate(self.layers):
            part.decide(senses, command, layer, index)


class PlainSum(VectorSum):
    """Layers that are added up in Python."""

    def decide(self, senses, command, layer):
        layer_command, active, largest = np.empty_like(command), np.empty_like(layer), np.zeros(len(layer))
        command.fill(0.0)
        layer.fill(-1)
        for index, (part, weight) in enumerate(zip(self.layers, self.weights, strict=True)):
            layer_command.fill(0.0)
            self.clear(active)
            part.decide(senses, layer_command, active, index)
            add_weighted(layer_command, active, weight, index, command, layer, largest)
        slow_down(command, senses.max_speed, senses.design, senses.sideways)


class PythonExplore(Explore):
    """A layer in Python that does as another."""

    def decide(self, senses, command, layer, index):
        super().decide(senses, command, layer, index)


class PythonAvoid(Avoid):
    """Another."""

    def decide(self, senses, command, layer, index):
        super().decide(senses, command, layer, index)


def crowd(control, groups=("",), **arguments):
    model = SwarmModel(rng=4, **arguments)
    for group in groups:
        model.add_robots(AGENT9, 20, group=group)
    model.control = control
    return model


def in_groups(arbiter):
    return lambda: crowd({"a": arbiter(Avoid(), Explore(turn_interval=5)), "b": Subsumption(Avoid())}, ("a", "b"))


def machine(explore=Explore, condition=None):
    return StateMachine(
        states={"search": (Avoid(distance=10), explore(turn_interval=7)), "stay": Halt(), "apart": explore()},
        transitions=[
            Transition(source="search", target="stay", condition=Seen(kind="robot", within=15, probability=0.5)),
            Transition(source="stay", target="search", condition=Chance(probability=0.03)),
            Transition(source="search", target="apart", condition=condition or Chance(probability=0.1)),
            Transition(source="apart", target="search", condition=Chance(probability=0.2)),
        ],
    )


class Often(Condition):
    """A condition in Python with the chance of another."""

    def chances(self, senses):
        return np.full(len(senses.design), 0.1)


WEIGHTS = (2.0, 1.0, 0.5)
LAYERS = Avoid(), Explore(turn_interval=9), Gather()
PAIRS = {
    "subsumption": (lambda: crowd(Subsumption(*LAYERS)), lambda: crowd(PlainSubsumption(*LAYERS))),
    "sum": (lambda: crowd(VectorSum(*LAYERS, weights=WEIGHTS)), lambda: crowd(PlainSum(*LAYERS, weights=WEIGHTS))),
    "team": (in_groups(Subsumption), in_groups(PlainSubsumption)),
    "team of sums": (in_groups(VectorSum), in_groups(PlainSum)),
    "layers in Python": (
        lambda: crowd(Subsumption(Avoid(), Explore(turn_interval=9))),
        lambda: crowd(Subsumption(PythonAvoid(), PythonExplore(turn_interval=9))),
    ),
    "sum with layers in Python": (
        lambda: crowd(VectorSum(Avoid(), Explore(turn_interval=9), Gather())),
        lambda: crowd(VectorSum(Avoid(), PythonExplore(turn_interval=9), Gather())),
    ),
    "team with layers in Python": (
        lambda: crowd({"a": Subsumption(Avoid(), Explore()), "b": Subsumption(Avoid())}, ("a", "b")),
        lambda: crowd({"a": Subsumption(PythonAvoid(), PythonExplore()), "b": Subsumption(Avoid())}, ("a", "b")),
    ),
    "machine with layers in Python": (lambda: crowd(machine()), lambda: crowd(machine(PythonExplore))),
    "machine with conditions in Python": (lambda: crowd(machine()), lambda: crowd(machine(condition=Often()))),
}


@pytest.mark.parametrize(("make", "make_plain"), PAIRS.values(), ids=PAIRS)
def test_an_arbiter_decides_by_its_kernel_as_its_definition_in_python_does(make, make_plain):
    models = make(), make_plain()
    assert [decides_by(model).kernel is None for model in models] == [False, True]
    assert_equal_columns(*map(columns_after, models))
    for model in models:
        model.robots[3].remove()
        model.add_robots(AGENT9, 2, group=model.robots[0].group)
    assert_equal_columns(*map(columns_after, models))


def test_the_plan_names_layers_and_conditions_in_python_and_arbiters_of_a_users_own():
    reasons = {
        decides_by(crowd(control)).python
        for control in (
            machine(PythonExplore, Often()),
            Subsumption(PythonAvoid(name="mine"), Explore()),
            PlainSubsumption(Explore()),
        )
    }
    assert reasons == {"Explore, Often", "mine", "PlainSubsumption"}


def test_robots_that_change_their_group_are_driven_by_its_arbiter_from_the_next_step_on():
    model = crowd({"a": Subsumption(Explore()), "b": Subsumption(Halt())}, ("a", "b")).run(2)
    model.robots[0].group, model.robots[-1].group = "b", "a"
    model.run(1)
    stands = (model.swarm.command == 0.0).all(axis=1)
    assert stands[[0, 1, -2, -1]].tolist() == [True, False, True, False]


class Stumble(Explore):
    """A layer that raises an error in one step."""

    def decide(self, senses, command, layer, index):
        if self._swarm.agents[0].model.steps == 5:
            raise RuntimeError("stumbled")
        super().decide(senses, command, layer, index)


@pytest.mark.parametrize("arbiter", [Subsumption, VectorSum])
def test_after_an_error_of_a_layer_the_next_step_begins_with_the_first_layer(arbiter):
    plain = {Subsumption: PlainSubsumption, VectorSum: PlainSum}[arbiter]
    models = [crowd(kind(Avoid(front="random"), Stumble(), Gather())) for kind in (arbiter, plain)]
    for model in models:
        with pytest.raises(RuntimeError, match="stumbled"):
            model.run(20)
    assert_equal_columns(*map(columns_after, models))


def test_a_weight_that_is_set_between_steps_counts_from_the_next_on():
    models = [crowd(VectorSum(Avoid(), Explore(), weights=weights)) for weights in ((1, 1), (1, 0))]
    models[0].control.weights = (1.0, 0.0)
    assert_equal_columns(*(columns_after(model, 20) for model in models))


class Horn(Actuator):
    """What sounds only in the steps in which it is set."""

    name = "horn"

    def apply(self, model, rows): ...


def test_actuators_messages_and_drives_of_several_kinds_are_part_of_the_kernel():
    omni, lit = RobotDesign(drive=OmniDrive()), replace(AGENT9, actuators=(Lamp(), Horn()))
    model = SwarmModel(rng=4, communication=Radio(range=50, message=("x", "y")))
    model.add_robots(lit, 5)
    model.add_robots(omni, 5)
    model.control = {lit: Subsumption(Explore()), omni: None}
    columns = model.swarm.columns
    for name in ("act.lamp", "act.horn", "send.x", "command"):
        columns[name][:] = 0.5
    assert decides_by(model).kernel is not None
    model.run(1)
    assert (columns["act.lamp"][:5] == 0.5).all()  # which holds what it is set to
    assert not columns["act.horn"].any()
    assert np.isnan(columns["send.x"]).all()
    assert not model.swarm.command[:5, 2].any()
