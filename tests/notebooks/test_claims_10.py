"""Claims of notebook 10 on fresh seeds."""

import pytest

from mesa_swarm.experiments.statistics import bootstrap_mean
from support.exercises import names_of

SEEDS = range(1001, 1021)

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def notebook(tmp_path_factory):
    """Return what the notebook's own cells define."""
    return names_of(10, "setup", "habits", folder=tmp_path_factory.mktemp("claims"))


@pytest.fixture(scope="module")
def rows(notebook):
    """Return the habits of robots by reward."""
    return {kind: [notebook["habits"](kind, rng)[0] for rng in SEEDS] for kind in "abc"}


@pytest.mark.parametrize("other", ["b", "c"])
def test_with_reward_a_robots_turn_to_and_fro_beside_a_wall_more_often(notebook, rows, other):
    assert notebook["difference"](rows, "a", other, notebook["TURNS"]).low > 0


@pytest.mark.parametrize("kind", ["a", "b", "c"])
def test_facing_a_wall_robots_go_back_and_forth_with_every_reward(notebook, rows, kind):
    assert bootstrap_mean([row[notebook["TRAVEL"]] for row in rows[kind]]).low > 5


@pytest.mark.parametrize(("first", "second"), ["ab", "bc"])
def test_which_reward_makes_them_do_so_most_is_undecided(notebook, rows, first, second):
    assert not notebook["difference"](rows, first, second, notebook["TRAVEL"]).excludes_zero
