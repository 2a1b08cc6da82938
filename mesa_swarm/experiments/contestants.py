"""The contestants of the benchmark of learning: how each is trained, and its control afterwards."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.experiments.driving import driven_world, tallied
from mesa_swarm.experiments.evolution import Evolved, Trial, evolve
from mesa_swarm.learning.fitness import Fitness
from mesa_swarm.learning.hebbian import HebbianLearning
from mesa_swarm.learning.networks import Networks
from mesa_swarm.learning.policy import Policy, PolicyLayer, SensorLayout
from mesa_swarm.learning.q_learning import QLearning, QPolicy
from mesa_swarm.learning.rewards import NEXT_STATE
from mesa_swarm.learning.wire_learning import WireFittedQ
from mesa_swarm.robots.design import AGENT9
from mesa_swarm.world.random_map import random_map

DESIGN, ROBOTS, HOME = AGENT9, 15, "original"
# Points of the curve of a training.
PARTS = 33
# Controllers are bred on small generated maps, which a few robots cover in the time of a trial, and chosen on maps as
# large as those of the test. The numbers of all three are far apart.
BREEDING, CHOOSING = range(10_000, 10_025), range(11_000, 11_004)
SMALL, FEW_OBSTACLES, FEW_ROBOTS = (480, 360), 3, 6
GENERATIONS = len(BREEDING)
# Robots of the benchmark are to stay far from things: d_crit is 0.4 of the range, and the state they reach is rewarded.
DISTANT = {"critical": 0.4, "reward_of": NEXT_STATE}


@dataclass(frozen=True, slots=True, kw_only=True)
class Trained:
    """The outcome of a training.

    `frozen` drives with the learned policy; `learning` continues where the training ended, None for contestants that do
    not learn while they drive. `curve` has the collisions per robot and 1,000 steps in each part of the training.
    """

    frozen: Arbiter
    learning: Arbiter | None = None
    robot_steps: int = 0
    curve: list[float] = field(default_factory=list)


def contestants() -> dict[str, Callable[[int, int], Trained]]:
    """Return by name the functions that train each contestant, with a seed and a number of steps of 15 robots."""
    return {
        "random": _random,
        "Avoid + Explore": _rule,
        "evolved reflex": partial(_evolved, 0),
        "evolved network": partial(_evolved, 2),
        "Q (a)": partial(_taught, QLearning, {**DISTANT, "actions": 4, "reward": "a"}),
        "Q (b)": partial(_taught, QLearning, {**DISTANT, "actions": 4, "reward": "b"}),
        "Q (c)": partial(_taught, QLearning, {**DISTANT, "actions": 4, "reward": "c"}),
        "Q (c), typed": partial(_taught, QLearning, {**DISTANT, "actions": 4, "reward": "c", "encoding": "typed"}),
        "wire-fitted Q": partial(_taught, WireFittedQ, DISTANT),
        "Hebbian": partial(_taught, HebbianLearning, {"reward": "a"}),
    }


def _random(seed: int, steps: int) -> Trained:
    """Return a contestant that acts at random: networks without weights give all eight actions the same value."""
    sensors = SensorLayout.of(DESIGN)
    s, count = len(sensors), 8
    nothing = Networks(np.zeros((count, s, 2 * s)), np.zeros((count, 2 * s)), np.zeros((count, 2 * s)), np.zeros(count))
    return Trained(frozen=_by(QPolicy(sensors=sensors, networks=nothing, steps=1)))


def _rule(seed: int, steps: int) -> Trained:
    return Trained(frozen=Subsumption(Avoid(), Explore()))


def _evolved(units: int, seed: int, steps: int) -> Trained:
    policy = bred(units, seed, min(steps / 33_000, 1.0)).policy
    return Trained(frozen=_by(policy), robot_steps=policy.steps)


def bred(units: int, seed: int, share: float = 1.0) -> Evolved:
    """Breed with robot-steps of its own, up to 10 million; 0 hidden units make reflexes.

    `share` is that of the generations and of the steps of every trial: a shorter benchmark breeds less.
    """
    generations = max(round(GENERATIONS * share), 1)
    fitness = Fitness(collision_cost=700, coverage_worth=10, square=20)
    trial = Trial(
        robots=FEW_ROBOTS,
        steps=max(round(4500 * share), 1),
        fitness=fitness,
        units=units,
        encoding="typed",
        mirrored=True,
    )
    return evolve(
        trial,
        maps=[random_map(k, obstacles=FEW_OBSTACLES, size=SMALL) for k in BREEDING[:generations]],
        generations=generations,
        population=12,
        constant=1.5,
        finalists=6,
        final=replace(trial, robots=ROBOTS, steps=max(round(5000 * share), 1)),
        final_maps=[random_map(k) for k in CHOOSING],
        rng=seed,
    )


def _taught(learner: type, options: dict[str, Any], seed: int, steps: int) -> Trained:
    """Train a learner at home, and note how often robots collided meanwhile."""
    model = driven_world(Subsumption(learner(**options)), DESIGN, ROBOTS, HOME, seed)
    curve = []
    for part in np.array_split(np.arange(steps), min(PARTS, steps)):
        tally = tallied(model, len(part))
        curve.append(1000.0 * tally.means()["collisions"])
    layers = model.control.layers if model.control else ()
    policy = next(layer for layer in layers if isinstance(layer, QLearning | WireFittedQ | HebbianLearning)).policy()
    goes_on = Subsumption(learner(**options, start=policy))
    return Trained(frozen=_by(policy), learning=goes_on, robot_steps=steps * ROBOTS, curve=curve)


def _by(policy: Policy) -> Arbiter:
    return Subsumption(PolicyLayer(policy=policy))
