"""Rules, sensors, actuators, processes and agents of the worlds whose bits are stored; see `same_bits`.

All of it uses public names only, so that it runs with the code of other versions as well.
"""

import math
from dataclasses import dataclass

import mesa
import numpy as np
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm import Actuator, Process, Sensor, SwarmModel
from mesa_swarm.control import PASS, behaviour


@behaviour(memory={"left": 0, "side": 1.0})
def rams(me, often=0.02):
    """Drive straight on, into whatever is there, and turn on the spot now and then."""
    if me.memory.left == 0 and me.chance < often:
        me.memory.left = 3 + int(me.chance * 1e6) % 25
        me.memory.side = 1.0 if me.chance < 0.5 * often else -1.0
    if me.memory.left > 0:
        me.memory.left -= 1
        return -me.memory.side * 0.5 * me.max_speed, me.memory.side * 0.5 * me.max_speed
    return me.max_speed, me.max_speed


@behaviour
def ploughs(me, aside=0.1):
    """Drive at what is nearest, a little to one side of it."""
    nearest = -1
    for s in range(len(me.distance)):
        if me.kind[s] >= 0 and (nearest < 0 or me.distance[s] < me.distance[nearest]):
            nearest = s
    if nearest < 0:
        return PASS
    turn = max(-1.0, min(1.0, me.bearing[nearest] + aside * (me.chance - 0.5)))
    return me.max_speed * (1.0 - max(0.0, turn)), me.max_speed * (1.0 + min(0.0, turn))


@behaviour(memory={"n": 0, "left": 0.0, "last": [0.0, 0.0, 0.0]})
def remembers(me, every=7):
    """Turn now and then, by a difference of speeds that is remembered and fades."""
    me.memory.n += 1
    me.memory.last[me.memory.n % 3] = me.chance
    if me.memory.n % every == 0:
        me.memory.left = me.memory.last[0] - me.memory.last[1]
    if abs(me.memory.left) > 0.1:
        me.memory.left *= 0.8
        return me.max_speed * me.memory.left, -me.max_speed * me.memory.left
    return PASS


@behaviour
def grips(me):
    """Grip what is ahead, and put it down by chance."""
    me.act.grip = 1.0 if me.chance < 0.97 else 0.0
    return PASS


@behaviour
def smells(me):
    """Leave a trail, and turn to the side on which it smells more."""
    me.act.trail = 1.0
    difference = me.left_nose[0] - me.right_nose[0]
    if abs(difference) > 1e-3:
        turn = 0.3 if difference > 0 else -0.3
        return me.max_speed * (0.7 - turn), me.max_speed * (0.7 + turn)
    return PASS


@behaviour(memory={"best": 0.0})
def talks(me):
    """Send numbers, light the lamp, and turn to the nearest neighbour when a large number was heard."""
    me.send.value = me.chance
    me.send.pair[0] = me.memory.best
    me.send.pair[1] = me.max_speed
    for j in range(me.heard.n):
        me.memory.best = max(0.999 * me.memory.best, me.heard.value[j])
    me.act.lamp = me.memory.best
    if me.memory.best > 0.9 and me.neighbour[0] < 60.0 and me.neighbour[2] < 0.95:
        turn = max(-1.0, min(1.0, me.neighbour[1]))
        return me.max_speed * (1.0 - max(0.0, turn)), me.max_speed * (1.0 + min(0.0, turn))
    return PASS


@behaviour
def flees(me):
    """Turn away from the nearest wolf and the nearest robot."""
    if me.wolf[0] < 60.0:
        turn = 0.5 if me.wolf[1] < 0.0 else -0.5
        return me.max_speed * (0.5 - turn), me.max_speed * (0.5 + turn)
    if me.neighbour[0] < 15.0:
        return me.max_speed, 0.2 * me.max_speed
    return PASS


@behaviour(memory={"phase": 0.0})
def whirls(me):
    """Set three wheels in a rhythm with some chance."""
    me.memory.phase += 0.05 + 0.05 * me.chance
    speed = me.max_speed
    return speed * math.sin(me.memory.phase), speed * math.cos(me.memory.phase), speed * (me.chance - 0.4)


@behaviour(memory={"ahead": 1.0, "aside": 0.0})
def floats(me):
    """Move in any direction, which changes by chance."""
    if me.chance < 0.05:
        me.memory.ahead, me.memory.aside = 2.0 * me.chance * 20.0 - 1.0, 1.0 - me.chance * 25.0
    return me.max_speed * me.memory.ahead, me.max_speed * me.memory.aside


@behaviour
def steers(me):
    """Turn until the compass points east, spray on lines, and ring."""
    me.act.spray[0] = 1.0 if me.line[0] else 0.0
    me.act.spray[1] = me.chance
    me.act.bell = me.drift[0]
    if me.line[0] and me.chance < 0.5:
        return 0.9 * me.max_speed, 0.3 * me.max_speed
    return (0.5 * me.max_speed, 0.9 * me.max_speed) if me.compass[0] < 0.5 else PASS


@dataclass(frozen=True, kw_only=True, slots=True)
class Compass(Sensor):
    """A sensor of where east and north are."""

    name: str = "compass"
    width: int = 2

    @staticmethod
    def read(heading, out):
        """Write both for each robot."""
        for i in range(len(out)):
            out[i, 0], out[i, 1] = math.cos(heading[i]), math.sin(heading[i])


@dataclass(frozen=True, kw_only=True, slots=True)
class Drift(Sensor):
    """A sensor of how far robots are from where it drifts to, a number that the model has."""

    name: str = "drift"

    def arguments(self, model):
        """Return the place."""
        return {"middle": np.array([100.0 + 0.1 * model.completed, 90.0])}

    @staticmethod
    def read(position, middle, out):
        """Write the distance for each robot."""
        for i in range(len(out)):
            out[i, 0] = abs(position[i, 0] - middle[0]) + abs(position[i, 1] - middle[1])


@dataclass(frozen=True, kw_only=True)
class Spray(Actuator):
    """An actuator of two numbers, which the model adds up."""

    name: str = "spray"
    width: int = 2

    def apply(self, model, rows):
        """Add up what was set."""
        model.state["sprayed"] = model.state["sprayed"] + model.swarm.columns["act.spray"][rows].sum(axis=0)


@dataclass(frozen=True, kw_only=True)
class Bell(Actuator):
    """An actuator whose strokes the model adds up, by a function that is compiled."""

    name: str = "bell"

    def arguments(self, model):
        """Return where they are added up."""
        return {"rung": model.state["rung"]}

    @staticmethod
    def act(value, rows, rung):
        """Add them for each robot in these rows."""
        for i in range(len(rows)):
            rung[rows[i]] += value[i]


class Weary:
    """A custom layer, with a number for each robot, that rests robots at random times."""

    name = "Weary"

    def __init__(self, limit):
        self.limit = limit

    def bind(self, swarm, prefix, rng):
        """Make the column."""
        self.rng, self.swarm, self.column = rng, swarm, f"{prefix}.tired"
        swarm.remember(self.column, (), np.float64, 0.0)

    def decide(self, senses, command, layer, index):
        """Let the tired rest."""
        tired = self.swarm.columns[self.column]
        tired += self.rng.random(len(tired)) * (layer < 0)
        rests = (tired > self.limit) & (layer < 0)
        tired[rests] = 0.0
        command[rests], layer[rests] = 0.0, index


class Tide(Process):
    """A process that moves a level up and down at random, and reports floods."""

    level: float = 0.0
    floods: int = 0
    gain: float = 0.1

    def __init__(self, gain=0.1):
        self.gain = gain

    def step(self, model):
        """Rise, and fall when it is high."""
        self.level = (self.level + self.gain * model.streams["tide"].random()) % 1.0
        if self.level > 0.9:
            self.floods += 1
            model.event("flood", value=self.level)


class Ledger(Process):
    """A process with a state that only its own methods store, which turns a robot now and then."""

    resumable = True

    def __init__(self):
        self._rows = {}

    def step(self, model):
        """Add a row; turn the first robot at every eleventh."""
        self._rows[len(self._rows)] = object()
        if len(self._rows) % 11 == 0:
            model.robots[0].heading = 0.1 * (len(self._rows) % 30)

    def checkpoint(self):
        """Return what a later step depends on."""
        return {"rows": len(self._rows)}

    def restore(self, state):
        """Take it back."""
        self._rows = {k: object() for k in range(state["rows"])}


class Wolf(ContinuousSpaceAgent):
    """An agent of Mesa's that walks about, and that a body follows."""

    heading: float = 0.0
    meals: int = 0

    def __init__(self, model, place):
        super().__init__(model.space, model)
        self.position = place

    def step(self):
        """Turn at random, and walk where it is not near the edge."""
        self.heading = float(self.heading + self.model.rng.uniform(-0.5, 0.5))
        way = 0.6 * np.array([np.cos(self.heading), np.sin(self.heading)])
        if self.model.space.in_bounds(self.position + 20 * way):
            self.position += way
        self.meals += self.model.collisions


class Kite(mesa.Agent):
    """An agent of Mesa's with a `pos` and without a heading, that goes to and fro."""

    def __init__(self, model, place):
        super().__init__(model)
        self.start, self.pos = place, place

    def step(self):
        """Go to and fro."""
        x, y = self.start
        self.pos = (x + 25.0 * math.sin(0.03 * self.model.steps), y)


class Planned(SwarmModel):
    """A model to which things happen before its steps, by their numbers or in each; it reports a few numbers."""

    def __init__(self, **named):
        super().__init__(
            **{"map": "openspace", **named},
            model_reporters={"x": sum_of_positions, "completed": "completed"},
            agent_reporters={"kind": kind_of, "id": "unique_id"},
        )
        self.plan, self.each = {}, ()

    def step(self):
        """Let happen what is planned, and take a step."""
        for change in (*self.each, *self.plan.get(self.completed, ())):
            change(self)
        super().step()


def sum_of_positions(model):
    return float(model.swarm.position.sum())


def kind_of(agent):
    return type(agent).__name__
