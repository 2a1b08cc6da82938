"""Worlds of a vector that take a step in one compiled call do to the last bit what each does by itself."""

import copy
import pickle
from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import disc
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.environments import (
    Aggregation,
    CollisionAvoidance,
    ExtinguishFires,
    FindFires,
    Foraging,
    VectorSwarmEnv,
    vector,
)
from mesa_swarm.environments.driven_worlds import DrivenWorld
from mesa_swarm.environments.variation import Variation
from mesa_swarm.errors import InvalidValueError
from mesa_swarm.robots.design import AGENT3, AGENT9
from support.driven_models import Watching

# Worlds of these are driven.
DRIVEN = {
    "speed": CollisionAvoidance(n_robots=6, max_steps=25),
    "crowd": CollisionAvoidance(n_robots=40, map="openspace", max_steps=60),
    "state": CollisionAvoidance(n_robots=6, max_steps=25, reward="b", actions=8, coverage_reward=0.5),
    "next state": CollisionAvoidance(n_robots=6, max_steps=25, reward="c", reward_of="next state"),
    "find": FindFires(n_robots=8, max_steps=60),
    "found": FindFires(n_robots=30, max_steps=400, map="openspace_fire"),
    "extinguish": ExtinguishFires(n_robots=8, max_steps=60),
    "aggregate": Aggregation(n_robots=7, max_steps=300),
    "varied": CollisionAvoidance(n_robots=4, max_steps=20, variation=Variation(n_robots=(2, 6), speed=(0.5, 1.5))),
}
# Worlds of these take their steps one by one.
OTHERS = {
    "team": CollisionAvoidance(n_robots=5, team=0.3, max_steps=20),
    "designs": CollisionAvoidance(n_robots=5, design=(AGENT9, AGENT3), max_steps=20),
    "messages": CollisionAvoidance(n_robots=4, messages=1, max_steps=20),
    "forage": Foraging(n_robots=5, max_steps=30),
    "imperfect": CollisionAvoidance(n_robots=4, max_steps=20, variation=Variation(imperfection=(0.2, 0.9))),
}


def draw_actions(env, rng):
    shape = (env.n_worlds, env.commanded)
    if env.task.actions != "continuous":
        return rng.integers(0, env.task.actions, shape)
    return rng.uniform(-1, 1, (*shape, env.task.numbers))


def play(env, steps=70, change=None):
    """Return all that an environment returns in these steps, and the fingerprints of its worlds."""
    rng, returned = np.random.default_rng(0), [env.reset(seed=3)]
    for step in range(steps):
        if change is not None:
            change(env, step)
        returned += env.step(draw_actions(env, rng))
    return [*returned, [world.state_hash() for world in env.worlds], [world.measures() for world in env.worlds]]


def assert_equal(one, other):
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for name in one:
            assert_equal(one[name], other[name])
    elif isinstance(one, list):
        for pair in zip(one, other, strict=True):
            assert_equal(*pair)
    else:
        assert getattr(one, "dtype", None) == getattr(other, "dtype", None)
        np.testing.assert_array_equal(one, other)


@pytest.fixture
def alone(monkeypatch):
    """Return a function that plays an environment whose worlds take their steps one by one, in Python."""

    def play_alone(env, *arguments):
        with monkeypatch.context() as patch:
            patch.setattr(DrivenWorld, "is_ready", lambda driven: False)
            return play(env, *arguments)

    return play_alone


@pytest.mark.parametrize("mode", ["SameStep", "NextStep"])
@pytest.mark.parametrize("name", [*DRIVEN, *OTHERS])
def test_worlds_of_each_task_are_those_that_take_their_steps_alone(name, mode, alone):
    task = {**DRIVEN, **OTHERS}[name]
    envs = [VectorSwarmEnv(task, n_worlds=3, autoreset_mode=mode) for _ in range(2)]
    steps = 310 if task.max_steps >= 300 else 70
    assert_equal(play(envs[0], steps), alone(envs[1], steps))
    assert envs[0]._is_ready.all() == (name in DRIVEN)


@pytest.mark.parametrize("name", ["speed", "find", "extinguish"])
def test_robots_that_rules_drive_are_in_the_same_call(name, alone):
    envs = [VectorSwarmEnv(DRIVEN[name], n_worlds=3, commanded=2) for _ in range(2)]
    assert_equal(play(envs[0]), alone(envs[1]))
    assert envs[0]._is_ready.all()


@pytest.mark.parametrize("threads", [1, 2, 3, 8])
@pytest.mark.parametrize("worlds", [1, 7, 64])
def test_1_7_and_64_worlds_in_1_2_3_and_8_threads_are_the_same(worlds, threads):
    returned = play(VectorSwarmEnv(DRIVEN["speed"], n_worlds=worlds, threads=threads), 30)
    single = play(VectorSwarmEnv(DRIVEN["speed"], n_worlds=1), 30)
    for one, other in zip(returned, single, strict=True):
        if isinstance(one, np.ndarray) and one.ndim > 1:
            assert one[0].shape == other[0].shape
    assert_equal(returned[0][:1], single[0])  # of later steps the actions are others
    if worlds > 1:
        assert_equal(returned, play(VectorSwarmEnv(DRIVEN["speed"], n_worlds=worlds), 30))


def change_by_hand(env, step):
    """Change what a user may change between steps, each in another step."""
    world = env.worlds[1]
    changes = {
        3: lambda: setattr(world.robots[0], "position", (60.0, 60.0)),
        6: lambda: world.add_obstacle(disc((300, 300), 20)),
        9: lambda: setattr(world, "fire_constants", replace(world.fire_constants, k1=0.01)),
        12: lambda: setattr(world, "extinguish_range", 40.0),
        15: lambda: world.fires[0].put_out() if len(world.fires) else None,
        18: lambda: world.observers.append(Watching()),
        21: world.observers.clear,
        24: lambda: setattr(world.robots[1], "max_speed", 0.5),
        27: lambda: setattr(world, "collect_every", 1),
        30: lambda: setattr(world, "noise", 0.0) or world.add_process(Shaking()),
        33: lambda: world.remove_process(world.processes[-1]),
        36: world.step,
        39: lambda: world.remove_robots([world.robots[2]]),
        42: lambda: env.reset(mask=[False, True, False]),
    }
    changes.get(step, lambda: None)()


class Shaking:
    """A process that turns robots a little."""

    def step(self, model):
        model.swarm.columns["heading"] += 0.01


@pytest.mark.parametrize("name", ["speed", "find", "extinguish"])
def test_what_is_changed_by_hand_between_steps_counts(name, alone):
    task = DRIVEN[name]
    envs = [VectorSwarmEnv(task, n_worlds=3, autoreset_mode="NextStep") for _ in range(2)]
    assert_equal(play(envs[0], 50, change_by_hand), alone(envs[1], 50, change_by_hand))


def test_a_world_that_is_observed_takes_its_steps_alone_and_the_others_together():
    env = VectorSwarmEnv(DRIVEN["speed"], n_worlds=3)
    env.reset(seed=1)
    watching = Watching()
    env.worlds[1].observers.append(watching)
    env.step(np.ones((3, 6, 2)))
    assert env._is_ready.tolist() == [True, False, True]
    assert watching.steps == [(1, 1, 1)]


def test_another_control_of_a_world_is_obeyed(alone):
    def control(env, step):
        if step == 5:
            env.worlds[0].control = Subsumption(Avoid(), Explore())

    envs = [VectorSwarmEnv(DRIVEN["speed"], n_worlds=2) for _ in range(2)]
    assert_equal(play(envs[0], 20, control), alone(envs[1], 20, control))


def test_a_parameter_of_a_layer_that_drives_the_other_robots_is_obeyed(alone):
    def slow_down(env, step):
        if step == 5:
            env.worlds[0].control.layers[2].speed = 0.25

    envs = [VectorSwarmEnv(DRIVEN["speed"], n_worlds=2, commanded=2) for _ in range(2)]
    driven = play(envs[0], 20, slow_down)
    assert_equal(driven, alone(envs[1], 20, slow_down))
    assert envs[0]._is_ready.all()
    assert driven[-2] != play(VectorSwarmEnv(DRIVEN["speed"], n_worlds=2, commanded=2), 20)[-2]


def test_what_was_returned_is_not_changed_by_later_steps():
    env = VectorSwarmEnv(DRIVEN["speed"], n_worlds=2)
    env.reset(seed=1)
    observations, reward, _, _, infos = env.step(np.ones((2, 6, 2)))
    stored = observations.copy(), reward.copy(), infos["collided"].copy()
    for _ in range(20):
        env.step(-np.ones((2, 6, 2)))
    for one, other in zip((observations, reward, infos["collided"]), stored, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_in_the_same_way(copied):
    env = VectorSwarmEnv(DRIVEN["find"], n_worlds=2)
    env.reset(seed=1)
    for _ in range(10):
        env.step(np.ones((2, 8, 2)))
    twin = copied(env)
    for _ in range(10):
        assert_equal(list(env.step(np.ones((2, 8, 2)))), list(twin.step(np.ones((2, 8, 2)))))


def test_a_wrong_number_of_threads_is_refused_in_one_line():
    with pytest.raises(InvalidValueError, match=r"^threads is 0; expected"):
        VectorSwarmEnv(DRIVEN["speed"], n_worlds=1, threads=0)


def crowded_env():
    """Return worlds so crowded that the room for pairs does not do at first, with their episodes begun."""
    env = VectorSwarmEnv(CollisionAvoidance(n_robots=60, map="openspace", max_steps=50), n_worlds=3)
    env.reset(seed=5)
    for world in env.worlds:
        for robot, (x, y) in zip(world.robots, np.ndindex(8, 8), strict=False):
            robot.position = (300.0 + 16.0 * x, 200.0 + 16.0 * y)
    return env


def interrupt_once(monkeypatch, owner, name, after):
    """Let a function raise `KeyboardInterrupt` when it is called for the first time, before or after its work."""
    original, called = getattr(owner, name), []

    def function(*arguments):
        if called:
            return original(*arguments)
        called.append(name)
        if after:
            original(*arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr(owner, name, function)
    return called


@pytest.mark.parametrize(
    ("owner", "name", "after"), [(vector, "call_worlds", True), (DrivenWorld, "attend", False)], ids=["after", "within"]
)
def test_ctrl_c_in_a_call_leaves_all_worlds_after_the_step_and_none_within_it(monkeypatch, owner, name, after):
    actions = np.random.default_rng(2).uniform(-1, 1, (6, 3, 60, 2))
    whole, interrupted = crowded_env(), crowded_env()
    called = interrupt_once(monkeypatch, owner, name, after)
    steps = 0
    for action in actions:
        try:
            interrupted.step(action)
        except KeyboardInterrupt:
            steps += 1
    monkeypatch.undo()
    for action in actions:
        whole.step(action)
    assert (called, steps) == ([name], 1)
    for one, other in zip(interrupted.worlds, whole.worlds, strict=True):
        assert (one.steps, one.completed) == (other.steps, other.completed)
        assert one.state_hash() == other.state_hash()


def test_an_episode_that_ends_in_a_step_that_is_interrupted_is_reported_by_the_next_step(monkeypatch):
    action, (env, whole) = np.zeros((3, 60, 2)), (crowded_env(), crowded_env())
    for _ in range(49):
        env.step(action)
        whole.step(action)
    interrupt_once(monkeypatch, vector, "call_worlds", after=True)
    with pytest.raises(KeyboardInterrupt):
        env.step(action)
    ended = list(env.worlds)
    assert [world.steps for world in ended] == [50, 50, 50]
    interrupt_once(monkeypatch, vector.VectorSwarmEnv, "_take_step", after=True)
    with pytest.raises(KeyboardInterrupt):  # once more
        env.step(action)
    assert [world.steps for world in ended] == [50, 50, 50]
    (_, reward, _, truncated, infos), (_, expected, _, also, others) = env.step(action), whole.step(action)
    assert truncated.all()
    assert also.all()
    assert [world.steps for world in ended] == [50, 50, 50]
    assert (reward == expected).all()
    assert (infos["final_obs"] == others["final_obs"]).all()
    assert (infos["returns"] == others["returns"]).all()
    assert not env.step(action)[3].any()


def test_an_error_in_one_world_leaves_the_others_after_the_step(monkeypatch):
    env, whole = crowded_env(), crowded_env()
    failing = []

    def attend(driven, code):
        if driven.row == 1 and not failing:
            failing.append(code)
            monkeypatch.setattr(driven._driver, "attend", fail)
        driven._driver.attend(code)
        return True

    def fail(code):
        raise ValueError("no room")

    monkeypatch.setattr(DrivenWorld, "attend", attend)
    action = np.zeros((3, 60, 2))
    with pytest.raises(ValueError, match="no room"):
        env.step(action)
    monkeypatch.undo()
    whole.step(action)
    assert [world.completed for world in env.worlds] == [1, 0, 1]
    assert [world.steps for world in env.worlds] == [1, 1, 1]
    assert env.worlds[0].state_hash() == whole.worlds[0].state_hash()
    assert env.worlds[2].state_hash() == whole.worlds[2].state_hash()


def test_an_error_before_the_step_of_one_world_keeps_no_other_from_its_step(monkeypatch):
    monkeypatch.setattr("mesa_swarm.environments.vector.WORLDS", 2)
    env = crowded_env()
    action = np.zeros((env.n_worlds, env.commanded, 2))
    env.step(action)
    steps = [world.steps for world in env.worlds]
    env.worlds[1].swarm.disturbances[0] = True  # so that sensors are read again
    monkeypatch.setattr(type(env.worlds[1]), "sense", lambda self: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        env.step(action)
    assert [world.steps - before for world, before in zip(env.worlds, steps, strict=True)] == [
        int(w != 1) for w in range(env.n_worlds)
    ]
