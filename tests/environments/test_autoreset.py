"""When the next episode of a world of a vector begins: in the same step, in the next one, or when the user resets."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import NormalizeObservation, NormalizeReward, RecordEpisodeStatistics

from mesa_swarm.base.errors import InvalidValueError, SwarmError, UnknownNameError
from mesa_swarm.environments import CollisionAvoidance, FindFires, RobotVectorEnv, Variation, VectorSwarmEnv
from mesa_swarm.environments.vector import AUTORESET_MODES

VARIED = CollisionAvoidance(
    n_robots=5, max_steps=7, variation=Variation(maps=("original", "sparse"), n_robots=(2, 5), imperfection=(0.0, 0.5))
)


def episodes(mode: str, count: int) -> list[list[bytes]]:
    """Return all that is seen and paid in the first episodes of each of three worlds, driven alike in every mode."""
    env = VectorSwarmEnv(VARIED, n_worlds=3, autoreset_mode=mode)
    seen = env.reset(seed=5)
    heard: list[list[bytes]] = [[row.tobytes()] for row in seen]
    while min(map(len, heard)) < count * 9:
        drive = np.where(seen[..., :2] < 0.5, -0.5, 0.9)
        seen, reward, terminated, truncated, infos = env.step(drive)
        last = infos.get("final_obs", seen)
        over = terminated | truncated
        for w in range(3):
            if env.begun[w] and mode == "NextStep":
                assert not reward[w].any()
                heard[w].append(seen[w].tobytes())
                continue
            heard[w].append(last[w].tobytes() + reward[w].tobytes() + repr((terminated[w], truncated[w])).encode())
            if over[w]:
                heard[w][-1] += infos["returns"][w].tobytes()
                heard[w][-1] += repr([values[w] for values in infos["measures"].values()]).encode()
            if over[w] and mode == "SameStep":
                heard[w].append(seen[w].tobytes())
        if mode == "Disabled" and over.any():
            seen = env.reset(mask=over)
            for w in np.flatnonzero(over):
                heard[w].append(seen[w].tobytes())
    return [rows[: count * 9] for rows in heard]


@pytest.mark.slow
def test_episodes_are_the_same_bits_in_all_modes():
    same, following, disabled = (episodes(mode, 3) for mode in AUTORESET_MODES)
    assert same == following == disabled


@pytest.mark.slow
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, "NextStep"])
def test_gymnasium_s_normalize_observation_works_as_around_its_own_vector(mode):
    name, parameters = "MesaSwarm/CollisionAvoidance-v0", {"n_robots": 3, "max_steps": 6}
    ours = NormalizeObservation(gymnasium.make_vec(name, num_envs=4, autoreset_mode=mode, **parameters))
    theirs = NormalizeObservation(gymnasium.vector.SyncVectorEnv([lambda: gymnasium.make(name, **parameters)] * 4))
    assert np.array_equal(ours.reset(seed=[1, 2, 3, 4])[0], theirs.reset(seed=[1, 2, 3, 4])[0])
    for action in np.random.default_rng(0).uniform(-1, 1, (40, 4, 2)).astype(np.float32):
        seen = ours.step(action)[0]
        assert np.array_equal(seen, theirs.step(action)[0])
        assert ours.observation_space.contains(seen)


@pytest.mark.slow
def test_normalized_observations_of_all_robots_of_many_worlds_have_mean_0_and_variance_1():
    env = NormalizeObservation(
        RobotVectorEnv(CollisionAvoidance(n_robots=8, max_steps=50), n_worlds=4, autoreset_mode="NextStep")
    )
    env.reset(seed=1)
    rng = np.random.default_rng(1)
    for _ in range(300):
        env.step(rng.uniform(-0.2, 1, (32, 2)).astype(np.float32))
    env.update_running_mean = False
    rows = np.vstack([env.step(rng.uniform(-0.2, 1, (32, 2)).astype(np.float32))[0] for _ in range(300)])
    assert np.abs(rows.mean(axis=0)).max() < 0.3
    assert rows.var(axis=0) == pytest.approx(1.0, abs=0.5)


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP])
def test_gymnasium_s_statistics_are_the_returns_of_the_episodes(mode):
    task = CollisionAvoidance(n_robots=2, max_steps=4)
    env = NormalizeReward(RecordEpisodeStatistics(RobotVectorEnv(task, n_worlds=2, autoreset_mode=mode)))
    plain = VectorSwarmEnv(task, n_worlds=2)
    env.reset(seed=1), plain.reset(seed=1)
    returns, expected = [], []
    while len(returns) < 3:
        *_, infos = env.step(np.full((4, 2), 0.7))
        if "episode" in infos:
            returns.append(infos["episode"]["r"].tolist())
            assert infos["episode"]["l"].tolist() == [4] * 4
    while len(expected) < 3:
        *_, infos = plain.step(np.full((2, 2, 2), 0.7))
        if "returns" in infos:
            expected.append(infos["returns"].ravel().tolist())
    assert np.array(returns) == pytest.approx(np.array(expected))


def test_in_the_next_step_an_action_does_nothing_and_the_infos_are_those_of_a_reset():
    env = RobotVectorEnv(FindFires(n_robots=2, max_steps=2), n_worlds=1, autoreset_mode="NextStep")
    _, conditions = env.reset(seed=1)
    twin = RobotVectorEnv(FindFires(n_robots=2, max_steps=2), n_worlds=1)
    twin.reset(seed=1)
    for _ in range(2):
        last, _, _, truncated, infos = env.step(np.ones((2, 2)))
        twins = twin.step(np.ones((2, 2)))
    assert truncated.all()
    assert "final_obs" not in infos
    assert np.array_equal(last, twins[-1]["final_obs"])
    assert infos["measures"]["steps"].tolist() == [2.0, 2.0]
    again, reward, terminated, truncated, infos = env.step(-np.ones((2, 2)))
    assert np.array_equal(again, twins[0])
    assert not reward.any()
    assert not (terminated | truncated).any()
    assert infos.keys() == conditions.keys()
    assert env.swarms.worlds[0].steps == 0


def test_only_the_masked_worlds_begin_an_episode():
    env = RobotVectorEnv(CollisionAvoidance(n_robots=2), n_worlds=3, autoreset_mode=AutoresetMode.DISABLED)
    env.reset(seed=1)
    env.step(np.ones((6, 2)))
    before = [world.state_hash() for world in env.swarms.worlds]
    options = {"reset_mask": np.repeat([False, True, False], 2), "map": "sparse"}
    observations, infos = env.reset(seed=9, options=options)
    assert [world.map.name for world in env.swarms.worlds] == ["original", "sparse", "original"]
    hashes = [world.state_hash() for world in env.swarms.worlds]
    assert [a == b for a, b in zip(before, hashes, strict=True)] == [True, False, True]
    assert infos["_map"].tolist() == options["reset_mask"].tolist()
    whole = RobotVectorEnv(CollisionAvoidance(n_robots=2), n_worlds=3)
    rows = whole.reset(seed=9, options={"map": "sparse"})[0]
    assert np.array_equal(observations[2:4], rows[2:4])
    assert options.keys() == {"reset_mask", "map"}


def test_a_world_whose_episode_is_over_is_not_stepped_before_it_is_reset():
    env = VectorSwarmEnv(CollisionAvoidance(n_robots=2, max_steps=2), n_worlds=2, autoreset_mode="Disabled")
    env.reset(seed=1)
    env.step(np.ones((2, 2, 2)))
    env.reset(mask=[True, False])
    *_, truncated, infos = env.step(np.ones((2, 2, 2)))
    assert truncated.tolist() == [False, True]
    assert infos["measures"]["steps"].tolist() == [0.0, 2.0]
    with pytest.raises(SwarmError, match=r"^the episode of world 1 is over; before step\(\) call reset\(mask") as error:
        env.step(np.ones((2, 2, 2)))
    assert len(str(error.value)) < 300
    assert [world.steps for world in env.worlds] == [1, 2]
    env.reset(mask=truncated)
    env.step(np.ones((2, 2, 2)))


def test_wrong_modes_and_masks_are_refused_by_name():
    task = CollisionAvoidance(n_robots=2)
    with pytest.raises(UnknownNameError, match=r"^unknown autoreset_mode 'NextSteps'; did you mean 'NextStep'\?"):
        VectorSwarmEnv(task, n_worlds=2, autoreset_mode="NextSteps")
    env = RobotVectorEnv(task, n_worlds=2)
    with pytest.raises(SwarmError, match=r"^the environment has no episode yet; call reset\(\) of all worlds first$"):
        env.reset(options={"reset_mask": np.array([True, True, False, False])})
    env.reset(seed=1)
    for mask, message in [
        (np.array([True, False, False, False]), "option reset_mask has some environments of world 0 only"),
        (np.array([1, 1, 0, 0]), "option reset_mask is .*; expected a bool array of 4"),
        ([True, True, False, False], "option reset_mask is .*; expected a bool array of 4"),
        (np.zeros(4, bool), "mask is .*; expected True or False for each of the 2 worlds, at least one of them True"),
    ]:
        with pytest.raises(InvalidValueError, match=f"^{message}"):
            env.reset(options={"reset_mask": mask})
    with pytest.raises(InvalidValueError, match=r"^mask is \[1, 0\]; expected True or False"):
        env.swarms.reset(mask=[1, 0])
