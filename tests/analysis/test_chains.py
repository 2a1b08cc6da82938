"""Chains at one moment: who follows whom, and the paths and rings that it makes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.analysis.chains import chains
from mesa_swarm.base.errors import InvalidValueError

seeds = st.integers(0, 2**32 - 1)


def line(n, gap=10.0, heading=0.0):
    """Return the poses of n robots in a line, the head first."""
    ahead = np.array([math.cos(heading), math.sin(heading)])
    return -gap * np.arange(n)[:, None] * ahead, np.full(n, heading)


def ring(n, radius=20.0):
    """Return the poses of n robots that follow each other round a circle, counter-clockwise."""
    azimuth = 2 * math.pi * np.arange(n) / n
    return radius * np.column_stack([np.cos(azimuth), np.sin(azimuth)]), azimuth + math.pi / 2


def crowd(seed, n=60, side=120.0):
    """Return random poses that keep to few directions, so that there are chains."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0, side, (n, 2)), rng.normal(0.0, 0.7, n)


def expected_leaders(position, heading, distance, half_angle, alignment):
    """Return who follows whom, robot by robot and pair by pair, in the words of the definition."""
    n, wanted = len(position), {}
    for i in range(n):
        seen = []
        for j in range(n):
            dx, dy = position[j] - position[i]
            bearing = math.remainder(math.atan2(dy, dx) - heading[i], 2 * math.pi)
            if i != j and math.hypot(dx, dy) <= distance and abs(bearing) <= half_angle:
                seen.append((math.hypot(dx, dy), j))
        if seen:
            gap, j = min(seen)
            if abs(math.remainder(heading[i] - heading[j], 2 * math.pi)) < alignment:
                wanted.setdefault(j, []).append((gap, i))
    leader = np.full(n, -1)
    for j, followers in wanted.items():
        leader[min(followers)[1]] = j
    return leader


@given(seeds, st.floats(10, 175), st.floats(10, 175))
def test_who_follows_whom_agrees_with_the_definition_pair_by_pair(seed, half_angle, alignment):
    position, heading = crowd(seed, n=40, side=90.0)
    found = chains(position, heading, link_distance=20.0, half_angle_degrees=half_angle, alignment_degrees=alignment)
    expected = expected_leaders(position, heading, 20.0, math.radians(half_angle), math.radians(alignment))
    assert found.leader.tolist() == expected.tolist()


@given(seeds)
def test_places_and_labels_are_those_of_walking_from_follower_to_leader(seed):
    position, heading = crowd(seed, side=70.0)
    found = chains(position, heading, link_distance=25.0, half_angle_degrees=90, alignment_degrees=180)
    for label, (rows, closed) in enumerate(zip(found.members(), found.closed, strict=True)):
        assert found.leader[rows[1:]].tolist() == rows[:-1].tolist()
        assert found.leader[rows[0]] == (rows[-1] if closed else -1)
        assert (found.label[rows] == label).all()
        assert found.place[rows].tolist() == list(range(len(rows)))
        assert len(rows) == found.lengths[label]
    alone = found.label < 0
    assert (found.leader[alone] == -1).all()
    assert found.lengths.sum() + alone.sum() == len(position)
    assert (np.diff(found.lengths) <= 0).all()


@given(st.integers(2, 30), st.floats(-math.pi, math.pi))
def test_robots_in_a_line_are_one_chain_in_their_order(n, heading):
    found = chains(*line(n, heading=heading), link_distance=15)
    assert found.lengths.tolist() == [n]
    assert found.place.tolist() == list(range(n))
    assert not found.closed.any()


def test_two_lines_that_drive_in_opposite_directions_are_two_chains():
    (right, east), (left, west) = line(5), line(3, heading=math.pi)
    found = chains(np.concatenate([right, left + np.array([0, 4])]), np.concatenate([east, west]), link_distance=15)
    assert found.lengths.tolist() == [5, 3]
    assert found.label.tolist() == [0] * 5 + [1] * 3


def test_robots_that_face_each_other_are_no_chain():
    assert chains([[0, 0], [10, 0]], [0, math.pi], link_distance=15).count == 0


def test_robots_that_face_each_other_are_a_ring_of_two_if_no_alignment_is_asked_for():
    found = chains([[0, 0], [10, 0]], [0, 3.0], link_distance=15, alignment_degrees=180)
    assert found.closed.tolist() == [True]


@pytest.mark.parametrize("n", [3, 6, 12])
def test_robots_that_follow_each_other_round_a_circle_are_a_ring(n):
    found = chains(*ring(n), link_distance=40, half_angle_degrees=90, alignment_degrees=150)
    assert found.lengths.tolist() == [n]
    assert found.closed.tolist() == [True]
    assert sorted(found.place.tolist()) == list(range(n))
    assert found.longest == n


def test_a_ring_is_opened_at_its_longest_link():
    position, heading = ring(8)
    azimuth = 2 * math.pi * 3.3 / 8
    position[3], heading[3] = 20 * np.array([math.cos(azimuth), math.sin(azimuth)]), azimuth + math.pi / 2
    found = chains(position, heading, link_distance=40, half_angle_degrees=90)
    assert found.leader[2] == 3
    assert found.members()[0].tolist() == [2, 1, 0, 7, 6, 5, 4, 3]


def test_of_two_followers_the_nearer_keeps_the_link_and_the_other_follows_none():
    found = chains([[0, 0], [-9, 3], [-8, -3]], np.zeros(3), link_distance=15)
    assert found.leader.tolist() == [-1, -1, 0]


def test_of_two_followers_that_are_equally_near_the_smaller_row_keeps_the_link():
    found = chains([[0, 0], [-8, 3], [-8, -3]], np.zeros(3), link_distance=15)
    assert found.leader.tolist() == [-1, 0, -1]


def test_who_has_one_that_faces_it_right_ahead_does_not_follow_one_beyond():
    assert chains([[0, 0], [8, 0], [14, 0]], [0, math.pi, 0], link_distance=20).leader[0] == -1


@pytest.mark.parametrize(
    ("place", "heading", "follows"),
    [
        ((15, 0), 0.0, True),
        ((15.01, 0), 0.0, False),
        ((-5, 0), 0.0, False),
        ((7, 6.9), 0.0, True),
        ((7, 7.1), 0.0, False),
        ((10, 0), 1.57, True),
        ((10, 0), 1.58, False),
    ],
    ids=["just near", "too far", "behind", "just ahead", "too far aside", "just aligned", "crosswise"],
)
def test_a_link_ends_at_its_limits(place, heading, follows):
    leader = chains([[0, 0], place], [0, heading], link_distance=15).leader
    assert leader[0] == (1 if follows else -1)


@given(seeds, st.floats(-math.pi, math.pi), st.tuples(st.floats(-500, 500), st.floats(-500, 500)))
def test_chains_know_no_place_and_no_direction(seed, turn, shift):
    position, heading = crowd(seed)
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    here = chains(position, heading, link_distance=20)
    there = chains(position @ rotation.T + shift, heading + turn, link_distance=20)
    assert here.leader.tolist() == there.leader.tolist()


@given(seeds)
def test_the_order_of_the_rows_is_nothing(seed):
    position, heading = crowd(seed)
    order = np.random.default_rng(seed).permutation(len(heading))
    here, there = (chains(position[o], heading[o], link_distance=20) for o in (slice(None), order))
    assert np.where(there.leader < 0, -1, order[there.leader]).tolist() == here.leader[order].tolist()
    assert there.place.tolist() == here.place[order].tolist()
    assert there.lengths.tolist() == here.lengths.tolist()


def test_the_figures_are_those_of_the_chains():
    (three, east), (two, north) = line(3), line(2, heading=math.pi / 2)
    position = np.concatenate([three, two + np.array([200, 0]), [[400, 0]]])
    found = chains(position, np.concatenate([east, north, [0]]), link_distance=15)
    assert (found.count, found.longest, found.mean_length, found.chained) == (2, 3, 2.5, pytest.approx(5 / 6))


@pytest.mark.parametrize("n", [0, 1])
def test_no_robots_and_one_alone_have_no_chain(n):
    found = chains(np.zeros((n, 2)), np.zeros(n), link_distance=15)
    assert (found.count, found.longest, found.members()) == (0, 0, [])
    assert math.isnan(found.mean_length)
    assert found.chained == 0.0 if n else math.isnan(found.chained)


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        (([[0, 0, 0]], [0]), {}, r"position has the shape \(1, 3\); expected an array of shape \(n, 2\)"),
        (([[0, 0]], [0, 1]), {}, r"heading has the shape \(2,\); expected an array of shape \(1,\)"),
        (([[0, math.inf]], [0]), {}, r"position is inf at \[0, 1\]"),
        (("here", [0]), {}, r"position has the shape \(\); expected an array"),
        (([[0, 0]], [0]), {"link_distance": 0}, "link_distance is 0"),
        (([[0, 0]], [0]), {"half_angle_degrees": 181}, "half_angle_degrees is 181"),
        (([[0, 0]], [0]), {"alignment_degrees": 0}, "alignment_degrees is 0"),
    ],
)
def test_wrong_arrays_and_parameters_are_refused_in_words(arguments, options, words):
    with pytest.raises(InvalidValueError, match=words):
        chains(*arguments, **{"link_distance": 15, **options})
