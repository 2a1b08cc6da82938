"""Policies of every family that can be exported: with and without memory, kinds, several sets of weights."""

import numpy as np

from mesa_swarm import AGENT9
from mesa_swarm.learning import Networks, QPolicy, ReflexPolicy, SensorLayout, WirePolicy
from mesa_swarm.learning.reflex_policy import rows_of

NINE = SensorLayout.of(AGENT9)


def reflex(units, squash, encoding="distance", copies=1):
    rng, rows = np.random.default_rng(5), rows_of(NINE, units, encoding)
    hidden, wheel = rng.normal(size=(copies, rows, units)), rng.normal(size=(copies, rows, 2))
    return ReflexPolicy(sensors=NINE, hidden=hidden, wheel=wheel, squash=squash, encoding=encoding, steps=1)


def wires(count, encoding="distance", copies=1):
    width = 9 * (4 if encoding == "typed" else 1)
    networks = Networks.random(3 * count * copies, inputs=width, hidden=7, rng=np.random.default_rng(6))
    return WirePolicy(sensors=NINE, networks=networks, wires=count, encoding=encoding, steps=1)


def q(actions, encoding="distance", copies=1):
    rng, more = np.random.default_rng(7), {"temperature": 0.05, "steps": 1}
    return QPolicy.untrained(AGENT9, rng=rng, actions=actions, encoding=encoding, copies=copies, **more)


POLICIES = {
    "Q of 4 actions": q(4),
    "Q of 8 actions, typed, of 3 robots": q(8, "typed", copies=3),
    "a reflex": reflex(0, "linear"),
    "a reflex of 2 robots, typed": reflex(0, "threshold", "typed", copies=2),
    "a recurrent network": reflex(3, "tanh"),
    "a recurrent network of 2 robots, typed": reflex(4, "linear", "typed", copies=2),
    "wires": wires(4),
    "wires of 2 robots, typed": wires(8, "typed", copies=2),
}


def in_python(policy, readings, kinds, chance, numbers=None):
    """Return wheel commands and memory."""
    memory = np.zeros((len(readings), getattr(policy, "memory", 0)))
    more = (memory,) if memory.size else ()
    return policy.act(readings, kinds, chance, *more, numbers=numbers), memory
