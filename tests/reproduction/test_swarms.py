"""The thesis's results on swarms (5.3), over fixed seeds: what holds, and what does not.

Verdicts are what came out, not what was wished for. A change of the code that changes one is to be looked into.
"""

import pytest

from mesa_swarm.experiments.reproduction import (
    agglomeration_run,
    chain_run,
    claims,
    exploration_run,
    runs_of,
)
from mesa_swarm.experiments.statistics import mean_interval, paired_difference

pytestmark = pytest.mark.slow
SEEDS = list(range(40))


def column(runs, measure):
    return [run[measure] for run in runs]


class TestExploration:
    """One avoiding robot on the map `original`, for 60,000 steps."""

    def test_it_visits_nearly_all_that_it_can_reach_without_a_collision(self):
        runs = runs_of(exploration_run, {}, SEEDS[:20])
        visited = column(runs, "coverage")
        assert sum(share >= 0.95 for share in visited) >= 18
        assert mean_interval(visited).estimate >= 0.95
        assert column(runs, "collisions") == [0] * 20

    def test_random_turns_change_little_for_this_robot_and_much_for_one_that_falls_into_an_orbit(self):
        quick = [column(runs_of(exploration_run, {"turn_interval": t}, SEEDS[:20]), "coverage") for t in (0, 100)]
        difference, _ = paired_difference(*quick)
        assert abs(difference.estimate) < 0.05
        slow = {"design": "AGENT9", "max_speed": 1.0, "distance": 15.0, "spot_distance": 0.0}
        plain, turning = (
            column(runs_of(exploration_run, {**slow, "turn_interval": t}, SEEDS[:20]), "coverage") for t in (0, 200)
        )
        assert mean_interval(plain).high < 0.25
        assert mean_interval(turning).low > 0.5


class TestAgglomeration:
    @pytest.mark.parametrize("step", [1000, 3000])
    def test_robots_end_nearer_to_each_other_than_half_of_what_chance_had_put_them(self, step):
        spacing = mean_interval(column(runs_of(agglomeration_run, {}, SEEDS), f"spacing at {step}"))
        assert spacing.high < 0.5

    @pytest.mark.parametrize("step", [1000, 3000])
    def test_there_are_several_groups_and_never_one(self, step):
        runs = runs_of(agglomeration_run, {}, SEEDS)
        assert min(column(runs, f"groups at {step}")) > 1
        assert mean_interval(column(runs, f"local convergence at {step}")).low > 0.5


class TestChains:
    """The claims that the thesis makes from one run each; see docs/reproduction.md for the figures."""

    @pytest.mark.parametrize(
        ("claim", "verdict"),
        list(zip(claims(), ("refuted", "confirmed", "confirmed", "not confirmed", "confirmed"), strict=True)),
        ids=[claim.words for claim in claims()],
    )
    def test_a_claim_has_the_verdict_that_was_reported(self, claim, verdict):
        finding = claim.test(SEEDS)
        assert finding.pairs == len(SEEDS)
        assert finding.verdict == verdict, str(finding)

    def test_fewer_head_on_meetings_end_in_dispersal_with_the_leader_rule(self):
        without, with_rule = (runs_of(chain_run, settings, SEEDS) for settings in ({}, {"head_on": "on"}))
        for measure in ("dispersals", "share dispersed"):
            difference, pairs = paired_difference(column(without, measure), column(with_rule, measure))
            assert difference.high < 0
            assert pairs == len(SEEDS)

    def test_without_the_leader_rule_about_half_of_all_head_on_meetings_end_in_dispersal(self):
        share = mean_interval(column(runs_of(chain_run, {}, SEEDS), "share dispersed"))
        assert 0.3 < share.low < share.high < 0.7
