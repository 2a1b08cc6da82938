"""Claims of notebook 08 on fresh seeds."""

import pytest

from mesa_swarm.experiments.statistics import mean_interval, share_interval
from support.exercises import names_of

SEEDS = range(1001, 1021)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Return the names that the notebook's cells define, run with fresh seeds."""
    cells = ("setup", "ranges", "content", "nearest")
    return names_of(8, *cells, folder=tmp_path_factory.mktemp("claims"), SEEDS=SEEDS)


def succeeded(place, reach):
    """Return the share of runs in which all fires were out, for each content."""
    shares = []
    for by_range in place["out"].values():
        times = by_range[reach]
        assert len(times) == len(SEEDS)
        shares.append(share_interval(sum(t is not None for t in times), len(times)))
    return shares


@pytest.mark.long
class TestRange:
    def test_with_100_units_messages_hardly_help(self, place):
        assert all(share.high < 1 / 3 for share in succeeded(place, 100))

    def test_with_150_units_some_runs_succeed_and_some_do_not(self, place):
        assert all(share.low > 0.25 and share.high < 0.9 for share in succeeded(place, 150))

    def test_with_200_units_or_more_most_runs_succeed(self, place):
        for reach in (200, 400):
            assert all(share.low > 0.75 for share in succeeded(place, reach))

    def test_robots_at_random_positions_are_on_average_between_100_and_125_units_from_the_nearest_other(self, place):
        nearest = mean_interval([place["nearest_other"](rng).mean() for rng in range(1001, 1101)])
        assert 100 < nearest.low < nearest.high < 125


@pytest.mark.long
class TestContent:
    @pytest.mark.parametrize("reach", [100, 150, 200, 400])
    def test_at_no_range_these_runs_decide_between_state_and_goal(self, place, reach):
        assert not place["goal_minus_state"](place["out"], reach).excludes_zero
