"""Claims of notebook 3 on fresh seeds."""

import re

import numpy as np
import pytest

from mesa_swarm.experiments.statistics import mean_interval, paired_difference, share_interval
from support.exercises import NOTEBOOKS, cells_of, names_of

pytestmark = pytest.mark.long
NOTEBOOK = NOTEBOOKS[2]
SEEDS = range(1001, 1081)


@pytest.fixture(scope="module")
def notebook(tmp_path_factory):
    """Return the names that the notebook's cells define."""
    return names_of(3, "setup", "corner", "rules", folder=tmp_path_factory.mktemp("cells"))


@pytest.fixture(scope="module")
def outcomes(notebook):
    """Return for each rule whether each robot is stuck, its collisions, and its share of turning steps."""
    return {
        name: np.array([notebook["outcome"](layer, seed) for seed in SEEDS], dtype=float)
        for name, layer in notebook["RULES"].items()
    }


def stuck(outcomes, rule):
    return share_interval(outcomes[rule][:, 0].sum(), len(SEEDS))


def test_the_robot_of_seed_4_is_stuck_from_step_52_to_the_end(notebook):
    (episode,) = notebook["pathologies_of"](notebook["stationary"])
    assert (episode.kind, episode.first_step, episode.last_step) == ("corridor flip", 52, 2000)


def test_a_third_or_so_of_the_robots_that_turn_on_the_spot_get_stuck(outcomes):
    share = stuck(outcomes, "stationary")
    assert share.low > 0.2
    assert share.high < 0.6


def test_turning_while_moving_prevents_it_at_the_price_of_collisions(outcomes):
    assert stuck(outcomes, "translational").high < 0.05
    assert outcomes["stationary"][:, 1].sum() == 0
    collided = share_interval((outcomes["translational"][:, 1] > 0).sum(), len(SEEDS))
    assert collided.low > 0
    assert collided.high < 0.25


def test_a_side_drawn_anew_in_every_step_lets_robots_out_but_slowly(outcomes):
    assert stuck(outcomes, "side drawn anew").high < stuck(outcomes, "stationary").low
    assert outcomes["side drawn anew"][:, 1].sum() == 0
    turning = [outcomes[rule][:, 2] for rule in ("translational", "side drawn anew")]
    more, _ = paired_difference(*turning)
    assert more.low > 0.1
    assert mean_interval(turning[1]).high < 0.3


def test_drawn_anew_only_for_what_is_ahead_it_does_not_help(outcomes):
    fewer, _ = paired_difference(outcomes["drawn anew ahead"][:, 0], outcomes["stationary"][:, 0])
    assert fewer.high < 0.1
    assert stuck(outcomes, "drawn anew ahead").low > 0.3


def test_the_text_quotes_these_numbers_of_robots(outcomes):
    text = " ".join(cells_of(NOTEBOOK)["results"].split())
    counts = {rule: round(outcomes[rule][:, 0].sum()) for rule in outcomes}
    quoted = re.findall(r"(\d+) of 80", text)
    assert [int(number) for number in quoted] == [
        counts[rule] for rule in ("stationary", "translational", "side drawn anew", "drawn anew ahead")
    ]
