"""Claims of notebook 04 on fresh seeds."""

import numpy as np
import pytest

from mesa_swarm.analysis import clusters
from mesa_swarm.experiments.statistics import bootstrap_mean, mean_interval
from mesa_swarm.models.agglomeration import LINK, Agglomeration
from support.exercises import ROOT, cells_of, names_of

PATH = ROOT / "notebooks" / "04_agglomeration.ipynb"
SEEDS = range(1001, 1021)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return the numbers of groups and the shares in the largest one of all seeds, by sight."""
    place = names_of(4, "setup", "final-groups", folder=tmp_path_factory.mktemp("claims"))
    return {sight: np.array(place["final_groups"](SEEDS, sight=sight)) for sight in (50, 100, 200)}


def group_counts(steps, **settings):
    """Return the number of groups of every seed at these steps, a row a seed."""
    rows = []
    for seed in SEEDS:
        model, row = Agglomeration(**settings, rng=seed), []
        for step in steps:
            model.run(step - model.steps)
            row.append(clusters(model.swarm.position, LINK).count)
        rows.append(row)
    return np.array(rows)


@pytest.mark.long
class TestGroups:
    def test_robots_end_in_many_groups_whether_they_see_50_or_200_units(self, runs):
        for groups, largest in runs.values():
            assert mean_interval(groups).low > 7
            assert mean_interval(largest).high < 0.5

    def test_with_a_longer_range_there_are_fewer_groups_but_200_units_are_no_better_than_100(self, runs):
        groups = {sight: table[0] for sight, table in runs.items()}
        assert bootstrap_mean(groups[100] - groups[50]).high < -3
        assert bootstrap_mean(groups[200] - groups[50]).high < -3
        assert not bootstrap_mean(groups[200] - groups[100]).excludes_zero

    def test_the_text_states_what_was_measured(self, runs):
        text = " ".join(cells_of(PATH)["results"].split())
        few, share = "there are {:.1f} groups [{:.1f}, {:.1f}]", "contains {:.0f} % of the robots [{:.0f}, {:.0f}]"
        for sight, stated in {50: (few, share), 100: (few,), 200: (few.replace(" groups", ""), share)}.items():
            groups, largest = runs[sight]
            for part, measured in zip(stated, (groups, 100 * largest), strict=False):
                mean = mean_interval(measured)
                assert part.format(mean.estimate, mean.low, mean.high) in text

    def test_they_gather_within_500_steps_and_the_groups_are_hardly_fewer_later(self):
        early, later = group_counts((500, 3_000)).T
        fewer = bootstrap_mean(early - later)
        assert 0 < fewer.low < fewer.high < 0.2 * early.mean()

    def test_with_200_units_no_group_changes_after_step_1000(self):
        early, later = group_counts((1_000, 2_000), sight=200).T
        assert (early == later).all()


@pytest.mark.long
def test_twice_the_robots_are_in_more_groups_but_fewer_than_twice_as_many():
    of_50, of_100 = (group_counts((2_000,), n_robots=robots).ravel() for robots in (50, 100))
    assert bootstrap_mean(of_100 - of_50).low > 0
    assert bootstrap_mean(of_100 - 2 * of_50).high < 0
