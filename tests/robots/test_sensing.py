"""What sensors read in a whole world: radiation, ground marks, presets, rays, noise, hold and period (PHYSICS 3)."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import (
    AGENT9,
    LineSensor,
    ProximitySensor,
    RadiationSensor,
    RobotDesign,
    bump_sensor,
    disc,
    laser_sensor,
    polygon,
    rectangle,
)
from mesa_swarm.control import Explore, Subsumption
from scenes import ahead, blind, empty

OBSTACLE, ROBOT, FIRE, NOTHING = 0, 1, 2, -1


def carrying(*sensors, radius=5.0):
    return RobotDesign(radius=radius, sensors=sensors)


def looker(*sensors, heading=0.0, model=None, **options):
    """Return a world with one robot at (200, 150) that carries these sensors."""
    model = model or empty(**options)
    return model, model.add_robots(carrying(*sensors), poses=[(200, 150, heading)])[0]


def seen(model):
    model.sense()
    return model.swarm.distance[0].tolist(), model.swarm.kind[0].tolist()


# ---- proximity


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


# ---- radiation


def test_the_hottest_burning_fire_in_the_sector_is_felt():
    model, _ = looker(RadiationSensor(range=80, field_of_view_degrees=60))
    model.add_fire((240, 150), radius=5, temperature=0.4)
    model.add_fire((270, 160), radius=5, temperature=0.9)
    model.add_fire((150, 150), radius=5, temperature=1.0)
    model.sense()
    assert model.swarm.radiation.tolist() == [[0.9]]


@pytest.mark.parametrize(
    ("place", "felt"),
    [
        ((294.9, 150), True),
        ((295.1, 150), False),
        ((205, 190), False),
        ((205 + 30 * math.cos(0.5), 150 + 30 * math.sin(0.5)), True),
        ((170, 150), False),
    ],
)
def test_a_fire_is_felt_only_if_its_body_meets_the_sector(place, felt):
    model, _ = looker(RadiationSensor(range=80, field_of_view_degrees=60))
    model.add_fire(place, radius=10, temperature=0.7)
    model.sense()
    assert model.swarm.radiation.tolist() == [[0.7 if felt else 0.0]]


def test_walls_do_not_hide_the_heat_of_a_fire():
    model, _ = looker(RadiationSensor())
    model.add_obstacle(rectangle((215, 100), (225, 200)))
    model.add_fire((250, 150), radius=10, temperature=0.7)
    model.sense()
    assert model.swarm.radiation.tolist() == [[0.7]]


def test_a_fire_whose_temperature_is_set_is_felt_at_the_new_one_even_after_a_look():
    model, _ = looker(RadiationSensor())
    fire = model.add_fire((240, 150), radius=10, temperature=0.7)
    model.step()
    model.sense()
    fire.temperature = 0.2
    model.sense()
    assert model.swarm.radiation.tolist() == [[0.2]]


# ---- ground marks


def test_a_line_sensor_tells_whether_its_point_is_over_a_mark():
    model, robot = looker(LineSensor(mount=(5, 0)), LineSensor(mount=(-5, 0)), LineSensor(mount=(0, 5)))
    model.add_obstacle(rectangle((203, 140), (210, 160), contact=False))
    model.add_obstacle(disc((200, 158), 3.5, contact=False))
    model.sense()
    assert model.swarm.line.tolist() == [[True, False, True]]
    robot.heading = math.pi
    model.sense()
    assert model.swarm.line.tolist() == [[False, True, False]]


@pytest.mark.parametrize(("x", "over"), [(150, False), (165, True), (200, False), (235, True), (250, False)])
def test_the_hole_of_a_mark_is_not_over_it(x, over):
    model = empty()
    hole = [(180, 130), (220, 130), (220, 170), (180, 170)]
    model.add_obstacle(polygon([(160, 110), (240, 110), (240, 190), (160, 190)], [hole], contact=False))
    model.add_robots(carrying(LineSensor()), poses=[(x, 150, 0.4)])
    model.sense()
    assert model.swarm.line.tolist() == [[over]]


def test_solid_bodies_are_not_marks_and_marks_do_not_hinder():
    model = empty()
    model.add_obstacle(rectangle((210, 0), (230, 300), contact=False))
    model.add_robots(carrying(LineSensor(mount=(5, 0))), poses=[(200.5, 150, 0.0), (380, 150, 0.0)])
    model.control = Subsumption(ahead)
    readings = []
    for _ in range(30):
        model.sense()
        readings.append(bool(model.swarm.line[0, 0]))
        model.step()
    assert readings == [k in range(5, 25) for k in range(30)]
    assert model.swarm.position[0, 0] == pytest.approx(230.5, abs=1e-9)
    assert not model.swarm.line[1, 0]


# ---- noise


def noisy_world(n=400, probability=0.5, magnitude=0.2, distance=25.0, **more):
    """Return a world of many robots that each see one disc at this distance."""
    model = empty(100 * 20, 100 * (n // 20))
    sensor = ProximitySensor(
        range=50, field_of_view_degrees=10, error_probability=probability, error_magnitude=magnitude, **more
    )
    model.add_robots(carrying(sensor), poses=[(20 + 100 * (k % 20), 50 + 100 * (k // 20), 0.0) for k in range(n)])
    for k in range(n if distance else 0):
        model.add_obstacle(disc((25 + distance + 5 + 100 * (k % 20), 50 + 100 * (k // 20)), 5))
    return model


def test_a_reading_errs_with_its_probability_by_its_magnitude_up_or_down():
    model = noisy_world(probability=0.3)
    model.sense()
    distance = model.swarm.distance[:, 0]
    up, down, right = (np.isclose(distance, d, atol=1e-9) for d in (30, 20, 25))
    assert (up | down | right).all()
    sigma = math.sqrt(0.3 * 0.7 * 400)
    assert abs((up | down).sum() - 120) < 4 * sigma
    assert abs(int(up.sum()) - int(down.sum())) < 4 * math.sqrt(120)


def test_a_reading_that_errs_stays_between_nought_and_the_range():
    for magnitude, values in ((1.5, {0.0, 50.0}), (1.0, {0.0, 50.0}), (1e6, {0.0, 50.0})):
        model = noisy_world(100, 1.0, magnitude)
        model.sense()
        assert set(np.round(model.swarm.distance[:, 0], 9)) == values


def test_errors_neither_invent_nor_lose_a_detection():
    nothing = noisy_world(100, 1.0, 0.9, distance=0)
    nothing.sense()
    assert (nothing.swarm.distance == -1).all()
    edge = noisy_world(100, 1.0, 0.9, distance=49.9)
    edge.sense()
    assert (edge.swarm.kind == OBSTACLE).all()
    assert (edge.swarm.distance >= 0).all()


@pytest.mark.parametrize("hold", [1, 4])
def test_an_error_is_held_for_as_many_steps_as_asked_for(hold):
    model = noisy_world(100, 0.5, 0.2, hold=hold)
    rows = []
    for _ in range(12):
        model.sense()
        rows.append(model.swarm.distance[:, 0].copy())
        model.step()
    changed = [bool((a != b).any()) for a, b in pairwise(rows)]
    assert changed == [(k + 1) % hold == 0 for k in range(11)]


def test_a_reading_is_refreshed_once_a_period():
    model = empty()
    sensors = (ProximitySensor(range=100), ProximitySensor(range=100, period=3))
    model.add_robots(carrying(*sensors), poses=[(100, 150, 0.0)])
    model.add_obstacle(rectangle((180, 0), (200, 300)))
    model.control = Subsumption(ahead)
    for k in range(10):
        model.sense()
        assert model.swarm.distance[0] == pytest.approx((75 - k, 75 - k + k % 3), abs=1e-9)
        model.step()


def test_reading_twice_gives_the_same():
    model = noisy_world(40, 0.5, 0.2, hold=2, period=3)
    for _ in range(5):
        model.sense()
        first = model.swarm.distance.copy(), model.swarm.kind.copy(), model.swarm.error.copy()
        for _ in range(3):
            model.swarm.disturbed = True  # no short cut
            model.sense()
        assert (first[0] == model.swarm.distance).all()
        assert (first[2] == model.swarm.error).all()
        model.step()


def test_a_sensor_s_noise_does_not_change_the_walk_of_robots_that_do_not_look():
    places = []
    for probability in (0.0, 0.5):
        model = empty(rng=4)
        design = AGENT9.with_slip(probability=0.3, magnitude=0.5)
        model.add_robots(design.with_proximity(error_probability=probability, error_magnitude=0.3), 10)
        model.control = Subsumption(Explore(turn_interval=7))
        places.append(model.run(60).swarm.position.copy())
    assert (places[0] == places[1]).all()


def test_more_sensors_do_not_change_the_walk():
    places = []
    for more in ((), (ProximitySensor(error_probability=0.5, error_magnitude=0.5), LineSensor(), RadiationSensor())):
        model = empty(rng=4)
        design = AGENT9.with_slip(probability=0.3, magnitude=0.5)
        model.add_robots(RobotDesign(sensors=(*design.sensors, *more), slip_probability=0.3, slip_magnitude=0.5), 10)
        model.control = Subsumption(Explore(turn_interval=7))
        places.append(model.run(60).swarm.position.copy())
    assert (places[0] == places[1]).all()
