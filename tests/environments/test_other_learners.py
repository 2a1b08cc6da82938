import numpy as np
import pytest

from mesa_swarm.base.errors import InvalidValueError, SwarmError, UnknownNameError
from mesa_swarm.environments import CollisionAvoidance, FindFires, Variation, VectorSwarmEnv, collision_avoidance_v0

pytestmark = pytest.mark.slow
SMALL = CollisionAvoidance(n_robots=3, max_steps=20)


def vec_env(task=SMALL, **more):
    pytest.importorskip("stable_baselines3")
    from mesa_swarm.environments import SharedPolicyVecEnv  # noqa: PLC0415 - optional

    return SharedPolicyVecEnv(task, **{"n_worlds": 2, "seed": 1, **more})


def test_the_vec_env_is_the_worlds_of_the_vector_with_infos_of_episodes():
    env, worlds = vec_env(), VectorSwarmEnv(SMALL, n_worlds=2)
    assert np.array_equal(env.reset().reshape(2, 3, 9), worlds.reset(seed=1))
    assert env.reset_infos[5] == {"map": "original", "n_robots": 3, "speed": 1.0, "imperfection": 0.0}
    total, rng = np.zeros(6), np.random.default_rng(0)
    for step in range(1, 50):
        actions = rng.uniform(-1.5, 1.5, (6, 2)).astype(np.float32)
        seen, reward, ended, infos = env.step(actions)
        rows, rewards, _, truncated, found = worlds.step(np.clip(actions, -1, 1).reshape(2, 3, 2))
        assert np.array_equal(seen.reshape(2, 3, 9), rows)
        assert reward.dtype == np.float32
        assert reward == pytest.approx(rewards.ravel())
        assert ended.tolist() == [step % 20 == 0] * 6 == np.repeat(truncated, 3).tolist()
        assert [info["collided"] for info in infos] == found["collided"].ravel().tolist()
        total += rewards.ravel()
        if step % 20 == 0:
            assert [info["episode"]["r"] for info in infos] == pytest.approx(total.tolist())
            assert {info["episode"]["l"] for info in infos} == {20}
            assert infos[4]["episode"]["coverage"] == found["measures"]["coverage"][1]
            assert all(info["TimeLimit.truncated"] for info in infos)
            last = [info["terminal_observation"] for info in infos]
            assert np.array_equal(np.array(last).reshape(2, 3, 9), found["final_obs"])
            total[:] = 0


def test_a_finished_task_is_not_truncated():
    env = vec_env(FindFires(n_robots=2))
    env.reset()
    env.swarms.worlds[0]._score.found[:] = True
    _, _, ended, infos = env.step(np.zeros((4, 2)))
    assert ended.tolist() == [True, True, False, False]
    assert [info["TimeLimit.truncated"] for info in infos[:2]] == [False, False]
    assert "episode" not in infos[2]


def test_seeds_and_options_are_those_of_the_next_reset():
    env, twin = vec_env(), VectorSwarmEnv(SMALL, n_worlds=2)
    assert env.seed([4, 5]) == [4, 4, 4, 5, 5, 5]
    env.set_options({"map": "sparse"})
    assert np.array_equal(env.reset().reshape(2, 3, 9), twin.reset(seed=[4, 5], options={"map": "sparse"}))
    assert np.array_equal(env.reset().reshape(2, 3, 9), twin.reset())
    env.seed(7)
    assert np.array_equal(env.reset().reshape(2, 3, 9), twin.reset(seed=7))


def test_options_that_were_refused_are_not_those_of_the_reset_after():
    env = vec_env()
    env.set_options({"noise": 1})
    with pytest.raises(UnknownNameError, match=r"^unknown option 'noise'"):
        env.reset()
    assert env.reset().shape == (6, 9)


def test_fewer_robots_than_are_commanded_are_refused_as_an_option():
    env = vec_env()
    env.set_options([{"n_robots": 3}, {"n_robots": 2}])
    with pytest.raises(InvalidValueError, match=r"^option n_robots is 2; expected at least 3, the commanded robots"):
        env.reset()
    few = vec_env(commanded=2)
    few.set_options({"n_robots": 2})
    assert few.reset().shape == (4, 9)


def test_wrong_use_of_the_vec_env_is_refused_in_words():
    env = vec_env(n_worlds=2.0, render_mode="rgb_array")
    assert env.num_envs == 6
    with pytest.raises(SwarmError, match=r"call reset\(\) before render\(\)$"):
        env.render()
    env.reset()
    for wrong, shape in ((np.ones((5, 2)), r"\(5, 2\)"), (None, r"\(\)")):
        with pytest.raises(InvalidValueError, match=rf"^actions have shape {shape}; expected 6 rows, one for each"):
            env.step(wrong)


def test_attributes_and_pictures_are_what_stable_baselines_asks_for():
    env = vec_env(render_mode="rgb_array")
    env.reset()
    assert env.get_attr("task", [0, 4]) == [SMALL, SMALL]
    assert env.get_attr("render_mode", 2) == ["rgb_array"]
    assert not env.has_attr("spec")
    assert env.env_is_wrapped(object, [1]) == [False]
    assert env.render().shape == (960, 640, 3)
    with pytest.raises(InvalidValueError, match=r"^task cannot be set"):
        env.set_attr("task", None)
    with pytest.raises(InvalidValueError, match=r"^fly cannot be called"):
        env.env_method("fly")
    with pytest.raises(InvalidValueError, match=r"^commanded is 4 and the least of n_robots 2; expected at most that"):
        vec_env(CollisionAvoidance(variation=Variation(n_robots=(2, 4))))


@pytest.mark.parametrize("actions", ["continuous", 8])
def test_ppo_of_stable_baselines_learns_with_one_policy_for_all_robots(actions):
    ppo = pytest.importorskip("stable_baselines3").PPO
    monitor = pytest.importorskip("stable_baselines3.common.vec_env").VecMonitor
    task = CollisionAvoidance(n_robots=3, max_steps=16, actions=actions)

    def trained(seed: int) -> tuple[list, np.ndarray]:
        model = ppo("MlpPolicy", monitor(vec_env(task)), n_steps=32, batch_size=32, n_epochs=2, seed=seed, device="cpu")
        model.learn(384)
        assert len(model.ep_info_buffer) == 24
        assert {episode["l"] for episode in model.ep_info_buffer} == {16}
        return list(model.policy.parameters()), model.predict(vec_env(task).reset(), deterministic=True)[0]

    (weights, chosen), (others, again) = trained(1), trained(1)
    assert all((one == other).all() for one, other in zip(weights, others, strict=True))
    assert np.array_equal(chosen, again)
    assert len(chosen) == 6


def test_dqn_of_stable_baselines_learns_from_numbered_actions():
    dqn = pytest.importorskip("stable_baselines3").DQN
    model = dqn("MlpPolicy", vec_env(CollisionAvoidance(n_robots=3, actions=4)), learning_starts=32, device="cpu")
    assert model.learn(312).num_timesteps == 312


def test_supersuit_stacks_copies_of_the_world_into_a_vector():
    supersuit = pytest.importorskip("supersuit")
    env = collision_avoidance_v0.parallel_env(n_robots=3, max_cycles=5)
    flat = supersuit.concat_vec_envs_v1(supersuit.pettingzoo_env_to_vec_env_v1(env), 2, num_cpus=0)
    observations, _ = flat.reset(seed=1)
    assert observations.shape == (6, 9)
    vector = VectorSwarmEnv(env.task, n_worlds=1)
    assert np.array_equal(observations[:3], vector.reset(seed=1)[0])
    for step in range(1, 12):
        observations, reward, terminated, truncated, _ = flat.step(np.ones((6, 2), np.float32))
        rows, rewards, *_ = vector.step(np.ones((1, 3, 2)))
        assert np.array_equal(observations[:3], rows[0])
        assert reward[:3] == pytest.approx(rewards[0])
        assert truncated.astype(bool).tolist() == [step % 5 == 0] * 6
        assert not np.any(terminated)


def test_supersuit_s_wrappers_wrap_it():
    supersuit = pytest.importorskip("supersuit")
    env = collision_avoidance_v0.parallel_env(n_robots=3)
    stacked = supersuit.frame_stack_v1(supersuit.clip_actions_v0(env), 4)
    observations, _ = stacked.reset(seed=1)
    assert observations["robot_2"].shape == (36,)
    stacked.step(dict.fromkeys(stacked.agents, np.array([2.0, 0.0], np.float32)))
    assert env.world.steps == 1


@pytest.mark.filterwarnings("ignore:PettingZoo in TorchRL is tested using version")
@pytest.mark.parametrize("actions", ["continuous", 4])
def test_torchrl_rolls_out_all_robots_as_one_group(actions):
    pytest.importorskip("torchrl")
    wrapper = pytest.importorskip("torchrl.envs").PettingZooWrapper
    base = collision_avoidance_v0.parallel_env(n_robots=3, max_cycles=7, actions=actions)
    env = wrapper(base, return_state=True, seed=1)
    played = env.rollout(20)
    group = played["robot"]
    assert group["observation"].shape == (7, 3, 9)
    assert played["next", "done"].squeeze(-1).tolist() == [False] * 6 + [True]
    assert played["next", "robot", "info", "coverage"][-1].min() > 0
    assert np.array_equal(played["next", "state"][-1].numpy(), base.state())
