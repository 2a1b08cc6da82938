"""What a recording holds of steps that failed, and that one can go on after them."""

import pytest

from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording, verify


def test_a_step_that_failed_leaves_a_recording_that_resumes(tmp_path, monkeypatch):
    class Moody(FireFighting):
        fails = False

        def step(self):
            super().step()
            if self.fails:
                raise ValueError("not today")

    model = Moody(n_robots=3, rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(5)
        Moody.fails = True
        with pytest.raises(ValueError, match="not today"):
            model.step()
        Moody.fails = False
        model.step()
        model.step()
    recording = Recording(tmp_path / "run.arrow")
    assert recording.steps.tolist() == [1, 2, 3, 4, 5, 6, 7, 8]
    again = Moody.resume(recording.path, step=6)
    again.step()
    again.step()
    assert again.state_hash() == model.state_hash()
    assert again.steps == model.steps


def test_the_row_of_a_step_that_failed_is_what_the_step_left_whatever_is_changed_after_it(tmp_path):
    class Moody(FireFighting):
        fails = False

        def step(self):
            super().step()
            if Moody.fails:
                raise ValueError("not today")

    path, model = tmp_path / "run.arrow", Moody(n_robots=3, rng=1)
    with model.record(path, exact=True):
        model.run(4)
        Moody.fails = True
        with pytest.raises(ValueError, match="not today"):
            model.step()
        left, Moody.fails = float(model.swarm.heading[0]), False
        model.robots[0].heading = left + 1.0
        model.run(3)
    assert Recording(path).at(5)["heading"][0] == left
    assert verify(Recording(path), Moody).same


def test_a_state_stored_after_a_step_that_failed_makes_up_for_one_that_could_not_be(tmp_path):
    class Moody(FireFighting):
        fails = False

        def step(self):
            if Moody.fails:
                raise ArithmeticError
            super().step()

    path, model = tmp_path / "run.arrow", Moody(n_robots=5, rng=1)
    with model.record(path):
        model.run(5)
        model.friend, Moody.fails = object(), True
        with pytest.raises(ArithmeticError):
            model.step()
        model.friend, Moody.fails = None, False
        model.run(5)
    recording = Recording(path)
    assert [(one.step, one.checkpoint) for one in recording.interventions] == [(5, None), (5, 1)]
    verification = verify(recording, Moody)
    assert (verification.same, len(verification.interventions)) == (True, 1)
    assert [Moody.resume(path, step=step).completed for step in (5, 8)] == [5, 8]
