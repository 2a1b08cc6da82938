"""Recordings forged with right checksums: no file is opened, no work is without bound, refusals are one line."""

import sys
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pyarrow as pa
import pytest

from mesa_swarm import SwarmModel
from mesa_swarm.base.errors import InvalidValueError, RecordingError
from mesa_swarm.model.state import refuse_attributes
from mesa_swarm.models.boids import Boids
from mesa_swarm.recording import Recording, sealed_stream, verify
from mesa_swarm.recording.container import CODEC, LENGTH, MAGIC, from_bytes, to_bytes
from mesa_swarm.recording.resume import resume_watched, shipped_class_of
from mesa_swarm.recording.sealed_stream import SealedReader, SealedWriter
from mesa_swarm.viewing.recorded_steps import PicturedSteps
from support.forging import changed, put_together, taken_apart

STEPS = 6
FAR = 10**12
SECRET = "a line of a file that no command has named"
MISSING = object()
OPENED: list[str] = []


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """What a short recording without stored states is made of."""
    return recorded(tmp_path_factory.mktemp("whole") / "run.arrow", checkpoint_every=0)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """What one is made of that stores the state at its beginning and after step 3."""
    return recorded(tmp_path_factory.mktemp("stored") / "run.arrow", checkpoint_every=3)


def recorded(path, **options):
    model = Boids(n_robots=2, rng=1)
    with model.record(path, **options):
        model.run(STEPS)
    return taken_apart(path)


def with_fact(parts, path, value):
    return replace(parts, facts=changed(parts.facts, path, value))


def refusal(read, *given):
    with pytest.raises(RecordingError) as caught:
        read(*given)
    text = str(caught.value)
    assert 0 < len(text) <= 300
    assert len(text.splitlines()) == 1
    return text


# ---- files and code that a recording names


@pytest.fixture
def secret(tmp_path):
    path = tmp_path / "secret.toml"
    path.write_text(f"{SECRET}\n")
    return path


@pytest.fixture
def opened(secret):
    """Return a function that returns whether the secret file was opened since."""

    def hook(event, given):
        if event == "open" and str(given[0]) == str(secret):
            OPENED.append(event)

    OPENED.clear()
    sys.addaudithook(hook)  # for ever: it is cheap
    return lambda: bool(OPENED)


def test_the_audit_of_opened_files_works(secret, opened):
    secret.read_text()
    assert opened()


@pytest.mark.parametrize("takes_map", [True, False])
def test_a_map_among_the_parameters_is_refused_and_its_file_not_opened(parts, tmp_path, secret, opened, takes_map):
    forged = with_fact(with_fact(parts, ("takes_map",), takes_map), ("parameters", "map"), str(secret))
    path = put_together(forged, tmp_path / "run.arrow")
    for read in (Recording, SwarmModel.resume, SwarmModel.verify, lambda path: verify(path, Boids)):
        assert SECRET not in refusal(read, path)
    assert not opened()


@pytest.mark.parametrize(
    "place", [("parameters", "sight"), ("parameters", "policy"), ("map",), ("seed",), ("platform",)]
)
def test_a_path_anywhere_in_the_provenance_is_only_a_text(parts, tmp_path, secret, opened, place):
    path = put_together(with_fact(parts, place, str(secret)), tmp_path / "run.arrow")
    for read in (SwarmModel.resume, SwarmModel.verify):
        if place == ("platform",):
            read(path)
        else:
            assert SECRET not in refusal(read, path)
    assert not opened()


@pytest.mark.parametrize("name", [("trap_of_recordings", "Trap"), ("os", "system"), ("mesa_swarm.models", "x")])
def test_no_module_is_imported_because_a_recording_names_it(parts, tmp_path, monkeypatch, name):
    (tmp_path / "trap_of_recordings.py").write_text("raise SystemExit('imported')")
    monkeypatch.syspath_prepend(tmp_path)
    module, its_class = name
    path = put_together(with_fact(parts, ("model",), {"module": module, "name": its_class}), tmp_path / "run.arrow")
    for read in (SwarmModel.resume, SwarmModel.verify, lambda path: verify(path, Boids)):
        refusal(read, path)
    refusal(shipped_class_of, Recording(path))
    assert PicturedSteps(Recording(path)).start is None
    assert "trap_of_recordings" not in sys.modules


# ---- attributes that would hide what a class does


def with_state(parts, path, change):
    """Return the same with each stored state changed at a path of its facts."""
    for place, item in enumerate(parts.items):
        if item.name == "checkpoint":
            state = from_bytes(item.content)
            inner = state.facts
            for step in path[:-1]:
                inner = inner[step]
            inner[path[-1]] = change(inner[path[-1]])
            parts = parts.with_item(place, content=to_bytes(state))
    return parts


REFERENCES = [{"of_model": "swarm"}, {"of_model": ""}, {"plain": 1}, {"part": None}]
NAMES = ["run", "step", "add_robots", "results", "state_hash", "obstacles", "__class__", "__dict__", "__len__", "swarm"]


@pytest.mark.slow
@pytest.mark.parametrize("reference", REFERENCES, ids=str)
@pytest.mark.parametrize("name", NAMES)
def test_no_attribute_hides_a_method_of_the_model(stored, tmp_path, name, reference):
    forgery = with_state(stored, ("attributes",), lambda known: {**known, name: reference})
    assert f"attribute {name} is not part of a state" in refusal(
        SwarmModel.resume, put_together(forgery, tmp_path / "f")
    )


@pytest.mark.parametrize("name", ["remove", "position", "step", "__class__"])
def test_no_attribute_hides_a_method_of_an_agent(stored, tmp_path, name):
    forgery = with_state(stored, ("of_things",), lambda known: [[1, {name: {"of_model": ""}}]])
    assert f"attribute {name} is not part of a state" in refusal(
        SwarmModel.resume, put_together(forgery, tmp_path / "f")
    )


class Kept:
    """A class with what is stored under the name that its class has as well."""

    value = 3
    __slots__ = ("__dict__", "slot")

    @cached_property
    def once(self):
        return 5

    def method(self):
        return self


@dataclass
class Fields(Kept):
    default: object = print


@pytest.mark.parametrize("name", ["value", "slot", "once", "own", "default"])
def test_values_slots_fields_and_what_is_computed_once_stay_attributes(name):
    refuse_attributes(Fields(), [name])
    with pytest.raises(InvalidValueError, match="attribute method is not part of a state"):
        refuse_attributes(Fields(), [name, "method"])


# ---- work without bound


def test_a_last_row_far_away_is_refused_when_it_is_opened(parts, tmp_path):
    (rows,) = parts.items
    far = pa.array([*range(1, STEPS), FAR])
    batch = pa.RecordBatch.from_arrays([far, *rows.batch.columns[1:]], schema=rows.batch.schema)
    path = put_together(parts.with_item(0, batch=batch), tmp_path / "run.arrow")
    for read in (SwarmModel.resume, SwarmModel.verify):
        assert "steps out of order" in refusal(read, path)


def far_off(parts, begin):
    """Return the same as if it had begun at a late step."""
    items = tuple(moved(item, begin) for item in parts.items)
    return with_fact(replace(parts, items=items), ("start", "step"), begin)


def moved(item, begin):
    if item.batch is None:
        return replace(item, step=item.step + begin)
    steps = pa.array(item.batch.column(0).to_numpy() + begin)
    batch = pa.RecordBatch.from_arrays([steps, *item.batch.columns[1:]], schema=item.batch.schema)
    return replace(item, step=item.step + begin, batch=batch)


def test_a_late_beginning_is_not_run_again_from_step_0(parts, stored, tmp_path):
    path = put_together(far_off(parts, FAR), tmp_path / "run.arrow")
    assert len(Recording(path)) == STEPS
    for read in (SwarmModel.resume, SwarmModel.verify):
        assert "expected at most 100,000 steps before it" in refusal(read, path)
    assert "a checkpoint of step" in refusal(SwarmModel.verify, put_together(far_off(stored, FAR), path))


@pytest.mark.parametrize("step", [FAR, -1, 2**62])
def test_a_beginning_that_its_rows_do_not_follow_is_refused(parts, tmp_path, step):
    refusal(Recording, put_together(with_fact(parts, ("start", "step"), step), tmp_path / "run.arrow"))


@pytest.mark.parametrize(("rows", "step"), [(10**17, 1), (7, FAR), (6, 0), (6, -5)])
def test_seals_that_cannot_follow_each_other_are_refused(parts, tmp_path, rows, step):
    path = put_together(parts.with_item(0, rows=rows, step=step), tmp_path / "run.arrow")
    assert "out of order" in refusal(Recording, path)


def test_damaged_numbers_in_a_seal_leave_the_rows_before_readable(tmp_path):
    path = tmp_path / "run.arrow"
    model = Boids(n_robots=2, rng=1)
    with model.record(path, checkpoint_every=0) as recorder:
        for _ in range(3):
            model.run(2)
            recorder.flush()
    content = path.read_bytes()
    assert content.count(b"rows=2 step=3;") == 1
    path.write_bytes(content.replace(b"rows=2 step=3;", b"rows=2 step=9;"))
    recording = Recording(path)
    assert (recording.intact, recording.complete) == (2, False)
    assert recording.damage.startswith("is damaged after step 2")


def test_intervals_that_no_reader_accepts_are_not_recorded(tmp_path):
    with pytest.raises(
        InvalidValueError, match="every is 2000000; expected a whole number at least 1 and at most 1000000"
    ):
        Boids(rng=1).record(tmp_path / "run.arrow", every=2_000_000)


def test_running_again_shows_how_far_it_is_and_ends_when_its_owner_goes(parts, tmp_path, capsys):
    path = put_together(parts, tmp_path / "run.arrow")
    SwarmModel.resume(path, progress=True)
    assert f"{STEPS} of {STEPS} steps in " in capsys.readouterr().err
    seen = []

    def watch(model):
        seen.append(model.completed)
        if len(seen) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        resume_watched(Recording(path), SwarmModel, STEPS, {}, watch)
    assert seen == [1, 2, 3]


def test_a_model_that_takes_no_step_is_not_waited_for(parts, tmp_path, monkeypatch):
    monkeypatch.setattr(Boids, "step", lambda model: None)
    assert "took no step" in refusal(SwarmModel.resume, put_together(parts, tmp_path / "run.arrow"))


# ---- memory


def test_rows_that_unpack_to_more_than_they_can_stand_for_are_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(sealed_stream, "PLAIN", sealed_stream.ZSTD)  # else the writer would not pack them
    schema = pa.schema([("step", pa.int64())])
    writer = SealedWriter(tmp_path / "bomb.arrow", schema, overwrite=False)
    writer.write(pa.RecordBatch.from_arrays([pa.array(np.zeros(5_000_000, np.int64))], schema=schema), 0)
    writer.close()
    reader = SealedReader(tmp_path / "bomb.arrow")
    before = pa.total_allocated_bytes()
    refusal(reader.batch, reader.pieces[0])
    assert pa.total_allocated_bytes() - before < 1_000_000


@pytest.mark.parametrize("content", [b"\0" * 100_000_000, (5_000_000).to_bytes(LENGTH, "little") + b"[[]," * 1_250_000])
def test_states_that_unpack_to_more_than_they_can_stand_for_are_refused(content):
    packed = MAGIC + len(content).to_bytes(LENGTH, "little") + CODEC.compress(content, asbytes=True)
    assert "damaged" in refusal(from_bytes, packed)


# ---- one schema


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("model",), MISSING, "provenance: model is missing"),
        (("model", "name"), 5, "model.name is 5"),
        (("start",), [], "start is a list"),
        (("every",), 0, "every is 0"),
        (("every",), True, "every is True"),
        (("versions", "numpy"), {"x": "y" * 1000}, "versions is a dict"),
        (("parameters",), None, "parameters is None"),
        (("parameters", "x"), "deep", "nested more than 50 deep"),
        (("seed",), -1, "seed is -1"),
        (("seed",), {"entropy": "x", "spawn_key": []}, "seed is a dict"),
        (("map",), ["x"], "map is a list"),
        (("exact",), "no", "exact is 'no'"),
        (("platform",), float("nan"), "platform is nan"),
    ],
)
def test_provenance_of_another_form_is_refused_when_it_is_opened(parts, tmp_path, path, value, words):
    facts = dict(parts.facts)
    if value is MISSING:
        del facts[path[0]]
    else:
        facts = changed(facts, path, value)
    assert words in refusal(Recording, put_together(replace(parts, facts=facts), tmp_path / "run.arrow"))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("designs", 0, "radius"), 0),
        (("designs", 0, "sensors", 0), [1, 2]),
        (("robots", 0), [5, 1, 0]),
        (("robots", 0), [1, 10**9, 0]),
        (("robots", 0, 2), 1),
        (("shapes", 0), {"disc": [1, 2]}),
        (("shapes", 0), {"rings": []}),
        (("leave",), float("nan")),
        (("layers",), "x"),
    ],
)
def test_what_a_world_looks_like_is_refused_where_it_cannot_be_drawn(parts, tmp_path, path, value):
    forged = with_fact(parts, ("scenery", *path), value)
    recording = Recording(put_together(forged, tmp_path / "run.arrow"))
    assert "has an invalid scenery" in refusal(lambda: recording.sceneries)


def test_columns_of_other_types_are_refused_when_it_is_opened(parts, tmp_path):
    for kind in (pa.list_(pa.string()), pa.list_(pa.list_(pa.float32(), 3)), pa.float32(), pa.list_(pa.null())):
        place = parts.schema.get_field_index("position")
        schema = parts.schema.set(place, pa.field("position", kind))
        forged = replace(parts, schema=schema, items=())
        assert "has invalid column 'position': type" in refusal(Recording, put_together(forged, tmp_path / "run.arrow"))


def test_rows_of_unequal_length_and_numbers_out_of_range_are_refused_where_they_are_decoded(parts, tmp_path):
    batch = parts.items[0].batch
    for name, row, words in (
        ("heading", [0.0, 0.0, 0.0], "a number of values of heading other than that of robots"),
        ("heading", [0.0, np.nan], "out-of-range values of heading"),
        ("heading", [0.0, None], "missing values"),
        ("position", [[0.0, 1e30]] * 2, "out-of-range values of position"),
        ("robot", [7, 7], "unique_ids that do not ascend"),
    ):
        place = batch.schema.get_field_index(name)
        column = pa.array([row, *batch.column(place).to_pylist()[1:]], batch.schema.field(place).type)
        other = pa.RecordBatch.from_arrays(
            [column if i == place else one for i, one in enumerate(batch.columns)], schema=batch.schema
        )
        recording = Recording(put_together(parts.with_item(0, batch=other), tmp_path / "run.arrow"))
        assert words in refusal(recording.to_pandas)
