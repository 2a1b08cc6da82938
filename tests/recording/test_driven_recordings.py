"""A recording of a run that compiled calls drive is, in all that a reader reads, that of its single steps."""

import gc
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import SwarmModel, disc, drive, process
from mesa_swarm.errors import BehaviourError, RecordingError
from mesa_swarm.kernels.plan import Driver
from mesa_swarm.model.gallery import find_model, gallery_names
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.physics.engine import CompiledEngine
from mesa_swarm.recording import Recording, verify
from mesa_swarm.recording.layout import Chunk
from mesa_swarm.recording.sealed_stream import SealedWriter
from support.driven_models import Counting, taken
from support.own_parts import Odometer
from support.recorded_twice import (
    assert_same_recordings,
    contents_of,
    recorded_both_ways,
    run,
    steps_driven,
    without_clock,
)
from support.recorded_worlds import WORLDS, a_lamp, fires, plain, pushed_loads, robots_that_smell, tick, world

SETTINGS = [{}, {"every": 3}, {"every": 7, "exact": True}, {"checkpoint_every": 40}]
COLUMNS = (
    ["position"],
    ["command", "fires", "loads", "contacts"],
    ["distance", "events"],
    ["layer", "number", "collided"],
)


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
@pytest.mark.parametrize("name", gallery_names())
def test_every_model_of_the_gallery_is_recorded_as_in_its_single_steps(name, settings, tmp_path):
    driven, single, _ = recorded_both_ways(
        lambda: find_model(name)(rng=3), tmp_path, lambda model, take: take(model, 110), **settings
    )
    assert_same_recordings(driven, single)


@pytest.mark.parametrize("settings", SETTINGS, ids=str)
@pytest.mark.parametrize("name", WORLDS)
def test_whatever_is_in_a_world_it_is_recorded_as_in_its_single_steps(name, settings, tmp_path):
    driven, single, steps = recorded_both_ways(WORLDS[name], tmp_path, lambda model, take: take(model, 130), **settings)
    assert_same_recordings(driven, single)
    if name != "robots that smell" or settings.get("every", 1) > 3:
        assert steps > 60


@pytest.mark.parametrize("columns", COLUMNS, ids=str)
@pytest.mark.parametrize("every", [1, 4])
def test_any_columns_are_recorded_as_in_single_steps(columns, every, tmp_path):
    driven, single, steps = recorded_both_ways(
        fires, tmp_path, lambda model, take: take(model, 130), columns=columns, every=every
    )
    assert_same_recordings(driven, single)
    assert steps > 100


@pytest.mark.parametrize("rows", [1, 2, 5, 64])
def test_chunks_of_any_length_are_those_of_single_steps(rows, tmp_path, monkeypatch):
    monkeypatch.setattr("mesa_swarm.recording.recorder.MOST_ROWS", rows)
    driven, single, steps = recorded_both_ways(plain, tmp_path, lambda model, take: take(model, 150))
    assert_same_recordings(driven, single)
    assert steps > 100


def test_two_recorders_of_one_model_store_what_each_would_alone(tmp_path):
    model = fires()
    with without_clock(), steps_driven() as numbers:
        with (
            model.record(tmp_path / "one.arrow"),
            model.record(tmp_path / "other.arrow", every=7, columns=["position"]),
        ):
            model.run(150)
        assert sum(numbers) > 100
        for name, settings in {"one": {}, "other": {"every": 7, "columns": ["position"]}}.items():
            alone = fires()
            with alone.record(tmp_path / f"{name} alone.arrow", **settings):
                taken(alone, 150)
            assert_same_recordings(tmp_path / f"{name}.arrow", tmp_path / f"{name} alone.arrow")


def test_models_that_are_driven_together_are_recorded_as_alone(tmp_path):
    models = [FireFighting(n_robots=5, rng=seed) for seed in (1, 2)]
    with without_clock():
        recorders = [model.record(tmp_path / f"{place}.arrow") for place, model in enumerate(models)]
        drive(models, 130)
        for place, recorder in enumerate(recorders):
            recorder.close()
            alone = FireFighting(n_robots=5, rng=place + 1)
            with alone.record(tmp_path / "alone.arrow", overwrite=True):
                taken(alone, 130)
            assert_same_recordings(tmp_path / f"{place}.arrow", tmp_path / "alone.arrow")


# ---- changes by hand


def move(model):
    model.robots[1].position = (111.0, 222.0)


def add_robot(model):
    model.add_robots(model.swarm.designs[0], poses=[(60.0, 60.0, 0.0)])


def add_fire(model):
    model.add_fire((300.0, 200.0), radius=15)


def add_obstacle(model):
    model.add_obstacle(disc((500.0, 100.0), 9.0))


def take_out(model):
    model.robots[0].remove()


def write_columns(model):
    model.swarm.columns["tendency"][:] *= -1.0
    model.swarm.columns["distance"][:] = 3.0


def note(model):
    model.event("by hand", value=2.5)


def declare(model):
    model.state["n"] = model.state.get("n", 0) + 1


CHANGES = [move, add_robot, add_fire, add_obstacle, take_out, write_columns, note, declare]


@pytest.mark.parametrize("change", CHANGES)
def test_a_change_by_hand_between_runs_is_stored_as_between_single_steps(change, tmp_path):
    def do(model, take):
        for steps in (30, 25, 40):
            take(model, steps)
            change(model)

    driven, single, steps = recorded_both_ways(fires, tmp_path, do)
    assert_same_recordings(driven, single)
    assert steps > 80
    assert len(Recording(driven).interventions) == 2


def test_bodies_sent_elsewhere_between_runs_are_stored_as_moves(tmp_path):
    def make():
        model = world(map="openspace")
        model.add_body(disc((300.0, 300.0), 10.0), kind="door")
        return model

    def do(model, take):
        for k in range(8):
            model.movers.agents[0].position = (300.0 + 5.0 * k, 300.0)
            take(model, 9)  # after a run of ten steps all rows are written, and moves with them

    driven, single, steps = recorded_both_ways(make, tmp_path, do)
    assert_same_recordings(driven, single)
    assert steps > 60
    assert not Recording(driven).interventions


@settings(max_examples=20, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 70), st.sampled_from([None, *CHANGES])), min_size=1, max_size=5),
    st.integers(1, 9),
    st.integers(0, 50),
    st.booleans(),
)
def test_runs_of_any_lengths_with_changes_between_them_are_single_steps(tmp_path_factory, runs, every, most, exact):
    def do(model, take):
        for steps, change in runs:
            take(model, steps)
            if change is not None and len(model.swarm) > 1:
                change(model)

    driven, single, _ = recorded_both_ways(
        fires, tmp_path_factory.mktemp("runs"), do, every=every, checkpoint_every=most, exact=exact
    )
    assert_same_recordings(driven, single)


# ---- what ends a run


def test_ctrl_c_leaves_all_rows_of_the_steps_that_were_completed(tmp_path, monkeypatch):
    take = Driver._go_on

    def interrupted(driver, steps, completed, *others):
        if completed > 20:
            take(driver, steps // 2, completed, *others)
            raise KeyboardInterrupt
        take(driver, steps, completed, *others)

    monkeypatch.setattr(Driver, "_go_on", interrupted)
    model = plain()
    model.run(5)
    recorder = model.record(tmp_path / "run.arrow")
    model.run(25)
    with pytest.raises(KeyboardInterrupt):
        model.run(60)
    assert recorder.closed
    assert model.steps == model.completed > 50
    monkeypatch.undo()
    other = plain().run(5)
    with other.record(tmp_path / "other.arrow"):
        taken(other, model.completed - 5)
    assert_same_rows_of(tmp_path / "run.arrow", tmp_path / "other.arrow")


def assert_same_rows_of(one, other):
    """Assert that the rows are the same, whatever complete states were stored besides."""
    assert Recording(one).complete
    assert contents_of(one)[0] == contents_of(other)[0]


@process(every=7)
def push(model):
    model.robots[0].position = model.robots[1].position + 3.0


@pytest.mark.parametrize("columns", [None, ["position"]])
def test_ctrl_c_while_python_moves_robots_within_a_compiled_call_leaves_all_rows(columns, tmp_path, monkeypatch):
    def crowd():
        model = world(robots=40)
        model.add_process(push)
        return model

    calls, settle = [], CompiledEngine.settle

    def interrupted(*arguments):
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return settle(*arguments)

    model = crowd()
    with monkeypatch.context() as patched, model.record(tmp_path / "run.arrow", columns=columns):
        patched.setattr(CompiledEngine, "settle", interrupted)
        with pytest.raises(KeyboardInterrupt):
            model.run(40)
    other = crowd()
    with other.record(tmp_path / "other.arrow", columns=columns):
        taken(other, model.completed)
    assert model.steps == model.completed > 7
    assert_same_rows_of(tmp_path / "run.arrow", tmp_path / "other.arrow")


@process(memory={"t": 0.0})
def fail_once(t, position, step):
    if step == 57:
        t[0] = position[99, 0]


@pytest.mark.parametrize("columns", [None, ["position"]])
@pytest.mark.parametrize("every", [1, 8])
def test_an_error_within_a_compiled_call_leaves_the_rows_of_all_steps_before(columns, every, tmp_path):
    def make():
        model = plain()
        model.add_process(fail_once)
        return model

    def do(model, take):
        with pytest.raises(BehaviourError):
            take(model, 90)
        model.observers.clear()

    driven, single, steps = recorded_both_ways(make, tmp_path, do, columns=columns, every=every)
    assert_same_rows_of(driven, single)
    assert steps > 50
    assert Recording(driven).steps.tolist() == list(range(every, 57, every))


def test_an_error_while_models_are_driven_together_leaves_the_rows_of_all_steps_before(tmp_path):
    models = [plain(), plain()]
    models[0].add_process(fail_once)
    recorders = [model.record(tmp_path / f"{place}.arrow") for place, model in enumerate(models)]
    with pytest.raises(BehaviourError):
        drive(models, 90)
    recorders[1].close()
    assert recorders[0].closed
    assert [len(Recording(tmp_path / f"{place}.arrow")) for place in (0, 1)] == [56, 90]


@pytest.mark.parametrize("name", ["put", "copy"])
def test_ctrl_c_while_python_adds_a_row_within_a_compiled_call_neither_loses_nor_doubles_one(
    name, tmp_path, monkeypatch
):
    monkeypatch.setattr("mesa_swarm.recording.recorder.MOST_ROWS", 20)
    model, calls, method = plain(), [], getattr(Chunk, name)

    def interrupted(*arguments):
        calls.append(1)
        if len(calls) == 4:
            raise KeyboardInterrupt
        return method(*arguments)

    with monkeypatch.context() as patched, without_clock(), model.record(tmp_path / "run.arrow"):
        patched.setattr(Chunk, name, interrupted)
        with pytest.raises(KeyboardInterrupt):
            model.run(200)
    assert 50 < model.completed == model.steps < 200
    assert Recording(tmp_path / "run.arrow").steps.tolist() == list(range(1, model.completed + 1))


def test_a_chunk_that_cannot_be_written_within_a_compiled_call_ends_the_recording_when_a_step_is_over(
    tmp_path, monkeypatch
):
    monkeypatch.setattr("mesa_swarm.recording.recorder.MOST_ROWS", 20)
    model, calls, put = plain(), [], SealedWriter._put

    def failing(writer, content):
        calls.append(1)
        if len(calls) == 4:
            raise RecordingError("disk full")
        put(writer, content)

    recorder = model.record(tmp_path / "run.arrow")
    with monkeypatch.context() as patched, without_clock():
        patched.setattr(SealedWriter, "_put", failing)
        with pytest.raises(RecordingError, match="disk full"):
            model.run(300)
    assert recorder.closed
    assert not model.observers
    assert model.steps == model.completed == 101  # the thread has failed after step 80, which the next chunk notices
    assert Recording(tmp_path / "run.arrow").steps.tolist() == list(range(1, 61))
    assert model.run(30).state_hash() == plain().run(model.completed).state_hash()


@process
def overheat(temperature, step):
    if step == 57:
        temperature[0] = np.inf


def recorded_until_closed(model, recorder, take):
    take(model, 90)
    recorder.close()


@pytest.mark.parametrize("rows", [20, 256])
def test_a_value_that_cannot_be_recorded_leaves_the_rows_before_it(rows, tmp_path, monkeypatch):
    monkeypatch.setattr("mesa_swarm.recording.recorder.MOST_ROWS", rows)
    for name, take in (("driven", run), ("single", taken)):
        model = plain()
        model.add_process(overheat)
        recorder = model.record(tmp_path / f"{name}.arrow")
        with without_clock(), pytest.raises(RecordingError, match="out-of-range values of temperature"):
            recorded_until_closed(model, recorder, take)
        assert recorder.closed
    assert Recording(tmp_path / "driven.arrow").steps.tolist() == list(range(1, 57))
    assert (
        contents_of(tmp_path / "driven.arrow", whole=False)[0] == contents_of(tmp_path / "single.arrow", whole=False)[0]
    )


def test_where_no_thread_can_be_had_chunks_are_written_all_the_same(tmp_path, monkeypatch):
    def start(thread):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr("mesa_swarm.recording.recorder.MOST_ROWS", 20)
    monkeypatch.setattr("threading.Thread.start", start)
    driven, single, steps = recorded_both_ways(plain, tmp_path, lambda model, take: take(model, 150))
    assert_same_recordings(driven, single)
    assert steps > 100


# ---- verify and resume


def test_a_driven_recording_is_verified_and_resumed(tmp_path):
    with steps_driven() as numbers:
        model = CollisionAvoidance(n_robots=8, rng=4)
        with model.record(tmp_path / "run.arrow", checkpoint_every=60):
            model.run(150)
        assert sum(numbers) > 140
    assert verify(Recording(tmp_path / "run.arrow"), CollisionAvoidance).same
    for step in (60, 101, 150):
        again = CollisionAvoidance.resume(tmp_path / "run.arrow", step=step)
        assert again.completed == step
        assert again.run(200 - step).state_hash() == CollisionAvoidance(n_robots=8, rng=4).run(200).state_hash()


# ---- what is driven, and what is not


def test_compiled_calls_end_where_complete_states_are_due(tmp_path):
    with without_clock(), steps_driven() as numbers:
        model = plain()
        with model.record(tmp_path / "run.arrow", checkpoint_every=130):
            model.run(301)
    ends = [1]
    for number in numbers:
        ends.append(ends[-1] + number)
    assert ends == [1, 130, 260, 301]
    assert all(end - begin >= 3 for begin, end in pairwise(ends))


@pytest.mark.parametrize("every", [1, 150])
def test_the_plan_names_what_a_recorder_makes_due(every, tmp_path):
    model = plain()
    with model.record(tmp_path / "run.arrow", every=every, checkpoint_every=500):
        assert "besides: observer Recorder: the next row begins a chunk\n" in str(model.plan)
        model.run(200)
        text = str(model.plan)
    assert text.endswith("driven: up to 500 steps in one compiled call")
    assert [line for line in text.splitlines() if "Recorder" in line] == [
        "besides: observer Recorder: checkpoints, every 500 steps"
    ]


def shows(model):
    model.add_part(Odometer())


def lamp_and_process(model):
    model.add_body(disc((300, 300), 20), mode="fixed", kind="lamp", temperature=0.75)
    model.add_process(tick)


@pytest.mark.parametrize(
    ("make", "change", "why"),
    [
        (robots_that_smell, None, "pictures of fields"),
        (plain, shows, "what part odometer shows"),
        (plain, lamp_and_process, "colours of bodies that radiate"),
    ],
)
def test_what_python_alone_can_record_makes_steps_single_and_the_plan_names_it(make, change, why, tmp_path):
    model = make()
    if change is not None:
        change(model)
    with model.record(tmp_path / "run.arrow"), steps_driven() as numbers:
        model.run(20)
        assert f"besides: observer Recorder: {why}" in str(model.plan)
        assert "one step at a time" in str(model.plan)
    assert not numbers


def test_a_lamp_alone_is_taken_along(tmp_path):
    model = a_lamp()
    with model.record(tmp_path / "run.arrow"), steps_driven() as numbers:
        model.run(50)
    assert sum(numbers) > 40


def test_a_model_with_a_step_of_its_own_is_recorded_as_ever(tmp_path):
    driven, single, steps = recorded_both_ways(lambda: Counting(rng=1), tmp_path, lambda model, take: take(model, 30))
    assert_same_recordings(driven, single)
    assert not steps


@pytest.mark.parametrize("make", [plain, pushed_loads, fires])
def test_a_driven_recording_is_closed_when_its_model_is_gone(make, tmp_path):
    model = make()
    model.record(tmp_path / "run.arrow")
    model.run(150)
    del model
    gc.collect()
    assert Recording(tmp_path / "run.arrow").complete
    assert len(Recording(tmp_path / "run.arrow")) == 150


def test_a_run_goes_on_after_its_recording_is_closed_within_it(tmp_path):
    model = plain()
    recorder = model.record(tmp_path / "run.arrow")
    model.run(30)
    recorder.close()
    assert run(model, 30).state_hash() == taken(plain(), 60).state_hash()
    assert len(Recording(tmp_path / "run.arrow")) == 30


def test_a_file_that_cannot_be_written_ends_a_driven_recording_and_the_model_goes_on(tmp_path, monkeypatch):
    model = plain()
    recorder = model.record(tmp_path / "run.arrow")
    model.run(30)
    monkeypatch.setattr("mesa_swarm.recording.recorder.RowBuffer.flush", broken)
    with pytest.raises(OSError, match="disk full"):
        model.run(30)
    monkeypatch.undo()
    assert recorder.closed
    assert isinstance(model.run(10), SwarmModel)


def broken(buffer):
    raise OSError("disk full")


def test_poses_of_bodies_are_recorded_after_one_has_come_and_gone_between_two_steps(tmp_path):
    model = pushed_loads()
    with model.record(tmp_path / "run.arrow", exact=True):
        model.run(20)
        model.add_body(disc((20, 20), 3), kind="visitor").remove()
        x, y, heading = model.loads[0].pose
        model.loads[0].move_to((x + 0.5, y, heading))
        model.run(20)
        poses = {load.unique_id: load.pose for load in model.loads}
    table = Recording(tmp_path / "run.arrow")[-1]["loads"]
    assert {row[0]: tuple(row)[1:] for row in table.tolist() if row[0] in poses} == poses
