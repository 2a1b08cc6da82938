"""The form of a load: where its pose puts it, and the mean distance of its points from its centre."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import disc, polygon, rectangle
from mesa_swarm.world.bodies import Form, mean_distance
from support.scenes import empty
from support.tables import farthest_from, put


def test_a_form_is_at_its_pose():
    form = Form.of(polygon([(0, 0), (30, 0), (0, 30)]))
    turned = form.shape_at((100.0, 50.0, math.pi / 2)).geometry.exterior.coords
    assert sorted(np.round(turned[:-1], 9).tolist()) == [[80.0, 40.0], [110.0, 40.0], [110.0, 70.0]]


# ---- the mean distance of a body's points from its centre


@pytest.mark.parametrize(("a", "b"), [(1, 1), (40, 100), (3, 500)])
def test_the_mean_distance_of_a_rectangle_is_the_closed_form(a, b):
    d = math.hypot(a, b)
    closed = d / 6 + a**2 / (12 * b) * math.log((b + d) / a) + b**2 / (12 * a) * math.log((a + d) / b)
    shape = rectangle((-a / 2, -b / 2), (a / 2, b / 2))
    assert mean_distance(shape.geometry, 0.0) == pytest.approx(closed, rel=1e-12)


def test_the_mean_distance_of_a_disc_is_two_thirds_of_its_radius_and_a_polygon_tends_to_it():
    azimuth = np.linspace(0, 2 * math.pi, 2000, endpoint=False)
    rim = polygon(30 * np.column_stack([np.cos(azimuth), np.sin(azimuth)]))
    assert mean_distance(disc((0, 0), 30).geometry, 30.0) == pytest.approx(20.0)
    assert mean_distance(rim.geometry, 0.0) == pytest.approx(20.0, rel=1e-5)


def test_the_mean_distance_of_a_concave_polygon_with_a_hole_is_what_a_sum_over_a_raster_gives():
    star = polygon([(-30, -20), (40, -25), (5, 0), (30, 30), (-20, 25)], [[(-15, -5), (-5, -5), (-10, 5)]]).geometry
    x, y = np.meshgrid(np.arange(-30, 40, 0.1) + 0.05, np.arange(-25, 30, 0.1) + 0.05)
    inside = shapely.contains_xy(star, x, y)
    assert mean_distance(star, 0.0) == pytest.approx(np.hypot(x, y)[inside].mean(), rel=1e-3)


L_SHAPE = polygon([(0, 0), (40, 0), (40, 10), (10, 10), (10, 60), (0, 60)])


@pytest.mark.parametrize("shape", [L_SHAPE, rectangle((-3, 2), (77, 22)), disc((9, -4), 6)])
def test_a_form_is_about_its_centre_with_a_thin_skin_around_its_core_and_a_thicker_one_around_its_heart(shape):
    form = Form.of(shape)
    corners = shapely.get_coordinates(shape.geometry) - shape.position
    assert form.reach == pytest.approx(np.hypot(*corners.T).max() + shape.radius)
    inner = shapely.maximum_inscribed_circle(shape.geometry).length if not shape.is_disc else 6.0
    assert form.thickness == pytest.approx(inner)
    assert form.lever == pytest.approx(mean_distance(form.outline, shape.radius))
    assert np.allclose(shapely.get_coordinates(form.outline), corners)
    if shape.is_disc:
        assert (form.radius, form.core_radius) == (6.0, pytest.approx(6.0 * (1 - 1e-9), abs=1e-12))
        assert form.core.equals(form.outline)
        assert form.heart.equals(form.outline)
        return
    assert (form.radius, form.core_radius) == (0.0, 0.0)
    # Corners stay corners, and every side is that far inside.
    for part, depth in ((form.core, 1e-9 * inner), (form.heart, 1e-3 * inner)):
        assert len(part.exterior.coords) == len(form.outline.exterior.coords)
        assert form.outline.exterior.distance(part) == pytest.approx(depth, rel=1e-3)


@pytest.mark.parametrize("shape", [disc((0, 0), 5), rectangle((-5, -5), (5, 5))])
def test_a_body_overlaps_from_more_than_rounding_on_and_is_within_a_map_up_to_its_border(shape):
    form = Form.of(shape)
    wall, ball = rectangle((20, -50), (30, 50)), disc((28, 0), 8)
    for other in (wall, ball):
        assert not form.overlaps((15.0, 0.0, 0.0), other)
        assert form.overlaps((15.0 + 1e-7, 0.0, 0.0), other)
    bounds = (-100.0, -60.0, 100.0, 60.0)
    for sign in (1, -1):
        for x, y in ((95, 0), (0, 55)):
            assert form.is_within((sign * x, sign * y, 0.0), bounds)
            more = 1 + 1e-6
            assert not form.is_within((sign * x * more, sign * y * more, 0.0), bounds)


@given(*[st.floats(-50, 50)] * 4, *[st.floats(-4, 4)] * 2)
def test_no_point_of_a_load_is_farther_from_where_it_was_than_the_bound(x, y, p, q, heading, turned):
    load = empty().add_load(L_SHAPE, resistance=1)
    load.move_to((200 + x, 150 + y, heading))
    assert -math.pi <= load.heading < math.pi
    there = (200 + p, 150 + q, turned)
    moved = shapely.get_coordinates(load.form.body_at(load.pose).geometry)
    away = np.hypot(*(moved - shapely.get_coordinates(load.form.body_at(there).geometry)).T).max()
    bound = farthest_from(load, there)
    assert away <= bound + 1e-9
    if (x, y) == (p, q):
        assert bound == pytest.approx(away, abs=1e-6)


def test_the_bound_is_met_by_a_load_that_turns_on_the_spot_or_moves_without_turning():
    load = empty().add_load(L_SHAPE, resistance=1)
    x, y, _ = load.pose
    put(load, (x, y, 1.0))
    assert farthest_from(load, (x, y, -0.5)) == pytest.approx(2 * math.sin(0.75) * load.form.reach)
    assert farthest_from(load, (x + 3, y - 4, 1.0)) == pytest.approx(5.0)


def test_the_former_name_of_move_to_warns_on_the_line_that_calls_it():
    load = empty().add_load(L_SHAPE, resistance=1)
    with pytest.warns(DeprecationWarning, match="move_to now") as caught:
        load.lay((50.0, 60.0, 0.5))
    assert [warning.filename for warning in caught] == [__file__]
    assert (load.pose, load.position.tolist()) == ((50.0, 60.0, 0.5), [50.0, 60.0])
