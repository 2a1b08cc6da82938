"""Learning to fight fires (thesis 9.5, 10.4): congregation emerges where robots share what they learn."""

from pathlib import Path

import numpy as np
import pytest
from joblib import Parallel, delayed

from mesa_swarm.experiments.statistics import bootstrap_mean
from mesa_swarm.learning.fire_learning import BACK_OFF, SITUATIONS, WAIT
from mesa_swarm.models.learning_fires import LearningFires

pytestmark = pytest.mark.long
APPENDIX = Path(__file__).parents[2] / "docs" / "appendix"
PAGE = " ".join((APPENDIX / "fire_learning.md").read_text(encoding="utf-8").split())
SEEDS = range(20, 26)
LARGEST, TOGETHER = "rounds with the largest out", "fighting at the largest in company"
HOT, COOLING = (SITUATIONS.index(f"too hot, {where} the heat, sees a fire") for where in ("in", "out of"))


def played(controller, seed, steps):
    model = LearningFires(controller=controller, rng=seed).run(steps)
    table = model.control.layers[1].values[0] if controller == "shared" else None
    return model.results(), table


def runs(controller, steps):
    return Parallel(n_jobs=2)(delayed(played)(controller, seed, steps) for seed in SEEDS)


def mean(done, measure):
    return np.mean([results[measure] for results, _ in done])


@pytest.fixture(scope="module")
def shared():
    return runs("shared", 60_000)


def test_robots_that_learn_in_one_table_gather_at_the_largest_fire_and_put_it_out_in_most_later_rounds(shared):
    assert mean(shared, LARGEST) > 0.6
    assert mean(shared, TOGETHER) > 0.6


def test_what_they_learn_is_strategy_b_to_back_out_of_the_heat_and_to_wait_there(shared):
    best = [table.argmax(axis=1) for _, table in shared]
    assert sum(each[HOT] == BACK_OFF for each in best) >= 5
    assert sum(each[COOLING] == WAIT for each in best) >= 5


def test_strategy_a_and_skills_at_random_leave_it_burning_and_strategy_b_is_still_better_than_what_was_learned(shared):
    a, by_chance, b = (runs(controller, 12_000) for controller in ("A", "random", "B"))
    assert mean(a, LARGEST) < 0.4
    assert mean(by_chance, LARGEST) == 0
    assert mean(b, LARGEST) >= mean(shared, LARGEST)
    assert mean(b, "steps of a round") < mean(shared, "steps of a round")


def learned_long(seed):
    """Return the share of later rounds in which the largest fire goes out, and how many of ten robots wait."""
    model = LearningFires(controller="own", beta=1e-5, rng=seed).run(600_000)
    best = model.control.layers[1].values.argmax(axis=2)
    return model.results()[LARGEST], int(np.sum(best[:, COOLING] == WAIT))


def test_with_ten_times_the_steps_robots_learn_each_for_themselves_to_wait(amount):
    count = amount(2, 20)
    done = Parallel(n_jobs=2)(delayed(learned_long)(seed) for seed in range(60, 60 + count))
    shares, waiting = zip(*done, strict=True)
    assert min(shares) >= 0.5
    assert sum(waiting) >= 0.8 * 10 * count
    if count == 20:
        found = bootstrap_mean([100 * share for share in shares])
        stated = f"{sum(waiting)} of 200 robots wait, each learning independently, and the largest fire goes out in "
        assert f"{stated}{found.estimate:.0f} % ({found.low:.0f} to {found.high:.0f}) of the later rounds" in PAGE
