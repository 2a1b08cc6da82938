"""Policies that were learned at fires, frozen on maps with fires that none of them has seen, beside hand-made rules."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar, cast

import numpy as np

from mesa_swarm.control import Avoid, Explore, Follow, Layer, Subsumption
from mesa_swarm.errors import check_choice, check_count
from mesa_swarm.experiments.pool import checked_jobs, in_order
from mesa_swarm.experiments.statistics import bootstrap_mean
from mesa_swarm.experiments.tables import with_limits
from mesa_swarm.fire import FightFire
from mesa_swarm.gallery import find_model
from mesa_swarm.learning.fire_learning import LearnFires, SkillPolicy
from mesa_swarm.learning.fire_wheels import FireWheelPolicy, LearnFireWheels
from mesa_swarm.robots.design import AGENT_FIRE
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.world.map import Map
from mesa_swarm.world.random_map import random_map

ROBOTS, FIRES = 10, 5
# Maps of training; those of the comparison are beyond all that anything was trained or chosen on.
TRAINING, UNSEEN = range(12_000, 12_010), 80_000
MEASURES = ("share found", "share out", "largest out", "steps", "collisions")
SKILL_STEPS, WHEEL_STEPS = 60_000, 30_000
Learning = TypeVar("Learning", LearnFires, LearnFireWheels)


@dataclass(frozen=True, kw_only=True, slots=True)
class FireTrial:
    """How long policies are trained, and how long they then fight fires on a map.

    `skill_steps` are those of skills, on the map openspace_fire; `wheel_steps` those of wheel actions, shared by ten
    generated maps; a trial ends after `steps`, or when all fires are out.
    """

    skill_steps: int = SKILL_STEPS
    wheel_steps: int = WHEEL_STEPS
    steps: int = 8000

    def __post_init__(self) -> None:
        for name in ("skill_steps", "wheel_steps", "steps"):
            check_count(name, getattr(self, name), minimum=10)


def contenders(trial: FireTrial) -> dict[str, Callable[[int], tuple[Layer, ...]]]:
    """Return by name the functions that return the layers of each contender, trained with a seed where it learns."""
    careful = Avoid(fires="never")
    fleeing = Avoid(fires="when hot"), FightFire(strategy="A")
    return {
        "strategy B": lambda seed: (careful, FightFire(strategy="B"), Explore()),
        "strategy A": lambda seed: (*fleeing, Explore()),
        "follower": lambda seed: (*fleeing, Follow(), Explore()),
        "skills": lambda seed: (careful, LearnFires(start=trained_skills(seed, trial.skill_steps), frozen=True)),
        "skills at random": lambda seed: (careful, LearnFires(frozen=True)),
        "wheel actions": lambda seed: (LearnFireWheels(start=trained_wheels(seed, trial.wheel_steps), frozen=True),),
    }


def trained_skills(seed: int, steps: int = SKILL_STEPS) -> SkillPolicy:
    """Return what ten robots of the model `learning_fires` learn with a seed, in one table for all."""
    model = find_model("learning_fires")(rng=seed).run(check_count("steps", steps, minimum=1))
    return _learner_of(model, LearnFires).policy()


def trained_wheels(seed: int, steps: int = WHEEL_STEPS) -> FireWheelPolicy:
    """Return the Q-networks that ten robots share after they drove on ten generated maps, one after the other."""
    policy: FireWheelPolicy | None = None
    for number, world in enumerate(TRAINING):
        model = fire_world(
            (LearnFireWheels(start=policy),), random_map(world, fires=FIRES), len(TRAINING) * seed + number
        )
        model.run(max(steps // len(TRAINING), 1))
        policy = _learner_of(model, LearnFireWheels).policy()
    return cast(FireWheelPolicy, policy)


def _learner_of(model: SwarmModel, kind: type[Learning]) -> Learning:
    """Return the layer of a model that learns."""
    layers = model.control.layers if model.control else ()
    return next(layer for layer in layers if isinstance(layer, kind))


def fire_world(layers: Sequence[Layer], world: Map | str, seed: int) -> SwarmModel:
    """Return a model of ten robots at the fires of a map."""
    model = SwarmModel(map=world, rng=seed, history_every=0)
    model.add_robots(AGENT_FIRE, ROBOTS)
    model.control = Subsumption(*layers)
    return model


def fought(layers: Sequence[Layer], world: Map | str, seed: int, steps: int) -> dict[str, float]:
    """Let robots fight the fires of a map, and measure them.

    Measured are the shares of fires at which a robot arrived, and that went out; whether the largest did; the steps
    until all were out, or else all steps; and collisions of a robot in 1,000 steps.
    """
    model = fire_world(layers, world, seed)
    found, collisions = np.zeros(len(model.fires), np.bool_), 0
    while model.steps < steps and not model.fires.out.all():
        model.step()
        found[model.swarm.fire[model.swarm.fire >= 0]] = True
        collisions += int(np.count_nonzero(model.swarm.columns["collided"]))
    out = model.fires.out
    largest = float(out[np.argmax(model.fires.area)])
    per_robot = 1000.0 * collisions / (len(model.swarm) * max(model.steps, 1))
    numbers = float(found.mean()), float(out.mean()), largest, float(model.steps), per_robot
    return dict(zip(MEASURES, numbers, strict=True))


def fire_policies(
    seeds: int = 30, *, trial: FireTrial | None = None, only: Sequence[str] = (), jobs: int = 1
) -> dict[str, list[dict[str, float]]]:
    """Return the measures of each contender with the seeds 1, 2, ...: one training and one unseen map a seed.

    Parameters
    ----------
    seeds : int
        At least 1.
    trial : FireTrial, optional
    only : sequence of str
        Names of contenders, all by default.
    jobs : int
        Processes; -1 for one on each core.

    Examples
    --------
    >>> brief = FireTrial(steps=20)
    >>> [sorted(row)[0] for row in fire_policies(2, trial=brief, only=["strategy B"])["strategy B"]]
    ['collisions', 'collisions']
    """
    given = trial or FireTrial()
    names = [check_choice("only", name, contenders(given)) for name in only] or list(contenders(given))
    tasks = [(name, seed, given) for seed in range(1, check_count("seeds", seeds, minimum=1) + 1) for name in names]
    done = in_order(checked_jobs(jobs), _one, tasks)
    return {name: [row for (other, *_), row in zip(tasks, done, strict=True) if other == name] for name in names}


def _one(name: str, seed: int, trial: FireTrial) -> dict[str, float]:
    layers = contenders(trial)[name](seed)
    return fought(layers, random_map(UNSEEN + seed, fires=FIRES), 1_000_000 + seed, trial.steps)


def fire_table(results: dict[str, list[dict[str, float]]]) -> str:
    """Return the means of each contender with their intervals, as the lines of a table in Markdown."""
    rows = [["contender", *MEASURES], ["---"] * (len(MEASURES) + 1)]
    for name, runs in results.items():
        rows.append([name, *(with_limits(bootstrap_mean([run[measure] for run in runs])) for measure in MEASURES)])
    return "\n".join(f"| {' | '.join(line)} |" for line in _padded(rows))


def _padded(rows: list[list[str]]) -> list[list[str]]:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return [
        [cell.ljust(width, "-" if set(cell) == {"-"} else " ") for cell, width in zip(row, widths, strict=True)]
        for row in rows
    ]
