"""Events of a model: as arrays, hashed, stored, recorded, compared, shown."""

import copy
import math

import numpy as np
import pytest

from mesa_swarm import SwarmModel
from mesa_swarm.base.errors import InvalidValueError, RemovedRobotError
from mesa_swarm.recording import Recording
from mesa_swarm.recording.checkpoint import checkpoint_of, restore
from mesa_swarm.recording.frames import frame_of
from support.scenes import blind


class Delivery(SwarmModel):
    """A model whose robots deliver something at random."""

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.add_robots(blind(), 4)

    def step(self):
        super().step()
        for robot in self.robots:
            if self.streams["luck"].random() < 0.3:
                self.event("delivered", robot=robot, value=float(self.steps))
        if self.steps % 10 == 0:
            self.event("night")


def same(log, other):
    return all((getattr(log, name) == getattr(other, name)).all() for name in ("step", "name", "unique_id", "value"))


def test_events_are_arrays_in_their_order():
    model = Delivery(rng=1)
    assert (len(model.events), model.events.name.tolist(), model.events.step.dtype) == (0, [], np.int64)
    robot = model.robots[1]
    model.event("late", robot=robot, value=2)
    model.event("early")
    assert model.events.step.tolist() == [0, 0]
    assert model.events.name.tolist() == ["late", "early"]
    assert model.events.unique_id.tolist() == [robot.unique_id, -1]
    assert model.events.value.tolist() == [2.0, 1.0]
    assert (model.events.count("late"), model.events.total("late"), model.events.count("never")) == (1, 2.0, 0)


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"name": 3}, "name of an event is 3"),
        ({"name": "two\nlines"}, "name of an event"),
        ({"name": ["a"]}, "name of an event"),
        ({"name": "a", "value": math.nan}, "value of an event is nan"),
        ({"name": "a", "value": "much"}, "value of an event"),
        ({"name": "a", "value": np.zeros(2)}, "value of an event"),
        ({"name": "a", "robot": 1}, "robot is 1; expected one of this model's robots"),
    ],
)
def test_a_wrong_event_is_refused_in_one_line_and_not_noted(given, match):
    model = Delivery(rng=1)
    with pytest.raises(InvalidValueError, match=match) as caught:
        model.event(**given)
    assert "\n" not in str(caught.value)
    assert len(model.events) == 0
    assert model.events.names == []


def test_robots_of_another_model_and_removed_ones_have_no_events():
    model, other = Delivery(rng=1), Delivery(rng=1)
    with pytest.raises(InvalidValueError, match="this model's robots"):
        model.event("a", robot=other.robots[0])
    robot = model.robots[0]
    robot.remove()
    with pytest.raises(RemovedRobotError):
        model.event("a", robot=robot)
    assert len(model.events) == 0


def test_events_are_part_of_the_state_once_there_are_any():
    one, two = Delivery(rng=1), Delivery(rng=1)
    one.event("a")
    assert one.state_hash() != two.state_hash()
    two.event("a")
    assert one.state_hash() == two.state_hash()
    assert copy.deepcopy(one).state_hash() == one.state_hash()


@pytest.mark.parametrize("every", [1, 7])
def test_recorded_events_are_those_of_the_model(tmp_path, every):
    model = Delivery(rng=1).run(5)
    before = len(model.events)
    with model.record(tmp_path / "run.arrow", every=every, checkpoint_every=20):
        model.run(63)
    recording = Recording(tmp_path / "run.arrow")
    until = recording.steps[-1]
    assert recording.events.step[0] > 5
    assert recording.events.value.tolist() == model.events.value[before:][model.events.step[before:] <= until].tolist()
    assert len(recording.events) > 40
    assert Delivery.verify(tmp_path / "run.arrow").same
    again = Delivery.resume(tmp_path / "run.arrow", step=42)
    assert same(again.run(26).events, model.events)
    table = recording.to_pandas("events")
    assert table["step"].tolist() == recording.events.step.tolist()
    assert table["name"].tolist() == recording.events.name.tolist()


def test_an_event_by_hand_is_an_intervention_and_verified_after_it(tmp_path):
    model = Delivery(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=20):
        model.run(10)
        model.event("visit", value=9)
        model.run(20)
    recording = Recording(tmp_path / "run.arrow")
    assert [one.what for one in recording.interventions] == [("events",)]
    assert same(recording.events, model.events)
    assert Delivery.verify(tmp_path / "run.arrow").same
    assert same(Delivery.resume(tmp_path / "run.arrow", step=25).run(5).events, model.events)


def test_events_of_other_code_are_found_by_verify(tmp_path, monkeypatch):
    model = Delivery(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(12)
    monkeypatch.setattr(Delivery, "event", lambda self, name, **given: SwarmModel.event(self, name.upper(), **given))
    verdict = Delivery.verify(tmp_path / "run.arrow")
    assert (verdict.same, verdict.column, verdict.step) == (False, "events", model.events.step[0])


def test_events_are_listed_beside_those_that_can_be_seen(tmp_path):
    model = Delivery(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(10)
    listed = Recording(tmp_path / "run.arrow").events()
    assert [event.text for event in listed if event.kind == "night"] == ["night"]
    assert listed[-2].kind == "delivered"
    first = model.events.unique_id[model.events.step == listed[0].step]
    assert listed[0].ids == tuple(first)
    assert sum(event.text.startswith("delivered") for event in listed) == len(set(model.events.step[:-1]))


def test_a_live_frame_has_the_events_of_its_step():
    model = Delivery(rng=1).run(10)
    table = frame_of(model, ("events",))["events"]
    assert set(table["step"]) == {10}
    assert table["name"].tolist()[-1] == "night"


def test_events_restored_from_a_checkpoint_are_checked():
    model = Delivery(rng=1).run(20)
    checkpoint = checkpoint_of(model)
    assert same(restore(Delivery(rng=1), checkpoint).events, model.events)
    with pytest.raises(InvalidValueError, match="series of events"):
        model.events.replace({"names": ["a"], "step": [1], "code": [1], "unique_id": [-1], "value": [1.0]})


def test_ten_thousand_events_take_a_megabyte_in_a_checkpoint():
    model = SwarmModel(rng=1)
    for number in range(10_000):
        model.event("counted", value=number)
    arrays = checkpoint_of(model).arrays
    assert sum(array.nbytes for array in arrays) < 1_000_000
