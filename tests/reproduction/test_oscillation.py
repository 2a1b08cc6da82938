"""The oscillations that the thesis reports of its learners (8.3): which occur, and their remedies.

Verdicts are results over 12 seeds, not aims: neither eight actions nor the reward without a leap
is shown to be the remedy that the thesis proposed.
"""

import pytest

from mesa_swarm.experiments.diagnosis import oscillations
from mesa_swarm.experiments.statistics import paired_difference

pytestmark = pytest.mark.slow
SEEDS = list(range(30, 42))
BESIDE, TOWARDS = "beside a wall", "towards a wall"
TURNS, TRAVEL = "turns to and fro", "back and forth"


@pytest.fixture(scope="module")
def rows():
    return oscillations([("a", 4), ("a", 8), ("b", 4), ("c", 4)], SEEDS, steps=8_000, jobs=2)


def difference(rows, scene, measure, first, second):
    """Second less first, paired by seed."""
    columns = [
        [row[measure] for row in rows if (row["scene"], row["reward"], row["actions"]) == (scene, *case)]
        for case in (first, second)
    ]
    assert [len(column) for column in columns] == [len(SEEDS)] * 2
    return paired_difference(*columns)[0]


def test_with_reward_a_and_four_actions_robots_turn_to_and_fro_beside_a_wall_which_with_b_they_hardly_do(rows):
    assert difference(rows, BESIDE, TURNS, ("b", 4), ("a", 4)).low > 0


def test_eight_actions_do_not_reliably_cure_that_beside_a_wall(rows):
    change = difference(rows, BESIDE, TURNS, ("a", 4), ("a", 8))
    assert change.estimate < 0 < change.high


def test_with_reward_b_robots_go_back_and_forth_before_a_wall_more_than_with_a(rows):
    assert difference(rows, TOWARDS, TRAVEL, ("a", 4), ("b", 4)).low > 0


def test_the_reward_without_a_leap_is_not_shown_to_cure_that(rows):
    change = difference(rows, TOWARDS, TRAVEL, ("b", 4), ("c", 4))
    assert change.low < 0 < change.high
