"""Fields in recordings: their pictures or values, and runs that go on from stored states and after changes by hand."""

import numpy as np
import pytest

from mesa_swarm import AGENT3, Field, Recording, SwarmModel, disc
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.recording import verify
from mesa_swarm.recording.layout import DEFAULT


class Marking(SwarmModel):
    """Robots that leave a trail where they go."""

    def __init__(self, *, rng=None, cell=20.0, map="openspace"):
        super().__init__(map=map, rng=rng)
        self.add_robots(AGENT3, 4)
        self.control = Subsumption(Avoid(distance=15), Explore())
        self.add_obstacle(disc((400, 300), 60))
        self.trail = self.add_field(Field("trail", cell=cell, diffusion=5.0, evaporation=0.01))
        self.add_field(Field("food", cell=50.0))

    def step(self):
        super().step()
        self.trail.deposit(self.swarm.position, 1.0)


def recorded(path, steps=30, change=lambda model: None, **options):
    model = Marking(rng=1)
    with model.record(path, **options):
        model.run(steps // 2)
        change(model)
        model.run(steps - steps // 2)
    return model, Recording(path)


def test_a_row_has_a_picture_of_each_field_to_within_half_a_percent_of_the_peak(tmp_path):
    model, recording = recorded(tmp_path / "run.arrow")
    fields = recording.fields(30)
    assert list(fields) == ["trail", "food"]
    assert fields["trail"].shape == model.trail.values.shape
    np.testing.assert_allclose(fields["trail"], model.trail.values, atol=0.004 * model.trail.peak)
    assert recording["fields.trail"].shape == (30, 30, 40)
    table = recording.to_pandas("fields")
    assert table.columns.tolist() == ["step", "field", "peak", "total", "name"]
    assert table["name"].tolist()[-2:] == ["trail", "food"]
    assert table["total"].iloc[-2] == pytest.approx(model.trail.total, rel=1e-6)
    assert list(recording.to_pandas().columns)[:2] == ["step", "robot"]


def test_exact_rows_have_the_values_themselves(tmp_path):
    model, recording = recorded(tmp_path / "run.arrow", exact=True)
    assert (recording.fields(30)["trail"] == model.trail.values).all()


def test_a_recording_without_fields_has_no_column_of_them(tmp_path):
    model = SwarmModel(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(2)
    recording = Recording(tmp_path / "run.arrow")
    assert not [name for name in recording.columns if name.startswith("fields")]
    assert recording.fields(2) == {}


def test_columns_that_are_asked_for_decide_whether_fields_are_recorded(tmp_path):
    chosen = tuple(name for name in DEFAULT if name != "fields")
    _, recording = recorded(tmp_path / "run.arrow", columns=chosen)
    assert recording.fields(2) == {}


@pytest.mark.parametrize("exact", [False, True])
def test_a_run_again_gives_the_same_fields(tmp_path, exact):
    recorded(tmp_path / "run.arrow", exact=exact)
    assert str(verify(tmp_path / "run.arrow", Marking)) == "all 30 rows to step 30 are the same"


def test_a_change_by_hand_is_found_and_stored(tmp_path):
    model, recording = recorded(
        tmp_path / "run.arrow", change=lambda model: model.fields["food"].deposit((100, 100), 5.0)
    )
    assert [one.what for one in recording.interventions] == [("values of fields",)]
    verdict = verify(recording, Marking)
    assert verdict.same
    again = Marking.resume(tmp_path / "run.arrow")
    assert again.state_hash() == model.state_hash()
    assert again.fields["food"].total == 5
    assert again.fields["trail"] is again.trail
    assert again.run(5).state_hash() == model.run(5).state_hash()


def test_a_field_that_was_added_by_hand_is_there_after_going_on(tmp_path):
    def add(model):
        model.add_field(Field("gas", diffusion=1.0)).deposit((50, 50), 2.0)
        model.add_obstacle(disc((50, 50), 20))

    model, recording = recorded(tmp_path / "run.arrow", change=add)
    assert "fields" in recording.interventions[0].what
    again = Marking.resume(tmp_path / "run.arrow")
    assert list(again.fields) == ["trail", "food", "gas"]
    assert again.run(5).state_hash() == model.run(5).state_hash()
    assert again.fields["gas"].peak == model.fields["gas"].peak


def test_going_on_with_another_parameter_takes_the_fields_over(tmp_path):
    model, _ = recorded(tmp_path / "run.arrow")
    again = Marking.resume(tmp_path / "run.arrow", cell=20.0)
    assert (again.trail.values == model.trail.values).all()
    assert not Marking.resume(tmp_path / "run.arrow", cell=10.0).trail.values.any()


def test_stored_values_that_no_field_can_have_are_refused(tmp_path):
    model = Marking(rng=1)
    for wrong in ({"values": np.full((30, 40), -1.0), "peak": 0.0}, {"values": np.zeros((2, 2)), "peak": 0.0},
                  {"values": np.zeros((30, 40)), "peak": np.nan}):  # fmt: skip
        with pytest.raises(SwarmError, match="expected"):
            model.trail.restore(wrong)


def test_pictures_of_large_fields_are_smaller(tmp_path):
    model = SwarmModel(rng=1)
    field = model.add_field(Field("trail", cell=1.0))
    field.deposit((400.5, 300.5), 4.0)
    with model.record(tmp_path / "run.arrow"):
        model.run(2)
    levels = Recording(tmp_path / "run.arrow").at(2)["fields.trail"]
    assert levels.size <= 120_000
    assert levels.shape == (300, 400)
    assert Recording(tmp_path / "run.arrow").fields(2)["trail"].max() == pytest.approx(1.0, rel=0.02)


class Mowing(Marking):
    """A trail that is removed after ten steps, and comes back after twenty with as many columns of other cells."""

    def step(self):
        SwarmModel.step(self)
        if self.completed == 10:
            self.remove_field("trail")
        elif self.completed == 20:
            self.trail = self.add_field(Field("trail", cell=20.0, diffusion=1.0))
        if not self.trail.removed:
            self.trail.deposit(self.swarm.position, 1.0)


@pytest.mark.parametrize("exact", [False, True])
def test_rows_have_no_picture_of_a_field_while_it_is_removed(tmp_path, exact):
    model = Mowing(rng=1)
    with model.record(tmp_path / "run.arrow", exact=exact):
        model.run(30)
    recording = Recording(tmp_path / "run.arrow")
    with pytest.raises(SwarmError, match=r"fields\.trail was removed in .*; read it frame by frame"):
        recording["fields.trail"]
    rows = [frame["fields.trail"].shape[0] for frame in recording]
    assert rows == [30] * 9 + [0] * 10 + [30] * 11
    totals = recording.to_pandas("fields").query("field == 0")["total"].to_numpy()
    assert (totals > 0).tolist() == [True] * 9 + [False] * 10 + [True] * 11
    assert str(verify(recording, Mowing)) == "all 30 rows to step 30 are the same"


@pytest.mark.parametrize("step", [5, 15, 25])
def test_a_run_goes_on_with_the_fields_that_it_then_had(tmp_path, step):
    model = Mowing(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=15):
        model.run(step)
        state = model.state_hash()
        model.run(30 - step)
    again = Mowing.resume(tmp_path / "run.arrow", step=step)
    assert again.state_hash() == state
    assert ("trail" in again.fields) == (step != 15)
    assert again.run(30 - step).state_hash() == model.state_hash()


def test_a_field_that_was_removed_by_hand_is_not_there_after_going_on(tmp_path):
    model, recording = recorded(tmp_path / "run.arrow", change=lambda model: model.remove_field("food"))
    assert "fields" in recording.interventions[0].what
    assert verify(recording, Marking).same
    again = Marking.resume(tmp_path / "run.arrow")
    assert list(again.fields) == ["trail"]
    assert again.run(5).state_hash() == model.run(5).state_hash()


def test_going_on_with_another_parameter_keeps_what_was_removed_and_added(tmp_path):
    def change(model):
        model.remove_field("food")
        model.add_field(Field("gas", cell=50.0)).deposit((50, 50), 2.0)

    recorded(tmp_path / "run.arrow", change=change)
    again = Marking.resume(tmp_path / "run.arrow", cell=10.0)
    assert list(again.fields) == ["trail", "gas"]
    assert again.fields["gas"].total == 2.0


def test_a_field_that_comes_back_with_other_columns_is_refused_in_one_line(tmp_path):
    def replace(model):
        model.remove_field("food")
        model.add_field(Field("food", cell=10.0))

    with pytest.raises(SwarmError, match=r"field food has pictures of 80 columns; expected 16 as when .* began"):
        recorded(tmp_path / "run.arrow", steps=4, change=replace)
    assert Recording(tmp_path / "run.arrow").intact == 2
