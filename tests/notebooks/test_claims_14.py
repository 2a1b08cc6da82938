"""Claims of notebook 14 on fresh seeds."""

import pytest

from mesa_swarm.experiments.statistics import mean_interval, paired_difference
from support.exercises import names_of

SEEDS = range(1001, 1021)

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Return the share of the room visited with each seed, by what robots do with marks, as the notebook's cells do."""
    return names_of(14, "setup", "model", folder=tmp_path_factory.mktemp("claims"), SEEDS=SEEDS)["found"]


def change(found, kind: str, other: str = "ignored"):
    """Return the interval of the mean difference to another kind with the same seeds."""
    return paired_difference(found[other], found[kind])[0]


def test_robots_that_follow_marks_visit_less_than_those_that_ignore_them(found):
    assert change(found, "followed").high < -0.2
    assert mean_interval(found["followed"]).high < 0.5


def test_robots_that_avoid_marks_visit_more_than_those_that_ignore_them(found):
    assert change(found, "avoided").low > 0


def test_marks_that_last_fifty_steps_make_robots_visit_less_than_without(found):
    assert change(found, "avoided, short-lived").high < 0
    assert change(found, "avoided, short-lived", "avoided").high < 0


def test_robots_that_avoid_marks_visit_more_than_robots_that_wander_at_random(found):
    assert change(found, "avoided", "wandering at random").low > 0
