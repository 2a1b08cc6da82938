import numpy as np
import pytest

from mesa_swarm import Map, disc
from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.environments import (
    CollisionAvoidance,
    ExtinguishFires,
    FindFires,
    Foraging,
    StateEncoder,
    Variation,
    VectorSwarmEnv,
    extinguish_fires_v0,
)
from mesa_swarm.environments.state import OF_FIRE, OF_ROBOT, OF_THING
from mesa_swarm.maps.map import FireSpot


def played(task, steps: int, **more) -> VectorSwarmEnv:
    env = VectorSwarmEnv(task, n_worlds=2, **more)
    env.reset(seed=1)
    rng = np.random.default_rng(0)
    for _ in range(steps):
        env.step(rng.uniform(-0.2, 1, (2, env.commanded, 2)))
    return env


def added(world) -> list:
    return world.obstacle_list[len(world.map.obstacles) :]


def test_the_state_is_what_the_columns_are():
    env = played(ExtinguishFires(n_robots=5, max_steps=500), 200, commanded=2)
    world, state = env.worlds[1], env.state()[1]
    columns, fires, (width, height) = world.swarm.columns, world.fires.columns, (world.map.width, world.map.height)
    assert state[0] == np.float32(200 / 500)
    robots = state[1 : 1 + 5 * OF_ROBOT].reshape(5, OF_ROBOT)
    for i, row in enumerate(robots):
        (x, y), heading, fastest = columns["position"][i], columns["heading"][i], columns["max_speed"][i]
        left, right = columns["command"][i] / fastest
        hot = min(columns["temperature"][i] / world.fire_constants.leave, 1)
        collided = float(columns["collided"][i])
        expected = [1, x / width, y / height, np.cos(heading), np.sin(heading), left, right, collided, hot]
        assert row == pytest.approx(expected, abs=1e-6)
    for k, row in enumerate(state[1 + 5 * OF_ROBOT :].reshape(-1, OF_FIRE)):
        x, y = fires["position"][k]
        temperature = min(fires["temperature"][k], 1)
        assert row == pytest.approx([1, x / width, y / height, temperature, float(fires["out"][k])], abs=1e-6)


def test_it_is_within_its_space():
    for task in (CollisionAvoidance(n_robots=6), FindFires(n_robots=3), ExtinguishFires(n_robots=3)):
        env = played(task, 60)
        assert env.state_space is env.state_space
        assert env.state_space.shape == env.state().shape[1:] == (StateEncoder(task).width,)
        assert all(env.state_space.contains(row) for row in env.state())


def test_absent_robots_and_fires_are_0():
    small = Map(name="small", bounds=(-50, -50, 150, 150), obstacles=[disc((100, 100), 5)], fires=[FireSpot((0, 0), 9)])
    task = FindFires(variation=Variation(maps=("openspace_fire", small), n_robots=(2, 3)))
    encoder, env = StateEncoder(task), VectorSwarmEnv(task, n_worlds=1)
    most = len(task.chart.fires)
    assert encoder.width == 1 + 3 * OF_ROBOT + most * OF_FIRE
    env.reset(seed=1, options={"map": small, "n_robots": 2})
    state = env.state()[0]
    robots, fires = state[1 : 1 + 3 * OF_ROBOT].reshape(3, OF_ROBOT), state[1 + 3 * OF_ROBOT :].reshape(-1, OF_FIRE)
    assert robots[:, 0].tolist() == [1, 1, 0]
    assert fires[:, 0].tolist() == [1] + [0] * (most - 1)
    assert fires[0, 1:3].tolist() == [0.25, 0.25]
    assert not robots[2].any()
    assert not fires[1:].any()


def test_a_map_with_more_fires_than_there_is_room_for_is_refused():
    crowded = Map(name="crowded", bounds=(0, 0, 200, 200), fires=[FireSpot((20 * k, 100), 5) for k in range(1, 9)])
    env = VectorSwarmEnv(FindFires(n_robots=1), n_worlds=1)
    with pytest.raises(SwarmError, match=r"call reset\(\) before state\(\)$"):
        env.state()
    env.reset(options={"map": crowded})
    with pytest.raises(InvalidValueError, match=r"^map crowded has 8 fires; the state has room for \d"):
        env.state()


def test_the_nest_and_the_food_are_part_of_the_state():
    env = VectorSwarmEnv(Foraging(n_robots=2, items=4), n_worlds=1)
    env.reset(seed=1)
    world = env.worlds[0]
    things = env.state()[0, -5 * OF_THING :].reshape(5, OF_THING)
    nest, *food = [(body.position[0] / world.map.width, body.position[1] / world.map.height) for body in added(world)]
    assert things[:, 0].tolist() == [1] * 5
    assert things[0, 1:] == pytest.approx(nest, abs=1e-6)
    assert np.sort(things[1:, 1:], axis=0) == pytest.approx(np.sort(food, axis=0), abs=1e-6)


def test_pettingzoo_s_state_is_that_of_the_vector():
    env, vector = extinguish_fires_v0.parallel_env(n_robots=4), VectorSwarmEnv(ExtinguishFires(n_robots=4), n_worlds=1)
    env.reset(seed=3), vector.reset(seed=3)
    for _ in range(30):
        env.step(dict.fromkeys(env.agents, (1, 0.9)))
        vector.step(np.full((1, 4, 2), (1, 0.9)))
    assert env.state().tobytes() == vector.state()[0].tobytes()
    assert env.state_space.contains(env.state())
