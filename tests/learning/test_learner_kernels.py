"""Kernels of learners: which have them, the random numbers that they draw, robots that come later."""

from dataclasses import fields

import numpy as np
import pytest

from mesa_swarm import AGENT_FIRE, SwarmModel
from mesa_swarm.control import Subsumption
from mesa_swarm.learning import (
    HebbianLearning,
    LearnFires,
    LearnFireWheels,
    QLearning,
    TableQLearning,
    WireFittedQ,
)
from support.kernels import assert_equal_columns, columns_after, decides_by

LEARNERS = {
    "networks": (QLearning(beta=5e-3), 1),
    "replay": (QLearning(replay=20, replays=3), 4),
    "shared": (QLearning(shared=True), 1),
    "table": (TableQLearning(), 1),
    "shared table": (TableQLearning(shared=True), 1),
    "skills": (LearnFires(), 1),
    "reflexes": (HebbianLearning(contact=5.0), 0),
    "wheels": (LearnFireWheels(), 1),
}
ROBOTS, STEPS = 12, 200


def learning(learner):
    model = SwarmModel(map="openspace_fire", rng=2)
    model.add_robots(AGENT_FIRE, ROBOTS)
    model.control = Subsumption(learner)
    return model


@pytest.mark.parametrize(("learner", "numbers"), LEARNERS.values(), ids=LEARNERS)
def test_a_learner_draws_by_its_kernel_as_many_numbers_as_numpys_generator_for_each_robot_and_step(learner, numbers):
    model = learning(learner).run(1)  # in the first step it has drawn its first weights
    assert decides_by(model).kernel is not None
    assert "Python" not in next(line for line in str(model.plan).splitlines() if "layers decide" in line)
    generator = np.random.Generator(np.random.PCG64())
    stream = model.streams[f"decide.{learner.name}"]
    generator.bit_generator.state = stream.bit_generator.state
    model.run(STEPS)
    generator.random(STEPS * ROBOTS * numbers)
    assert stream.random() == generator.random()


@pytest.mark.parametrize(("learner", "numbers"), LEARNERS.values(), ids=LEARNERS)
def test_a_learner_learns_by_its_kernel_as_when_python_calls_it_among_robots_that_come_and_go(learner, numbers):
    class FromPython(type(learner)):
        """The same, called from Python."""

        def decide(self, senses, command, layer, index):
            super().decide(senses, command, layer, index)

    values = {field.name: getattr(learner, field.name) for field in fields(learner)}
    models = learning(learner), learning(FromPython(**values))
    assert_equal_columns(*(columns_after(model, STEPS) for model in models))
    assert decides_by(models[1]).python == learner.name
    for model in models:
        model.robots[2].remove()
        model.add_robots(AGENT_FIRE, 3)
    assert_equal_columns(*(columns_after(model, STEPS) for model in models))


def test_a_learner_that_draws_normal_errors_is_named_by_the_plan():
    assert decides_by(learning(WireFittedQ()).run(2)).python == "WireFittedQ"


def test_a_rate_of_a_learner_that_is_set_between_steps_counts_from_the_next_on():
    models = [learning(QLearning()).run(5) for _ in range(2)]
    models[1].control.layers[0].eta = 0.5
    assert models[0].run(20).state_hash() != models[1].run(20).state_hash()
