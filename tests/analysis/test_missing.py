"""Missing robots and values: left out everywhere, as if they were not in the data, and counted; tables row by row."""

import copy
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import SwarmModel
from mesa_swarm.analysis import (
    Measure,
    Measures,
    central_moving_average,
    chains,
    clark_evans,
    clusters,
    collision_frequency,
    count_missing,
    coverage,
    cumulative_collisions,
    directions,
    dispersion,
    find_pathologies,
    follow_chains,
    kept_together,
    later_mean,
    layer_shares,
    milling,
    nearest_neighbour_distances,
    neighbour_alignment,
    polarization,
    time_to,
    visited_cells,
)
from mesa_swarm.base.errors import DegreesWarning, InvalidValueError
from support.tracks import still

BOX = (0.0, 0.0, 100.0, 100.0)
seeds = st.integers(0, 2**32)
# Measures of the robots of one moment, of positions and headings.
OF_ROBOTS = {
    "polarization": lambda position, heading: polarization(heading),
    "milling": milling,
    "neighbour_alignment": lambda position, heading: neighbour_alignment(position, heading, 30),
    "clark_evans": lambda position, heading: clark_evans(position, 1e4),
    "dispersion": lambda position, heading: dispersion(position),
}
# How a number is missing: NaN, masked (with a wild number beneath), or masked beside NaN.
WAYS = ("nan", "masked", "both")


def scene(seed, *shape):
    """Return positions (*shape, 2), headings and which robots are missing."""
    rng = np.random.default_rng(seed)
    return rng.uniform(0, 100, (*shape, 2)), rng.uniform(-np.pi, np.pi, shape), rng.random(shape) < 0.3


def with_gaps(array, missing, way):
    """Return an array in which elements are missing, of points both coordinates."""
    gaps = np.broadcast_to(missing.reshape(missing.shape + (1,) * (array.ndim - missing.ndim)), array.shape)
    if way == "nan":
        return np.where(gaps, np.nan, array)
    if way == "masked":
        return np.ma.array(np.where(gaps, 987.0, array), mask=gaps)
    half = gaps & (np.arange(gaps.size).reshape(gaps.shape) % 2 == 0)
    return np.ma.array(np.where(gaps & ~half, np.nan, array), mask=half)


def same(one, other):
    """Compare bits, and NaN with NaN."""
    np.testing.assert_array_equal(np.asarray(one), np.asarray(other))


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", OF_ROBOTS)
@given(seeds, st.integers(0, 12))
@settings(max_examples=25, deadline=None)
def test_missing_robots_are_left_out_and_counted(name, way, seed, n):
    position, heading, missing = scene(seed, n)
    found = OF_ROBOTS[name](with_gaps(position, missing, way), with_gaps(heading, missing, way))
    same(found, OF_ROBOTS[name](position[~missing], heading[~missing]))
    assert isinstance(found, float)
    assert found.missing == missing.sum()


@pytest.mark.parametrize("name", OF_ROBOTS)
@given(seeds, st.integers(0, 5), st.integers(0, 6))
@settings(max_examples=25, deadline=None)
def test_tables_over_time_are_measured_row_by_row(name, seed, k, n):
    position, heading, missing = scene(seed, k, n)
    position, heading = with_gaps(position, missing, "nan"), with_gaps(heading, missing, "nan")
    found = OF_ROBOTS[name](position, heading)
    rows = [OF_ROBOTS[name](*row) for row in zip(position, heading, strict=True)]
    same(found, np.array(rows, float))
    same(found.missing, [row.missing for row in rows])
    assert found.shape == (k,)


@pytest.mark.parametrize("way", WAYS)
@given(seeds, st.integers(1, 12))
@settings(max_examples=25, deadline=None)
def test_numbers_for_each_robot_are_nan_for_missing_ones_and_do_not_see_them(way, seed, n):
    position, _, missing = scene(seed, n)
    after = position + np.random.default_rng(seed).normal(size=(n, 2))
    gaps, expected = with_gaps(position, missing, way), np.full((2, n), np.nan)
    expected[0, ~missing] = nearest_neighbour_distances(position[~missing])
    expected[1, ~missing] = directions(position[~missing], after[~missing])
    same([nearest_neighbour_distances(gaps), directions(gaps, after)], expected)
    same([nearest_neighbour_distances([gaps, gaps])[1], directions([gaps, gaps], [after, after])[1]], expected)


def test_a_robot_without_one_coordinate_is_missing():
    assert dispersion([[0, 0], [6, 0], [np.nan, 900]]) == 3
    assert dispersion(np.ma.array([[0, 0], [6, 0], [900, 0]], mask=[[0, 0], [0, 0], [0, 1]])) == 3


def test_a_masked_heading_and_a_masked_position_count_one_robot_each():
    position = np.ma.array([[0.0, 0], [9, 0], [0, 9], [9, 9]], mask=[[0, 0], [1, 1], [0, 0], [0, 0]])
    heading = np.ma.array([0.0, 1.0, 2.0, 3.0], mask=[0, 0, 1, 0])
    assert milling(position, heading).missing == count_missing(position=position, heading=heading) == 2
    assert count_missing(position=[position, position]).tolist() == [1, 1]
    assert count_missing(heading=heading) == 1


def test_masked_arrays_within_lists_keep_their_masks():
    masked = np.ma.array([0.0, np.pi], mask=[0, 1])
    same(polarization([masked, masked]), [1.0, 1.0])
    assert polarization([0.0, np.ma.masked]) == 1.0


def test_none_is_missing_as_in_the_rows_of_a_collector_and_texts_are_no_numbers():
    assert later_mean([None, 1.0, None, 3.0], 1) == 2.0
    assert later_mean([None, 1.0, None, 3.0], 1).missing == 2
    assert polarization([0.0, None]).missing == 1
    for wrong in ([None, "1.0"], [None, 1j], [object(), 1.0]):
        with pytest.raises(InvalidValueError, match="expected real numbers"):
            later_mean(wrong)


def test_a_mask_that_masks_nothing_changes_nothing():
    heading = np.ma.array([0.0, np.pi / 2])
    assert polarization(heading) == polarization(heading.data)
    assert polarization(heading).missing == 0


# ---- groups and chains


@pytest.mark.parametrize("way", WAYS)
@given(seeds, st.integers(0, 25))
@settings(max_examples=25, deadline=None)
def test_groups_and_chains_are_those_of_the_robots_that_are_there(way, seed, n):
    position, heading, missing = scene(seed, n)
    gaps = with_gaps(position, missing, way), with_gaps(heading, missing, way)
    found, expected = clusters(gaps[0], 20), clusters(position[~missing], 20)
    same(np.asarray(found.label)[~missing], expected.label)
    assert (np.asarray(found.label)[missing] == -1).all()
    shares = ("robots", "count", "grouped", "largest_fraction", "local_convergence", "mean_size", "own_size", "alone")
    assert [getattr(found, name) for name in shares] == [getattr(expected, name) for name in shares]
    how = {"link_distance": 30, "half_angle_degrees": 90}
    line, whole = chains(*gaps, **how), chains(position[~missing], heading[~missing], **how)
    rows = np.flatnonzero(~missing)
    for name in ("label", "place"):
        same(np.asarray(getattr(line, name))[rows], getattr(whole, name))
    same(np.asarray(line.leader)[rows], [rows[leader] if leader >= 0 else -1 for leader in whole.leader])
    same(line.chained, whole.chained)
    assert [members.tolist() for members in line.members()] == [rows[m].tolist() for m in whole.members()]
    assert found.missing == line.missing == missing.sum()
    assert (np.ma.getmaskarray(found.label) == missing).all()


@pytest.mark.parametrize("way", WAYS)
@given(seeds, st.integers(2, 20))
@settings(max_examples=25, deadline=None)
def test_the_cohesion_of_groups_leaves_out_robots_that_are_missing_at_either_time(way, seed, n):
    rng = np.random.default_rng(seed)
    before, after = rng.integers(-1, 3, (2, n)).astype(float)
    lost, gone = rng.random((2, n)) < 0.2
    found = kept_together(with_gaps(before, lost, way), with_gaps(after, gone, way))
    there = ~(lost | gone)
    same(found, kept_together(before[there], after[there]))
    assert found.missing == (~there).sum()
    same(kept_together([before, after], [after, after]), [kept_together(before, after), kept_together(after, after)])


def test_a_robot_that_is_lost_from_its_group_is_not_a_split():
    first = clusters([[0, 0], [10, 0], [20, 0]], 15)
    later = clusters([[0, 0], [10, 0], [np.nan, np.nan]], 15)
    assert kept_together(first.label, later.label) == 1.0
    assert kept_together(first.label, later.label).missing == 1


def test_a_gap_within_the_patience_breaks_no_chain_and_a_longer_one_does():
    k, heading = 20, np.zeros((20, 3))
    position = np.zeros((k, 3, 2)) + np.arange(k)[:, None, None] * [1.0, 0.0]
    position[..., 0] += [20.0, 10.0, 0.0]
    whole = follow_chains(position, heading, np.arange(k), link_distance=15, patience=3)
    for length, events in ((2, []), (5, ["end"])):
        gaps = position.copy()
        gaps[8 : 8 + length, 1] = np.nan
        found = follow_chains(gaps, heading, np.arange(k), link_distance=15, patience=3)
        assert [event.kind for event in found.events if event.kind != "birth"] == events
        assert found.missing.tolist() == [int(8 <= t < 8 + length) for t in range(k)]
        if not events:
            same(found.chain, whole.chain)
            assert not np.ma.isMaskedArray(found.chain)
        else:
            assert np.ma.getmaskarray(found.chain)[8 : 8 + length, 1].tolist() == [True] * length
            same(found.chained[8:13], [0.0] * 5)


@given(seeds, st.integers(2, 6))
@settings(max_examples=25, deadline=None)
def test_a_history_with_gaps_anywhere_is_followed_to_its_end(seed, n):
    position, heading, missing = scene(seed, 12, n)
    how = {"link_distance": 60, "half_angle_degrees": 180, "alignment_degrees": 180, "reversal_distance": 1}
    found = follow_chains(with_gaps(position, missing, "nan"), heading, np.arange(12), patience=2, **how)
    assert found.missing.tolist() == missing.sum(axis=1).tolist()
    shares = found.chained[~np.isnan(found.chained)]
    assert ((shares >= 0) & (shares <= 1)).all()


@given(seeds, st.integers(2, 6), st.integers(0, 5))
@settings(max_examples=25, deadline=None)
def test_a_robot_that_is_never_there_changes_nothing_for_the_others(seed, n, lost):
    position, heading, missing = scene(seed, 12, n)
    missing[:] = np.arange(n) == lost % n
    rows, how = np.flatnonzero(~missing[0]), {"link_distance": 40, "half_angle_degrees": 90}
    found = follow_chains(with_gaps(position, missing, "masked"), heading, np.arange(12), **how)
    alone = follow_chains(position[:, rows], heading[:, rows], np.arange(12), **how)
    same(np.asarray(found.chain)[:, rows], alone.chain)
    assert [event.step for event in found.events] == [event.step for event in alone.events]
    assert [tuple(rows[list(event.robots)].tolist()) for event in alone.events] == [e.robots for e in found.events]


# ---- pathologies


def test_a_robot_is_in_no_episode_while_it_is_missing():
    track = still(command=np.ones((100, 1, 2)))
    found = find_pathologies(**track)
    assert [(e.kind, e.first_step, e.last_step) for e in found] == [("stuck", 2, 100)]
    for name in ("position", "heading", "command", "layer"):
        array = np.array(track[name], float)
        array[track["steps"] == 41] = np.nan
        cut = find_pathologies(**{**track, name: array})
        assert (cut[0].kind, cut[0].first_step) == ("stuck", 2)
        assert [e.last_step for e in cut] == [40, 100]
        assert cut[1].first_step in (42, 43)  # the first step after that shows how far the robot moves
        assert cut.missing == 1
    assert found.missing == 0


def test_readings_that_are_masked_are_those_of_nothing():
    track = still()
    shape = np.shape(track["distance"])
    gone = {"distance": np.ma.masked_all(shape), "kind": np.ma.masked_all(shape, int)}
    nothing = {"distance": np.full(shape, -1.0), "kind": np.full(shape, -1)}
    assert find_pathologies(**{**track, **gone}) == find_pathologies(**{**track, **nothing})


# ---- over time


@pytest.mark.parametrize("way", WAYS)
@given(seeds, st.integers(0, 30), st.integers(0, 8).map(lambda half: 2 * half + 1))
@settings(max_examples=25, deadline=None)
def test_the_moving_average_is_over_the_values_of_the_window_that_are_there(way, seed, k, window):
    rng = np.random.default_rng(seed)
    values, missing, half = rng.normal(size=k), rng.random(k) < 0.4, window // 2
    found = central_moving_average(with_gaps(values, missing, way), window)
    blocks = [np.where(missing, np.nan, values)[max(t - half, 0) : t + half + 1] for t in range(k)]
    expected = [block[~np.isnan(block)].mean() if not np.isnan(block).all() else np.nan for block in blocks]
    np.testing.assert_allclose(found, np.array(expected, float), atol=1e-9)
    assert found.missing == missing.sum()
    assert later_mean(with_gaps(values, missing, way), 1).missing == missing.sum()


@pytest.mark.parametrize("way", WAYS)
@given(seeds, st.integers(0, 12), st.integers(1, 6))
@settings(max_examples=25, deadline=None)
def test_shares_of_robots_are_of_those_that_are_there(way, seed, k, n):
    rng = np.random.default_rng(seed)
    layer, collided, missing = rng.integers(-1, 2, (k, n)), rng.random((k, n)) < 0.5, rng.random((k, n)) < 0.3
    shares = layer_shares(with_gaps(layer, missing, way), 2)
    frequency = collision_frequency(with_gaps(collided.astype(float), missing, way), 1)
    counts = cumulative_collisions(with_gaps(collided.astype(float), missing, way))
    for t in range(k):
        there = ~missing[t]
        if there.any():
            same(shares[t], layer_shares(layer[t : t + 1, there], 2)[0])
            assert frequency[t] == pytest.approx(collided[t, there].mean(), abs=1e-12)
        else:
            assert np.isnan([*shares[t], frequency[t]]).all()
    same(counts, np.cumsum(collided & ~missing, axis=0))
    for found in (shares, frequency, counts):
        same(found.missing, missing.sum(axis=1))


def test_a_masked_value_has_reached_nothing():
    assert time_to(np.ma.array([9.0, 1.0, 9.0], mask=[1, 0, 0]), 5) == 2


# ---- coverage


@pytest.mark.parametrize("way", WAYS)
@given(seeds, st.integers(0, 12), st.integers(1, 4))
@settings(max_examples=25, deadline=None)
def test_coverage_counts_positions_that_are_missing_and_that_lie_outside(way, seed, k, n):
    position, _, missing = scene(seed, k, n)
    beyond = np.random.default_rng(seed + 1).random((k, n)) < 0.2
    position[beyond] += [0.0, 200.0]
    found = coverage(with_gaps(position, missing, way), np.ones((4, 4)), BOX)
    inside = position[~missing & ~beyond]
    assert found == coverage(inside, np.ones((4, 4)), BOX)
    assert (found.missing, found.outside) == (missing.sum(), (beyond & ~missing).sum())


@pytest.mark.parametrize("way", WAYS)
def test_visited_cells_are_those_of_the_positions_that_are_there(way):
    position, _, missing = scene(1, 30)
    found = visited_cells(with_gaps(position, missing, way), BOX, (5, 5))
    same(found, visited_cells(position[~missing], BOX, (5, 5)))
    assert found.missing == missing.sum()
    assert found.dtype == bool


# ---- degrees


OF_HEADINGS = {
    "polarization": polarization,
    "milling": lambda heading: milling(np.zeros((2, 2)), heading),
    "neighbour_alignment": lambda heading: neighbour_alignment(np.zeros((2, 2)), heading, 1),
    "chains": lambda heading: chains(np.zeros((2, 2)), heading, link_distance=1),
    "follow_chains": lambda heading: follow_chains(np.zeros((1, 2, 2)), [heading], [0], link_distance=1),
    "count_missing": lambda heading: count_missing(heading=heading),
    "find_pathologies": lambda heading: find_pathologies(**{**still(), "heading": np.full((100, 1), heading[1])}),
}


@pytest.mark.parametrize("name", OF_HEADINGS)
def test_headings_beyond_two_turns_are_probably_degrees_of_which_the_caller_is_warned(name):
    with pytest.warns(DegreesWarning, match=r"^heading reaches 90, beyond 4 pi; expected radians") as caught:
        OF_HEADINGS[name]([0.0, -90.0])
    assert len(caught) == 1
    assert caught[0].filename == __file__


@pytest.mark.parametrize("name", OF_HEADINGS)
def test_headings_of_up_to_two_turns_are_radians(name, recwarn):
    OF_HEADINGS[name]([0.0, 4 * math.pi])
    OF_HEADINGS[name]([0.0, -4 * math.pi])
    assert not recwarn


# ---- what is returned


def test_a_measure_is_a_float_of_which_copies_and_results_are_plain():
    found = polarization([0.0, 0.0, np.nan])
    assert (found, repr(found), str(found), f"{found:.2f}") == (1.0, "1.0 (1 missing)", "1.0", "1.00")
    assert repr(polarization([0.0])) == "1.0"
    for plain in (found + 0, copy.copy(found), copy.deepcopy(found), pickle.loads(pickle.dumps(found))):
        assert (type(plain), plain) == (float, 1.0)
    assert repr(Measure(0.5, 1200, 3)) == "0.5 (1,200 missing, 3 outside)"


def test_measures_are_an_array_of_which_copies_and_results_are_plain():
    found = polarization([[0.0, 0.0], [0.0, np.nan]])
    assert repr(found) == "array([1., 1.]) (1 missing)"
    assert isinstance(found, np.ndarray)
    assert type(2 * found) is np.ndarray
    assert type(found.sum()) is np.float64
    assert (found[1:].missing, repr(found[1:])) == (None, "array([1.])")
    assert type(pickle.loads(pickle.dumps(found))) is np.ndarray
    assert type(Measures.of([1, 2], 0)) is Measures


class Measured(SwarmModel):
    """Stores and collects a measure that leaves a robot out."""

    def __init__(self, *, missing: int = 1, rng=None):
        super().__init__(rng=rng, model_reporters={"order": lambda model: model.order})
        self.heading, self.missing = 0.0, missing

    def step(self):
        super().step()
        self.heading += 0.1
        self.state["order"] = self.order

    @property
    def order(self):
        """A measure of headings, of which some are missing."""
        return polarization([0.0, self.heading, *[np.nan] * self.missing])


def test_a_model_stores_a_measure_as_the_float_that_it_is(tmp_path):
    model = Measured(rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=5):
        model.run(10)
    again = Measured.resume(tmp_path / "run.arrow", step=5)
    assert again.state["order"] == model.datacollector.model_vars["order"][5] != 1.0
    assert again.run(5).state_hash() == model.state_hash()
    plain = Measured(rng=1, missing=0).run(10)
    assert {type(value) for value in model.datacollector.model_vars["order"]} == {float}
    assert model.state_hash() == plain.state_hash()
    assert model.run(1).state_hash() != model.run(1).state_hash()
    other = Measured(rng=1).run(10)
    other.state["order"] = other.state["order"] / 2
    assert other.state_hash() != plain.state_hash()


def test_positions_and_headings_of_other_rows_are_refused():
    with pytest.raises(InvalidValueError, match=r"^heading is of rows and robots \(2, 3\); expected \(3, 2\)"):
        milling(np.zeros((3, 2, 2)), np.zeros((2, 3)))
