"""A world with nearly all that can be recorded, of which a recording is stored.

It is small, and its class is at the address that the recording names: leave both as they are.
"""

import math
from dataclasses import replace

import numpy as np

from mesa_swarm import (
    AGENT9,
    Carried,
    Emitter,
    Field,
    FieldSensor,
    Gripper,
    Lamp,
    Map,
    NeighbourSensor,
    Radio,
    SwarmModel,
    disc,
    rectangle,
    scatter,
)
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.robots.imperfections import MEASURED
from support.bit_parts import Ledger, Tide, grips, rams, smells, talks

WALLS = rectangle((95, 0), (100, 60)), disc((40.0, 130.0), 8.0)
ARENA = Map(name="arena", bounds=(0.0, 0.0, 200.0, 160.0), obstacles=WALLS)


class StoredWorld(SwarmModel):
    """Robots that push, carry, smell and talk, with doors, bodies that wander, errors, events and processes."""

    def __init__(self, *, n_robots: int = 2, rng=None):
        super().__init__(map=ARENA, rng=rng, model_reporters={"doors": "doors"}, agent_reporters={"id": "unique_id"})
        self.state.update(steps=0, history=np.zeros(3))
        self.add_bodies_and_fields()
        self.communication = Radio(
            range=90, message={"value": 1, "pair": 2}, most=2, loss_probability=0.2, beacons=((10.0, 10.0),)
        )
        self.add_all_robots(n_robots)
        self.imperfections = replace(MEASURED, failure=0.002, sensor_failure=0.002, battery=300.0)
        self.add_process(Tide())
        self.add_process(Ledger())

    def add_bodies_and_fields(self):
        """Add loads, a door, pucks, bodies that wander, and a field."""
        self.add_load(disc((150.0, 40.0), 8.0), resistance=0.3)
        self.add_load(rectangle((140, 100), (160, 112)), resistance=0.2)
        self.add_body(rectangle((95, 62), (100, 90)), kind="door")
        for k in range(4):
            self.add_body(disc((30.0 + 12.0 * k, 60.0), 3.0), kind="puck")
        scatter(self, 2, size=6.0, gap=4.0, speed=0.5)
        self.add_field(Field("trail", cell=40.0, diffusion=9.0, evaporation=0.02))

    def add_all_robots(self, n):
        """Add robots that carry pucks, talkers that leave trails, and robots that push loads."""
        gripper = Gripper(kinds=("puck",), reach=8.0, field_of_view_degrees=180)
        noses = [
            FieldSensor(field="trail", name=f"{side}_nose", mount=(5, y)) for side, y in (("left", 4), ("right", -4))
        ]
        carrier = replace(AGENT9, name="carrier", sensors=(*AGENT9.sensors, Carried()), actuators=(gripper,))
        senses = (*AGENT9.sensors, *noses, NeighbourSensor(range=80, k=1, lamp=True))
        talker = replace(AGENT9, name="talker", sensors=senses, actuators=(Emitter(field="trail"), Lamp()))
        self.add_robots(carrier, poses=[(25.0 + 14.0 * k, 52.0, 1.5) for k in range(n)])
        self.add_robots(talker, n)
        self.add_robots(AGENT9, poses=[(136.0, 40.0, 0.0), (150.0, 26.0, 1.6), (145.0, 94.0, 1.6)])
        self.control = {
            carrier: Subsumption(grips, Avoid(), Explore()),
            talker: Subsumption(talks, smells, Explore()),
            AGENT9: Subsumption(rams(often=0.01)),
        }

    @property
    def doors(self) -> float:
        """Where the door is."""
        return float(self.movers.position[0, 1])

    def step(self):
        """Ask for the door's next place, take a step, and count."""
        door = self.movers.agents[0]
        door.position = (97.5, 86.0 - 10.0 * math.cos(0.1 * self.completed))
        super().step()
        self.state["steps"] += 1
        self.state["history"][self.completed % 3] += self.streams["mine"].random()
        if self.completed % 5 == 0:
            self.event("counted", robot=self.robots[self.completed % len(self.robots)], value=self.state["steps"])
