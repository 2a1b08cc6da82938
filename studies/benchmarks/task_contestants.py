"""The contestants of each task of the benchmark, and controllers evolved on a task's own rewards."""

from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np

from mesa_swarm import Streams
from mesa_swarm.control import Arbiter, Avoid, Explore, Follow, Layer, Subsumption
from mesa_swarm.experiments import Controller
from mesa_swarm.fire import FightFire
from mesa_swarm.learning import Evolution, LearnFires, LearnFireWheels
from mesa_swarm.searches import Budget, Mission, design_machine, driven_by, evolve_network
from mesa_swarm_studies.benchmarks.benchmark_tasks import TRAIN, benchmark_tasks
from mesa_swarm_studies.benchmarks.contestants import Trained, contestants, gated_in
from mesa_swarm_studies.benchmarks.fire_policies import SKILL_STEPS, WHEEL_STEPS, trained_skills, trained_wheels
from mesa_swarm_studies.benchmarks.ppo import is_installed, trained_by_ppo

Train = Callable[[int, int], Trained]
# Of the evolution of linear controllers; a shorter benchmark has fewer generations.
GENERATIONS, POPULATION, TRIAL_STEPS, FINALISTS = 25, 16, 1000, 4
PPO = "PPO, shared"
# Maps on which the last generations are compared; searches have fewer generations than it takes to reach them.
CHOICE = TRAIN[-10:]
# Of a trial of a design.
MISSION_STEPS = 600


def linear(weights: np.ndarray) -> Controller:
    """Return a controller whose actions are weighted sums of the observations and a constant, clipped to [-1, 1].

    Parameters
    ----------
    weights : ndarray, shape (width + 1, k)
        The last row is the constant.

    Examples
    --------
    >>> linear(np.array([[1.0, -1.0], [0.5, 0.5]])).actor("continuous")(np.array([[0.25], [1.0]]))
    array([[ 0.75,  0.25],
           [ 1.  , -0.5 ]])
    """

    def act(observations: np.ndarray) -> np.ndarray:
        return observations @ weights[:-1] + weights[-1]

    return Controller(name="linear", make=lambda: act, width=len(weights) - 1)


def at_random(numbers: int, seed: int) -> Controller:
    """Return a controller whose actions are drawn uniformly from [-1, 1]: in each world the same.

    Examples
    --------
    >>> at_random(2, 1).actor("continuous")(np.zeros((3, 9))).shape
    (3, 2)
    """

    def make() -> Callable[[np.ndarray], np.ndarray]:
        rng = Streams(np.random.SeedSequence(seed))["random controller"]
        return lambda observations: rng.uniform(-1.0, 1.0, (len(observations), numbers))

    return Controller(name="random", make=make)


def evolved_linear(task: str, seed: int, share: float = 1.0) -> tuple[Controller, int]:
    """Return a linear controller evolved by CMA-ES on the rewards of a task, and the robot-steps that it took.

    All candidates of a generation are tried in the same world; each generation has another of the maps to train on.
    The means of the last generations are then tried on ten more of these maps, and the best is returned.

    Parameters
    ----------
    task : str
        Of `benchmark_tasks`.
    seed : int
    share : float
        Of the generations and of the steps of a trial, 0 to 1: a shorter benchmark trains less.
    """
    setting = benchmark_tasks()[task]
    width, numbers = setting.task.observer().width, setting.task.numbers
    generations, steps = max(round(GENERATIONS * share), 1), max(round(TRIAL_STEPS * share), 1)
    streams = Streams(np.random.SeedSequence(seed))
    start = np.zeros((width + 1, numbers))
    start[-1, :2] = 0.5  # straight ahead
    search = Evolution(start.ravel(), sigma=0.5, population=POPULATION, seed=int(streams["search"].integers(2**31)))

    def worth(weights: np.ndarray, number: int, rng: int) -> float:
        return setting.drive(linear(weights.reshape(start.shape)), f"random {number}", rng, steps, ("reward",))[
            "reward"
        ]

    for g in range(generations):
        rng = int(streams["worlds"].integers(2**31))
        search.tell([worth(weights, TRAIN[g % len(TRAIN)], rng) for weights in search.ask()])
    finalists = search.means[-FINALISTS:]
    validated = [np.mean([worth(weights, number, seed) for number in CHOICE]) for weights in finalists]
    trials = generations * POPULATION + len(finalists) * len(CHOICE)
    return linear(finalists[int(np.argmax(validated))].reshape(start.shape)), trials * steps * setting.task.n_robots


def _evolved(task: str, seed: int, steps: int) -> Trained:
    controller, robot_steps = evolved_linear(task, seed, min(steps / 33_000, 1.0))
    return Trained(frozen=controller, robot_steps=robot_steps)


def _random(task: str, seed: int, steps: int) -> Trained:
    return Trained(frozen=at_random(benchmark_tasks()[task].task.numbers, seed))


def _ruled(make: Callable[[], Arbiter], seed: int, steps: int) -> Trained:
    return Trained(frozen=make())


def _by_ppo(seed: int, steps: int) -> Trained:
    controller, robot_steps = trained_by_ppo(seed, min(steps / 33_000, 1.0))
    return Trained(frozen=controller, robot_steps=robot_steps)


def _skills(seed: int, steps: int) -> Trained:
    policy = trained_skills(seed, max(round(SKILL_STEPS * min(steps / 33_000, 1.0)), 10))
    return Trained(
        frozen=Subsumption(Avoid(fires="never"), LearnFires(start=policy, frozen=True)), robot_steps=policy.steps
    )


def _wheels(seed: int, steps: int) -> Trained:
    policy = trained_wheels(seed, max(round(WHEEL_STEPS * min(steps / 33_000, 1.0)), 10))
    return Trained(frozen=Subsumption(LearnFireWheels(start=policy, frozen=True)), robot_steps=policy.steps)


def _designed(machines: bool, seed: int, steps: int) -> Trained:
    """Design a state machine, or evolve a network, for aggregation by the same budget."""
    share, setting = min(steps / 33_000, 1.0), benchmark_tasks()["aggregation"]
    task = setting.task
    mission = Mission(design=task.designs[0], robots=task.n_robots, steps=max(round(MISSION_STEPS * share), 1))
    budget = replace(Budget(), generations=max(round(Budget().generations * share), 1))
    maps = [setting.map_named(f"random {number}") for number in TRAIN[: budget.generations]]
    found: Any = (design_machine if machines else evolve_network)(mission, maps=maps, rng=seed, **asdict(budget))
    return Trained(
        frozen=found.machine if machines else driven_by(found.policy),
        robot_steps=budget.runs * mission.robots * mission.steps,
    )


def _strategy_a(*more: Layer) -> Arbiter:
    return Subsumption(Avoid(fires="when hot"), FightFire(strategy="A"), *more, Explore())


def _strategy_b() -> Arbiter:
    return Subsumption(Avoid(fires="never"), FightFire(strategy="B"), Explore())


def _task_rule(task: str) -> Arbiter:
    """Return the rule by which the task's robots are driven that are not commanded."""
    return Subsumption(*benchmark_tasks()[task].task.others())


def contestants_of(task: str) -> dict[str, Train]:
    """Return by name the functions that train each contestant of a task, with a seed and a number of steps."""
    if task == "avoid":
        return {**contestants(), PPO: _by_ppo}
    rules: dict[str, Callable[[], Arbiter]] = {benchmark_tasks()[task].rule: partial(_task_rule, task)}
    if task == "extinguish_fires":
        rules = {"strategy A": _strategy_a, "A, followers": partial(_strategy_a, Follow()), "strategy B": _strategy_b}
    fires: dict[str, Train] = {}
    if task == "extinguish_fires":
        fires = {"skills": _skills, "wheel actions": _wheels}
        fires |= {f"{name}, gated": partial(gated_in, task, train) for name, train in fires.items()}
    designs: dict[str, Train] = {}
    if task == "aggregation":
        designs = {"evolved network": partial(_designed, False), "state machine": partial(_designed, True)}
    return {
        "random": partial(_random, task),
        **{name: partial(_ruled, make) for name, make in rules.items()},
        **fires,
        **designs,
        "evolved linear": partial(_evolved, task),
    }


def optional(name: str) -> bool:
    """Return whether a contestant needs a package that is not installed; it takes part when it is named."""
    return name == PPO and not is_installed()
