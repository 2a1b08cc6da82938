"""Claims of notebook 1 on fresh seeds."""

import numpy as np
import pytest

from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.experiments.statistics import mean_interval, paired_difference, share_interval
from support.exercises import NOTEBOOKS, cells_of, names_of

pytestmark = pytest.mark.long
CELLS = cells_of(NOTEBOOKS[0])
SEEDS = range(1001, 1041)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("cells")


@pytest.fixture(scope="module")
def runs(folder):
    """Return the collisions and the extent of the path of each run, by control."""
    place = names_of(1, "setup", "own", "many", folder=folder)
    return {
        name: np.array([place["alone"](layers, seed) for seed in SEEDS]) for name, layers in place["CONTROLS"].items()
    }


def free(runs, name):
    """Return the share of runs without a collision."""
    return share_interval((runs[name][:, 0] == 0).sum(), len(SEEDS))


def test_the_blind_robot_of_seed_1_ends_in_a_corner_after_854_collisions(folder):
    model = names_of(1, "setup", "robot", "blind", folder=folder)["model"]
    assert model.total_collisions == 854
    assert np.hypot(*(model.swarm.position[0] - (780, 20))) < 10
    assert f"{model.total_collisions} of 1,000" in CELLS["blind-result"]


def test_nothing_is_within_range_of_it_at_first(folder):
    model = names_of(1, "setup", "robot", folder=folder)["model"]
    model.sense()
    assert (model.swarm.distance == -1).all()


@pytest.mark.parametrize("cell", ["avoid", "own"])
def test_with_avoid_and_with_the_timid_rule_it_has_no_collision(folder, cell):
    assert names_of(1, "setup", cell, folder=folder)["model"].total_collisions == 0


def test_the_timid_rule_moves_to_and_fro_at_the_first_wall(folder):
    model = names_of(1, "setup", "own", folder=folder)["model"]
    watched = model.watch(last=None, columns=("position",))
    model.run(100)
    assert np.hypot(*np.ptp(watched["position"][:, 0], axis=0)) == pytest.approx(1.0, abs=0.01)


def test_a_blind_robot_collides_in_nearly_every_run(runs):
    assert free(runs, "Explore").high < 0.15


def test_avoid_and_the_timid_rule_prevent_collisions_in_most_runs(runs):
    assert free(runs, "Avoid, Explore").low > 0.6
    assert free(runs, "timid, Explore").low > 0.85


def test_with_avoid_paths_are_wider_and_with_the_timid_rule_narrower_than_blindly(runs):
    blind, avoiding, timid = (runs[name][:, 1] for name in ("Explore", "Avoid, Explore", "timid, Explore"))
    wider, _ = paired_difference(blind, avoiding)
    assert wider.low > 150
    narrower, _ = paired_difference(avoiding, timid)
    assert narrower.high < -300
    assert timid.mean() / avoiding.mean() == pytest.approx(0.2, abs=0.1)


def test_the_unsolved_exercise_has_about_8000_collisions(folder):
    source = CELLS["check-1"].split("check_rule(")[0]
    place = names_of(1, "setup", folder=folder)
    exec(source, place)
    counts = []
    for seed in SEEDS[:20]:
        model = place["crowd"](seed)
        model.control = Subsumption(Explore())
        counts.append(model.run(1_000).total_collisions)
    interval = mean_interval(counts)
    assert interval.low > 7_000
    assert interval.high < 9_000
