"""Ten small models as users write them, each with another kind of state, and one of all kinds, drawn by a number."""

from dataclasses import dataclass, replace

import mesa
import numpy as np
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm import (
    AGENT3,
    AGENT9,
    AGENT_FIRE,
    Emitter,
    Field,
    FieldSensor,
    Gripper,
    Process,
    Radio,
    RobotDesign,
    Sensor,
    SwarmModel,
    disc,
    rectangle,
)
from mesa_swarm.control import (
    PASS,
    Avoid,
    Chance,
    Explore,
    Follow,
    Gather,
    Halt,
    Seen,
    StateMachine,
    Subsumption,
    Transition,
    VectorSum,
    behaviour,
)
from mesa_swarm.fire import FightFire, Spreading
from mesa_swarm.robots.gripper import Carried
from mesa_swarm.robots.imperfections import ROBOTARIUM


@behaviour(memory={"n": 0, "left": 0.0, "last": [0.0, 0.0]})
def remembers(me, every=7):
    """Turn now and then, by an angle that is remembered."""
    me.memory.n += 1
    me.memory.last[0] = me.memory.last[1]
    me.memory.last[1] = me.chance
    if me.memory.n % every == 0:
        me.memory.left = me.chance - 0.5
    if abs(me.memory.left) > 0.1:
        me.memory.left *= 0.8
        return me.memory.left, -me.memory.left
    return PASS


@behaviour
def grips(me):
    """Grip, and put down by chance."""
    me.act.grip = 1.0 if me.chance < 0.9 else 0.0
    return PASS


@behaviour
def smells(me):
    """Leave a trail, and turn where it smells."""
    me.act.trail = 1.0
    if me.nose[0] > 0.5:
        return me.max_speed, 0.3 * me.max_speed
    return PASS


@behaviour(memory={"best": 0.0})
def talks(me):
    """Send a number, and remember the largest that was heard."""
    me.send.value = me.chance
    for j in range(me.heard.n):
        me.memory.best = max(me.memory.best, me.heard.value[j])
    return (0.2, 0.9) if me.memory.best > 0.99 else PASS


@dataclass(frozen=True, kw_only=True, slots=True)
class Compass(Sensor):
    """A sensor of where east is."""

    name: str = "compass"
    width: int = 1

    @staticmethod
    def read(heading, out):
        out[:, 0] = np.cos(heading)


@behaviour
def steers(me):
    """Turn until the compass points east."""
    return (0.5, 0.9) if me.compass[0] < 0.5 else PASS


class Weary:
    """A custom layer, with a number for each robot and one for all."""

    name = "Weary"

    def __init__(self, limit):
        self.limit, self.steps = limit, 0

    def bind(self, swarm, prefix, rng):
        self.rng = rng
        self.column = f"{prefix}.tired"
        self.swarm = swarm
        swarm.remember(self.column, (), np.float64, 0.0)

    def decide(self, senses, command, layer, index):
        tired = self.swarm.columns[self.column]
        self.steps += 1
        tired += self.rng.random(len(tired)) * (layer < 0)
        rests = (tired > self.limit) & (layer < 0)
        tired[rests] = 0.0
        command[rests], layer[rests] = 0.0, index


class Tide(Process):
    """A process that moves a number up and down, and counts."""

    level: float = 0.0
    count: int = 0
    gain: float = 0.1

    def __init__(self, gain=0.1):
        self.gain = gain

    def step(self, model):
        self.count += 1
        self.level = (self.level + self.gain * model.streams["tide"].random()) % 1.0
        if self.level > 0.9:
            model.event("flood", value=self.level)


class Ledger(Process):
    """A process with a state that only its own methods store."""

    def __init__(self):
        self._rows = {}
        self._seen = frozenset()

    def step(self, model):
        self._rows[len(self._rows)] = object()
        self._seen |= {len(self._rows) % 3}
        if len(self._rows) % 11 == 0:
            model.robots[0].heading = 0.1 * len(self._rows)

    def checkpoint(self):
        return {"rows": len(self._rows), "seen": sorted(self._seen)}

    def restore(self, state):
        self._rows = {k: object() for k in range(state["rows"])}
        self._seen = frozenset(state["seen"])


class Wolf(ContinuousSpaceAgent):
    """An agent of Mesa's that walks about, and that a body follows."""

    heading: float = 0.0
    meals: int = 0

    def __init__(self, model, place=(120.0, 150.0)):
        super().__init__(model.space, model)
        self.position = place

    def step(self):
        self.heading = float(self.model.rng.uniform(-3, 3))
        way = 0.5 * np.array([np.cos(self.heading), np.sin(self.heading)])
        if self.model.space.in_bounds(self.position + 20 * way):
            self.position += way
        self.meals += self.model.collisions


def sum_of_positions(model):
    return float(model.swarm.position.sum())


def kind_of(agent):
    return type(agent).__name__


class Observed(SwarmModel):
    """What the small models share: reporters of the model and of agents, and a parameter that nothing reads."""

    def __init__(self, *, gain: float = 1.0, rng=None, **named):
        super().__init__(
            **{"map": "openspace", **named},
            rng=rng,
            model_reporters={"x": sum_of_positions, "completed": "completed"},
            agent_reporters={"kind": kind_of},
        )
        self.furnish()

    def furnish(self):
        """Add what the model has."""


class Machine(Observed):
    """A state machine, whose robots are in different states."""

    def furnish(self):
        self.add_robots(AGENT9, 6)
        moves = [
            Transition(source="go", target="wait", condition=Chance(probability=0.2)),
            Transition(source="wait", target="go", condition=Chance(probability=0.05)),
            Transition(source="go", target="gather", condition=Seen(kind="robot", within=40)),
        ]
        states = {"go": (Avoid(distance=15), Explore()), "wait": (Halt(),), "gather": (Avoid(), Gather(), Explore())}
        self.control = StateMachine(states, moves)


class Groups(Observed):
    """A team of three arbiters, one of them a machine, for designs and groups."""

    def furnish(self):
        self.add_robots(AGENT9, 3, group="scouts")
        self.add_robots(AGENT9, 3)
        self.add_robots(AGENT3, 2)
        machine = StateMachine(
            {"go": (Avoid(), Explore()), "wait": Halt()},
            [
                Transition(source="go", target="wait", condition=Chance(probability=0.1)),
                Transition(source="wait", target="go", condition=Chance(probability=0.1)),
            ],
        )
        weights = VectorSum(Avoid(), Explore(), weights=(2, 1))
        self.control = {"scouts": machine, AGENT9: Subsumption(Avoid(), remembers, Explore()), AGENT3: weights}


class OwnSensor(Observed):
    """A sensor and a layer of the user's own."""

    def furnish(self):
        design = replace(AGENT9, name="navigator", sensors=(*AGENT9.sensors, Compass()))
        self.add_robots(design, 5)
        self.control = Subsumption(Avoid(), Weary(20.0), steers, Explore())


class Trails(Observed):
    """A field that robots write and read, and one that a process fills."""

    def furnish(self):
        self.add_field(Field("trail", cell=20.0, diffusion=0.5, evaporation=0.02))
        self.add_field(Field("rain", cell=50.0, evaporation=0.1))
        nose = FieldSensor(field="trail", name="nose", mount=(5, 2))
        design = RobotDesign(name="ant", sensors=(*AGENT3.sensors, nose), actuators=(Emitter(field="trail"),))
        self.add_robots(design, 5)
        self.control = Subsumption(Avoid(), smells, Explore())

    def step(self):
        super().step()
        self.fields["rain"].deposit(tuple(self.rng.uniform(50, 500, 2)), 1.0)


class Grippers(Observed):
    """Robots that carry pucks, push a load, and are blocked by a door."""

    def furnish(self):
        design = RobotDesign(
            name="carrier",
            sensors=(*AGENT9.sensors, Carried()),
            actuators=(Gripper(kinds=("puck",), reach=8.0, field_of_view_degrees=180),),
        )
        for k in range(6):
            self.add_body(disc((100 + 30 * k, 120), 3), kind="puck")
        self.add_load(disc((300, 300), 10), resistance=0.3)
        self.door = self.add_body(rectangle((400, 100), (410, 160)), kind="door")
        self.add_robots(design, poses=[(90 + 30 * k, 110, 1.0) for k in range(5)])
        self.control = Subsumption(grips, Avoid(), Explore())

    def step(self):
        x, y = self.door.position
        self.door.position = (x, 100 + (y - 99) % 200)
        super().step()


class Talking(Observed):
    """Robots that send numbers, and hear goals."""

    def furnish(self):
        radio = Radio(range=200, state=True, goal=True, message=("value",), most=3, loss_probability=0.2)
        self.communication = radio
        self.add_robots(AGENT9, 6)
        self.control = Subsumption(Avoid(), talks, Follow(), Explore())


class Failing(Observed):
    """Imperfect robots, of which some fail, with batteries."""

    def furnish(self):
        self.add_robots(replace(AGENT9, name="charged", battery=80.0), 4)
        self.add_robots(AGENT9, 3)
        self.imperfections = replace(ROBOTARIUM, failure=0.01, sensor_failure=0.01, wheel_failure=0.005)
        self.control = Subsumption(Avoid(), Explore())

    def step(self):
        super().step()
        if self.steps == 4:
            self.robots[1].fail("stop")
            self.robots[2].fail("wheel", index=1, how="free")


class Sparks(Observed):
    """Fires that throw sparks, and robots that fight them."""

    def furnish(self):
        self.add_fire((200, 200), radius=20)
        self.add_fire((500, 400), radius=15, temperature=0.5)
        self.add_process(Spreading(rate=0.05))
        self.add_robots(AGENT_FIRE, 6)
        self.control = Subsumption(FightFire(strategy="B"), Avoid(), Explore())


class Wolves(Observed):
    """Agents of Mesa's that drive bodies, and are born and die."""

    def furnish(self):
        self.wolf = Wolf(self)
        self.add_body(disc((120, 150), 6), kind="wolf", agent=self.wolf)
        self.guest = mesa.Agent(self)
        self.guest.visits = 0
        self.add_robots(AGENT9, 5)
        self.control = Subsumption(Avoid(), Explore())

    def step(self):
        for wolf in list(self.agents_by_type.get(Wolf, ())):
            wolf.step()
        super().step()
        self.guest.visits += 1
        if self.steps % 9 == 0:
            cub = Wolf(self, (300.0, 300.0))
            self.add_body(disc((300, 300), 4), kind="cub", agent=cub)
        if self.steps % 13 == 0 and len(self.agents_by_type[Wolf]) > 1:
            list(self.agents_by_type[Wolf])[-1].remove()


class Stateful(Observed):
    """Declared state, events, processes, and attributes of every kind."""

    def furnish(self):
        self.state["delivered"] = 0
        self.state["history"] = np.zeros(3)
        self.tide = self.add_process(Tide())
        self.add_process(Ledger())
        self.visited = {0: [1, 2], "x": (3.0, None)}
        self.places = np.zeros((2, 2))
        self.favourite = None
        self.draws = np.random.default_rng(3)
        self.add_robots(AGENT9, 4)
        self.control = Subsumption(Avoid(), remembers, Explore())

    def step(self):
        super().step()
        self.state["delivered"] += int(self.collisions) + 1
        self.state["history"][self.steps % 3] += self.draws.random()
        self.visited[0].append(self.steps)
        self.places += 1.0
        self.favourite = self.robots[self.steps % len(self.robots)]
        self.event("delivered", robot=self.favourite, value=self.state["delivered"])
        if self.steps % 10 == 0:
            self.robots[-1].remove()
            self.add_robots(AGENT9, poses=[(100 + self.steps, 500, 0.0)])


OWN = [Machine, Groups, OwnSensor, Trails, Grippers, Talking, Failing, Sparks, Wolves, Stateful]


class Drawn(Observed):
    """A world with a random choice of all of this."""

    def __init__(self, *, draw: int = 0, gain: float = 1.0, rng=None):
        self.draw = draw
        rare = np.random.default_rng([draw, 1])
        super().__init__(
            gain=gain,
            rng=rng,
            map=["openspace", "openspace_fire"][rare.integers(2)],
            noise=float(rare.choice([0.0, 0.0, 0.1])),
            slip=float(rare.choice([0.0, 0.0, 0.2])),
            imperfections=float(rare.choice([0.0, 0.0, 0.5])),
            collect_every=int(rare.choice([1, 1, 3])),
            history_every=int(rare.choice([1, 4])),
        )

    def furnish(self):
        rng = np.random.default_rng([self.draw, 2])
        for part in (self.add_bodies, self.add_fires, self.add_radio, self.add_driven_robots):
            part(rng)
        if rng.random() < 0.3:
            self.add_process(Tide(0.2))
        if rng.random() < 0.2:
            self.add_process(Ledger())
        if rng.random() < 0.3:
            self.state["n"] = 0

    def add_bodies(self, rng):
        """Add bodies at places that are free on both maps."""
        if rng.random() < 0.4:
            self.add_obstacle(disc((150, 560), 12))
        if rng.random() < 0.4:
            self.add_load(disc((250, 560), 9), resistance=0.4)
        if rng.random() < 0.4:
            self.add_body(disc((350, 560), 6), kind="puck")
        if rng.random() < 0.3:
            self.add_body(disc((420, 560), 6), kind="wolf", agent=Wolf(self, (420.0, 560.0)))
        if rng.random() < 0.3:
            self.add_field(Field("rain", cell=60.0, diffusion=0.2, evaporation=0.05))

    def add_fires(self, rng):
        """Perhaps add a fire and sparks."""
        if rng.random() < 0.4:
            self.add_fire((500, 550), radius=10, temperature=0.6)
        if rng.random() < 0.3:
            self.add_process(Spreading(rate=0.02))

    def add_radio(self, rng):
        """Perhaps let robots hear each other."""
        if rng.random() < 0.4:
            self.communication = Radio(range=150, message=("value",), most=2, loss_probability=0.1)

    def drawn_arbiters(self, rng):
        """Return some arbiters in a random order."""
        layers = [Avoid(distance=float(rng.choice([10, 15]))), remembers(every=int(rng.integers(2, 9))), Weary(15.0)]
        rng.shuffle(layers)
        if self.communication is not None:
            layers.append(talks)
        moves = [
            Transition(source="go", target="wait", condition=Chance(probability=0.1)),
            Transition(source="wait", target="go", condition=Chance(probability=0.1)),
        ]
        choices = [
            Subsumption(*layers, Explore()),
            StateMachine({"go": (*layers[:2], Explore()), "wait": Halt()}, moves),
            VectorSum(Avoid(), Explore(), weights=(1, 0.5)),
        ]
        return [choices[k] for k in rng.permutation(len(choices))]

    def add_driven_robots(self, rng):
        """Add robots of some designs and groups, and what drives them."""
        chosen = self.drawn_arbiters(rng)
        battery = float(rng.choice([0.0, 0.0, 60.0]))
        design = replace(AGENT9, name="one", battery=battery)
        self.add_robots(design, int(rng.integers(2, 6)))
        if rng.random() < 0.4:
            self.add_robots(design, 2, group="scouts")
            self.control = {"scouts": chosen[1], design: chosen[0]}
        else:
            self.control = chosen[0]

    def step(self):
        for agent in list(self.agents_by_type.get(Wolf, ())):
            agent.step()
        super().step()
        if "n" in self.state:
            self.state["n"] += self.collisions
        if "rain" in self.fields:
            self.fields["rain"].deposit(tuple(self.rng.uniform(50, 500, 2)), 1.0)
        if self.draw % 3 == 0 and self.steps % 12 == 0:
            self.change_itself()

    def change_itself(self):
        """Let a robot come and go, and another fail."""
        if len(self.robots) > 2:
            self.robots[0].remove()
        design = self.robots[0].design
        self.add_robots(design, 1)
        self.robots[0].fail("sensor", index=0)
