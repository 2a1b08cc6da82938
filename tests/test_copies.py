"""Copies of a model go on as the model does."""

import copy
import pickle

import pytest

from mesa_swarm.control import Subsumption
from mesa_swarm.models.fire_fighting import FireFighting
from scenes import ahead, blind, empty


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
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
