"""The contestants of the benchmark of learning: how each is trained, and its control afterwards."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache, partial
from operator import attrgetter
from typing import Any

import numpy as np

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.control import Arbiter, Avoid, Explore, Subsumption
from mesa_swarm.experiments import Controller
from mesa_swarm.learning import Fitness, HebbianLearning, Networks, QLearning, QPolicy, SensorLayout, WireFittedQ
from mesa_swarm.searches import Evolved, Trial, ValidationGate, driven_by, evolve, gated, tallied
from mesa_swarm.world.random_map import random_map
from mesa_swarm_studies.benchmarks.benchmark_tasks import benchmark_tasks

DESIGN, ROBOTS, HOME = AGENT9, 15, "original"
# Points of the curve of a training.
PARTS = 33
# Controllers are bred on small generated maps, which a few robots cover in the time of a trial, and chosen on maps as
# large as those of the test. The numbers of all three are far apart.
BREEDING, CHOOSING = range(10_000, 10_025), range(11_000, 11_004)
SMALL, FEW_OBSTACLES, FEW_ROBOTS = (480, 360), 3, 6
GENERATIONS = len(BREEDING)
# Robots of the benchmark are to stay far from things: d_crit is 0.4 of the range, and the state they reach is rewarded.
DISTANT = {"critical": 0.4, "reward_of": "next state"}
# Cooled: temperature and learning rate fall together to the end of a training twice as long, after which a frozen
# policy acts as the learner did. T - T_c falls by e^-COOLING.
COOLED = {"critical": 0.2, "reward_of": "next state", "last_temperature": 0.1, "last_eta": 0.02}
TWICE, COOLING = 2, 4.0
COOLED_Q = {**COOLED, "actions": 4, "reward": "b"}
# Stored experiences, and how many of them a robot learns from again: its networks then learn as often as shared ones.
REPLAY = {"replay": 1000, "replays": ROBOTS - 1}
# As often, but from the last few steps only, which resemble each other.
SHORT_REPLAY = {**REPLAY, "replay": ROBOTS}


@dataclass(frozen=True, slots=True, kw_only=True)
class Trained:
    """The outcome of a training.

    `frozen` drives with the learned policy; `learning` continues where the training ended, None for contestants that do
    not learn while they drive. `curve` has the collisions per robot and 1,000 steps in each part of the training.
    `trainings` were done until one passed on validation maps, of which `robot_steps` are the sum, validation included;
    `passed` is None where no training was validated. All but the last of the trainings, if that passed, missed.
    """

    frozen: Arbiter | Controller
    learning: Arbiter | None = None
    robot_steps: int = 0
    curve: list[float] = field(default_factory=list)
    trainings: int = 1
    passed: bool | None = None


def contestants() -> dict[str, Callable[[int, int], Trained]]:
    """Return by name the functions that train each contestant, with a seed and a number of steps of 15 robots."""
    return {
        "random": _random,
        "Avoid + Explore": _rule,
        "evolved reflex, gated": partial(gated_in, "avoid", partial(_evolved, 0)),
        "evolved network, gated": partial(gated_in, "avoid", partial(_evolved, 2)),
        "Q (a)": partial(_taught, QLearning, {**DISTANT, "actions": 4, "reward": "a"}),
        "Q (b)": partial(_taught, QLearning, {**DISTANT, "actions": 4, "reward": "b"}),
        "Q (c)": partial(_taught, QLearning, {**DISTANT, "actions": 4, "reward": "c"}),
        "Q (c), typed": partial(_taught, QLearning, {**DISTANT, "actions": 4, "reward": "c", "encoding": "typed"}),
        "own Q (b), cooled": partial(_cooled, QLearning, COOLED_Q),
        "own Q (b), cooled, with replay": partial(_cooled, QLearning, {**COOLED_Q, **REPLAY}),
        "own Q (b), cooled, short replay": partial(_cooled, QLearning, {**COOLED_Q, **SHORT_REPLAY}),
        "shared Q (b), cooled, 1/15": partial(_cooled, QLearning, {**COOLED_Q, "shared": True}, share=1 / ROBOTS),
        "shared Q (b), cooled": SHARED,
        "shared Q (b), cooled, gated": partial(gated_in, "avoid", SHARED),
        "wire-fitted Q": partial(_taught, WireFittedQ, DISTANT),
        "shared wire-fitted Q, cooled": partial(_cooled, WireFittedQ, {**COOLED, "reward": "b", "shared": True}),
        "Hebbian": partial(_taught, HebbianLearning, {"reward": "a"}),
    }


def _random(seed: int, steps: int) -> Trained:
    """Return a contestant that acts at random: networks without weights give all eight actions the same value."""
    sensors = SensorLayout.of(DESIGN)
    s, count = len(sensors), 8
    nothing = Networks(np.zeros((count, s, 2 * s)), np.zeros((count, 2 * s)), np.zeros((count, 2 * s)), np.zeros(count))
    return Trained(frozen=driven_by(QPolicy(sensors=sensors, networks=nothing, steps=1)))


def _rule(seed: int, steps: int) -> Trained:
    return Trained(frozen=Subsumption(Avoid(), Explore()))


def _evolved(units: int, seed: int, steps: int) -> Trained:
    policy = bred(units, seed, min(steps / 33_000, 1.0)).policy
    return Trained(frozen=driven_by(policy), robot_steps=policy.steps)


def bred(units: int, seed: int, share: float = 1.0) -> Evolved:
    """Breed with robot-steps of its own, up to 10 million; 0 hidden units make reflexes.

    `share` is that of the generations and of the steps of every trial: a shorter benchmark breeds less.
    """
    generations = max(round(GENERATIONS * share), 1)
    # Where speed is worth less, one of ten drives backwards.
    fitness = Fitness(collision_cost=700, coverage_worth=10, speed_worth=5, square=20)
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
    model = SwarmModel(map=HOME, rng=seed, history_every=0, collect_every=0)
    model.add_robots(DESIGN, ROBOTS)
    model.control = Subsumption(learner(**options))
    curve = []
    for part in np.array_split(np.arange(steps), min(PARTS, steps)):
        tally = tallied(model, len(part))
        curve.append(1000.0 * tally.means()["collisions"])
    layers = model.control.layers if model.control else ()
    policy = next(layer for layer in layers if isinstance(layer, QLearning | WireFittedQ | HebbianLearning)).policy()
    goes_on = Subsumption(learner(**options, start=policy))
    return Trained(frozen=driven_by(policy), learning=goes_on, robot_steps=steps * ROBOTS, curve=curve)


def _cooled(learner: type, options: dict[str, Any], seed: int, steps: int, *, share: float = 1.0) -> Trained:
    """Train a learner that cools to the end of its training, in this share of twice as many steps."""
    steps = max(round(TWICE * steps * share), 1)
    return _taught(learner, {**options, "beta": min(COOLING / steps, 1.0)}, seed, steps)


SHARED = partial(_cooled, QLearning, {**COOLED_Q, "shared": True})


def gated_in(task: str, train: Callable[[int, int], Trained], seed: int, steps: int) -> Trained:
    """Train until the outcome passes on validation maps."""
    gate = gate_of(task, steps)
    found = gated(lambda each: train(each, steps), gate, control=attrgetter("frozen"), rng=seed)
    robot_steps = sum(each.robot_steps for each in found.results) + sum(v.robot_steps for v in found.validations)
    return replace(found.result, robot_steps=robot_steps, trainings=found.trainings, passed=found.passed)


def validated(task: str, trained: Trained, steps: int) -> Trained:
    """Return a single training with whether its outcome passes on the validation maps; a rule as it is."""
    if trained.passed is not None or not trained.robot_steps:
        return trained
    return replace(trained, passed=gate_of(task, steps).validate(trained.frozen).passed)


@cache
def gate_of(task: str, steps: int) -> ValidationGate:
    """Return the gate of a task for trainings of these steps, measuring the rule once; short ones validate less."""
    setting = benchmark_tasks()[task]
    return setting.gate(max(round(setting.steps * min(steps / 33_000, 1.0)), 1))
