"""The arena: all that Mesa's continuous space promises, without its hazards, on plain Mesa agents and on ours."""

import copy
import gc
import pickle
import random
import subprocess
import sys
import weakref

import mesa
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm import AGENT3, AGENT9, SwarmModel, disc, rectangle
from mesa_swarm.base.errors import InvalidValueError, RemovedRobotError
from mesa_swarm.control import Subsumption
from mesa_swarm.fire.fires import Fire
from mesa_swarm.robots.robot import Robot
from mesa_swarm.world.arena import Arena, Registered
from mesa_swarm.world.bodies import Obstacle
from support.pace import work_within
from support.scenes import ahead, blind, empty

SQUARE = [[0, 100], [0, 100]]


def arena(dimensions=SQUARE, **options):
    return Arena(dimensions, random=random.Random(1), **options)


def populated(points, dimensions=SQUARE, **options):
    """Return an arena with a plain Mesa agent at each point, and the agents."""
    model, space = mesa.Model(rng=1), arena(dimensions, **options)
    agents = [ContinuousSpaceAgent(space, model) for _ in points]
    for agent, point in zip(agents, points, strict=True):
        agent.position = point
    return space, agents


# ---- sizes and bounds


@pytest.mark.parametrize(
    ("dimensions", "size", "center"),
    [
        (SQUARE, (100, 100), (50, 50)),
        ([[-50, 50], [10, 30]], (100, 20), (0, 20)),
        ([[0, 1], [0, 2], [0, 4]], (1, 2, 4), (0.5, 1, 2)),
    ],
)
def test_size_and_centre_follow_from_the_dimensions(dimensions, size, center):
    space = arena(dimensions)
    assert (tuple(space.size), tuple(space.center), space.ndims) == (size, center, len(size))
    assert (space.width, space.height) == size[:2]
    assert [[space.x_min, space.x_max], [space.y_min, space.y_max]] == [list(d) for d in dimensions[:2]]


@pytest.mark.parametrize(
    ("point", "inside"),
    [((0, 0), True), ((100, 100), True), ((50, 100.0001), False), ((-1e-12, 5), False), ((np.nan, 5), False)],
)
def test_the_border_is_inside_and_beyond_it_is_not(point, inside):
    assert arena().in_bounds(point) is inside


@pytest.mark.parametrize("n_agents", [0, 1, 2, 15, 16, 17, 100])
def test_an_arena_made_for_any_number_of_agents_takes_any_number(n_agents):
    points = [(k % 100, k // 100) for k in range(150)]
    space, agents = populated(points, n_agents=n_agents)
    assert space.agent_positions.tolist() == [list(map(float, p)) for p in points]
    assert [agent._mesa_index for agent in agents] == list(range(150))


def test_an_empty_arena_answers_every_question():
    space = arena(n_agents=0)
    assert space.agent_positions.shape == (0, 2)
    assert len(space.agents) == 0
    assert space.calculate_distances((5, 5))[0].shape == (0,)
    assert space.calculate_difference_vector((5, 5)).shape == (0, 2)
    assert space.get_agents_in_radius((5, 5), 1e9)[0] == []
    assert space.get_k_nearest_agents((5, 5), 3)[0] == []


def test_a_new_agent_is_at_a_place_of_the_arena_before_it_is_given_one():
    space, _ = populated([])
    agent = ContinuousSpaceAgent(space, mesa.Model(rng=1))
    assert space.in_bounds(agent.position)


# ---- agents come and go


@given(st.lists(st.integers(0, 10**6), min_size=1, max_size=40))
def test_indices_and_positions_stay_together_whichever_agents_come_and_go(moves):
    model, space, agents, truth = mesa.Model(rng=1), arena(n_agents=1), [], {}
    for k, move in enumerate(moves):
        if move % 3 or not agents:
            agents.append(ContinuousSpaceAgent(space, model))
            agents[-1].position = truth[agents[-1]] = (k, move % 101)
        else:
            gone = agents.pop(move % len(agents))
            gone.remove()
            assert gone.space is None
            assert gone._mesa_index is None
        assert space.active_agents == agents == list(space.agents)
        assert space._index_to_agent == dict(enumerate(agents))
        assert space._agent_to_index == {agent: row for row, agent in enumerate(agents)}
        assert [agent._mesa_index for agent in agents] == list(range(len(agents)))
        assert [tuple(agent.position) for agent in agents] == [truth[agent] for agent in agents]
        assert space.agent_positions.shape == (len(agents), 2)


# ---- hazards that Mesa has


@pytest.mark.parametrize("point", [(101, 5), (-1, 5), (np.nan, 5), (np.inf, 5), (1, 2, 3), 5, "ab", None])
def test_a_wrong_position_is_refused_and_nothing_is_written(point):
    space, (agent, _) = populated([(10, 20), (30, 40)])
    with pytest.raises((ValueError, TypeError)):
        agent.position = point
    assert space.agent_positions.tolist() == [[10, 20], [30, 40]]


def test_adding_too_much_to_a_position_raises_and_writes_nothing():
    _, (agent, _) = populated([(10, 20), (30, 40)])
    with pytest.raises(ValueError, match="outside"):
        agent.position += (0, 1000)
    assert agent.position.tolist() == [10, 20]
    agent.position += (5, 5)
    assert agent.position.tolist() == [15, 25]


def test_writing_to_what_was_read_is_refused():
    space, (agent, _) = populated([(10, 20), (30, 40)])
    for values in (agent.position, space.agent_positions[0], space.agent_positions[:1]):
        with pytest.raises(InvalidValueError, match="an element of a copy was set, which would change nothing"):
            values[:] = 77
    assert space.agent_positions.tolist() == [[10, 20], [30, 40]]


def test_positions_that_are_read_after_a_change_are_those_of_now():
    space, agents = populated([(10, 20), (30, 40), (50, 60)])
    before = space.agent_positions
    agents[0].remove()
    assert before.shape == (3, 2)
    assert space.agent_positions.tolist() == [[30, 40], [50, 60]]
    agents[1].position = (1, 1)
    assert before[1].tolist() == [30, 40]


def test_a_row_of_the_positions_may_be_written_within_bounds():
    space, (agent, _) = populated([(10, 20), (30, 40)])
    space.agent_positions[0] = (11, 21)
    assert agent.position.tolist() == [11, 21]
    with pytest.raises(InvalidValueError, match="outside the arena"):
        space.agent_positions[0] = (11, 210)


def test_positions_written_all_at_once_are_refused_instead_of_ignored():
    space, _ = populated([(10, 20), (30, 40)])
    with pytest.raises(InvalidValueError, match="one agent at a time"):
        space.agent_positions += 1
    with pytest.raises(InvalidValueError, match="one agent at a time"):
        space.agent_positions[:] = 1
    with pytest.raises(InvalidValueError, match="one agent at a time"):
        space.agent_positions = np.ones((2, 2))
    assert space.agent_positions.tolist() == [[10, 20], [30, 40]]


def test_writing_a_row_of_the_arena_moves_a_robot_and_not_what_stands_still():
    model = empty()
    obstacle = model.add_obstacle(disc((50, 50), 5))
    robot = model.add_robots(blind(), poses=[(100, 100, 0.0)])[0]
    model.space.agent_positions[robot._mesa_index] = (120, 130)
    assert model.swarm.position.tolist() == [[120, 130]]
    with pytest.raises(InvalidValueError, match="obstacles do not move"):
        model.space.agent_positions[obstacle._mesa_index] = (120, 130)


def test_pos_is_the_position_and_setting_it_moves():
    model = empty()
    robot = model.add_robots(blind(), poses=[(100, 100, 0.0)])[0]
    robot.pos = (120, 130)
    assert robot.position.tolist() == robot.pos.tolist() == [120, 130]


# ---- distances


@pytest.mark.parametrize("torus", [False, True])
def test_differences_and_distances_are_those_of_the_geometry(torus):
    rng = np.random.default_rng(1)
    points = rng.uniform(0, 100, (30, 2))
    space, agents = populated(points, torus=torus)
    here = np.array([90.0, 5.0])
    images = [(a, b) for a in (-100, 0, 100) for b in (-100, 0, 100)] if torus else [(0, 0)]
    least = np.min([np.hypot(*(points + shift - here).T) for shift in images], axis=0)
    distances, who = space.calculate_distances(here)
    assert distances == pytest.approx(least)
    assert list(who) == agents
    vectors = space.calculate_difference_vector(here)
    assert np.hypot(*vectors.T) == pytest.approx(least)
    assert np.mod(here + vectors - points + 50, 100) == pytest.approx(np.full((30, 2), 50)) if torus else True
    some, who = space.calculate_distances(here, agents[3:7])
    assert some == pytest.approx(least[3:7])
    assert list(who) == agents[3:7]
    assert space.calculate_difference_vector(here, agents[3:7]) == pytest.approx(vectors[3:7])
    assert type(distances) is type(vectors) is np.ndarray


def test_other_measures_of_distance_may_be_asked_for():
    space, _ = populated([(10, 20), (30, 40)])
    assert space.calculate_distances((0, 0), metric="cityblock")[0].tolist() == [30, 70]


@pytest.mark.parametrize("torus", [False, True])
@pytest.mark.parametrize("radius", [0, 5, 20, 1000])
def test_agents_in_a_radius_are_all_those_and_only_those(torus, radius):
    points = [(2, 2), (98, 98), (7, 2), (50, 50), (2, 2)]
    space, agents = populated(points, torus=torus)
    inside, distances = space.get_agents_in_radius((2, 2), radius)
    every, _ = space.calculate_distances((2, 2))
    assert inside == [a for a, d in zip(agents, every, strict=True) if d <= radius]
    assert distances.tolist() == [d for d in every if d <= radius]


@pytest.mark.parametrize("k", [0, 1, 2, 4, 5, 50, 10**9])
def test_the_k_nearest_are_the_nearest_in_order_and_all_if_there_are_fewer(k):
    space, agents = populated([(10, 0), (40, 0), (0, 0), (20, 0)])
    nearest, distances = space.get_k_nearest_agents((1, 0), k)
    assert nearest == [agents[2], agents[0], agents[3], agents[1]][:k]
    assert distances.tolist() == [1, 9, 19, 39][:k]


def test_neighbours_do_not_include_oneself():
    _, agents = populated([(10, 0), (14, 0), (30, 0), (60, 0)])
    near, distances = agents[0].get_neighbors_in_radius(20)
    assert near == [agents[1], agents[2]]
    assert distances.tolist() == [4, 20]
    nearest, distances = agents[3].get_nearest_neighbors(2)
    assert nearest == [agents[2], agents[1]]
    assert agents[0].get_nearest_neighbors(99)[0] == agents[1:]


def test_neighbours_are_those_within_one_unit_or_the_single_nearest_unless_asked_otherwise():
    model = empty()
    robots = list(model.add_robots(blind(0.25), poses=[(50, 50, 0), (51, 50, 0), (50, 48.999, 0), (50, 51.5, 0)]))
    assert robots[0].get_neighbors_in_radius()[0] == [robots[1]]
    assert robots[0].get_nearest_neighbors()[0] == [robots[1]]
    assert model.space.get_k_nearest_agents((50, 51.4))[0] == [robots[3]]
    assert [robots[0].get_nearest_neighbors(k)[0] for k in (0, -1, -(2**31))] == [[], [], []]
    with pytest.raises(InvalidValueError, match="k is"):
        robots[0].get_nearest_neighbors(-(2**31) - 1)


def test_the_agents_of_a_model_may_be_indexed_and_sliced():
    model = empty()
    robots = list(model.add_robots(blind(), 4))
    assert (model.robots[0], model.robots[-1], model.robots[1:3]) == (robots[0], robots[3], robots[1:3])


@pytest.mark.slow
def test_the_agents_of_a_model_to_which_nothing_else_refers_stay():
    def robots_of_a_model():
        model = SwarmModel(rng=1)
        model.add_robots(AGENT3, 3)
        return model.robots

    robots = robots_of_a_model()
    gc.collect()
    assert (len(robots), robots[0].model.robots[2].unique_id) == (3, robots[2].unique_id)


def test_a_torus_takes_positions_from_beyond_its_border_to_the_other_side():
    space, (agent,) = populated([(10, 20)], torus=True)
    agent.position = (110, -5)
    assert agent.position.tolist() == [10, 95]
    assert space.torus_correct((250, 30)).tolist() == [50, 30]


# ---- our agents


def test_robots_are_found_where_they_are_after_steps_and_removals():
    model = SwarmModel(map="original", rng=3)
    model.add_fire((700, 80), radius=20)
    robots = model.add_robots(AGENT9, 20)
    model.control = Subsumption(ahead)
    for k in range(10):
        model.run(5)
        robots.pop(k).remove()
        for robot in robots:
            assert model.space.get_agents_in_radius(robot.position, 1e-9)[0] == [robot]
        agents = [*model.obstacles, *model.fires, *model.robots]
        found, distances = model.space.get_agents_in_radius((400, 300), 1e9)
        assert set(found) == set(agents)
        assert distances == pytest.approx([np.hypot(*(a.position - (400, 300))) for a in found])
        table = {a: tuple(p) for a, p in zip(model.space.active_agents, model.space.agent_positions, strict=True)}
        assert table == {a: tuple(a.position) for a in agents}


def test_neighbours_of_robots_that_share_a_place_are_as_many_as_asked_for():
    model = empty()
    robots = model.add_robots(blind(), poses=[(100, 100, 0.0)] * 3 + [(130, 100, 0.0)])
    assert robots[2].get_nearest_neighbors(1)[0] == [robots[0]]
    assert robots[2].get_nearest_neighbors(9)[0] == [robots[0], robots[1], robots[3]]
    assert robots[2].get_neighbors_in_radius(1)[0] == robots[:2]
    assert robots[2].get_neighbors_in_radius(-1)[0] == []


def test_all_other_robots_are_within_an_infinite_radius_and_a_radius_that_is_not_a_number_is_refused():
    model = empty()
    robots = list(model.add_robots(blind(), poses=[(50, 50, 0), (70, 50, 0), (390, 290, 0)]))
    assert robots[0].get_neighbors_in_radius(float("inf"))[0] == robots[1:]
    with pytest.raises(InvalidValueError, match=r"^radius is nan"):
        robots[0].get_neighbors_in_radius(float("nan"))


def test_obstacles_and_fires_are_found_and_do_not_move():
    model = empty()
    wall, fire = model.add_obstacle(rectangle((100, 100), (140, 120))), model.add_fire((200, 200), radius=20)
    assert model.space.get_k_nearest_agents((120, 110), 1)[0] == [wall]
    assert model.space.get_k_nearest_agents((200, 199), 1)[0] == [fire]
    for agent in (wall, fire):
        with pytest.raises(InvalidValueError, match="do not move; remove this one and add another"):
            agent.position = (1, 1)


def test_mesa_knows_all_agents_by_their_kind():
    model = SwarmModel(map="openspace_fire", rng=1)
    model.add_robots(AGENT9, 4)
    kinds = {kind: list(agents) for kind, agents in model.agents_by_type.items()}
    assert kinds == {Robot: list(model.robots), Obstacle: list(model.obstacles), Fire: list(model.fires)}
    assert len(model.agents) == len(model.space.agents) == 4 + len(model.obstacles) + 7
    ids = [agent.unique_id for agent in model.agents]
    assert len(set(ids)) == len(ids)


def test_all_agents_may_be_removed_at_once_the_mesa_way():
    model = SwarmModel(map="openspace_fire", rng=1)
    robots = model.add_robots(AGENT9, 4)
    model.control = Subsumption(ahead)
    model.run(3)
    model.remove_all_agents()
    assert len(model.agents) == len(model.space.agents) == len(model.robots) == len(model.obstacles) == 0
    assert len(model.fires) == 0
    with pytest.raises(RemovedRobotError):
        _ = robots[0].position
    model.run(2)
    model.add_robots(AGENT9, 2)
    model.run(2)
    assert model.swarm.position.shape == (2, 2)


@pytest.mark.parametrize("kind", ["obstacle", "fire"])
def test_what_was_removed_cannot_be_removed_again(kind):
    model = empty()
    agent = model.add_obstacle(disc((50, 50), 5)) if kind == "obstacle" else model.add_fire((50, 50), radius=5)
    agent.remove()
    with pytest.raises(RemovedRobotError, match=f"this {kind} has been removed"):
        agent.remove()


def test_a_removed_obstacle_is_neither_met_nor_seen():
    model = empty()
    wall = model.add_obstacle(rectangle((120, 0), (140, 300)))
    robot = model.add_robots(AGENT9, poses=[(110, 150, 0.0)])[0]
    model.control = Subsumption(ahead)
    model.run(20)
    assert robot.position[0] < 116
    wall.remove()
    model.run(100)
    assert robot.position[0] == pytest.approx(215, abs=1e-6)
    assert model.swarm.kind[0, 0] == -1


@pytest.mark.slow
def test_a_model_without_references_is_forgotten():
    model = SwarmModel(map="openspace_fire", rng=1)
    model.add_robots(AGENT9, 4)
    model.control = Subsumption(ahead)
    model.run(3)
    watch = weakref.ref(model)
    del model
    gc.collect()
    assert watch() is None


@pytest.mark.slow
def test_a_mesa_model_that_was_there_before_the_package_was_imported_keeps_counting():
    program = """if True:
        import mesa
        model = mesa.Model(rng=1)
        first = mesa.Agent(model).unique_id
        import mesa_swarm.world.arena
        print(first, mesa.Agent(model).unique_id, mesa.Agent(mesa.Model(rng=1)).unique_id)
    """
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert result.stdout.split() == ["1", "2", "1"]


class OneByOne(SwarmModel):
    """A model with its own way to register agents, which therefore come one by one."""

    def register_agent(self, agent):
        super().register_agent(agent)


def registers(model):
    """Return all that Mesa knows of a model's agents, as numbers."""
    ids = lambda agents: [agent.unique_id for agent in agents]  # noqa: E731
    return (
        [ids(model.agents), ids(model.space.active_agents), ids(model.robots), ids(model.space.agents)],
        {kind.__name__: ids(agents) for kind, agents in model.agents_by_type.items()},
        [kind.__name__ for kind in model.agent_types],
        [(agent._mesa_index, model.space._agent_to_index[agent], agent in model.agents) for agent in model.agents],
        [(robot.row, robot.unique_id, robot.model is model, robot.swarm is model.swarm) for robot in model.robots],
        [tuple(map(float, agent.position)) for agent in model.agents],
    )


@pytest.mark.slow
@given(st.lists(st.tuples(st.sampled_from("abod"), st.integers(1, 9)), max_size=6))
@settings(max_examples=30)
def test_robots_made_together_are_in_the_same_registers_as_robots_made_one_by_one(acts):
    models = SwarmModel(rng=1), OneByOne(rng=1)
    for model in models:
        for act, number in acts:
            robots = model.swarm.agents
            if act in "ab":
                model.add_robots(AGENT3, number, group=act)
            elif act == "o":
                model.add_obstacle(disc((30 * number, 20), 4))
            else:
                model.remove_robots(robots[::number])
        ContinuousSpaceAgent(model.space, model)  # is given the next numbers
    assert registers(models[0]) == registers(models[1])
    assert models[0].state_hash() == models[1].state_hash()


needs_mesa_3_3 = pytest.mark.skipif(
    not hasattr(mesa.Model(rng=1), "_agents"), reason="from Mesa 3.5 on the sets of models hold their agents themselves"
)


def plain_agents(count=9):
    model = mesa.Model(rng=1)
    return [mesa.Agent(model) for _ in range(count)]


@needs_mesa_3_3
@pytest.mark.parametrize(
    "question",
    [
        list,
        len,
        lambda agents: agents[3],
        lambda agents: agents[2:5],
        lambda agents: list(agents.select(lambda agent: agent.unique_id % 2)),
        lambda agents: list(agents.select(at_most=4, inplace=True)) + list(agents),
        lambda agents: list(agents.shuffle()) + list(agents),
        lambda agents: list(agents.shuffle(inplace=True)) + list(agents),
        lambda agents: list(agents.sort("unique_id")) + list(agents),
        lambda agents: list(agents.sort("unique_id", inplace=True)) + list(agents),
        lambda agents: agents.get("unique_id"),
        lambda agents: agents.agg("unique_id", sum),
        lambda agents: agents.map(lambda agent: agent.unique_id),
        lambda agents: agents.groupby(lambda agent: agent.unique_id % 3).count(),
        lambda agents: list(agents & agents[:4]),
        lambda agents: [agents.do(agents.discard), len(agents)][1],
        lambda agents: [agents.remove(agents[0]), list(agents)][1],
        lambda agents: [made := [], agents.shuffle_do(made.append)][0],
        lambda agents: [agents[0] in agents, None in agents],
        lambda agents: [type(agents.select()).__name__, *agents.select()],
    ],
)
def test_a_set_that_holds_its_agents_answers_as_that_of_mesa(question):
    agents = plain_agents()
    ours, mesas = Registered(agents, random.Random(3)), mesa.agent.AgentSet(agents, random.Random(3))
    assert question(ours) == question(mesas)


@needs_mesa_3_3
def test_a_set_that_holds_its_agents_takes_the_random_generator_of_their_model():
    agents = plain_agents()
    assert Registered(agents).random is agents[0].model.random
    assert list(pickle.loads(pickle.dumps(Registered([], random.Random(1))))) == []


def test_many_robots_are_removed_at_once_and_the_others_keep_their_contacts():
    rng = np.random.default_rng(5)
    model = SwarmModel(rng=1)
    robots = model.add_robots(AGENT3, 300)
    columns = model.swarm.columns
    columns["contact_kind"][:] = rng.choice([-1, 0, 1], 300)
    columns["contact_index"][:] = rng.integers(-1, 300, 300)
    met = {
        robot.unique_id: robots[other].unique_id
        for robot, kind, other in zip(robots, columns["contact_kind"], columns["contact_index"], strict=True)
        if kind == 1 and other >= 0
    }
    gone = {robot.unique_id for robot in robots[::2]}
    model.remove_robots(robots[::2])
    for row, robot in enumerate(model.swarm.agents):
        if robot.unique_id in met:
            other, index = met[robot.unique_id], model.swarm.contact_index[row]
            assert index == (-1 if other in gone else model.swarm.agents[index].row)
            assert other in gone or model.swarm.agents[index].unique_id == other
    assert [robot.row for robot in robots] == [-1 if k % 2 == 0 else k // 2 for k in range(300)]


@pytest.mark.slow
@given(
    st.lists(st.tuples(st.sampled_from(["look", "add", "remove", "drop", "shuffle"]), st.integers(0, 9)), max_size=12)
)
@settings(max_examples=60)
def test_robots_that_were_asked_for_once_are_those_of_then_without_those_removed_that_nothing_refers_to(acts):
    model = SwarmModel(rng=1)
    model.add_robots(AGENT3, 5)
    pairs, held = [], []
    for act, number in acts:
        if act == "look":
            pairs.append((model.robots, mesa.agent.AgentSet(model.swarm.agents, random.Random(1))))
        elif act == "add":
            model.add_robots(AGENT3, number)
        elif act == "remove" and number < len(model.swarm):
            held += [model.robots[number]] * (number % 2)  # half of them are still referred to
            model.robots[number].remove()
        elif act == "shuffle" and pairs:
            model.random.seed(number)
            pairs[-1][0].shuffle(inplace=True)
            pairs[-1][1].random.seed(number)
            pairs[-1][1].shuffle(inplace=True)
        for robots, twin in pairs if act == "drop" else ():
            assert len(robots) == len(twin)
            assert robots[:] == list(twin)
            assert list(robots) == list(twin)
    for robots, twin in pairs:
        assert (len(robots), robots[:], list(robots)) == (len(twin), list(twin), list(twin))
        assert all(robot in robots for robot in twin)


def test_one_of_very_many_robots_is_found_at_once():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT3, poses=[(100, 100, 0.0)] * 3000)
    with work_within(0.5):
        assert [model.robots[row].row for row in range(3000)] == list(range(3000))
        assert sum(len(model.robots) for _ in range(3000)) == 3000**2


def test_a_copied_model_has_robots_of_its_own_to_look_at():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT3, 3)
    robots = model.robots
    twin = copy.deepcopy(model)
    assert twin.robots[1] is not robots[1]
    assert [robot.unique_id for robot in pickle.loads(pickle.dumps(robots))] == [5, 6, 7]
    assert len(pickle.loads(pickle.dumps(model)).robots) == 3
    with pytest.raises(AttributeError, match="'Agents' object has no attribute 'speed'"):
        robots.speed  # noqa: B018
