"""Whether robots that go to the hottest fire put all fires out earlier than those that go to the nearest.

Settings and criterion were committed before the judged runs, which have seeds from 1,001 on.
"""

import pytest

from mesa_swarm.experiments.statistics import paired_difference
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm_studies.laboratory import FRESH

STEPS, SEEDS, SPREADS = 15_000, 24, (0.0, 0.0003)


def last_out(rng, choice, spread):
    """Return the step at which all fires were out under strategy B with ten robots, `STEPS` if they never were."""
    model = FireFighting(strategy="B", n_robots=10, choice=choice, spread=spread, rng=rng).run(STEPS)
    return float(model.results()["all fires out at"] or STEPS)


def judged(first, second):
    """Return in words whether the second is later in the mean, by the 95 % interval of the paired difference."""
    difference, _ = paired_difference(first, second)
    return "later" if difference.low > 0 else "earlier" if difference.high < 0 else "no difference shown"


def test_a_difference_is_stated_only_where_its_interval_excludes_0():
    assert judged([1.0, 2.0, 3.0, 4.0], [11.0, 12.5, 13.0, 14.5]) == "later"
    assert judged([11.0, 12.5, 13.0, 14.5], [1.0, 2.0, 3.0, 4.0]) == "earlier"
    assert judged([1.0, 2.0, 3.0, 4.0], [4.0, 3.0, 2.0, 1.0]) == "no difference shown"


def measured(seeds, spread):
    """Return the steps of both choices for every seed."""
    return [[last_out(rng, choice, spread) for rng in seeds] for choice in ("nearest", "hottest")]


@pytest.mark.long
@pytest.mark.parametrize("spread", SPREADS)
def test_no_difference_is_shown_between_the_hottest_and_the_nearest_fire(spread):
    assert judged(*measured(range(FRESH, FRESH + SEEDS), spread)) == "no difference shown"
