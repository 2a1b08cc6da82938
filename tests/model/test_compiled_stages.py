"""Stages of a part that are functions of arrays: in compiled calls of many steps they have the bits of single ones."""

import numpy as np
import pytest

from mesa_swarm import AGENT9, Column, Part, Phase, SwarmModel, compiled_stage
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.errors import BehaviourError, InvalidValueError, UnknownNameError


def add_ways(command, driven, factor):
    for i in range(len(driven)):
        driven[i] += factor * abs(command[i, 0] + command[i, 1])


def toss(drawn, chance, step):
    drawn[0] += chance
    drawn[1] = step


def go_wrong(driven, step):
    driven[1000 * (step > 3)] = 1.0


def write_to_swarm(position):
    position[0, 0] = 1.0


class Meter(Part):
    name = "meter"

    def __init__(self, function=add_ways, every=1):
        self.function, self.every, self.factor = function, every, 0.5
        self.driven, self.drawn = np.zeros(0), np.zeros(2)

    def bind(self, context):
        self.context = context

    def columns(self):
        return {"driven": Column(self.driven, "robots"), "drawn": Column(self.drawn)}

    def stages(self):
        yield compiled_stage(self.context, self, Phase.PROCESS, self.function, "measures", every=self.every)
        yield compiled_stage(self.context, self, Phase.COLLECT, toss, "draws")

    def store(self):
        return {}


def world(**settings):
    model = SwarmModel(map="sparse", rng=3)
    model.add_part(Meter(**settings))
    model.add_robots(AGENT9, 5)
    model.control = Subsumption(Avoid(distance=12), Explore(turn_interval=9))
    return model


@pytest.mark.parametrize("every", [1, 7])
def test_steps_of_a_run_are_those_that_are_taken_one_by_one(every):
    driven, single = world(every=every).run(60), world(every=every)
    for _ in range(60):
        single.step()
    assert "up to 1000 steps in one compiled call" in str(driven.plan)
    assert driven.state_hash() == single.state_hash()
    assert driven.parts["meter"].driven.sum() > 0


def test_chance_is_drawn_from_the_stream_of_the_part_in_each_step():
    model = world().run(10)
    stream = SwarmModel(map="sparse", rng=3).streams["meter"]
    assert model.parts["meter"].drawn.tolist() == [sum(stream.random(10).tolist()), 10.0]


def test_robots_that_come_later_have_rows():
    model = world().run(5)
    model.add_robots(AGENT9, 2)
    assert len(model.run(5).parts["meter"].driven) == 7


def test_an_error_names_the_stage_and_the_step():
    with pytest.raises(BehaviourError, match=r"measures \(meter\) failed in step 4: it raised IndexError"):
        world(function=go_wrong).run(20)


@pytest.mark.parametrize(("function", "error", "text"), [
    (lambda nowhere: None, UnknownNameError, "unknown parameter of <lambda> 'nowhere'"),
    (write_to_swarm, InvalidValueError, "stage measures of part meter cannot be compiled"),
    ("add", InvalidValueError, "expected a function of arrays"),
])  # fmt: skip
def test_what_cannot_be_a_stage_is_refused_in_one_line(function, error, text):
    with pytest.raises(error, match=text):
        world(function=function).run(1)
