"""Robots that have learned a little by Q-learning, and robots that drive by their policy."""

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.control import Subsumption
from mesa_swarm.learning import QLearning


def trained(steps=30, robots=3, rng=1, **options):
    model = SwarmModel(map="original", rng=rng)
    model.add_robots(AGENT9, robots)
    model.control = Subsumption(QLearning(**options))
    return model.run(steps)


def learned(model, **training):
    return model.control.layers[0].policy(**training)


def driven(layer, design=AGENT9, rng=2, robots=3):
    model = SwarmModel(map="original", rng=rng)
    model.add_robots(design, robots)
    model.control = Subsumption(layer)
    return model
