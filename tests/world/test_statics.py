"""Tables of static bodies against Shapely: edges with their solid side, owners, kinds, and what each cell lists."""

import math
from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.geometry.grid import cell_at
from mesa_swarm.world.shapes import disc, polygon
from mesa_swarm.world.statics import BORDER, FIRE, LOAD, OBSTACLE, Marks, Statics

BOUNDS = (-50.0, 20.0, 150.0, 140.0)
seeds = st.integers(0, 2**32 - 1)
RING = polygon([(0, 30), (60, 30), (60, 80), (0, 80)], [[(10, 40), (50, 40), (30, 70)]])


def drawn(rng):
    """Return random shapes, some of them marks, and fires with which of them burn."""
    shapes = []
    for _ in range(rng.integers(0, 7)):
        x, y = rng.uniform(BOUNDS[:2], BOUNDS[2:])
        spikes = np.arange(rng.integers(3, 8))
        turn = 2 * math.pi * spikes / len(spikes)
        star = np.column_stack([np.cos(turn), np.sin(turn)]) * rng.uniform(3, 15, (len(spikes), 1)) + (x, y)
        contact = bool(rng.random() < 0.7)
        kinds = disc((x, y), rng.uniform(1, 15), contact=contact), polygon(star[::-1], contact=contact)
        shapes.append(kinds[rng.integers(2)])
    fires = np.column_stack([rng.uniform(BOUNDS[:2], BOUNDS[2:], (3, 2)), rng.uniform(1, 9, 3)])
    return [*shapes, RING], fires[: rng.integers(0, 4)]


def edges_of(shape):
    """Return the edges of a polygon, either way round, each from its lesser end."""
    rings = shapely.get_rings(shape.geometry)
    lines = [line for ring in rings for line in pairwise(ring.coords)]
    return sorted(tuple(sorted(line)) for line in lines)


def rows_as_lines(rows):
    """Return rows ax, ay, bx, by in the same form."""
    return sorted(tuple(sorted([(ax, ay), (bx, by)])) for ax, ay, bx, by in rows.tolist())


@given(seeds)
def test_every_solid_shape_has_its_rows_and_every_row_its_owner_and_kind(seed):
    rng = np.random.default_rng(seed)
    shapes, fires = drawn(rng)
    burning, loads = rng.random(len(fires)) < 0.5, [k for k in range(len(shapes)) if rng.random() < 0.3]
    codes = [LOAD if k in loads else OBSTACLE for k in range(len(shapes))] + [FIRE] * len(fires)
    discs = [disc((x, y), radius) for x, y, radius in fires]
    statics = Statics.of(BOUNDS, [*shapes, *discs], codes, sight=10.0, touch=5.0, loads=loads, apart=len(fires))
    seen = [*codes[: len(shapes)], *np.where(burning, FIRE, OBSTACLE)]
    statics.show(seen)
    edges, discs, m = statics.edges, statics.discs, len(statics.edges)
    border = shapely.box(*BOUNDS).exterior.coords
    assert rows_as_lines(edges[:4]) == sorted(tuple(sorted(e)) for e in pairwise(border))
    assert (statics.owner[:4] == BORDER).all()
    solid = {k: shape for k, shape in enumerate(shapes) if shape.contact}
    own = statics.owner[4 : len(statics.owner) - len(fires)]
    assert set(own.tolist()) == set(solid)
    rings = iter(statics.rings.tolist())
    for k, shape in solid.items():
        rows = np.flatnonzero(np.append(np.full(4, BORDER), own) == k)
        assert (statics.body[rows] == (LOAD if k in loads else OBSTACLE)).all()
        assert (statics.kind[rows] == statics.body[rows]).all()
        if shape.is_disc:
            assert discs[rows - m].tolist() == [[*shape.position.tolist(), shape.radius]]
            continue
        assert next(rings) == [rows[0], rows[-1] + 1]
        assert rows_as_lines(edges[rows]) == edges_of(shape)
        for ax, ay, bx, by in edges[rows].tolist():
            length = math.hypot(bx - ax, by - ay)
            left = (ax + bx) / 2 - 1e-6 * (by - ay) / length, (ay + by) / 2 + 1e-6 * (bx - ax) / length
            assert shape.geometry.contains(shapely.Point(left))
    assert next(rings, None) is None
    assert statics.first_apart == len(discs) - len(fires)
    assert discs[statics.first_apart :].tolist() == fires.tolist()
    of_fires = slice(m + statics.first_apart, None)
    assert statics.owner[of_fires].tolist() == list(range(len(fires)))
    assert (statics.body[of_fires] == FIRE).all()
    assert statics.kind[of_fires].tolist() == [FIRE if burns else OBSTACLE for burns in burning]
    statics.seen_as[:] = np.where(burning, OBSTACLE, FIRE)
    assert statics.kind[of_fires].tolist() == [OBSTACLE if burns else FIRE for burns in burning]
    assert (statics.body[of_fires] == FIRE).all()
    assert (statics.kind[: of_fires.start] == statics.body[: of_fires.start]).all()
    assert statics.bounds.tolist() == list(BOUNDS)


def items_at(lists, point):
    """Return the items that the cell of a point lists."""
    cell = cell_at(*point, lists.grid)
    return set(lists.items[lists.start[cell] : lists.start[cell + 1]].tolist())


@given(seeds, st.floats(1, 60), st.floats(1, 20), st.floats(0, 10))
def test_a_cell_lists_what_can_be_seen_or_touched_from_it_also_once_a_load_has_moved(seed, sight, touch, slack):
    rng = np.random.default_rng(seed)
    shapes, fires = drawn(rng)
    loads = [len(shapes) - 1]
    discs = [disc((x, y), radius) for x, y, radius in fires]
    codes = [*[OBSTACLE] * (len(shapes) - 1), LOAD, *[FIRE] * len(fires)]
    statics = Statics.of(
        BOUNDS, [*shapes, *discs], codes, sight=sight, touch=touch, loads=loads, slack=slack, apart=len(fires)
    )
    lines = [shapely.LineString(row.reshape(2, 2)) for row in statics.edges]
    bodies = [*lines, *(shapely.Point(x, y).buffer(r) for x, y, r in statics.discs)]
    low = np.array([body.bounds[:2] for body in bodies]) - 1e-9
    high = np.array([body.bounds[2:] for body in bodies]) + 1e-9
    moving = statics.body == LOAD
    for point in rng.uniform(BOUNDS[:2], BOUNDS[2:], (20, 2)):
        away = np.maximum(0, np.maximum(low - point, point - high)).max(axis=1) - slack * moving
        seen = items_at(statics.sight_cells, point)
        touched = items_at(statics.touch_cells, point)
        assert set(np.flatnonzero(away < sight - 1e-6).tolist()) <= seen
        assert set(range(4, len(bodies))) & set(np.flatnonzero(away < touch - 1e-6).tolist()) <= touched
        # No farther than a cell and the reach; the border is never touched.
        far = statics.grid.cell + 1e-6
        assert all(away[item] <= sight + far for item in seen)
        assert all(away[item] <= touch + far and item >= 4 for item in touched)


def test_marks_have_rows_of_their_own_and_solids_none_among_them():
    mark, spot = polygon(RING.geometry.exterior.coords, contact=False), disc((1, 2), 3, contact=False)
    marks = Marks.of([RING, disc((9, 9), 1), spot, mark])
    assert marks.discs.tolist() == [[1, 2, 3]]
    assert rows_as_lines(marks.edges) == edges_of(mark)
    assert marks.rings.tolist() == [[0, 4]]
    nothing = Marks.of([RING])
    assert (nothing.edges.shape, nothing.discs.shape, nothing.rings.shape) == ((0, 4), (0, 3), (0, 2))


@pytest.mark.parametrize(("reach", "cells"), [(1.0, 100), (1000.0, 1)])
def test_an_empty_world_has_a_grid_of_cells_as_wide_as_can_be_touched(reach, cells):
    statics = Statics.of((0, 0, 10, 10), [], [], sight=1.0, touch=reach)
    assert statics.grid.cells == cells
    assert len(statics.touch_cells.items) == 0
    assert set(statics.sight_cells.items.tolist()) == {0, 1, 2, 3}
