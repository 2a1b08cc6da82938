"""Kernels of layers: every layer has one, and those that draw random numbers do as NumPy's generator draws them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import AGENT_FIRE, HolonomicDrive, Radio, SwarmModel
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import (
    Align,
    Approach,
    Avoid,
    Cohere,
    Cruise,
    Explore,
    Follow,
    Gather,
    Halt,
    HeadOn,
    Lead,
    MatchVelocity,
    Perimeter,
    Push,
    Respond,
    Retreat,
    Separate,
    Subsumption,
)
from mesa_swarm.control.explore import count_down, turn_on_the_spot
from mesa_swarm.control.head_on import meet_head_on
from mesa_swarm.control.layer import find_nearest_ahead
from mesa_swarm.fire import FightFire, SeekHeat
from mesa_swarm.kernels.elementary import exp, log
from support.kernels import assert_equal_columns, columns_after, decides_by

WHEELED = (
    Approach(target="heat"), Retreat(), Avoid(), Avoid(front="random"), Avoid(front="back up"), Explore(),
    Explore(turn_interval=5), FightFire(), SeekHeat(), Follow(), Gather(), Halt(), HeadOn(), HeadOn(leader="number"),
    HeadOn(leader="chain"), Lead(), MatchVelocity(), Perimeter(), Push(), Respond(),
)  # fmt: skip
SIDEWAYS = (Align(), Cohere(), Cruise(), Separate())


def crowd(control, n=40, **arguments):
    model = SwarmModel(map="openspace_fire", rng=2, **arguments)
    model.add_robots(AGENT_FIRE, n)
    model.control = control
    return model


@pytest.mark.parametrize("layer", WHEELED, ids=repr)
def test_each_layer_has_a_kernel(layer):
    messages = {"HeadOn": ("number", "follows"), "Lead": ("rank",)}.get(layer.name, ())
    model = crowd(Subsumption(layer), n=3, communication=Radio(range=50, message=messages))
    assert decides_by(model.run(2)).kernel is not None
    assert "Python" not in next(line for line in str(model.plan).splitlines() if "layers decide" in line)


@pytest.mark.parametrize("layer", SIDEWAYS, ids=repr)
def test_each_layer_that_commands_sideways_has_a_kernel(layer):
    model = SwarmModel(rng=2)
    model.add_robots(replace(AGENT_FIRE, drive=HolonomicDrive()), 3)
    model.control = Subsumption(layer)
    assert decides_by(model.run(2)).kernel is not None


@pytest.mark.parametrize(("layer", "words"), [(Lead(), "Lead compares ranks"), (HeadOn(leader="chain"), "HeadOn dec")])
def test_a_layer_that_lacks_messages_has_no_kernel_and_names_them_in_the_first_step(layer, words):
    model = crowd(Subsumption(layer), n=3)
    assert decides_by(model).kernel is None
    with pytest.raises(InvalidValueError, match=words):
        model.step()


class PlainExplore(Explore):
    """Turns of all robots drawn at once by NumPy."""

    def decide(self, senses, command, layer, index):
        columns, largest = self._swarm.columns, math.radians(self.largest_turn_degrees)
        straight, turn = columns[f"{self._prefix}.straight"], columns[f"{self._prefix}.turn"]
        count_down(straight, turn, self._rng.uniform(-largest, largest, len(layer)), self.turn_interval, layer)
        turn_on_the_spot(turn, senses.radius, senses.max_speed, command, layer, index)
        go = layer < 0
        command[go] = (self.speed * senses.max_speed[go])[:, None]
        layer[go] = index


class PlainAvoid(Avoid):
    """Sides of all robots drawn at once by NumPy."""

    def decide(self, senses, command, layer, index):
        sides = np.where(self._rng.random(len(layer)) < 0.5, 1.0, -1.0)
        Avoid(distance=self.distance).decide(replace(senses, tendency=sides), command, layer, index)


class PlainHeadOn(HeadOn):
    """Speeds of all robots drawn at once by NumPy."""

    def decide(self, senses, command, layer, index):
        nearest = np.empty(len(layer), np.int64)
        find_nearest_ahead(senses.distance, senses.kind, senses.bearing, senses.design, nearest)
        memory = [self._swarm.columns[f"{self._prefix}.{name}"] for name in ("front", "least", "speed", "left")]
        draws = np.array([exp(number * log(self.slowest)) for number in self._rng.random(len(layer))])
        meet_head_on(
            nearest, senses.distance, senses.kind, senses.design, senses.forward, senses.last_command,
            senses.max_speed, senses.radius, senses.tendency, draws, self.distance, self.margin, self.parting, *memory,
            command, layer, index,
        )  # fmt: skip


PLAIN = {
    "turns": (Subsumption(Avoid(), Explore(turn_interval=9)), Subsumption(Avoid(), PlainExplore(turn_interval=9))),
    "sides": (Subsumption(Avoid(front="random"), Explore()), Subsumption(PlainAvoid(front="random"), Explore())),
    "speeds": (Subsumption(HeadOn(), Avoid(), Explore()), Subsumption(PlainHeadOn(), Avoid(), Explore())),
}


@pytest.mark.parametrize(("control", "plain"), PLAIN.values(), ids=PLAIN)
def test_kernels_draw_the_numbers_that_numpys_generator_draws_for_all_robots_in_each_step(control, plain):
    models = crowd(control, n=60), crowd(plain, n=60)
    assert [decides_by(model).kernel is None for model in models] == [False, True]
    assert_equal_columns(*map(columns_after, models))
    drawing = f"decide.{next(layer.name for layer in plain.layers if type(layer).__module__ == __name__)}"
    assert models[0].streams[drawing].random() == models[1].streams[drawing].random()
