"""Commanded: drives the first robots as told, and says when there are too few."""

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.control import Subsumption
from mesa_swarm.environments.task_world import Commanded
from mesa_swarm.errors import InvalidValueError


def told(count, robots):
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, robots)
    model.control = Subsumption(Commanded(count))
    model.control.layers[0].wheels[:] = np.arange(count)[:, None] / 10
    return model


def test_the_first_robots_do_as_they_are_told_and_the_others_stand():
    assert told(2, 3).run(1).swarm.command.tolist() == [[0.0, 0.0], [0.1, 0.1], [0.0, 0.0]]


def test_fewer_robots_than_are_commanded_are_refused_from_the_start_and_after_removals():
    with pytest.raises(InvalidValueError, match=r"^Commanded\(5\) has 2 robots to command; add robots"):
        told(5, 2).step()
    model = told(3, 3).run(2)
    next(iter(model.robots)).remove()
    with pytest.raises(InvalidValueError, match=r"^Commanded\(3\) has 2 robots to command"):
        model.step()
