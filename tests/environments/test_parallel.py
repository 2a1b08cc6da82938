import math
import pickle
import warnings

import numpy as np
import pettingzoo
import pytest

from mesa_swarm.base.errors import InvalidValueError, SwarmError, UnknownNameError
from mesa_swarm.environments import (
    Variation,
    VectorSwarmEnv,
    aggregation_v0,
    collision_avoidance_v0,
    extinguish_fires_v0,
    find_fires_v0,
    foraging_v0,
)
from mesa_swarm.maps.random_map import random_map

with warnings.catch_warnings():
    # Where pygame is installed, PettingZoo's tests import a game of its own in a way that it has deprecated.
    warnings.filterwarnings("ignore", "The old environment creation API", DeprecationWarning)
    from pettingzoo.test import (
        api_test,
        max_cycles_test,
        parallel_api_test,
        parallel_seed_test,
        render_test,
        seed_test,
        state_test,
    )

MODULES = [collision_avoidance_v0, find_fires_v0, extinguish_fires_v0, foraging_v0, aggregation_v0]
NAMES = [module.__name__.rpartition(".")[2] for module in MODULES]


def sampled(env, rng: np.random.Generator) -> dict:
    return dict(zip(env.agents, rng.uniform(-0.2, 1, (len(env.agents), 2)).astype(np.float32), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("module", MODULES, ids=NAMES)
@pytest.mark.parametrize("actions", ["continuous", 8])
def test_it_passes_pettingzoo_s_test(module, actions, capsys):
    parallel_api_test(module.parallel_env(n_robots=4, max_steps=80, actions=actions), num_cycles=200)
    parallel_seed_test(lambda: module.parallel_env(n_robots=4, actions=actions))
    assert "Passed Parallel API test" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("module", MODULES, ids=NAMES)
@pytest.mark.parametrize("actions", ["continuous", 8])
def test_with_turns_it_passes_pettingzoo_s_tests(module, actions, capsys):
    api_test(module.env(n_robots=3, max_steps=20, actions=actions), num_cycles=50)
    seed_test(lambda: module.env(n_robots=3, actions=actions), num_cycles=20)
    state_test(module.env(n_robots=3), module.parallel_env(n_robots=3))
    assert "Passed API test" in capsys.readouterr().out


def test_max_cycles_ends_an_episode_with_and_without_turns():
    max_cycles_test(find_fires_v0)
    with pytest.raises(InvalidValueError, match=r"^max_cycles is 3 beside max_steps; give one of them$"):
        find_fires_v0.parallel_env(max_cycles=3, max_steps=3)


def test_it_passes_pettingzoo_s_test_of_pictures_and_windows(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    render_test(lambda **given: collision_avoidance_v0.env(n_robots=2, **given))


def test_a_window_shows_each_step_and_closes(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame = pytest.importorskip("pygame")
    env, twin = (collision_avoidance_v0.parallel_env(n_robots=2, render_mode=mode) for mode in ("human", "rgb_array"))
    for one in (env, twin):
        one.reset(seed=1)
        one.step({"robot_0": (1, 0), "robot_1": (1, 1)})
    shown = pygame.surfarray.array3d(pygame.display.get_surface())
    assert np.array_equal(shown.swapaxes(0, 1), twin.render())
    assert env.render() is None
    env.close()
    assert not pygame.display.get_init()


@pytest.mark.parametrize("name", NAMES)
def test_pettingzoo_s_registry_knows_it(name):
    if not hasattr(pettingzoo, "make"):
        pytest.skip("PettingZoo has a registry from version 1.27 on")
    env = pettingzoo.make("parallel", f"MesaSwarm/{name}", n_robots=3, max_cycles=7)
    assert (str(env), env.task.max_steps, len(env.possible_agents)) == (name, 7, 3)
    assert str(pettingzoo.make("aec", f"MesaSwarm/{name}", n_robots=3)) == name


@pytest.mark.slow
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
    with pytest.raises(UnknownNameError, match=r"^unknown render_mode 'ansi'; .*known: rgb_array, human$"):
        collision_avoidance_v0.parallel_env(render_mode="ansi")


def test_it_draws_only_if_asked():
    env = find_fires_v0.parallel_env(n_robots=2, render_mode="rgb_array")
    with pytest.raises(SwarmError, match=r"call reset\(\) before render\(\)$"):
        env.render()
    env.reset(seed=1)
    assert env.render().shape == (480, 640, 3)
    assert find_fires_v0.parallel_env(n_robots=2).render() is None


def test_agents_are_the_robots_that_the_episode_has():
    variation = Variation(maps=("openspace", random_map(1)), n_robots=(2, 5))
    env = collision_avoidance_v0.parallel_env(n_robots=3, max_steps=2, variation=variation)
    assert len(env.possible_agents) == 5
    numbers, names = set(), set()
    for seed in range(12):
        observations, infos = env.reset(seed=seed)
        n = env.conditions.n_robots
        assert env.agents == list(observations) == list(infos) == env.possible_agents[:n]
        assert len(env.world.swarm) == n
        assert [len(part) for part in env.step(sampled(env, np.random.default_rng(1)))] == [n] * 5
        numbers.add(n), names.add(env.world.map.name)
    assert numbers == {2, 3, 4, 5}
    assert names == {"openspace", "random 1"}
    assert len(env.reset(options={"n_robots": 4, "map": "sparse"})[0]) == 4
    assert env.world.map.name == "sparse"


def test_infos_name_the_measures_that_are_known_once_the_episode_is_over():
    env = find_fires_v0.parallel_env(n_robots=2, max_steps=3)
    _, infos = env.reset(seed=1)
    names = infos["robot_1"].keys()
    assert {"collided", "collisions", "coverage", "fires found"} <= names
    idle = dict.fromkeys(env.agents, (0, 0))
    for step in range(3):
        *_, infos = env.step(idle)
        assert infos["robot_0"].keys() == names
        assert (infos["robot_0"]["coverage"] > 0) == (step == 2)
    measures = env.world.measures()
    assert math.isnan(measures["steps until all found"])
    assert infos["robot_1"] == {**measures, "collided": False, "steps until all found": math.inf}


def test_a_robot_that_collides_is_named_in_the_infos():
    env = collision_avoidance_v0.parallel_env(n_robots=8, map="original")
    env.reset(seed=1)
    seen = set()
    for _ in range(300):
        *_, infos = env.step(dict.fromkeys(env.agents, (1, 1)))
        hit = [info["collided"] for info in infos.values()]
        assert hit == env.world.swarm.collided.tolist()
        seen |= set(hit)
    assert seen == {True, False}


def test_speeds_out_of_range_are_clipped_if_asked():
    env, twin = (collision_avoidance_v0.parallel_env(n_robots=2, clip=clip) for clip in (True, False))
    env.reset(seed=1), twin.reset(seed=1)
    env.step({"robot_0": (3, 0.5), "robot_1": (-7, np.inf)})
    twin.step({"robot_0": (1, 0.5), "robot_1": (-1, 1)})
    assert env.world.state_hash() == twin.world.state_hash()
    with pytest.raises(InvalidValueError, match=r"^the action of robot 1 is \[nan, 0.0\]"):
        env.step({"robot_0": (0, 0), "robot_1": (np.nan, 0)})
    with pytest.raises(InvalidValueError, match=r"^clip is True for actions=8; expected False"):
        collision_avoidance_v0.parallel_env(actions=8, clip=True)


def test_it_can_be_copied_by_pickle_with_its_episode():
    env = collision_avoidance_v0.parallel_env(n_robots=3)
    env.reset(seed=1)
    twin = pickle.loads(pickle.dumps(env))
    for one in (env, twin):
        one.reset(seed=2)
        one.step(dict.fromkeys(one.agents, (1, 0)))
    assert env.world.state_hash() == twin.world.state_hash()


def test_options_that_are_unknown_or_out_of_range_are_refused():
    env = collision_avoidance_v0.parallel_env(n_robots=3)
    with pytest.raises(UnknownNameError, match=r"^unknown option 'maps'; did you mean 'map'\?"):
        env.reset(options={"maps": "sparse"})
    with pytest.raises(
        InvalidValueError, match=r"^option n_robots is 4; expected a whole number at least 1 and at most 3$"
    ):
        env.reset(options={"n_robots": 4})
    with pytest.raises(InvalidValueError, match=r"^options is .*; expected a dict such as"):
        env.reset(options=np.ones(3))
