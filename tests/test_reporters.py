"""Reporters that measure now and then."""

import pytest

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.models.agglomeration import Agglomeration
from mesa_swarm.reporters import Held, held


def test_what_is_collected_is_measured_every_so_many_steps_and_held_in_between():
    model = Agglomeration(n_robots=20, rng=1)
    measured = {}
    for _ in range(35):
        model.step()
        if model.steps % 10 == 0 or model.steps == 1:
            measured[model.steps] = model.neighbour_distance
    collected = model.datacollector.model_vars["neighbour_distance"]
    assert len(collected) == 35
    assert [collected[step - 1] for step in measured] == list(measured.values())
    assert len(set(collected)) == len(measured)


def test_every_model_has_reporters_of_its_own():
    first, second = held("groups")["groups"], held("groups")["groups"]
    assert first is not second


def test_an_interval_of_nothing_is_refused():
    with pytest.raises(InvalidValueError, match="every is 0"):
        Held("groups", every=0)
