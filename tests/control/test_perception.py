"""What robots make of their readings, against a plain NumPy twin on random worlds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT3, AGENT6, AGENT9, SwarmModel
from mesa_swarm.control.layer import Senses, centroids, find_nearest_ahead
from mesa_swarm.world.statics import ROBOT
from support.scenes import empty


def sensed(seed: int, n: int = 30) -> Senses:
    model = SwarmModel(map="original", rng=seed)
    for design in (AGENT3, AGENT6, AGENT9):
        model.add_robots(design, n // 3)
    model.sense()
    return Senses.of(model.swarm)


@pytest.mark.slow
@given(st.integers(0, 10_000))
def test_the_centroid_is_the_mean_over_the_sensors_that_see_a_robot_and_no_others(seed):
    senses = sensed(seed)
    centroid, seen = centroids(senses)
    for i in range(len(seen)):
        table = senses.sensors[senses.design[i]]
        points = [table[s, :2] + senses.distance[i, s] * table[s, 2:4] for s in np.flatnonzero(senses.kind[i] == ROBOT)]
        assert seen[i] == len(points)
        np.testing.assert_allclose(centroid[i], np.mean(points, axis=0) if points else (0, 0), atol=1e-12)


@pytest.mark.slow
@given(st.integers(0, 10_000))
def test_the_nearest_robot_ahead_is_never_behind_and_never_an_obstacle(seed):
    senses = sensed(seed)
    nearest = np.empty(len(senses.design), np.int64)
    find_nearest_ahead(senses.distance, senses.kind, senses.bearing, senses.design, nearest)
    for i, s in enumerate(nearest):
        ahead = np.abs(senses.bearing[senses.design[i]]) < np.pi / 2 - 1e-9
        choice = np.flatnonzero((senses.kind[i] == ROBOT) & ahead)
        assert (s == -1) == (len(choice) == 0)
        if s >= 0:
            assert s in choice
            assert senses.distance[i, s] == senses.distance[i, choice].min()


def test_two_robots_abeam_are_perceived_at_the_centre_between_them():
    model = empty()
    model.add_robots(AGENT9, poses=[(200, 150, 0.0), (200, 180, 0.0), (200, 120, 0.0)])
    model.sense()
    centroid, seen = centroids(Senses.of(model.swarm))
    assert seen[0] == 2
    assert centroid[0] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_sensor_looking_exactly_sideways_does_not_look_ahead():
    model = empty()
    model.add_robots(AGENT9, poses=[(200, 150, 0.0), (200, 180, 0.0)])
    model.sense()
    senses, nearest = Senses.of(model.swarm), np.empty(2, np.int64)
    find_nearest_ahead(senses.distance, senses.kind, senses.bearing, senses.design, nearest)
    assert (senses.kind[0] == ROBOT).any()
    assert nearest[0] == -1
