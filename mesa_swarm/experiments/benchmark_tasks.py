"""The tasks of the benchmark of learning: their worlds, their blocks of generated maps, and their measures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from mesa_swarm.control import Subsumption
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.environments.aggregation import Aggregation
from mesa_swarm.environments.foraging import Foraging
from mesa_swarm.environments.task import Task
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.environments.tasks import CollisionAvoidance, ExtinguishFires, FindFires
from mesa_swarm.experiments.controllers import Controller
from mesa_swarm.experiments.gating import VALIDATION, WORLDS
from mesa_swarm.world.map import Map
from mesa_swarm.world.random_map import random_map

# Numbers of generated maps: to train on, and to compare. Evolution, validation and the choice of settings have further
# blocks, see `contestants` and `gating`.
TRAIN, TEST = range(50_101, 50_201), range(60_001, 60_051)
# Worlds of the evaluation have other seeds than those of training.
APART = 1_000_000


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
    judged : bool
        Whether there is a target, see `is_target_met`.
    """

    task: Task
    measures: tuple[str, ...]
    rule: str
    maps: Mapping[str, Any] = field(default_factory=dict)
    steps: int = 5000
    tests: int = 20
    judged: bool = False

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
        driver = Controller(name="control", control=controller) if isinstance(controller, Arbiter) else controller
        if driver.control is None:
            found = TaskWorld(task=task, rng=APART + seed).play(driver.actor(task.actions))
        else:
            found = TaskWorld(task=task, rng=APART + seed, control=driver.control).play()
        return {name: found[name] for name in measures or self.measures}


@dataclass(frozen=True, slots=True)
class TaskValidation:
    """The means of a task's measures over the validation maps, and whether they pass."""

    means: dict[str, float]
    passed: bool


@dataclass(frozen=True, eq=False)
class TaskGate:
    """The gate of a task of the benchmark, see `gating.gated`: what a training has to reach on the validation maps.

    In the task with a target that is the target, otherwise 80 % of the main measure of the rule.

    Parameters
    ----------
    setting : BenchmarkTask
    steps : int
        At most, on each map.
    """

    setting: BenchmarkTask
    steps: int

    @cached_property
    def _of_the_rule(self) -> dict[str, float]:
        return self._means(Subsumption(*self.setting.task.others()))

    def _means(self, controller: Arbiter | Controller) -> dict[str, float]:
        rows = [self.setting.drive(controller, f"random {number}", WORLDS, self.steps) for number in VALIDATION]
        return {name: float(np.mean([row[name] for row in rows])) for name in self.setting.measures}

    def validate(self, control: Arbiter | Controller, *, jobs: int = 1) -> TaskValidation:
        """Return the means of a controller, and whether they pass; `jobs` is not used."""
        found, rule, main = self._means(control), self._of_the_rule, self.setting.measures[0]
        if self.setting.judged:
            passed = is_target_met(
                found["collisions"], found["speed ahead"], found["coverage"], of_the_rule=rule["coverage"]
            )
        else:
            passed = found[main] >= SHARE_OF_RULE * rule[main]
        return TaskValidation(found, passed)

    def rank(self, found: TaskValidation) -> tuple[float, ...]:
        """Return numbers by which validations are ordered, the best first: by passing, then by the main measure."""
        value = found.means[self.setting.measures[0]]
        return -found.passed, value if self.setting.judged else -value


# Required of controllers that avoid: few collisions, most of the greatest speed, and the coverage of the rule.
FEW, FAST = 0.5, 0.6


def is_target_met(collisions: float, ahead: float, seen: float, *, of_the_rule: float) -> bool:
    """Return whether a controller that avoids is on target."""
    return collisions <= FEW and ahead >= FAST and seen >= of_the_rule


SMALL = {"size": (480, 360), "obstacles": 3}
# In the other tasks, the share of the rule's main measure that a training has to reach on the validation maps.
SHARE_OF_RULE = 0.8
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
            judged=True,
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
