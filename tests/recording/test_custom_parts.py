"""Recordings of models with custom sensors, actuators, messages and memory."""

from dataclasses import dataclass

import numpy as np
import pytest

from mesa_swarm import AGENT9, Lamp, NeighbourSensor, Radio, Recording, RobotDesign, Sensor, SwarmModel
from mesa_swarm.control import Subsumption, behaviour

COLUMNS = ("position", "compass", "neighbour", "0.turns.count", "heard.n", "heard.count", "send.count", "act.lamp")


@dataclass(frozen=True, kw_only=True)
class Compass(Sensor):
    name: str = "compass"

    @staticmethod
    def read(heading, out):
        for i in range(len(out)):
            out[i, 0] = heading[i]


@behaviour(memory={"count": 0})
def turns(me):
    me.memory.count += 1
    me.act.lamp = me.memory.count
    me.send.count = me.memory.count + me.heard.n
    return 1.0, 0.5 if me.compass[0] > 0 else 0.8


DESIGN = RobotDesign(sensors=(*AGENT9.sensors, Compass(), NeighbourSensor(lamp=True)), actuators=(Lamp(),))


class Turning(SwarmModel):
    def __init__(self, rng=None):
        super().__init__(rng=rng, communication=Radio(message=["count"]))
        self.add_robots(DESIGN, 6)
        self.control = Subsumption(turns)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("custom") / "run.swarm"
    model = Turning(rng=1)
    with model.record(path, columns=COLUMNS):
        model.run(20)
    return path, model


@pytest.mark.slow
def test_such_a_run_is_recorded_verified_and_resumed(recorded):
    path, model = recorded
    recording = Recording(path)
    assert {name: recording[name].shape[2:] for name in COLUMNS[1:4]} == {
        "compass": (1,),
        "neighbour": (12,),
        "0.turns.count": (),
    }
    np.testing.assert_array_equal(recording["act.lamp"][-1], model.swarm.columns["act.lamp"])
    assert recording.checkpoints
    assert Turning.verify(path)
    resumed = Turning.resume(path)
    assert resumed.state_hash() == model.state_hash()
    again = Turning(rng=1).run(25)
    assert resumed.run(5).state_hash() == again.state_hash()
