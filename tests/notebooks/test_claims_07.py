"""Claims of notebook 07 on fresh seeds."""

import numpy as np
import pytest

from mesa_swarm.experiments.statistics import mean_interval, share_interval
from support.exercises import names_of

SEEDS = range(1001, 1021)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Return the names that the notebook's cells define, run with fresh seeds."""
    cells = ("setup", "compare", "many", "history", "together")
    return names_of(7, *cells, folder=tmp_path_factory.mktemp("claims"), SEEDS=SEEDS)


def runs_that_put_out_all(place, strategy):
    numbers = place["found"].column(strategy, "fires out")
    return share_interval(numbers.count(7), len(numbers))


@pytest.mark.long
class TestStrategies:
    def test_b_puts_out_all_fires_and_a_does_not(self, place):
        assert runs_that_put_out_all(place, "A").high < 0.2
        assert runs_that_put_out_all(place, "B").low > 0.8

    def test_the_six_small_fires_go_out_under_both(self, place):
        for strategy in ("A", "B"):
            for fire in place["SMALL"]:
                assert None not in place["found"].column(strategy, f"fire {fire} out at")

    def test_corrected_for_six_comparisons_fires_3_and_7_are_out_later_under_b_and_fire_4_is_undecided(self, place):
        corrected = {fire: limits for fire, (_, limits) in place["later_under_b"](place["found"]).items()}
        assert {fire for fire, limits in corrected.items() if limits.low > 0} == {3, 7}
        assert not any(limits.high < 0 for limits in corrected.values())

    def test_two_robots_are_at_the_largest_fire_often_under_b_and_hardly_ever_under_a(self, place):
        assert len(place["shares"]["A"]) == len(SEEDS)
        assert mean_interval(place["shares"]["A"]).high < 0.05
        assert mean_interval(place["shares"]["B"]).low > 0.3
        assert mean_interval(np.subtract(place["shares"]["B"], place["shares"]["A"])).low > 0.3

    def test_with_the_seed_that_is_drawn_two_robots_meet_once_under_a_and_cool_the_fire_by_three_hundredths(
        self, place
    ):
        steps, temperature, robots = place["largest_fire"]("A", 1)
        together = steps[robots >= 2]
        assert together.max() - together.min() < 100
        assert together.min() < 600 < together.max()
        assert round(1 - temperature.min(), 2) == 0.03
        assert temperature[-1] == 1

    def test_the_largest_fire_takes_1_19_robots(self, place):
        model = place["FireFighting"](rng=1)
        assert round(place["robots_needed"](model.fire_constants, model.fires.area.max()), 2) == 1.19
