"""All that is recorded can be read: the writer has the limits of the reader, and refuses what exceeds them."""

import tracemalloc

import numpy as np
import pytest

from mesa_swarm import AGENT3, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, RecordingError, UnstoredStateWarning
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording, container, verify
from mesa_swarm.recording import collected_data as collected
from mesa_swarm.recording.checkpoint import checkpoint_of, restore
from mesa_swarm.recording.container import Checkpoint, Packer, from_bytes, to_bytes
from mesa_swarm.recording.schema import longest_gap
from mesa_swarm.recording.verify import states_to
from support.forging import put_together, taken_apart


class Collecting(SwarmModel):
    """Robots of which the same two values are collected in each step."""

    def __init__(self, *, n=200, rng=None):
        super().__init__(rng=rng, agent_reporters={"on": lambda agent: 1, "x": lambda agent: 0.0})
        self.add_robots(AGENT3, n)


class Grid(SwarmModel):
    """Robots that leave something behind on a fine grid."""

    def __init__(self, *, cells=1000, x=None, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT3, 3)
        self.grid = np.zeros((cells, cells))

    def step(self):
        super().step()
        self.grid[tuple(self.swarm.position.astype(int).T)] += 1


def small(**parameters):
    return Grid(cells=800, rng=1, **parameters)


def turned(model):
    model.robots[0].heading += 0.3


def one_line(error):
    text = str(error.value)
    assert len(text.splitlines()) == 1
    assert len(text) <= 300
    return text


def read_whole(path):
    recording = Recording(path)
    recording.to_pandas(), recording.sceneries, recording.changes
    return [recording.checkpoint(place).step for place in range(len(recording.checkpoints))]


# ---- states


@pytest.mark.slow
def test_what_was_collected_of_many_robots_over_many_steps_is_stored_and_read_again(tmp_path):
    path, model = tmp_path / "run.arrow", Collecting(rng=1)
    with model.record(path, every=100) as recorder:
        model.run(1050)
        turned(model)
        model.run(50)
    assert (recorder.checkpoints, recorder.why_no_checkpoint) == ((0, 1000, 1050), "")
    verdict = verify(path, Collecting)
    assert (verdict.same, verdict.rows) == (True, 11)
    again = Collecting.resume(path, step=1100)
    assert again.state_hash() == model.state_hash()
    assert again.datacollector._agent_records == model.datacollector._agent_records


@pytest.mark.parametrize("value", [1, 0.5, True, np.float64(2), np.bool_(1), "on", None, 1 << 70, (1, 2), [3.5]])
def test_rows_that_were_collected_keep_their_types(value):
    class Reporting(SwarmModel):
        def __init__(self, *, rng=None):
            super().__init__(rng=rng, agent_reporters={"value": lambda agent: value, "mixed": _mixed})
            self.add_robots(AGENT3, 3)

    model = Reporting(rng=1).run(5)
    model.remove_robots(model.robots[:1])
    model.run(5)
    again = restore(Reporting(rng=2), from_bytes(to_bytes(checkpoint_of(model))))
    assert repr(again.datacollector._agent_records) == repr(model.datacollector._agent_records)


def _mixed(agent):
    return agent.unique_id if agent.unique_id % 2 else str(agent.unique_id)


def test_a_large_array_among_the_attributes_is_stored_and_read_again(tmp_path):
    path, model = tmp_path / "run.arrow", Grid(cells=2100, rng=1)
    turned(model)
    with model.record(path, checkpoint_every=5) as recorder:
        model.run(12)
    assert recorder.why_no_checkpoint == ""
    assert Grid.resume(path, step=11).steps == 11


def test_of_many_states_only_one_is_held_at_a_time(tmp_path):
    path, model = tmp_path / "run.arrow", Grid(rng=1)
    with model.record(path, every=5, checkpoint_every=5):
        model.run(50)
    recording = Recording(path)
    places, one = len(recording.checkpoints), model.grid.nbytes
    tracemalloc.start()
    try:
        states = states_to(recording, places - 1)
        assert tracemalloc.get_traced_memory()[1] < 4 * one
    finally:
        tracemalloc.stop()
    assert [state.step for state in states] == list(recording.checkpoints)
    assert Grid.resume(path).state_hash() == model.state_hash()


@pytest.mark.parametrize("packs_badly", [False, True])
def test_a_state_that_is_stored_is_not_too_large_to_be_read(monkeypatch, packs_badly):
    monkeypatch.setattr(container, "MOST_MEMORY", 100_000)
    draw, stored = np.random.default_rng(1), []
    for size in range(1000, 200_000, 20_000):
        array = draw.bytes(size) if packs_badly else bytes(size)
        checkpoint = Checkpoint(step=1, state_hash="", facts={}, arrays=[np.frombuffer(array, np.uint8)])
        try:
            content = to_bytes(checkpoint)
        except RecordingError as error:
            assert "more than the 100,000 of a checkpoint; use smaller arrays" in str(error)
            continue
        stored.append(size)
        assert from_bytes(content).arrays[0].tobytes() == array
    assert len(stored) == (10 if packs_badly else 3)


def test_a_state_that_is_too_large_is_not_stored_and_the_reason_is(tmp_path, monkeypatch):
    monkeypatch.setattr(container, "MOST_MEMORY", 1_000_000)
    path, model = tmp_path / "run.arrow", small()
    with model.record(path, checkpoint_every=5) as recorder:
        model.run(12)
    assert recorder.checkpoints == ()
    assert "bytes and needs about" in recorder.why_no_checkpoint
    assert "bytes and needs about" in Recording(path).provenance["why_no_checkpoint"]
    assert Grid.resume(path).state_hash() == model.state_hash()


def test_states_that_have_collected_too_much_are_not_stored_and_the_others_can_be_read(tmp_path, monkeypatch):
    monkeypatch.setattr(collected, "MOST_COLLECTED", 100_000)
    monkeypatch.setattr(collected, "MOST_PACKED", 1)
    path, model = tmp_path / "run.arrow", Collecting(n=10, rng=1)
    with model.record(path, every=100, checkpoint_every=20) as recorder:
        model.run(200)
    assert 2 <= len(recorder.checkpoints) < 11
    assert "collected data need about" in recorder.why_no_checkpoint
    assert states_to(Recording(path), len(recorder.checkpoints) - 1)[-1].step == recorder.checkpoints[-1]
    assert Collecting.resume(path, step=190).steps == 190
    monkeypatch.setattr(collected, "MOST_COLLECTED", 10_000)
    monkeypatch.setattr(collected, "MOST_PACKED", 0)
    with pytest.raises(RecordingError, match="collected data need") as error:
        states_to(Recording(path), len(recorder.checkpoints) - 1)
    one_line(error)


def test_too_much_collected_before_a_recording_is_a_reason_of_its_first_states_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(collected, "MOST_COLLECTED", 100_000)
    monkeypatch.setattr(collected, "MOST_PACKED", 30)
    path, model = tmp_path / "run.arrow", Collecting(n=10, rng=1).run(200)
    with pytest.warns(UnstoredStateWarning) as warned, model.record(path, checkpoint_every=5):
        model.run(400)
    (text,) = {str(one.message) for one in warned}
    assert text.startswith("the state of Collecting after step 200 cannot be stored in its recording: collected data")
    assert "recording of 0 bytes" not in text
    assert Recording(path).provenance["why_no_checkpoint"] == ""
    assert Collecting.resume(path).state_hash() == model.state_hash()


@pytest.mark.parametrize(
    ("of", "array"),
    [
        ("rows", np.zeros((1 << 30, 0))),
        ("builtins.int", np.zeros((1 << 28, 0, 5))),
        ("rows", np.zeros((10**7, 1), "i1")),
    ],
)
def test_series_that_are_more_as_lists_than_as_arrays_are_refused(tmp_path, of, array):
    path = tmp_path / "run.arrow"
    with Collecting(n=2, rng=1).record(path, checkpoint_every=5):
        pass
    parts = taken_apart(path)
    (place,) = (place for place, item in enumerate(parts.items) if item.name == "checkpoint")
    state = from_bytes(parts.items[place].content)
    state.arrays.append(array)
    state.facts["collected"][0][2] = {"of": of, "array": {"array": len(state.arrays) - 1}}
    forged = put_together(parts.with_item(place, content=to_bytes(state)), tmp_path / "forged.arrow")
    with pytest.raises(RecordingError, match="collected data need") as error:
        states_to(Recording(forged), 0)
    one_line(error)


def test_an_array_that_many_values_name_takes_the_memory_of_one():
    packer = Packer()
    content = packer.pack(np.zeros(9))
    values = Packer(packer.arrays).unpack([content] * 1000)
    assert all(value is values[0] for value in values)


# ---- what a recording begins with


def _deep():
    value = []
    for _ in range(60):
        value = [value]
    return value


@pytest.mark.slow
@pytest.mark.parametrize(
    "given", [{"x": _deep()}, {"x": "x" * (34 << 20)}, {"x": [[]] * 2_100_000}, {"rng": 1 << 5000}]
)
def test_parameters_that_no_reader_takes_are_refused_before_a_file_is_made(tmp_path, given):
    model = Grid(**{"cells": 800, "rng": 1, **given})
    with pytest.raises(RecordingError, match="this recording would be unreadable") as error:
        model.record(tmp_path / "run.arrow")
    one_line(error)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "dtype", "shape"),
    [("a", complex, ()), ("a", "U5", ()), ("a", "M8[s]", ()), ("a", object, ()), ("a", float, (200_000,)),
     ("step", float, ()), ("robot", float, ())],
)  # fmt: skip
def test_columns_that_no_reader_takes_are_refused_before_a_file_is_made(tmp_path, name, dtype, shape):
    model = small()
    model.swarm.remember(name, shape, dtype, 0)
    with pytest.raises((RecordingError, InvalidValueError), match="column") as error:
        model.record(tmp_path / "run.arrow", columns=("position", name))
    one_line(error)
    assert not list(tmp_path.iterdir())


# ---- rows


def test_rows_that_are_very_large_and_much_alike_can_be_read(tmp_path):
    path, model = tmp_path / "run.arrow", small()
    model.add_robots(AGENT3, 60)
    model.swarm.remember("wide", (90_000,), float, 0.0)
    with model.record(path, columns=("wide",), checkpoint_every=0):
        model.run(2)
    recording = Recording(path)
    assert recording[1]["wide"].shape == (63, 90_000)


@pytest.mark.parametrize(
    ("name", "value"), [("command", 1e300), ("temperature", np.nan), ("temperature", 1e39), ("temperature", -np.inf)]
)
def test_values_that_no_reader_takes_end_a_recording_whose_rows_before_stay(tmp_path, name, value):
    path, model = tmp_path / "run.arrow", small()
    recorder = model.record(path, checkpoint_every=0)
    model.run(10)
    model.swarm.columns[name][...] = value
    with np.errstate(all="ignore"), pytest.raises(RecordingError, match="out-of-range values of") as error:
        model.run(10)
    one_line(error)
    assert recorder.closed
    assert len(Recording(path)) == 10
    read_whole(path)


@pytest.mark.parametrize("last", [1, 7, 200])
def test_rows_of_the_same_chunk_before_a_value_that_no_reader_takes_stay_too(tmp_path, last):
    class Breaking(FireFighting):
        def step(self):
            super().step()
            if self.steps > last:
                self.swarm.columns["command"][1] = np.inf

    path, model = tmp_path / "run.arrow", Breaking(n_robots=3, rng=1)
    model.record(path, checkpoint_every=0)
    with np.errstate(all="ignore"), pytest.raises(RecordingError, match="out-of-range values of command"):
        model.run(300)
    assert Recording(path).steps.tolist() == list(range(1, last + 1))
    read_whole(path)


def test_more_steps_without_a_row_than_readers_accept_end_a_recording_whose_rows_before_stay(tmp_path, monkeypatch):
    path, model = tmp_path / "run.arrow", small()
    recorder = model.record(path, checkpoint_every=0)
    model.run(10)

    def fails(model):
        raise ZeroDivisionError

    with monkeypatch.context() as patch:
        patch.setattr(model.datacollector, "collect", fails)
        for _ in range(longest_gap(1)):
            with pytest.raises(ZeroDivisionError):
                model.step()
    with pytest.raises(RecordingError, match="start another recording") as error:
        model.step()
    one_line(error)
    assert recorder.closed
    assert len(Recording(path)) == 10
