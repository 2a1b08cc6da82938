"""Worlds in which robots push loads about doors that a process sends, in compiled code."""

import math

from mesa_swarm import AGENT9, Map, SwarmModel, disc, process, rectangle
from mesa_swarm.control import Explore, Subsumption


@process
def swing(bodies_aim, bodies_aim_heading, bodies_kind, step, sliding=-1, turning=-1, reach=40.0, turn=0.03):
    """Let doors of one kind slide up and down, and those of another turn, back and forth."""
    for b in range(len(bodies_kind)):
        if bodies_kind[b] == sliding:
            bodies_aim[b, 1] = 90.0 - reach * math.cos(0.02 * step)
        if bodies_kind[b] == turning:
            bodies_aim_heading[b] += turn if step % 400 < 250 else -turn


def with_swinging_doors(seed, **named):
    """Return a narrow world in which loads are pushed into the ways of a door that slides, and of one that turns."""
    model = SwarmModel(map=Map(bounds=(0, 0, 220, 180)), rng=seed, **named)
    for place in ((140, 40), (101, 112), (62, 104)):
        model.add_load(disc(place, 7), resistance=0.4)
    model.add_load(rectangle((180, 80), (195, 90)), resistance=0.7)
    model.add_body(rectangle((98, 30), (103, 70)), kind="gate")
    model.add_body(rectangle((40, 118), (80, 122)), kind="vane")
    model.add_process(swing(sliding=model.kind_code("gate"), turning=model.kind_code("vane")))
    model.add_robots(AGENT9.with_slip(probability=0.2, magnitude=0.5), 40)
    model.control = Subsumption(Explore())
    return model


def with_a_long_load(seed):
    """Return a narrow world with a load that is nearly as long as the world is wide, and turns as robots push it."""
    model = SwarmModel(map=Map(bounds=(0, 0, 90, 60)), rng=seed)
    model.add_load(rectangle((4, 28.5), (54, 31.5)), resistance=0.1)
    model.add_robots(AGENT9, 8)
    model.control = Subsumption(Explore(turn_interval=80))
    return model
