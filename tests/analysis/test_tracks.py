"""Stretches of steps with a property, and events of chains: the parts of which analyses over time are made."""

import numpy as np
import pytest

from mesa_swarm.analysis import ChainEvent
from mesa_swarm.analysis.arrays import check_array, check_bounds, check_length, check_points, check_steps, check_whole
from mesa_swarm.analysis.chain_history import (
    Lineage,
    Meetings,
    distances,
    facing_pairs,
    first_run,
    meeting_event,
    settle_links,
    turning_points,
)
from mesa_swarm.analysis.chains import nearest_ahead, paths
from mesa_swarm.analysis.pathology import (
    ROBOT,
    Track,
    find_lasting,
    find_runs,
    flips_of,
    last_before,
    look_up_step,
    mark_steps,
)


def column(*values):
    return np.array(values)[:, None]


def test_arrays_at_the_border_get_their_types():
    assert check_array("position", [[1, 2], [3, 4]], ("n", 2)).dtype == float
    assert check_points("position", [[1, 2]]).tolist() == [[1.0, 2.0]]
    assert [check_whole("layer", [0.0, -1.0], ("k",)).dtype, check_steps([1, 2, 5]).dtype] == [np.int64] * 2
    assert check_bounds([0, 0, 800, 600]) == (0.0, 0.0, 800.0, 600.0)
    assert check_length("distance", 20) == 20.0


def test_the_last_sign_before_a_step_is_that_of_another_step_that_is_not_zero():
    assert last_before(column(1, 0, -1)).ravel().tolist() == [-1, 0, 0]
    assert look_up_step(column(1, 2), column(1, 0)).ravel().tolist() == [2, 1]


def test_a_sign_flips_where_the_last_one_was_the_opposite():
    assert flips_of(column(1, 0, -1, -1, 1)).ravel().tolist() == [False, False, True, False, True]


def test_stretches_are_covered_and_found_again():
    mask = mark_steps((4, 1), np.array([0]), np.array([1]), np.array([2]))
    assert mask.ravel().tolist() == [False, True, True, False]
    assert find_runs(mask) == [(0, 1, 2)]
    assert find_runs(column(True, True, False, True)) == [(0, 0, 1), (0, 3, 3)]


def test_lasting_stretches_begin_after_step_zero():
    assert find_lasting(np.ones((4, 1), bool), 2)[0].tolist() == [1, 2]
    assert len(find_lasting(np.ones((2, 1), bool), 2)[0]) == 0


def test_a_track_reads_near_bodies_by_the_sensor_on_that_side():
    track = Track(
        steps=[1], position=[[[0, 0]]], heading=[[0]], command=[[[1, 0]]], layer=[[0]], distance=[[[9]]],
        kind=[[[ROBOT]]], radius=[5], max_speed=[1], forward=[[0, -1, -1]],
    )  # fmt: skip
    assert track.turn.tolist() == [[-1.0]]
    assert [track.reads((ROBOT,), 20.0, which).item() for which in range(3)] == [True, False, False]
    assert not track.reads((ROBOT,), 9.0, 0).any()


def test_a_chain_that_comes_again_in_the_opposite_order_is_a_birth_and_then_a_reversal():
    lineage, place = Lineage(window=100), np.zeros((2, 2))
    for step, leader, kind in ((5, [-1, 0], "birth"), (6, [1, -1], "reversal")):
        (event,) = lineage.advance(step, step - 1, paths(np.array(leader), place))
        assert event.kind == kind


def test_robots_that_part_after_a_meeting_have_dispersed():
    position = np.array([[[0.0, 0], [40, 0]], [[0, 0], [20, 0]], [[0, 0], [90, 0]]])
    assert Meetings().outcome((1, 0, 1), np.arange(3), position, np.full((3, 2), -1)) == "dispersed"


def test_a_pair_faces_each_other_only_without_a_robot_between():
    position, heading = np.array([[0.0, 0], [30, 0], [45, 0]]), np.array([0.0, np.pi, np.pi])
    assert facing_pairs(position, heading, 50.0, 20.0).tolist() == [[0, 1]]
    assert distances(position, np.array([[0, 2]])).tolist() == [45.0]


def test_the_nearest_robot_ahead_has_its_row_and_distance():
    nearest, gap = nearest_ahead(np.array([[0.0, 0], [10, 0]]), np.zeros(2), 15.0, 45.0)
    assert (nearest.tolist(), gap.tolist()) == ([1, -1], [10.0, np.inf])


def test_a_ring_is_closed():
    place = np.array([[0.0, 0], [1, 0], [1, 9], [5, 5]])
    assert paths(np.array([1, 2, 0, -1]), place).closed.tolist() == [True]


@pytest.mark.parametrize(("length", "first"), [(1, 0), (2, 2), (3, 4), (5, 4)])
def test_the_first_run_is_the_first_that_is_long_enough(length, first):
    assert first_run(np.array([True, False, True, True]), length) == first


def test_a_meeting_names_the_chains_of_its_robots():
    event = meeting_event((0, 0, 1), np.array([7]), np.array([[4, -1]]))
    assert event == ChainEvent(kind="meeting", step=7, robots=(0, 1), chains=(4,))


def test_links_that_flicker_are_settled():
    assert settle_links(column(-1, 0, 0, -1, 0, -1, -1), 2).ravel().tolist() == [-1, 0, 0, 0, 0, -1, -1]


def test_a_way_turns_where_it_then_goes_far_enough_back():
    assert turning_points(np.array([0.0, 5, 9, 8, 9, 2, 0, 6]), 4.0) == [4, 6]
