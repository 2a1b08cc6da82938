"""Claims of notebook 05 on fresh seeds."""

import numpy as np
import pytest

from mesa_swarm.experiments.statistics import bootstrap_mean, mean_interval
from support.exercises import ROOT, cells_of, names_of

PATH = ROOT / "notebooks" / "05_chains_and_leaders.ipynb"
SEEDS = range(1001, 1021)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return the length of chains, the meetings and those that disperse: a column each, a row a seed, by rule."""
    place = names_of(5, "setup", "chain-run", folder=tmp_path_factory.mktemp("claims"))
    chain_run, rules = place["chain_run"], place["RULES"]
    return {name: np.array([chain_run(seed, **rules[name]) for seed in SEEDS]) for name in rules}


def lengths(runs, name):
    return runs[name][:, 0]


def rounded(interval):
    return [round(number, 1) for number in (interval.estimate, interval.low, interval.high)]


@pytest.mark.long
class TestRules:
    def test_any_effect_of_the_gap_rule_is_smaller_than_a_quarter_of_a_chain_and_of_unknown_sign(self, runs):
        difference = bootstrap_mean(lengths(runs, "gap rule") - lengths(runs, "no rule"))
        assert not difference.excludes_zero
        quarter = 0.25 * lengths(runs, "no rule").mean()
        assert -quarter < difference.low < difference.high < quarter

    def test_the_leader_rule_makes_chains_shorter_by_more_than_a_robot(self, runs):
        assert bootstrap_mean(lengths(runs, "gap and leader rule") - lengths(runs, "gap rule")).high < -1

    def test_with_the_leader_rule_at_most_a_tenth_of_the_meetings_disperse_and_about_half_without(self, runs):
        shares = {name: mean_interval(table[:, 2] / table[:, 1]) for name, table in runs.items()}
        assert shares["gap and leader rule"].high <= 0.1
        assert 0.4 <= shares["gap rule"].low < shares["gap rule"].high <= 0.5

    def test_with_the_leader_rule_there_are_less_than_half_as_many_meetings(self, runs):
        met = mean_interval(runs["gap and leader rule"][:, 1] - 0.5 * runs["gap rule"][:, 1])
        assert met.high < 0

    def test_the_text_states_what_was_measured(self, runs):
        text = cells_of(PATH)["results"]
        assert [rounded(mean_interval(lengths(runs, name))) for name in runs] == [
            [5.0, 4.2, 5.7],
            [4.9, 4.3, 5.4],
            [2.8, 2.6, 3.0],
        ]
        assert "5.0 robots per chain with it [4.2, 5.7] and 4.9 without [4.3, 5.4]" in text
        assert rounded(bootstrap_mean(lengths(runs, "gap rule") - lengths(runs, "no rule"))) == [0.1, -0.6, 1.1]
        shorter = bootstrap_mean(lengths(runs, "gap rule") - lengths(runs, "gap and leader rule"))
        assert rounded(shorter) == [2.2, 1.6, 3.3]
        assert "shorter by 2.2 robots [1.6, 3.3], 2.8 instead of 5.0" in " ".join(text.split())
