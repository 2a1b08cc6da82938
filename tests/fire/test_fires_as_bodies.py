"""Fires are bodies, and that they burn is a process: as anyone could build them."""

import copy

import numpy as np
import pytest

from mesa_swarm import SwarmModel, disc, rectangle
from mesa_swarm.base.errors import InvalidValueError, RemovedRobotError
from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.fire import Burning
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.state_hash import written_state_hash
from mesa_swarm.recording.checkpoint import OF_BURNING, checkpoint_of, in_parts, restore
from mesa_swarm.world.bodies import Body
from support.scenes import blind, empty


def test_fires_are_among_the_bodies_in_the_order_in_which_they_came():
    model = empty()
    first = model.add_obstacle(disc((20, 20), 5))
    fire = model.add_fire((60, 20), radius=8)
    door = model.add_body(rectangle((80, 10), (90, 30)), kind="door")
    assert list(model.bodies) == [first, fire, door]
    assert [body.kind for body in model.bodies] == ["obstacle", "fire", "door"]
    assert isinstance(fire, Body)
    assert (fire.mode, fire.contact, fire.blocked) == ("fixed", True, False)
    assert fire.shape == disc((60, 20), 8)
    assert list(model.obstacles) == [first]


def test_a_removed_fire_is_no_body_any_more_and_has_no_shape():
    model = empty()
    fire = model.add_fire((60, 20), radius=8)
    fire.remove()
    assert len(model.bodies) == 0
    with pytest.raises(RemovedRobotError, match="this fire has been removed"):
        _ = fire.shape


def test_a_fire_is_neither_driven_nor_carried():
    model = empty()
    fire = model.add_fire((60, 20), radius=8)
    (robot,) = model.add_robots(blind(), poses=[(20, 20, 0.0)])
    with pytest.raises(InvalidValueError, match="driven bodies"):
        model.move_bodies([fire], [(30, 30, 0.0)])
    with pytest.raises(InvalidValueError, match="driven body"):
        model.attach(robot, fire)


def test_the_kind_of_fires_is_made_with_add_fire_only():
    with pytest.raises(InvalidValueError, match="robots and fires: see add_robots, add_fire"):
        empty().add_body(disc((20, 20), 5), kind="fire")


def test_a_model_has_burning_as_its_first_process_from_its_first_fire_on():
    model = empty()
    assert model.processes == ()
    own = model.add_process(Cooling())
    model.add_fire((60, 20), radius=8)
    model.add_fire((20, 60), radius=8)
    assert [type(process) for process in model.processes] == [Burning, Cooling]
    assert model.processes[1] is own


class Cooling:
    """Another way to burn: all fires lose a tenth of their temperature in each step."""

    def step(self, model):
        for fire in model.fires:
            fire.temperature *= 0.9


def test_fires_burn_as_another_process_lets_them_if_burning_is_removed():
    model = empty()
    fire = model.add_fire((60, 20), radius=8, temperature=0.5)
    model.remove_process(model.processes[0])
    assert model.run(10).fires.temperature.tolist() == [0.5]
    model.add_process(Cooling())
    model.run(2)
    assert fire.temperature == pytest.approx(0.5 * 0.9**2)
    model.add_fire((20, 60), radius=8)
    assert [type(process) for process in model.processes] == [Cooling]


def test_robots_cool_after_the_last_fire_was_removed():
    model = empty()
    (robot,) = model.add_robots(blind(), poses=[(200, 150, 0.0)])
    fire = model.add_fire((150, 150), radius=40)
    model.run(2)
    fire.remove()
    warm = robot.temperature
    model.run(1)
    assert 0 < robot.temperature < warm


def test_burning_is_not_part_of_the_state_and_a_copy_has_its_own_fires():
    model = find_model("fire_fighting")(rng=1).run(5)
    other = copy.deepcopy(model)
    del other.parts.processes.numbered[0]
    assert written_state_hash(other) == written_state_hash(model)
    assert other.state_hash() != model.state_hash()
    assert copy.deepcopy(model).run(50).state_hash() == model.run(50).state_hash() != other.run(50).state_hash()


def test_a_recording_goes_on_without_burning_where_it_was_removed(tmp_path):
    model = find_model("fire_fighting")(rng=1)
    with model.record(tmp_path / "a.swarm"):
        model.run(5)
        model.remove_process(model.processes[0])
        model.run(5)
    again = type(model).resume(tmp_path / "a.swarm")
    assert again.processes == ()
    assert again.run(5).state_hash() == model.run(5).state_hash()


@pytest.mark.parametrize("removed", [False, True])
def test_a_fire_that_was_added_by_hand_burns_on_when_its_run_is_resumed(tmp_path, removed):
    model = SwarmModel(rng=1)
    fire = model.add_fire((400, 300), radius=20, temperature=0.5)
    model.add_robots(blind(), poses=[(425, 300, 0.0)])
    model.run(3)
    if removed:
        fire.remove()
    again = restore(SwarmModel(rng=1), checkpoint_of(model))
    assert len(again.processes) == 1
    assert again.run(9).state_hash() == model.run(9).state_hash()


def test_an_older_checkpoint_in_which_burning_is_an_attribute_is_restored():
    facts = {
        **{"attributes": {"_burns": {"plain": True}, "own": {"plain": 5}}, "columns": {}, "history": [1, [0], 1]},
        **{"randomness": {"noise": None}, "radio": None, "control": None, "control_state": [], "constants": None},
    }
    assert in_parts(facts)["processes"] == [[0, OF_BURNING]]
    assert in_parts(facts)["attributes"] == {"own": {"plain": 5}}


def test_contacts_name_the_fire_that_a_robot_bumps_into():
    model = empty()
    fire = model.add_fire((60, 20), radius=8)
    (robot,) = model.add_robots(blind(), poses=[(30, 20, 0.0)])
    model.control = Subsumption(Explore())
    while not robot.collided:
        model.step()
    contacts = model.contacts
    assert contacts.kind.tolist() == [model.kind_code("fire")]
    assert contacts.other.tolist() == [fire.unique_id]
    assert np.allclose(contacts.normal, [(-1.0, 0.0)])
