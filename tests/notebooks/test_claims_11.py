"""Claims of notebook 11 on fresh seeds."""

import numpy as np
import pytest

from mesa_swarm.experiments.statistics import mean_interval, share_interval
from support.exercises import names_of

SEEDS = range(1001, 1021)

pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def notebook(tmp_path_factory):
    """Return what the notebook's own cells define."""
    return names_of(11, "setup", "trial", folder=tmp_path_factory.mktemp("claims"))


@pytest.fixture(scope="module")
def bred(notebook):
    """Return an evolution for each seed."""
    return [notebook["evolution"](rng) for rng in SEEDS]


@pytest.fixture(scope="module")
def by_hand(notebook):
    """Return the mean fitness of the hand-written layers."""
    return np.mean([notebook["fitness_of_layers"](rng) for rng in SEEDS])


@pytest.fixture(scope="module")
def gap(notebook, bred):
    """Return a function: by how much a measure of evolved robots is larger on a map, with its limits."""
    drive, driver, layers = (notebook[name] for name in ("drive", "driver", "layers"))
    rows = {
        world: [
            (drive(driver(each.policy), world, rng), drive(layers(), world, rng))
            for each, rng in zip(bred, SEEDS, strict=True)
        ]
        for world in ("original", "sparse")
    }
    return lambda world, name: mean_interval([evolved[name] - hand[name] for evolved, hand in rows[world]])


def share(happened):
    return share_interval(sum(happened), len(happened))


def test_the_best_of_the_first_generation_is_fitter_than_the_mean_of_the_layers(bred, by_hand):
    assert share([each.fitness[0].max() > by_hand for each in bred]).low > 0.8


def test_the_mean_of_a_generation_becomes_fitter_than_the_layers_but_not_at_once(bred, by_hand):
    assert share([(each.fitness.mean(axis=1) > by_hand).any() for each in bred]).low > 0.8
    assert share([each.fitness[0].mean() > by_hand for each in bred]).high < 0.2


def test_the_best_of_the_last_generation_is_fitter_than_that_of_the_first(bred):
    assert mean_interval([each.fitness[-1].max() - each.fitness[0].max() for each in bred]).low > 1


def test_evolved_robots_collide_less_on_the_other_map(gap):
    assert gap("sparse", "collisions").high < 0


def test_whether_they_collide_less_on_the_map_of_the_evolution_is_undecided(gap):
    assert not gap("original", "collisions").excludes_zero


@pytest.mark.parametrize("world", ["original", "sparse"])
def test_evolved_robots_cover_less(gap, world):
    assert gap(world, "coverage").high < 0


def test_the_constant_is_above_the_limit_of_both_wheels(bred):
    assert share([each.policy.wheel[0, -1].min() > 1 for each in bred]).low > 0.8


def test_to_which_side_the_front_sensor_turns_them_is_chance(bred):
    left = share([each.policy.wheel[0, 0, 0] < each.policy.wheel[0, 0, 1] for each in bred])
    assert left.low < 0.5 < left.high
