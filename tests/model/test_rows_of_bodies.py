"""Columns of a part with a row for each body: the model adds and removes the rows."""

import pickle
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
import pytest

from mesa_swarm import AGENT9, Column, Part, Phase, Stage, SwarmModel, disc
from mesa_swarm.base.errors import InvalidValueError, RecordingError
from mesa_swarm.recording.checkpoint import checkpoint_of, restore
from support.rows_of_bodies import Weathered


def aged(model):
    return {body.unique_id: float(age) for body, age in zip(model.bodies, model.parts["weather"].age, strict=True)}


def test_rows_come_and_go_with_bodies_of_every_kind():
    model = Weathered(rng=1).run(2)
    first = aged(model)
    assert set(first.values()) == {2.0}
    load = model.add_load(disc((300, 300), 5), resistance=0.5)
    fire, door = model.add_fire((500, 300), radius=10), model.add_body(disc((600, 300), 5))
    model.run(3)
    ages = aged(model)
    assert all(ages[unique_id] == 5.0 for unique_id in first)
    assert [ages[body.unique_id] for body in (load, fire, door)] == [3.0] * 3
    for body in (load, fire, model.bodies[0], door):
        gone = body.unique_id
        body.remove()
        assert aged(model) == {unique_id: age for unique_id, age in ages.items() if unique_id != gone}
        ages = aged(model)


def test_rows_are_recorded_resumed_and_continued_with_bodies_that_were_added(tmp_path):
    model = Weathered(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=4):
        model.run(3)
        model.add_fire((500, 300), radius=10)
        model.add_body(disc((600, 300), 5), mode="fixed")
        model.run(7)
    assert Weathered.verify(tmp_path / "run.arrow").same
    for step in (3, 5, 9):  # after the third with what was changed by hand
        again = Weathered.resume(tmp_path / "run.arrow", step=step)
        assert again.run(10 - step).state_hash() == model.state_hash()
    assert aged(model.continued(noise=0.1)) == aged(Weathered.resume(tmp_path / "run.arrow"))


class MadeInBind(Part):
    """Makes its columns whenever it is bound."""

    name = "soot"

    def bind(self, context):
        self.context = context
        self.soot = np.zeros(len(context.model.bodies))
        self.heat = np.zeros(len(context.model.swarm))

    def columns(self):
        return {"soot": Column(self.soot, "bodies"), "heat": Column(self.heat, "robots")}

    def stages(self):
        return [Stage(Phase.PROCESS, self.grow, "soot grows")]

    def grow(self):
        self.soot += 1.0 + np.arange(len(self.soot))
        self.heat += 0.5


class Sooty(SwarmModel):
    """A world with a part that makes its columns in `bind`."""

    def __init__(self, *, noise=0.0, rng=None):
        super().__init__(map="openspace", noise=noise, rng=rng)
        self.add_robots(AGENT9, 3)
        self.add_part(MadeInBind())


@pytest.mark.parametrize("duplicate", [deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_columns_that_are_made_anew_whenever_a_part_is_bound_are_kept_by_copies(duplicate):
    model = Sooty(rng=1).run(3)
    twin = duplicate(model)
    assert twin.parts["soot"].soot.tolist() == model.parts["soot"].soot.tolist() == [3.0, 6.0, 9.0, 12.0]
    twin.add_body(disc((100, 100), 5))
    twin.run(1)
    assert twin.parts["soot"].soot.tolist() == [4.0, 8.0, 12.0, 16.0, 5.0]
    assert model.state_hash() == duplicate(model).state_hash()


@dataclass
class Measured(Part):
    """A part that is compared by its array; two of a class stand in one model."""

    level: np.ndarray
    name: str = "measured"

    def columns(self):
        return {"level": Column(self.level)}


class LeftOut(Part):
    """Leaves its column out of copies, and makes it in `bind`."""

    name = "left_out"

    def bind(self, context):
        self.level = np.zeros(2)

    def columns(self):
        return {"level": Column(self.level)}

    def __getstate__(self):
        return {}


@pytest.mark.parametrize("duplicate", [deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_parts_that_are_compared_by_arrays_or_leave_columns_out_are_copied(duplicate):
    model = SwarmModel(rng=1)
    for name in ("one", "other"):
        model.add_part(Measured(np.arange(3.0), name))
    model.add_part(LeftOut()).level[:] = 1.0
    twin = duplicate(model)
    assert twin.parts["other"].level.tolist() == [0.0, 1.0, 2.0]
    assert twin.parts["left_out"].level.tolist() == [0.0, 0.0]
    twin.run(1)


def test_columns_that_are_made_anew_whenever_a_part_is_bound_are_resumed(tmp_path):
    model = Sooty(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=4):
        model.run(9)
    assert Sooty.verify(tmp_path / "run.arrow").same
    again = Sooty.resume(tmp_path / "run.arrow", step=6)
    assert again.run(3).state_hash() == model.state_hash()
    assert model.continued(noise=0.1).parts["soot"].heat.tolist() == [4.5, 4.5, 4.5]


def test_the_hash_sees_each_row():
    model, other = Weathered(rng=1), Weathered(rng=1)
    assert model.state_hash() == other.state_hash()
    other.parts["weather"].age[1] += 1e-9
    assert model.state_hash() != other.state_hash()


@pytest.mark.parametrize("name", ["stages", "__class__", "columns"])
def test_a_stored_state_hides_nothing_of_what_the_class_of_a_part_does(name):
    checkpoint = checkpoint_of(Weathered(rng=1).run(2))
    checkpoint.facts["parts"]["weather"].setdefault("stored", {})[name] = {"plain": 1}
    with pytest.raises(RecordingError, match=f"attribute {name} is not part of a state"):
        restore(Weathered(rng=1), checkpoint)


def test_robots_have_nothing_to_do_with_it():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 2)
    assert np.shape(Weathered(rng=1).parts["weather"].age) == (5,)


class Stuck(Part):
    """Cannot take a column of which rows were removed."""

    name = "stuck"

    def bind(self, context):
        self.held = [np.zeros(len(context.model.bodies))]

    def columns(self):
        return {"held": Column(self.held[0], "bodies")}


def test_a_body_whose_rows_a_part_cannot_drop_stays_whole():
    model = SwarmModel(rng=1)
    bodies = model.add_fire((400, 300), radius=10), model.add_body(disc((100, 100), 5))
    model.add_part(Stuck())
    for body in bodies:
        with pytest.raises(InvalidValueError, match="has no attribute that is its column held"):
            body.remove()
    assert list(model.bodies)[4:] == list(bodies)  # after the border
    assert model.fires.agents == [bodies[0]]
    assert bodies[0].temperature == 1.0
    model.run(2)
