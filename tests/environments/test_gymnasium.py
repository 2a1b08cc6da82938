import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import mesa_swarm.environments
from mesa_swarm.base.errors import InvalidValueError, SwarmError, UnknownNameError
from mesa_swarm.environments import (
    CollisionAvoidance,
    FindFires,
    RobotEnv,
    RobotVectorEnv,
    Variation,
    VectorSwarmEnv,
    register,
)
from mesa_swarm.environments.registration import NAMESPACE, REGISTERED
from mesa_swarm.environments.rendering import RIM
from mesa_swarm.robots.imperfections import MEASURED

IDS = [f"{NAMESPACE}/{name}" for name in REGISTERED]


def plain(infos: dict) -> dict:
    """Return infos of a vector as plain values, which can be compared."""
    return {name: plain(value) if isinstance(value, dict) else value.tolist() for name, value in infos.items()}


def without_present(infos: dict) -> dict:
    return {name: value for name, value in plain(infos).items() if name not in ("present", "_present")}


@pytest.mark.slow
@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("more", [{}, {"n_robots": 4, "actions": 4}], ids=["alone", "among others"])
def test_it_passes_gymnasium_s_test_without_a_warning(name, more):
    env = gymnasium.make(name, **more)
    check_env(env.unwrapped)
    env.close()


@pytest.mark.slow
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
    assert np.array_equal(seen[0], one.reset(seed=7)[0])
    for action in np.random.default_rng(0).uniform(-1, 1, (50, 2, 2)).astype(np.float32):
        rows, single = vector.step(action), one.step(action[0])
        assert np.array_equal(rows[0][0], single[0])
        assert [rows[k][0] for k in (1, 2, 3)] == list(single[1:4])
    assert vector.observation_space.contains(seen)


@pytest.mark.slow
@pytest.mark.parametrize("mode", AutoresetMode)
def test_it_agrees_with_gymnasium_s_own_vector_environment_over_ends_of_episodes(mode):
    variation = Variation(maps=("original", "sparse"), speed=(0.5, 1.0), imperfection=(0.0, 0.5))
    name, parameters = IDS[0], {"n_robots": 40, "max_steps": 90, "variation": variation}
    ours = gymnasium.make_vec(name, num_envs=2, autoreset_mode=mode, **parameters)
    theirs = gymnasium.vector.SyncVectorEnv([lambda: gymnasium.make(name, **parameters)] * 2, autoreset_mode=mode)
    assert ours.metadata["autoreset_mode"] is mode
    (seen, infos), (their_seen, their_infos) = ours.reset(seed=[3, 9]), theirs.reset(seed=[3, 9])
    assert np.array_equal(seen, their_seen)
    assert without_present(infos) == plain(their_infos)
    collisions = 0
    for action in np.random.default_rng(0).uniform(0.8, 1, (200, 2, 2)).astype(np.float32):
        (*mine, infos), (*other, their_infos) = ours.step(action), theirs.step(action)
        for a, b in zip(mine, other, strict=True):
            assert np.array_equal(a, b)
        if "final_obs" in infos:
            their_infos["final_obs"] = np.stack(their_infos["final_obs"])
        assert without_present(infos) == plain(their_infos)
        if mode == AutoresetMode.DISABLED and (over := mine[2] | mine[3]).any():
            again = [env.reset(options={"reset_mask": over.copy()}) for env in (ours, theirs)]
            assert np.array_equal(again[0][0], again[1][0])
            assert without_present(again[0][1]) == plain(again[1][1])
        collisions += "collided" in infos and infos["collided"].sum()
    assert collisions > 0


def test_infos_follow_gymnasium_s_convention_of_masks():
    vector = gymnasium.make_vec(IDS[1], num_envs=2, n_robots=2, max_steps=3)
    one_by_one = gymnasium.wrappers.vector.DictInfoToList(vector)
    _, infos = one_by_one.reset(seed=1)
    assert [info["map"] for info in infos] == ["openspace_fire"] * 2
    for _ in range(3):
        *_, infos = one_by_one.step(np.zeros((2, 2)))
    assert infos[1]["final_info"]["measures"]["steps"] == 3
    assert infos[1]["final_info"]["measures"]["steps until all found"] == np.inf


def test_statistics_of_episodes_can_be_recorded_by_gymnasium_s_wrapper():
    vector = gymnasium.wrappers.vector.RecordEpisodeStatistics(
        RobotVectorEnv(CollisionAvoidance(n_robots=2, max_steps=3), n_worlds=2)
    )
    vector.reset(seed=1)
    rewards = []
    for _ in range(3):
        _, reward, *_, infos = vector.step(np.full((4, 2), 0.5))
        rewards.append(reward)
    assert infos["episode"]["r"] == pytest.approx(np.sum(rewards, axis=0))


def test_options_fix_what_an_episode_is_like():
    env = gymnasium.make(IDS[0], n_robots=5)
    _, info = env.reset(seed=1, options={"map": "sparse", "n_robots": 2, "speed": 0.5, "imperfection": 0.25})
    assert info == {"map": "sparse", "n_robots": 2, "speed": 0.5, "imperfection": 0.25}
    world = env.unwrapped.world
    assert (world.map.name, len(world.swarm)) == ("sparse", 2)
    assert world.swarm.max_speed.tolist() == [world.swarm.designs[0].max_speed] * 2
    assert world.swarm.designs[0].max_speed == 0.5 * env.unwrapped.task.design.max_speed
    assert world.imperfections == MEASURED.at(0.25)
    assert env.reset()[1] == {"map": "original", "n_robots": 5, "speed": 1.0, "imperfection": 0.0}
    with pytest.raises(UnknownNameError, match=r"^unknown option 'robots'; did you mean 'n_robots'\?"):
        env.reset(options={"robots": 2})


def test_a_window_shows_a_gymnasium_environment(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame = pytest.importorskip("pygame")
    env = gymnasium.make(IDS[1], render_mode="human")
    env.reset(seed=1)
    env.step(np.zeros(2, np.float32))
    assert pygame.display.get_surface().get_size() == (640, 480)
    env.close()
    with pytest.raises(InvalidValueError, match=r"^render_mode is 'human'; expected 'rgb_array' or None"):
        gymnasium.make_vec(IDS[1], num_envs=2, render_mode="human")


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
        assert ("final_obs" in infos) == ("final_obs" in final)
        if "collided" in infos:
            mask = infos["_collided"]
            assert np.array_equal(infos["collided"][mask], final["collided"].ravel()[mask])


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
    assert (env.render() == RIM).all(axis=2).any()
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
    with pytest.raises(
        InvalidValueError, match=r"^actions have shape \(5, 2\); expected 6 rows, one for each robot of the 2"
    ):
        vector.step(np.zeros((5, 2)))
    with pytest.raises(InvalidValueError, match=r"^actions are \[\[1, 1\], \[1\]\]; expected an array$"):
        vector.step([[1, 1], [1]])
