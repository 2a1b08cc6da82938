"""Robots that are removed from the world of an environment: their agents die, the others go on as if numbers stayed."""

import inspect
import math
import warnings

import gymnasium
import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, Map
from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.environments import (
    CollisionAvoidance,
    ExtinguishFires,
    FindFires,
    Foraging,
    ParallelSwarmEnv,
    RobotEnv,
    RobotVectorEnv,
    StateEncoder,
    TaskWorld,
    VectorSwarmEnv,
    aggregation_v0,
    collision_avoidance_v0,
    extinguish_fires_v0,
    find_fires_v0,
    foraging_v0,
)
from mesa_swarm.environments.parallel import with_turns
from mesa_swarm.environments.sb3 import _check_none_missing
from mesa_swarm.environments.state import OF_ROBOT
from mesa_swarm.environments.task_world import Roster
from mesa_swarm.maps.random_map import random_map
from support.task_worlds import world_of

with warnings.catch_warnings():
    warnings.filterwarnings("ignore", "The old environment creation API", DeprecationWarning)
    from pettingzoo.test import api_test, parallel_api_test

MODULES = [collision_avoidance_v0, find_fires_v0, extinguish_fires_v0, foraging_v0, aggregation_v0]
NAMES = [module.__name__.rpartition(".")[2] for module in MODULES]
BLANK = Map(name="blank", bounds=(0, 0, 300, 300))


def remove(world, unique_id) -> None:
    """Remove a robot by its unique_id."""
    next(robot for robot in world.robots if robot.unique_id == unique_id).remove()


class Mortal(ParallelSwarmEnv):
    """Removes a robot before every tenth step."""

    steps = 0

    def step(self, actions):
        self.steps += 1
        if self.steps % 10 == 0:
            self.world.robots[self.steps // 10 % len(self.world.robots)].remove()
        return super().step(actions)


def mortal(module, **parameters) -> Mortal:
    env = module.parallel_env(n_robots=4, **parameters)
    return Mortal(env.task, name=env.metadata["name"])


@pytest.mark.slow
@pytest.mark.parametrize("module", MODULES, ids=NAMES)
@pytest.mark.parametrize("actions", ["continuous", 8])
def test_with_removed_robots_it_passes_pettingzoo_s_test_without_a_warning(module, actions, capsys):
    parallel_api_test(mortal(module, max_steps=80, actions=actions), num_cycles=200)
    assert "Passed Parallel API test" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("module", MODULES, ids=NAMES)
@pytest.mark.parametrize("actions", ["continuous", 8])
def test_with_turns_and_removed_robots_it_passes_pettingzoo_s_test(module, actions, capsys):
    api_test(with_turns(mortal(module, max_steps=80, actions=actions)), num_cycles=100)
    assert "Passed API test" in capsys.readouterr().out


@pytest.mark.parametrize("module", MODULES, ids=NAMES)
def test_the_agent_of_a_removed_robot_is_terminated_in_that_step_and_reset_brings_it_back(module):
    env = module.parallel_env(n_robots=4)
    env.reset(seed=1)
    actions = dict.fromkeys(env.possible_agents, (0.5, 0.5))
    before = env.step(actions)[0]
    env.world.robots[1].remove()
    assert env.agents == env.possible_agents
    outputs = env.step(actions)
    assert all(list(part) == env.possible_agents for part in outputs)
    observations, rewards, terminated, truncated, infos = outputs
    assert terminated == {"robot_0": False, "robot_1": True, "robot_2": False, "robot_3": False}
    assert not any(truncated.values())
    assert (rewards["robot_1"], infos["robot_1"]["collided"]) == (0.0, False)
    assert env.observation_space("robot_1").contains(observations["robot_1"])
    assert np.array_equal(observations["robot_1"], before["robot_1"])
    assert env.agents == ["robot_0", "robot_2", "robot_3"]
    assert all(list(part) == env.agents for part in env.step({agent: (0.5, 0.5) for agent in env.agents}))
    env.reset()
    assert env.agents == env.possible_agents
    assert len(env.world.swarm) == 4


@pytest.mark.slow
@pytest.mark.parametrize("module", MODULES, ids=NAMES)
@pytest.mark.parametrize("seed", range(3))
def test_each_agent_keeps_its_own_robot_whichever_others_are_removed(module, seed):
    env = module.parallel_env(n_robots=8, max_steps=500)
    env.reset(seed=seed)
    rng = np.random.default_rng(seed)
    robots = dict(zip(env.agents, env.world.robots, strict=True))
    encoder = env.task.observer()
    for step in range(60):
        if step % 10 == 5:
            robots.pop(str(rng.choice(env.agents))).remove()
        wheels = {agent: rng.uniform(-1, 1, 2) for agent in robots}
        observations, _, terminated, _, infos = env.step(wheels)
        assert [agent for agent, gone in terminated.items() if not gone] == env.agents == list(robots)
        rows = np.empty((len(robots), encoder.width), np.float32)
        encoder.observe(env.world.swarm.columns, rows)
        for agent, robot in robots.items():
            assert robot.command == pytest.approx(wheels[agent] * robot.max_speed)
            assert infos[agent]["collided"] == robot.collided
            assert np.array_equal(observations[agent], rows[robot.row])


def test_rewards_and_measures_are_those_of_each_robot_while_it_was_there():
    env = collision_avoidance_v0.parallel_env(n_robots=20, max_steps=100, map=BLANK)
    env.reset(seed=3)
    robots = dict(zip(env.agents, env.world.robots, strict=True))
    steps, hits, ahead = ({agent: 0.0 for agent in robots} for _ in range(3))
    while env.agents:
        if len(env.agents) > 2 and env.world.steps % 7 == 3:
            robots.pop(env.agents[env.world.steps % len(env.agents)]).remove()
        _, rewards, _, _, infos = env.step({agent: (1.0, 0.8) for agent in env.agents})
        for agent, robot in robots.items():
            assert rewards[agent] == pytest.approx(0.9 - 2.0 * robot.collided)
            steps[agent] += 1
            hits[agent] += robot.collided
            ahead[agent] += 0.9
    measured = infos["robot_0" if "robot_0" in infos else next(iter(infos))]
    assert sum(hits.values()) > 0
    assert measured["collisions"] == pytest.approx(1000 * sum(hits.values()) / sum(steps.values()))
    assert measured["worst robot"] == pytest.approx(max(1000 * hits[agent] / steps[agent] for agent in steps))
    assert measured["speed ahead"] == pytest.approx(0.9)
    assert measured["steps"] == 100


def test_a_robot_that_is_removed_by_a_process_of_the_world_dies_in_the_same_step():
    class Trap:
        def step(self, model):
            if model.steps == 3:
                model.robots[0].remove()

    env = collision_avoidance_v0.parallel_env(n_robots=3)
    env.reset(seed=1)
    env.world.add_process(Trap())
    for _ in range(3):
        _, rewards, terminated, *_ = env.step(dict.fromkeys(env.agents, (1, 1)))
    assert terminated == {"robot_0": True, "robot_1": False, "robot_2": False}
    assert rewards["robot_0"] == 0.0
    assert rewards["robot_1"] != 0.0


def test_without_any_robot_the_episode_is_over():
    env = find_fires_v0.parallel_env(n_robots=2)
    env.reset(seed=1)
    for robot in list(env.world.robots):
        robot.remove()
    *_, terminated, truncated, infos = env.step({})
    assert terminated == {"robot_0": True, "robot_1": True}
    assert truncated == {"robot_0": False, "robot_1": False}
    assert (infos["robot_0"]["fires found"], infos["robot_0"]["coverage"]) == (0.0, 0.0)
    assert env.agents == []


def test_no_action_is_needed_of_a_removed_robot_but_of_all_others():
    env = collision_avoidance_v0.parallel_env(n_robots=3, actions=4)
    env.reset(seed=1)
    env.world.robots[0].remove()
    with pytest.raises(InvalidValueError, match=r"^actions lack robot_2"):
        env.step({"robot_1": 0})
    with pytest.raises(InvalidValueError, match=r"^actions are .*; expected a dict"):
        env.step({"robot_1": 0, "robot_2": 0, "robot_9": 0})
    with pytest.raises(InvalidValueError, match=r"^the action of robot 2 is 7"):
        env.step({"robot_1": 0, "robot_2": 7})
    env.step({"robot_1": 0, "robot_2": 3})
    with pytest.raises(InvalidValueError, match=r"^actions are .*; expected a dict"):
        env.step({"robot_0": 0, "robot_1": 0, "robot_2": 3})


def test_fires_that_a_removed_robot_has_found_stay_found():
    world = TaskWorld(task=FindFires(n_robots=3, map=random_map(3, fires=2)), rng=1)
    first, second = world.fires
    reward = np.empty(3)
    world.robots[0].position = np.add(first.position, (first.radius + 8.0, 0))
    world.sense()
    world.advance(np.zeros((3, 2)), reward)
    assert reward[0] > 0 > reward[1]
    world.robots[0].remove()
    world.robots[0].position = np.add(second.position, (second.radius + 8.0, 0))
    world.advance(np.zeros((3, 2)), reward)
    assert (reward[0], reward[1] > 0 > reward[2]) == (0.0, True)
    assert world.finished
    assert world.measures()["fires found"] == 1.0


@pytest.mark.slow
def test_what_a_removed_robot_delivered_counts_and_the_others_are_paid_for_their_own():
    world = TaskWorld(task=Foraging(map=BLANK, n_robots=6, max_steps=900, items=40), commanded=0, rng=3)
    numbers = {robot.unique_id: number for number, robot in enumerate(world.robots)}
    reward, robot_steps, by_removed = np.empty(6), 0, 0
    for step in range(900):
        if step in (300, 500):
            carrier = next((robot for robot in world.robots if robot.carried[0] >= 0), world.robots[1])
            by_removed += np.count_nonzero(world.events.unique_id == carrier.unique_id)
            carrier.remove()
        before = len(world.events)
        world.advance(None, reward)
        robot_steps += len(world.swarm)
        new = [unique_id for _, name, unique_id, _ in world.events.rows(before) if name == "delivered"]
        assert np.flatnonzero(reward > 5).tolist() == sorted({numbers[unique_id] for unique_id in new})
    delivered, measured = world.events.count("delivered"), world.measures()
    assert delivered > by_removed > 0
    assert measured["items delivered"] == delivered
    assert measured["items per 1,000 robot-steps"] == pytest.approx(1000 * delivered / robot_steps)


def test_the_others_of_a_team_of_designs_observe_by_their_own_design():
    task = CollisionAvoidance(design=(AGENT3, AGENT9), n_robots=6, map=BLANK)
    world = TaskWorld(task=task, rng=1)
    for unique_id in (world.robots[1].unique_id, world.robots[3].unique_id):
        remove(world, unique_id)
    out = np.full((6, 9), np.nan, np.float32)
    world.observe(out)
    assert not out[[1, 3]].any()
    assert not out[[0, 2], 3:].any()
    for number, row, design in ((0, 0, AGENT3), (2, 1, AGENT3), (4, 2, AGENT9), (5, 3, AGENT9)):
        own = np.empty((4, len(design.proximity)), np.float32)
        task.encoder(design).observe(world.swarm.columns, own)
        assert np.array_equal(out[number, : own.shape[1]], own[row])


def test_the_state_keeps_each_robot_s_place():
    world = TaskWorld(task=FindFires(n_robots=4), rng=1)
    encoder = StateEncoder(world.task)
    before, after = (np.empty(encoder.width, np.float32) for _ in range(2))
    encoder.write(world, before)
    world.robots[2].remove()
    encoder.write(world, after)
    rows = slice(1 + 2 * OF_ROBOT, 1 + 3 * OF_ROBOT)
    assert before[rows].any()
    before[rows] = 0
    assert np.array_equal(before, after)


def test_a_vector_has_rows_of_zeros_for_removed_robots_until_the_next_episode():
    env = VectorSwarmEnv(CollisionAvoidance(n_robots=3, max_steps=4), n_worlds=2)
    env.reset(seed=1)
    env.worlds[1].robots[1].remove()
    observations, reward, terminated, truncated, infos = env.step(np.ones((2, 3, 2)))
    there = [[True, True, True], [True, False, True]]
    assert env.present.tolist() == infos["present"].tolist() == there
    assert infos["removed"].tolist() == (~np.array(there)).tolist()
    assert observations.any(axis=2).tolist() == (reward != 0).tolist() == there
    assert not terminated.any()
    for step in (2, 3, 4):
        observations, reward, *_, truncated, infos = env.step(np.ones((2, 3, 2)))
        assert "removed" not in infos
        assert (reward[1, 1], truncated.all()) == (0.0, step == 4)
    assert env.present.all()
    assert observations.any(axis=2).all()
    assert not infos["final_obs"][1, 1].any()


def test_a_world_of_a_vector_without_robots_begins_its_next_episode():
    env = VectorSwarmEnv(CollisionAvoidance(n_robots=3), n_worlds=2, commanded=1)
    env.reset(seed=1)
    env.worlds[0].robots[0].remove()
    env.worlds[1].robots[2].remove()  # driven by rules
    _, _, terminated, truncated, _ = env.step(np.ones((2, 1, 2)))
    assert (terminated.tolist(), truncated.any()) == ([True, False], False)
    assert [len(world.swarm) for world in env.worlds] == [3, 2]
    assert env.present.all()


def test_a_gymnasium_episode_is_terminated_if_its_own_robot_is_removed_and_only_then():
    env = gymnasium.make("MesaSwarm/CollisionAvoidance-v0", n_robots=3)
    env.reset(seed=1)
    world = env.unwrapped.world
    world.robots[2].remove()
    observation, reward, terminated, *_ = env.step(np.ones(2, np.float32))
    assert (observation.any(), reward, terminated) == (True, 1.0, False)
    world.robots[0].remove()
    again, reward, terminated, truncated, info = env.step(np.ones(2, np.float32))
    assert (again.tolist(), reward, terminated, truncated) == (observation.tolist(), 0.0, True, False)
    assert (info["collided"], info["measures"]["steps"]) == (False, 2.0)
    assert env.reset()[0].any()


@pytest.mark.parametrize("mode", ["SameStep", "NextStep", "Disabled"])
def test_a_flat_vector_terminates_the_environment_of_a_removed_robot_once(mode):
    env = RobotVectorEnv(CollisionAvoidance(n_robots=2, max_steps=5), n_worlds=2, autoreset_mode=mode)
    env.reset(seed=1)
    env.swarms.worlds[1].robots[0].remove()
    observations, _, terminated, truncated, infos = env.step(np.ones((4, 2)))
    assert terminated.tolist() == [False, False, True, False]
    assert infos["present"].tolist() == observations.any(axis=1).tolist() == [True, True, False, True]
    if mode == "SameStep":
        assert infos["_final_obs"].tolist() == terminated.tolist()
        assert infos["final_obs"].shape == observations.shape
    *_, terminated, truncated, infos = env.step(np.ones((4, 2)))
    assert not terminated.any()
    assert not truncated.any()


def test_stable_baselines_refuses_robots_that_are_missing_while_the_episode_goes_on():
    infos = {"removed": np.array([[False, False], [False, True]])}
    _check_none_missing({}, np.array([False, False]))
    _check_none_missing(infos, np.array([False, True]))
    with pytest.raises(SwarmError, match=r"^robot 1 of world 1 was removed during an episode; Stable-Base"):
        _check_none_missing(infos, np.array([True, False]))


INTERFACES = {
    "parallel": (lambda task: ParallelSwarmEnv(task, name="x"), lambda env: env.world),
    "gymnasium": (RobotEnv, lambda env: env.world),
    "arrays": (lambda task: VectorSwarmEnv(task, n_worlds=2), lambda env: env.worlds[1]),
    "flat": (lambda task: RobotVectorEnv(task, n_worlds=2), lambda env: env.swarms.worlds[1]),
}


@pytest.mark.parametrize("name", INTERFACES)
def test_robots_that_are_added_are_refused_in_one_line_and_no_world_advances(name):
    make, world_of_env = INTERFACES[name]
    env = make(CollisionAvoidance(n_robots=2))
    env.reset(seed=1)
    actions = {
        "parallel": dict.fromkeys(("robot_0", "robot_1"), (1, 1)),
        "gymnasium": (1, 1),
        "arrays": np.ones((2, 2, 2)),
        "flat": np.ones((4, 2)),
    }[name]
    world = world_of_env(env)
    world.robots[0].remove()
    world.add_robots(AGENT9, 1)
    with pytest.raises(SwarmError, match=r"^robot \d+ was added to the world of an episode, which keeps") as error:
        env.step(actions)
    assert len(str(error.value)) < 300
    worlds = env.worlds if name == "arrays" else env.swarms.worlds if name == "flat" else [env.world]
    assert [each.steps for each in worlds] == [0] * len(worlds)
    env.reset()
    env.step(actions)


@pytest.mark.parametrize("task", [FindFires(n_robots=2), ExtinguishFires(n_robots=2)])
@pytest.mark.parametrize(
    "change", [lambda world: world.fires[0].remove(), lambda world: world.add_fire((400, 60), radius=5)]
)
def test_fires_that_are_added_or_removed_are_refused_where_they_count(task, change):
    world = TaskWorld(task=task, rng=1)
    change(world)
    with pytest.raises(SwarmError, match=r"^the episode began with 7 fires, and some were added or removed"):
        world.advance(np.zeros((2, 2)), np.empty(2))


def test_food_that_is_added_has_no_room_in_the_state():
    world = TaskWorld(task=Foraging(n_robots=2, items=3), rng=1)
    encoder = StateEncoder(world.task)
    next(process for process in world.processes if hasattr(process, "add_food")).add_food(world)
    with pytest.raises(InvalidValueError, match=r"^the world has 5 things; the state has room for 4"):
        encoder.write(world, np.empty(encoder.width, np.float32))


def test_a_score_that_cannot_do_without_a_robot_refuses_that_it_is_removed():
    class MyScore:
        finished = False

        def reward(self, out):
            out[:] = 1.0

    class Mine(CollisionAvoidance):
        def score(self, model, count):
            return MyScore()

    world = TaskWorld(task=Mine(n_robots=3), commanded=2, rng=1)
    world.robots[2].remove()  # not rewarded
    world.advance(np.zeros((2, 2)), np.empty(2))
    world.robots[1].remove()
    for _ in range(2):
        with pytest.raises(SwarmError, match=r"^robot 1 was removed from the world, and MyScore has no remove_robots"):
            world.advance(np.zeros((2, 2)), np.empty(2))


def test_every_score_of_the_package_can_do_without_robots():
    for module in ("scores", "foraging", "aggregation"):
        members = vars(__import__(f"mesa_swarm.environments.{module}", fromlist=["x"])).items()
        for name, scored in members:
            if name.endswith("Score") and name != "Score" and inspect.isclass(scored):
                assert callable(scored.remove_robots)


def test_an_episode_without_a_learner_is_measured_by_the_steps_that_robots_were_there():
    class Trap:
        def step(self, model):
            if model.steps == 10:
                model.robots[0].remove()

    world = world_of(CollisionAvoidance(map=BLANK, max_steps=20), [(50, 50, 0.0), (50, 150, 0.0)])
    world.add_process(Trap())
    played = world.play(lambda seen: np.ones((2, 2)))
    assert played["reward"] == pytest.approx((9 + 20) / (9 + 20))
    assert played["speed ahead"] == pytest.approx(1.0)
    lone = TaskWorld(task=CollisionAvoidance(n_robots=1, map=BLANK, max_steps=3), rng=1)
    lone.robots[0].remove()
    played = lone.play(lambda seen: np.ones((1, 2)))
    assert (played["steps"], played["reward"]) == (1.0, 0.0)
    assert math.isnan(played["collisions"])
    assert math.isnan(played["worst robot"])


def test_a_picture_marks_the_commanded_robots_that_are_left():
    env = RobotEnv(CollisionAvoidance(n_robots=4, map=BLANK), render_mode="rgb_array")
    env.reset(seed=1)
    marked = env.render()
    env.world.robots[0].remove()
    plain = env.render()
    assert (marked == 0).any() or (marked != plain).any()
    dark = [(picture.sum(axis=2) < 150).sum() for picture in (marked, plain)]
    assert dark[0] > dark[1] == 0


def test_a_roster_numbers_robots_by_their_first_rows():
    world = TaskWorld(task=CollisionAvoidance(n_robots=5), rng=1)
    roster = Roster(world.swarm)
    world.robots[3].remove()
    world.robots[0].remove()
    gone = roster.find_gone(world.swarm)
    assert gone.tolist() == [0, 3]
    roster.drop(gone)
    assert roster.numbers.tolist() == [1, 2, 4]
    assert [roster.remaining(first) for first in range(6)] == [0, 0, 1, 2, 2, 3]
    assert roster.present(4).tolist() == [False, True, True, False]
    out = np.full(4, 9.0)
    roster.spread(np.array([10.0, 20.0, 30.0]), out)
    assert out.tolist() == [0.0, 10.0, 20.0, 0.0]
