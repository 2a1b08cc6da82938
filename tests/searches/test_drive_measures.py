"""Measures of a drive are those of its steps taken one by one, and its steps are taken in compiled calls."""

import numpy as np

from mesa_swarm import AGENT9, SwarmModel, until
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.learning.fitness import SUMS
from mesa_swarm.searches.drive_measures import drive_measured, driven_world, tallied
from support.recorded_twice import steps_driven


def world(robots=6):
    return driven_world(Subsumption(Avoid(), Explore(turn_interval=9)), AGENT9, robots, "original", 4)


def test_a_tally_of_compiled_calls_is_that_of_single_steps():
    with steps_driven() as numbers:
        together = tallied(world(), 40)
    one_by_one, model = tallied(world(), 40, each=lambda step: None), world()
    assert sum(numbers) == 40
    assert together.steps == one_by_one.steps == 40
    assert together.means() == one_by_one.means()
    assert (together.sums == one_by_one.sums).all()
    assert not model.observers
    columns, expected = model.swarm.columns, np.zeros((6, len(SUMS)))
    for _ in range(40):
        model.step()
        shares = columns["command"] / columns["max_speed"][:, None]
        expected[:, 1:] += np.column_stack([shares.mean(axis=1), columns["collided"]])
    assert np.allclose(together.sums[:, 1:], expected[:, 1:])


def test_places_after_each_step_are_stored_and_the_observer_is_gone_afterwards():
    model, places = world(), np.empty((30, 6, 2))
    tallied(model, 30, positions=places)
    assert not model.observers
    other = world()
    assert all((other.run(1).swarm.position == row).all() for row in places)
    assert (model.swarm.position == places[-1]).all()


def test_a_drive_may_go_on_after_one_that_was_measured():
    model = world()
    first, second = drive_measured(model, 25), drive_measured(model, 25)
    assert model.steps == 50
    assert first != second
    assert drive_measured(world(), 25) == first


def test_a_drive_has_all_its_steps_also_after_a_condition_has_ended_a_run():
    class Short(SwarmModel):
        stops = until("steps", at_least=12)

    model = Short(map="original", rng=4, history_every=0, collect_every=0)
    model.add_robots(AGENT9, 6)
    model.control = Subsumption(Avoid(), Explore(turn_interval=9))
    places = np.empty((30, 6, 2))
    measured = tallied(model, 30, positions=places)
    assert measured.steps == model.steps == 30
    assert measured.means() == tallied(world(), 30).means()
    assert (places[-1] == model.swarm.position).all()
