"""Shepherding: sheep are ordinary Mesa agents that flee, and a robot that sees them brings them to a target."""

import mesa
import numpy as np
import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.models.shepherding import APART, NEAR, STRIDE, TARGET, Sheep, Shepherding


def test_the_sheep_are_agents_of_mesa_and_robots_see_their_bodies():
    model = Shepherding(n_sheep=6, rng=1)
    flock = model.agents_by_type[Sheep]
    assert len(flock) == 6
    assert type(next(iter(flock))).__mro__[1] is mesa.Agent
    (robot,) = model.robots
    x, y = next(iter(flock)).position
    robot.position = x + 8.0, y
    model.sense()
    assert "sheep" in {model.kinds[kind] for kind in robot.kind if kind >= 0}


def test_a_flock_that_is_brought_home_is_near_the_target_and_close_together():
    model = Shepherding(n_sheep=12, rng=1).run(2000)
    places = model.movers.position
    centre = places.mean(axis=0)
    assert not model.running
    assert model.results() == {"brought home at": model.steps}
    assert np.hypot(*(centre - (TARGET.real, TARGET.imag))) < NEAR
    assert np.hypot(*(places - centre).T).max() < APART * 12 ** (2 / 3)


@pytest.mark.slow
def test_the_stored_runs_come_out_again():
    homes = [Shepherding(n_sheep=12, rng=rng).run(2000).home_at for rng in (1, 2)]
    assert homes == [457, 394]


def test_no_sheep_goes_farther_than_a_stride_a_step():
    model = Shepherding(n_sheep=20, rng=3)
    for _ in range(40):
        before = model.movers.position.copy()
        model.step()
        assert np.hypot(*(model.movers.position - before).T).max() <= STRIDE + 1e-9


def test_bodies_follow_their_agents_in_the_next_step_unless_a_robot_could_not_give_way():
    model = Shepherding(n_sheep=20, rng=4).run(30)
    at = np.array([sheep.position for sheep in model.agents_by_type[Sheep]])
    model.step()
    free = ~model.movers.blocked
    assert at[free] == pytest.approx(model.movers.position[free])


def test_sheep_that_no_robot_frightens_stay_apart_and_mostly_stand():
    model = Shepherding(n_sheep=10, rng=5)
    model.remove_robots(model.robots)
    before = model.movers.position.copy()
    model.run(20)
    assert np.hypot(*(model.movers.position - before).T).mean() < 5 * STRIDE


def test_fewer_than_two_sheep_are_refused():
    with pytest.raises(SwarmError, match="n_sheep"):
        Shepherding(n_sheep=1, rng=1)
