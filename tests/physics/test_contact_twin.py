"""Contact and the search for room, kernel by kernel, beside their Shapely twins and closed forms."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mesa_swarm import Map, RobotDesign, SwarmModel, rectangle
from mesa_swarm.base.errors import PlacementError
from mesa_swarm.kernels.block import Block
from mesa_swarm.physics import contact, separation, shapely_engine
from mesa_swarm.physics import placing as settle
from mesa_swarm.physics.contact import SLOP, Contacts, coincident_direction
from mesa_swarm.physics.crowd import PairArrays, near_pairs
from mesa_swarm.physics.separation import MOST_SWEEPS, SETTLED
from mesa_swarm.physics.shapely_engine import is_apart_from_robots
from mesa_swarm.world.statics import BORDER, FIRE, LOAD, OBSTACLE, ROBOT
from support.scenes import PROMISED
from support.solid_worlds import BOUNDS, contacts_of, crowd_in, solid_world

WORLD = solid_world()
xs, ys, radii = st.floats(10, 110), st.floats(-5, 75), st.floats(1, 6)
seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=30)


def crowd(seed, n=6):
    """Return robots in a corner of the map with a wall, near each other."""
    rng = np.random.default_rng(seed)
    return rng.uniform((11, -4), (48, 34), (n, 2)), rng.uniform(2, 6, n)


# ---- static bodies


@given(xs, ys, radii)
def test_the_deepest_overlap_with_a_static_body_is_the_twins(x, y, radius):
    depth, nx, ny, flat, item = contact.deepest_static(x, y, radius, WORLD.statics)
    twin = shapely_engine.deepest_solid(np.array([x, y]), radius, WORLD.solids)
    if twin is None:
        assert depth <= SLOP * radius
        return
    # The centre of a robot is never deep inside a solid; at two equally deep overlaps either may count.
    assume(twin.depth < 0.9 * radius)
    assert depth == pytest.approx(twin.depth, abs=1e-9)
    nudged = shapely_engine.deepest_solid(np.array([x + 1e-7, y - 1e-7]), radius, WORLD.solids)
    assume(nudged is not None and np.allclose(nudged.normal, twin.normal, atol=1e-3))
    assert (nx, ny) == pytest.approx(tuple(twin.normal), abs=1e-6)
    owner, body = (BORDER, OBSTACLE) if item == BORDER else (WORLD.statics.owner[item], WORLD.statics.body[item])
    assert (owner, body, flat) == (twin.index, twin.kind, twin.flat)


@given(xs, ys, radii)
def test_whether_a_place_is_free_is_the_same_in_both_engines_and_inside_of_solids_too(x, y, radius):
    gap = WORLD.solids.gaps(np.array([[x, y]]))[0]
    assume(abs(gap - radius) > 1e-6)
    twin = shapely_engine.is_free_of_solids(np.array([[x, y]]), radius, WORLD.solids)[0]
    assert settle.is_free(x, y, radius, WORLD.statics, WORLD.rings) == twin == (gap > radius)


@pytest.mark.parametrize("depth", [0.5, 2.0])
def test_overlaps_up_to_rounding_are_free_and_not_pushed_and_deeper_ones_are(depth):
    radius = 4.0
    here = np.array([[BOUNDS[0] + radius - depth * SLOP * radius, 30.0]])
    deep = depth > 1
    assert settle.is_free(*here[0], radius, WORLD.statics, WORLD.rings) != deep
    assert shapely_engine.is_free_of_solids(here, radius, WORLD.solids)[0] != deep
    assert (shapely_engine.deepest_solid(here[0], radius, WORLD.solids) is not None) == deep
    ours, twin = contacts_of(1)
    place = here.copy()
    assert contact.push_from_statics(0, place, radius, WORLD.statics, ours)
    assert (place[0, 0] > here[0, 0]) == deep == (ours.depth[0] > 0)
    place = here.copy()
    assert shapely_engine.leave_statics(0, place, radius, WORLD.solids, twin)
    assert (place[0, 0] > here[0, 0]) == deep == (twin.depth[0] > 0)


@pytest.mark.parametrize(
    ("place", "normal"),
    [((12, 30), (1, 0)), ((108, 30), (-1, 0)), ((64, -3), (0, 1)), ((64, 73), (0, -1)), ((11, -3), (1, 0))],
)
def test_the_border_pushes_inwards_from_its_nearest_side(place, normal):
    depth, nx, ny, flat, item = contact.deepest_static(*map(float, place), 4.0, WORLD.statics)
    assert (nx, ny, flat, item) == (*normal, True, BORDER)
    assert depth == 4.0 - min(place[0] - 10, 110 - place[0], place[1] + 5, 75 - place[1])


@pytest.mark.parametrize("place", [(13.0, 30.0), (107.0, 30.0), (64.0, -2.0), (64.0, 72.0)])
def test_a_robot_that_touches_the_border_touches_it_without_overlap(place):
    assert contact.deepest_static(*place, 3.0, WORLD.statics) == (0.0, 0.0, 0.0, False, BORDER)
    ours, _ = contacts_of(1)
    position, free = np.array([place]), np.zeros(1, np.bool_)
    contact.push_all_from_statics(np.arange(1), position, np.array([3.0]), WORLD.statics, ours, free)
    assert free[0]
    assert position.tolist() == [list(place)]


@few
@given(seeds)
def test_robots_are_pushed_out_of_static_bodies_as_the_twin_pushes_them_and_rows_not_asked_for_are_not(seed):
    position, radius = crowd(seed)
    gaps = WORLD.solids.gaps(position)
    assume((gaps > 0.2 * radius).all())
    ours, twin = contacts_of(6)
    place, other, free = position.copy(), position.copy(), np.zeros(6, np.bool_)
    contact.push_all_from_statics(np.arange(5), place, radius, WORLD.statics, ours, free)
    left = [shapely_engine.leave_statics(i, other, radius[i], WORLD.solids, twin) for i in range(5)]
    assert place == pytest.approx(other, abs=1e-9)
    assert free.tolist() == [*left, False]
    for mine, theirs in zip(ours, (twin.kind, twin.index, twin.normal, twin.depth, twin.face), strict=True):
        touched = twin.depth > 0
        assert mine[touched] == pytest.approx(theirs[touched], abs=1e-9)


@pytest.mark.parametrize(("behind", "out"), [(0.0, -1.0), (0.9, -1.0), (1.1, 1.0)])
def test_a_centre_at_most_a_millionth_of_its_radius_behind_a_face_leaves_on_the_open_side(behind, out):
    """Beyond, the nearest way from the face counts: no robot gets there."""
    radius, face = 2.0, 40.0
    x = face + behind * 1e-6 * radius
    _, nx, ny, flat, _ = contact.deepest_static(x, 27.0, radius, WORLD.statics)
    assert (nx, ny, flat) == (out, 0.0, True)
    twin = shapely_engine.deepest_solid(np.array([x, 27.0]), radius, WORLD.solids)
    assert tuple(twin.normal) == pytest.approx((out, 0.0))


def test_overlaps_that_are_left_as_rounding_are_a_tenth_of_what_is_promised():
    assert pytest.approx(PROMISED / 10) == SLOP


# ---- pairs of robots


@few
@given(seeds, st.booleans())
def test_robots_that_overlap_push_each_other_by_half_of_it_and_note_each_other(seed, sleepy):
    position, radius = crowd(seed, 8)
    awake = np.random.default_rng(seed).random(8) < 0.4 if sleepy else np.ones(8, np.bool_)
    pairs = np.array([(i, j) for i in range(8) for j in range(i)])
    push, (ours, _) = np.zeros((8, 2)), contacts_of(8)
    met = np.flatnonzero(awake[pairs].any(axis=1))
    count = separation.push_pairs(position, radius, np.arange(8), pairs, met, push, ours)
    expected, deepest, found = np.zeros((8, 2)), [(0.0, -1)] * 8, []
    for k, (i, j) in enumerate(pairs):
        apart = position[i] - position[j]
        overlap = radius[i] + radius[j] - np.hypot(*apart)
        if overlap > 0 and (awake[i] or awake[j]):
            found.append(k)
            half = apart / np.hypot(*apart) * overlap / 2
            expected[i] += half
            expected[j] -= half
            deepest[i], deepest[j] = max(deepest[i], (overlap, j)), max(deepest[j], (overlap, i))
    assert met[:count].tolist() == found
    assert push == pytest.approx(expected, abs=1e-12)
    assert ours.depth == pytest.approx([depth for depth, _ in deepest])
    assert ours[1].tolist() == [other for _, other in deepest]
    assert ours[0].tolist() == [ROBOT if other >= 0 else -1 for _, other in deepest]
    for i, (_, other) in enumerate(deepest):
        if other >= 0:
            apart = position[i] - position[other]
            assert ours[2][i] == pytest.approx(apart / np.hypot(*apart))


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_overlaps_of_robots_up_to_rounding_of_the_smaller_one_are_left(share):
    radius, deep = np.array([3.0, 5.0]), share > 1
    position = np.array([[30.0, 10.0], [30.0 + 8.0 - share * SLOP * 3.0, 10.0]])
    pairs, push = np.array([[0, 1]]), np.zeros((2, 2))
    ours, _ = contacts_of(2)
    _robots, (crowd_block, *_) = crowd_in(WORLD, position, radius)
    assert separation.find_overlaps(crowd_block, Block(near := PairArrays.of_pairs(pairs)).numbers) == (SETTLED, deep)
    assert near.overlaps[:deep].tolist() == [0] * deep
    count = separation.push_pairs(position, radius, np.arange(2), pairs, np.zeros(1, np.int64), push, ours)
    assert count == deep
    assert len(shapely_engine.overlapping_pairs(position, radius)) == deep
    assert settle.overlaps_any(0, *position[0], position, radius) == deep
    assert is_apart_from_robots(0, position[:1], position, radius)[0] != deep


def test_coincident_robots_push_each_other_apart_by_half_of_both_radii():
    position, radius, number = np.full((2, 2), 30.0), np.array([3.0, 5.0]), np.array([7, 4])
    push, (ours, _) = np.zeros((2, 2)), contacts_of(2)
    separation.push_pairs(position, radius, number, np.array([[0, 1]]), np.zeros(1, np.int64), push, ours)
    assert push[0] == pytest.approx(4.0 * np.array(coincident_direction(7, 4)))
    assert push[1] == pytest.approx(-push[0])


def test_neighbouring_numbers_part_in_directions_that_are_far_apart():
    for a in (0, 1, 50, 1234):
        azimuths = [math.atan2(*coincident_direction(a, a + k)[::-1]) for k in range(1, 5)]
        between = [abs(math.remainder(p - q, 2 * math.pi)) for k, p in enumerate(azimuths) for q in azimuths[:k]]
        assert min(between) > 0.5


@few
@given(seeds)
def test_a_push_moves_a_robot_once_and_by_at_most_a_quarter_of_its_radius(seed):
    rng = np.random.default_rng(seed)
    position, radius, push = rng.uniform(0, 50, (6, 2)), rng.uniform(1, 9, 6), rng.uniform(-3, 3, (6, 2))
    push[rng.random(6) < 0.3] = 0.0
    pairs = np.array([[0, 1], [2, 3], [4, 1], [5, 0]])
    rows = [0, 1, 4]  # of the pairs 0 and 2
    before, asked_for = position.copy(), push.copy()
    awake, moved = np.zeros(6, np.bool_), np.full(6, -1)
    count = separation.apply_pushes(position, push, radius, pairs, np.array([0, 2]), awake, moved)
    went = [i for i in rows if asked_for[i].any()]
    assert sorted(moved[:count].tolist()) == went == np.flatnonzero(awake).tolist()
    for i in range(6):
        length = np.hypot(*asked_for[i])
        way = asked_for[i] * min(1.0, 0.25 * radius[i] / length) if i in went else np.zeros(2)
        assert position[i] - before[i] == pytest.approx(way, abs=1e-12)
    assert (push[went] == 0).all()


def test_a_push_along_one_axis_moves_a_robot_too():
    for axis in (0, 1):
        position, push = np.zeros((2, 2)), np.zeros((2, 2))
        push[0, axis] = 0.5
        awake, moved = np.zeros(2, np.bool_), np.empty(2, np.int64)
        args = np.array([4.0, 4.0]), np.array([[0, 1]]), np.zeros(1, np.int64), awake, moved
        assert separation.apply_pushes(position, push, *args) == 1
        assert position[0, axis] == 0.5


def test_the_farthest_of_the_rows_that_moved_counts():
    reference = np.full((4, 2), [7.0, -3.0])
    position = reference + np.array([[3.0, 4.0], [0.0, 2.0], [9.0, 9.0], [-1.0, 0.0]])
    assert separation.farthest_from(reference, position, np.array([0, 1, 3])) == 5.0
    assert separation.farthest_from(reference, position, np.array([1, 3])) == 2.0
    assert separation.farthest_from(position, reference, np.array([3])) == 1.0
    assert separation.farthest_from(reference, position, np.empty(0, np.int64)) == 0.0


@few
@given(seeds, st.integers(2, 9))
def test_a_crowd_is_separated_as_the_twin_separates_it(seed, n):
    position, radius = crowd(seed, n)
    assume((WORLD.solids.gaps(position) > 0.2 * radius).all())
    (ours, twin), place, other = contacts_of(n), position.copy(), position.copy()
    robots, bodies = crowd_in(WORLD, place, radius, contacts=ours)
    free, reference = robots.free, robots.reference
    contact.push_all_from_statics(np.arange(n), place, radius, WORLD.statics, ours, free)
    near = near_pairs(position, radius, radius.min(), WORLD.grid)
    settled, pairs = separation.separate(*bodies, near, MOST_SWEEPS)
    twice = shapely_engine.separate_by_shapely(other, radius, WORLD.solids, twin, MOST_SWEEPS)
    assume(settled)
    assert twice
    assert free.all()
    assert place == pytest.approx(other, abs=1e-6)
    assert ours.depth == pytest.approx(twin.depth, abs=1e-6)
    assert len(shapely_engine.overlapping_pairs(place, radius)) == 0
    assert 2 * np.hypot(*(reference - place).T).max() <= radius.min() + 1e-9
    assert len(pairs) == len(near_pairs(reference, radius, radius.min(), WORLD.grid))


@few
@given(seeds, st.integers(2, 9))
def test_robots_that_overlap_return_to_where_they_were_as_those_of_the_twin_do(seed, n):
    rng = np.random.default_rng(seed)
    before, radius = crowd(seed, n)
    place = before + rng.uniform(-3, 3, (n, 2))
    assume((WORLD.solids.gaps(place) > 0.2 * radius).all())
    other, (ours, twin) = place.copy(), contacts_of(n)
    reference, free = place + rng.uniform(-0.5, 0.5, (n, 2)), rng.random(n) < 0.5
    for i in range(n):
        free[i] &= shapely_engine.deepest_solid(place[i], radius[i], WORLD.solids) is None
    pairs = near_pairs(reference, radius, radius.min(), WORLD.grid)
    _robots, bodies = crowd_in(WORLD, place, radius, before=before, reference=reference, free=free, contacts=ours)
    separation.return_to_free_places(*bodies, pairs)
    shapely_engine.return_overlapping(other, before, radius, WORLD.solids, twin)
    assert (place == other).all()
    assert ours.depth == pytest.approx(twin.depth, abs=1e-9)


def test_all_that_follow_one_that_returns_return_with_it():
    """The first is in the border; each of the others has come near to where the one before it was."""
    before = np.array([[14.5, 12.0], [23.0, 12.0], [31.5, 12.0], [40.0, 12.0]])
    place, radius = before - [[3.0, 0.0], [3.4, 0.0], [3.8, 0.0], [4.2, 0.0]], np.full(4, 4.0)
    (_, twin), mine, theirs = contacts_of(4), place.copy(), place.copy()
    pairs, free = near_pairs(mine, radius, 4.0, WORLD.grid), np.array([False, True, True, True])
    _robots, bodies = crowd_in(WORLD, mine, radius, before=before, free=free)
    separation.return_to_free_places(*bodies, pairs)
    shapely_engine.return_overlapping(theirs, before, radius, WORLD.solids, twin)
    assert (mine == before).all()
    assert (theirs == before).all()


# ---- room


@pytest.mark.slow
@few
@given(st.tuples(xs, ys), radii, st.booleans(), seeds)
def test_the_place_that_a_robot_is_moved_to_is_the_first_free_one_of_the_rings(place, radius, apart, seed):
    position, size = crowd(seed, 5)
    position[2], size[2] = place, radius
    twin = position.copy()
    found = settle.find_room(2, position, size, WORLD.statics, WORLD.rings, apart)
    assert found == shapely_engine.move_to_free_place(2, twin, size, BOUNDS, WORLD.solids, apart=apart)
    assert position == pytest.approx(twin, abs=1e-9)
    assert found
    assert WORLD.solids.gaps(position[2:3])[0] >= radius * (1 - 1e-6)
    if apart:
        assert not settle.overlaps_any(2, *position[2], position, size)


def test_deep_in_a_large_body_both_engines_search_the_same_coarser_rings():
    block = solid_world((rectangle((20, 5), (100, 65)),), np.empty((0, 3)))
    for place in ((55.0, 33.0), (62.0, 37.5), (97.0, 20.0)):
        ours, twin, radius = np.array([place]), np.array([place]), np.array([0.5])
        assert settle.find_room(0, ours, radius, block.statics, block.rings, False)
        assert shapely_engine.move_to_free_place(0, twin, radius, BOUNDS, block.solids, apart=False)
        assert ours == pytest.approx(twin, abs=1e-9)
        nearest = min(place[0] - 20, 100 - place[0], place[1] - 5, 65 - place[1]) + 0.5
        assert nearest <= math.dist(ours[0], place) <= 1.02 * nearest + 0.0625


def test_there_is_no_room_for_a_robot_wider_than_the_map():
    position, radius = np.array([[60.0, 40.0]]), np.array([41.0])
    for apart in (False, True):
        assert not settle.find_room(0, position, radius, WORLD.statics, WORLD.rings, apart)
        assert not shapely_engine.move_to_free_place(0, position, radius, BOUNDS, WORLD.solids, apart=apart)
    assert position.tolist() == [[60.0, 40.0]]


@few
@given(seeds)
def test_a_tangle_is_dissolved_one_robot_after_the_other_as_by_the_twin(seed):
    rng = np.random.default_rng(seed)
    place, radius = rng.uniform((14, 0), (40, 24), (7, 2)), rng.uniform(2, 5, 7)
    twin, before = place.copy(), place.copy()
    assert settle.leave_each_other(place, radius, WORLD.statics, WORLD.rings) == -1
    shapely_engine.separate_placed_robots(twin, radius, BOUNDS, WORLD.solids)
    assert place == pytest.approx(twin, abs=1e-9)
    assert len(shapely_engine.overlapping_pairs(place, radius)) == 0
    for i in range(7):
        others = np.vstack([place[:i], before[i:]])
        fits = WORLD.solids.gaps(before[i : i + 1])[0] >= radius[i] and not settle.overlaps_any(
            i, *before[i], others, radius
        )
        if fits:
            assert (place[i] == before[i]).all()


def test_the_first_robot_without_room_is_named_with_its_radius():
    bounds = 0.0, 0.0, 33.0, 11.0
    small = solid_world((), np.empty((0, 3)), bounds)
    place, radius = np.array([[5.2, 5.5], [15.3, 5.5], [26.5, 5.5]]), np.array([5.0, 5.0, 6.0])
    assert settle.leave_each_other(place.copy(), radius, small.statics, small.rings) == 2
    with pytest.raises(PlacementError, match=r"no room is left for robot 3 of 3 \(radius 6\)"):
        shapely_engine.separate_placed_robots(place.copy(), radius, bounds, small.solids)
    swarm = SimpleNamespace(columns={"position": place, "radius": radius, "number": np.arange(3)})
    with pytest.raises(PlacementError, match=r"no room is left for robot 3 of 3 \(radius 6\)"):
        settle.settle_robots(swarm, small.surroundings, small.grid)


@few
@given(st.lists(st.tuples(xs, ys), min_size=1, max_size=5))
def test_only_robots_inside_of_solids_leave_them_and_other_robots_do_not_count_yet(places):
    position, radius = np.array(places), np.full(len(places), 3.0)
    before = position.copy()
    settle.leave_solids(position, radius, WORLD.statics, WORLD.rings)
    for i, was in enumerate(before):
        alone = was[None].copy()
        if not settle.is_free(*was, 3.0, WORLD.statics, WORLD.rings):
            assert shapely_engine.move_to_free_place(0, alone, np.array([3.0]), BOUNDS, WORLD.solids, apart=False)
        assert position[i] == pytest.approx(alone[0], abs=1e-9)


# ---- what a step notes


def test_contacts_are_listed_with_the_numbers_of_both_bodies():
    obstacles, fires = ([SimpleNamespace(unique_id=first + k) for k in range(5)] for first in (200, 300))
    kinds, index = np.array([ROBOT, OBSTACLE, FIRE, OBSTACLE, LOAD]), np.array([3, 2, 1, BORDER, 4])
    collided = np.array([True, True, True, True, True])
    swarm = SimpleNamespace(
        collided=collided, contact_kind=kinds, contact_index=index, unique_ids=np.arange(100, 105),
        contact_normal=np.arange(10.0).reshape(5, 2), contact_depth=np.arange(5.0),
    )  # fmt: skip
    found = Contacts.of(swarm, obstacles, {FIRE: fires})
    assert (found.robot.tolist(), found.kind.tolist()) == ([100, 101, 102, 103, 104], kinds.tolist())
    assert found.other.tolist() == [103, 202, 301, -1, 204]
    collided[[0, 2, 3]] = False
    found = Contacts.of(swarm, obstacles, {FIRE: fires})
    assert (found.robot.tolist(), found.other.tolist()) == ([101, 104], [202, 204])
    assert (found.normal.tolist(), found.depth.tolist()) == ([[2.0, 3.0], [8.0, 9.0]], [1.0, 4.0])


@pytest.mark.parametrize("engine", ["compiled", "shapely"])
def test_a_step_forgets_the_contacts_of_the_step_before_and_notes_the_deepest_of_its_own(engine):
    model = SwarmModel(map=Map(name="room", bounds=(0, 0, 100, 100)), engine=engine, rng=1)
    model.add_robots(RobotDesign(radius=5), poses=[(50, 50, 0.0), (59, 50, 0.0), (50, 61, 0.0)])
    columns = model.swarm.columns
    model.step()
    model.swarm.columns["position"][:] = [[50, 50], [59, 50], [50, 59.5]]
    model.step()
    assert columns["contact_index"].tolist() == [1, 0, 0]
    assert columns["contact_kind"].tolist() == [ROBOT] * 3
    assert columns["contact_depth"] == pytest.approx([1.0, 1.0, 0.5], abs=0.2)
    assert columns["collided"].all()
    model.step()
    assert not columns["collided"].any()
    assert columns["contact_kind"].tolist() == columns["contact_index"].tolist() == [-1, -1, -1]
    assert not columns["contact_normal"].any()
    assert not columns["contact_depth"].any()
