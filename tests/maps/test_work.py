"""Counting work before it is done: pairs of boxes, crossings and sides of lines, against the obvious ways."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.maps import map_parts
from mesa_swarm.maps.map_parts import Work
from mesa_swarm.maps.svg import chord_count, elliptic_arc, path_words, subpaths

seeds = st.integers(0, 2**32 - 1)
lattices = st.lists(st.tuples(*[st.integers(0, 5)] * 4), min_size=1, max_size=12)


def pairs_that_touch(boxes):
    """Return the pairs of boxes that touch, each both ways and each box with itself, by all pairs."""
    low, high = boxes[:, :2], boxes[:, 2:]
    return np.argwhere(((low[:, None] <= high) & (low <= high[:, None])).all(axis=2)).tolist()


@pytest.mark.parametrize("limits", [(1_000_000, 100_000), (40, 7), (1, 1)])
@pytest.mark.parametrize("n", [0, 1, 30])
def test_pairs_of_boxes_that_touch_are_found_whole_in_parts_of_a_bounded_size(n, limits, monkeypatch):
    monkeypatch.setattr(map_parts, "MOST_PAIRS_AT_ONCE", limits[0])
    monkeypatch.setattr(map_parts, "ENOUGH_PAIRS", limits[1])
    corners = np.random.default_rng(n).integers(0, 12, (n, 2))
    boxes = np.hstack([corners, corners + np.random.default_rng(1).integers(0, 4, (n, 2))]).astype(float)
    parts = list(map_parts._list_touching(boxes))
    assert all(len(one) == len(other) <= limits[1] for one, other in parts)
    found = [[int(i), int(j)] for part in parts for i, j in zip(*part, strict=True)]
    assert sorted(found) == pairs_that_touch(boxes)


@given(lattices)
def test_the_pairs_that_touch_are_no_more_than_those_that_overlap_in_x_or_in_y(corners):
    table = np.array(corners, float)
    boxes = np.hstack([np.minimum(table[:, :2], table[:, 2:]), np.maximum(table[:, :2], table[:, 2:])])
    n, along = len(boxes), []
    for low, high in ((0, 2), (1, 3)):
        near = (boxes[:, None, low] <= boxes[:, high]) & (boxes[:, low] <= boxes[:, None, high])
        along.append((np.count_nonzero(near) - n) // 2)
    assert map_parts._most_pairs(boxes) == min(along)


@given(lattices, lattices)
def test_edges_cross_or_touch_where_shapelys_do_unless_they_are_points_or_on_one_line(one, other):
    count = min(len(one), len(other))
    a, b = np.array(one[:count], float), np.array(other[:count], float)
    lines = [[shapely.LineString(row.reshape(2, 2)) for row in rows] for rows in (a, b)]
    area = [
        shapely.MultiPoint(np.concatenate([p, q]).reshape(4, 2)).convex_hull.area for p, q in zip(a, b, strict=True)
    ]
    keep = [k for k in range(count) if area[k] > 0 and min(lines[0][k].length, lines[1][k].length) > 0]
    expected = sum(lines[0][k].intersects(lines[1][k]) for k in keep)
    assert map_parts._crossings(a[keep], b[keep]) == expected


def test_the_sides_of_a_line_are_half_its_width_away_on_either_side():
    at = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 0.0], [10.0, 20.0]])
    sides = map_parts._sides(at, 2.0)
    assert sides.tolist() == [
        *([0, 2, 10, 2], [10, 2, 8, 0], [8, 0, 8, 20]),
        *([0, -2, 10, -2], [10, -2, 12, 0], [12, 0, 12, 20]),
    ]


def zigzag(n, gap):
    """Return an outline of n teeth, so far apart."""
    x = gap * np.arange(n)
    return np.vstack([np.column_stack([x, np.arange(n) % 2]), [[x[-1], -9], [0, -9]]])


def test_an_outline_costs_more_the_more_corners_and_holes_it_has_and_the_nearer_they_are():
    def cost(rings, **options):
        work = Work(10)
        before = work.left
        work.spend_on_outlines(rings, **options)
        return before - work.left

    far = zigzag(3000, 10.0)
    # Each slanted tooth lies over the next two.
    near = far + np.column_stack([25.0 * far[:, 1], np.zeros(len(far))])
    assert cost([far]) < cost([near])
    assert cost([near], are_apart=True) == cost([far], are_apart=True) < cost([far])
    assert cost([far[:100]]) < cost([far])
    hole = np.array([[1.0, -5], [2, -5], [1, -4]])
    assert cost([far[:100]]) < cost([far[:100], hole]) < cost([far[:100], hole, hole + 5])


def test_a_shape_may_not_use_up_the_work_of_a_whole_large_file():
    teeth = np.column_stack([np.arange(6000) * 1e-3, 50.0 * (np.arange(6000) % 2)])
    slanted = teeth + np.column_stack([teeth[:, 1], np.zeros(6000)])
    with pytest.raises(InvalidValueError, match="come near each other too often"):
        Work(10**9).spend_on_outlines([slanted])


@given(st.floats(0.5, 300), st.floats(0.5, 300), st.floats(-3, 3), st.floats(0.2, 6.2), st.floats(0.01, 1))
def test_an_arc_strays_no_farther_than_the_tolerance_and_has_no_more_chords_than_about_needed(a, b, start, sweep, off):
    at = elliptic_arc((7, -3), (a, b), start, sweep, off)
    t = start + np.linspace(0, sweep, 400)
    truth = np.column_stack([7 + a * np.cos(t), -3 + b * np.sin(t)])
    assert at[0] == pytest.approx(truth[0])
    assert at[-1] == pytest.approx(truth[-1])
    assert shapely.distance(shapely.points(truth), shapely.LineString(at)).max() <= off * (1 + 1e-6)
    # A chord of a circle of the larger radius strays by at most its sagitta.
    needed = sweep / (2 * math.acos(max(1 - off / max(a, b), -1)))
    assert len(at) - 1 <= max(1.2 * needed + 1, math.ceil(sweep))


@given(*[st.floats(-50, 50)] * 6, st.floats(0.01, 1))
def test_bezier_curves_stray_no_farther_than_the_tolerance(a, b, c, d, e, f, off):
    texts = f"M 0 0 C {a} {b} {c} {d} {e} {f}", f"M 0 0 Q {a} {b} {e} {f}"
    t = np.linspace(0, 1, 300)[:, None]
    cubic = 3 * (1 - t) ** 2 * t * [a, b] + 3 * (1 - t) * t**2 * [c, d] + t**3 * [e, f]
    square = 2 * (1 - t) * t * [a, b] + t**2 * [e, f]
    for text, truth in zip(texts, (cubic, square), strict=True):
        for _, at in subpaths(text, off):
            far = shapely.distance(shapely.points(truth), shapely.LineString(at)).max()
            assert far <= off * (1 + 1e-6)
            bend = 6 * max(math.hypot(c - 2 * a, d - 2 * b), math.hypot(a - 2 * c + e, b - 2 * d + f)) + 1
            assert len(at) - 1 <= math.ceil(math.sqrt(bend / 8 / off)) + 1 or text.count("Q")


def test_a_fraction_of_a_chord_is_a_whole_one():
    assert [chord_count(number) for number in (0.0, 0.3, 1.0, 1.001, 7.5)] == [1, 1, 1, 2, 8]


def test_words_of_a_path_are_counted_but_not_those_of_straight_ones():
    assert path_words("M 0 0 L 10.5 -2 z") == 7
    assert path_words("M0,0 1,0 1,1Z") == 0
    assert path_words("M" + " " * 800_001) == 800_002
