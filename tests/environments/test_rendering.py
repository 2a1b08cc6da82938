import numpy as np
import pytest

from mesa_swarm import AGENT9, Field, Looks, Map, SwarmModel, disc, polygon, rectangle
from mesa_swarm.environments.rendering import Camera
from mesa_swarm.maps.map import FireSpot
from mesa_swarm.viewing.palette import LIGHT, fire_colour, rgb

RING = polygon([(10, 10), (90, 10), (90, 50), (10, 50)], [[(40, 20), (60, 20), (60, 40), (40, 40)]])
HALL = Map(
    name="hall",
    bounds=(-100, 0, 100, 100),
    obstacles=[RING, rectangle((-90, 60), (-50, 95), contact=False), disc((-20, 80), 10)],
    fires=[FireSpot(position=(50, 80), radius=10)],
)


class World(SwarmModel):
    commanded = 1


def pictured(poses=(), **more) -> np.ndarray:
    """Return the hall at 2 pixels a unit."""
    world = World(map=HALL, rng=1)
    if poses:
        world.add_robots(AGENT9, poses=poses)
    for name, values in more.items():
        bodies = world.parts.bodies.table
        tables = {"hot": world.swarm.columns, "out": world.fires.own, "temperature": {name: bodies.temperature}}
        tables[name][name][world.fires.rows if name == "temperature" else ...] = values
    return Camera(HALL, longest_side=400).picture(world)


def colour(picture: np.ndarray, x: float, y: float) -> str:
    return "#" + bytes(picture[int((100 - y) * 2), int((x + 100) * 2)]).hex()


def test_everything_is_to_scale_with_y_up():
    picture = pictured()
    assert picture.shape == (200, 400, 3)
    assert picture.dtype == np.uint8
    assert colour(picture, 20, 30) == LIGHT.obstacle
    assert colour(picture, 50, 30) == LIGHT.ground  # the hole
    assert colour(picture, -70, 80) == LIGHT.mark
    assert colour(picture, -20, 80) == colour(picture, -20, 89) == LIGHT.obstacle
    assert colour(picture, -20, 92) == LIGHT.ground


def test_an_obstacle_that_was_removed_is_gone_from_the_picture_and_one_that_was_added_is_in_it():
    world, camera = World(map=HALL, rng=1), Camera(HALL, longest_side=400)
    assert colour(camera.picture(world), -20, 80) == LIGHT.obstacle
    world.obstacles[2].remove()
    world.add_obstacle(disc((80, 80), 8))
    picture = camera.picture(world)
    assert colour(picture, -20, 80) == LIGHT.ground
    assert colour(picture, 80, 80) == LIGHT.obstacle
    assert colour(picture, 20, 30) == LIGHT.obstacle
    assert np.array_equal(camera.picture(World(map=HALL, rng=1)), pictured())


def test_areas_are_right_to_a_hundredth():
    grey = (pictured() == rgb(LIGHT.obstacle)).all(axis=2).sum() / 4
    assert grey == pytest.approx(80 * 40 - 20 * 20 + np.pi * 100, rel=0.01)


def test_a_robot_shows_where_it_looks_and_whether_it_is_hot():
    picture = pictured([(-50, 30, np.pi / 2), (-80, 30, 0.0)], hot=[False, True])
    assert colour(picture, -50, 33) == colour(picture, -77, 30) == LIGHT.robot_front
    assert colour(picture, -50, 27) == LIGHT.robot
    assert colour(picture, -83, 30) == LIGHT.robot_hot


def test_a_commanded_robot_among_others_has_a_rim():
    picture = pictured([(-50, 30, 0.0), (-80, 30, 0.0)])
    assert colour(picture, -50, 36.5) == LIGHT.robot_outline
    assert colour(picture, -80, 36.5) == LIGHT.ground
    assert colour(pictured([(-50, 30, 0.0)]), -50, 36.5) == LIGHT.ground


def test_a_fire_goes_from_black_to_red_and_is_pale_once_it_is_out():
    assert colour(pictured(temperature=1.0), 50, 80) == fire_colour(1.0)
    assert colour(pictured(temperature=0.5), 50, 80) == fire_colour(0.5)
    assert colour(pictured(temperature=0.0, out=True), 50, 80) == LIGHT.ashes


def test_bodies_that_a_task_adds_are_drawn_where_they_are():
    world = World(map=HALL, rng=1)
    world.add_obstacle(disc((-50, 30), 10, contact=False))
    food = world.add_body(disc((-50, 30), 3), kind="food")
    camera = Camera(HALL, longest_side=400)
    picture = camera.picture(world)
    assert (colour(picture, -50, 30), colour(picture, -44, 30)) == (LIGHT.load, LIGHT.mark)
    food.position = (-80, 30)
    picture = camera.picture(world)
    assert (colour(picture, -50, 30), colour(picture, -80, 30)) == (LIGHT.mark, LIGHT.load)


def test_what_radiates_has_the_colour_of_its_temperature():
    world = World(map=HALL, rng=1)
    world.add_body(disc((-50, 30), 10), kind="lamp", mode="fixed", temperature=0.5)
    assert colour(Camera(HALL, longest_side=400).picture(world), -50, 30) == fire_colour(0.5)


class Declared(World):
    looks = Looks(kinds={"food": "#123456"}, column=lambda model: np.ones(len(model.swarm)))


def test_a_picture_has_the_colours_that_the_model_declares_and_its_fields_below_all_else():
    world = Declared(map=HALL, rng=1)
    world.add_body(disc((-50, 30), 10), kind="food")
    world.add_robots(AGENT9, poses=[(-50, 60, 0.0)])
    world.add_field(Field("trail", cell=5)).deposit([(2.0, 7.0)], 1.0)
    picture = Camera(HALL, longest_side=400).picture(world)
    assert colour(picture, -50, 30) == "#123456"
    assert colour(picture, -53, 60) == LIGHT.values[-1]
    assert colour(picture, 20, 30) == LIGHT.obstacle
    assert colour(picture, 2, 7) not in (LIGHT.ground, LIGHT.obstacle)


def test_what_reaches_over_the_edge_is_cut_off():
    picture = pictured([(-98, 2, 0.0), (98, 98, 0.0)])
    assert colour(picture, -100, 1) == LIGHT.robot
    assert colour(picture, 99.4, 98) == LIGHT.robot_front


def test_pictures_do_not_share_their_pixels():
    camera, world = Camera(HALL), World(map=HALL, rng=1)
    first = camera.picture(world)
    first[:] = 0
    assert camera.picture(world).any()
