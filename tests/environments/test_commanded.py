"""Commanded: drives the first robots by commands, and refuses to without enough robots."""

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Subsumption
from mesa_swarm.environments.task_world import Commanded


def commanded(count, robots):
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, robots)
    model.control = Subsumption(Commanded(count))
    model.control.layers[0].wheels[:] = np.arange(count)[:, None] / 10
    return model


def test_the_first_robots_are_driven_by_commands_and_the_others_stand():
    assert commanded(2, 3).run(1).swarm.command.tolist() == [[0.0, 0.0], [0.1, 0.1], [0.0, 0.0]]


def test_fewer_robots_than_are_commanded_are_refused_from_the_start_and_after_removals():
    with pytest.raises(InvalidValueError, match=r"^Commanded\(5\) has 2 robots to command; add robots"):
        commanded(5, 2).step()
    model = commanded(3, 3).run(2)
    next(iter(model.robots)).remove()
    with pytest.raises(InvalidValueError, match=r"^Commanded\(3\) has 2 robots to command"):
        model.step()
