"""The kernels of sensing beside closed forms, brute force, and Shapely."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT9, AGENT_FIRE, LineSensor, ProximitySensor, RadiationSensor, RobotDesign, disc
from mesa_swarm.kernels.block import Block
from mesa_swarm.physics import shapely_engine as shapely_sensing
from mesa_swarm.physics.engine import CompiledEngine
from mesa_swarm.physics.sensing import (
    MOST_FOUND,
    ROUNDING,
    add_errors,
    is_just_behind,
    is_nearest_body,
    is_segment_within,
    look_at_segment,
    rotate_into_frame,
    sense_inside,
    sense_line,
    sense_radiation,
)
from mesa_swarm.physics.shapely_engine import ShapelyEngine
from mesa_swarm.robots.design import HOLD, MAGNITUDE, PROBABILITY, RANGE
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.statics import FIRE, LOAD, NOTHING, OBSTACLE, ROBOT
from support.sensing_robots import looker, seen
from support.solid_worlds import SHAPES, solid_world

WORLD = solid_world()
few = settings(max_examples=30)
seeds = st.integers(0, 2**32 - 1)
numbers = st.floats(-20, 20)
SEEING = RobotDesign(
    name="seeing",
    radius=3.0,
    sensors=(
        ProximitySensor(mount=(8.0, -3.0), range=25),
        ProximitySensor(bearing_degrees=100, mount=(-6.0, 5.0), range=30, field_of_view_degrees=90),
        ProximitySensor(bearing_degrees=-70, range=20, rays=3),
        RadiationSensor(bearing_degrees=30, mount=(4.0, 7.0), range=60, field_of_view_degrees=100),
        RadiationSensor(bearing_degrees=-90, range=45),
        LineSensor(mount=(6.0, -4.0)),
        LineSensor(mount=(-3.0, 8.0)),
    ),
)


def swarm_of(seed, n=5):
    """Return a swarm of two designs at random places of the world."""
    rng, swarm = np.random.default_rng(seed), Swarm()
    for k in range(n):
        place = rng.uniform((12, -3), (108, 73), (1, 2))
        swarm.add(SEEING if k % 2 else AGENT_FIRE, place, rng.uniform(-3, 3, 1), np.ones(1))
        swarm.agents.append(None)
    return swarm


@given(numbers, numbers, st.floats(-3, 3))
def test_a_vector_turned_into_a_frame_is_the_complex_quotient_by_its_axis(x, y, azimuth):
    axis = complex(math.cos(azimuth), math.sin(azimuth))
    assert complex(*rotate_into_frame(x, y, axis.real, axis.imag)) == pytest.approx(complex(x, y) / axis)


@given(*[st.integers(-6, 6)] * 4, st.integers(0, 5))
def test_a_segment_is_within_reach_where_its_box_meets_the_square(ax, ay, bx, by, far):
    box = shapely.box(min(ax, bx), min(ay, by), max(ax, bx), max(ay, by))
    assert is_segment_within(ax, ay, bx, by, far) == box.intersects(shapely.box(-far, -far, far, far))


@pytest.mark.parametrize("kind", [NOTHING, OBSTACLE, ROBOT, FIRE, LOAD])
@pytest.mark.parametrize("what", [OBSTACLE, ROBOT, FIRE, LOAD])
def test_the_nearest_counts_and_of_equally_near_bodies_the_lowest_kind(what, kind):
    assert is_nearest_body(4.0, what, 5.0, kind)
    assert not is_nearest_body(5.0, what, 4.0, kind)
    assert is_nearest_body(5.0, what, 5.0, kind) == (kind == NOTHING or what < kind)


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5, -2.0])
def test_a_sensor_on_a_face_or_just_behind_it_is_behind_it_and_one_in_front_or_beside_is_not(turn):
    """The solid side is on the left of an edge, from (-3, d) to (3, d) where the origin is d to its right."""
    touch, axis = 0.5, np.exp(1j * turn)

    def behind(distance, along=0.0):
        a, b = ((complex(x + along, distance) * axis) for x in (-3.0, 3.0))
        return is_just_behind(a.real, a.imag, b.real, b.imag, touch)

    assert behind(-0.999 * touch)
    assert not behind(-1.001 * touch)
    assert behind(0.999 * ROUNDING * touch)
    assert not behind(1.001 * ROUNDING * touch)
    assert not behind(touch / 2)
    for end in (-1, 1):
        assert behind(-0.3, end * 3.39)
        assert not behind(-0.3, end * 3.41)


def sector(view_degrees):
    half = math.radians(view_degrees) / 2
    return math.cos(half), math.sin(half), half


@few
@given(st.floats(0.1, 15), st.floats(-3.1, 3.1), st.floats(-3.1, 3.1), st.floats(0.5, 5), st.integers(0, 1))
def test_a_disc_straight_ahead_is_as_far_as_its_rim_whichever_way_a_sensor_looks(gap, azimuth, off, radius, rays):
    axes = [math.remainder(math.degrees(azimuth + turn), 360) for turn in (0.0, off)]
    eyes = [
        ProximitySensor(bearing_degrees=axis, field_of_view_degrees=40, range=50, rays=rays, mount=(0, 0))
        for axis in axes
    ]
    model, _ = looker(*eyes)
    far = gap + radius
    model.add_obstacle(disc((200 + far * math.cos(azimuth), 150 + far * math.sin(azimuth)), radius))
    distance, kind = seen(model)
    assert distance[0] == pytest.approx(gap)
    assert kind[0] == OBSTACLE
    if abs(off) > math.radians(20) + math.asin(radius / far) + 1e-6:
        assert (distance[1], kind[1]) == (-1.0, NOTHING)


@pytest.mark.parametrize("obstacles", [False, True])
def test_a_sensor_sees_the_nearest_of_more_discs_than_are_noted_at_once(obstacles):
    model, _ = looker(ProximitySensor(range=60, field_of_view_degrees=120))
    places = [(210 + 0.02 * k, 150 + 20 * math.sin(k)) for k in range(MOST_FOUND + 200)]
    if obstacles:
        for place in places:
            model.add_obstacle(disc(place, 0.5))
    else:
        model.add_robots(RobotDesign(radius=0.5), poses=[(*place, 0.0) for place in places])
    distance, kind = seen(model)
    front, inside = np.array([205.0, 150.0]), math.radians(60)
    apart = np.array(places) - front
    visible = np.abs(np.arctan2(apart[:, 1], apart[:, 0])) < inside
    assert distance[0] == pytest.approx(np.hypot(*apart[visible].T).min() - 0.5)
    assert kind[0] == (OBSTACLE if obstacles else ROBOT)


@given(st.floats(0.1, 15), st.floats(-3.1, 3.1), st.integers(0, 1))
def test_a_wall_straight_ahead_is_as_far_as_its_face_and_0_where_the_sensor_is_on_it(gap, azimuth, rays):
    axis = complex(math.cos(azimuth), math.sin(azimuth))
    view = axis.real, axis.imag, *sector(40.0), rays
    a, b = complex(gap, -9) * axis, complex(gap, 9) * axis
    assert look_at_segment(a.real, a.imag, b.real, b.imag, *view, 50.0, 1e-3) == pytest.approx(gap)
    # A wall close behind the sensor is not seen, unless the sensor is on its solid side.
    a, b = complex(-5e-4, -9) * axis, complex(-5e-4, 9) * axis
    assert look_at_segment(a.real, a.imag, b.real, b.imag, *view, 50.0, 1e-3) == math.inf
    assert look_at_segment(b.real, b.imag, a.real, a.imag, *view, 50.0, 1e-3) == 0.0


@few
@given(seeds)
def test_sensors_inside_of_solid_polygons_or_beyond_the_border_read_0_and_all_others_are_left(seed):
    swarm, statics = swarm_of(seed, 8), WORLD.surroundings.statics
    swarm.columns["position"][:3] = np.random.default_rng(seed).uniform((10, -5), (22, 8), (3, 2))
    columns, table = swarm.columns, swarm.table
    distance, kind = np.full_like(columns["distance"], 7.0), np.full_like(columns["kind"], ROBOT)
    sense_inside(
        columns["position"], columns["heading"], columns["design"], table.proximity, table.counts,
        statics.edges, statics.kind, statics.rings, statics.bounds, distance, kind,
    )  # fmt: skip
    for i, s in np.ndindex(distance.shape):
        point = shapely.Point(shapely_sensing.place_in_world(swarm, i, table.proximity[swarm.design[i], s, :2]))
        gaps = [point.distance(polygon.boundary) for polygon in WORLD.solids.polygons]
        assume(min(gaps) > 1e-9)
        inside = s < table.counts[swarm.design[i]] and any(p.contains(point) for p in WORLD.solids.polygons)
        assert (distance[i, s], kind[i, s]) == ((0.0, OBSTACLE) if inside else (7.0, ROBOT))


@few
@given(seeds)
def test_the_hottest_burning_fire_in_each_sector_is_felt_as_the_twin_feels_it(seed):
    swarm, rng = swarm_of(seed), np.random.default_rng(seed)
    fires = np.column_stack([rng.uniform((12, -3), (108, 73), (4, 2)), rng.uniform(1, 9, 4)])
    world = solid_world(SHAPES, fires)
    world.surroundings.bodies.temperature[-4:] = rng.choice([0.0, 0.4, 0.8], 4)
    felt, twin = np.full((5, 2), 9.0), np.full((5, 2), 9.0)
    columns = swarm.columns
    place = columns["position"], columns["heading"], columns["design"]
    sense_radiation(*place, swarm.table.radiation, Block(world.surroundings.radiating).numbers, felt)
    shapely_sensing.sense_radiation_by_shapely(swarm, world.surroundings, twin)
    assert (felt == twin).all()
    # The first design has one such sensor only: what it does not have feels nothing.
    assert (felt[swarm.design == 0, 1] == 0).all()


@few
@given(seeds)
def test_a_line_sensor_reads_where_shapely_finds_its_point_over_a_mark(seed):
    rng, marks = np.random.default_rng(seed), SHAPES[3]
    swarm = swarm_of(seed)
    swarm.columns["position"][:] = rng.uniform((62, -5), (90, 20), (5, 2))
    line, twin = np.ones((5, 2), np.bool_), np.ones((5, 2), np.bool_)
    table, ground, columns = swarm.table, WORLD.surroundings.marks, swarm.columns
    place = columns["position"], columns["heading"], columns["design"]
    sense_line(*place, table.line, ground.edges, ground.rings, ground.discs, line)
    shapely_sensing.sense_line_by_shapely(swarm, WORLD.surroundings, twin)
    assert (line == twin).all()
    for i in np.flatnonzero(swarm.design == 1):
        for s in range(2):
            point = shapely.Point(shapely_sensing.place_in_world(swarm, i, table.line[1, s]))
            assert line[i, s] == marks.geometry.contains(point)


@few
@given(seeds, st.integers(0, 12))
def test_readings_err_by_the_magnitude_of_their_sensor_with_its_probability_and_stay_so_while_it_holds(seed, step):
    rng = np.random.default_rng(seed)
    noise, sensors = np.zeros((2, 3, 4)), np.zeros((2, 3, 9))
    noise[..., PROBABILITY] = rng.choice([0.0, 0.4, 1.0], (2, 3))
    noise[..., MAGNITUDE] = rng.choice([0.0, 0.5, 2.0], (2, 3))
    noise[..., HOLD] = rng.integers(0, 4, (2, 3))
    sensors[..., RANGE] = rng.choice([10.0, 30.0], (2, 3))
    design, draws = rng.integers(2, size=6), rng.choice([0.0, 0.1, 0.2, 0.4, 0.5, 0.9], (6, 3))
    distance, error = rng.choice([-1.0, 0.0, 4.0, 9.0], (6, 3)), rng.choice([-0.5, 0.0, 0.5], (6, 3))
    share, size, hold = (noise[design][..., column] for column in (PROBABILITY, MAGNITUDE, HOLD))
    fresh = np.where(draws < share / 2, -size, np.where(draws < share, size, 0.0))
    errors = np.where(step % np.maximum(hold, 1) == 0, fresh, error)
    wrong = np.clip(distance * (1 + errors), 0.0, sensors[design][..., RANGE])
    expected = np.where((distance >= 0) & (errors != 0), wrong, distance)
    add_errors(distance, design, sensors, noise, draws, step, error)
    assert error.tolist() == errors.tolist()
    assert distance == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("radius", [2.0, 5.0])
@pytest.mark.parametrize(("behind", "read"), [(-0.5, 0.0), (0.0, 0.0), (0.9, 0.0), (1.5, -1.0)])
def test_a_rim_that_contact_leaves_in_a_wall_by_a_millionth_of_the_radius_reads_0(radius, behind, read):
    swarm = Swarm()
    front = RobotDesign(radius=radius, sensors=(ProximitySensor(range=9),))
    swarm.add(front, np.array([[40.0 - radius + behind * 1e-6 * radius, 28.0]]), np.zeros(1), np.ones(1))
    swarm.agents.append(None)
    CompiledEngine().sense(swarm, WORLD.surroundings, 1, None)
    assert swarm.distance[0, 0] == pytest.approx(read, abs=1e-5)


# ---- the twin's own measures


def test_a_view_of_the_twin_begins_at_the_mount_and_looks_along_the_axis():
    swarm = Swarm()
    swarm.add(SEEING, np.array([[30.0, 40.0]]), np.array([math.pi / 2]), np.ones(1))
    view = shapely_sensing.view_of(swarm, 0, swarm.table.proximity[0, 0], 5.0)
    assert view.apex.coords[0] == pytest.approx((33.0, 48.0))
    assert view.range == 25.0
    assert view.area.covers(shapely.Point(33.0, 48.0 + 29.9))
    assert len(view.rays) == 2
    assert [ray.length for ray in view.rays] == pytest.approx([30.0, 30.0])
    fan = shapely_sensing.view_of(swarm, 0, swarm.table.proximity[0, 2], 5.0)
    azimuths = [math.degrees(math.atan2(b[1] - a[1], b[0] - a[0])) for a, b in (ray.coords for ray in fan.rays)]
    assert azimuths == pytest.approx([0.0, 20.0, 40.0])
    assert shapely_sensing.reach_beyond(np.array([2.0, 7.0])) == 8.0
    assert shapely_sensing.reach_beyond(np.empty(0)) == 1.0


def test_a_view_all_round_has_no_edges_and_one_of_a_single_ray_looks_along_the_axis():
    round_one = ProximitySensor(mount=(0.0, 0.0), field_of_view_degrees=360)
    single = ProximitySensor(bearing_degrees=45, mount=(0.0, 0.0), rays=1)
    swarm = Swarm()
    swarm.add(RobotDesign(sensors=(round_one, single)), np.zeros((1, 2)), np.zeros(1), np.ones(1))
    views = [shapely_sensing.view_of(swarm, 0, row, 2.0) for row in swarm.table.proximity[0]]
    assert views[0].rays == ()
    assert views[0].area.covers(shapely.Point(0, 0).buffer(51.9))
    (ray,) = views[1].rays
    assert ray.coords[1] == pytest.approx((52 * math.sqrt(0.5), 52 * math.sqrt(0.5)))


def test_all_solids_of_the_twin_are_listed_with_owner_and_kind():
    solids = WORLD.solids
    assert solids.polygon_owner.tolist() == [-1, 0, 2]
    assert solids.disc_owner.tolist() == [1, 4, 0, 1]
    assert (solids.polygon_body.tolist(), solids.disc_body.tolist()) == ([0, 0, 0], [0, 0, FIRE, FIRE])
    assert solids.radii.tolist() == [8, 5, 4, 3]
    around = WORLD.surroundings
    assert around.bodies.visible_kinds[around.rows[solids.disc_shape]].tolist() == [OBSTACLE, OBSTACLE, FIRE, OBSTACLE]
    places = np.array([[50.0, 40.0], [85.0, 66.0], [15.0, 30.0], [50.0, 30.0]])
    assert solids.gaps(places) == pytest.approx([5.0, 3.0, 5.0, 0.0])


@pytest.mark.slow
@few
@given(seeds)
def test_both_engines_read_the_same_beside_fires_that_burn_and_that_are_out(seed):
    read = []
    for engine in (CompiledEngine(), ShapelyEngine()):
        swarm = swarm_of(seed)
        for column in (swarm.columns["distance"], swarm.columns["kind"]):
            column.fill(9)
        engine.sense(swarm, WORLD.surroundings, 1, None)
        read.append((swarm.distance, swarm.kind, swarm.radiation, swarm.line))
    for ours, twins in zip(*read, strict=True):
        assert ours == pytest.approx(twins, abs=1e-9)
    distance, kind = read[0][:2]
    assert ((distance == -1) == (kind == NOTHING)).all()
    assert (distance[swarm.design == 1, 3:] == -1).all()
    assert distance.shape[1] == len(AGENT9.proximity)
