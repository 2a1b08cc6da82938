"""Worlds that compiled calls can drive, each with something else in its rows; each function returns a new model."""

import numpy as np

from mesa_swarm import (
    AGENT9,
    AGENT_FIRE,
    Column,
    Field,
    FieldSensor,
    NeighbourSensor,
    Part,
    Phase,
    Previous,
    ProximitySensor,
    RobotDesign,
    Stage,
    SwarmModel,
    disc,
    held,
    process,
    until,
)
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.robots.imperfections import Imperfection, Imperfections


def world(robots=8, design=AGENT9, model_class=SwarmModel, control=None, **parameters):
    model = model_class(rng=5, **parameters)
    model.add_robots(design, robots)
    model.control = control or Subsumption(Avoid(distance=15), Explore(turn_interval=20))
    return model


def plain():
    return world()


def without_robots():
    return world(robots=0)


def pushed_loads():
    model = world(robots=25, map="openspace", control=Subsumption(Explore()))
    for x in (200, 400, 600):
        model.add_load(disc((x, 300), 15), resistance=0.5)
    return model


def sensors_that_err():
    sensors = [
        ProximitySensor(bearing_degrees=bearing, field_of_view_degrees=40, error_probability=0.1, error_magnitude=0.2)
        for bearing in (0, 40, -40)
    ]
    return world(design=RobotDesign(name="erring", sensors=sensors), noise=0.1)


def sensors_that_lag():
    sensors = [
        ProximitySensor(bearing_degrees=bearing, field_of_view_degrees=40, period=3, hold=2, error_probability=0.3)
        for bearing in (0, 40, -40)
    ]
    return world(design=RobotDesign(name="lagging", sensors=sensors))


def imperfect_robots():
    model = world(robots=15, slip=0.2)
    seeing = Imperfection(error=0.1, dropout=0.05, outliers=0.02, hold=3, period=4)
    driving = Imperfection(error=0.05, lag=2.0, hold=2)
    model.imperfections = Imperfections(sensing=seeing, driving=driving, battery=500.0, failure=0.001)
    return model


def robots_that_smell():
    model = SwarmModel(rng=5)
    model.add_field(Field("trail", cell=20.0, diffusion=0.1, evaporation=0.01))
    model.fields["trail"].deposit([(400.0, 300.0)], 50.0)
    sensors = (*AGENT9.sensors, FieldSensor(field="trail"), NeighbourSensor(range=80))
    model.add_robots(RobotDesign(name="smelling", sensors=sensors), 8)
    model.control = Subsumption(Avoid(distance=15), Explore())
    return model


def fires():
    return FireFighting(n_robots=12, rng=5)


def a_lamp():
    model = world(design=AGENT_FIRE)
    model.add_body(disc((300, 300), 20), mode="fixed", kind="lamp", temperature=0.75)
    return model


@process(memory={"t": 0})
def tick(t, temperature):
    t[0] += 1
    for i in range(temperature.shape[0]):
        temperature[i] = 0.001 * t[0]


def a_part_and_a_process():
    model = world()
    model.add_part(Previous("heading", "distance"))
    model.add_process(tick)
    return model


class Bells(Part):
    """Rings after every ninth step, in Python."""

    name = "bells"

    def bind(self, context):
        self.model = context.model
        self.rung = np.zeros(len(context.model.swarm), np.int64)

    def columns(self):
        return {"rung": Column(self.rung, "robots")}

    def stages(self):
        return [Stage(Phase.PROCESS, self.ring, "bells ring", every=9)]

    def ring(self):
        self.rung += 1
        self.model.event("rung", robot=self.model.robots[0], value=float(self.model.completed))
        self.model.event("heard")


class Ringing(SwarmModel):
    def __init__(self, *, rng=None):
        super().__init__(rng=rng, model_reporters=held("least", every=8))

    @property
    def least(self):
        return float(self.swarm.position.min())


def bells():
    model = world(model_class=Ringing)
    model.add_part(Bells())
    return model


class Ending(SwarmModel):
    stops = until("robot_steps", at_least=500)


def an_end():
    return world(model_class=Ending)


def seldom_collected():
    return world(collect_every=10)


# By name; of all but the last, compiled calls take along what is recorded by default.
WORLDS = {
    "plain": plain,
    "no robots": without_robots,
    "pushed loads": pushed_loads,
    "sensors that err": sensors_that_err,
    "sensors that lag": sensors_that_lag,
    "imperfect robots": imperfect_robots,
    "fires": fires,
    "a lamp": a_lamp,
    "a part and a process": a_part_and_a_process,
    "bells": bells,
    "an end": an_end,
    "seldom collected": seldom_collected,
    "robots that smell": robots_that_smell,
}
