"""Claims of notebook 06 on fresh seeds."""

import pytest

from mesa_swarm.experiments.statistics import bootstrap_mean, mean_interval
from mesa_swarm.models.boids import Boids
from support.exercises import ROOT, cells_of, names_of

PATH = ROOT / "notebooks" / "06_flocking_and_boids.ipynb"
SEEDS = range(1001, 1021)
AVOID, MATCH, BOIDS = "wheels, avoid and explore", "wheels, and match", "boids"


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Return what the notebook's own cells define, in full size."""
    return names_of(6, "setup", "means", folder=tmp_path_factory.mktemp("claims"))


@pytest.fixture(scope="module")
def cases(place):
    """Return the alignment and the polarization of all seeds, by case."""
    return {
        name: place["means_of"](kind, SEEDS, place["STEPS"], **settings)
        for name, (kind, settings) in place["CASES"].items()
    }


@pytest.fixture(scope="module")
def without(place):
    """Return the alignment of all seeds, by the rule that is missing."""
    return {
        name: place["means_of"](Boids, SEEDS, place["STEPS"] // 2, **settings)[0]
        for name, settings in place["WITHOUT"].items()
    }


def shown(interval):
    return f"{interval.estimate:.2f} [{interval.low:.2f}, {interval.high:.2f}]"


def text_of(cell):
    return " ".join(cells_of(PATH)[cell].split())


@pytest.mark.long
class TestCases:
    def test_avoidance_alone_aligns_neighbours_and_the_rule_adds_to_it(self, cases):
        assert mean_interval(cases[AVOID][0]).low > 0.4
        assert bootstrap_mean(cases[MATCH][0] - cases[AVOID][0]).low > 0.05

    def test_boids_are_more_aligned_than_robots_on_wheels(self, cases):
        assert bootstrap_mean(cases[BOIDS][0] - cases[MATCH][0]).low > 0.2

    def test_polarization_is_smaller_than_alignment_in_all_cases(self, cases):
        for alignment, polarized in cases.values():
            assert bootstrap_mean(alignment - polarized).low > 0.2

    def test_the_text_states_what_was_measured(self, cases):
        text = text_of("results")
        for alignment, polarized in cases.values():
            assert shown(mean_interval(alignment)) in text
            assert shown(mean_interval(polarized)) in text
        assert f"adds {shown(bootstrap_mean(cases[MATCH][0] - cases[AVOID][0]))}" in text

    def test_the_curve_of_the_boids_in_the_picture_rises_to_almost_1_and_falls_again(self, place):
        alignment = Boids(rng=place["SEEDS"][0]).run(place["STEPS"]).datacollector.model_vars["alignment"]
        peak = max(alignment)
        assert peak > 0.95
        assert min(alignment[alignment.index(peak) :]) < 0.8


@pytest.mark.long
class TestRules:
    def test_each_rule_adds_to_alignment_cohesion_least(self, without):
        lost = {name: without["all three"] - alignment for name, alignment in without.items()}
        for name in ("no alignment", "no cohesion", "no separation"):
            assert bootstrap_mean(lost[name]).low > 0
        for name in ("no alignment", "no separation"):
            assert bootstrap_mean(lost[name] - lost["no cohesion"]).low > 0

    def test_whether_alignment_or_separation_adds_more_is_not_known(self, without):
        assert not bootstrap_mean(without["no alignment"] - without["no separation"]).excludes_zero

    def test_boids_move_alike_without_the_alignment_rule(self, without):
        assert mean_interval(without["no alignment"]).low > 0.6

    def test_the_text_states_what_was_measured(self, without):
        text = text_of("weights-result")
        assert shown(mean_interval(without["all three"])) in text
        assert shown(mean_interval(without["no alignment"])) in text
        for name in ("no alignment", "no separation", "no cohesion"):
            assert f"by {shown(bootstrap_mean(without['all three'] - without[name]))}" in text
        assert shown(bootstrap_mean(without["no alignment"] - without["no separation"])) in text
