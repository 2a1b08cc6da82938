"""Rewards that a team shares, pay for new ground, messages, and teams of several designs."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT9, AGENT_FIRE, Map, SwarmModel
from mesa_swarm.analysis import visited_cells
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.environments import (
    Aggregation,
    CollisionAvoidance,
    ExtinguishFires,
    FindFires,
    Foraging,
    Variation,
    VectorSwarmEnv,
    collision_avoidance_v0,
)
from mesa_swarm.environments.task_world import Commanded, TaskWorld
from mesa_swarm.maps.random_map import random_map
from support.task_worlds import rewarded, world_of

BLANK = Map(name="blank", bounds=(0, 0, 400, 400))


def test_the_first_robot_in_a_cell_is_paid_for_it_and_no_robot_after_it():
    task = CollisionAvoidance(map=BLANK, coverage_reward=3.0, design=replace(AGENT9, max_speed=2.0))
    # Cells are 10 x 10: the first robot enters one in its first and in its fourth step, the second follows it.
    world = world_of(task, [(102, 105, 0.0), (84, 105, 0.0), (300, 305, 0.0)])
    paid = [rewarded(world, [(1, 1), (1, 1), (0, 0)]) for _ in range(9)]
    assert [row[0] - 1 for row in paid] == [3, 0, 0, 3, 0, 0, 0, 0, 3]
    assert [row[1] - 1 for row in paid] == [3, 0, 3, 0, 0, 0, 0, 0, 0]
    assert [row[2] for row in paid] == [3] + 8 * [0]


@given(st.integers(0, 1000))
@settings(max_examples=5)
def test_what_is_paid_for_new_ground_is_the_number_of_cells_that_the_analysis_counts(seed):
    rules = Subsumption(Avoid(), Explore(turn_interval=10))
    paying = CollisionAvoidance(n_robots=4, map="sparse", coverage_reward=1.0)
    worlds = [TaskWorld(task=task, control=rules, rng=seed) for task in (paying, replace(paying, coverage_reward=0.0))]
    positions, paid, reward = [], 0.0, np.empty((2, 4))
    for _ in range(60):
        for world, row in zip(worlds, reward, strict=True):
            world.advance(None, row)
        paid += (reward[0] - reward[1]).sum()
        positions.append(worlds[0].swarm.position.copy())
    assert paid == pytest.approx(visited_cells(np.array(positions), worlds[0].map.bounds, (40, 40)).sum())


@pytest.mark.parametrize("team", [0.0, 0.25, 1.0])
def test_a_share_of_the_reward_is_the_mean_of_the_commanded_robots(team):
    task = CollisionAvoidance(map=BLANK, team=team)
    world = world_of(task, [(100, 100, 0.0), (200, 100, 0.0), (300, 100, 0.0), (300, 300, 0.0)], commanded=3)
    own = np.array([1.0, 0.5, 0.0])
    assert rewarded(world, own[:, None].repeat(2, axis=1)) == pytest.approx((1 - team) * own + team * 0.5)


def heard_by(world) -> np.ndarray:
    """Return the last columns of the observations: of what robots hear."""
    out = np.empty((world.commanded, world.task.observer().width), np.float32)
    world.observe(out)
    return out[:, 9:]


def test_robots_observe_what_the_nearest_robot_within_range_sends_with_its_range_and_bearing():
    task = CollisionAvoidance(map=BLANK, messages=2, message_range=100.0)
    world = world_of(task, [(100, 100, 0.0), (100, 150, 0.0), (100, 210, np.pi / 2)])
    rewarded(world, [(0, 0, 0.2, -1.0), (0, 0, 0.5, 1.0), (0, 0, -0.6, 0.0)])
    expected = [
        [0.5, 0.5, 1.0, 0.75, 1.0],  # the second, to the left
        [0.5, 0.5, 0.0, 0.6, 0.0],  # the first, to the right
        [0.6, 0.0, 0.5, 0.75, 1.0],  # the second, behind
    ]
    assert np.allclose(heard_by(world), expected, rtol=0, atol=1e-6)
    world.robots[0].position = (390, 390)
    rewarded(world, [(0, 0, 0.0, 0.0)] * 3)
    assert np.allclose(heard_by(world)[0], [1.0, 0.5, 0.5, 0.5, 0.5])


def test_what_is_observed_is_what_robots_hear_in_the_next_step():
    poses = [(100, 100, 0.0), (150, 100, 0.0)]
    task = CollisionAvoidance(map=BLANK, messages=1, n_robots=2, design=(replace(AGENT9, max_speed=2.0), AGENT9))
    world = world_of(task, poses)
    model = SwarmModel(map=BLANK, rng=1, communication=task.radio)
    for design, pose in zip(task.designs, poses, strict=True):
        model.add_robots(design, poses=[pose])
    model.control = Subsumption(Commanded(2, sends={"signal": 1}))
    layer = model.control.layers[0]
    layer.wheels[:], layer.sends[:] = [(0, 2), (0, 1)], [[0.25], [-0.5]]
    for _ in range(5):
        rewarded(world, [(0, 1, 0.25), (0, 1, -0.5)])
        model.step()
        observed = heard_by(world)[:, [0, 3]] * [150, 2] - [0, 1]
        model.parts.radio.exchange()
        known = np.column_stack([model.swarm.columns["heard.range"][:, 0], model.swarm.columns["heard.signal"][:, 0]])
        assert np.allclose(observed, known, rtol=0, atol=1e-4)


@given(st.integers(0, 1000))
@settings(max_examples=5)
def test_messages_change_nothing_but_what_is_heard(seed):
    plain = CollisionAvoidance(n_robots=4, map=BLANK)
    worlds = [TaskWorld(task=task, rng=seed) for task in (plain, replace(plain, messages=3))]
    rng, reward = np.random.default_rng(seed), np.empty((2, 4))
    for _ in range(20):
        actions = rng.uniform(-1, 1, (4, 5))
        for world, row in zip(worlds, reward, strict=True):
            world.advance(actions[:, : world.task.numbers], row)
        assert np.array_equal(reward[0], reward[1])
    seen = [np.empty((4, world.task.observer().width), np.float32) for world in worlds]
    for world, out in zip(worlds, seen, strict=True):
        world.observe(out)
    assert seen[1].shape == (4, 9 + 3 + 3)
    assert np.array_equal(seen[0], seen[1][:, :9])


def test_robots_have_the_designs_in_blocks_as_even_as_possible():
    task = CollisionAvoidance(design=(AGENT9, AGENT3, AGENT9), n_robots=8, map=BLANK)
    assert [(design.name, count) for design, count in task.blocks()] == [("AGENT9", 3), ("AGENT3", 3), ("AGENT9", 2)]
    world = TaskWorld(task=task, rng=1)
    assert [robot.design for robot in world.robots] == [AGENT9] * 3 + [AGENT3] * 3 + [AGENT9] * 2
    assert task.observer().widths == (9, 9, 9, 3, 3, 3, 9, 9)


def test_robots_of_a_team_observe_what_they_would_among_their_like():
    team = TaskWorld(task=FindFires(design=(AGENT_FIRE, AGENT9), n_robots=5), rng=3)
    out = np.full((5, team.task.observer().width), np.nan, np.float32)
    team.observe(out)
    for design, rows in ((AGENT_FIRE, slice(0, 3)), (AGENT9, slice(3, 5))):
        encoder = team.task.encoder(design)
        own = np.empty((5, encoder.width), np.float32)
        encoder.observe(team.swarm.columns, own)
        assert np.array_equal(out[rows, : encoder.width], own[rows])
        assert not out[rows, encoder.width :].any()


def test_a_vector_environment_pads_the_observations_of_a_team_and_declares_it():
    task = CollisionAvoidance(design=(AGENT3, AGENT9), n_robots=3, map=BLANK)
    env = VectorSwarmEnv(task, n_worlds=2)
    seen = env.reset(seed=1)
    assert env.observed.sum(axis=1).tolist() == [3, 3, 9]
    assert not seen[:, ~env.observed].any()
    assert (seen[:, env.observed] > 0).all()
    assert env.step(np.ones((2, 3, 2)))[1].shape == (2, 3)


def test_the_thesis_s_reward_takes_the_range_of_each_robot_s_own_sensors():
    short = AGENT9.with_proximity(range=25)
    poses = [(395 - 20, 100, 0.0), (395 - 20, 300, 0.0)]
    task = CollisionAvoidance(map=BLANK, reward="b", critical=0.9, reward_of="next state")
    mixed = rewarded(world_of(replace(task, design=(AGENT9, short), n_robots=2), poses), [(0, 0), (0, 0)])
    alone = [
        rewarded(world_of(replace(task, design=one), [pose]), [(0, 0)])[0]
        for one, pose in zip((AGENT9, short), poses, strict=True)
    ]
    assert mixed == alone
    assert mixed[0] != mixed[1]


TASKS = [CollisionAvoidance, FindFires, ExtinguishFires, Foraging, Aggregation]


@pytest.mark.slow
@pytest.mark.parametrize("task", TASKS)
def test_every_task_takes_messages_teams_designs_and_pay_for_ground_at_once(task):
    made = task(n_robots=3, design=(AGENT9, AGENT3), messages=1, team=0.5, coverage_reward=0.1, max_steps=4)
    env = VectorSwarmEnv(made, n_worlds=2)
    seen = env.reset(seed=1)
    for _ in range(5):
        seen, reward, *_ = env.step(np.full((2, 3, made.numbers), 0.5))
        assert np.isfinite(reward).all()
        assert seen.min() >= 0
        assert seen.max() <= 1


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"team": 1.1}, "team is 1.1; expected"),
        ({"coverage_reward": -1}, "coverage_reward is -1; expected"),
        ({"messages": 101}, "messages is 101; expected"),
        ({"messages": 1, "actions": 8}, "messages is 1 with actions=8; expected 'continuous' actions"),
        ({"message_range": 0}, "message_range is 0; expected"),
        ({"design": ()}, r"design is \(\); expected a RobotDesign"),
        ({"design": (AGENT9, 3)}, "design is .*; expected a RobotDesign such as AGENT9, or several"),
        ({"design": (AGENT9, AGENT3), "n_robots": 1}, "design has 2 of them for 1 robots"),
        (
            {"design": (AGENT9, AGENT3), "variation": Variation(n_robots=(2, 4))},
            "variation draws the number of robots of 2 designs; expected one design",
        ),
    ],
)
def test_wrong_teams_and_messages_are_refused_by_name(wrong, message):
    with pytest.raises(InvalidValueError, match=f"^{message}"):
        CollisionAvoidance(**wrong)


def test_actions_with_messages_have_more_numbers_and_errors_name_them():
    env = VectorSwarmEnv(CollisionAvoidance(n_robots=2, messages=2, map=BLANK), n_worlds=1)
    env.reset(seed=1)
    with pytest.raises(InvalidValueError, match=r"expected \(1, 2, 4\): 4 numbers, two of them wheel speeds for each"):
        env.step(np.zeros((1, 2, 2)))
    with pytest.raises(
        InvalidValueError, match=r"robot 1 in world 0 .*; expected 4 numbers, two of them wheel speeds, fr"
    ):
        env.step(np.array([[(0, 0, 0, 0), (0, 0, 0, 2)]]))


def test_agents_of_a_team_have_the_observation_spaces_of_their_designs():
    env = collision_avoidance_v0.parallel_env(design=(AGENT9, AGENT3), n_robots=3, messages=1, max_cycles=3)
    assert [env.observation_space(agent).shape for agent in env.possible_agents] == [(13,), (13,), (7,)]
    observations, _ = env.reset(seed=1)
    while env.agents:
        assert all(env.observation_space(agent).contains(row) for agent, row in observations.items())
        observations, *_ = env.step({agent: env.action_space(agent).sample() for agent in env.agents})
    assert env.action_space("robot_2").shape == (3,)


@pytest.mark.parametrize("task", [FindFires, ExtinguishFires])
def test_fires_on_random_maps_are_found_and_fought(task):
    world = TaskWorld(task=task(map=random_map(3, fires=4), n_robots=6, max_steps=600), commanded=0, rng=2)
    measured = world.play()
    assert len(world.fires) == 4
    assert measured["fires found" if task is FindFires else "coverage"] > 0
    assert world.swarm.fire.max() < 4


def test_a_rule_sends_and_hears_the_task_s_messages():
    class Beacon:
        name = "Beacon"

        def bind(self, swarm, prefix, rng):
            pass

        def decide(self, senses, command, layer, index):
            senses.send["signal"][:] = np.arange(len(layer)) / 4
            layer[:] = index

    task = CollisionAvoidance(map=BLANK, n_robots=3, messages=1, message_range=1000)
    world = TaskWorld(task=task, control=Subsumption(Beacon()), rng=1)
    world.advance(None, np.empty(3))
    out = np.empty((3, task.observer().width), np.float32)
    world.observe(out)
    nearest = [int(np.argsort(np.hypot(*(world.swarm.position - place).T))[1]) for place in world.swarm.position]
    assert out[:, -1].tolist() == [0.5 + k / 8 for k in nearest]
