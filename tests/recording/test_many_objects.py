"""Recordings of many robots: what is stored of each one must not take long for all of them."""

import pytest

from mesa_swarm import AGENT3, AGENT9, SwarmModel, disc
from mesa_swarm.recording import Recording, recorder, resume
from support.pace import work_within


def scattered(robots):
    model = SwarmModel(rng=1)
    model.add_robots(AGENT3, robots // 2, group="first")
    model.add_obstacle(disc((400, 300), 10))
    model.add_robots(AGENT9, robots // 2)
    model.remove_robots(model.robots[3:20:4])
    return model


def test_robots_that_no_constructor_makes_are_restored_with_their_numbers_designs_and_groups(tmp_path):
    model = scattered(60)
    model.robots[5].task_of_mine = "lead"
    with model.record(tmp_path / "run.arrow"):
        model.run(12)
    twin = resume(SwarmModel, tmp_path / "run.arrow")
    assert twin.state_hash() == model.state_hash()
    assert [robot.unique_id for robot in twin.robots] == [robot.unique_id for robot in model.robots]
    assert [robot.design for robot in twin.robots] == [robot.design for robot in model.robots]
    assert [agent.unique_id for agent in twin.agents] == [agent.unique_id for agent in model.agents]
    assert [robot.group for robot in twin.robots] == [robot.group for robot in model.robots]
    assert twin.robots[5].task_of_mine == "lead"
    assert twin.add_robots(AGENT3, 1)[0].unique_id == model.add_robots(AGENT3, 1)[0].unique_id


@pytest.mark.slow
def test_five_thousand_robots_are_restored_within_a_second(tmp_path):
    model = SwarmModel(rng=1)
    model.add_robots(AGENT3, poses=[(10 + k % 100, 10 + k // 100, 0.0) for k in range(5000)])
    model.record(tmp_path / "run.arrow").close()
    assert Recording(tmp_path / "run.arrow").checkpoints
    with work_within(1):
        assert len(resume(SwarmModel, tmp_path / "run.arrow", step=0).swarm) == 5000


def counted_states(monkeypatch):
    """Return a list that grows by one whenever a recorder makes a state."""
    made, original = [], recorder.checkpoint_of
    monkeypatch.setattr(
        recorder, "checkpoint_of", lambda *values, **named: [made.append(1), original(*values, **named)][1]
    )
    return made


def test_a_state_that_cannot_be_stored_is_tried_once_when_a_recording_begins(tmp_path, monkeypatch):
    tried = counted_states(monkeypatch)
    model = SwarmModel(rng=1)
    model.held = object()
    with pytest.warns(UserWarning, match="without checkpoints"):
        made = model.record(tmp_path / "run.arrow")
    assert len(tried) == 1
    assert "held" in made.why_no_checkpoint
    model.run(3)
    made.close()
    assert len(tried) == 1


def test_a_state_with_which_a_recording_begins_is_made_once(tmp_path, monkeypatch):
    made = counted_states(monkeypatch)
    with SwarmModel(rng=1).record(tmp_path / "run.arrow") as recording:
        assert recording.checkpoints == (0,)
    assert len(made) == 1
