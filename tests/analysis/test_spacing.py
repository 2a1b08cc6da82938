"""Nearest neighbours and extent: closed forms on lattices, the Poisson mean, all-pairs twins, symmetries."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.analysis import (
    clark_evans,
    dispersion,
    nearest_neighbour_distances,
    random_nearest_neighbour_distance,
)

swarms = st.builds(
    lambda seed, n: np.random.default_rng(seed).random((n, 2)) * 100, st.integers(0, 2**32), st.integers(2, 60)
)


def turned(position, turn):
    c, s = np.cos(turn), np.sin(turn)
    return position @ np.array([[c, s], [-s, c]])


def triangular_lattice(side, spacing):
    row = np.arange(side)
    x = row[None, :] + 0.5 * (row[:, None] % 2)
    return spacing * np.column_stack([x.ravel(), np.repeat(row * math.sqrt(0.75), side)])


@given(swarms)
def test_nearest_neighbours_are_those_of_all_pairs(position):
    distance = np.hypot(*(position[:, None] - position).transpose(2, 0, 1))
    np.fill_diagonal(distance, np.inf)
    np.testing.assert_allclose(nearest_neighbour_distances(position), distance.min(axis=1), rtol=1e-12)


@given(swarms, st.floats(-np.pi, np.pi), st.floats(-500, 500), st.floats(0.1, 50), st.randoms(use_true_random=False))
def test_spacing_follows_a_swarm_that_is_moved_turned_scaled_and_shuffled(position, turn, shift, scale, random):
    order = random.sample(range(len(position)), len(position))
    moved = scale * (turned(position, turn)[order] + np.array([shift, -shift]))
    expected = scale * nearest_neighbour_distances(position)[order]
    np.testing.assert_allclose(nearest_neighbour_distances(moved), expected, atol=1e-9 * scale)
    assert dispersion(moved) == pytest.approx(scale * dispersion(position), rel=1e-9)
    assert clark_evans(moved, scale**2 * 1e4) == pytest.approx(clark_evans(position, 1e4), abs=1e-9)


def test_a_lone_robot_has_no_neighbour():
    assert nearest_neighbour_distances([[3, 4]]).tolist() == [math.inf]
    assert nearest_neighbour_distances(np.empty((0, 2))).shape == (0,)
    assert math.isnan(clark_evans([[3, 4]], 100))
    assert math.isnan(clark_evans(np.empty((0, 2)), 100))


def test_robots_in_one_place_are_at_no_distance():
    assert nearest_neighbour_distances(np.ones((5, 2))).tolist() == [0.0] * 5
    assert clark_evans(np.ones((5, 2)), 100) == 0.0
    assert dispersion(np.ones((5, 2))) == 0.0


def test_a_triangular_lattice_has_the_largest_ratio_there_is():
    spacing, side = 7.0, 20
    area = side**2 * spacing**2 * math.sqrt(0.75)
    assert clark_evans(triangular_lattice(side, spacing), area) == pytest.approx(2 * (4 / 3) ** 0.25)


def test_a_square_lattice_has_a_ratio_of_two():
    x, y = np.meshgrid(np.arange(10.0), np.arange(10.0))
    assert clark_evans(np.column_stack([x.ravel(), y.ravel()]), 100) == pytest.approx(2.0)


def test_random_places_have_a_ratio_of_one():
    position = np.random.default_rng(1).random((20_000, 2))
    # Standard error 0.26136 / (0.5 sqrt(n)) = 0.0037 (Clark & Evans 1954); the border adds about 0.002.
    assert clark_evans(position, 1.0) == pytest.approx(1.0, abs=0.013)


@given(st.integers(1, 10**6), st.floats(1e-3, 1e9))
def test_the_random_distance_is_half_over_the_root_of_the_density(n, area):
    assert random_nearest_neighbour_distance(n, area) == pytest.approx(0.5 / math.sqrt(n / area))


@given(swarms)
def test_dispersion_is_the_root_mean_square_distance_of_all_pairs_over_root_two(position):
    squares = ((position[:, None] - position) ** 2).sum(axis=2)
    assert dispersion(position) == pytest.approx(math.sqrt(squares.mean() / 2), rel=1e-9)


def test_dispersion_of_a_ring_is_its_radius():
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    assert dispersion(5 + 8 * np.column_stack([np.cos(turn), np.sin(turn)])) == pytest.approx(8.0)


def test_dispersion_of_one_robot_is_zero_and_of_none_is_not_defined():
    assert dispersion([[7, 9]]) == 0.0
    assert math.isnan(dispersion(np.empty((0, 2))))
