"""The tasks of the benchmark of learning: their worlds, their blocks of generated maps, and their measures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from mesa_swarm import Map
from mesa_swarm.control import Arbiter
from mesa_swarm.environments import Aggregation, CollisionAvoidance, ExtinguishFires, FindFires, Foraging, Task
from mesa_swarm.experiments import Controller, played
from mesa_swarm.searches import Criteria, ValidationGate
from mesa_swarm.world.random_map import random_map

# Numbers of generated maps: to train on, and to compare. Evolution and the choice of settings have further blocks, see
# `contestants`.
TRAIN, TEST = range(50_101, 50_201), range(60_001, 60_051)
# Those of a `ValidationGate` by default.
VALIDATION = range(30_000, 30_010)
# Worlds of the evaluation have other seeds than those of training.
APART = 1_000_000
# In tasks without a target, the share of the rule's main measure that a training has to reach on the validation maps.
SHARE_OF_RULE = 0.8


@dataclass(frozen=True, kw_only=True, slots=True)
class BenchmarkTask:
    """A task of the benchmark of learning.

    Parameters
    ----------
    task : Task
        Of `environments`; its map is replaced by generated ones.
    measures : tuple of str
        Columns of the table, of `TaskWorld.measures`; the first is the main one.
    rule : str
        The contestant that the others are compared with.
    maps : mapping
        Options of `random_map`.
    steps : int
        At most, on each map.
    tests : int
        How many of the 50 test maps.
    target : Criteria, optional
        What controllers are to reach.
    """

    task: Task
    measures: tuple[str, ...]
    rule: str
    maps: Mapping[str, Any] = field(default_factory=dict)
    steps: int = 5000
    tests: int = 20
    target: Criteria | None = None

    def map_named(self, place: str) -> Map:
        """Return a map by the name that results have: "random 60001", or that of a built-in map."""
        word, _, number = place.partition(" ")
        return random_map(int(number), **self.maps) if word == "random" else Map.load(place)

    def drive(
        self,
        controller: Arbiter | Controller,
        place: str,
        seed: int,
        steps: int,
        measures: Sequence[str] = (),
    ) -> dict[str, float]:
        """Let a controller drive all robots for these steps, or until the task is done; return measures of the world.

        These are those of the table by default, or some of those of `TaskWorld.play`.
        """
        task = replace(self.task, map=self.map_named(place), max_steps=min(steps, self.steps))
        found = played(controller, task, APART + seed)
        return {name: found[name] for name in measures or self.measures}

    def gate(self, steps: int) -> ValidationGate:
        """Return what a training has to reach on the validation maps, with these steps at most on each.

        That is the target; in a task without one, 80 % of the main measure of the rule.
        """
        return ValidationGate(
            task=replace(self.task, max_steps=min(steps, self.steps)),
            maps=[self.map_named(f"random {number}") for number in VALIDATION],
            criteria=self.target or Criteria(of_rule={self.measures[0]: SHARE_OF_RULE}),
        )


SMALL = {"size": (480, 360), "obstacles": 3}
DRIVING = ("collisions", "worst robot", "speed ahead", "coverage")


def benchmark_tasks() -> dict[str, BenchmarkTask]:
    """Return the tasks of the benchmark by name."""
    fires = {"fires": 5}
    return {
        "avoid": BenchmarkTask(
            task=CollisionAvoidance(encoding="typed"),
            measures=DRIVING,
            rule="Avoid + Explore",
            tests=len(TEST),
            target=ValidationGate.criteria,  # by default those of avoidance
        ),
        "find_fires": BenchmarkTask(
            task=FindFires(),
            measures=("fires found", "steps", "collisions"),
            rule="Avoid + Explore",
            maps=fires,
        ),
        "extinguish_fires": BenchmarkTask(
            task=ExtinguishFires(),
            measures=("fires out", "largest fire out", "steps", "collisions"),
            rule="strategy B",
            maps=fires,
            steps=8000,
        ),
        "foraging": BenchmarkTask(
            task=Foraging(n_robots=6),
            measures=("items per 1,000 robot-steps", "collisions"),
            rule="hand-written rule",
            maps=SMALL,
            steps=2000,
        ),
        "aggregation": BenchmarkTask(
            task=Aggregation(),
            measures=("largest cluster", "largest cluster, last quarter", "neighbour distance"),
            rule="hand-written rule",
            maps=SMALL,
            steps=2000,
        ),
    }
