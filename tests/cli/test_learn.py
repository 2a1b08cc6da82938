"""tune: its options, and what it prints of the result."""

import inspect

import pytest

from mesa_swarm.cli import learn
from mesa_swarm.searches.tuning import LEAST_SPEED, LearningGoal

QUICK = "--robots 2 --generations 1 --population 4 --seeds 1 --judged 2 --quiet"


@pytest.mark.parametrize(
    ("option", "limits"),
    [
        ("--judged 1", "2 to 1,000"),
        ("--judged 1001", "2 to 1,000"),
        ("--least-speed 3", "-1 to 1"),
        ("--population 3", "4 to 1,000"),
        ("--steps x", "1 to 1,000,000"),
    ],
)
def test_an_option_out_of_its_range_is_refused_with_the_whole_range_and_the_help_of_the_command(typed, option, limits):
    status, out, err = typed(f"tune {option}")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert option.split()[0] in err
    assert f"expected {limits} (mesa-swarm tune --help lists" in err


def test_the_help_of_all_commands_is_named_where_no_command_is_known(typed):
    assert "(mesa-swarm --help lists what is possible)" in typed("tunne")[2]


def test_the_speed_of_the_goal_is_that_of_a_learning_goal_by_default():
    option = inspect.signature(learn.tune_command).parameters["least_speed"].default
    assert (LearningGoal().least_speed if option is None else option) == LEAST_SPEED


def test_a_missed_speed_is_printed_under_the_table_and_one_that_is_reached_is_not(typed):
    status, out, _ = typed(f"tune --steps 20 --least-speed 1 {QUICK}")
    assert status == 0
    assert "the goal's speed was missed" in out.splitlines()[-1] + out.splitlines()[-2]
    assert "nan" not in out
    assert "missed" not in typed(f"tune --steps 20 --least-speed -1 {QUICK}")[1]
