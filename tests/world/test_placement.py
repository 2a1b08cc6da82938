"""Free places: never an overlap, always within the free space, seeded, and a number that holds when it refuses."""

import math
import re

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import Point

from mesa_swarm import AGENT9, Map, SwarmModel, disc, polygon, rectangle
from mesa_swarm.base.errors import PlacementError
from mesa_swarm.geometry.free_room import Crowded
from mesa_swarm.world.placement import free_places, free_space, place_apart
from mesa_swarm.world.statics import CELLS_PER_ITEM, MOST_LISTED, OBSTACLE, Statics
from support.pace import work_within
from support.scenes import blind, empty

NO_OTHERS = np.empty((0, 2)), np.empty(0)
U_SHAPE = [(60, 40), (160, 40), (160, 120), (140, 120), (140, 60), (80, 60), (80, 120), (60, 120)]
RING = polygon([(20, 20), (180, 20), (180, 130), (20, 130)], [[(50, 50), (150, 50), (150, 100), (50, 100)]])


def least_gap(position, radius, others=NO_OTHERS):
    """Return the least distance between the edges of any two discs, by all pairs."""
    points, radii = np.concatenate([position, others[0]]), np.concatenate([np.full(len(position), radius), others[1]])
    gap = np.hypot(*(points[:, None] - points).T) - radii[:, None] - radii
    new = np.arange(len(points)) < len(position)
    return gap[(new[:, None] | new) & ~np.eye(len(points), dtype=bool)].min(initial=math.inf)


def assert_free(model, robots, tolerance=0.0):
    """Check by Shapely that these robots overlap nothing that stands still, nor each other."""
    x_min, y_min, x_max, y_max = model.map.bounds
    for robot in robots:
        point, r = Point(robot.position), robot.radius
        assert min(point.x - x_min, x_max - point.x, point.y - y_min, y_max - point.y) >= r - tolerance
        for obstacle in model.obstacles:
            if obstacle.contact:
                assert obstacle.shape.geometry.distance(point) - obstacle.shape.radius >= r - tolerance
        for fire in model.fires:
            assert np.hypot(*(fire.position - robot.position)) >= r + fire.radius - tolerance
    position, radius = model.swarm.position, model.swarm.radius
    gap = np.hypot(*(position[:, None] - position).T) - radius[:, None] - radius
    assert gap[~np.eye(len(gap), dtype=bool)].min(initial=0.0) >= -tolerance


def promised(place, n):
    """Return how many would fit according to the refusal of n."""
    with pytest.raises(PlacementError) as caught:
        place(n)
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith("1 robot of radius " if n == 1 else f"{n} robots of radius ")
    return int(re.search(r": (\d+) would; ask for fewer", text)[1])


@given(seed=st.integers(0, 2**32), n=st.integers(0, 60), radius=st.floats(0.5, 12), discs=st.integers(0, 5))
def test_robots_never_overlap_anything_in_random_worlds(seed, n, radius, discs):
    rng = np.random.default_rng(seed)
    model = empty(220, 160, rng=seed)
    for _ in range(discs):
        model.add_obstacle(disc(rng.uniform((0, 0), (220, 160)), rng.uniform(2, 25)))
    model.add_obstacle(polygon(U_SHAPE))
    model.add_fire(rng.uniform((0, 0), (220, 160)), radius=rng.uniform(2, 20))
    try:
        robots = model.add_robots(blind(radius), n)
    except PlacementError as problem:
        n = int(re.search(r"(\d+) would", str(problem))[1])
        robots = model.add_robots(blind(radius), n)
    assert len(robots) == n
    assert_free(model, robots)
    heading = model.swarm.heading
    assert ((-math.pi <= heading) & (heading < math.pi)).all()


@pytest.mark.parametrize("name", ["original", "sparse", "openspace", "openspace_fire"])
def test_robots_find_free_places_on_every_built_in_map(name):
    model = SwarmModel(map=name, rng=5)
    assert_free(model, model.add_robots(AGENT9, 150))


def test_the_same_seed_gives_the_same_places_and_another_gives_others():
    places = [SwarmModel(map="original", rng=rng) for rng in (1, 1, 2)]
    for model in places:
        model.add_robots(AGENT9, 30)
    first, second, third = (model.swarm.position for model in places)
    assert (first == second).all()
    assert (first != third).any()


def test_the_first_places_do_not_depend_on_how_many_follow():
    few, many = empty(), empty()
    few.add_robots(blind(), 10)
    many.add_robots(blind(), 40)
    assert (few.swarm.position == many.swarm.position[:10]).all()


def test_places_are_spread_evenly_over_the_free_space():
    space = free_space((0, 0, 100, 100), [], 0.01)
    places = place_apart(4000, 0.01, space, *NO_OTHERS, np.random.default_rng(1))
    counts = np.histogram2d(*places.T, bins=4, range=[[0, 100]] * 2)[0]
    assert abs(counts - 250).max() < 5 * math.sqrt(250)


def test_places_are_spread_evenly_also_over_a_slanting_strip_of_a_vast_map():
    strip = shapely.transform(shapely.box(0, 0, 3000, 4), lambda at: at @ [[0.8, 0.6], [-0.6, 0.8]] + [7, -9])
    assert strip.area < 0.01 * shapely.box(*strip.bounds).area
    places = place_apart(4000, 1e-3, strip, *NO_OTHERS, np.random.default_rng(1))
    assert shapely.dwithin(strip, shapely.points(places), 1e-9).all()
    along, across = ((places - [7, -9]) @ [[0.8, -0.6], [0.6, 0.8]]).T
    counts = np.histogram2d(along, across, bins=(5, 4), range=[[0, 3000], [0, 4]])[0]
    assert abs(counts - 200).max() < 5 * math.sqrt(200)
    # In each triangle too: its corners' halves hold a quarter each.
    counts = np.histogram2d(along, across / 4 - along / 3000, bins=(2, 2), range=[[0, 3000], [-1, 1]])[0]
    assert np.abs(counts / 4000 - [[0.125, 0.375], [0.375, 0.125]]).max() < 0.04


def test_of_a_number_beyond_all_bounds_it_is_known_how_many_fit_at_most():
    space = shapely.box(0, 0, 8e6, 6e6)
    with pytest.raises(
        PlacementError, match=r"^10{17} robots of radius 5 do not fit on the map: at most \d+ would"
    ) as caught:
        place_apart(10**17, 5.0, space, *NO_OTHERS, np.random.default_rng(1))
    most = int(re.search(r"at most (\d+)", str(caught.value))[1])
    assert most == pytest.approx(8e6 * 6e6 / (math.pi * 25), rel=1e-5)


def test_among_robots_that_are_there_already_a_place_is_drawn_as_if_they_were_not_unless_it_overlaps_one():
    space = free_space((0, 0, 300, 200), [], 3.0)
    rng = np.random.default_rng(2)
    others = rng.uniform((0, 0), (300, 200), (60, 2)), rng.uniform(1, 20, 60)
    alone, among = (place_apart(200, 3.0, space, *o, np.random.default_rng(5)) for o in (NO_OTHERS, others))
    assert least_gap(among, 3.0, others) >= 0
    gap = np.min(np.hypot(*(alone[:, None] - others[0]).transpose(2, 0, 1)) - others[1], axis=1)
    # The places drawn first are the same ones, but for those that overlap.
    first = [place for place, far in zip(alone[:40].tolist(), gap[:40] >= 3.0, strict=True) if far]
    assert len(first) > 5
    assert all(place in among.tolist() for place in first)


@pytest.mark.slow
@settings(max_examples=20)
@given(
    width=st.floats(11, 200), height=st.floats(11, 200), radius=st.floats(2, 20), seed=st.integers(0, 1000),
    ring=st.booleans(),
)  # fmt: skip
def test_as_many_as_a_refusal_promises_do_fit(width, height, radius, seed, ring):
    shapes = [polygon(U_SHAPE)] if ring else []
    space = free_space((0, 0, width, height), shapes, radius)

    def place(n, again=0):
        return place_apart(n, radius, space, *NO_OTHERS, np.random.default_rng(seed + again), "here")

    fit = promised(place, 10**9)
    for again in (0, 1):
        places = place(fit, again)
        assert len(places) == fit
        assert least_gap(places, radius) >= 0
        assert not len(places) or shapely.dwithin(space, shapely.points(places), 1e-9).all()


def test_a_refusal_counts_the_robots_that_are_there_already():
    model = empty(200, 100)
    model.add_robots(blind(), 40)
    fit = promised(lambda n: model.add_robots(blind(), n), 10_000)
    assert len(model.robots) == 40
    assert 20 < fit < 200
    model.add_robots(blind(), fit)
    assert_free(model, model.robots)


def test_robots_of_other_sizes_that_are_there_already_are_kept_clear_of():
    model = empty(300, 200)
    model.add_robots(blind(30), poses=[(80, 100, 0.0), (200, 60, 0.0)])
    model.add_robots(blind(1), 400)
    model.add_robots(blind(12), 5)
    assert_free(model, model.robots)


@pytest.mark.parametrize("name", ["original", "openspace_fire"])
def test_a_thousand_million_robots_are_refused_within_a_second(name):
    model = SwarmModel(map=name, rng=1)
    model.add_robots(AGENT9, 1)
    with work_within(1):
        fit = promised(lambda n: model.add_robots(AGENT9, n), 10**9)
    assert 1000 < fit < 5000


def test_a_thousand_million_robots_are_refused_where_they_would_fit_too():
    model = SwarmModel(map=Map(name="vast", bounds=(0, 0, 8e8, 8e8)), rng=1)
    with work_within(1), pytest.raises(PlacementError, match="the limit is"):
        model.add_robots(AGENT9, 10**9)


def test_a_vast_map_of_which_next_to_nothing_is_free_is_no_trap():
    model = SwarmModel(map=Map(name="vast", bounds=(0, 0, 8e8, 8e8)), rng=1)
    model.add_obstacle(rectangle((0, 50), (8e8, 8e8)))
    model.add_obstacle(rectangle((100, 0), (8e8, 50)))
    with work_within(1):
        robots = model.add_robots(blind(), 5)
        promised(lambda n: model.add_robots(blind(), n), 1000)
    assert_free(model, robots, 1e-6)


def test_a_crowd_that_random_places_cannot_hold_is_packed_in_a_lattice():
    model = empty(200, 200)
    # Random places jam at 54.7 % of the area; this is 79 %.
    robots = model.add_robots(blind(), 400)
    assert 400 * math.pi * 25 / 200**2 > 0.78
    assert_free(model, robots)
    assert (np.diff(model.swarm.position[:, 1]) >= 0).mean() > 0.9


@pytest.mark.parametrize(("n", "radius", "inside"), [(4, 12.0, True), (100, 4.9, False)])
def test_holes_of_obstacles_are_free_and_what_is_solid_is_not(n, radius, inside):
    model = empty(200, 150)
    model.add_obstacle(RING)
    robots = model.add_robots(blind(radius), n)
    assert_free(model, robots)
    in_hole = [50 < r.position[0] < 150 and 50 < r.position[1] < 100 for r in robots]
    # The margin outside the ring is 20 wide: too narrow for robots of 12, not for those of 4.9.
    assert all(in_hole) is inside
    assert any(in_hole)


def test_the_arms_of_a_concave_obstacle_enclose_free_space():
    model = empty(220, 160)
    model.add_obstacle(polygon(U_SHAPE))
    robots = model.add_robots(blind(3), 200)
    assert_free(model, robots)
    assert any(80 < r.position[0] < 140 and 60 < r.position[1] < 120 for r in robots)


@pytest.mark.parametrize("wide", [10.5, 10.05, 10.014])
def test_a_slanting_corridor_hardly_wider_than_a_robot_is_found(wide):
    model = empty(400, 300)
    across = wide * math.sqrt(2)
    model.add_obstacle(polygon([(0, 0), (300, 300), (0, 300)]))
    model.add_obstacle(polygon([(across, 0), (400, 0), (400, 300), (300 + across, 300)]))
    with work_within(1):
        robots = model.add_robots(blind(), 10)
        fit = promised(lambda n: model.add_robots(blind(), n), 1000)
    assert fit >= 1
    assert_free(model, robots, 1e-9)


def test_many_separate_niches_are_not_taken_for_one_small_room():
    model = empty(25 * 14 + 2, 14)
    for k in range(26):
        model.add_obstacle(rectangle((14 * k, 0), (14 * k + 3, 14)))
    model.add_robots(blind(), 24)
    assert_free(model, model.robots)


@pytest.mark.parametrize("bounds", [(0, 0, 9, 100), (0, 0, 10, 100), (0, 0, 100, 10)])
def test_a_map_as_narrow_as_a_robot_holds_no_robot(bounds):
    model = SwarmModel(map=Map(name="narrow", bounds=bounds), rng=1)
    assert promised(lambda n: model.add_robots(blind(), n), 1) == 0


def test_a_map_without_any_free_place_holds_no_robot():
    model = empty(100, 100)
    model.add_obstacle(disc((50, 50), 80))
    assert promised(lambda n: model.add_robots(blind(), n), 3) == 0
    assert model.add_robots(blind(), 0) == []


def test_nought_robots_are_as_many_as_asked_for():
    model = empty()
    assert model.add_robots(AGENT9, 0) == []
    assert model.add_robots(AGENT9, poses=[]) == []
    assert model.step() is None
    assert model.swarm.distance.shape == (0, 9)


def test_robots_that_do_not_fit_leave_the_model_as_it_was():
    model = empty(100, 100)
    model.add_robots(blind(), 5)
    before = model.state_hash(), len(model.agents), len(model.swarm.designs)
    with pytest.raises(PlacementError):
        model.add_robots(AGENT9, 10**6)
    assert (model.state_hash(), len(model.agents), len(model.swarm.designs)) == before


def test_a_crowd_of_obstacles_leaves_places_that_are_free():
    shapes = [disc((x, y), 1.0) for x in np.linspace(0, 60, 50) for y in np.linspace(0, 100, 50)]
    space = free_places((0, 0, 100, 100), shapes, 2.0)
    places = place_apart(20, 2.0, space, np.empty((0, 2)), np.empty(0), np.random.default_rng(1))
    assert isinstance(space, Crowded)
    assert min(math.dist(place, shape.position) for place in places for shape in shapes) >= 3.0
    assert least_gap(places, 2.0) >= 0


def test_a_crowd_that_leaves_no_room_is_refused():
    shapes = [disc((x, 5 * (x % 20)), 9.0) for x in np.linspace(0, 100, 3000)] + [disc((50, 50), 90.0)]
    space = free_places((0, 0, 100, 100), shapes, 2.0)
    with pytest.raises(PlacementError, match="0 would"):
        place_apart(2, 2.0, space, np.empty((0, 2)), np.empty(0), np.random.default_rng(1))


@pytest.mark.slow
def test_lines_that_cross_too_often_are_a_crowd_however_few_they_are():
    ends = np.random.default_rng(1).random((500, 2, 2)) * 100
    shapes = [polygon([a, b, (a + b) / 2 + 0.01]) for a, b in ends]
    assert isinstance(free_places((0, 0, 100, 100), shapes, 0.01), Crowded)
    assert free_places((0, 0, 100, 100), shapes[:200], 0.01).equals(free_space((0, 0, 100, 100), shapes[:200], 0.01))


def test_long_edges_on_a_wide_map_are_listed_a_bounded_number_of_times():
    corners = np.random.default_rng(1).random((1500, 3, 2)) * 1e5
    shapes = [polygon(corner) for corner in corners]
    statics = Statics.of((0, 0, 1e5, 1e5), shapes, [OBSTACLE] * len(shapes), sight=50.0, touch=5.0)
    assert statics.grid.cells < CELLS_PER_ITEM * len(statics.edges) / 2
    assert len(statics.sight_cells.items) <= 2 * MOST_LISTED
