import os

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Frame, Recording
from mesa_swarm.recording.frames import events_of
from mesa_swarm.recording.provenance import join_sceneries, shows


def equal(one, two):
    return (
        one.step == two.step
        and one.state_hash == two.state_hash
        and one.columns.keys() == two.columns.keys()
        and all(one[name].tobytes() == two[name].tobytes() for name in one.columns)
    )


def test_seeking_finds_what_playing_shows(recorded):
    played = list(Recording(recorded))
    seeking = Recording(recorded)
    for row in np.random.default_rng(1).permutation(len(played)).tolist():
        assert equal(seeking[row], played[row])
        assert equal(seeking.at(row + 1), played[row])
    assert equal(seeking[-1], played[-1])


def test_rows_and_steps_that_are_not_there_are_refused(recorded):
    recording = Recording(recorded)
    for row in (600, -601):
        with pytest.raises(IndexError, match="of 600"):
            recording[row]
    for step in (0, 601):
        with pytest.raises(InvalidValueError, match="the recording has 600 steps from 1 to 600"):
            recording.at(step)
    with pytest.raises(UnknownNameError, match="did you mean 'position'"):
        recording["positio"]
    with pytest.raises(InvalidValueError, match="to_pandas"):
        recording["fires"]


def test_frames_cannot_be_written_to(recorded):
    with pytest.raises(ValueError, match="read-only"):
        Recording(recorded)[0]["position"][0] = 1.0


def test_a_column_at_all_steps_has_its_shape(recorded):
    recording = Recording(recorded)
    assert recording["position"].shape == (600, 12, 2)
    assert recording["heading"].dtype == np.float32
    assert recording["kind"].shape == (600, 12, recording[0]["distance"].shape[1])
    assert recording["layer"].dtype == np.int32


def test_tables_have_a_row_for_each_robot_or_fire_and_step(recorded):
    recording = Recording(recorded)
    robots, fires = recording.to_pandas(), recording.to_pandas("fires")
    assert len(robots) == 600 * 12
    assert robots[["x", "y"]].to_numpy().reshape(600, 12, 2).tobytes() == recording["position"].tobytes()
    assert fires["fire"].tolist() == [*range(1, 8)] * 600
    assert len(fires) == 600 * 7
    assert len(recording.to_pandas("contacts")) == sum(len(frame["contacts"]) for frame in recording)
    with pytest.raises(UnknownNameError, match="known: robots, fires"):
        recording.to_pandas("fire_s")


def test_a_model_without_robots_can_be_recorded_and_read(tmp_path):
    model = SwarmModel(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(3)
    recording = Recording(tmp_path / "run.arrow")
    assert recording["position"].shape == (3, 0, 2)
    assert len(recording.to_pandas()) == 0
    assert recording.events() == []


def test_an_empty_recording_has_no_frames(tmp_path):
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 1)
    model.record(tmp_path / "run.arrow").close()
    recording = Recording(tmp_path / "run.arrow")
    assert (len(recording), list(recording), recording.events(), len(recording.to_pandas())) == (0, [], [], 0)
    with pytest.raises(InvalidValueError, match="the recording has no step"):
        recording.at(1)


def test_a_recording_can_be_read_while_it_is_written(tmp_path):
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 3)
    recorder = model.record(tmp_path / "run.arrow")
    model.run(10)
    recorder.flush()
    model.run(5)
    early = Recording(tmp_path / "run.arrow")
    recorder.close()
    assert (len(early), early.complete) == (10, False)
    assert len(Recording(tmp_path / "run.arrow")) == 15


@pytest.mark.skipif(os.name == "nt", reason="Windows replaces no file that is open")
def test_a_recording_that_is_replaced_while_it_is_read_stays_readable(tmp_path):
    path = tmp_path / "run.arrow"
    model = FireFighting(rng=1)
    with model.record(path):
        model.run(600)
    old = Recording(path)
    FireFighting(rng=2).record(path, overwrite=True).close()
    assert old["position"].shape == (600, 10, 2)
    assert len(Recording(path)) == 0


def test_fires_that_went_out_are_events(tmp_path):
    model = FireFighting(n_robots=30, rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(3000)
    found = {
        (event.ids[0], event.text): event.step
        for event in Recording(tmp_path / "run.arrow").events()
        if event.kind == "fire out"
    }
    assert [fire.unique_id for fire in model.fires] != list(range(1, len(model.fires) + 1))
    assert found == {
        (fire.unique_id, f"fire {number} is out"): step
        for number, (fire, step) in enumerate(zip(model.fires, model.fires.out_step.tolist(), strict=True), start=1)
    }


def frame(step, position=None, contacts=()):
    table = np.array([(robot,) for robot in contacts], [("robot", np.int32)])
    columns = {"contacts": table}
    if position is not None:
        columns["position"] = np.array(position, float)
    robots = np.arange(0 if position is None else len(position), dtype=np.int32)
    return Frame(step=step, state_hash=None, robots=robots, columns=columns)


def test_collisions_of_many_robots_near_in_time_are_one_burst():
    frames = [frame(step, contacts=range(6) if step in (3, 9, 40) else range(2)) for step in range(1, 60)]
    events = events_of(frames)
    assert [(event.step, event.kind) for event in events] == [(3, "collision burst"), (40, "collision burst")]
    assert events[0].text == "up to 6 robots collide at once until step 9"
    assert events[0].ids == (0, 1, 2, 3, 4, 5)


def test_two_groups_that_become_one_are_a_merge():
    def rows(gap):
        return [(20.0 * i, 0.0) for i in range(3)] + [(40.0 + gap + 20.0 * i, 0.0) for i in range(3)]

    frames = [frame(step, rows(100.0 if step < 25 else 20.0)) for step in range(1, 60)]
    (event,) = events_of(frames)
    assert (event.step, event.kind, event.ids) == (31, "merge", (0, 1, 2, 3, 4, 5))
    assert str(event) == "step 31: 2 groups have become one of 6 robots"


def test_a_slice_is_a_list_of_frames(recorded):
    recording = Recording(recorded)
    assert [frame.step for frame in recording[:3]] == [1, 2, 3]
    assert [frame.step for frame in recording[-1:-600:-200]] == [600, 400, 200]
    assert recording[700:] == []


@pytest.mark.parametrize("wrong", [1.5, None, (1, 2), [0]])
def test_what_is_no_row_and_no_column_is_refused_in_one_line(recorded, wrong):
    with pytest.raises(InvalidValueError, match=r"row is .*; expected a whole number, a slice or the name of a column"):
        Recording(recorded)[wrong]


def test_numbers_of_numpy_are_rows(recorded):
    assert Recording(recorded)[np.int64(2)].step == 3


def test_a_frame_shows_its_step_robots_and_columns_in_one_line(recorded):
    recording = Recording(recorded)
    names = ", ".join(recording.columns)
    assert repr(recording[4]) == f"<Frame of step 5, 12 robots: {names}>"


def test_each_scenery_of_a_run_has_the_robots_and_designs_of_all_and_its_own_shapes():
    early = {"designs": ["a"], "robots": [[1, 2, 0]], "loads": [], "shapes": ["wall"]}
    late = {"designs": ["b", "a"], "robots": [[2, 2, 1], [5, 6, 0]], "loads": [], "shapes": []}
    (_, first), (_, second) = join_sceneries([(0, early), (9, late)])
    assert (first["designs"], first["robots"]) == (["a", "b"], [[1, 2, 0], [5, 6, 1]])
    assert (first["shapes"], second) == (["wall"], {**first, "shapes": []})


def test_a_scenery_that_only_lost_robots_is_not_stored_again():
    assert shows({"robots": [[5, 7, 0]], "leave": 1.0}, {"robots": [[5, 5, 0], [7, 7, 0]], "leave": 1.0})
    assert not shows({"robots": [[5, 7, 0]], "leave": 1.0}, {"robots": [[5, 8, 0]], "leave": 1.0})
