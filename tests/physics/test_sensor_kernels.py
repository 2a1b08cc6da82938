"""Sensors with a function of arrays are read in compiled calls of many steps, as in Python."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from mesa_swarm import AGENT9, Part, Sensor, SwarmModel, process
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.errors import BehaviourError, UnknownNameError
from mesa_swarm.kernels.part import Column


@dataclass(frozen=True, kw_only=True)
class Compass(Sensor):
    """The heading times a factor, and whether something was touched."""

    name: str = "compass"
    width: int = 2
    factor: float = 2.0

    @staticmethod
    def read(heading, collided, factor, out):
        for i in range(len(out)):
            out[i, 0], out[i, 1] = factor * heading[i], collided[i]


@dataclass(frozen=True, kw_only=True)
class Clock(Sensor):
    """What a process and a part remember."""

    name: str = "clock"
    width: int = 2

    @staticmethod
    def read(count_steps, weather_wet, out):
        out[:, 0], out[:, 1] = count_steps[0], weather_wet[0]


@dataclass(frozen=True, kw_only=True)
class Broken(Sensor):
    """Reads what is not there, from some step on."""

    name: str = "broken"

    @staticmethod
    def read(count_steps, rows, out):
        out[:, 0] = rows[int(1000 * (count_steps[0] > 4))]


@process(memory={"steps": 0.0})
def count(steps):
    steps[0] += 1


class Weather(Part):
    name = "weather"

    def __init__(self):
        self.wet = np.full(1, 7.0)

    def columns(self):
        return {"wet": Column(self.wet)}


def world(*designs, n=4):
    model = SwarmModel(rng=1)
    model.add_part(Weather())
    model.add_process(count)
    for design in designs:
        model.add_robots(design, n)
    model.control = Subsumption(Avoid(distance=12), Explore())
    return model


def with_sensors(*sensors, name="robot"):
    return replace(AGENT9, name=name, sensors=(*AGENT9.sensors, *sensors))


@pytest.mark.parametrize("designs", [
    [with_sensors(Compass())],
    [with_sensors(Compass(), name="one"), AGENT9],
    [with_sensors(Compass(factor=3.0), name="one"), AGENT9, with_sensors(Clock(), Compass(), name="two")],
])  # fmt: skip
def test_readings_are_those_of_single_steps(designs):
    driven, single = world(*designs).run(40), world(*designs)
    assert "Python" not in str(driven.plan)
    for _ in range(40):
        single.step()
    assert driven.state_hash() == single.state_hash()
    assert np.array_equal(driven.swarm.columns["compass"], single.swarm.columns["compass"], equal_nan=True)
    driven.sense()
    factor = [2.0 if design.name != "one" or len(designs) < 3 else 3.0 for design in driven.swarm.designs]
    rows = ~np.isnan(driven.swarm.columns["compass"][:, 0])
    expected = np.array(factor)[driven.swarm.design] * driven.swarm.heading
    assert driven.swarm.columns["compass"][rows, 0].tolist() == expected[rows].tolist()


def test_a_sensor_reads_what_a_process_and_a_part_have():
    model = world(with_sensors(Clock())).run(6)
    model.sense()
    assert model.swarm.columns["clock"][0].tolist() == [6.0, 7.0]


def test_an_error_of_a_sensor_names_it_and_the_step():
    with pytest.raises(BehaviourError, match="sensor broken failed in step 6: it raised IndexError"):
        world(with_sensors(Broken())).run(20)


def test_what_no_part_and_no_process_has_is_refused_at_the_first_reading():
    model = SwarmModel(rng=1)
    model.add_robots(with_sensors(Clock()), 1)
    with pytest.raises(UnknownNameError, match=r"unknown parameter of Clock.read 'count_steps'"):
        model.step()
