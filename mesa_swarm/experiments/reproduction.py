"""What the thesis reports of one and of many robots (5.3): runs that return numbers, and claims over many seeds."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from joblib import Parallel, delayed

from mesa_swarm.analysis import (
    clusters,
    coverage,
    follow_chains,
    kept_together,
    nearest_neighbour_distances,
    reachable_cells,
)
from mesa_swarm.experiments.statistics import Interval, mean_interval, paired_difference
from mesa_swarm.gallery import find_model

Numbers = dict[str, float | None]
SEEDS = range(40)
# Who stands within this distance of another is in one group with it, whatever made the group.
GROUP = 40.0
# Steps after which one looks who is still together.
WINDOW = 200
FRAME = 5
EARLY, LATE = 1_000, 3_000


# A robot that sees all that is ahead of it, is quick, and turns on the spot where it would else touch something.
EXPLORER = {
    "n_robots": 1,
    "map": "original",
    "design": "WIDE3",
    "max_speed": 4.0,
    "distance": 7.0,
    "spot_distance": 3.5,
}


def exploration_run(rng: int, steps: int = 60_000, **settings) -> Numbers:
    """Let one robot explore the map `original`; return which share of the cells within its reach it visited.

    Cells are those of a 40 x 40 grid in which the robot's centre can be. The robot is the `EXPLORER`, if the
    settings of `CollisionAvoidance` do not say otherwise.

    Examples
    --------
    >>> sorted(exploration_run(1, steps=100))
    ['collisions', 'coverage']
    """
    model = find_model("collision_avoidance")(rng=rng, **{**EXPLORER, **settings})
    solids = [(obstacle.shape.geometry, obstacle.shape.radius) for obstacle in model.obstacles if obstacle.contact]
    radius, start = float(model.swarm.radius[0]), model.swarm.position[0].copy()
    cells = reachable_cells(model.map.bounds, solids, radius, start)
    kept = model.watch(last=None, columns=("position",))
    model.run(steps)
    return {
        "coverage": coverage(kept["position"], cells, model.map.bounds),
        "collisions": float(model.total_collisions),
    }


def agglomeration_run(rng: int, **settings) -> Numbers:
    """Let robots agglomerate; return their spacing relative to the start, groups, and who keeps together.

    Examples
    --------
    >>> agglomeration_run(1, n_robots=5)["spacing at 1000"] > 0
    True
    """
    model = find_model("agglomeration")(rng=rng, **settings)
    spacing = nearest_neighbour_distances(model.swarm.position).mean()
    numbers: Numbers = {}
    for step in (EARLY, LATE):
        kept = kept_while(model, step)
        groups = clusters(model.swarm.position, GROUP)
        numbers[f"spacing at {step}"] = float(nearest_neighbour_distances(model.swarm.position).mean() / spacing)
        numbers[f"groups at {step}"] = float(groups.count)
        numbers[f"size at {step}"] = groups.mean_size
        numbers[f"local convergence at {step}"] = groups.local_convergence
        numbers[f"kept together at {step}"] = kept
    return numbers


def kept_while(model, until: int) -> float:
    """Run a model until a step; return the share of pairs in one group that still were after the last 200 steps."""
    model.run(until - WINDOW - model.steps)
    before = clusters(model.swarm.position, GROUP).label
    model.run(WINDOW)
    return kept_together(before, clusters(model.swarm.position, GROUP).label)


def chain_run(rng: int, **settings) -> Numbers:
    """Let robots form chains; return how long they are, what became of head-on meetings, and who keeps together.

    Lengths and shares are means over the 200 steps before step 1,000 and before step 3,000.

    Examples
    --------
    >>> chain_run(1, n_robots=5)["meetings"] >= 0
    True
    """
    model = find_model("chain_formation")(rng=rng, **settings)
    kept = model.watch(last=None, every=FRAME, columns=("position", "heading"))
    together = {f"kept together at {step}": kept_while(model, step) for step in (EARLY, LATE)}
    history = follow_chains(
        kept["position"], kept["heading"], kept.steps, link_distance=model.link_distance, patience=3
    )
    numbers: Numbers = dict(together)
    for step in (EARLY, LATE):
        frames = (kept.steps > step - WINDOW) & (kept.steps <= step)
        numbers[f"length at {step}"] = mean_or_one(history.mean_length[frames])
        numbers[f"chained at {step}"] = float(history.chained[frames].mean())
    outcomes = history.outcomes()
    met = sum(outcomes.values())
    numbers["meetings"] = float(met)
    numbers["dispersals"] = float(outcomes["dispersed"])
    numbers["share dispersed"] = outcomes["dispersed"] / met if met else None
    return numbers


def mean_or_one(lengths: np.ndarray) -> float:
    """Return the mean length of chains; a robot alone counts as a chain of one where there is none."""
    return float(np.where(np.isnan(lengths), 1.0, lengths).mean())


@dataclass(frozen=True, kw_only=True, slots=True)
class Claim:
    """A claim of the thesis as a difference of two numbers over paired seeds, which it says is above 0.

    Parameters
    ----------
    words : str
        What the thesis says.
    first, second : (function, settings, measure)
        Of each: the run, its settings, and the number; the claim is that the second is larger.
    """

    words: str
    first: tuple[Callable[..., Numbers], dict, str]
    second: tuple[Callable[..., Numbers], dict, str]

    def test(self, seeds: Iterable[int] = SEEDS, jobs: int = -1) -> "Finding":
        """Run both sides with the same seeds and return what came of it."""
        same = list(seeds)
        sides = [self.measured(side, same, jobs) for side in (self.first, self.second)]
        difference, pairs = paired_difference(*sides)
        first, second = ([value for value in side if value is not None] for side in sides)
        return Finding(self.words, mean_interval(first), mean_interval(second), difference, pairs)

    def measured(self, side: tuple, seeds: list[int], jobs: int) -> list[float | None]:
        """Return one side's number for every seed."""
        run, settings, measure = side
        return [numbers[measure] for numbers in runs_of(run, settings, seeds, jobs)]


_DONE: dict[tuple, list[Numbers]] = {}


def runs_of(run: Callable[..., Numbers], settings: dict, seeds: list[int], jobs: int = -1) -> list[Numbers]:
    """Return what a run gives for every seed; the same runs are done once in a process."""
    key = (run, tuple(sorted(settings.items())), tuple(seeds))
    if key not in _DONE:
        rows = Parallel(jobs)(delayed(run)(seed, **settings) for seed in seeds)
        _DONE[key] = [{name: known(value) for name, value in row.items()} for row in rows]
    return _DONE[key]


def known(value: float | None) -> float | None:
    """Return None for what could not be measured.

    Examples
    --------
    >>> known(float("nan")), known(0.5)
    (None, 0.5)
    """
    return None if value is None or np.isnan(value) else value


@dataclass(frozen=True, slots=True)
class Finding:
    """What came of a claim: both means, the mean paired difference, and the number of pairs."""

    words: str
    first: Interval
    second: Interval
    difference: Interval
    pairs: int

    @property
    def verdict(self) -> str:
        """What came of it: confirmed, refuted (it is the other way round), or not confirmed (the interval holds 0)."""
        if not self.difference.excludes_zero:
            return "not confirmed"
        return "confirmed" if self.difference.estimate > 0 else "refuted"

    def __str__(self) -> str:
        """Return one line."""
        low, high = self.difference.low, self.difference.high
        return (
            f"{self.words}: {self.verdict}; {self.first.estimate:.3g} against {self.second.estimate:.3g}, "
            f"difference {self.difference.estimate:+.3g} [{low:+.3g}, {high:+.3g}], {self.pairs} pairs"
        )


def claims(**settings) -> list[Claim]:
    """Return the thesis's claims about chains, under these settings of `ChainFormation`.

    Examples
    --------
    >>> len(claims(n_robots=20))
    5
    """
    without = {**settings, "gap_rule": "off"}
    robots = {"n_robots": settings["n_robots"]} if "n_robots" in settings else {}
    return [
        Claim(
            words="chains hold together better than clusters",
            first=(agglomeration_run, robots, "kept together at 3000"),
            second=(chain_run, settings, "kept together at 3000"),
        ),
        Claim(
            words="chains go on merging: longer at 3,000 steps than at 1,000",
            first=(chain_run, settings, "length at 1000"),
            second=(chain_run, settings, "length at 3000"),
        ),
        Claim(
            words="clusters go on merging: larger at 3,000 steps than at 1,000",
            first=(agglomeration_run, robots, "size at 1000"),
            second=(agglomeration_run, robots, "size at 3000"),
        ),
        Claim(
            words="the gap rule makes chains longer",
            first=(chain_run, without, "length at 3000"),
            second=(chain_run, settings, "length at 3000"),
        ),
        Claim(
            words="the head-on rule makes fewer meetings end in dispersal",
            first=(chain_run, {**settings, "head_on": "on"}, "share dispersed"),
            second=(chain_run, settings, "share dispersed"),
        ),
    ]
