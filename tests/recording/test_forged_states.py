"""Stored states that are not those of the run: verify compares each, and resume does not go on from them."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.errors import RecordingError
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording, verify
from mesa_swarm.recording.checkpoint import checkpoint_of
from mesa_swarm.recording.container import PLACES, Checkpoint, from_bytes, to_bytes
from mesa_swarm.recording.sealed_stream import CHECKPOINT
from support.forging import put_together, taken_apart
from support.twin_models import Stateful, Wolves

STEP = 6
# How a run was observed is not compared; and numbers of arrays and names of types encode what is.
OBSERVED = {"collect_every", "reporters", "history"}
ENCODING = {"of", "array", "number"}
READINGS = {"distance", "kind", "radiation", "line"}


def recorded(model, path, steps=12, **how):
    with model.record(path, checkpoint_every=3, **how) as recorder:
        model.run(steps)
    assert recorder.why_no_checkpoint == ""
    return path


PARTS: dict[type, object] = {}


def parts_of(kind, folder):
    """Return what a recording of a model is made of, with states of steps 0, 3, 6, 9 and 12; made once."""
    if kind not in PARTS:
        PARTS[kind] = taken_apart(recorded(kind(rng=1), folder / f"{kind.__name__}.arrow"))
    return PARTS[kind]


def place_of(parts, step=STEP):
    return next(k for k, item in enumerate(parts.items) if item.name == CHECKPOINT and item.step == step)


def with_state(parts, content, step=STEP):
    return parts.with_item(place_of(parts, step), content=content)


def leaves(value, path=()):
    """Yield the paths to all numbers, texts and truth values in JSON that are part of a state."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        if key not in ENCODING and not (not path and key in OBSERVED):
            yield from leaves(inner, (*path, key))
    if not isinstance(value, (dict, list)) and value is not None:
        yield path


def changed_leaf(value, path, change):
    if not path:
        return change(value)
    copied = dict(value) if isinstance(value, dict) else list(value)
    copied[path[0]] = changed_leaf(copied[path[0]], path[1:], change)
    return copied


def another(value):
    """Return another value of the same kind."""
    if isinstance(value, bool) or value is None:
        return not value
    return value + 1 if isinstance(value, (int, float)) else f"{value}x"


def forged_json(checkpoint, place):
    """Return a state with one value of its facts changed, and the path to it."""
    paths = list(leaves(checkpoint.facts))
    path = paths[place % len(paths)]
    return replace_state(checkpoint, facts=changed_leaf(checkpoint.facts, path, another)), path


def forged_array(checkpoint, place):
    """Return a state with one number of one of its arrays changed."""
    sizes = [array.size for array in checkpoint.arrays]
    place %= sum(sizes)
    which = int(np.searchsorted(np.cumsum(sizes), place, side="right"))
    arrays = [array.copy() for array in checkpoint.arrays]
    flat = arrays[which].reshape(-1)
    at = place - sum(sizes[:which])
    flat[at] = not flat[at] if flat.dtype == bool else flat[at] + 1
    if flat.dtype.kind == "f" and np.isnan(flat[at]):
        flat[at] = 0.0
    return replace_state(checkpoint, arrays=arrays), (which, at)


def replace_state(checkpoint, **changes):
    given = {name: getattr(checkpoint, name) for name in ("step", "state_hash", "facts", "arrays")}
    return Checkpoint(**{**given, **changes})


def noticed(path, model_class):
    """Return whether verify says that the recording is not the same, or refuses it."""
    try:
        return not verify(path, model_class).same
    except RecordingError:
        return True


@pytest.mark.parametrize("kind", [Stateful, Wolves])
@pytest.mark.parametrize("forge", [forged_json, forged_array])
@settings(max_examples=25)
@given(place=st.integers(0, 10**6))
def test_verify_notices_any_change_of_a_stored_state(tmp_path_factory, kind, forge, place):
    folder = tmp_path_factory.mktemp("forged")
    whole = parts_of(kind, folder)
    genuine = from_bytes(whole.items[place_of(whole)].content)
    state, what = forge(genuine, place)
    if forge is forged_array and what[0] not in compared_arrays(genuine):
        return
    path = put_together(with_state(whole, to_bytes(state)), folder / "run.arrow")
    assert noticed(path, kind), what


def compared_arrays(checkpoint):
    """Return the numbers of the arrays that are part of a state, and are not read anew by sensors."""
    facts = {name: content for name, content in checkpoint.facts.items() if name not in OBSERVED}
    columns = {name: column for name, column in facts["columns"].items() if name not in READINGS}
    return set(map(int, PLACES.findall(json.dumps({**facts, "columns": columns}, separators=(",", ":")))))


def test_a_genuine_recording_is_the_same(tmp_path):
    for kind in (Stateful, Wolves):
        verdict = verify(put_together(parts_of(kind, tmp_path), tmp_path / "run.arrow"), kind)
        assert str(verdict) == "all 12 rows to step 12 are the same"


@pytest.mark.parametrize("step", [0, 3, 6, 12])
def test_the_state_of_another_run_in_the_place_of_its_own_is_noticed_and_resume_refuses_it(tmp_path, step):
    path = recorded(FireFighting(n_robots=4, rng=1), tmp_path / "run.arrow")
    other = FireFighting(n_robots=4, rng=1)
    other.robots[0].position = (400, 300)
    genuine = taken_apart(path)
    forged = put_together(with_state(genuine, to_bytes(checkpoint_of(other.run(step))), step), path)
    assert noticed(forged, FireFighting)
    if step:
        with pytest.raises(RecordingError, match=f"stored state of step {step} does not match the row of this step"):
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
    state = from_bytes(whole.items[place_of(whole)].content)
    facts = {**state.facts, "attributes": {**state.facts["attributes"], "secret": {"plain": 5}}}
    put_together(with_state(whole, to_bytes(replace_state(state, facts=facts))), path)
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
    put_together(with_state(whole, b"no state"), path)
    verdict = verify(path, Counting)
    assert (verdict.same, verdict.step) == (False, STEP)
    assert "its stored state cannot be read" in str(verdict)
    assert Counting.resume(path, step=STEP).state_hash() == Counting(rng=1).run(STEP).state_hash()
