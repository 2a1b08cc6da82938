"""Pictures of learning and of the reward laboratory show the numbers that they are made of."""

import csv
import io

import numpy as np
import pytest

from mesa_swarm import AGENT9
from mesa_swarm.analysis import central_moving_average
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.cli import main
from mesa_swarm.experiments.learning_figures import (
    TITLES,
    FireRun,
    LearningRun,
    fire_figure,
    learning_figure,
    learning_run,
    reward_figure,
)
from mesa_swarm.learning import QPolicy
from mesa_swarm.learning.reward_lab import learned_profile, reward_profile
from mesa_swarm.models.q_learning import QLearning


def line(axes, index=0):
    return axes.get_lines()[index].get_xydata()


@pytest.mark.parametrize(("n_robots", "window"), [(3, 1001), (1, 11)])
def test_collisions_are_smoothed_over_1001_steps_or_11_for_one_robot_and_the_total_is_the_sum(n_robots, window):
    collisions = np.random.default_rng(1).integers(0, n_robots + 1, 3000).astype(float)
    run = LearningRun(collisions, np.linspace(1, 0.2, 3000), n_robots)
    figure = learning_figure({1e-4: run})
    frequency, total, temperature = figure.axes
    assert line(frequency)[:, 1] == pytest.approx(central_moving_average(collisions / n_robots, window))
    assert line(total)[-1].tolist() == pytest.approx([3000, collisions.sum() / n_robots])
    assert line(temperature)[:, 1] == pytest.approx(run.temperature)


def test_a_learning_run_is_the_model_s():
    run = learning_run(beta=5e-3, rng=4, steps=150, n_robots=100)
    model = QLearning(beta=5e-3, rng=4, n_robots=100).run(150)
    assert run.collisions.sum() == model.total_collisions > 0
    assert run.n_robots == 100
    # T is that of each step's choice; the layer has already cooled it when it chose for the first time.
    assert run.temperature[-1] == pytest.approx(model.temperature, rel=0.01)


def test_no_runs_are_refused():
    with pytest.raises(InvalidValueError, match="runs is empty"):
        learning_figure({})


def test_a_curve_is_not_joined_across_its_leap():
    paid = reward_profile("b", actions=4)
    learned = learned_profile(QPolicy.untrained(AGENT9, rng=np.random.default_rng(1), actions=4), AGENT9)
    rewards, _, choice = reward_figure({"b": (paid, learned)}).axes
    forward = next(each for each in rewards.get_lines() if each.get_label() == "forward")
    assert np.isnan(forward.get_ydata()).sum() == 1
    shares = [each.get_ydata() for each in choice.get_lines() if each.get_label() in learned.actions]
    assert np.sum(shares, axis=0) == pytest.approx(np.ones(len(learned.distance)))


@pytest.mark.slow
def test_the_command_writes_a_picture_and_tables_and_prints_where_they_are(tmp_path, capsys):
    with pytest.raises(SystemExit) as status:
        main(["reward-lab", "--rewards", "b", "--steps", "30", "--out", str(tmp_path), "--quiet"])
    assert status.value.code == 0
    printed = capsys.readouterr().out
    assert "towards a wall" in printed
    assert "Means over 15 robots and 1 seed: flips of the turn, and of the direction of travel, per 100" in printed
    assert all(str(path) in printed for path in tmp_path.iterdir())
    assert (tmp_path / "reward_lab.png").read_bytes().startswith(b"\x89PNG")
    marks = list(csv.DictReader(io.StringIO((tmp_path / "marks.csv").read_text())))
    assert {m["action"]: float(m["size"]) for m in marks if m["mark"] == "leap"}["forward"] == pytest.approx(1.0)
    curves = list(csv.DictReader(io.StringIO((tmp_path / "curves.csv").read_text())))
    assert [row["r"] for row in curves if row["action"] == "forward"][-1] == "1.0"


@pytest.mark.parametrize("wrong", [("--rewards", "a,x"), ("--actions", "5"), ("--steps", "0")])
def test_the_command_refuses_nonsense_in_one_line(wrong, tmp_path, capsys):
    with pytest.raises(SystemExit) as status:
        main(["reward-lab", *wrong, "--out", str(tmp_path / "new")])
    assert status.value.code == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert not (tmp_path / "new").exists()


def test_the_picture_of_fires_has_a_dot_a_run_and_a_line_for_each_learner():
    def run(share):
        results = dict.fromkeys(TITLES, share)
        return FireRun(np.array([6000.0, 3000.0]), results)

    figure = fire_figure({"shared": [run(0.5), run(1.0)], "A": [run(0.0), run(None)]})
    largest, _, rounds = figure.axes
    assert line(largest)[:, 1].tolist() == [0.5, 1.0]
    assert line(rounds)[:, 1].tolist() == [6000.0, 3000.0]
    assert line(rounds, 1)[:, 1].tolist() == [4500.0, 4500.0]
    with pytest.raises(InvalidValueError, match="runs are missing"):
        fire_figure({"A": []})
