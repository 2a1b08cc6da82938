import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.base.errors import InvalidValueError, PlacementError, SwarmError
from mesa_swarm.environments import CollisionAvoidance, ExtinguishFires, FindFires, VectorSwarmEnv
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.environments.vector import LARGEST_SEED, generators

TASKS = [
    CollisionAvoidance(n_robots=8, max_steps=300),
    FindFires(n_robots=8, max_steps=300),
    ExtinguishFires(n_robots=8, max_steps=300),
]

ENDED = {"final_obs", "_final_obs", "returns", "measures"}


def random_actions(env: VectorSwarmEnv, steps: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.2, 1, (steps, env.n_worlds, env.commanded, 2))


def played(env: VectorSwarmEnv, actions: np.ndarray, seed) -> list[np.ndarray]:
    """Return all outputs of an environment, to be compared as bytes."""
    heard = [env.reset(seed=seed)]
    for action in actions:
        *arrays, infos = env.step(action)
        measures = infos.pop("measures", {})
        heard += [*arrays, env.state(), *infos.values(), *measures.values()]
    return heard


def same(one: list[np.ndarray], other: list[np.ndarray]) -> bool:
    return len(one) == len(other) and all(a.tobytes() == b.tobytes() for a, b in zip(one, other, strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS, ids=lambda task: type(task).__name__)
def test_a_thousand_steps_are_the_same_bits_for_the_same_seed_and_others_for_another(task):
    env, twin = (VectorSwarmEnv(task, n_worlds=2) for _ in range(2))
    actions = random_actions(env, 1000)
    first = played(env, actions, 5)
    assert same(first, played(twin, actions, 5))
    assert same(first, played(env, actions, 5))
    assert not same(first[:50], played(twin, actions[:20], 6)[:50])


def test_without_a_seed_the_stream_of_episodes_goes_on():
    env, twin = (VectorSwarmEnv(TASKS[0], n_worlds=2) for _ in range(2))
    one, other = ([e.reset(seed=4), e.reset(), e.reset()] for e in (env, twin))
    assert same(one, other)
    assert not np.array_equal(one[0], one[1])
    assert not np.array_equal(one[1], one[2])


def test_without_any_seed_two_environments_differ():
    first, second = (VectorSwarmEnv(TASKS[0], n_worlds=1).reset() for _ in range(2))
    assert not np.array_equal(first, second)


@pytest.mark.slow
def test_a_world_is_the_same_alone_and_among_others():
    many, alone = VectorSwarmEnv(TASKS[0], n_worlds=3), VectorSwarmEnv(TASKS[0], n_worlds=1)
    actions = random_actions(many, 320)
    together, one = played(many, actions, [10, 11, 12]), played(alone, actions[:, 2:], 12)
    assert same([array[2:] for array in together], one)
    two = played(VectorSwarmEnv(TASKS[0], n_worlds=2), actions[:, :2], 7)
    assert same(two, [array[:2] for array in played(many, actions, 7)])


def test_worlds_are_seeded_by_the_children_of_the_seed():
    env = VectorSwarmEnv(TASKS[0], n_worlds=3)
    env.reset(seed=5)
    for world, child in zip(env.worlds, np.random.SeedSequence(5).spawn(3), strict=True):
        first = int(np.random.default_rng(child).integers(2**63))
        assert world.state_hash() == TaskWorld(task=TASKS[0], commanded=8, rng=first).state_hash()


@given(seeds=st.sets(st.integers(0, 2**63), min_size=2, max_size=4))
def test_no_two_seeds_share_a_world(seeds):
    firsts = [[int(g.integers(LARGEST_SEED)) for g in generators(seed, 16)] for seed in seeds]
    assert len(set().union(*firsts)) == 16 * len(seeds)


def test_an_episode_that_ends_hands_over_what_was_seen_last_and_starts_anew():
    env = VectorSwarmEnv(CollisionAvoidance(n_robots=3, max_steps=5), n_worlds=2)
    env.reset(seed=1)
    old, env_returns = env.worlds[1], np.zeros((2, 3))
    for step in range(1, 6):
        observations, reward, terminated, truncated, infos = env.step(np.ones((2, 3, 2)))
        env_returns += reward
        assert truncated.tolist() == [step == 5] * 2
        assert not terminated.any()
        assert set(infos) == {"collided", "present"} | (ENDED if step == 5 else set())
    assert infos["measures"]["steps"].tolist() == [5, 5]
    assert infos["returns"].tolist() == env_returns.tolist()
    seen = np.empty((3, 9), np.float32)
    old.observe(seen)
    assert np.array_equal(infos["final_obs"][1], seen)
    env.worlds[1].observe(seen)
    assert env.worlds[1].steps == 0
    assert np.array_equal(observations[1], seen)


def test_only_the_world_whose_task_is_done_starts_anew():
    env = VectorSwarmEnv(FindFires(n_robots=1, max_steps=50), n_worlds=2)
    env.reset(seed=1)
    env.worlds[0]._score.found[:] = True
    unended = env.worlds[1]
    _, _, terminated, truncated, infos = env.step(np.zeros((2, 1, 2)))
    assert terminated.tolist() == [True, False]
    assert truncated.tolist() == [False, False]
    assert env.worlds[1] is unended
    assert env.worlds[0].steps == 0
    assert infos["final_obs"].shape == (2, 1, 37)
    assert infos["_final_obs"].tolist() == [True, False]
    assert infos["measures"]["fires found"].tolist() == [1, 0]
    assert infos["returns"].tolist() == [[-0.01], [0]]


def test_a_done_task_is_terminated_and_not_truncated_though_its_time_is_up():
    env = VectorSwarmEnv(FindFires(n_robots=1, max_steps=1), n_worlds=1)
    env.reset(seed=1)
    env.worlds[0]._score.found[:] = True
    assert [bool(flag[0]) for flag in env.step(np.zeros((1, 1, 2)))[2:4]] == [True, False]


def test_what_was_handed_out_does_not_change_later():
    env = VectorSwarmEnv(TASKS[0], n_worlds=2)
    first = env.reset(seed=1)
    copy = first.copy()
    second = env.step(np.ones((2, 8, 2)))
    before = [array.copy() for array in second[:4]]
    env.step(np.ones((2, 8, 2)))
    assert np.array_equal(first, copy)
    assert same(list(second[:4]), before)


@pytest.mark.parametrize("seed", [-1, "a", 1.5, [1], [1, -2], True])
def test_wrong_seeds_are_refused(seed):
    with pytest.raises(InvalidValueError, match=r"^seed "):
        VectorSwarmEnv(TASKS[0], n_worlds=2).reset(seed=seed)


def test_a_step_before_the_first_episode_is_refused():
    with pytest.raises(SwarmError, match=r"call reset\(\) before step\(\)$"):
        VectorSwarmEnv(TASKS[0], n_worlds=2).step(np.zeros((2, 8, 2)))


def test_more_robots_than_fit_are_refused():
    with pytest.raises(PlacementError, match=r"would; ask for fewer or a larger map$"):
        VectorSwarmEnv(CollisionAvoidance(n_robots=50_000), n_worlds=1).reset()
