"""A user's model whose module has classes that a forged recording might misuse: they note what they were made to do."""

import mesa

from mesa_swarm import AGENT9, Process, SwarmModel
from mesa_swarm.control import Avoid, Explore, Subsumption

# What was done by objects that no constructor has made.
DONE: list[str] = []


class Writer:
    """A class with `step` that is not a process."""

    path = "unset"

    def step(self, model):
        DONE.append(f"stepped {self.path}")


class Remover:
    """A class that does something when it goes."""

    path = "unset"

    def __init__(self):
        self.honest = True

    def step(self, model):
        return

    def __del__(self):
        if not getattr(self, "honest", False):
            DONE.append(f"deleted {self.path}")


class Closing(Process):
    """A process that does the same."""

    path: str = "unset"

    def step(self, model):
        return

    def __del__(self):
        DONE.append(f"closed {self.path}")


class Watched(Process):
    """A process with a property that acts when it is set, and a number."""

    level: float = 0.0

    def step(self, model):
        self.level += 1.0

    @property
    def path(self):
        """A path that is opened when it is set."""
        return ""

    @path.setter
    def path(self, value):
        DONE.append(f"set {value}")


class Courier(mesa.Agent):
    """An agent whose step writes to its path; the model has none."""

    path = "unset"

    def step(self):
        DONE.append(f"helped {self.path}")


class Present(mesa.Agent):
    """An agent that the model has."""

    age: int = 0

    def step(self):
        self.age += 1


class Workshop(SwarmModel):
    """A model that steps all of its agents and processes."""

    def __init__(self, *, rng=None):
        super().__init__(map="openspace", rng=rng)
        self.add_robots(AGENT9, 2)
        self.control = Subsumption(Avoid(), Explore())
        self.add_process(Watched())
        Present(self)

    def step(self):
        for agent in list(self.agents):
            if isinstance(agent, Present | Courier):
                agent.step()
        super().step()
