"""Mesa's habits with agents: removal, creation, and a user's own agents beside robots."""

import copy
import pickle
from functools import partial
from itertools import pairwise

import mesa
import numpy as np
import pandas as pd
import pytest
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm import AGENT9, SwarmModel, disc
from mesa_swarm.base.errors import InvalidValueError, RemovedRobotError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.fire.fires import Fire
from mesa_swarm.robots.robot import Robot
from mesa_swarm.world.bodies import Body, Load, Obstacle
from mesa_swarm.world.movers import Driven


def furnished():
    """Return a world with two of each kind of agent, and these by kind."""
    model = SwarmModel(rng=1)
    kinds = {
        "robot": model.add_robots(AGENT9, poses=[(40, 40, 0.0), (60, 100, 1.0)]),
        "fire": [model.add_fire((100 + 50 * k, 250), radius=5) for k in range(2)],
        "load": [model.add_load(disc((100 + 60 * k, 200), 10), resistance=1) for k in range(2)],
        "obstacle": [model.add_obstacle(disc((200 + 60 * k, 100), 10)) for k in range(2)],
        "driven": [model.add_body(disc((400 + 60 * k, 100), 10), kind="door") for k in range(2)],
    }
    model.control = Subsumption(Avoid(distance=15), Explore())
    return model, kinds


KINDS = ("robot", "fire", "load", "obstacle", "driven")


# ---- removal


@pytest.mark.parametrize("kind", KINDS)
def test_deregistering_an_agent_is_as_removing_it(kind):
    ends = []
    for way in ("remove", "deregister_agent"):
        model, kinds = furnished()
        model.run(3)
        agent = kinds[kind][0]
        agent.remove() if way == "remove" else model.deregister_agent(agent)
        assert agent not in model.agents
        assert agent not in model.agents_by_type[type(agent)]
        assert agent not in model.space.active_agents
        assert agent.space is None
        assert kinds[kind][1] in model.agents
        ends.append((len(model.agents), len(model.space.active_agents), model.run(5).state_hash()))
    assert ends[0] == ends[1]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("first", ["remove", "deregister_agent"])
@pytest.mark.parametrize("second", ["remove", "deregister_agent"])
def test_what_was_removed_cannot_be_removed_again(kind, first, second):
    model, kinds = furnished()
    agent = kinds[kind][0]
    ways = {"remove": agent.remove, "deregister_agent": lambda: model.deregister_agent(agent)}
    ways[first]()
    before = model.state_hash()
    with pytest.raises(RemovedRobotError) as error:
        ways[second]()
    assert "\n" not in str(error.value)
    assert model.state_hash() == before


def test_the_handle_of_a_deregistered_robot_raises():
    model, kinds = furnished()
    robot = kinds["robot"][0]
    model.deregister_agent(robot)
    with pytest.raises(RemovedRobotError, match="was removed"):
        robot.position  # noqa: B018
    assert len(model.swarm) == len(model.robots) == 1


def test_an_agent_of_another_model_is_not_deregistered():
    (model, _), (_, others) = furnished(), furnished()
    with pytest.raises(InvalidValueError, match="of another model"):
        model.deregister_agent(others["robot"][0])
    assert len(model.robots) == 2


def test_subclasses_notice_each_removal_once_however_it_was_made():
    class Noting(SwarmModel):
        def deregister_agent(self, agent):
            super().deregister_agent(agent)
            gone.append(agent.unique_id)

    gone, model = [], Noting(rng=1)
    first, second, third = model.add_robots(AGENT9, 3)
    first.remove()
    model.remove_robots([second])
    assert gone == [first.unique_id, second.unique_id]
    model.deregister_agent(third)
    assert set(gone) == {first.unique_id, second.unique_id, third.unique_id}


# ---- creation


@pytest.mark.parametrize("kind", [Robot, Fire, Load, Obstacle, Driven, Body])
@pytest.mark.parametrize("method", ["create_agents", "from_dataframe"])
def test_agents_of_this_package_are_made_by_their_model_and_mesas_ways_name_the_method(kind, method):
    model = SwarmModel(rng=1)
    before = len(model.agents)
    given = 3 if method == "create_agents" else pd.DataFrame({"x": [1, 2, 3]})
    with pytest.raises(InvalidValueError, match=r"use model\.add_") as error:
        getattr(kind, method)(model, given)
    assert str(error.value).startswith(f"{kind.__name__}.{method} is not available")
    assert len(str(error.value)) <= 300
    assert len(model.agents) == before


@pytest.mark.parametrize("make", [partial(Robot.create_agents, n=10), Robot, partial(Robot, x=1, y=2)])
def test_what_the_message_about_robots_names_works(make):
    model = SwarmModel(rng=1)
    with pytest.raises(InvalidValueError) as error:
        make(model)
    call = str(error.value).partition("use ")[2].partition(" or ")[0]
    assert len(eval(call, {"model": model, "AGENT9": AGENT9})) == 10


# ---- a user's own agents


class Clock(mesa.Agent):
    """An agent without a position."""

    def __init__(self, model):
        super().__init__(model)
        self.time = 0

    def step(self):
        self.time += 1


class Sheep(ContinuousSpaceAgent):
    """An agent in the space of the robots."""

    def __init__(self, space, model, position):
        super().__init__(space, model)
        self.position = position
        self.eaten = 0

    def step(self):
        self.position += np.array([1.0, 0.0])
        self.eaten += 1


class Meadow(SwarmModel):
    """Robots, a clock and sheep, each with a step of its own."""

    def __init__(self, *, n_sheep: int = 3, rng=None):
        super().__init__(rng=rng)
        self.clock = Clock(self)
        self.add_robots(AGENT9, 3)
        self.sheep = [Sheep(self.space, self, (100.0 + 50.0 * k, 300.0)) for k in range(n_sheep)]
        self.control = Subsumption(Avoid(distance=15), Explore())

    def step(self):
        for kind in (Clock, Sheep):
            if kind in self.agents_by_type:
                self.agents_by_type[kind].do("step")
        super().step()


def test_own_agents_take_their_steps_beside_the_robots_and_do_not_disturb_them():
    model = Meadow(rng=1).run(20)
    assert (model.clock.time, [one.eaten for one in model.sheep]) == (20, [20] * 3)
    assert [one.position.tolist() for one in model.sheep] == [[120.0 + 50.0 * k, 300.0] for k in range(3)]
    assert model.state_hash() == Meadow(n_sheep=0, rng=1).run(20).state_hash()


def test_own_agents_are_found_in_the_space_and_gone_when_they_were_removed():
    model = Meadow(rng=1)
    first, second, third = model.sheep
    assert set(model.space.get_agents_in_radius((100, 300), 60)[0]) >= {first, second}
    assert third not in model.space.get_agents_in_radius((100, 300), 60)[0]
    (robot,) = model.add_robots(AGENT9, poses=[(100, 310, 0.0)])
    assert set(first.get_neighbors_in_radius(11)[0]) == {robot}
    first.remove()
    model.clock.remove()
    assert {first, model.clock}.isdisjoint(model.agents)
    assert first not in model.space.get_agents_in_radius((100, 300), 60)[0]
    model.run(5)
    assert (first.eaten, second.eaten, model.clock.time) == (0, 5, 0)
    model.deregister_agent(second)
    assert second not in model.agents


def test_own_agents_stay_where_they_are_while_the_space_grows_and_shrinks():
    model = Meadow(rng=1)
    places = {one: one.position.tolist() for one in model.sheep}
    late = []
    for n in (1, 40, 200):
        model.add_robots(AGENT9, n)
        late.append(Sheep(model.space, model, (10.0 * n**0.5, 20.0)))
        places[late[-1]] = late[-1].position.tolist()
        assert {one: one.position.tolist() for one in places} == places
    model.remove_robots([model.robots[k] for k in range(0, 200, 2)])
    assert {one: one.position.tolist() for one in places} == places
    assert [agent._mesa_index for agent in model.space.active_agents] == list(range(len(model.space.active_agents)))
    everyone = model.space.agent_positions
    assert all(
        (everyone[agent._mesa_index] == agent.position).all() for agent in model.agents if hasattr(agent, "space")
    )


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_copies_have_own_agents_that_go_on(duplicate):
    model = Meadow(rng=1).run(5)
    twin = duplicate(model)
    model.sheep[0].position = (10.0, 10.0)
    twin.run(5)
    assert [one.eaten for one in twin.sheep] == [10] * 3
    assert twin.sheep[0].position.tolist() == [110.0, 300.0]
    assert twin.sheep[0].model is twin.sheep[0].space.active_agents[0].model is twin
    assert twin.state_hash() == Meadow(rng=1).run(10).state_hash()


def test_a_body_follows_an_own_agent_and_goes_with_it():
    model = Meadow(rng=1)
    body = model.add_body(disc(model.sheep[0].position, 4), kind="sheep", agent=model.sheep[0])
    model.run(3)
    assert body.position.tolist() == model.sheep[0].position.tolist()
    model.sheep[0].remove()
    model.run(1)
    assert body not in model.agents


def test_a_recording_with_own_agents_is_resumed_with_them(tmp_path):
    with (model := Meadow(rng=1)).record(tmp_path / "run.arrow", checkpoint_every=5):
        model.run(20)
    again = Meadow.resume(tmp_path / "run.arrow", step=10)
    assert [one.eaten for one in again.sheep] == [10] * 3
    again.run(10)
    assert again.state_hash() == model.state_hash()
    assert [one.position.tolist() for one in again.sheep] == [one.position.tolist() for one in model.sheep]


def test_ids_of_robots_and_own_agents_ascend_in_the_order_in_which_they_came():
    model = Meadow(rng=1)
    model.add_robots(AGENT9, 5)
    Clock(model)
    model.add_robots(AGENT9, 1)
    ids = [agent.unique_id for agent in model.agents]
    assert all(later == before + 1 for before, later in pairwise(ids))
    assert np.diff(model.swarm.unique_ids).min() > 0
