"""What robots feel of fires, and what they know of the ground under them (PHYSICS 3)."""

import math

import pytest

from mesa_swarm import LineSensor, RadiationSensor, disc, polygon, rectangle
from mesa_swarm.control import Subsumption
from support.scenes import ahead, empty
from support.sensing_robots import carrying, looker

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


def test_a_line_sensor_reads_whether_its_point_is_over_a_mark():
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
