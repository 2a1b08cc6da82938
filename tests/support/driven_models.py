"""Models of which compiled calls take many steps, what interrupts these, and how runs are compared."""

import numpy as np

from mesa_swarm import AGENT9, Column, Part, Phase, Stage, SwarmModel, count, mean, share, until, value
from mesa_swarm.control import Avoid, Explore, Subsumption


class Plain(SwarmModel):
    """Robots that avoid and explore, of which every stage has a kernel, with measures of each kind."""

    moving = count("command", above=0)

    def __init__(self, *, n_robots=12, history_every=3, collect_every=1, rng=None):
        reporters = {
            "collisions now": count("collided"),
            "left": count("tendency", above=0),
            "driven": share("layer", equals=0),
            "speed": mean("speed"),
            "first temperature": value("fires.robots.temperature"),
            "fires out": count("fires.out"),
        }
        super().__init__(
            map="openspace_fire",
            rng=rng,
            history_every=history_every,
            collect_every=collect_every,
            model_reporters=reporters,
        )
        self.add_robots(AGENT9, n_robots)
        self.control = Subsumption(Avoid(distance=15), Explore())


def taken(model, steps):
    """Return a model after single steps, as many as it runs for."""
    for _ in range(steps):
        if not model.running:
            break
        model.step()
    return model


def assert_same(one, other):
    """Assert that two models are the same in everything that is stored of them."""
    assert (one.steps, one.completed, one.running) == (other.steps, other.completed, other.running)
    assert one.state_hash() == other.state_hash()
    assert_same_rows(one.datacollector.model_vars, other.datacollector.model_vars)
    assert one.datacollector._collected == other.datacollector._collected
    assert str(one.streams.state()) == str(other.streams.state())
    np.testing.assert_array_equal(one.fires.history.temperature, other.fires.history.temperature)
    np.testing.assert_array_equal(one.fires.history.steps, other.fires.history.steps)
    assert (one.collisions, one.total_collisions) == (other.collisions, other.total_collisions)
    assert one.parts.robots.robot_steps == other.parts.robots.robot_steps


def assert_same_rows(one, other):
    assert one.keys() == other.keys()
    for name, values in one.items():
        assert list(map(type, values)) == list(map(type, other[name])), name
        assert list(map(repr, values)) == list(map(repr, other[name])), name


class Counting(SwarmModel):
    """A model with a step of its own."""

    def step(self):
        super().step()
        self.state["n"] = self.state.get("n", 0) + 1


class Watching:
    """An observer that stores steps."""

    def __init__(self):
        self.steps = []

    def after_step(self, model, step):
        self.steps.append((step, model.completed, model.steps))


class Season(Part):
    """A part that does something in Python every seven steps."""

    name = "season"

    def bind(self, context):
        self.model = context.model
        if not hasattr(self, "days"):
            self.days = np.zeros(1)

    def columns(self):
        return {"days": Column(self.days)}

    def stages(self):
        return [Stage(Phase.PROCESS, self.turn, "the season turns", every=7)]

    def turn(self):
        self.days += self.model.completed
        self.model.swarm.columns["tendency"][:] *= -1.0


class Reaching(Plain):
    """Ends when enough robots have collided."""

    stops = until("total_collisions", at_least=5)
