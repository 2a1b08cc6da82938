"""Foraging: food is carried to a nest that robots use the energy of, and the account balances."""

import numpy as np
import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.models.foraging import FULL, GAIN, INSIDE, NEST, NEST_RADIUS, OUTSIDE, Foraging


@pytest.mark.slow
def test_the_stored_runs_come_out_again():
    runs = [Foraging(n_robots=6, thresholds=word, rng=1).run(600).results()["items"] for word in ("no", "yes")]
    assert runs == [9, 7]


@pytest.mark.slow
def test_every_item_that_is_brought_is_an_event_and_is_replaced():
    model = Foraging(n_robots=8, thresholds="no", rng=2).run(600)
    assert model.state["items"] > 0
    assert len(model.events) == model.state["items"]
    assert set(model.events.value) == {GAIN}
    assert len(model.movers) == 20


def test_energy_is_what_there_was_and_was_brought_less_what_was_used():
    model = Foraging(n_robots=4, thresholds="no", rng=3).run(300)
    used = model.state["spent"]
    assert 300 * 4 * INSIDE <= used <= 300 * 4 * OUTSIDE
    assert model.energy == pytest.approx(FULL / 2 + GAIN * model.state["items"] - used)


def test_robots_in_the_nest_rest_while_the_store_is_above_their_thresholds():
    model = Foraging(n_robots=4, rng=4)
    model.state["thresholds"] = np.zeros(4)
    model.remove_robots(list(model.robots)[1:])
    model.state["thresholds"] = np.zeros(1)
    (robot,) = model.robots
    robot.position = NEST
    model.run(100)
    assert tuple(robot.position) == NEST
    model.state["thresholds"] = np.full(1, 2 * FULL)
    model.run(100)
    assert np.hypot(*(robot.position - NEST)) > 40


def test_new_food_never_lies_in_the_nest():
    model = Foraging(n_robots=8, thresholds="no", items=40, rng=5).run(200)
    free = model.movers.position[~model.movers.carried]
    assert (np.hypot(*(free - NEST).T) > NEST_RADIUS).all()


def test_an_unknown_word_for_thresholds_is_refused():
    with pytest.raises(SwarmError, match="thresholds"):
        Foraging(thresholds="maybe", rng=1)
