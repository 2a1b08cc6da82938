"""Columns of a part with a row for each body: the model adds and removes the rows."""

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel, disc
from mesa_swarm.errors import RecordingError
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
