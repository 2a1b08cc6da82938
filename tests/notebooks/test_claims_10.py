"""Claims of notebook 10 on fresh seeds."""

import io
from contextlib import redirect_stdout

import pytest

from mesa_swarm.experiments.statistics import bootstrap_mean
from support.exercises import NOTEBOOKS, cells_of, last_value

(PATH,) = (path for path in NOTEBOOKS if path.stem.startswith("10_"))
SEEDS = range(1001, 1021)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def notebook(tmp_path_factory):
    """Return what the notebook's own cells define."""
    cells, place, folder = cells_of(PATH), {"__name__": "__main__"}, tmp_path_factory.mktemp("claims")
    with redirect_stdout(io.StringIO()):
        for name in ("setup", "habits"):
            last_value(cells[name], place, folder / f"{name}.py")
    return place


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
