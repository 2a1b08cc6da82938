"""Limits and defaults of the measures: what is documented is accepted, and what is beyond it refused."""

import inspect
from dataclasses import fields

import numpy as np
import pytest

from mesa_swarm.analysis import (
    chains,
    clusters,
    collision_frequency,
    find_pathologies,
    follow_chains,
    later_mean,
    layer_shares,
    reachable_cells,
    time_to,
    visited_cells,
)
from mesa_swarm.analysis.arrays import check_bounds, check_flags, check_length, check_points, check_steps, check_whole
from mesa_swarm.analysis.chain_history import ChainEvent, Meetings
from mesa_swarm.analysis.chains import Links, nearest_ahead
from mesa_swarm.analysis.pathology import Thresholds
from mesa_swarm.base.errors import InvalidValueError
from support.tracks import still


def defaults(function):
    """Return the defaults of a function's parameters."""
    parameters = inspect.signature(function).parameters.items()
    return {name: p.default for name, p in parameters if p.default is not inspect.Parameter.empty}


def test_the_defaults_of_the_parts_are_those_of_the_functions():
    assert {field.name: field.default for field in fields(Thresholds)} == defaults(find_pathologies)
    following, links = defaults(follow_chains), defaults(chains)
    assert {name: following[name] for name in links} == links
    assert defaults(Links) == links
    own = {"distance": "meeting_distance", "angle_degrees": "meeting_angle_degrees"}
    assert {own.get(name, name): value for name, value in defaults(Meetings).items()} == {
        name: following[name] for name in following.keys() - links.keys() - {"reversal_distance"}
    }


CHAIN_LIMITS = {
    "link_distance": ((1e-9, 1e9), (0, 1.1e9)),
    "half_angle_degrees": ((0, 180), (-1e-9, 180.001)),
    "alignment_degrees": ((1e-9, 180), (0, 180.001)),
    "patience": ((1, 10**9), (0, 1.5)),
    "window": ((0, 10**9), (-1, 0.5)),
    "meeting_distance": ((1e-9, 75), (0, 75.001)),
    "meeting_angle_degrees": ((0, 90), (-1e-9, 90.001)),
    "parting_distance": ((50, 1e9), (49.999, 1.1e9)),
    "reversal_distance": ((1e-9, 1e9), (0, 1.1e9)),
}


@pytest.mark.parametrize("name", CHAIN_LIMITS)
def test_parameters_of_chains_are_accepted_up_to_their_limits_and_refused_beyond(name):
    (right, wrong), nothing = CHAIN_LIMITS[name], (np.zeros((0, 2, 2)), np.zeros((0, 2)), [])
    for value in right:
        follow_chains(*nothing, **{"link_distance": 15, name: value})
    for value in wrong:
        with pytest.raises(InvalidValueError, match="parting_distance is" if value == 75.001 else f"^{name} is"):
            follow_chains(*nothing, **{"link_distance": 15, name: value})


PATHOLOGY_LIMITS = {
    **dict.fromkeys(("near", "gap"), ((0, 1e9), (-1e-9, 1.1e9))),
    **dict.fromkeys(("window", "fewest_flips", "fewest_steps"), ((2, 10**6), (1, 2.5))),
    **dict.fromkeys(("slow_share", "stuck_share", "forward_share"), ((1e-9, 1), (0, 1.001))),
    **dict.fromkeys(("turned_degrees", "facing_degrees"), ((0, 180), (-1e-9, 180.001))),
}


@pytest.mark.parametrize("name", PATHOLOGY_LIMITS)
def test_thresholds_are_accepted_up_to_their_limits_and_refused_beyond(name):
    right, wrong = PATHOLOGY_LIMITS[name]
    for value in right:
        find_pathologies(**still(), **{name: value})
    for value in wrong:
        with pytest.raises(InvalidValueError, match=f"^{name} is"):
            find_pathologies(**still(), **{name: value})


@pytest.mark.parametrize(
    ("right", "wrong", "words"),
    [
        (lambda: check_points("p", [[1e9, -1e9]]), lambda: check_points("p", [[0, -1.001e9]]), "p reaches 1.001e"),
        (lambda: check_length("d", 8**0.5 * 1e9), lambda: check_length("d", 8**0.5 * 1.001e9), "d is 2.83"),
        (lambda: check_bounds([0, 0, 1e-9, 1]), lambda: check_bounds([1, 0, 1, 1]), "bounds is"),
        (lambda: check_bounds([0, 0, 1, 1e-9]), lambda: check_bounds([0, 1, 1, 1]), "bounds is"),
        (lambda: check_bounds([-2, -2, -1, -1]), lambda: check_bounds([0, 1, 1, 0]), "bounds is"),
        (lambda: check_whole("w", [-2.0, 2], ("n",)), lambda: check_whole("w", [-1.5, 2], ("n",)), "w holds fractions"),
        (lambda: check_steps([-3, -2, 7]), lambda: check_steps([3, 2, 7]), "steps do not ascend"),
        (lambda: check_flags("f", [0, 1], ("n",)), lambda: check_flags("f", [0, -1], ("n",)), "f is an array of int"),
        (lambda: check_flags("f", [True], ("n",)), lambda: check_flags("f", ["1"], ("n",)), "f is an array of <U1"),
        (lambda: later_mean([1, 2], 1), lambda: later_mean([1, 2], 1.001), "share is"),
        (lambda: later_mean([1, 2], 1e-9), lambda: later_mean([1, 2], 0), "share is"),
        (lambda: layer_shares([[999]], 1000), lambda: layer_shares([[0]], 1001), "layers is 1001"),
        (lambda: layer_shares([[-1]], 1), lambda: layer_shares([[1]], 1), "layer holds 1"),
        (lambda: time_to([1, 2], 1, steps=[-5, 5]), lambda: time_to([1, 2], 1, steps=[0, 0.5]), "ascending whole"),
        (lambda: clusters([[0, 0]], 1, fewest=1), lambda: clusters([[0, 0]], 8**0.5 * 1.001e9), "distance is"),
        (
            lambda: visited_cells([[1, 1]], (0, 0, 2, 2), (1000, 1)),
            lambda: visited_cells([[1, 1]], (0, 0, 2, 2), (1, 1001)),
            "shape' columns is 1001",
        ),
        (
            lambda: reachable_cells((0, 0, 9, 9), [], 1, (4, 4), (1, 1), fewest_share=0.0),
            lambda: reachable_cells((0, 0, 9, 9), [], 1, (4, 4), (1, 1), fewest_share=0.991),
            "fewest_share is",
        ),
    ],
)
def test_values_are_accepted_up_to_their_limits_and_refused_beyond(right, wrong, words):
    right()
    with pytest.raises(InvalidValueError) as caught:
        wrong()
    assert words in str(caught.value)


@pytest.mark.parametrize("along", [0, 1])
@pytest.mark.parametrize("end", [0, 1])
def test_a_position_may_lie_beyond_the_border_by_a_millionth_of_the_longer_side(along, end):
    point = np.array([25.0, 10.0])
    for hairs, accepted in ((0.99, True), (1.01, False)):
        point[along] = [(0, 0), (50, 20)][end][along] + (2 * end - 1) * hairs * 50e-6
        if accepted:
            assert visited_cells([point], (0, 0, 50, 20), (2, 2)).sum() == 1
        else:
            with pytest.raises(InvalidValueError, match="expected points within the bounds"):
                visited_cells([point], (0, 0, 50, 20), (2, 2))


def test_collisions_are_smoothed_over_1001_steps_unless_asked_otherwise():
    collided = np.random.default_rng(1).random((3000, 2)) < 0.1
    assert (collision_frequency(collided) == collision_frequency(collided, 1001)).all()
    assert later_mean([0, 0, 0, 4, 8]) == 4.0


def test_cells_are_forty_by_forty_and_count_from_a_hundredth_unless_asked_otherwise():
    there = (0, 0, 100, 100), [], 2.4, (50, 50)
    assert (reachable_cells(*there) == reachable_cells(*there, (40, 40), fewest_share=0.01)).all()
    # Of a cell of 2.5 a strip of 0.1 is free: 4 % of it beside the border, 0.16 % in the corner.
    assert reachable_cells(*there)[0].tolist() == [False, *[True] * 38, False]


def test_groups_have_two_robots_or_more_unless_asked_otherwise():
    assert clusters([[0, 0], [1, 0], [9, 0]], 2).sizes.tolist() == [2]


def test_robots_that_are_exactly_at_the_reach_or_the_half_angle_are_ahead():
    place = np.array([[0.0, 0.0], [3.0, 4.0]])
    assert nearest_ahead(place, np.zeros(2), 5.0, 90.0)[0].tolist() == [1, -1]
    assert nearest_ahead(place, np.zeros(2), np.nextafter(5.0, 0.0), 90.0)[0].tolist() == [-1, -1]
    assert nearest_ahead(np.array([[0.0, 0.0], [0.0, 4.0]]), np.zeros(2), 5.0, 180.0)[0].tolist() == [1, 0]


def test_events_are_ordered_by_step_then_kind_then_robots():
    made = [
        ChainEvent(kind=kind, step=step, robots=robots, chains=())
        for step in (2, 10)
        for kind in ("birth", "end", "merge", "split", "reversal", "meeting")
        for robots in ((0, 3), (2, 1))
    ]
    assert sorted(made[::-1], key=lambda event: event.order) == made
