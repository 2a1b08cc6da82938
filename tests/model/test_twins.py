"""A run that goes on in any way ends as the run that was never interrupted: the same hash, ids, rows and events."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

from mesa_swarm.model.gallery import find_model, gallery_names
from support.twin_models import OWN, Drawn
from support.twins import WAYS, Run, differing, trace

MODELS = {**{model.__name__: model for model in OWN}, **{name: find_model(name) for name in gallery_names()}}
# In the default suite worlds and ways are fewer: the slow tests have all of them.
FEW, MANY, ALL = 12, 120, 500


def run_of(name, seed=3, edits=0):
    return Run(MODELS[name], seed, before=11, after=13, edits=edits)


def drawn_run(seed):
    rng = np.random.default_rng(seed)
    before, after, edits = int(rng.integers(30)), int(rng.integers(1, 30)), int(rng.integers(4))
    return Run(Drawn, seed, before, after, edits, {"draw": seed})


def check(run, ways, folder):
    expected = trace(run, "plain", folder)
    for way in ways:
        assert differing(expected, trace(run, way, folder)) == {}, (way, run)


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_each_model_ends_the_same_in_three_ways(name, tmp_path):
    check(run_of(name), some_ways(list(MODELS).index(name)), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_each_model_ends_the_same_in_every_way(name, tmp_path):
    check(run_of(name), WAYS, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [5, 6, 7])
@pytest.mark.parametrize("name", MODELS)
def test_each_model_that_is_changed_by_hand_ends_the_same_in_every_way(name, seed, tmp_path):
    check(run_of(name, seed, edits=4), WAYS, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(FEW))
def test_a_random_world_ends_the_same_in_three_ways_at_random(seed, tmp_path):
    check(drawn_run(seed), some_ways(seed), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(FEW, MANY))
def test_more_random_worlds_end_the_same_in_three_ways_at_random(seed, tmp_path):
    check(drawn_run(seed), some_ways(seed), tmp_path)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(MANY, ALL))
def test_five_hundred_random_worlds_end_the_same_in_three_ways_at_random(seed, tmp_path):
    check(drawn_run(seed), some_ways(seed), tmp_path)


def some_ways(seed):
    return np.random.default_rng([seed, 8]).permutation(sorted(WAYS))[:3].tolist()


@pytest.mark.slow
def test_another_process_ends_a_run_the_same(tmp_path):
    runs = [run_of(name) for name in MODELS] + [drawn_run(seed) for seed in range(FEW)]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        others = list(pool.map(trace, runs, ["plain"] * len(runs), [tmp_path] * len(runs)))
    for run, other in zip(runs, others, strict=True):
        assert differing(trace(run, "plain", tmp_path), other) == {}, run
