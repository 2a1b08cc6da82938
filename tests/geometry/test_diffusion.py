"""The closed forms and the laws of conservation that the scheme on the grid obeys, walls included."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm.geometry.diffusion import BLOCKED, EAST, NORTH, OPEN, SOUTH, WEST, block_disc, block_polygon, spread

FRAME = (0.0, 0.0, 1.0, 1.0)
SHARES = st.floats(0.0, 0.125)


def spread_over(values, x_share, y_share, remaining=1.0, sides=None, steps=1):
    sides = np.empty((0, 0), np.uint8) if sides is None else sides
    rows, columns = np.nonzero(sides & OPEN != OPEN)
    begins = np.searchsorted(rows, np.arange(len(values) + 1))
    for _ in range(steps):
        spread(values, x_share, y_share, remaining, sides, begins, columns.astype(np.int64))
    return values


def plainly_spread(values, x_share, y_share, remaining, sides):
    """The same cell by cell, as one would write it down."""
    new = values.copy()
    ways = ((EAST, 0, 1, x_share), (WEST, 0, -1, x_share), (NORTH, 1, 0, y_share), (SOUTH, -1, 0, y_share))
    for i, j in np.ndindex(values.shape):
        for way, up, right, share in ways:
            k, m = i + up, j + right
            if 0 <= k < len(values) and 0 <= m < values.shape[1] and sides[i, j] & way:
                new[i, j] += share * (values[k, m] - values[i, j])
    return new * remaining


def some_sides(shape, rng, discs=3):
    sides = np.full(shape, OPEN, np.uint8)
    for x, y, radius in rng.uniform((0, 0, 0.1), (shape[1], shape[0], 3), (discs, 3)):
        block_disc(sides, FRAME, x, y, radius)
    return sides


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.integers(1, 12), st.integers(1, 12), SHARES, SHARES, st.floats(0, 1))
def test_a_step_is_the_sum_of_what_flows_through_open_links(seed, rows, columns, x_share, y_share, remaining):
    rng = np.random.default_rng(seed)
    sides, values = some_sides((rows, columns), rng), rng.random((rows, columns))
    values[sides & BLOCKED > 0] = 0
    expected = plainly_spread(values, x_share, y_share, remaining, sides)
    np.testing.assert_allclose(
        spread_over(values, x_share, y_share, remaining, sides), expected, rtol=1e-13, atol=1e-15
    )


def test_the_variance_of_a_point_grows_by_two_shares_in_each_direction():
    values = np.zeros((81, 101))
    values[40, 50] = 3.0
    spread_over(values, 0.12, 0.05, steps=30)
    x, y = np.arange(101) - 50, np.arange(81) - 40
    assert values.sum() == pytest.approx(3.0, rel=1e-14)
    assert (values.sum(axis=0) * x**2).sum() / 3.0 == pytest.approx(2 * 0.12 * 30, rel=1e-12)
    assert (values.sum(axis=1) * y**2).sum() / 3.0 == pytest.approx(2 * 0.05 * 30, rel=1e-12)


@pytest.mark.parametrize("mode", [0, 1, 5, 39])
def test_a_cosine_between_the_borders_decays_with_its_eigenvalue(mode):
    cosine = np.cos(np.pi * mode * (np.arange(40) + 0.5) / 40)
    values = np.tile(2 + cosine, (7, 1))
    spread_over(values, 0.2, 0.05, steps=10)
    eigenvalue = 1 - 4 * 0.2 * np.sin(np.pi * mode / 80) ** 2
    np.testing.assert_allclose(values, np.tile(2 + eigenvalue**10 * cosine, (7, 1)), rtol=1e-12)


def test_mirrored_and_turned_fields_stay_so_to_the_last_bit():
    values = np.random.default_rng(1).random((9, 9))
    plain, mirrored, turned = (spread_over(part.copy(), 0.1, 0.1, 0.9, steps=20) for part in
                               (values, values[:, ::-1], values.T))  # fmt: skip
    assert (mirrored == plain[:, ::-1]).all()
    assert (turned == plain.T).all()


def test_what_has_become_tiny_is_zero():
    values = np.zeros((1, 200))
    values[0, 0] = 1.0
    spread_over(values, 1e-3, 0.0, steps=300)
    smallest = values[values > 0].min()
    assert smallest >= 1e-250


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.booleans())
def test_centres_are_blocked_that_shapely_finds_within_a_polygon(seed, hole):
    import shapely  # noqa: PLC0415

    rng = np.random.default_rng(seed)
    outline = shapely.Point(rng.uniform(-2, 14, 2)).buffer(rng.uniform(0.3, 8), quad_segs=int(rng.integers(1, 5)))
    polygon = outline.difference(shapely.affinity.scale(outline, 0.5, 0.5)) if hole else outline
    sides = np.full((10, 12), OPEN, np.uint8)
    rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
    block_polygon(sides, FRAME, np.concatenate([np.hstack([ring[:-1], ring[1:]]) for ring in rings]))
    x, y = np.meshgrid(np.arange(12) + 0.5, np.arange(10) + 0.5)
    assert ((sides & BLOCKED > 0) == shapely.contains_xy(polygon, x, y)).all()
    for i, j in np.ndindex(10, 11):
        link = shapely.LineString([(j + 0.5, i + 0.5), (j + 1.5, i + 0.5)])
        assert (sides[i, j] & EAST == 0) == polygon.intersects(link)
        assert (sides[i, j] & EAST == 0) == (sides[i, j + 1] & WEST == 0)
    for i, j in np.ndindex(9, 12):
        link = shapely.LineString([(j + 0.5, i + 0.5), (j + 0.5, i + 1.5)])
        assert (sides[i, j] & NORTH == 0) == polygon.intersects(link)
        assert (sides[i, j] & NORTH == 0) == (sides[i + 1, j] & SOUTH == 0)


@pytest.mark.slow
@settings(deadline=None, max_examples=60)
@given(st.floats(-2, 14), st.floats(-2, 12), st.floats(0.05, 7))
def test_a_disc_blocks_what_a_polygon_of_many_corners_blocks(x, y, radius):
    corners = [(x + radius * np.cos(a), y + radius * np.sin(a)) for a in np.arange(0, 20000) / 20000 * 2 * np.pi]
    edges = np.hstack([corners, np.roll(corners, -1, axis=0)])
    disc, polygon = np.full((10, 12), OPEN, np.uint8), np.full((10, 12), OPEN, np.uint8)
    block_disc(disc, FRAME, x, y, radius)
    block_polygon(polygon, FRAME, edges)
    centres = np.stack(np.meshgrid(np.arange(12) + 0.5, np.arange(10) + 0.5), axis=-1)
    if np.abs(np.hypot(*(centres - (x, y)).reshape(-1, 2).T) - radius).min() < 1e-3:
        return  # the outlines differ by more than that from the centre
    assert ((disc ^ polygon) & BLOCKED == 0).all()
    assert (disc == polygon).mean() > 0.9
