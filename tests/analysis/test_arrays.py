"""What is refused at the border, in words that name the argument."""

import numpy as np
import pytest

from mesa_swarm.analysis import (
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
    layer_shares,
    milling,
    nearest_neighbour_distances,
    polarization,
    random_nearest_neighbour_distance,
    reachable_cells,
    time_to,
    visited_cells,
)
from mesa_swarm.analysis.arrays import check_flags
from mesa_swarm.base.errors import InvalidValueError

BOX = (0, 0, 100, 100)
PLACES = [[1.0, 2.0], [3.0, 4.0]]
OF_POINTS = {
    "clusters": lambda position: clusters(position, 10),
    "nearest_neighbour_distances": nearest_neighbour_distances,
    "clark_evans": lambda position: clark_evans(position, 100),
    "dispersion": dispersion,
    "milling": lambda position: milling(position, [0.0, 0.0]),
    "directions": lambda position: directions(PLACES, position),
    "visited_cells": lambda position: visited_cells(position, BOX, (2, 2)),
    "coverage": lambda position: coverage(position, [[True]], BOX),
}
NOT_POINTS = {
    "has the shape": [1.0, 2.0],
    "expected an array of shape": [[1.0, 2.0, 3.0], [1.0, 2.0, 3.0]],
    "is -inf at [0, 1]; expected finite": [[1.0, -np.inf], [1.0, 2.0]],
    "expected real numbers": [["a", "b"], ["c", "d"]],
    "complex128": [[1j, 1], [1, 1]],
    "at most 1e+09": [[1e300, 0], [0, 0]],
    "; expected an array": [[1.0, 2.0], [3.0]],
}


@pytest.mark.parametrize("words", NOT_POINTS)
@pytest.mark.parametrize("name", OF_POINTS)
def test_what_is_not_a_list_of_finite_points_is_refused_in_one_line(name, words):
    with pytest.raises(InvalidValueError) as caught:
        OF_POINTS[name](NOT_POINTS[words])
    assert words in str(caught.value)
    assert str(caught.value).startswith("position")
    assert "\n" not in str(caught.value)


REFUSED = {
    "distance is 0": lambda: clusters(PLACES, 0),
    "distance is -1": lambda: clusters(PLACES, -1),
    "distance is nan": lambda: clusters(PLACES, np.nan),
    "fewest is 0": lambda: clusters(PLACES, 1, fewest=0),
    "fewest is 1.5": lambda: clusters(PLACES, 1, fewest=1.5),
    "area is 0": lambda: clark_evans(PLACES, 0),
    "area is -2": lambda: random_nearest_neighbour_distance(2, -2),
    "n is 0": lambda: random_nearest_neighbour_distance(0, 2),
    "heading has the shape (1, 1, 2); expected an array of shape (n,) or (k, n)": lambda: polarization([[[0, 1]]]),
    "heading is of rows and robots (2, 2); expected (2,)": lambda: milling(PLACES, [[0, 0], [0, 0]]),
    "position has the shape (1, 2, 2); expected one moment, (n, 2): [clusters(row": lambda: clusters([PLACES], 10),
    "position has the shape (1, 2, 2); expected one moment, (n, 2): follow_chains": lambda: chains(
        [PLACES], [[0, 0]], link_distance=10
    ),
    "heading holds an infinity": lambda: polarization([0, np.inf]),
    "heading has 3 robots; expected 2, as many as position": lambda: milling(PLACES, [0, 0, 0]),
    "position_after has 1 robots; expected 2": lambda: directions(PLACES, [[0, 0]]),
    "window is 10; expected an odd number of steps, which has a middle: 9 or 11": lambda: central_moving_average(
        [1, 2], 10
    ),
    "window is 0": lambda: central_moving_average([1, 2], 0),
    "window is 2": lambda: collision_frequency([[True]], 2),
    "values is inf at [1]; expected finite numbers, or NaN": lambda: central_moving_average([1, np.inf], 3),
    "steps is nan at [1]; expected finite numbers": lambda: time_to([1, 2], 1, steps=np.ma.array([1, 2], mask=[0, 1])),
    "bounds is nan at [3]": lambda: visited_cells(PLACES, np.ma.array(BOX, mask=[0, 0, 0, 1]), (2, 2)),
    "start is nan at [0]": lambda: reachable_cells(BOX, [], 5, np.ma.array([50, 50], mask=[1, 0])),
    "cells is NaN or masked at [0, 1]": lambda: coverage(PLACES, np.ma.array([[1, 1]], mask=[[0, 1]]), BOX),
    "neither position nor heading is given": count_missing,
    "position and heading are of robots (2,) and (3,)": lambda: count_missing(position=PLACES, heading=[0, 0, 0]),
    "collided has the shape (2,)": lambda: collision_frequency([True, False]),
    "collided has no robots": lambda: cumulative_collisions(np.empty((3, 0), bool)),
    "collided is an array of float64; expected booleans": lambda: cumulative_collisions([[0.5]]),
    "layer has no robots": lambda: layer_shares(np.empty((3, 0)), 2),
    "layer holds 2; expected whole numbers from -1 to 1": lambda: layer_shares([[0, 2]], 2),
    "layer holds -2": lambda: layer_shares([[0, -2]], 2),
    "layer holds 0.5": lambda: layer_shares([[0.5]], 2),
    "layers is 0": lambda: layer_shares([[0]], 0),
    "threshold is nan": lambda: time_to([1, 2], np.nan),
    "threshold has the shape (1,)": lambda: time_to([1, 2], [1]),
    "expected 2 ascending whole numbers": lambda: time_to([1, 2], 1, steps=[5, 5]),
    "steps are 1 numbers": lambda: time_to([1, 2], 1, steps=[5]),
    "bounds is [0, 0, 0, 5]": lambda: visited_cells(PLACES, [0, 0, 0, 5], (2, 2)),
    "bounds has the shape (3,)": lambda: visited_cells(PLACES, (0, 0, 5), (2, 2)),
    "shape is 40; expected two whole numbers": lambda: visited_cells(PLACES, BOX, 40),
    "shape' rows is 0": lambda: visited_cells(PLACES, BOX, (0, 40)),
    "cells' columns is 1000000000": lambda: reachable_cells(BOX, [], 5, (50, 50), (40, 10**9)),
    "expected points within the bounds": lambda: visited_cells([[101, 50]], BOX, (2, 2)),
    "cells has no reachable cell": lambda: coverage(PLACES, [[False]], BOX),
    "cells has the shape (1,)": lambda: coverage(PLACES, [True], BOX),
    "radius is 0": lambda: reachable_cells(BOX, [], 0, (50, 50)),
    "start has the shape (3,)": lambda: reachable_cells(BOX, [], 5, (50, 50, 1)),
    "start is (2, 50), where a robot of radius 5 does not fit": lambda: reachable_cells(BOX, [], 5, (2, 50)),
    "start is (50, 50), where a robot of radius 60": lambda: reachable_cells(BOX, [], 60, (50, 50)),
    "fewest_share is 1": lambda: reachable_cells(BOX, [], 5, (50, 50), fewest_share=1),
    "solids is 7; expected a list": lambda: reachable_cells(BOX, 7, 5, (50, 50)),
    "solids holds 7; expected pairs": lambda: reachable_cells(BOX, [7], 5, (50, 50)),
    "solids holds 'a'; expected valid Shapely": lambda: reachable_cells(BOX, [("a", 0)], 5, (50, 50)),
    "a solid's radius is -1": lambda: reachable_cells(BOX, [("a", -1)], 5, (50, 50)),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_is_out_of_range_is_refused_in_one_line(words):
    with pytest.raises(InvalidValueError) as caught:
        REFUSED[words]()
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_flags_may_be_zeros_and_ones():
    np.testing.assert_array_equal(check_flags("collided", np.array([[0.0, 1.0]]), ("k", "n")), [[False, True]])


def test_nothing_that_is_given_is_written_to():
    position, heading = np.random.default_rng(1).random((2, 9, 2))
    kept = position.copy(), heading.copy()
    clusters(position, 0.3)
    milling(position, heading[:, 0])
    directions(position, heading)
    visited_cells(position, BOX, (2, 2))
    central_moving_average(heading[:, 0], 3)
    np.testing.assert_array_equal((position, heading), kept)
