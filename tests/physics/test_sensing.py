"""What proximity sensors read in a whole world: bodies, presets, rays (PHYSICS 3)."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, ProximitySensor, RadiationSensor, bump_sensor, disc, laser_sensor, polygon, rectangle
from mesa_swarm.control import Subsumption
from mesa_swarm.physics.sensing import is_just_behind, rotate_into_frame
from support.scenes import ahead, blind, empty
from support.sensing_robots import FIRE, NOTHING, OBSTACLE, ROBOT, carrying, looker, seen

# ---- proximity


def test_a_vector_is_turned_into_the_frame_of_an_axis():
    assert rotate_into_frame(0.0, 2.0, 0.0, 1.0) == (2.0, 0.0)


def test_a_sensor_is_just_behind_an_edge_only_on_its_left():
    assert is_just_behind(-1.0, -1e-8, 1.0, -1e-8, 1e-6)
    assert not is_just_behind(1.0, -1e-8, -1.0, -1e-8, 1e-6)
    assert not is_just_behind(-1.0, -1e-5, 1.0, -1e-5, 1e-6)


def test_nothing_in_range_reads_minus_one_and_no_kind():
    model, _ = looker(ProximitySensor(range=50))
    assert seen(model) == ([-1], [NOTHING])


@pytest.mark.parametrize(
    ("add", "kind"),
    [
        (lambda m: m.add_obstacle(disc((240, 150), 10)), OBSTACLE),
        (lambda m: m.add_obstacle(rectangle((230, 140), (260, 160))), OBSTACLE),
        (lambda m: m.add_robots(blind(10), poses=[(240, 150, 0.0)]), ROBOT),
        (lambda m: m.add_fire((240, 150), radius=10), FIRE),
    ],
    ids=["disc", "rectangle", "robot", "fire"],
)
def test_each_kind_of_body_is_seen_at_its_distance_from_the_rim_and_named(add, kind):
    model, _ = looker(ProximitySensor(range=50))
    add(model)
    distance, kinds = seen(model)
    assert distance == pytest.approx([25], abs=1e-9)
    assert kinds == [kind]


def test_the_border_is_seen_as_an_obstacle():
    model = empty()
    model.add_robots(AGENT9, poses=[(30, 150, math.pi)])
    model.sense()
    assert next(iter(model.robots)).distance[0] == pytest.approx(25, abs=1e-9)
    assert next(iter(model.robots)).kind[0] == OBSTACLE


def test_what_is_just_in_range_is_seen_and_what_is_just_beyond_is_not():
    for x, expected in ((265 - 1e-9, True), (265 + 1e-9, False)):
        model, _ = looker(ProximitySensor(range=50))
        model.add_obstacle(disc((x, 150), 10))
        assert (seen(model)[1] == [OBSTACLE]) is expected


def test_marks_on_the_ground_are_not_seen_by_proximity_sensors():
    model, _ = looker(ProximitySensor(range=50))
    model.add_obstacle(disc((220, 150), 10, contact=False))
    assert seen(model) == ([-1], [NOTHING])


def test_ones_own_body_is_not_seen():
    model, _ = looker(
        ProximitySensor(field_of_view_degrees=360, mount=(0, 0)), ProximitySensor(field_of_view_degrees=360)
    )
    assert seen(model) == ([-1, -1], [NOTHING, NOTHING])
    model.add_robots(blind(), poses=[(190, 150, 0.0)])
    assert seen(model)[0] == pytest.approx([5, 10], abs=1e-9)


@pytest.mark.parametrize(
    "solid",
    [
        disc((230, 150), 10),
        rectangle((222, 140), (240, 160)),
        polygon([(215, 100), (300, 150), (215, 200)]),
    ],
    ids=["disc", "rectangle", "triangle"],
)
def test_a_sensor_inside_a_body_reads_nought(solid):
    model, _ = looker(ProximitySensor(mount=(30, 0), range=1, field_of_view_degrees=10))
    model.add_obstacle(solid)
    assert seen(model) == ([0], [OBSTACLE])
    model.step()
    assert seen(model) == ([0], [OBSTACLE])


def test_a_sensor_inside_a_robot_or_a_fire_reads_nought():
    for add, kind in (
        (lambda m: m.add_robots(blind(), poses=[(230, 150, 0.0)]), ROBOT),
        (lambda m: m.add_fire((230, 150), radius=5), FIRE),
    ):
        model, _ = looker(ProximitySensor(mount=(30, 0), range=1, field_of_view_degrees=10))
        add(model)
        assert seen(model) == ([0], [kind])


def test_a_sensor_in_the_hole_of_an_obstacle_is_not_inside_it():
    hole = [(225, 145), (235, 145), (235, 155), (225, 155)]
    model, _ = looker(ProximitySensor(mount=(30, 0), range=20))
    model.add_obstacle(polygon([(215, 100), (260, 100), (260, 200), (215, 200)], [hole]))
    assert seen(model)[0] == pytest.approx([5], abs=1e-9)


@pytest.mark.slow
@given(heading=st.floats(-0.5, 0.5), x=st.floats(180, 190))
def test_a_robot_pressed_to_a_wall_sees_it_as_near_as_it_is(heading, x):
    sensor = ProximitySensor(range=50, field_of_view_degrees=90)
    model = empty()
    model.add_obstacle(rectangle((200, 0), (220, 300)))
    model.add_robots(carrying(sensor), poses=[(x, 150, heading)])
    model.control = Subsumption(ahead)
    model.run(25)
    mount_x = model.swarm.position[0, 0] + 5 * math.cos(model.swarm.heading[0])
    distance, kind = seen(model)
    assert model.swarm.collided[0]
    assert distance[0] == pytest.approx(200 - mount_x, abs=1e-6)
    assert kind == [OBSTACLE]


def test_a_robot_pressed_to_the_border_sees_it_as_touching():
    model = empty()
    model.add_robots(carrying(ProximitySensor(range=1)), poses=[(390 + 0.37 * k, 10 + 12 * k, 0.0) for k in range(14)])
    model.control = Subsumption(ahead)
    model.run(10)
    model.sense()
    assert (model.swarm.kind == OBSTACLE).all()
    assert model.swarm.distance == pytest.approx(np.zeros((14, 1)), abs=1e-6)


def test_a_fire_that_is_out_is_seen_as_an_obstacle_and_not_felt():
    model, robot = looker(ProximitySensor(range=50), RadiationSensor())
    fire = model.add_fire((240, 150), radius=20, area=1e-6)
    model.sense()
    assert (robot.kind.tolist(), model.swarm.radiation.tolist()) == ([FIRE], [[1.0]])
    near = model.add_robots(blind(), poses=[(240, 176, 0.0)])[0]
    model.step()
    assert fire.out
    model.step()
    assert near.fire == -1
    model.sense()
    assert (robot.kind.tolist(), model.swarm.radiation.tolist()) == ([OBSTACLE], [[0.0], [0.0]])


# ---- presets and rays


def test_a_laser_measures_far_ahead_and_sees_nothing_beside():
    model, _ = looker(laser_sensor(), laser_sensor(180))
    model.add_obstacle(disc((370, 150), 5))
    model.add_obstacle(disc((240, 140), 5))
    distance, kind = seen(model)
    assert distance == pytest.approx([160, 195], abs=1e-9)
    assert kind == [OBSTACLE, OBSTACLE]


def test_a_bumper_feels_what_touches_and_nothing_else():
    model, _ = looker(bump_sensor(), bump_sensor(180))
    other = model.add_robots(blind(), poses=[(210, 150, 0.0)])[0]
    assert seen(model) == ([pytest.approx(0, abs=1e-9), -1], [ROBOT, NOTHING])
    other.position = (210.6, 150)
    assert seen(model)[1] == [NOTHING, NOTHING]


@pytest.mark.slow
@given(seed=st.integers(0, 2**32), view=st.floats(5, 350))
def test_rays_never_read_less_than_the_exact_distance_and_approach_it(seed, view):
    rng = np.random.default_rng(seed)
    counts = [0, 3, 5, 17, 257, 4097]
    model, _ = looker(*[ProximitySensor(range=80, field_of_view_degrees=view, rays=k) for k in counts])
    for _ in range(3):
        model.add_obstacle(disc(rng.uniform((210, 100), (300, 200)), rng.uniform(3, 20)))
    corner = rng.uniform((220, 80), (280, 180))
    model.add_obstacle(rectangle(corner, corner + rng.uniform(5, 40, 2)))
    distance = np.array(seen(model)[0])
    far = np.where(distance < 0, math.inf, distance)
    # From 5 on, each number of rays contains the rays of the one before.
    assert (far[2:-1] >= far[3:] - 1e-9).all()
    assert (far[1:] >= far[0] - 1e-9).all()
    if 1 < far[0] < 79:
        # A wall at a grazing angle is missed by at most the gap between two rays, or wholly at the edge.
        spread = math.radians(view) / 4096
        assert far[-1] - far[0] < 80 * math.sqrt(2 * 80 * spread) or not math.isfinite(far[-1])


def test_a_gap_between_rays_is_missed_and_the_exact_sensor_does_not_miss_it():
    model, _ = looker(*[ProximitySensor(range=50, field_of_view_degrees=60, rays=k) for k in (0, 2, 3)])
    model.add_obstacle(disc((235, 150), 2))
    distance, kind = seen(model)
    assert distance == pytest.approx([28, -1, 28], abs=1e-9)
    assert kind == [OBSTACLE, NOTHING, OBSTACLE]
