"""Order: one where all agree, zero where they cancel, and no matter where or how the swarm is turned."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.analysis import directions, milling, neighbour_alignment, polarization

azimuths = st.lists(st.floats(-np.pi, np.pi), min_size=1, max_size=40).map(np.array)
seeds = st.integers(0, 2**32)


def ring(n, radius=10.0, centre=(0.0, 0.0)):
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False) + 0.1
    return np.array(centre) + radius * np.column_stack([np.cos(turn), np.sin(turn)]), turn


@pytest.mark.slow
@given(azimuths, st.floats(-9, 9), st.randoms(use_true_random=False))
def test_polarization_is_the_mean_phasor_in_any_order_and_however_the_swarm_is_turned(heading, turn, random):
    expected = abs(sum(cmath.exp(1j * h) for h in heading)) / len(heading)
    assert polarization(heading) == pytest.approx(expected, abs=1e-12)
    assert polarization(np.array(random.sample(list(heading), len(heading))) + turn) == pytest.approx(
        expected, abs=1e-9
    )
    assert 0 <= polarization(heading) <= 1


@given(azimuths, st.integers(1, 5))
def test_robots_without_a_direction_are_left_out(heading, missing):
    gaps = np.concatenate([heading, np.full(missing, np.nan)])
    assert polarization(gaps) == polarization(heading)


@pytest.mark.parametrize("n", [1, 2, 7, 1000])
def test_polarization_of_parallel_robots_is_one(n):
    assert polarization(np.full(n, 2.5)) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("n", [2, 3, 12])
def test_polarization_of_headings_all_around_is_zero(n):
    assert polarization(ring(n)[1]) == pytest.approx(0.0, abs=1e-12)


def test_polarization_of_random_headings_is_that_of_a_random_walk():
    rng, n = np.random.default_rng(1), 400
    mean = np.mean([polarization(rng.uniform(-np.pi, np.pi, n)) for _ in range(500)])
    assert mean == pytest.approx(math.sqrt(math.pi / (4 * n)), rel=0.1)


def test_order_of_no_robots_and_of_a_swarm_that_stands_is_not_defined():
    nowhere = [math.nan, math.nan]
    assert all(map(math.isnan, [polarization([]), polarization(nowhere), milling(np.empty((0, 2)), [])]))
    assert math.isnan(milling([[0, 0], [1, 1]], nowhere))


@pytest.mark.parametrize("way", [1, -1])
def test_milling_of_a_ring_that_turns_is_one_either_way_round(way):
    position, turn = ring(9, centre=(300, -200))
    assert milling(position, turn + way * np.pi / 2) == pytest.approx(1.0)


@pytest.mark.parametrize("outward", [0.0, np.pi])
def test_milling_of_a_ring_that_grows_or_shrinks_is_zero(outward):
    position, turn = ring(9)
    assert milling(position, turn + outward) == pytest.approx(0.0, abs=1e-12)


def test_milling_of_a_ring_half_of_which_goes_each_way_is_zero():
    position, turn = ring(10)
    assert milling(position, turn + np.where(np.arange(10) % 2, 1, -1) * np.pi / 2) == pytest.approx(0.0, abs=1e-12)


def test_milling_of_a_ring_that_goes_at_a_slant_is_its_sine():
    position, turn = ring(8)
    assert milling(position, turn + 0.3) == pytest.approx(math.sin(0.3))


@given(seeds, st.integers(1, 30), st.floats(-np.pi, np.pi), st.floats(-500, 500), st.floats(0.1, 50))
def test_milling_stays_when_the_swarm_is_moved_turned_scaled_and_shuffled(seed, n, turn, shift, scale):
    rng = np.random.default_rng(seed)
    position, heading, order = rng.random((n, 2)) * 100, rng.uniform(-np.pi, np.pi, n), rng.permutation(n)
    c, s = np.cos(turn), np.sin(turn)
    moved = scale * (position @ np.array([[c, s], [-s, c]]) + (shift, shift))
    assert milling(moved[order], (heading + turn)[order]) == pytest.approx(milling(position, heading), abs=1e-7)


@given(seeds, st.integers(2, 30))
def test_milling_is_the_mean_of_sines_robot_by_robot(seed, n):
    rng = np.random.default_rng(seed)
    position, heading = rng.random((n, 2)) * 100, rng.uniform(-np.pi, np.pi, n)
    x, y = position[:, 0].mean(), position[:, 1].mean()
    sines = [math.sin(h - math.atan2(py - y, px - x)) for (px, py), h in zip(position, heading, strict=True)]
    assert milling(position, heading) == pytest.approx(abs(sum(sines)) / n, abs=1e-9)


@pytest.mark.parametrize("n", [1, 2, 3, 7])
def test_robots_at_the_centroid_go_round_nothing(n):
    assert milling(np.full((n, 2), 0.1), np.full(n, 1.0)) == 0.0


def test_a_robot_without_a_direction_still_makes_up_the_centroid():
    # Centroid (1, 0): both others are off it by one unit, the one that stands is left out of the mean.
    assert milling([[0, 0], [2, 0], [1, 0]], [-np.pi / 2, np.pi / 2, np.nan]) == pytest.approx(1.0)


@given(seeds, st.floats(-np.pi, np.pi, exclude_max=True), st.floats(0.01, 10))
def test_directions_are_those_in_which_robots_were_moved(seed, azimuth, speed):
    before = np.random.default_rng(seed).random((5, 2)) * 100
    after = before + speed * np.array([np.cos(azimuth), np.sin(azimuth)])
    found = directions(before, after)
    np.testing.assert_allclose(np.exp(1j * found), np.exp(1j * azimuth), atol=1e-9)
    assert ((-np.pi <= found) & (found < np.pi)).all()


def test_going_left_is_minus_pi_and_standing_is_no_direction():
    found = directions([[1, 0], [1, 1], [5, 5]], [[0, 0], [0, 1], [5, 5]])
    assert found[:2].tolist() == [-math.pi, -math.pi]
    assert math.isnan(found[2])


@given(seeds, st.floats(-9, 9))
def test_neighbour_alignment_is_the_mean_over_near_pairs_wherever_the_swarm_lies(seed, turn):
    rng = np.random.default_rng(seed)
    points, heading = rng.uniform(0, 100, (12, 2)), rng.uniform(-np.pi, np.pi, 12)
    near = [(i, j) for i in range(12) for j in range(i) if math.dist(points[i], points[j]) <= 40]
    expected = np.mean([math.cos(heading[i] - heading[j]) for i, j in near])
    order, (c, s) = rng.permutation(12), (math.cos(turn), math.sin(turn))
    turned = points @ np.array([[c, s], [-s, c]]) + rng.uniform(-1000, 1000, 2)
    assert neighbour_alignment(points, heading, 40) == pytest.approx(expected, abs=1e-12)
    assert neighbour_alignment(turned[order], heading[order] + turn, 40 + 1e-9) == pytest.approx(expected, abs=1e-9)


def test_two_flocks_that_go_opposite_ways_are_aligned_but_not_polarized():
    points = np.concatenate([ring(10)[0], ring(10, centre=(500.0, 0.0))[0]])
    heading = np.repeat([0.0, np.pi], 10)
    assert neighbour_alignment(points, heading, 50) == pytest.approx(1.0)
    assert polarization(heading) == pytest.approx(0.0, abs=1e-12)


def test_neighbour_alignment_of_robots_that_are_far_apart_is_not_a_number():
    assert math.isnan(neighbour_alignment([[0, 0], [99, 0]], [0, 0], 50))
