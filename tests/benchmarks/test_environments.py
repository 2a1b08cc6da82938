from time import process_time

import gymnasium
import numpy as np
import pytest

from mesa_swarm.environments import (
    Aggregation,
    CollisionAvoidance,
    ExtinguishFires,
    FindFires,
    Foraging,
    RobotVectorEnv,
    VectorSwarmEnv,
)
from mesa_swarm.environments.parallel import ParallelSwarmEnv

TASKS = [CollisionAvoidance, FindFires, ExtinguishFires, Foraging, Aggregation]
# Processor time: other programs disturb it less than time on the clock.
pytestmark = pytest.mark.benchmark(timer=process_time)
ROBOTS, WORLDS = 50, 16
ROUND = 30


def actions(*shape: int) -> np.ndarray:
    """Return wheel speeds that drive forward more than back, for a round of steps."""
    return np.random.default_rng(0).uniform(-0.2, 1, (ROUND, *shape, 2)).astype(np.float32)


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
def test_robot_steps_through_arrays(benchmark, task):
    env = VectorSwarmEnv(task(n_robots=ROBOTS), n_worlds=WORLDS)
    env.reset(seed=1)
    commands = actions(WORLDS, ROBOTS)
    steps = benchmark(lambda: [env.step(row) for row in commands])
    assert np.isfinite([reward for _, reward, *_ in steps]).all()
    if benchmark.stats is not None:  # None where benchmarks are off
        benchmark.extra_info["robot-steps/s"] = ROUND * WORLDS * ROBOTS / benchmark.stats["median"]


@pytest.mark.parametrize("task", TASKS)
def test_robot_steps_through_pettingzoo(benchmark, task):
    env = ParallelSwarmEnv(task(n_robots=ROBOTS, max_steps=10**9), name="timed_v0")
    env.reset(seed=1)
    commands = [dict(zip(env.agents, row, strict=True)) for row in actions(ROBOTS)]

    def played() -> list:
        if not env.agents:  # all fires were found
            env.reset()
        return [env.step(row) for row in commands if env.agents]

    steps = benchmark(played)
    assert all(rewards.keys() == set(env.possible_agents) for _, rewards, *_ in steps)
    if benchmark.stats is not None:  # None where benchmarks are off
        benchmark.extra_info["robot-steps/s"] = ROUND * ROBOTS / benchmark.stats["median"]


def test_robot_steps_through_a_flat_vector(benchmark):
    env = RobotVectorEnv(CollisionAvoidance(n_robots=ROBOTS), n_worlds=WORLDS)
    env.reset(seed=1)
    commands = actions(WORLDS * ROBOTS)
    steps = benchmark(lambda: [env.step(row) for row in commands])
    assert np.isfinite([reward for _, reward, *_ in steps]).all()
    if benchmark.stats is not None:  # None where benchmarks are off
        benchmark.extra_info["robot-steps/s"] = ROUND * WORLDS * ROBOTS / benchmark.stats["median"]


def test_steps_of_one_robot_through_gymnasium(benchmark):
    env = gymnasium.make("MesaSwarm/CollisionAvoidance-v0", max_steps=10**9)
    env.reset(seed=1)
    commands = actions()
    steps = benchmark(lambda: [env.step(row) for row in commands])
    assert np.isfinite([reward for _, reward, *_ in steps]).all()
    if benchmark.stats is not None:  # None where benchmarks are off
        benchmark.extra_info["robot-steps/s"] = ROUND / benchmark.stats["median"]
