"""Stored states that are not those of the run: verify compares each, and resume does not go on from them."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import RecordingError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording, verify
from mesa_swarm.recording.checkpoint import checkpoint_of
from mesa_swarm.recording.container import from_bytes, to_bytes
from support.forging import (
    compared_arrays,
    forged_array,
    forged_json,
    place_of,
    put_together,
    replace_state,
    taken_apart,
    with_state,
)
from support.twin_models import Stateful, Wolves


def recorded(model, path, steps=12, **how):
    with model.record(path, checkpoint_every=3, **how) as recorder:
        model.run(steps)
    assert recorder.why_no_checkpoint == ""
    return path


STEP = 6
PARTS: dict[type, object] = {}


def parts_of(kind, folder):
    """Return what a recording of a model is made of, with states of steps 0, 3, 6, 9 and 12; made once."""
    if kind not in PARTS:
        PARTS[kind] = taken_apart(recorded(kind(rng=1), folder / f"{kind.__name__}.arrow"))
    return PARTS[kind]


def noticed(path, model_class):
    """Return whether verify reports a difference, or refuses the recording."""
    try:
        return not verify(path, model_class).same
    except RecordingError:
        return True


@pytest.mark.slow
@pytest.mark.parametrize("kind", [Stateful, Wolves])
@pytest.mark.parametrize("forge", [forged_json, forged_array])
@settings(max_examples=25)
@given(place=st.integers(0, 10**6))
def test_verify_notices_any_change_of_a_stored_state(tmp_path_factory, kind, forge, place):
    folder = tmp_path_factory.mktemp("forged")
    whole = parts_of(kind, folder)
    genuine = from_bytes(whole.items[place_of(whole, STEP)].content)
    state, what = forge(genuine, place)
    if forge is forged_array and what[0] not in compared_arrays(genuine):
        return
    path = put_together(with_state(whole, to_bytes(state), STEP), folder / "run.arrow")
    assert noticed(path, kind), what


def test_a_genuine_recording_is_the_same(tmp_path):
    for kind in (Stateful, Wolves):
        verdict = verify(put_together(parts_of(kind, tmp_path), tmp_path / "run.arrow"), kind)
        assert str(verdict) == "all 12 rows to step 12 are the same"


@pytest.mark.slow
@pytest.mark.parametrize("step", [0, 3, 6, 12])
def test_the_state_of_another_run_in_the_place_of_its_own_is_noticed_and_resume_refuses_it(tmp_path, step):
    path = recorded(FireFighting(n_robots=4, rng=1), tmp_path / "run.arrow")
    other = FireFighting(n_robots=4, rng=1)
    other.robots[0].position = (400, 300)
    genuine = taken_apart(path)
    forged = put_together(with_state(genuine, to_bytes(checkpoint_of(other.run(step))), step), path)
    assert noticed(forged, FireFighting)
    wrong = "does not match the row of this step" if step else "is not that with which the recording began"
    with pytest.raises(RecordingError, match=f"the stored state of step {step} {wrong}"):
        FireFighting.resume(forged, step=step)


class Counting(SwarmModel):
    """A model with an attribute that is in no row and no hash."""

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, 2)
        self.control = Subsumption(Avoid(), Explore())
        self.secret = 0


def test_the_verdict_names_step_and_part_of_a_state_that_differs(tmp_path):
    path = recorded(Counting(rng=1), tmp_path / "run.arrow")
    whole = taken_apart(path)
    state = from_bytes(whole.items[place_of(whole, STEP)].content)
    facts = {**state.facts, "attributes": {**state.facts["attributes"], "secret": {"plain": 5}}}
    put_together(with_state(whole, to_bytes(replace_state(state, facts=facts)), STEP), path)
    verdict = verify(path, Counting)
    assert (verdict.same, verdict.step, verdict.rows) == (False, STEP, STEP - 1)
    assert str(verdict) == "step 6 is the first that differs: its stored state differs in attributes secret"


def test_what_was_set_by_hand_before_the_recording_began_is_named_and_the_run_is_verified_from_there(tmp_path):
    model = Counting(rng=1).run(2)
    model.secret = 7
    verdict = verify(recorded(model, tmp_path / "run.arrow"), Counting)
    assert verdict.same
    assert str(verdict) == (
        "all 12 rows to step 14 are the same, from the stored state of step 2 (its attributes secret is not what the "
        "parameters make)"
    )


def test_how_a_run_is_observed_is_not_compared(tmp_path):
    model = Counting(rng=1)
    model.collect_every, model.fires.history.every = 4, 2
    assert verify(recorded(model, tmp_path / "run.arrow"), Counting).same


def test_a_state_after_a_change_by_hand_is_taken_and_those_after_it_are_compared(tmp_path):
    model = Counting(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=3):
        model.run(4)
        model.robots[0].heading = 1.0
        model.run(8)
    whole = taken_apart(tmp_path / "run.arrow")
    steps = Recording(tmp_path / "run.arrow").checkpoints
    assert steps == (0, 3, 4, 7, 10)
    assert verify(tmp_path / "run.arrow", Counting).same
    state = from_bytes(whole.items[place_of(whole, 7)].content)
    facts = {**state.facts, "attributes": {**state.facts["attributes"], "secret": {"plain": 5}}}
    put_together(with_state(whole, to_bytes(replace_state(state, facts=facts)), 7), tmp_path / "run.arrow")
    assert verify(tmp_path / "run.arrow", Counting).step == 7


def test_a_state_that_cannot_be_read_is_named(tmp_path):
    path = recorded(Counting(rng=1), tmp_path / "run.arrow")
    whole = taken_apart(path)
    put_together(with_state(whole, b"no state", STEP), path)
    verdict = verify(path, Counting)
    assert (verdict.same, verdict.step) == (False, STEP)
    assert "its stored state cannot be read" in str(verdict)
    assert Counting.resume(path, step=STEP).state_hash() == Counting(rng=1).run(STEP).state_hash()


def test_a_state_that_no_row_proves_is_not_gone_on_from(tmp_path):
    model, path = FireFighting(n_robots=4, rng=1), tmp_path / "run.arrow"
    with model.record(path, every=10, checkpoint_every=6):
        model.run(25)
    assert Recording(path).checkpoints == (0, 6, 12, 18, 24)
    other = FireFighting(n_robots=4, rng=2).run(12)
    put_together(with_state(taken_apart(path), to_bytes(checkpoint_of(other)), 12), path)
    for step in (12, 15):
        again = FireFighting.resume(path, step=step)
        assert again.state_hash() == FireFighting(n_robots=4, rng=1).run(step).state_hash()


def test_a_forged_interval_of_collecting_is_noticed_with_the_rows_that_it_would_excuse(tmp_path):
    path = recorded(Counting(rng=1), tmp_path / "run.arrow")
    whole = taken_apart(path)
    state = from_bytes(whole.items[place_of(whole, STEP)].content)
    forged = replace_state(state, facts={**state.facts, "collect_every": 3})
    put_together(with_state(whole, to_bytes(forged), STEP), path)
    assert str(verify(path, Counting)) == "step 6 is the first that differs: its stored state differs in collect_every"


def test_an_interval_of_collecting_that_is_changed_by_hand_is_noted(tmp_path):
    model, path = Counting(rng=1), tmp_path / "run.arrow"
    with model.record(path, checkpoint_every=3):
        model.run(4)
        model.collect_every = 5
        model.run(8)
    assert verify(path, Counting).same
    rows = Counting.resume(path, step=11).run(1).datacollector.get_model_vars_dataframe()
    assert rows.equals(model.datacollector.get_model_vars_dataframe())
