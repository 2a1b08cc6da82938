"""Three parts of a user's kind, one that forgets a column, and a model of these beside all standing parts."""

import numpy as np

from mesa_swarm import AGENT9, AGENT_FIRE, Emitter, Field, FieldSensor, RobotDesign, SwarmModel, disc
from mesa_swarm.control import Avoid, Explore, Subsumption, behaviour
from mesa_swarm.kernels.part import Column, Part, Phase, Shown, Stage

SNIFFER = RobotDesign(
    name="sniffer",
    sensors=(*AGENT_FIRE.sensors, FieldSensor(field="trail")),
    actuators=(Emitter(field="trail"),),
)


@behaviour(memory={"turns": 0})
def wander(me, least=0.2):
    """Leave a trail, and count the steps in which it is strong."""
    me.act.trail = 1.0
    if me.trail[0] > least:
        me.memory.turns += 1
        return me.max_speed, 0.5 * me.max_speed
    return me.max_speed, me.max_speed * me.chance


class Odometer(Part):
    """Robots' columns only: how far each has been driven, and how often in each direction."""

    name = "odometer"

    def __init__(self):
        self.driven, self.turned = np.zeros(0), np.zeros((0, 2), np.int64)

    def bind(self, context):
        self.model = context.model
        if len(self.driven) != len(context.model.swarm):
            self.driven = np.zeros(len(context.model.swarm))
            self.turned = np.zeros((len(context.model.swarm), 2), np.int64)

    def columns(self):
        return {"driven": Column(self.driven, "robots"), "turned": Column(self.turned, "robots")}

    def stages(self):
        return [Stage(Phase.PROCESS, self.add, "adds up ways")]

    def add(self):
        command = self.model.swarm.command
        self.driven = self.driven + np.abs(command[:, :2]).mean(axis=1)  # another array in each step
        self.turned += np.column_stack([command[:, 0] > command[:, 1], command[:, 0] < command[:, 1]])

    def shown(self):
        return Shown("ways", rows={"way": self.driven}, text=f"{self.driven.sum():.1f} in all")


class Boards(Part):
    """Rows of its own and a random stream: boards at places, whose strength robots raise at random; it evaporates."""

    name = "boards"

    def __init__(self, places=((200.0, 200.0), (500.0, 400.0)), rate=0.05):
        self.places, self.rate = np.array(places), rate
        self.strength, self.steps = np.ones(len(self.places)), np.zeros(1, np.int64)

    def bind(self, context):
        self.model, self.rng = context.model, context.streams["boards"]

    def columns(self):
        return {
            "places": Column(self.places, role="parameter"),
            "strength": Column(self.strength),
            "steps": Column(self.steps, role="index"),
        }

    def stages(self):
        return [Stage(Phase.SENSE, self.write, "writes", every=2), Stage(Phase.PROCESS, self.fade, "evaporates")]

    def write(self):
        self.strength += self.rng.random(len(self.strength)) * len(self.model.swarm)
        self.steps += 1

    def fade(self):
        self.strength *= 1.0 - self.rate

    def shown(self):
        discs = np.column_stack([self.places, 5.0 * self.strength])
        values = np.outer(self.strength, np.ones(3))
        return Shown("boards", discs=discs, values=values, colour="#aa3311", text=f"{self.strength.max():.2f} at most")


class Roster(Part):
    """Agents in `store()`: a leader that changes at random, and the order in which robots led."""

    name = "roster"

    def __init__(self):
        self.leader, self.led = None, []

    def bind(self, context):
        self.model, self.rng = context.model, context.streams["roster"]

    def stages(self):
        return [Stage(Phase.DECIDE, self.choose, "chooses a leader", every=3)]

    def choose(self):
        self.leader = self.model.swarm.agents[int(self.rng.integers(len(self.model.swarm)))]
        self.led.append(self.leader)
        del self.led[:-5]


class Forgetful(Odometer):
    """Forgets what each robot has carried: the array is neither a column nor stored, and yet it counts."""

    name = "forgetful"

    def __init__(self):
        super().__init__()
        self.carried = np.zeros(3)

    def store(self):
        return {}

    def add(self):
        self.carried += 1.0
        self.driven = self.driven + self.carried.sum()


class Doors:
    """A process, and a stream of its own."""

    def __init__(self, rng):
        self.rng, self.open = rng, np.zeros(2)

    def step(self, model):
        self.open += self.rng.random(2)
        model.state["opened"] += int(self.open.sum() > 1.5)


class Whole(SwarmModel):
    """A small world in which every standing part has something to do, with three parts of its own."""

    def __init__(self, *, n_robots: int = 5, evaporation: float = 0.01, forgetful: bool = False, rng=None):
        super().__init__(map="openspace", rng=rng, noise=0.1)
        self.add_field(Field("trail", cell=20.0, diffusion=1.0, evaporation=evaporation))
        self.add_robots(SNIFFER, n_robots)
        self.add_robots(AGENT9, 1)
        self.add_fire((300.0, 300.0), radius=12.0)
        self.stone = self.add_body(disc((100.0, 100.0), 10.0), kind="stone")
        self.control = Subsumption(Avoid(distance=15), wander, Explore())
        self.state["opened"] = 0
        self.add_process(Doors(self.streams["doors"]))
        for part in (Odometer(), Boards(), Roster()):
            self.add_part(part)
        if forgetful:
            self.add_part(Forgetful())

    def step(self):
        self.stone.position = (100.0 + self.steps % 50, 100.0)
        super().step()
        if self.steps % 10 == 0:
            self.event("ten", value=float(self.steps))
