"""Rules that tests share, and a robot that faces a disc."""

from mesa_swarm import AGENT9, disc
from mesa_swarm.control import PASS, Subsumption, behaviour
from support.scenes import empty

SEEN = []


@behaviour
def timid(me, distance=20.0):
    """Back away from whatever is ahead."""
    if 0 <= me.distance[me.front] < distance:
        return -me.max_speed, -me.max_speed
    return PASS


def slowly(function):
    """Return the same rule in a form that Numba refuses."""

    def slow(me):
        SEEN.append(f"{me.radius}")
        return function(me)

    return slow


def facing_a_disc():
    model = empty()
    model.add_obstacle(disc((222, 150), 5))
    return model, model.add_robots(AGENT9, poses=[(200, 150, 0.0)])[0]


def step_with(rule):
    """Return a model after one step of a robot in front of a disc."""
    model, _ = facing_a_disc()
    model.control = None if rule is None else Subsumption(rule)
    model.step()
    return model


@behaviour
def wander(me):
    """Drive with each wheel at a random speed of its own."""
    return me.chance, me.chance
