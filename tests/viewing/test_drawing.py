"""Drawings of worlds: well-formed, to scale, y up, colours by temperature, in both themes of a page."""

import re
from base64 import b64decode
from dataclasses import replace
from io import BytesIO
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from mesa_swarm import Field, Looks, Map, RobotDesign, SwarmModel, disc, polygon, rectangle
from mesa_swarm.maps.map import FireSpot
from mesa_swarm.models.foraging import Foraging
from mesa_swarm.recording.frames import PICTURED, frame_of
from mesa_swarm.viewing.drawing import WorldDrawing, drawing_of_model, last_part, scene_of_all
from mesa_swarm.viewing.palette import DARK, LIGHT, fire_colour, scalar_pixels
from mesa_swarm.viewing.scene import scene_of

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]\d+)?")
SHAPES = [disc((20, 20), 5), rectangle((0, 0), (9, 60)), polygon([(30, 30), (50, 30), (40, 50)], contact=False)]


def elements(svg: str) -> dict[str, list[dict]]:
    """Attributes of all elements by class, that of the light theme where there are two."""
    found: dict[str, list[dict]] = {}
    for element in ElementTree.fromstring(svg).iter():
        found.setdefault(element.get("class", "").removesuffix(" day"), []).append(element.attrib)
    return found


def numbers(outline: str) -> np.ndarray:
    return np.array([float(number) for number in NUMBER.findall(outline)])


def world(obstacles=(), poses=(), radius=3.0, bounds=(0, 0, 80, 60), fires=()) -> SwarmModel:
    """A world of 80 by 60 with these obstacles, robots and fires."""
    model = SwarmModel(map=Map(name="hall", bounds=bounds, obstacles=list(obstacles), fires=list(fires)), rng=1)
    if poses:
        model.add_robots(RobotDesign(radius=radius), poses=poses)
    return model


def drawn(*args, **more) -> dict[str, list[dict]]:
    return elements(drawing_of_model(world(*args, **more)))


def test_a_world_with_everything_in_it_is_well_formed_xml():
    svg = drawing_of_model(world(SHAPES, [(60, 20, 1.0)], fires=[FireSpot(position=(60, 40), radius=8)]))
    assert {"obstacles", "marks", "fire", "robots", "robot", "back"} <= elements(svg).keys()
    assert ElementTree.fromstring(svg).get("viewBox") == "0 0 80 60"


def test_an_empty_world_has_only_its_ground():
    tags = [element.tag.partition("}")[2] for element in ElementTree.fromstring(drawing_of_model(world())).iter()]
    assert sorted(tags) == ["defs", "g", "g", "g", "rect", "svg"]


@pytest.mark.parametrize("radius", [0.05, 5.0, 300.0])
def test_robots_are_discs_of_their_own_radius_at_their_own_place(radius):
    size = 200 * radius
    svg = drawing_of_model(world(poses=[(0.5 * size, 0.25 * size, 0.7)], radius=radius, bounds=(0, 0, size, size)))
    (robot,) = elements(svg)["robot"]
    x, y, turned = numbers(robot["transform"])
    assert (x, y) == pytest.approx((0.5 * size, 0.25 * size), abs=size / 8000)
    assert turned == round(np.degrees(0.7))
    (circle,) = ElementTree.fromstring(svg).findall(".//{*}defs//{*}circle")
    assert float(circle.get("r")) == pytest.approx(radius)


def test_robots_of_two_sizes_and_larger_ones_are_discs_of_their_own_radius():
    model = world(poses=[(20, 20, 0.0)])
    model.add_robots(RobotDesign(name="large", radius=6.0), poses=[(60, 30, 0.0)])
    svg = drawing_of_model(model, larger=2.0, name="own")
    radii = {
        body.get("id"): body.find("{*}circle").get("r") for body in ElementTree.fromstring(svg).iterfind(".//*[@id]")
    }
    assert radii == {"own-body0": "6", "own-body1": "12"}
    assert [back["href"] for back in elements(svg)["back"]] == ["#own-body0", "#own-body1"]


def test_the_light_half_of_a_robot_is_the_one_ahead():
    body = ElementTree.fromstring(drawing_of_model(world(poses=[(40, 30, 0.0)], radius=5.0))).find(".//*[@id]")
    front, heading = body.findall("{*}path")
    # Counter-clockwise from its right hand to its left hand: over the front of a robot that faces east.
    assert numbers(front.get("d")).tolist() == [0, -4.6, 4.6, 4.6, 0, 0, 1, 0, 4.6]
    assert heading.get("d") == "M0 0H5"
    assert front.get("fill") == "currentColor"


def test_marked_robots_have_another_colour_and_all_have_light_fronts():
    model = world(poses=[(40, 30, 0.0), (60, 30, 0.0), (20, 30, 0.0)])
    model.swarm.columns["hot"][1] = True
    shown = elements(drawing_of_model(model))
    assert [back["fill"] for back in shown["back"]] == [LIGHT.robot, LIGHT.robot_hot, LIGHT.robot]
    assert [back["fill"] for back in shown["back night"]] == [DARK.robot, DARK.robot_hot, DARK.robot]
    assert shown["robots"][0]["color"] == LIGHT.robot_front


def test_a_window_shows_a_part_of_the_map_with_y_up():
    model = world(bounds=(0, 0, 800, 600))
    part = WorldDrawing(frames=[frame_of(model)], scene=scene_of(model), window=(100, 50, 400, 300))
    assert ElementTree.fromstring(part.text()).get("viewBox") == "100 250 400 300"


def test_a_field_is_as_opaque_as_its_levels_and_has_row_0_below():
    model = world()
    field = model.add_field(Field("trail", cell=20.0))
    field.deposit(np.array([[10.0, 10.0], [70.0, 50.0]]), np.array([1.0, 0.25]))
    svg = drawing_of_model(model)
    for kind, palette in (("day", LIGHT), ("night", DARK)):
        (image,) = ElementTree.fromstring(svg).iterfind(f".//*[@class='field {kind}']")
        assert (image.get("width"), image.get("height")) == ("80", "60")
        pixels = np.asarray(Image.open(BytesIO(b64decode(image.get("href").partition(",")[2]))))
        # The group around it is turned upside down.
        assert pixels.tolist() == scalar_pixels(field.levels(), 0, palette).tolist()


def test_a_trail_is_the_last_part_of_a_way_or_all_of_a_shorter_one():
    way = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])
    assert last_part(way, 12.0).tolist() == [[8.0, 0.0], [10.0, 0.0], [10.0, 10.0]]
    assert last_part(way, 20.0).tolist() == way.tolist()
    assert last_part(way, 99.0).tolist() == way.tolist()
    standing = np.full((3, 2), 7.0)
    assert last_part(standing, 5.0).tolist() == standing.tolist()


@pytest.fixture(scope="module")
def moments():
    """Steps of a model in which food is carried, and removed and added by hand."""
    model, frames, scenes = Foraging(n_robots=6, rng=1), [], []
    for _ in range(5):
        model.run(80)
        frames.append(frame_of(model, PICTURED))
        scenes.append(scene_of(model))
        next(body for body in model.movers.agents if body.carrier is None).remove()
        model.add_food()
    return WorldDrawing(frames=frames, scene=scene_of_all(scenes), seconds=4.0, name="own")


def moving(pictured: WorldDrawing) -> list[ElementTree.Element]:
    return list(ElementTree.fromstring(pictured.text()).iter())


def test_a_moving_drawing_begins_with_the_one_at_rest(moments):
    pictured = replace(moments, frames=moments.frames[1:], before=moments.frames[:1], trail=30.0)
    still, parts = elements(pictured.first().text()), moving(pictured)
    assert "<animate" not in pictured.first().text()
    robots = [part for part in parts if part.get("class") == "robot"]
    places = np.array([numbers(robot.get("transform"))[:2] for robot in robots])
    assert places == pytest.approx(pictured.frames[0]["position"], abs=0.051)
    assert [robot.get("transform") for robot in robots] == [robot["transform"] for robot in still["robot"]]
    assert len(still["trail"]) == len([part for part in parts if part.get("class") == "trail"]) == 6
    for robot in robots:
        moves = [part.get("values").split(";")[0] for part in robot if part.tag.endswith("animateTransform")]
        assert robot.get("transform") == f"translate({moves[0]}) rotate({moves[1]})"


def test_the_trail_of_a_drawing_at_rest_ends_at_its_robot(moments):
    pictured = replace(moments, frames=moments.frames[1:], before=moments.frames[:1], trail=30.0).first()
    ends = [numbers(trail["points"])[-2:].tolist() for trail in elements(pictured.text())["trail"]]
    assert np.array(ends) == pytest.approx(pictured.frames[0]["position"], abs=0.051)


def test_loads_that_come_and_go_are_shown_while_they_are_there(moments):
    shown = [part for part in moving(moments) if part.get("class") == "load"]
    loads = {int(number) for frame in moments.frames for number in frame["loads"]["load"]}
    assert len(shown) == len(loads) > len(moments.frames[0]["loads"])
    changing = [load for load in shown for part in load if part.get("attributeName") == "visibility"]
    always = set.intersection(*({int(load) for load in frame["loads"]["load"]} for frame in moments.frames))
    assert len(changing) == len(loads) - len(always)


def test_what_never_enters_the_window_is_left_out_of_a_drawing(moments):
    corner = replace(moments, window=(0.0, 0.0, 40.0, 30.0))
    assert corner.text().count('class="robot"') < moments.text().count('class="robot"') == 6


def test_y_points_up():
    svg = drawing_of_model(world(poses=[(40, 10, np.pi / 2)], radius=5.0))
    group = ElementTree.fromstring(svg).find("{*}g")
    assert group.get("transform") == "translate(0 60) scale(1 -1)"
    assert elements(svg)["robot"][0]["transform"] == "translate(40 10) rotate(90)"


def test_a_map_that_does_not_start_at_the_origin_is_drawn_from_its_corner():
    shown = drawn([disc((1e7 + 40, -30), 5)], [(1e7 + 20, -20, 0.0)], bounds=(1e7, -60, 1e7 + 80, 0))
    assert numbers(shown["obstacles"][0]["d"])[:2].tolist() == [35, 30]
    assert numbers(shown["robot"][0]["transform"])[:2].tolist() == [20, 40]


def test_discs_run_the_same_way_round_as_polygons_so_that_overlaps_stay_filled():
    round_one, square = (numbers(drawn([shape])["obstacles"][0]["d"]) for shape in SHAPES[:2])
    x, y = square.reshape(-1, 2).T
    clockwise = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) < 0
    sweep = round_one[6]
    assert clockwise == (sweep == 0)


def test_loads_have_a_colour_of_their_own():
    model = world([disc((20, 20), 5)])
    model.add_body(disc((60, 20), 5), kind="puck", mode="pushed", resistance=0.5)
    shown = elements(drawing_of_model(model))
    assert (shown["body"][0]["fill"], shown["obstacles"][0]["fill"]) == (LIGHT.load, LIGHT.obstacle)
    assert numbers(shown["load"][0]["transform"])[:2].tolist() == [60, 20]


class Coloured(SwarmModel):
    looks = Looks(kinds={"nest": ("#c0c0ff", "#202060")})


def test_kinds_have_the_colours_that_their_model_declares_in_both_themes():
    model = Coloured(map="openspace", rng=1)
    model.add_body(disc((60, 20), 5), kind="nest", mode="fixed")
    shown = elements(drawing_of_model(model))
    assert "#c0c0ff" in [path["fill"] for path in shown["obstacles"]]
    assert "#202060" in [path["fill"] for path in shown["obstacles night"]]


def test_fires_go_from_black_to_red_with_their_temperature():
    reds = [int(fire_colour(t)[1:3], 16) for t in np.linspace(0, 1, 11)]
    assert reds == sorted(set(reds))
    assert reds[0] < 32
    assert reds[-1] > 224
    assert int(fire_colour(1.0)[3:], 16) < 0x2020


def test_a_fire_that_is_out_is_grey():
    model = world(fires=[FireSpot(position=(40, 30), radius=8)])
    model.fires.own["out"][:] = True
    fill = elements(drawing_of_model(model))["disc"][0]["fill"]
    red, green, blue = (int(fill[i : i + 2], 16) for i in (1, 3, 5))
    assert max(red, green, blue) - min(red, green, blue) < 16


def test_numbers_are_rounded():
    model = world(poses=[(100 / 3, 200 / 6, 1 / 7)])
    assert elements(drawing_of_model(model))["robot"][0]["transform"] == "translate(33.33 33.33) rotate(8)"
