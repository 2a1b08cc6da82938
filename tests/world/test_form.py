"""The form of a load: where its pose puts it, and the mean distance of its points from its centre."""

import math

import numpy as np
import pytest
import shapely

from mesa_swarm import disc, polygon, rectangle
from mesa_swarm.world.bodies import Form, mean_distance


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
