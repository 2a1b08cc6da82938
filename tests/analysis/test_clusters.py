"""Groups: what is linked by steps of at most a distance, in any order and wherever the swarm is."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mesa_swarm.analysis import clusters, kept_together
from mesa_swarm.base.errors import InvalidValueError

swarms = st.builds(
    lambda seed, n: np.random.default_rng(seed).random((n, 2)) * 100, st.integers(0, 2**32), st.integers(0, 60)
)


def all_distances(position):
    return np.hypot(*(position[:, None] - position).transpose(2, 0, 1))


def grown_one_by_one(position, distance, fewest):
    """Return the groups as sorted lists of rows, by all pairs, in the documented order."""
    near, left, groups = all_distances(position) <= distance, set(range(len(position))), []
    while left:
        group, edge = set(), {min(left)}
        while edge:
            group |= edge
            edge = {int(j) for i in edge for j in np.flatnonzero(near[i])} - group
        left -= group
        groups.append(sorted(group))
    return sorted((g for g in groups if len(g) >= fewest), key=lambda group: (-len(group), group[0]))


def partition(label):
    return {frozenset(np.flatnonzero(label == number).tolist()) for number in np.unique(label[label >= 0])}


def assume_clear(position, distance):
    """Leave out worlds in which rounding decides who is linked."""
    assume((np.abs(all_distances(position) - distance) > 1e-6).all())


@given(swarms, st.floats(1, 40), st.integers(1, 4))
def test_groups_are_those_that_grow_robot_by_robot(position, distance, fewest):
    found, groups = clusters(position, distance, fewest=fewest), grown_one_by_one(position, distance, fewest)
    expected = np.full(len(position), -1)
    for number, group in enumerate(groups):
        expected[group] = number
    np.testing.assert_array_equal(found.label, expected)
    assert found.sizes.tolist() == [len(group) for group in groups]
    assert found.label.dtype == found.sizes.dtype == np.int64


@given(swarms, st.floats(1, 40), st.floats(-np.pi, np.pi), st.floats(-500, 500))
def test_groups_stay_when_the_swarm_is_moved_turned_or_scaled(position, distance, turn, shift):
    assume_clear(position, distance)
    c, s = np.cos(turn), np.sin(turn)
    moved = 3.0 * (position @ np.array([[c, s], [-s, c]]) + (shift, -shift))
    np.testing.assert_array_equal(clusters(moved, 3.0 * distance).label, clusters(position, distance).label)


@given(swarms, st.floats(1, 40), st.randoms(use_true_random=False))
def test_who_shares_a_group_does_not_depend_on_the_order_of_the_robots(position, distance, random):
    order = np.array(random.sample(range(len(position)), len(position)), int)
    before, after = clusters(position, distance), clusters(position[order], distance)
    back = np.empty(len(order), np.int64)
    back[order] = after.label
    assert partition(back) == partition(before.label)
    assert after.sizes.tolist() == before.sizes.tolist()


@given(swarms, st.floats(1, 40), st.floats(0, 40))
def test_a_longer_reach_only_merges_groups(position, distance, more):
    narrow, wide = clusters(position, distance, fewest=1), clusters(position, distance + more, fewest=1)
    assert wide.count <= narrow.count
    assert all(len(set(wide.label[list(group)])) == 1 for group in partition(narrow.label))


@given(swarms, st.floats(1, 40), st.integers(1, 4))
def test_shares_agree_with_the_labels(position, distance, fewest):
    found, n = clusters(position, distance, fewest=fewest), max(len(position), 1)
    grouped = (found.label >= 0).sum()
    assert found.grouped == grouped
    assert found.alone == pytest.approx((found.label < 0).sum() / n)
    assert found.largest_fraction == pytest.approx((found.label == 0).sum() / n)
    assert found.local_convergence == pytest.approx((found.label > 0).sum() / max(grouped, 1))
    assert found.mean_size * found.count == pytest.approx(grouped)


def test_robots_exactly_the_distance_apart_are_linked():
    assert clusters([[0, 0], [3, 4]], 5).count == 1
    assert clusters([[0, 0], [3, 4]], np.nextafter(5, 0)).count == 0


def test_a_chain_is_one_group_however_long_it_is():
    chain = np.column_stack([np.arange(1000) * 10.0, np.zeros(1000)])
    found = clusters(chain, 10)
    assert (found.count, found.largest_fraction, found.local_convergence, found.alone) == (1, 1.0, 0.0, 0.0)


@pytest.mark.parametrize("c", [1, 2, 5, 50])
def test_local_convergence_of_groups_of_one_size_is_all_but_one_of_them(c):
    pairs = np.array([[100.0 * k + dx, 0.0] for k in range(c) for dx in (0, 10)])
    assert clusters(pairs, 10).local_convergence == pytest.approx((c - 1) / c)


def test_groups_of_one_size_are_numbered_by_their_first_robots_row():
    position = [[0, 0], [100, 0], [200, 0], [201, 0], [101, 0], [1, 0], [300, 0], [202, 0]]
    assert clusters(position, 2).label.tolist() == [1, 2, 0, 0, 2, 1, -1, 0]


@pytest.mark.parametrize("n", [0, 1, 2])
def test_a_swarm_without_groups_has_shares_of_zero(n):
    found = clusters(np.arange(2.0 * n).reshape(n, 2) * 100, 10)
    assert (found.count, found.largest_fraction, found.local_convergence, found.mean_size) == (0, 0.0, 0.0, 0.0)
    assert found.alone == (1.0 if n else 0.0)
    assert found.label.tolist() == [-1] * n


def test_robots_in_one_place_are_one_group():
    assert clusters(np.ones((500, 2)), 1e-9).sizes.tolist() == [500]


def test_a_distance_that_links_too_many_pairs_to_hold_is_refused_before_memory_is_spent():
    position = np.random.default_rng(1).random((8000, 2))
    with pytest.raises(InvalidValueError, match=r"distance is 2, which links about 31996000 pairs of 8000 robots"):
        clusters(position, 2)


labels = st.lists(st.integers(-1, 4), min_size=2, max_size=25)


@given(labels, st.randoms(use_true_random=False))
def test_kept_together_counts_the_pairs_that_share_a_group_at_both_times(before, random):
    after = [random.randint(-1, 3) for _ in before]
    pairs = [(i, j) for i in range(len(before)) for j in range(i) if before[i] == before[j] >= 0]
    kept = [after[i] == after[j] >= 0 for i, j in pairs]
    if pairs:
        assert kept_together(before, after) == pytest.approx(sum(kept) / len(kept))
    else:
        assert math.isnan(kept_together(before, after))


@given(labels)
def test_groups_that_only_merge_or_are_renumbered_are_kept_together(before):
    merged = [0 if group >= 0 else -1 for group in before]
    renumbered = [7 - group if group >= 0 else -1 for group in before]
    for after in (merged, renumbered):
        share = kept_together(before, after)
        assert math.isnan(share) or share == 1.0


def test_labels_of_another_number_of_robots_are_refused():
    with pytest.raises(InvalidValueError, match=r"after has the shape \(1,\); expected an array of shape \(2,\)"):
        kept_together([0, 0], [0])


@given(swarms, st.floats(1, 40))
def test_the_own_size_is_the_mean_over_robots_of_how_many_share_their_group(position, distance):
    found = clusters(position, distance)
    shared = [1 if label < 0 else int((found.label == label).sum()) for label in found.label]
    assert found.own_size == pytest.approx(np.mean(shared) if shared else 0.0)
