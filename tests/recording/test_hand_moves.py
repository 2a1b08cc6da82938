"""Driven bodies that a user's loop moves between recorded steps."""

from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel, disc, rectangle
from mesa_swarm.base.errors import RecordingError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.recording import Recording, verify
from mesa_swarm.recording.changes import moves_from_bytes
from mesa_swarm.recording.container import Checkpoint, to_bytes
from mesa_swarm.recording.recorder import RowBuffer


class Doors(SwarmModel):
    """A hall with doors that only its user moves; the step of a class of its own may fail."""

    fails_before = fails_after = 0

    def __init__(self, *, n_robots=8, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, n_robots)
        self.doors = [self.add_body(rectangle((x, 100), (x + 10, 160)), kind="door") for x in (100, 200, 300)]
        self.control = Subsumption(Avoid(distance=15), Explore())

    def step(self):
        if self.fails_before == self.completed + 1:
            raise OSError
        super().step()
        if self.fails_after == self.completed:
            raise OSError


def swing(model, step):
    for place, door in enumerate(model.doors[:2]):
        door.move_to((105 + 100 * place, 130 + 10 * np.sin(step + place), 0.1 * step))


def moved_by_hand(path, steps=30, model=None, **how):
    model = Doors(rng=4) if model is None else model
    model.step()  # from now on all doors travel
    with model.record(path, **how):
        for step in range(steps):
            swing(model, step)
            model.step()
    return model


def test_moves_by_hand_take_little_room_and_are_repeated(tmp_path):
    model = moved_by_hand(tmp_path / "run.arrow")
    recording = Recording(tmp_path / "run.arrow")
    assert recording.checkpoints == (1,)
    assert not recording.interventions
    assert [one.step for one in recording.hand_moves] == list(range(1, 31))
    verdict = verify(recording, Doors)
    assert verdict.same
    assert verdict.moved == 30
    assert str(verdict).endswith("; bodies moved by hand after 30 steps (repeated as recorded)")
    again = Doors.resume(tmp_path / "run.arrow")
    assert again.state_hash() == model.state_hash()


@pytest.mark.slow
@pytest.mark.parametrize("every", [1, 7])
@pytest.mark.parametrize("checkpoint_every", [0, 10])
def test_the_run_goes_on_from_any_step_with_the_same_moves(tmp_path, every, checkpoint_every):
    model = moved_by_hand(tmp_path / "run.arrow", steps=27, every=every, checkpoint_every=checkpoint_every)
    for begin in (5, 11, 14):
        again = Doors.resume(tmp_path / "run.arrow", step=begin)
        for step in range(begin - 1, 27):
            swing(again, step)
            again.step()
        assert again.state_hash() == model.state_hash()


def test_a_resumed_model_has_the_moves_that_were_made_after_that_very_step(tmp_path):
    moved_by_hand(tmp_path / "run.arrow", steps=12)
    again = Doors.resume(tmp_path / "run.arrow", step=6)
    assert again.movers.asked.tolist() == [True, True, False]
    assert again.movers.aim[0].tolist() == [105.0, 130 + 10 * np.sin(5)]


def test_a_move_with_another_change_is_stored_as_a_whole_state(tmp_path):
    model = Doors(rng=4).run(1)
    with model.record(tmp_path / "run.arrow"):
        for step in range(6):
            swing(model, step)
            if step == 3:
                model.robots[0].heading = 1.0
            model.step()
    recording = Recording(tmp_path / "run.arrow")
    assert recording.checkpoints == (1, 4)
    assert [one.step for one in recording.interventions] == [4]
    assert [one.step for one in recording.hand_moves] == [1, 2, 3, 5, 6]
    verdict = verify(recording, Doors)
    assert verdict.same
    assert verdict.moved == 5
    assert Doors.resume(tmp_path / "run.arrow").state_hash() == model.state_hash()


def test_a_body_that_was_placed_at_once_is_stored_as_a_whole_state(tmp_path):
    model = Doors(rng=4)
    with model.record(tmp_path / "run.arrow"):
        swing(model, 1)  # no step has been taken: the doors are there at once
        model.run(3)
    recording = Recording(tmp_path / "run.arrow")
    assert not recording.hand_moves
    assert [one.step for one in recording.interventions] == [0]
    assert verify(recording, Doors).same


@pytest.mark.parametrize("when", ["fails_before", "fails_after"])
def test_moves_before_a_step_that_failed_are_those_with_which_it_was_taken(tmp_path, when, monkeypatch):
    model = Doors(rng=4).run(1)
    monkeypatch.setattr(Doors, when, 5)
    with model.record(tmp_path / "run.arrow"):
        for step in range(10):
            swing(model, step)
            try:
                model.step()
            except OSError:
                monkeypatch.setattr(Doors, when, 0)
                swing(model, 50)
                model.step()
    assert verify(tmp_path / "run.arrow", Doors).same
    assert Doors.resume(tmp_path / "run.arrow").state_hash() == model.state_hash()


def test_what_is_written_twice_by_an_interrupt_counts_once(tmp_path, monkeypatch):
    write = RowBuffer._write_moves

    def twice(buffer):
        moves = list(buffer._moves)
        write(buffer)
        buffer._moves = moves
        write(buffer)

    monkeypatch.setattr(RowBuffer, "_write_moves", twice)
    moved_by_hand(tmp_path / "run.arrow")
    assert len(Recording(tmp_path / "run.arrow").hand_moves) == 30
    assert verify(tmp_path / "run.arrow", Doors).same


def test_a_recording_of_another_model_without_these_bodies_is_refused_in_one_line(tmp_path):
    moved_by_hand(tmp_path / "run.arrow")
    (move, *_) = Recording(tmp_path / "run.arrow").hand_moves
    with pytest.raises(RecordingError, match=r"^step 2 cannot be run again: a body that was moved by hand is missing$"):
        move.apply(SwarmModel(rng=1))
    model = SwarmModel(rng=4)
    bodies = [model.add_body(disc((20, 20), 1)) for _ in range(3)]
    for body, number in zip(bodies, move.bodies.tolist(), strict=False):
        body.unique_id = number
    move = replace(move, poses=move.poses - 1000)
    with pytest.raises(RecordingError, match=r"^step 2 cannot be run again: a body was moved off the map$"):
        move.apply(model)


HEADS, BODIES, POSES = np.array([[3, 1, 2]]), np.array([7, 8]), np.zeros((2, 3))


@pytest.mark.parametrize(
    "arrays",
    [
        (HEADS, BODIES),
        (HEADS, BODIES, POSES[:1]),
        (HEADS + 0.5, BODIES, POSES),
        (HEADS - 4, BODIES, POSES),
        (HEADS[:, :2], BODIES, POSES),
        (np.array([[3, 1, 1]]), BODIES, POSES),
        (np.array([[3, 1, 1], [2, 1, 1]]), BODIES, POSES),
    ],
)
def test_odd_stored_moves_are_refused_in_one_line(arrays):
    content = to_bytes(Checkpoint(step=3, state_hash="", facts={}, arrays=list(arrays)))
    with pytest.raises(RecordingError, match=r"^moves made by hand cannot be decoded$"):
        moves_from_bytes(content)
