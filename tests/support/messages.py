"""Robots that broadcast to each other, and what they hear."""

import numpy as np

from mesa_swarm.control import Subsumption
from support.scenes import blind, empty

HEARD = ("heard_layer", "heard_task", "heard_from", "heard_goal")


class Broadcasting:
    """A layer that stands still and broadcasts, for each robot in order of creation, this task and this goal."""

    name = "Broadcasting"

    def __init__(self, tasks, goals=()):
        self.tasks, self.goals = np.array(tasks), np.reshape(np.array(goals, float), (-1, 2))

    def bind(self, swarm, prefix, rng):
        self.swarm = swarm

    def decide(self, senses, command, layer, index):
        number = self.swarm.number
        senses.task[:] = self.tasks[number]
        senses.goal[:] = self.goals[number] if len(self.goals) else np.nan
        layer[:] = index


def heard(poses, radio, tasks, goals=(), *, shapes=(), fires=(), **options):
    """Return a model whose robots have broadcast this, and heard it from each other."""
    model = empty(communication=radio, **options)
    for shape in shapes:
        model.add_obstacle(shape)
    for place in fires:
        model.add_fire(place, radius=10)
    model.add_robots(blind(), poses=poses)
    model.control = Subsumption(Broadcasting(tasks, goals))
    return model.run(2)


def listener(*arguments, **options):
    """Return the task that the last of several robots hears."""
    return int(heard(*arguments, **options).swarm.heard_task[-1])
