"""A model with a part that has a row for each body, and one for each robot."""

import numpy as np

from mesa_swarm import AGENT9, Part, SwarmModel, disc
from mesa_swarm.kernels.part import Column, Phase, Stage


class Weather(Part):
    """How long each body has been outside."""

    name = "weather"
    age: np.ndarray

    def __init__(self, bodies):
        self.age = np.zeros(bodies)

    def columns(self):
        return {"age": Column(self.age, "bodies")}

    def stages(self):
        return [Stage(Phase.PROCESS, self.pass_by, "weather passes")]

    def pass_by(self):
        self.age += 1.0


class Weathered(SwarmModel):
    def __init__(self, *, rng=None):
        super().__init__(map="openspace", rng=rng)
        self.add_body(disc((200, 200), 10), mode="fixed")
        self.add_robots(AGENT9, 3)
        self.add_part(Weather(len(self.bodies)))
