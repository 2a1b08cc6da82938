"""What pages and texts of the models state of many runs: on the stored runs, and on other seeds again.

Texts were worded by the stored runs (seeds 301 to 320, `docs/measure_models.py`). Criteria were fixed before the runs
with the seeds 401 to 420. A claim holds if the 95 % interval is within its limits; differences are paired by seed.
"""

import importlib.util
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from joblib import Parallel, delayed
from measure_models import DEFAULTS, measured, settings_of, stored

from mesa_swarm import sweep
from mesa_swarm.experiments.statistics import (
    TIME,
    Interval,
    bootstrap_mean,
    mean_interval,
    paired_difference,
    share_interval,
)
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.models.q_learning import QLearning

STORED = stored()
FURTHER = range(401, 421)
FIRST_COLLISIONS = "collisions per robot and 1,000 steps, first 1,000"
DOCS = Path(__file__).parents[2] / "docs"
TUTORIAL, FORESIGHT = ((DOCS / page).read_text(encoding="utf-8") for page in ("tutorial.md", "appendix/foresight.md"))
# What a robot drives in a step, of the range of its sensors: 1 of 50 map units.
ONE_STEP = 0.02


class Claim(NamedTuple):
    """The mean of a measure, or the share of runs with an event, is within limits."""

    model: str
    label: str
    measure: str
    low: float = -math.inf
    high: float = math.inf

    def check(self, values: Callable[[str, str], list[float]]) -> None:
        row = values(self.label, self.measure)
        happened = sum(not math.isnan(value) for value in row)
        found = share_interval(happened, len(row)) if self.measure.endswith(TIME) else bootstrap_mean(row)
        assert self.low <= found.low, f"required >= {self.low}; measured {found}"
        assert found.high <= self.high, f"required <= {self.high}; measured {found}"


class Less(NamedTuple):
    """A measure is less with the first settings than with the second ones."""

    model: str
    label: str
    other: str
    measure: str

    def check(self, values: Callable[[str, str], list[float]]) -> None:
        difference, pairs = paired_difference(values(self.label, self.measure), values(self.other, self.measure))
        assert pairs >= 20
        assert difference.low > 0, f"required > 0; measured {difference}"


CLAIMS = [
    Claim("agglomeration", DEFAULTS, "groups", low=10),
    Claim("agglomeration", "See twice as far", "groups", low=5),
    Less("agglomeration", "See twice as far", DEFAULTS, "groups"),
    Claim("agglomeration", "Stay farther apart", "share at rest", low=0.95),
    Claim("agglomeration", "Stay farther apart", "share colliding in a step", high=0.01),
    Less("agglomeration", "Never rest", DEFAULTS, "share at rest"),
    Claim("agglomeration", "Never rest", "share at rest", high=0.25),
    Claim("boids", "Without separation", "share colliding in a step", low=0.5),
    Claim("boids", DEFAULTS, "share colliding in a step", high=0.01),
    Less("boids", "Separation only", DEFAULTS, "alignment"),
    Claim("boids", "Separation only", "alignment", high=0.3),
    Claim("boids", DEFAULTS, "alignment", low=0.7),
    Claim("boids", "Nothing drives on", "share at rest", low=0.75),
    Claim("flocking", DEFAULTS, "alignment", low=0.5),
    Claim("flocking", DEFAULTS, "polarization", high=0.3),
    Less("flocking", "Without matching", DEFAULTS, "alignment"),
    Less("flocking", "Six wide sensors", DEFAULTS, "alignment"),
    Less("flocking", "Six wide sensors", DEFAULTS, "share colliding in a step"),
    Claim("flocking", "Far sight", "alignment", high=0.15),
    Less("chain_formation", "Nine sensors", DEFAULTS, "chained"),
    Less("chain_formation", "Nine sensors", DEFAULTS, "mean chain"),
    Less("chain_formation", "Turn at random speeds", DEFAULTS, "share colliding in a step"),
    Less("chain_formation", "Turn at random speeds", DEFAULTS, "mean chain"),
    Claim("chain_formation", "Turn at random speeds", "share at rest", low=0.4, high=0.7),
    Claim("chain_formation", "Only twelve robots", "chains", low=1, high=4),
    Claim("collision_avoidance", "Turn on the spot", "share at rest", low=0.4),
    Claim("collision_avoidance", DEFAULTS, "share at rest", high=0.05),
    Less("collision_avoidance", DEFAULTS, "Sixty robots", "collisions per robot and 1,000 steps"),
    Claim("fire_fighting", DEFAULTS, "all fires out at", low=0.5),
    Claim("fire_fighting", "Strategy A", "fire 2 (largest) out at", high=0.2),
    Claim("fire_fighting", "Strategy A", "fires out", low=5.9, high=6.1),
    Claim("fire_fighting", "A, with calls for help", "fire 2 (largest) out at", low=0.5),
    Less("fire_fighting", DEFAULTS, "Sparks", "fires in all"),
    Claim("best_of_n", "A wrong start", "agreed at", low=0.5),
    Claim("best_of_n", "A wrong start", "share for the left site", high=0.05),
    Claim("best_of_n", "Far broadcasts", "agreed at", low=0.3),
    Claim("best_of_n", DEFAULTS, "agreed at", high=0.2),
    Claim("best_of_n", "No broadcasts heard", "share for the left site", low=0.5, high=0.5),
    Less("q_learning", DEFAULTS, "Cool quickly", FIRST_COLLISIONS),
    Less("q_learning", "A large critical distance", DEFAULTS, FIRST_COLLISIONS),
    Less("q_learning", "Learn together", DEFAULTS, "the same in the last 3,000 steps"),
    Claim("q_learning", "Cool quickly", "forward speed in the last 1,000 steps", low=0.7),
    Claim("q_learning", DEFAULTS, "forward speed in the last 1,000 steps", high=0.5),
    Claim("q_learning", "A large critical distance", "forward speed in the last 1,000 steps", high=0.15),
    Claim("learning_fires", DEFAULTS, "rounds with the largest out", high=0.0),
    Claim("learning_fires", "Random skills", "rounds with the largest out", high=0.0),
    Claim("learning_fires", "Strategy B, not learned", "rounds with all fires out", low=1.0),
    Claim("learning_fires", "No reward for fires", "steps of a round", low=6_000),
    Claim("perimeter", DEFAULTS, "share turned outwards", low=0.6),
    Claim("perimeter", DEFAULTS, "mean distance from the centroid", low=100),
    Claim("perimeter", "A ring too small", "share turned outwards", low=0.8),
    Less("perimeter", DEFAULTS, "Short sight", "mean distance from the centroid"),
    Less("perimeter", "Short sight", DEFAULTS, "share turned outwards"),
    Claim("perimeter", "A ring too wide", "share at walls", low=0.6),
    Claim("cooperative_transport", "A single robot", "arrived at", high=0.2),
    Claim("cooperative_transport", "A single robot", "way left", low=350, high=350),
    Claim("cooperative_transport", "Twenty robots", "arrived at", low=0.8),
    Claim("puck_clustering", "Sixteen robots", "share of pucks carried", low=0.9),
    Claim("puck_clustering", "Single pucks only", "share of pucks carried", high=0.13),
    Less("puck_clustering", "Single pucks only", DEFAULTS, "share of pucks carried"),
    Claim("puck_clustering", "Twice as many pucks", "clusters", low=3, high=7),
    Less("foraging", DEFAULTS, "Thirty, without rest", "items"),
    Less("foraging", DEFAULTS, "Thirty, without rest", "energy used per item"),
    Claim("foraging", "Thirty, without rest", "energy", high=250),
    Claim("foraging", "Two items of food", "energy", high=25),
    Claim("foraging", "Two items of food", "share outside in the second half", low=0.75),
    Claim("foraging", "Two robots", "energy", low=250),
    Claim("shepherding", DEFAULTS, "brought home at", low=0.8),
    Claim("shepherding", "A hundred sheep", "brought home at", low=0.8),
    Claim("shepherding", "Three shepherds", "brought home at", low=0.8),
    Claim("shepherding", "Five neighbours", "brought home at", high=0.2),
    Claim("ant_trails", "Equal branches", "share of the branch used more", low=0.6),
    Less("ant_trails", "Trail counts for little", "Equal branches", "share of the branch used more"),
    Less("ant_trails", "Trail that vanishes", "Equal branches", "share of the branch used more"),
    Claim("ant_trails", "Trail counts for little", "share of the upper branch", low=0.4, high=0.6),
    Claim("ant_trails", "Trail that vanishes", "share of the upper branch", low=0.4, high=0.6),
    Less("signposts", "No boards", DEFAULTS, "visits"),
    Less("signposts", DEFAULTS, "A source that stays", "visits"),
    Claim("task_allocation", DEFAULTS, "share at work, second half", low=0.32, high=0.345),
    Claim("task_allocation", "Only majors", "share at work, second half", low=0.32, high=0.345),
    Claim("task_allocation", "A high demand", "majors at work, second half", low=0.7),
    Claim("task_allocation", "A high demand", "stimulus, second half", low=7),
    Claim("task_allocation", "Only majors", "stimulus, second half", low=2, high=3.5),
    Claim("task_allocation", "More than all can do", "stimulus", low=50),
]
# On other seeds, as far as time permits: models whose runs take a fraction of a second.
QUICK = ("boids", "flocking", "chain_formation", "fire_fighting", "task_allocation")


def names(claims: list) -> list:
    return [pytest.param(one, id=f"{one.model}, {one.label}: {one.measure}, {number}") for number, one in claims]


@pytest.fixture(scope="module")
def further():
    """Return the values of a measure on the further seeds; the runs of a setting are made once."""
    made: dict = {}

    def values(model: str, label: str, measure: str) -> list[float]:
        if (model, label) not in made:
            made[model, label] = [measured(model, settings_of(model)[label], seed) for seed in FURTHER]
        return [row[measure] for row in made[model, label]]

    return values


@pytest.mark.parametrize("claim", names([*enumerate(CLAIMS)]))
def test_what_the_text_of_a_model_states_holds_on_its_stored_runs(claim):
    claim.check(lambda label, measure: STORED[claim.model][label][measure])


@pytest.mark.long
@pytest.mark.parametrize("claim", names([(number, one) for number, one in enumerate(CLAIMS) if one.model in QUICK]))
def test_it_holds_on_twenty_other_seeds(claim, further):
    claim.check(lambda label, measure: further(claim.model, label, measure))


@pytest.mark.long
def test_under_strategy_a_the_large_fire_goes_out_on_one_of_the_first_thirty_seeds():
    assert FireFighting(strategy="A", rng=26).run(15_000).results()["fire 2 (largest) out at"] == 9_536


def to_and_fro(seed: int) -> tuple[float, ...]:
    """Let robots learn in tables; return how often they drive straight ahead, straight back, and near d_crit."""
    model = QLearning(memory="table", beta=1e-3, rng=seed).run(9_000)
    found = []
    for _ in range(1_000):
        model.step()
        left, right = model.swarm.command.T
        near = abs(model.swarm.columns["0.TableQLearning.nearest"] - model.learner.critical) <= ONE_STEP
        found.append([np.mean((left == right) & (left > 0)), np.mean((left == right) & (left < 0)), near.mean()])
    return tuple(np.mean(found, axis=0))


@pytest.mark.long
def test_robots_that_learn_in_tables_move_to_and_fro_at_the_critical_distance():
    shares = zip(*Parallel(n_jobs=2)(delayed(to_and_fro)(seed) for seed in range(1001, 1021)), strict=True)
    ahead, back, near = (bootstrap_mean([100 * value for value in row]) for row in shares)
    text = " ".join(FORESIGHT.split())
    assert f"{shown(ahead)} of their actions drive straight ahead, {shown(back)} straight back" in text
    assert f"in {shown(near)} of the steps the nearest reading is within one step" in text


def shown(percent: Interval) -> str:
    return f"{percent.estimate:.0f} % [{percent.low:.1f}, {percent.high:.1f}]"


@pytest.mark.long
def test_the_table_of_the_tutorial_is_that_of_its_plan(tmp_path):
    file = tmp_path / "cleaning.py"
    file.write_text(re.search(r"^```python\n(.*?)^```", TUTORIAL, re.DOTALL | re.MULTILINE)[1], encoding="utf-8")
    spec = importlib.util.spec_from_file_location("cleaning", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    numbers = [5, 10, 20, 40, 80]
    assert "seeds 21 to 40 each" in TUTORIAL
    made = sweep(
        module.Cleaning, {"n_robots": numbers}, seeds=range(21, 41), steps=1000, out=tmp_path / "made", jobs=1
    ).frame()
    for n in numbers:
        found = mean_interval(made[made["n_robots"] == n]["cells per robot"])
        assert f"| {n} | {found.estimate:.1f} [{found.low:.1f}, {found.high:.1f}] |" in TUTORIAL
