"""Shepherding: sheep are bodies that flee, and a robot that sees them brings them to a target."""

import numpy as np
import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.models.shepherding import APART, NEAR, STRIDE, TARGET, Shepherding


def test_the_sheep_are_bodies_that_robots_see_and_a_process_sends():
    model = Shepherding(n_sheep=6, rng=1)
    flock = model.movers.agents
    assert [body.kind for body in flock] == ["sheep"] * 6
    (robot,) = model.robots
    x, y = flock[0].position
    robot.position = x + 8.0, y
    model.sense()
    assert "sheep" in {model.kinds[kind] for kind in robot.kind if kind >= 0}
    assert "driven: up to 1000 steps" in str(model.run(1).plan)


def test_the_camera_sees_centre_farthest_and_target_in_the_frame_of_the_robot():
    model = Shepherding(n_sheep=7, rng=2)
    (robot,) = model.robots
    robot.position, robot.heading = (300.0, 400.0), 0.7
    model.sense()
    places = model.movers.position
    centre = places.mean(axis=0)
    far = places[np.hypot(*(places - centre).T).argmax()]
    offsets = (np.array([centre, far, TARGET]) - robot.position) @ (1, 1j) * np.exp(-0.7j)
    assert robot.flock == pytest.approx(np.column_stack([offsets.real, offsets.imag]).ravel())
    assert model.away == pytest.approx(np.hypot(*(centre - TARGET)))


def test_a_flock_that_is_brought_home_is_near_the_target_and_close_together():
    model = Shepherding(n_sheep=12, rng=1).run(2000)
    places = model.movers.position
    centre = places.mean(axis=0)
    assert not model.running
    assert model.results() == {"brought home at": model.steps}
    assert np.hypot(*(centre - TARGET)) < NEAR
    assert np.hypot(*(places - centre).T).max() < APART * 12 ** (2 / 3)


@pytest.mark.slow
def test_the_stored_runs_come_out_again():
    homes = [Shepherding(n_sheep=12, rng=rng).run(2000).home_at for rng in (1, 2)]
    assert homes == [447, 396]


def test_no_sheep_goes_farther_than_a_stride_a_step():
    model = Shepherding(n_sheep=20, rng=3)
    for _ in range(40):
        before = model.movers.position.copy()
        model.step()
        assert np.hypot(*(model.movers.position - before).T).max() <= STRIDE + 1e-9


def test_a_frightened_sheep_walks_along_the_sum_of_the_paper():
    model = Shepherding(n_sheep=5, neighbours=3, rng=4).run(1)
    (walking,) = model.processes
    x, y = model.movers.position.mean(axis=0)
    model.robots[0].position = x + 60.0, y
    ahead = walking.ahead_x + 1j * walking.ahead_y
    model.run(1)
    now, dog = model.movers.position @ (1, 1j), complex(*model.robots[0].position)
    for i, stride in enumerate(model.movers.aim @ (1, 1j) - now):
        gaps = now[i] - now
        near = np.argsort(abs(gaps), kind="stable")[1:4]
        crowd = unit(sum(unit(gap) for gap in gaps if abs(gap) < APART))
        total = 1.05 * unit(now[near].mean() - now[i]) + 2.0 * crowd + unit(now[i] - dog) + 0.5 * ahead[i]
        along = total * np.conj(unit(stride))
        # What is missing is noise: a vector of length 0.3.
        assert along.real > 0
        assert abs(along.imag) <= 0.3 + 1e-9
        assert abs(stride) == pytest.approx(STRIDE)


def unit(vector):
    return vector / abs(vector) if vector else 0.0


def test_sheep_that_no_robot_frightens_stay_apart_and_mostly_stand():
    model = Shepherding(n_sheep=10, rng=5)
    model.remove_robots(model.robots)
    before = model.movers.position.copy()
    model.run(20)
    assert np.hypot(*(model.movers.position - before).T).mean() < 5 * STRIDE


def test_fewer_than_two_sheep_are_refused():
    with pytest.raises(SwarmError, match="n_sheep"):
        Shepherding(n_sheep=1, rng=1)
