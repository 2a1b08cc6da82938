"""After every step no two bodies overlap, whatever the speed, the density and the shape of the world."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import Map, SwarmModel, disc, polygon, rectangle
from mesa_swarm.control import Subsumption
from support.scenes import PROMISED, ahead, blind, circle, corridor, empty, wedge, worst_overlap

L_SHAPE = [(150, 100), (250, 100), (250, 200), (220, 200), (220, 130), (150, 130)]


def drive(model, steps=60, rule=ahead):
    """Run and return the worst overlap after any step."""
    model.control = Subsumption(rule)
    worst = -math.inf
    for _ in range(steps):
        model.step()
        worst = max(worst, worst_overlap(model))
    return worst


@pytest.mark.slow
@given(
    seed=st.integers(0, 2**32),
    n=st.integers(1, 40),
    radius=st.floats(2, 12),
    speed=st.floats(0.05, 6),
    discs=st.integers(0, 4),
)
def test_no_body_overlaps_another_in_random_crowded_worlds(seed, n, radius, speed, discs):
    rng = np.random.default_rng(seed)
    model = empty(220, 160)
    for _ in range(discs):
        model.add_obstacle(disc(rng.uniform((20, 20), (200, 140)), rng.uniform(2, 25)))
    model.add_obstacle(polygon([(100, 60), (140, 60), (140, 100), (125, 100), (125, 70), (100, 70)]))
    design = blind(radius, speed * radius)
    n = min(n, int(0.3 * 220 * 160 / (math.pi * radius**2)))
    poses = np.column_stack([rng.uniform((0, 0), (220, 160), (n, 2)), rng.uniform(-3, 3, n)])
    try:
        model.add_robots(design, poses=poses)
        assert drive(model, 4, circle(left=float(rng.uniform(-1, 1)))) <= PROMISED
    except ValueError as problem:
        assert "no room is left" in str(problem)


def test_a_corner_met_on_the_diagonal_holds_the_robot():
    model = empty()
    model.add_robots(blind(), poses=[(40, 40, -3 * math.pi / 4)])
    assert drive(model) <= PROMISED
    assert model.robots[0].position == pytest.approx((5, 5), abs=1e-5)


@pytest.mark.parametrize("radii_per_step", [0.4, 1, 10, 100])
def test_a_thin_wall_is_not_jumped_over(radii_per_step):
    model = empty(4000, 300)
    model.add_obstacle(rectangle((2000, 0), (2000.01, 300)))
    model.add_robots(blind(5, 5 * radii_per_step), poses=[(1950 - 3 * k, 20 + 30 * k, 0.0) for k in range(8)])
    assert drive(model, 40) <= PROMISED
    assert (model.swarm.position[:, 0] <= 1995.001).all()


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [60, 30, 10, 5, 1])
@pytest.mark.parametrize("speed", [0.5, 4.0, 30.0])
def test_a_wedge_holds_all_that_drive_into_it(degrees, speed):
    model = wedge(degrees)
    model.add_robots(blind(5, speed), poses=[(60 - 12 * k, 150.3, 0.0) for k in range(4)])
    assert drive(model, 300) <= PROMISED


def test_a_corridor_narrower_than_a_robot_is_not_entered():
    model = corridor(width=9.0)
    model.add_robots(blind(), poses=[(60, 150, 0.0), (48, 151, 0.0)])
    assert drive(model, 120) <= PROMISED
    assert (model.swarm.position[:, 0] < 101).all()


def test_a_dead_end_as_wide_as_a_robot_is_entered_and_left():
    model = corridor(width=10.5)
    model.add_robots(blind(), poses=[(90, 150, 0.0)])
    assert drive(model, 260) <= PROMISED
    assert model.swarm.position[0, 0] == pytest.approx(295, abs=1e-4)
    assert drive(model, 260, ahead(speed=-1.0)) <= PROMISED
    assert model.swarm.position[0, 0] < 100


@pytest.mark.slow
def test_fifty_robots_pressed_to_a_wall_do_not_overlap():
    model = empty(400, 120)
    poses = [(300 - 11 * (k // 10), 8 + 11 * (k % 10), 0.0) for k in range(50)]
    model.add_robots(blind(), poses=poses)
    assert drive(model, 150) <= PROMISED


@pytest.mark.slow
def test_a_jam_dissolves_when_the_robots_turn_round():
    model = empty(400, 120)
    robots = model.add_robots(blind(), poses=[(300 - 11 * (k // 10), 8 + 11 * (k % 10), 0.0) for k in range(50)])
    drive(model, 150)
    for robot in robots:
        robot.heading = math.pi
    before = model.swarm.position[:, 0].mean()
    assert drive(model, 100) <= PROMISED
    assert model.swarm.position[:, 0].mean() < before - 50


def test_coincident_centres_part():
    model = empty()
    model.add_robots(blind(), poses=[(200, 150, 0.0)] * 25)
    assert drive(model, 3, ahead(speed=0.0)) <= PROMISED


def test_coincident_centres_part_the_same_way_every_time():
    positions = []
    for _ in range(2):
        model = empty()
        model.add_robots(blind(), poses=[(200, 150, 0.0)] * 7)
        drive(model, 1, ahead(speed=0.0))
        positions.append(model.swarm.position.copy())
    assert (positions[0] == positions[1]).all()


@pytest.mark.parametrize(
    ("x", "collides"),
    [(110.0, False), (np.nextafter(110.0, 200.0), False), (110.0 - 1e-4, True)],
)
def test_touching_is_not_a_collision_and_overlap_is(x, collides):
    model = empty()
    model.add_robots(blind(), poses=[(100, 150, 0.0), (x, 150, 0.0)])
    model.swarm.disturbed = False  # leave the overlap to the step itself
    model.control = Subsumption(ahead(speed=0.0))
    model.step()
    assert model.swarm.collided.tolist() == [collides, collides]
    assert worst_overlap(model) <= PROMISED


@pytest.mark.parametrize(
    ("shape", "place"),
    [
        (disc((200, 150), 60), (200, 150)),
        (disc((200, 150), 60), (215, 140)),
        (rectangle((100, 100), (300, 200)), (200, 150)),
        (polygon(L_SHAPE), (240, 110)),
        (polygon(L_SHAPE), (221, 131)),
    ],
    ids=["disc's centre", "disc", "rectangle", "concave polygon", "concave corner"],
)
def test_a_robot_spawned_inside_a_solid_is_outside_after_a_step(shape, place):
    model = empty()
    model.add_obstacle(shape)
    model.add_robots(blind(), poses=[(*place, 0.3)])
    assert drive(model, 1) <= PROMISED


def test_a_robot_spawned_in_a_hole_stays_in_it():
    model = empty()
    ring = polygon([(100, 50), (300, 50), (300, 250), (100, 250)], [[(150, 100), (250, 100), (250, 200), (150, 200)]])
    model.add_obstacle(ring)
    model.add_robots(blind(), poses=[(200, 150, 0.2)])
    assert drive(model, 200) <= PROMISED
    x, y = model.swarm.position[0]
    assert 150 < x < 250
    assert 100 < y < 200


def test_a_robot_spawned_in_a_corridor_too_narrow_for_it_is_moved_out():
    model = corridor(width=8.0)
    model.add_robots(blind(), poses=[(200, 150, 0.0)])
    assert drive(model, 1) <= PROMISED


def test_an_obstacle_put_onto_robots_between_steps_pushes_them_out():
    model = empty()
    model.add_robots(blind(), 20)
    assert drive(model, 5) <= PROMISED
    model.add_obstacle(rectangle((50, 50), (350, 250)))
    assert drive(model, 5) <= PROMISED


def test_robots_slide_along_flush_rectangles_without_catching_on_the_seams():
    model = empty(600, 300)
    for k in range(10):
        model.add_obstacle(rectangle((50 + 50 * k, 100), (100 + 50 * k, 120)))
    model.add_robots(blind(), poses=[(60, 125, -0.001)])
    model.control = Subsumption(ahead)
    model.run(400)
    assert model.swarm.position[0] == pytest.approx((460, 125), abs=0.05)
    assert abs(model.robots[0].heading) < 1e-9


def test_a_world_far_from_the_origin_keeps_the_guarantee():
    far = 1e7
    model = SwarmModel(map=Map(name="far", bounds=(far, far, far + 200, far + 150)), rng=1)
    model.add_obstacle(rectangle((far + 90, far + 40), (far + 110, far + 110)))
    model.add_robots(blind(), 40)
    assert drive(model, 60, circle) <= PROMISED


@pytest.mark.parametrize(("far", "radius"), [(1e9 - 200, 4.0), (2.0**29, 2.2), (0.0, 1e-12), (0.0, 1e-9)])
def test_the_smallest_robots_that_a_world_takes_keep_the_guarantee(far, radius):
    size = 30 * radius
    model = SwarmModel(map=Map(name="far", bounds=(far, far, far + size, far + size)), rng=1)
    tip, side = (far + size / 2, far + size / 2), (far + size / 3, far + size / 4)
    model.add_obstacle(polygon([tip, side, (far + size / 2.1, far + size / 4)]))
    model.add_robots(blind(radius, radius), 20)
    assert drive(model, 60, circle) <= PROMISED


def test_robots_beside_an_obstacle_that_reaches_to_the_largest_coordinate_keep_the_guarantee():
    model = empty()
    model.add_obstacle(polygon([(200, 140), (1e9, 3e8), (1e9, 8e8)]))
    model.add_robots(blind(4.0, 8.0), 40)
    assert drive(model, 40, circle) <= PROMISED


@pytest.mark.slow
def test_bodies_of_very_different_size_do_not_overlap():
    model = empty(500, 400)
    model.add_robots(blind(60, 3.0), poses=[(100, 200, 0.0), (400, 200, math.pi)])
    model.add_robots(blind(2, 1.0), 80)
    assert drive(model, 120) <= PROMISED


def test_robots_of_unequal_radius_are_each_moved_by_half_the_overlap():
    model = empty()
    model.add_robots(blind(10), poses=[(100, 150, 0.0)])
    model.add_robots(blind(4), poses=[(112, 150, 0.0)])
    model.swarm.disturbed = False
    model.control = Subsumption(ahead(speed=0.0))
    model.step()
    assert model.swarm.position[:, 0] == pytest.approx((99, 113), abs=1e-6)


def test_robots_in_a_column_beside_a_wall_do_not_hold_each_other_for_ever():
    model = empty()
    model.add_obstacle(rectangle((0, 200), (150, 215)))
    poses = [(89.7541, 175.2804, 0.3), (90.9119, 185.2321, 0.3), (93.0539, 194.9999999, 0.0)]
    model.add_robots(blind(), poses=poses)
    assert drive(model, steps=60) <= PROMISED
    assert (model.swarm.position[:, 0] > 130).all()
