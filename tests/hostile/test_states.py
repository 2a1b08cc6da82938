"""Stored states that a run did not have, and classes that a recording would have made: all are noticed or refused."""

import gc

import numpy as np
import pytest

from mesa_swarm.base.errors import RecordingError, SwarmError
from mesa_swarm.recording import verify
from mesa_swarm.recording.container import from_bytes, to_bytes
from support import vandals
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
from support.twin_models import OWN
from support.vandals import DONE, Workshop

pytestmark = pytest.mark.slow
STEP = 6
HOME = vandals.__name__


def recorded(model, path, steps=12):
    with model.record(path, checkpoint_every=3) as recorder:
        model.run(steps)
    assert recorder.why_no_checkpoint == ""
    return path


def is_noticed(path, model_class):
    try:
        return not verify(path, model_class).same
    except RecordingError:
        return True


@pytest.mark.parametrize("kind", OWN, ids=lambda kind: kind.__name__)
def test_any_change_of_a_stored_state_is_noticed(kind, tmp_path, tally, amount):
    model = kind(rng=1)
    whole = taken_apart(recorded(model, tmp_path / "whole.arrow"))
    genuine = from_bytes(whole.items[place_of(whole, STEP)].content)
    rng, area = np.random.default_rng(3), tally("states")
    compared = compared_arrays(genuine, model.swarm.table.readings)
    for number in range(amount(20, 400)):
        forge = (forged_json, forged_array)[number % 2]
        state, what = forge(genuine, int(rng.integers(10**6)))
        if forge is forged_array and what[0] not in compared:
            continue
        path = put_together(with_state(whole, to_bytes(state), STEP), tmp_path / "forged.arrow")
        area.check(f"{kind.__name__} {what}", is_noticed(path, kind), "is the same")


# Processes as stored: number, class, attributes.
PROCESSES = {
    "no process": (7, "Writer", {"path": {"plain": "/tmp/x"}}),
    "no process, declared only": (7, "Writer", {}),
    "deleted": (7, "Remover", {"path": {"plain": "/tmp/x"}}),
    "a process with __del__": (7, "Closing", {"path": {"plain": "/tmp/x"}}),
    "a property": (7, "Watched", {"path": {"plain": "/tmp/x"}}),
    "a property of one that there is": (1, "Watched", {"path": {"plain": "/tmp/x"}, "level": {"plain": 1.0}}),
    "not declared": (7, "Watched", {"level": {"plain": 1.0}, "odd": {"plain": 1}}),
    "its dict": (7, "Watched", {"__dict__": {"plain": {"dict": [["level", 5.0]]}}}),
    "its class": (7, "Watched", {"__class__": {"plain": 1}}),
    "its step": (7, "Watched", {"step": {"plain": 1}}),
    "the step of one that there is": (1, "Watched", {"step": {"of_model": "swarm"}, "level": {"plain": 1.0}}),
    "an agent": (7, "Courier", {}),
    "a model": (7, "Workshop", {}),
    "of elsewhere": (7, "subprocess.Popen", {"args": {"plain": "ls"}}),
}
# Agents: class and attributes.
AGENTS = {
    "another agent": ("Courier", {"path": {"plain": "/tmp/x"}}),
    "another agent, declared only": ("Courier", {}),
    "not declared": ("Present", {"odd": {"plain": 1}}),
    "its step": ("Present", {"step": {"plain": 1}}),
    "its dict": ("Present", {"__dict__": {"plain": {"dict": []}}}),
    "no agent": ("Writer", {}),
}
ATTRIBUTES = {
    "a method": {"run": {"of_model": "swarm"}},
    "its step": {"step": {"plain": 1}},
    "its class": {"__class__": {"plain": 1}},
    "a property": {"control": {"plain": None}},
}


def with_process(facts, number, name, attributes):
    others = [process for process in facts["processes"] if process[0] != number]
    kind = name if "." in name else f"{HOME}.{name}"
    stored = {f"{number} {attribute}": content for attribute, content in attributes.items()}
    before = facts["parts"].get("processes", {}).get("stored", {})
    kept = {key: content for key, content in before.items() if not key.startswith(f"{number} ")}
    return {
        **facts,
        "processes": sorted([*others, [number, kind]], key=lambda process: process[0]),
        "parts": {**facts["parts"], "processes": {"stored": {**kept, **stored}}},
    }


def with_agent(facts, name, attributes):
    things, unique_id = facts["things"], facts["things"]["next_id"]
    others = [*things.get("others", []), [unique_id, HOME, name, None]]
    return {
        **facts,
        "things": {**things, "others": others, "next_id": unique_id + 1},
        "of_things": [*facts["of_things"], [unique_id, attributes]],
    }


def forgeries(facts):
    for name, (number, kind, attributes) in PROCESSES.items():
        yield f"process: {name}", with_process(facts, number, kind, attributes)
    for name, (kind, attributes) in AGENTS.items():
        yield f"agent: {name}", with_agent(facts, kind, attributes)
    for name, attributes in ATTRIBUTES.items():
        yield f"model: {name}", {**facts, "attributes": {**facts["attributes"], **attributes}}


def test_a_recording_has_no_class_made_and_stepped_that_does_not_expect_it(tmp_path, tally):
    whole, area = taken_apart(recorded(Workshop(rng=1), tmp_path / "whole.arrow")), tally("classes")
    genuine = from_bytes(whole.items[place_of(whole, STEP)].content)
    for name, facts in forgeries(genuine.facts):
        content = to_bytes(replace_state(genuine, facts=facts))
        path = put_together(with_state(whole, content, STEP), tmp_path / "forged.arrow")
        DONE.clear()
        area.check(name, is_noticed(path, Workshop), "is the same")
        area.check(f"{name}, resumed", _is_refused(path), "was resumed")
        gc.collect()
        area.check(f"{name}, acting", DONE == [], str(DONE))


def _is_refused(path):
    """Return whether a state is refused in one line of at most 300 characters."""
    try:
        Workshop.resume(path, step=STEP).run(3)
    except SwarmError as error:
        return 0 < len(str(error)) <= 300 and len(str(error).splitlines()) == 1
    return False


def test_a_genuine_recording_of_that_model_is_resumed(tmp_path):
    path = recorded(Workshop(rng=1), tmp_path / "run.arrow")
    model = Workshop.resume(path, step=STEP).run(6)
    assert model.state_hash() == Workshop(rng=1).run(12).state_hash()
    assert verify(path, Workshop).same
