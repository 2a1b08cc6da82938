"""Running a model: steps, progress, what is collected, contacts, and a step that failed."""

import math
import re
from datetime import datetime

import numpy as np
import pytest

from mesa_swarm import ProximitySensor, RobotDesign, SwarmModel, disc, rectangle
from mesa_swarm.base import work_line as work_done
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.base.progress import finishing_time
from mesa_swarm.control import Subsumption
from support.scenes import ahead, blind, circle, empty


def test_run_takes_this_many_steps_and_returns_the_model():
    model = empty()
    assert model.run(7) is model
    assert model.run(0).steps == 7


def test_a_progress_bar_is_shown_when_asked_for_only(capsys, monkeypatch):
    monkeypatch.setattr(work_done, "always_drawn", True)
    empty().run(3)
    assert capsys.readouterr().err == ""
    empty().run(3, progress=True)
    shown = capsys.readouterr().err
    assert "3/3 steps" in shown
    assert "left, done at" in shown


def test_where_no_bar_can_move_one_line_is_printed_at_the_end(capsys):
    empty().run(3, progress=True)
    assert re.fullmatch(r"3 of 3 steps in [\d.]+ s\n", capsys.readouterr().err)


def test_the_time_at_which_work_is_done_has_its_day_if_that_is_not_today():
    now = datetime(2025, 1, 31, 23, 58, 30)
    assert finishing_time(60, 1.0, now) == "done at 23:59:30"
    assert finishing_time(3600, 0.5, now) == "done on 01 Feb at 01:58"


def test_run_stops_when_the_model_stops_running():
    class Short(SwarmModel):
        def step(self):
            super().step()
            self.running = self.steps < 4

    assert Short(rng=1).run(100).steps == 4


@pytest.mark.parametrize("steps", [-1, 2.5, math.nan, "3", None, True])
def test_a_wrong_number_of_steps_is_refused(steps):
    with pytest.raises(InvalidValueError, match="steps is"):
        empty().run(steps)


def test_data_are_collected_once_a_step_with_reporters_of_ones_own():
    model = empty(
        model_reporters={"mean_x": lambda m: float(m.swarm.position[:, 0].mean())},
        agent_reporters={"x": lambda a: float(a.position[0])},
    )
    model.add_robots(blind(), poses=[(385, 100, 0.0), (200, 200, 0.0)])
    model.control = Subsumption(ahead)
    model.run(12)
    frame = model.datacollector.get_model_vars_dataframe()
    assert list(frame) == ["collisions", "total_collisions", "mean_x"]
    expected = [(min(385 + k, 395) + 200 + k) / 2 for k in range(1, 13)]
    assert frame["mean_x"].tolist() == pytest.approx(expected, abs=1e-6)
    assert frame["collisions"].tolist() == [0] * 10 + [1] * 2
    assert frame["total_collisions"].iloc[-1] == model.total_collisions == 2
    agents = model.datacollector.get_agent_vars_dataframe()
    assert len(agents) == 24
    assert agents.loc[(12, 1), "x"] == pytest.approx(395, abs=1e-6)


# ---- contacts


def touching():
    """Return a model after a step in which robots met a wall, each other, a fire, the border, and nothing."""
    model = empty()
    other, wall = model.add_obstacle(disc((50, 250), 5)), model.add_obstacle(rectangle((200, 0), (220, 50)))
    fire = model.add_fire((300, 150), radius=20, temperature=1.0)
    poses = [(194.6, 25, 0.0), (100, 100, 0.0), (111, 100, math.pi), (274.5, 150, 0.0), (394.8, 250, 0.0)]
    poses.append((100, 200, 0.0))
    robots = model.add_robots(blind(), poses=poses)
    model.control = Subsumption(ahead)
    model.step()
    return model, robots, (other, wall, fire)


def test_contacts_name_who_met_what_where_and_how_deep():
    model, robots, (_, wall, fire) = touching()
    contacts, ids = model.contacts, [robot.unique_id for robot in robots]
    assert contacts.robot.tolist() == ids[:5]
    assert contacts.kind.tolist() == [0, 1, 1, 2, 0]
    assert contacts.other.tolist() == [wall.unique_id, ids[2], ids[1], fire.unique_id, -1]
    assert contacts.normal == pytest.approx(np.array([[-1, 0], [-1, 0], [1, 0], [-1, 0], [-1, 0]]), abs=1e-9)
    assert contacts.depth == pytest.approx([0.6, 1, 1, 0.5, 0.8], abs=1e-9)
    assert model.collisions == model.total_collisions == 5
    assert model.swarm.collided.tolist() == [True] * 5 + [False]


@pytest.mark.parametrize("gone", ["obstacle", "robot"])
def test_contacts_still_name_the_right_ones_when_something_else_is_removed_after_the_step(gone):
    model, robots, (other, *_) = touching()
    before = dict(zip(model.contacts.robot.tolist(), model.contacts.other.tolist(), strict=True))
    first = robots[0].unique_id
    (other if gone == "obstacle" else robots[0]).remove()
    after = dict(zip(model.contacts.robot.tolist(), model.contacts.other.tolist(), strict=True))
    if gone == "robot":
        del before[first]
    assert after == before


def test_contacts_are_of_the_last_step_only():
    model, _, _ = touching()
    model.control = Subsumption(circle(left=-1.0, right=-1.0))
    model.run(3)
    assert len(model.contacts.robot) == 0
    assert model.total_collisions == 5


def test_a_design_with_a_sensor_of_the_longest_range_sees_across_the_world():
    model = empty()
    model.add_robots(RobotDesign(sensors=(ProximitySensor(range=1e6),)), poses=[(100, 150, 0.0)])
    model.sense()
    assert model.swarm.distance.tolist() == [[295.0]]


def test_a_model_goes_on_after_a_step_that_failed():
    class Stumbles(SwarmModel):
        def step(self):
            if self.steps == 3:
                raise RuntimeError
            super().step()

    model = Stumbles(rng=1).run(2)
    with pytest.raises(RuntimeError):
        model.step()
    model.run(3)
    assert (model.steps, model.completed) == (6, 5)
