"""Reporters that measure now and then."""

import pickle

import pytest

from mesa_swarm import SwarmModel
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.model.reporters import Held, event_count, event_total, held
from mesa_swarm.models.agglomeration import Agglomeration


def test_what_is_collected_is_measured_when_due_and_held_in_between():
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


@pytest.mark.parametrize(("every", "steps"), [(1, [1, 2, 3, 4, 5, 6, 7]), (3, [3, 6]), (0, [])])
def test_rows_are_collected_after_the_steps_that_the_interval_divides(every, steps):
    model = SwarmModel(rng=1, collect_every=every, model_reporters={"step": "completed"}).run(7)
    assert model.datacollector.model_vars["step"] == steps


def test_what_is_collected_changes_no_bit_of_what_happens():
    hashes = set()
    for every in (1, 7, 0):
        model = Agglomeration(n_robots=5, rng=1)
        model.collect_every = every
        hashes.add(model.run(20).state_hash())
    assert len(hashes) == 1


def test_a_model_that_is_resumed_collects_as_the_recorded_one_did(tmp_path):
    model = Agglomeration(n_robots=5, rng=1)
    model.collect_every = 4
    with model.record(tmp_path / "a.arrow", checkpoint_every=10):
        model.run(10)
    again = Agglomeration.resume(tmp_path / "a.arrow").run(6)
    assert again.collect_every == 4
    model.run(6)
    assert again.datacollector.model_vars == model.datacollector.model_vars
    assert len(again.datacollector.model_vars["groups"]) == 4


def test_events_are_counted_by_reporters_in_copies_and_sweeps_too():
    reporters = {"delivered": event_count("delivered"), "food": event_total("delivered")}
    model = pickle.loads(pickle.dumps(SwarmModel(rng=1, model_reporters=reporters)))
    model.run(1)
    model.event("delivered", value=2.5)
    model.run(1)
    assert model.datacollector.model_vars["delivered"] == [0, 1]
    assert model.datacollector.model_vars["food"] == [0.0, 2.5]
    with pytest.raises(InvalidValueError, match="name of an event"):
        event_count(3)
