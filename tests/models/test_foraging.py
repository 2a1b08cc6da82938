"""Foraging: food is carried to a nest that robots use the energy of, and the account balances."""

import numpy as np
import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.models.foraging import FULL, GAIN, INSIDE, NEST, NEST_RADIUS, OUTSIDE, Foraging


@pytest.mark.slow
def test_the_stored_runs_come_out_again():
    runs = [Foraging(n_robots=6, thresholds=word, rng=1).run(600).results()["items"] for word in ("no", "yes")]
    assert runs == [10, 6]


@pytest.mark.slow
def test_every_item_that_is_brought_is_an_event_and_is_replaced():
    model = Foraging(n_robots=8, thresholds="no", rng=2).run(600)
    assert model.nest.items > 0
    assert len(model.events) == model.nest.items
    assert set(model.events.value) == {GAIN}
    assert len(model.movers) == 20


def test_energy_is_what_there_was_and_was_brought_less_what_was_used():
    model = Foraging(n_robots=4, thresholds="no", rng=3).run(300)
    used = model.nest.spent
    assert 300 * 4 * INSIDE <= used <= 300 * 4 * OUTSIDE
    assert model.energy == pytest.approx(FULL / 2 + GAIN * model.nest.items - used)


def test_robots_in_the_nest_rest_while_the_store_is_above_their_thresholds():
    model = Foraging(n_robots=4, rng=4)
    model.nest.thresholds = 0.0
    model.remove_robots(list(model.robots)[1:])
    (robot,) = model.robots
    robot.position = NEST
    model.run(100)
    assert tuple(robot.position) == NEST
    model.nest.thresholds = 2 * FULL
    model.run(100)
    assert np.hypot(*(robot.position - NEST)) > 40


def test_new_food_never_lies_in_the_nest():
    model = Foraging(n_robots=8, thresholds="no", items=40, rng=5).run(200)
    free = model.movers.position[~model.movers.carried]
    assert (np.hypot(*(free - NEST).T) > NEST_RADIUS).all()


def test_an_unknown_word_for_thresholds_is_refused():
    with pytest.raises(SwarmError, match="thresholds"):
        Foraging(thresholds="maybe", rng=1)


def test_all_of_a_step_is_compiled_and_many_steps_are_one_call():
    model = Foraging(n_robots=3, rng=1).run(1)
    assert "Python" not in str(model.plan)
    assert "driven: up to 1000 steps" in str(model.plan)


def test_steps_taken_one_by_one_and_by_run_are_the_same():
    driven, stepped = (
        Foraging(n_robots=8, thresholds="no", rng=2).run(700),
        Foraging(n_robots=8, thresholds="no", rng=2),
    )
    for _ in range(700):
        stepped.step()
    assert driven.nest.items > 0
    assert driven.state_hash() == stepped.state_hash()
    assert driven.events.rows() == stepped.events.rows()
