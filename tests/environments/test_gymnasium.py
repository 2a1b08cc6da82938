import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import mesa_swarm.environments
from mesa_swarm.environments import CollisionAvoidance, FindFires, RobotEnv, RobotVectorEnv, VectorSwarmEnv, register
from mesa_swarm.environments.registration import NAMESPACE, REGISTERED
from mesa_swarm.errors import InvalidValueError, SwarmError, UnknownNameError

IDS = [f"{NAMESPACE}/{name}" for name in REGISTERED]


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("more", [{}, {"n_robots": 4, "actions": 4}], ids=["alone", "among others"])
def test_it_passes_gymnasium_s_test_without_a_warning(name, more):
    env = gymnasium.make(name, **more)
    check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize("name", IDS)
def test_a_thousand_steps_are_the_same_bits_for_the_same_seed_and_others_for_another(name):
    def heard(seed: int, steps: int) -> bytes:
        env = gymnasium.make(name, n_robots=3, max_steps=400)
        rng = np.random.default_rng(0)
        outputs = [env.reset(seed=seed)[0].tobytes()]
        for _ in range(steps):
            observation, reward, terminated, truncated, _ = env.step(rng.uniform(-0.2, 1, 2).astype(np.float32))
            outputs += [observation.tobytes(), repr((reward, terminated, truncated)).encode()]
            if terminated or truncated:
                outputs.append(env.reset()[0].tobytes())
        return b"".join(outputs)

    assert heard(3, 1000) == heard(3, 1000)
    assert heard(3, 20) != heard(4, 20)


def test_a_module_in_the_name_is_enough():
    assert gymnasium.make("mesa_swarm.environments:MesaSwarm/FindFires-v0").unwrapped.task == FindFires(n_robots=1)


def test_to_register_twice_does_no_harm():
    register()
    gymnasium.register_envs(mesa_swarm.environments)
    assert set(IDS) <= set(gymnasium.registry)


@pytest.mark.parametrize("name", IDS)
def test_make_vec_makes_what_make_makes(name):
    vector = gymnasium.make_vec(name, num_envs=2, n_robots=2)
    one = gymnasium.make(name, n_robots=2)
    assert vector.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
    seen = vector.reset(seed=7)[0]
    assert np.array_equal(seen[1], one.reset(seed=8)[0])
    for action in np.random.default_rng(0).uniform(-1, 1, (50, 2, 2)).astype(np.float32):
        rows, single = vector.step(action), one.step(action[1])
        assert np.array_equal(rows[0][1], single[0])
        assert [rows[k][1] for k in (1, 2, 3)] == list(single[1:4])
    assert vector.observation_space.contains(seen)


def test_it_agrees_with_gymnasium_s_own_vector_environment_over_ends_of_episodes():
    name, parameters = IDS[0], {"n_robots": 2, "max_steps": 7}
    ours = gymnasium.make_vec(name, num_envs=2, **parameters)
    theirs = gymnasium.vector.SyncVectorEnv(
        [lambda: gymnasium.make(name, **parameters)] * 2, autoreset_mode=AutoresetMode.SAME_STEP
    )
    assert np.array_equal(ours.reset(seed=3)[0], theirs.reset(seed=3)[0])
    for action in np.random.default_rng(0).uniform(-1, 1, (30, 2, 2)).astype(np.float32):
        (*mine, infos), (*other, their_infos) = ours.step(action), theirs.step(action)
        for a, b in zip(mine, other, strict=True):
            assert np.array_equal(a, b)
        assert set(infos) == set(their_infos) - {"final_info", "_final_info"}
        if infos:
            assert np.array_equal(infos["final_obs"], np.stack(their_infos["final_obs"]))
            assert np.array_equal(infos["_final_obs"], their_infos["_final_obs"])


def test_all_robots_of_many_worlds_lie_flat():
    task = CollisionAvoidance(n_robots=4, max_steps=30)
    flat, worlds = RobotVectorEnv(task, n_worlds=3), VectorSwarmEnv(task, n_worlds=3)
    assert np.array_equal(flat.reset(seed=1)[0].reshape(3, 4, 9), worlds.reset(seed=1))
    for action in np.random.default_rng(0).uniform(-1, 1, (40, 12, 2)):
        seen, reward, _, truncated, infos = flat.step(action)
        rows, rewards, _, ends, final = worlds.step(action.reshape(3, 4, 2))
        assert np.array_equal(seen.reshape(rows.shape), rows)
        assert np.array_equal(reward.reshape(3, 4), rewards)
        assert np.array_equal(truncated, np.repeat(ends, 4))
        assert infos.keys() - {"_final_obs"} == final.keys()


def test_all_robots_of_a_world_whose_task_is_done_end_and_no_others():
    env = RobotVectorEnv(FindFires(n_robots=3), n_worlds=2)
    env.reset(seed=1)
    env.swarms.worlds[0]._score.found[:] = True
    _, _, terminated, truncated, infos = env.step(np.zeros((6, 2)))
    assert terminated.tolist() == infos["_final_obs"].tolist() == [True] * 3 + [False] * 3
    assert not truncated.any()


def test_the_picture_distinguishes_the_commanded_robot():
    env = RobotEnv(CollisionAvoidance(n_robots=3), render_mode="rgb_array")
    env.reset(seed=1)
    assert (env.render() == (34, 34, 34)).all(axis=2).any()
    vector = RobotVectorEnv(CollisionAvoidance(n_robots=3), n_worlds=2, render_mode="rgb_array")
    vector.reset(seed=1)
    assert [picture.shape for picture in vector.render()] == [(480, 640, 3)] * 2


def test_wrong_use_is_refused_in_words():
    env = gymnasium.make(IDS[0], max_steps=3).unwrapped
    with pytest.raises(SwarmError, match=r"call reset\(\) first$"):
        env.step((0, 0))
    with pytest.raises(InvalidValueError, match=r"^seed is -1; expected"):
        env.reset(seed=-1)
    env.reset(seed=1)
    with pytest.raises(InvalidValueError, match=r"^the action of robot 0 is \[0.0, 2.0\]; expected two wheel speeds"):
        env.step((0, 2))
    with pytest.raises(UnknownNameError, match=r"^unknown parameter of FindFires 'arrivals'; did you mean 'arrival'\?"):
        gymnasium.make(IDS[1], arrivals=3)
    vector = RobotVectorEnv(CollisionAvoidance(n_robots=3), n_worlds=2, render_mode="rgb_array")
    with pytest.raises(SwarmError, match=r"call reset\(\) before render\(\)$"):
        vector.render()
    vector.reset()
    with pytest.raises(InvalidValueError, match=r"^actions have shape \(5, 2\); expected \(2, 3, 2\)"):
        vector.step(np.zeros((5, 2)))
