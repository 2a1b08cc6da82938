"""Compiled measures of a moment: the numbers of their checked counterparts, of any robots."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.analysis import (
    alignment_within,
    chain_lengths,
    chains,
    clusters,
    directions,
    group_sizes,
    mean_gap,
    nearest_neighbour_distances,
    neighbour_alignment,
    order_of,
    polarization,
    travel_of,
)

robots = st.lists(st.tuples(st.floats(0, 100), st.floats(0, 100), st.floats(-3, 3)), max_size=25)
distances = st.floats(1, 60)


def columns(drawn):
    table = np.array(drawn, float).reshape(-1, 3)
    return np.ascontiguousarray(table[:, :2]), np.ascontiguousarray(table[:, 2])


@given(robots, distances)
def test_groups_are_those_of_clusters(drawn, distance):
    position, _ = columns(drawn)
    sizes = group_sizes(position, distance)
    assert sorted(sizes, reverse=True) == clusters(position, distance, fewest=1).sizes.tolist()


@given(robots, distances)
def test_chains_are_those_of_chains(drawn, distance):
    position, heading = columns(drawn)
    lengths = chain_lengths(position, heading, distance)
    assert sorted(lengths, reverse=True) == chains(position, heading, link_distance=distance).lengths.tolist()


def test_a_ring_is_one_chain_of_all_its_robots():
    turns = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    position = 20 * np.column_stack([np.cos(turns), np.sin(turns)])
    assert chain_lengths(position, turns + np.pi / 2, 20.0).tolist() == [8]
    assert chains(position, turns + np.pi / 2, link_distance=20).closed.tolist() == [True]


@given(robots)
def test_gaps_are_those_to_nearest_neighbours(drawn):
    position, _ = columns(drawn)
    if len(position) < 2:
        assert math.isnan(mean_gap(position))
    else:
        assert mean_gap(position) == pytest.approx(np.mean(nearest_neighbour_distances(position)))


@given(robots, distances, st.booleans())
def test_order_and_alignment_are_those_of_headings(drawn, distance, lacks):
    position, heading = columns(drawn)
    if lacks:
        heading[::3] = np.nan
    assert order_of(heading) == pytest.approx(float(polarization(heading)), nan_ok=True)
    expected = float(neighbour_alignment(position, heading, distance))
    assert alignment_within(position, heading, distance) == pytest.approx(expected, abs=1e-12, nan_ok=True)


@given(robots, st.booleans())
def test_directions_of_travel_are_those_of_directions(drawn, moves):
    position, heading = columns(drawn)
    after = position + np.column_stack([np.cos(heading), np.sin(heading)]) * moves
    assert travel_of(position, after) == pytest.approx(directions(position, after), nan_ok=True)
