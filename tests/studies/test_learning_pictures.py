"""Figures 8.2 to 8.4 name what they show and hold all that they draw; the reward laboratory's figure has a key."""

import numpy as np
import pytest

from mesa_swarm.experiments.learning_figures import CRITICAL_NAME, MARKS, reward_figure
from mesa_swarm.learning.reward_lab import reward_profile
from mesa_swarm_studies.thesis.learning import POINTS, frequency_figure


@pytest.mark.parametrize(("robots", "runs"), [(1, 1), (1, 3), (15, 2)])
def test_collisions_have_a_key_the_right_numbers_of_things_and_no_clipped_line(robots, runs):
    curve = np.zeros(301)
    curve[50] = 900.0
    rows = [{"curve": curve.tolist(), "temperature": np.linspace(1, 0.2, POINTS).tolist()}] * runs
    figure = frequency_figure(rows, robots, 1e-4, 3_300)
    axes = figure.axes[0]
    things = (f"{runs} run" + "s" * (runs > 1), f"{robots} robot" + "s" * (robots > 1))
    assert axes.get_title() == f"beta 0.0001, {things[0]} of {things[1]}"
    (key,) = figure.legends
    assert len(key.get_texts()) == 3
    assert key.get_texts()[0].get_text() == f"collisions, mean of {things[0]}"
    lines = [line for one in figure.axes for line in one.lines if len(line.get_ydata())]
    assert all(np.max(line.get_ydata()) <= line.axes.get_ylim()[1] for line in lines)


@pytest.mark.parametrize(("kind", "marks"), [("a", {"leap", "plateau"}), ("c", {"plateau"})])
def test_the_key_of_rewards_names_the_actions_and_the_marks_that_occur(kind, marks):
    profile = reward_profile(kind, actions=4)
    (key,) = reward_figure({kind: (profile, profile)}).legends
    named = [text.get_text() for text in key.get_texts()]
    assert named[:4] == list(profile.actions)
    assert named[4:] == [*(name for mark, name in MARKS.items() if mark in marks), CRITICAL_NAME]
