"""Claims of notebook 9 on fresh seeds."""

import pytest

from mesa_swarm.experiments.statistics import mean_interval
from support.exercises import names_of

SEEDS = range(1001, 1021)

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def notebook(tmp_path_factory):
    """Return what the notebook's own cells define."""
    return names_of(9, "setup", "lesson", "recipe", folder=tmp_path_factory.mktemp("claims"))


@pytest.fixture(scope="module")
def gap(notebook):
    """Return a function: by how much a measure is larger with the first beta than with the second, with its limits."""
    rows = {beta: [notebook["measured"](notebook["lesson"](beta, rng)) for rng in SEEDS] for beta in notebook["BETAS"]}
    return lambda first, second, name: notebook["difference"](rows, first, second, name)


@pytest.fixture(scope="module")
def drives(notebook):
    """Return the drives of frozen policies, each after a training of its own, by whether networks are shared."""
    train, reloaded, drive = (notebook[name] for name in ("train", "reloaded", "drive"))
    return {shared: [drive(reloaded(train(rng, shared)), rng) for rng in SEEDS] for shared in (False, True)}


class TestExploration:
    @pytest.mark.parametrize("other", [0.0, 1e-4, 5e-4])
    def test_with_the_quickest_cooling_robots_have_the_fewest_collisions_in_total(self, gap, other):
        assert gap(5e-3, other, "in total").high < 0

    @pytest.mark.parametrize("other", [0.0, 1e-4, 5e-4])
    def test_with_the_quickest_cooling_robots_have_the_most_collisions_at_first(self, gap, other):
        assert gap(5e-3, other, "at first").low > 10

    @pytest.mark.parametrize("other", [0.0, 5e-4, 5e-3])
    def test_with_the_slowest_cooling_robots_have_the_most_collisions_in_total(self, gap, other):
        assert gap(1e-4, other, "in total").low > 0

    @pytest.mark.parametrize(("slower", "faster"), [(0.0, 1e-4), (1e-4, 5e-4), (1e-4, 5e-3)])
    def test_robots_that_remain_warmer_drive_ahead_more_slowly_at_last(self, gap, slower, faster):
        assert gap(slower, faster, "speed ahead").high < 0

    def test_with_the_quickest_cooling_robots_drive_ahead_a_little_more_slowly_at_last_than_with_the_next(self, gap):
        speed = gap(5e-3, 5e-4, "speed ahead")
        assert speed.low > -0.2
        assert speed.high < 0


class TestFrozenPolicies:
    def test_with_own_networks_robots_collide_more_than_with_shared_ones(self, drives):
        gaps = [own["collisions"] - one["collisions"] for own, one in zip(drives[False], drives[True], strict=True)]
        assert mean_interval(gaps).low > 5

    @pytest.mark.parametrize("shared", [False, True])
    def test_both_drive_ahead_at_more_than_80_percent_of_full_speed(self, drives, shared):
        assert mean_interval([drive["speed ahead"] for drive in drives[shared]]).low > 0.8
