import numpy as np
import pytest
from pettingzoo.test import parallel_api_test, parallel_seed_test

from mesa_swarm.environments import VectorSwarmEnv, collision_avoidance_v0, extinguish_fires_v0, find_fires_v0
from mesa_swarm.errors import InvalidValueError, SwarmError, UnknownNameError

MODULES = [collision_avoidance_v0, find_fires_v0, extinguish_fires_v0]
NAMES = [module.__name__.rpartition(".")[2] for module in MODULES]


def sampled(env, rng: np.random.Generator) -> dict:
    return dict(zip(env.agents, rng.uniform(-0.2, 1, (len(env.agents), 2)).astype(np.float32), strict=True))


@pytest.mark.parametrize("module", MODULES, ids=NAMES)
@pytest.mark.parametrize("actions", ["continuous", 8])
def test_it_passes_pettingzoo_s_test(module, actions, capsys):
    parallel_api_test(module.parallel_env(n_robots=4, max_steps=80, actions=actions), num_cycles=200)
    parallel_seed_test(lambda: module.parallel_env(n_robots=4, actions=actions))
    assert "Passed Parallel API test" in capsys.readouterr().out


@pytest.mark.parametrize("module", MODULES, ids=NAMES)
def test_a_thousand_steps_are_the_same_bits_for_the_same_seed_and_others_for_another(module):
    def heard(seed: int, steps: int) -> bytes:
        env = module.parallel_env(n_robots=6, max_steps=400)
        rng, outputs = np.random.default_rng(0), [env.reset(seed=seed)]
        for _ in range(steps):
            outputs.append(env.step(sampled(env, rng)))
            if not env.agents:
                outputs.append(env.reset())
        return b"".join(np.stack(list(row[0].values())).tobytes() + repr(row[1:]).encode() for row in outputs)

    assert heard(3, 1000) == heard(3, 1000)
    assert heard(3, 20) != heard(4, 20)


def test_it_is_a_world_of_the_vectorised_environment():
    env = collision_avoidance_v0.parallel_env(n_robots=5)
    vector = VectorSwarmEnv(env.task, n_worlds=1)
    observations, _ = env.reset(seed=9)
    assert np.array_equal(np.stack(list(observations.values())), vector.reset(seed=9)[0])
    rng = np.random.default_rng(1)
    for _ in range(100):
        actions = sampled(env, rng)
        observations, rewards, *_ = env.step(actions)
        seen, reward, *_ = vector.step(np.stack(list(actions.values()))[None])
        assert np.array_equal(np.stack(list(observations.values())), seen[0])
        assert list(rewards.values()) == reward[0].tolist()


def test_the_order_of_the_dict_does_not_matter():
    env, twin = (collision_avoidance_v0.parallel_env(n_robots=3) for _ in range(2))
    env.reset(seed=1), twin.reset(seed=1)
    actions = {"robot_0": (1, 0), "robot_1": (0, 1), "robot_2": (1, 1)}
    env.step(actions)
    twin.step(dict(reversed(actions.items())))
    assert np.array_equal(env.world.swarm.heading, twin.world.swarm.heading)


def test_all_robots_end_together():
    env = find_fires_v0.parallel_env(n_robots=3, max_steps=2)
    env.reset(seed=1)
    idle = dict.fromkeys(env.possible_agents, (0, 0))
    assert not any(env.step(idle)[3].values())
    *_, terminations, truncations, _ = env.step(idle)
    assert all(truncations.values())
    assert not any(terminations.values())
    assert env.agents == []
    with pytest.raises(SwarmError, match=r"^the episode is over or not begun; call reset\(\) before step\(\)$"):
        env.step(idle)
    env.reset()
    env.world._score.found[:] = True
    *_, terminations, truncations, _ = env.step(idle)
    assert all(terminations.values())
    assert not any(truncations.values())


def test_a_done_task_is_terminated_and_not_truncated_though_its_time_is_up():
    env = find_fires_v0.parallel_env(n_robots=1, max_steps=1)
    env.reset(seed=1)
    env.world._score.found[:] = True
    assert env.step({"robot_0": (0, 0)})[2:4] == ({"robot_0": True}, {"robot_0": False})


def test_spaces_hold_what_comes_and_goes():
    env = extinguish_fires_v0.parallel_env(n_robots=2)
    observations, _ = env.reset(seed=1)
    for agent in env.agents:
        assert env.observation_space(agent).contains(observations[agent])
        assert env.action_space(agent).contains(np.float32([1, -1]))
    assert env.observation_space("robot_0").shape == (41,)
    assert str(env) == "extinguish_fires_v0"


def test_wrong_actions_are_refused_by_name():
    env = collision_avoidance_v0.parallel_env(n_robots=2)
    with pytest.raises(SwarmError, match=r"call reset\(\)"):
        env.step({})
    env.reset(seed=1)
    for actions, message in [
        ({}, "actions are {}; expected a dict of one for each agent"),
        ([(0, 0), (0, 0)], "actions are .*; expected a dict"),
        ({"robot_0": (0, 0), "robot_7": (0, 0)}, "actions lack robot_1"),
        ({"robot_0": (0, 0), "robot_1": (0, 1.5)}, r"the action of robot 1 is \[0.0, 1.5\]; expected two wheel"),
        ({"robot_0": (0, 0), "robot_1": (0, 0, 0)}, "actions are .*; expected two wheel speeds for each robot"),
    ]:
        with pytest.raises(InvalidValueError, match=f"^{message}"):
            env.step(actions)


def test_wrong_parameters_are_refused_by_name():
    with pytest.raises(UnknownNameError, match=r"^unknown parameter of CollisionAvoidance 'robots'"):
        collision_avoidance_v0.parallel_env(robots=3)
    with pytest.raises(UnknownNameError, match=r"^unknown render_mode 'human'; known: rgb_array$"):
        collision_avoidance_v0.parallel_env(render_mode="human")


def test_it_draws_only_if_asked():
    env = find_fires_v0.parallel_env(n_robots=2, render_mode="rgb_array")
    with pytest.raises(SwarmError, match=r"call reset\(\) before render\(\)$"):
        env.render()
    env.reset(seed=1)
    assert env.render().shape == (480, 640, 3)
    assert find_fires_v0.parallel_env(n_robots=2).render() is None
