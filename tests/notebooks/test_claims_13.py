"""Claims of notebook 13 on fresh seeds."""

import pytest

from mesa_swarm.experiments.statistics import mean_interval, paired_difference
from support.exercises import names_of


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Return the names that the notebook's cells define, run with fresh seeds."""
    seeds = {"MANY": range(1001, 1121), "SEEDS": range(1001, 1021)}
    return names_of(13, "setup", "five", "unpaired", "sweep", folder=tmp_path_factory.mktemp("claims"), **seeds)


def rounded(interval):
    return [round(number) for number in (interval.estimate, interval.low, interval.high)]


@pytest.mark.long
class TestPairs:
    def test_sixty_pairs_show_fewer_collisions_of_robots_that_turn_on_the_spot(self, place):
        difference, pairs = paired_difference(place["first"][:60], place["second"][:60])
        assert pairs == 60
        assert rounded(difference) == [-10, -15, -5]

    def test_results_with_the_same_seed_are_correlated(self, place):
        assert len(place["first"]) == 120
        _, _, *correlation = place["benefit"](place["first"], place["second"])
        assert [round(number, 2) for number in correlation] == [0.31, 0.14, 0.47]


@pytest.mark.long
class TestNumbersOfRobots:
    def test_corrected_for_four_comparisons_the_effect_is_shown_with_twenty_robots_only(self, place):
        shown = {n: mean_interval(place["effect"][n], 1 - 0.05 / 4) for n in place["NUMBERS"]}
        assert {n for n, interval in shown.items() if interval.excludes_zero} == {20}
        assert rounded(shown[20]) == [-16, -29, -2]

    def test_whether_the_effect_differs_between_two_and_twenty_robots_remains_open(self, place):
        assert not place["between"].excludes_zero
        assert rounded(place["between"]) == [-5, -26, 15]
