"""Claims of notebook 2 on fresh seeds."""

import numpy as np
import pytest

from mesa_swarm.experiments.statistics import bootstrap_mean, paired_difference
from support.exercises import names_of

pytestmark = pytest.mark.long
SEEDS = range(1001, 1041)
WALLS, ROBOTS = 0, 1


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return the collisions of each run with walls and with robots, by the sensors' errors."""
    place = names_of(2, "setup", "collisions", folder=tmp_path_factory.mktemp("cells"))
    return {
        name: np.array([place["collisions"](seed, **errors) for seed in SEEDS])
        for name, errors in place["ERRORS"].items()
    }


def more_than_exact(runs, name, column):
    """Return the interval of the paired difference to exact readings."""
    return paired_difference(runs["exact"][:, column], runs[name][:, column])[0]


def test_with_exact_readings_robots_seldom_hit_walls(runs):
    assert bootstrap_mean(runs["exact"][:, WALLS]).high < 5


@pytest.mark.parametrize("name", ["20 % off", "10 steps"])
def test_small_errors_and_short_delays_add_less_than_two_collisions_with_walls(runs, name):
    more = more_than_exact(runs, name, WALLS)
    assert more.high < 2
    assert not more.excludes_zero


@pytest.mark.parametrize("name", ["50 % off", "90 % off"])
def test_large_errors_add_a_few_collisions_with_walls(runs, name):
    more = more_than_exact(runs, name, WALLS)
    assert more.low > 1
    assert more.high < 7


def test_old_readings_add_many_collisions_with_walls_and_older_ones_more(runs):
    twenty, forty = (bootstrap_mean(runs[name][:, WALLS]) for name in ("20 steps", "40 steps"))
    assert 75 < twenty.low < twenty.high < 110
    assert 300 < forty.low < forty.high < 370
    worst, _ = paired_difference(runs["50 % off"][:, WALLS], runs["20 steps"][:, WALLS])
    assert worst.low > 60


def test_a_few_runs_have_most_collisions_between_robots(runs):
    counts = np.sort(runs["exact"][:, ROBOTS])
    assert counts[-10:].sum() / counts.sum() == pytest.approx(0.96, abs=0.005)


@pytest.mark.parametrize("name", ["20 % off", "50 % off", "90 % off"])
def test_wrong_readings_make_no_visible_difference_to_collisions_between_robots(runs, name):
    assert not more_than_exact(runs, name, ROBOTS).excludes_zero


@pytest.mark.parametrize("name", ["10 steps", "20 steps", "40 steps"])
def test_old_readings_reduce_collisions_between_robots(runs, name):
    assert more_than_exact(runs, name, ROBOTS).high < 0
