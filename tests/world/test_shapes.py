"""Shapes: what is accepted, what is refused, and when two are equal."""

import copy
import json
import math
import pickle
from dataclasses import asdict, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.world.shapes import MOST_VERTICES, disc, polygon, rectangle, shape_from_json, shape_to_json
from support.pace import work_within

WRONG_NUMBERS = [math.nan, math.inf, -math.inf, 2e9, 10**400, "1", None, True, [1]]
coordinates = st.floats(-1e9, 1e9)


@pytest.mark.parametrize("wrong", WRONG_NUMBERS)
def test_no_shape_takes_a_coordinate_that_is_not_a_finite_number(wrong):
    for make in (
        lambda: disc((wrong, 0), 1),
        lambda: rectangle((0, wrong), (1, 1)),
        lambda: polygon([(0, 0), (1, wrong), (2, 2)]),
    ):
        with pytest.raises(InvalidValueError, match="point"):
            make()


@pytest.mark.parametrize("wrong", [0, -5, math.nan, math.inf, "5", pytest.param(1 << 20_000, id="a huge integer")])
def test_a_disc_needs_a_finite_radius_above_zero(wrong):
    with pytest.raises(InvalidValueError, match="radius is"):
        disc((0, 0), wrong)


@pytest.mark.parametrize("opposite", [(0, 10), (10, 0), (0, 0)])
def test_a_rectangle_without_area_is_refused(opposite):
    with pytest.raises(InvalidValueError, match="no area"):
        rectangle((0, 0), opposite)


@pytest.mark.parametrize(
    ("outline", "reason"),
    [
        ([(0, 0), (10, 10), (10, 0), (0, 10)], "not simple"),
        ([(0, 0), (10, 0), (10, 10), (20, 10), (10, 10), (0, 10)], "not simple"),
        ([(0, 0), (5, 0), (10, 0)], "not simple"),
        ([(0, 0), (1, 1)], "fewer than 3"),
        ([], "fewer than 3"),
        (5, "expected a list of points"),
        ("abc", "expected two numbers"),
    ],
)
def test_bow_ties_spikes_and_flat_outlines_are_refused(outline, reason):
    with pytest.raises(InvalidValueError, match=reason):
        polygon(outline)


def test_a_hole_outside_its_outline_is_refused():
    with pytest.raises(InvalidValueError, match="not simple"):
        polygon([(0, 0), (1, 0), (0, 1)], [[(5, 5), (6, 5), (5, 6)]])


def test_holes_that_are_no_list_are_refused():
    with pytest.raises(InvalidValueError, match="list of outlines"):
        polygon([(0, 0), (1, 0), (0, 1)], 3)


def test_a_polygon_of_a_hundred_thousand_corners_is_made_within_a_second():
    angles = np.linspace(0, 2 * math.pi, 100_000, endpoint=False)
    with work_within(1):
        shape = polygon(np.column_stack([np.cos(angles), np.sin(angles)]))
    assert shape.geometry.area == pytest.approx(math.pi)


def test_an_endless_outline_is_refused_before_it_fills_the_memory():
    with pytest.raises(InvalidValueError, match="more than"):
        polygon((float(i), float(i % 7)) for i in range(MOST_VERTICES + 2))


@given(coordinates, coordinates, coordinates, coordinates)
def test_a_rectangle_is_the_same_from_any_two_opposite_corners(x0, y0, x1, y1):
    if (x1 - x0) * (y1 - y0) == 0:
        return
    one = rectangle((x0, y0), (x1, y1))
    other = rectangle((x1, y0), (x0, y1))
    assert one == other
    assert hash(one) == hash(other)
    assert one.kind == "rectangle"


@given(st.integers(0, 3), st.booleans())
def test_a_polygon_is_the_same_from_any_corner_and_either_way_round(shift, backwards):
    outline = [(0, 0), (10, 0), (10, 5), (0, 8)]
    turned = outline[shift:] + outline[:shift]
    assert polygon(turned[::-1] if backwards else turned) == polygon(outline)


def test_minus_zero_and_zero_make_equal_shapes():
    assert disc((-0.0, 0.0), 1) == disc((0.0, -0.0), 1)


def test_a_mark_differs_from_an_obstacle_of_the_same_shape():
    assert disc((0, 0), 1) != disc((0, 0), 1, contact=False)


def test_a_polygon_whose_outline_is_a_box_counts_as_a_rectangle():
    assert polygon([(0, 0), (4, 0), (4, 2), (0, 2)]) == rectangle((0, 0), (4, 2))


def test_the_bounds_and_the_position_of_a_shape_are_those_of_its_body():
    assert disc((3, -4), 5).bounds == (-2, -9, 8, 1)
    assert disc((3, -4), 5).position.tolist() == [3, -4]
    corner = polygon([(0, 0), (6, 0), (0, 9)])
    assert corner.bounds == (0, 0, 6, 9)
    assert corner.position == pytest.approx([2, 3])
    assert not corner.is_disc
    assert corner != "a corner"
    assert len({disc((0, 0), 1), disc((0, 0), 2), disc((0, 0), 1, contact=False), disc((0, 0), 1)}) == 3


@given(st.integers(3, 9), st.floats(-100, 100), st.floats(0.5, 50), st.booleans(), st.booleans())
def test_a_shape_that_went_through_json_is_equal(n, x, size, has_hole, contact):
    turn = 2 * math.pi * np.arange(n) / n
    ring = size * np.column_stack([np.cos(turn), np.sin(turn)]) + (x, -x)
    made = polygon(ring, [0.5 * (ring - (x, -x)) + (x, -x)] if has_hole else [], contact=contact)
    for shape in (made, disc((x, 2 * x), size, contact=contact)):
        text = json.dumps(shape_to_json(shape))
        assert shape_from_json(json.loads(text)) == shape
        assert ("mark" in text) is not contact


def test_a_closed_outline_is_that_without_its_last_point_and_holes_too():
    outline, hole = [(0, 0), (10, 0), (10, 9), (0, 9)], [(1, 1), (2, 1), (1, 2)]
    assert polygon([*outline, outline[0]]) == polygon(np.array(outline, float)) == polygon(outline)
    assert polygon([*outline, outline[0]], [[*hole, hole[0]]]) == polygon(outline, [hole])


@pytest.mark.parametrize("point", [("1", 2), (1, "2"), (True, 2), (1, False), (1,), (1, 2, 3), None, (1, None)])
def test_a_point_is_two_numbers_and_neither_text_nor_a_flag(point):
    with pytest.raises(InvalidValueError, match=r"centre has the point .*; expected two numbers \(x, y\)"):
        disc(point, 1)


@pytest.mark.parametrize("shape", [disc((1, 2), 3), rectangle((0, 0), (4, 2), contact=False)])
def test_what_was_computed_of_a_shape_is_stored_nowhere_and_copies_are_equal(shape):
    fresh = replace(shape)
    assert shape == fresh
    assert hash(shape) == hash(fresh)
    assert (shape.position == fresh.position).all()
    assert asdict(shape).keys() == {"geometry", "radius", "contact"}
    assert pickle.dumps(shape) == pickle.dumps(replace(shape))
    for copied in (copy.copy(shape), copy.deepcopy(shape), pickle.loads(pickle.dumps(shape))):
        assert copied == shape
        assert hash(copied) == hash(shape)
        assert (copied.position == shape.position).all()
