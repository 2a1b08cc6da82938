"""Figure 8.6: what its runs measure, and whose way it shows."""

import pytest

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.experiments.diagnosis import MEASURES, SCENES, oscillating_robot, trained
from mesa_swarm_studies.thesis.oscillations import (
    BESIDE,
    CASES,
    COLD,
    PANELS,
    THRESHOLD,
    TURNS,
    name_of,
    oscillation_run,
    trace_run,
)


@pytest.fixture(scope="module")
def policy():
    return trained("b", 4, 1, steps=50, n_robots=3)


@pytest.mark.slow
def test_each_watched_scene_has_both_measures_at_its_temperature():
    watched = [[scene, COLD] for scene in SCENES]
    run = oscillation_run(1, reward="a", actions=4, watched=watched, learned=20)
    assert list(run) == [name_of(scene, COLD, measure) for scene in SCENES for measure in (TURNS, THRESHOLD)]


def test_what_is_drawn_is_also_judged():
    assert all((scene, heat) in CASES[reward, actions] for _, reward, actions, scene, heat, _ in PANELS)


@pytest.mark.parametrize("scene", SCENES)
def test_the_robot_that_is_shown_is_one_of_those_that_are_measured(policy, scene):
    shown = oscillating_robot(policy, scene=scene, measure=MEASURES[1], steps=60)
    assert shown == oscillating_robot(policy, scene=scene, measure=MEASURES[1], steps=60, robot=shown["robot"])
    assert {len(shown[name]) for name in ("x", "y", "left", "right")} == {60}


@pytest.mark.slow
def test_the_way_of_a_robot_of_choice_begins_where_it_does_with_other_commands():
    first, second = (
        trace_run(1, reward=reward, actions=actions, scene=BESIDE, temperature=COLD, measure=TURNS, robot=2, learned=20)
        for reward, actions in (("a", 4), ("b", 8))
    )
    assert first["robot"] == second["robot"] == 2
    assert abs(first["x"][0] - second["x"][0]) <= 4.0


def test_a_robot_that_does_not_exist_is_refused(policy):
    with pytest.raises(InvalidValueError, match="robot is 3; expected a whole number"):
        oscillating_robot(policy, scene=BESIDE, measure=TURNS, robot=3, steps=20)
