"""Parameters of layers: their documented defaults and ranges, of which both ends are permitted and nothing beyond."""

import math
import sys

import numpy as np
import pytest

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import (
    Align,
    Avoid,
    Cohere,
    Cruise,
    Explore,
    Follow,
    Gather,
    HeadOn,
    Lead,
    MatchVelocity,
    Perimeter,
    Push,
    Respond,
    Separate,
    Subsumption,
    VectorSum,
)
from mesa_swarm.control.arbiter import name_driver

ABOVE_0, FAR, LARGEST = math.ulp(0.0), 1e6, sys.float_info.max
NUMBERS = [
    (Align, "memory", 10, 1.0, FAR),
    (Align, "jump", 15, ABOVE_0, LARGEST),
    (Avoid, "distance", 15, 0.0, FAR),
    (Cohere, "distance", 40, ABOVE_0, FAR),
    (Cruise, "speed", 0.7, 0.0, 1.0),
    (Explore, "speed", 1, 0.0, 1.0),
    (Explore, "turn_interval", 0, 0, 2**31 - 1),
    (Explore, "largest_turn_degrees", 180, 0.0, 180.0),
    (Follow, "critical_angle_degrees", 10, 0.0, 180.0),
    (Follow, "gap", 15, 0.0, FAR),
    (Follow, "chase_speed", 1, 0.0, 1.0),
    (Follow, "cruise_speed", 0.7, 0.0, 1.0),
    (Gather, "critical_angle_degrees", 10, 0.0, 180.0),
    (Gather, "stop_distance", 20, 0.0, FAR),
    (HeadOn, "distance", 30, 0.0, FAR),
    (HeadOn, "slowest", 0.1, ABOVE_0, 1.0),
    (HeadOn, "margin", 0.25, 0.0, 2.0),
    (HeadOn, "parting", 1, ABOVE_0, FAR),
    (HeadOn, "tolerance", 6, ABOVE_0, FAR),
    (Lead, "speed", 0.3, 0.0, 1.0),
    (MatchVelocity, "memory", 20, 1.0, FAR),
    (MatchVelocity, "jump", 15, ABOVE_0, LARGEST),
    (MatchVelocity, "slowest", 0.1, 0.0, 1.0),
    (Perimeter, "ring", 40, 0.0, FAR),
    (Perimeter, "tolerance", 4, 0.0, FAR),
    (Perimeter, "critical_angle_degrees", 15, 0.0, 180.0),
    (Push, "clearance", 20, 0.0, FAR),
    (Push, "critical_angle_degrees", 20, 0.0, 180.0),
    (Respond, "near", 60, 0.0, FAR),
    (Respond, "critical_angle_degrees", 10, 0.0, 180.0),
    (Separate, "distance", 15, ABOVE_0, FAR),
]


@pytest.mark.parametrize(("layer", "name", "default", "lowest", "highest"), NUMBERS)
def test_both_ends_of_a_range_are_permitted_and_nothing_beyond(layer, name, default, lowest, highest):
    assert getattr(layer(), name) == default
    for value in (lowest, highest):
        assert getattr(layer(**{name: value}), name) == value
    whole = isinstance(lowest, int)
    for value, side in ((lowest, -1), (highest, 1)):
        beyond = value + side if whole else math.nextafter(value, side * math.inf)
        with pytest.raises(InvalidValueError, match=f"{name} is"):
            layer(**{name: beyond})


def test_an_arbiter_has_1_to_64_layers():
    assert len(Subsumption(*[Explore()] * 64).layers) == 64
    for count in (0, 65):
        with pytest.raises(InvalidValueError, match=rf"^Subsumption has {count} layers; expected 1 to 64$"):
            Subsumption(*[Explore()] * count)


def test_weights_are_1_each_by_default_and_at_most_a_million_either_way():
    assert VectorSum(Avoid(), Explore()).weights == (1.0, 1.0)
    assert VectorSum(Avoid(), Explore(), weights=(-1e6, 1e6)).weights == (-1e6, 1e6)
    assert VectorSum(Avoid(), Explore(), weights=np.array([0, 2])).weights == (0.0, 2.0)
    for wrong in ((-1.000001e6, 0), (0, 1.000001e6), np.ones((2, 1)), {1.0, 2.0}, {1: 2, 3: 4}):
        with pytest.raises(InvalidValueError, match="weight"):
            VectorSum(Avoid(), Explore(), weights=wrong)


def test_the_first_layer_and_the_last_are_described_by_their_names():
    control = Subsumption(Avoid(), Explore())
    assert [name_driver(control, k) for k in (-2, -1, 0, 1, 2)] == [
        "no layer", "no layer", "Avoid", "Explore", "unknown layer 2",
    ]  # fmt: skip


class Part:
    """A layer without what makes one."""

    name = "Part"


class Decides(Part):
    def decide(self, senses, command, layer, index): ...


class Binds(Part):
    def bind(self, swarm, prefix, rng): ...


@pytest.mark.parametrize("part", [Part(), Decides(), Binds()])
def test_a_layer_needs_both_of_its_methods(part):
    with pytest.raises(InvalidValueError, match="expected layers such as"):
        Subsumption(Explore(), part)
