"""Recordings of sweeps: complete or not there, none lost, none twice."""

import os
from pathlib import Path

import pytest

from mesa_swarm.base.errors import RecordingError, SwarmError
from mesa_swarm.base.files import draft_name, lock
from mesa_swarm.experiments.run_records import Archive, recorded
from mesa_swarm.experiments.sweep import sweep
from mesa_swarm.experiments.worker_pool import WorkerDiedError
from mesa_swarm.model.gallery import find_model
from mesa_swarm.recording import Recording, verify
from support.failing_models import Counting, Dying, DyingOnce, Raising, seeds_run

FIRE = find_model("fire_fighting")


def recordings_of(made):
    """The recordings of a sweep by the table's rows, None where there is none."""
    folder = made.path.parent / "recordings"
    return [None if name is None else Recording(folder / name) for name in made.frame()["recording"]]


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_the_table_names_the_recording_of_each_run(tmp_path, jobs):
    made = sweep(FIRE, {"n_robots": [2, 3]}, seeds=[5, 6], steps=30, out=tmp_path, jobs=jobs, record={"every": 10})
    recordings = recordings_of(made)
    found = [(recording.provenance["parameters"]["n_robots"], recording.provenance["seed"]) for recording in recordings]
    assert found == [(2, 5), (2, 6), (3, 5), (3, 6)]
    assert all(recording.steps.tolist() == [10, 20, 30] and recording.complete for recording in recordings)
    assert verify(recordings[3], FIRE).same


def test_a_recorded_sweep_has_the_results_of_one_that_is_not(tmp_path):
    plain = sweep(FIRE, seeds=2, steps=30, out=tmp_path / "plain", jobs=1).frame()
    recorded = sweep(FIRE, seeds=2, steps=30, out=tmp_path / "recorded", jobs=1, record={}).frame()
    assert recorded.drop(columns="recording").equals(plain)


def test_runs_that_were_not_recorded_are_done_again_and_those_that_were_are_not(tmp_path):
    diary = tmp_path / "diary"

    def swept(**how):
        return sweep(Counting, seeds=3, steps=1, settings={"diary": str(diary)}, out=tmp_path, jobs=1, **how)

    counts = [(swept(**how).done_before, len(diary.read_text().splitlines())) for how in ({}, {"record": {}})]
    next((tmp_path / "recordings").iterdir()).unlink()
    counts += [(swept(record={}).done_before, len(diary.read_text().splitlines())) for _ in range(2)]
    assert counts == [(0, 3), (0, 6), (2, 7), (3, 7)]
    assert len((tmp_path / "ledger.jsonl").read_text().splitlines()) == 3


def test_a_run_that_fails_is_recorded_as_far_as_it_went_and_not_tried_again(tmp_path):
    settings = {"diary": str(tmp_path / "diary")}
    made, again = (
        sweep(Raising, seeds=3, steps=2, settings=settings, out=tmp_path, jobs=1, record={}) for _ in range(2)
    )
    assert (made.failed, again.done_before) == (1, 3)
    assert [len(recording) for recording in recordings_of(made)] == [2, 1, 2]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
def test_a_run_whose_worker_is_killed_is_tried_again_and_recorded_whole_and_no_run_is_lost(tmp_path):
    settings = {"diary": str(tmp_path / "diary")}
    made = sweep(DyingOnce, seeds=4, steps=3, settings=settings, out=tmp_path, jobs=2, record={})
    assert (made.failed, made.frame()["seed"].tolist()) == (0, [1, 2, 3, 4])
    assert [len(recording) for recording in recordings_of(made)] == [3, 3, 3, 3]
    assert [path.suffix for path in (tmp_path / "recordings").iterdir()] == [".arrow"] * 4


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_recording_that_cannot_be_written_stops_the_sweep_and_is_no_fault_of_the_run(tmp_path, jobs):
    (tmp_path / "recordings").write_text("in the way")
    with pytest.raises(RecordingError, match="recordings"):
        sweep(FIRE, seeds=2, steps=5, out=tmp_path, jobs=jobs, record={})
    assert (tmp_path / "ledger.jsonl").read_text() == ""
    (tmp_path / "recordings").unlink()
    assert sweep(FIRE, seeds=2, steps=5, out=tmp_path, jobs=1, record={}).done_before == 0


@pytest.mark.parametrize(
    ("record", "message"),
    [({"evry": 2}, "did you mean 'every'"), ({"every": 0}, "every is 0"), ({"columns": ["x"]}, "unknown column")],
)
def test_wrong_options_are_refused_before_anything_is_run(tmp_path, record, message):
    with pytest.raises(SwarmError, match=message):
        sweep(FIRE, seeds=2, steps=5, out=tmp_path, record=record)
    assert list(tmp_path.iterdir()) == []


def test_a_draft_that_a_kill_left_is_replaced(tmp_path):
    archive = Archive(tmp_path, {})
    assert archive.file("0a").parent == Path(tmp_path)
    made = sweep(FIRE, seeds=1, steps=5, out=tmp_path, jobs=1, record={})
    (file,) = (tmp_path / "recordings").iterdir()
    draft = draft_name(file, 0)
    draft.write_bytes(file.read_bytes()[:100])
    file.unlink()
    again = sweep(FIRE, seeds=1, steps=5, out=tmp_path, jobs=1, record={})
    assert (made.done_before, again.done_before) == (0, 0)
    assert not draft.exists()
    assert len(Recording(file)) == 5


def test_a_run_whose_worker_dies_in_each_of_three_tries_is_given_up_and_the_rest_goes_on(tmp_path, monkeypatch):
    tried = []

    def on_all(workers, work, tasks):
        for task in tasks:
            run = task[-1]
            tried.append(run.rng)
            if run.rng == 2:
                raise WorkerDiedError
            yield work(*task)

    monkeypatch.setattr("mesa_swarm.experiments.runs.on_all", on_all)
    settings = {"diary": str(tmp_path / "diary")}
    made = sweep(Counting, seeds=3, steps=1, settings=settings, out=tmp_path, jobs=2, record={})
    table = made.frame()
    assert table["error"].dropna().to_dict() == {1: "WorkerDiedError: the process died in each of 3 tries"}
    assert table["recording"].isna().tolist() == [False, True, False]
    assert sorted(tried) == [1, 2, 2, 2, 3]


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
def test_a_run_that_always_kills_its_worker_is_given_up_leaves_no_draft_and_the_rest_goes_on(tmp_path):
    settings = {"diary": str(tmp_path / "diary")}
    made = sweep(Dying, seeds=3, steps=1, settings=settings, out=tmp_path, jobs=2, record={})
    table = made.frame()
    assert table["error"].dropna().to_dict() == {1: "WorkerDiedError: the process died in each of 3 tries"}
    assert seeds_run(tmp_path / "diary")[2] == 3
    assert (made.failed, table["recording"].isna().tolist()) == (1, [False, True, False])
    assert [path.suffix for path in (tmp_path / "recordings").iterdir()] == [".arrow"] * 2


def test_what_is_left_of_a_recording_is_deleted_unless_it_is_still_written_to(tmp_path):
    archive = Archive(tmp_path, {})
    drafts = [draft_name(archive.file(key), 0) for key in ("0a", "0b")]
    for draft in drafts:
        draft.write_bytes(b"some of it")
    with open(drafts[1], "rb", buffering=0) as file:
        lock(file)
        for key in ("0a", "0b", "0c"):
            archive.clear(key)
        assert list(tmp_path.iterdir()) == [drafts[1]]


def test_a_model_is_recorded_in_a_folder_that_is_made_if_it_is_missing(tmp_path):
    file = tmp_path / "runs" / "1.arrow"
    model = FIRE(n_robots=2, rng=1)
    with recorded(model, file, {"every": 2}):
        model.run(4)
    assert Recording(file).steps.tolist() == [2, 4]
