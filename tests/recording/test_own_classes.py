"""Resuming what no constructor makes: robots with custom parts, of classes in the model's own module."""

from dataclasses import dataclass

import pytest
from mesa import Agent

from mesa_swarm import AGENT9, Actuator, RobotDesign, Sensor, SwarmModel
from mesa_swarm.base.errors import RecordingError
from mesa_swarm.recording.checkpoint import checkpoint_of, restore
from mesa_swarm.recording.made_objects import is_class


@dataclass(frozen=True, kw_only=True)
class Compass(Sensor):
    name: str = "compass"
    gain: float = 1.0

    @staticmethod
    def read(heading, gain, out):
        for i in range(len(out)):
            out[i, 0] = heading[i] * gain


@dataclass(frozen=True, kw_only=True)
class Horn(Actuator):
    name: str = "horn"


class Guest(Agent):
    """An agent that comes later, and may be made without its constructor."""

    resumable = True
    mood: str


class Empty(SwarmModel):
    """A model whose user adds everything."""


def filled():
    model = Empty(rng=1)
    model.add_robots(AGENT9, 2)
    model.add_robots(RobotDesign(name="own", sensors=(Compass(gain=2.0),), actuators=(Horn(),)), 3)
    Guest(model).mood = "fine"
    return model.run(3)


def test_robots_with_custom_parts_that_no_constructor_adds_are_made_again(tmp_path):
    model = filled()
    with model.record(tmp_path / "run.arrow"):
        model.run(4)
    again = Empty.resume(tmp_path / "run.arrow")
    assert again.swarm.designs == model.swarm.designs
    assert again.state_hash() == model.state_hash()
    assert [agent.mood for agent in again.agents if isinstance(agent, Guest)] == ["fine"]
    assert again.run(3).state_hash() == model.run(3).state_hash()


def test_a_part_of_elsewhere_is_refused_in_one_line_with_what_to_do():
    @dataclass(frozen=True, kw_only=True)
    class Nose(Compass):
        name: str = "nose"

    model = Empty(rng=1)
    model.add_robots(RobotDesign(sensors=(Nose(),)), 1)
    with pytest.raises(RecordingError, match=r"custom part .*Nose.* in its constructor, or has its class in its own"):
        restore(Empty(rng=1), checkpoint_of(model))


def test_a_class_is_known_again_where_its_file_was_run_as_a_program_or_loaded_by_its_path():
    assert is_class(Guest, Guest.__module__, "Guest")
    assert is_class(Guest, "__main__", "Guest")
    assert is_class(Guest, "test_own_classes_0123abcd", "Guest")
    assert not is_class(Guest, "elsewhere", "Guest")
    assert not is_class(Guest, Guest.__module__, "Host")
