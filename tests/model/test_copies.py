"""Copies of a model go on as the model does."""

import copy
import pickle

import mesa
import pytest

from mesa_swarm import disc
from mesa_swarm.base.errors import RemovedRobotError, SwarmError
from mesa_swarm.control import Subsumption
from mesa_swarm.model.gallery import find_model, gallery_names
from mesa_swarm.models.fire_fighting import FireFighting
from support.scenes import ahead, blind, empty

DUPLICATES = [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))]


@pytest.mark.parametrize("duplicate", DUPLICATES)
def test_a_copied_model_goes_on_as_the_model_does_and_is_read_as_it_is(duplicate):
    model = FireFighting(n_robots=4, rng=1).run(5)
    twin = duplicate(model)
    model.run(300)
    twin.run(300)
    assert twin.state_hash() == model.state_hash()
    assert (twin.swarm.position == model.swarm.position).all()
    assert (twin.fires.temperature == model.fires.temperature).all()
    assert not twin.swarm.position.flags.writeable
    assert not twin.fires.temperature.flags.writeable


def test_fires_may_be_removed_while_one_goes_through_them():
    model = FireFighting(n_robots=1, rng=1)
    for fire in model.fires:
        fire.remove()
    assert len(model.fires) == 0


def test_robots_whose_control_is_taken_away_stop():
    model = empty()
    model.add_robots(blind(), poses=[(100, 100, 0.0)])
    model.control = Subsumption(ahead)
    model.run(3)
    model.control = None
    model.run(3)
    assert model.swarm.position[0].tolist() == [103.0, 100.0]
    assert model.swarm.layer.tolist() == [-1]


def things(model):
    """Return two of each kind of what can be added and removed, of which the second stays."""
    return {
        "robot": model.add_robots(blind(), poses=[(40, 40, 0.0), (60, 100, 1.0)]),
        "fire": [model.add_fire((100 + 50 * k, 250), radius=5) for k in range(2)],
        "load": [model.add_load(disc((100 + 60 * k, 200), 10), resistance=1) for k in range(2)],
        "obstacle": [model.add_obstacle(disc((200 + 60 * k, 100), 10)) for k in range(2)],
    }


@pytest.mark.parametrize("kind", ["robot", "fire", "load", "obstacle"])
def test_a_copy_of_a_handle_is_the_handle_and_so_stays_with_its_own(kind):
    model = empty()
    first, second = things(model)[kind]
    twin, place = copy.copy(second), second.position.tolist()
    first.remove()
    assert twin is second
    assert twin.position.tolist() == place
    second.remove()
    if kind in ("robot", "fire"):
        with pytest.raises(RemovedRobotError if kind == "robot" else SwarmError):
            twin.position  # noqa: B018


def test_a_deep_copy_of_a_model_has_things_of_its_own():
    model = empty()
    things(model)
    model.control = Subsumption(ahead)
    twin = copy.deepcopy(model)
    assert twin.state_hash() == model.state_hash()
    both = [[*world.robots, *world.fires, *world.loads] for world in (model, twin)]
    for mine, theirs in zip(*both, strict=True):
        assert mine is not theirs
        assert (mine.position == theirs.position).all()
    twin.robots[0].remove()
    assert len(model.swarm) == 2
    assert model.run(5).swarm.position[0].tolist() == [45.0, 40.0]


@pytest.mark.slow
@pytest.mark.parametrize("duplicate", DUPLICATES)
@pytest.mark.parametrize("name", gallery_names())
def test_a_copy_of_each_model_numbers_new_agents_as_the_model_does(name, duplicate):
    model = find_model(name)(rng=1)
    model.robots[0].remove()
    twin = duplicate(model)
    new = [[*world.add_robots(model.swarm.designs[0], 2), mesa.Agent(world)] for world in (model, twin)]
    assert [agent.unique_id for agent in new[0]] == [agent.unique_id for agent in new[1]]
    assert len({agent.unique_id for agent in twin.agents}) == len(twin.agents)


@pytest.mark.parametrize("duplicate", DUPLICATES)
def test_a_copy_of_a_mesa_model_of_another_kind_goes_on_counting_too(duplicate):
    model = mesa.Model(rng=1)
    mesa.Agent(model), mesa.Agent(model).remove()
    assert mesa.Agent(duplicate(model)).unique_id == mesa.Agent(model).unique_id == 3


@pytest.mark.skipif(hasattr(mesa.Model(), "agent_id_counter"), reason="this Mesa itself counts so")
def test_a_model_without_a_count_as_older_versions_have_pickled_it_counts_on_from_its_agents():
    model = FireFighting(n_robots=3, rng=1)
    highest = max(agent.unique_id for agent in model.agents)
    model.__dict__.pop("agent_id_counter")
    assert mesa.Agent(model).unique_id == highest + 1


@pytest.mark.slow
def test_sparks_in_a_copy_light_fires_with_the_unique_ids_that_they_have_in_the_model(tmp_path):
    model = FireFighting(n_robots=4, spread=0.005, rng=1).run(5)
    twin = copy.deepcopy(model)
    with twin.record(tmp_path / "run.arrow"):
        twin.run(200)
    model.run(200)
    assert len(model.fires) > 7
    assert [fire.unique_id for fire in twin.fires] == [fire.unique_id for fire in model.fires]
    assert twin.state_hash() == model.state_hash()
    assert FireFighting.resume(tmp_path / "run.arrow", step=205).state_hash() == model.state_hash()
