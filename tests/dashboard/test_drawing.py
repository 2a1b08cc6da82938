"""The drawing of a world: well-formed, to scale, y up, colours by temperature."""

import re
from base64 import b64decode
from io import BytesIO
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from mesa_swarm.dashboard.gallery.gallery_drawing import (
    WorldDrawing,
    draw_field,
    draw_fires,
    draw_loads,
    draw_robots,
    draw_shapes,
    drawing,
    last_part,
    sight_of,
)
from mesa_swarm.dashboard.gallery.gallery_view import thumbnail, title
from mesa_swarm.models.foraging import Foraging
from mesa_swarm.viewing.palette import fire_colour
from mesa_swarm.world.shapes import disc, polygon, rectangle

NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]\d+)?")
ORIGIN = np.zeros(2)


def elements(svg: str) -> dict[str, list[dict]]:
    """Attributes of all elements by class."""
    found: dict[str, list[dict]] = {}
    for element in ElementTree.fromstring(svg).iter():
        found.setdefault(element.get("class", ""), []).append(element.attrib)
    return found


def numbers(outline: str) -> np.ndarray:
    return np.array([float(number) for number in NUMBER.findall(outline)])


def test_a_world_with_everything_in_it_is_well_formed_xml():
    shapes = [disc((20, 20), 5), rectangle((0, 0), (9, 60)), polygon([(30, 30), (50, 30), (40, 50)], contact=False)]
    position, fire = np.array([[40.0, 30.0]]), (np.array([[60.0, 40.0]]), np.array([8.0]))
    svg = drawing(
        (80, 60),
        [
            draw_shapes(shapes, ORIGIN),
            draw_fires(*fire, np.array([0.5]), np.array([False])),
            draw_robots(position, np.array([1.0]), np.array([3.0])),
        ],
    )
    assert {"obstacle", "mark", "fire", "rear", "front", "heading"} <= elements(svg).keys()
    assert ElementTree.fromstring(svg).get("viewBox") == "0 0 80 60"


def test_an_empty_world_has_only_its_ground():
    none = np.zeros((0, 2)), np.zeros(0)
    layers = [draw_shapes([], ORIGIN), draw_robots(*none, np.zeros(0)), draw_fires(*none, np.zeros(0), np.zeros(0))]
    assert len(list(ElementTree.fromstring(drawing((8, 6), layers)).iter())) == 3


@pytest.mark.parametrize("radius", [0.05, 5.0, 300.0])
def test_robots_are_discs_of_their_own_radius_at_their_own_place(radius):
    drawn = elements(drawing((800, 600), [draw_robots(np.array([[40.0, 30.0]]), np.array([0.7]), np.array([radius]))]))
    for half in (*drawn["rear"], *drawn["front"]):
        x1, y1, rx, ry, _, _, _, x2, y2 = numbers(half["d"])
        assert (rx, ry) == (radius, radius)
        assert ((x1 + x2) / 2, (y1 + y2) / 2) == pytest.approx((40, 30), abs=0.002)
        assert np.hypot(x1 - x2, y1 - y2) == pytest.approx(2 * radius, abs=0.002)


def test_the_light_half_of_a_robot_is_the_one_ahead():
    drawn = elements(drawing((80, 60), [draw_robots(np.array([[40.0, 30.0]]), np.array([0.0]), np.array([5.0]))]))
    # Counter-clockwise from its right hand to its left hand: over the front of a robot that faces east.
    assert numbers(drawn["front"][0]["d"]).tolist() == [40, 25, 5, 5, 0, 0, 1, 40, 35]
    assert numbers(drawn["heading"][0]["d"]).tolist() == [40, 30, 45, 30]


def test_marked_robots_have_another_colour_and_all_have_light_fronts():
    position, marked = np.array([[40.0, 30.0], [60.0, 30.0], [20.0, 30.0]]), np.array([False, True, False])
    drawn = elements(drawing((80, 60), [draw_robots(position, np.zeros(3), np.full(3, 5.0), marked)]))
    assert [drawn[kind][0]["d"].count("Z") for kind in ("rear", "hot", "front")] == [2, 1, 3]
    assert drawn["rear"][0]["fill"] != drawn["hot"][0]["fill"]


def test_a_window_shows_a_part_of_the_map_with_y_up():
    assert ElementTree.fromstring(drawing((800, 600), [], (100, 50, 400, 300))).get("viewBox") == "100 250 400 300"


def test_a_field_is_as_opaque_as_its_levels_and_has_row_0_below():
    levels = np.arange(12, dtype=np.uint8).reshape(3, 4) * 20
    drawn = elements(drawing((80, 60), [draw_field(levels, (80.0, 60.0), 0, "one")]))
    (field,) = drawn["field"]
    assert (field["width"], field["height"], field["mask"]) == ("80", "60", "url(#one)")
    (image,) = ElementTree.fromstring(drawing((80, 60), [draw_field(levels, (80.0, 60.0), 0, "one")])).iter(
        "{http://www.w3.org/2000/svg}image"
    )
    pixels = np.asarray(Image.open(BytesIO(b64decode(image.get("href").partition(",")[2]))))
    assert pixels.tolist() == levels.tolist()  # the group around it is turned upside down


def test_a_trail_is_the_last_part_of_a_way_or_all_of_a_shorter_one():
    way = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])
    assert last_part(way, 12.0).tolist() == [[8.0, 0.0], [10.0, 0.0], [10.0, 10.0]]
    assert last_part(way, 20.0).tolist() == way.tolist()
    assert last_part(way, 99.0).tolist() == way.tolist()
    standing = np.full((3, 2), 7.0)
    assert last_part(standing, 5.0).tolist() == standing.tolist()


@pytest.fixture(scope="module")
def sights():
    """Steps of a model in which food is carried, eaten, and added."""
    model, found = Foraging(n_robots=6, rng=1), []
    for _ in range(5):
        model.run(80)
        found.append(sight_of(model))
    return found


def test_a_moving_drawing_begins_with_the_one_at_rest(sights):
    world = WorldDrawing(sights[1:], before=sights[:1], name="own", trail=30.0)
    still, moving = elements(world.still()), ElementTree.fromstring(world.moving(4.0))
    robots = [one for one in moving.iter() if one.get("class") == "robot"]
    places = np.array([numbers(one.get("transform"))[:2] for one in robots])
    assert places == pytest.approx(sights[1].frame["position"], abs=0.051)
    assert len(still["trail"]) == len([one for one in moving.iter() if one.get("class") == "trail"]) == 6
    firsts = [animation.get("values").split(";")[0] for animation in moving.iter() if "values" in animation.attrib]
    assert firsts
    for robot in robots:
        moves = [one.get("values").split(";")[0] for one in robot if one.tag.endswith("animateTransform")]
        assert robot.get("transform") == f"translate({moves[0]}) rotate({moves[1]})"


def test_loads_that_come_and_go_are_shown_while_they_are_there(sights):
    moving = ElementTree.fromstring(WorldDrawing(sights, name="own").moving(4.0))
    shown = [one for one in moving.iter() if one.get("class") == "body"]
    loads = {int(number) for sight in sights for number in sight.frame["loads"]["load"]}
    assert len(shown) == len(loads) > len(sights[0].frame["loads"])
    changing = [one for one in shown for part in one if part.get("attributeName") == "visibility"]
    always = set.intersection(*({int(one) for one in sight.frame["loads"]["load"]} for sight in sights))
    assert len(changing) == len(loads) - len(always)


def test_what_never_enters_the_window_is_left_out_of_a_moving_drawing(sights):
    whole, corner = (
        WorldDrawing(sights, name="own", window=window).moving(4.0) for window in (None, (0.0, 0.0, 40.0, 30.0))
    )
    assert corner.count('class="robot"') < whole.count('class="robot"') == 6


def test_y_points_up():
    svg = drawing((80, 60), [draw_robots(np.array([[40.0, 10.0]]), np.array([np.pi / 2]), np.array([5.0]))])
    group = ElementTree.fromstring(svg).find("{*}g")
    assert group.get("transform") == "translate(0 60) scale(1 -1)"
    assert numbers(elements(svg)["heading"][0]["d"])[3] == 15


def test_a_map_that_does_not_start_at_the_origin_is_drawn_from_its_corner():
    drawn = elements(drawing((80, 60), [draw_shapes([disc((1e7 + 40, -30), 5)], np.array([1e7, -60.0]))]))
    assert numbers(drawn["obstacle"][0]["d"])[:2].tolist() == [35, 30]


def test_discs_run_the_same_way_round_as_polygons_so_that_overlaps_stay_filled():
    round_one, square = (
        numbers(elements(drawing((80, 60), [draw_shapes([shape], ORIGIN)]))["obstacle"][0]["d"])
        for shape in (disc((20, 20), 5), rectangle((0, 0), (9, 60)))
    )
    x, y = square.reshape(-1, 2).T
    clockwise = np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) < 0
    sweep = round_one[6]
    assert clockwise == (sweep == 0)


def test_loads_have_a_colour_of_their_own():
    layers = [draw_shapes([disc((20, 20), 5)], ORIGIN), draw_loads([disc((60, 20), 5)], ORIGIN)]
    drawn = elements(drawing((80, 60), layers))
    assert drawn["load"][0]["fill"] != drawn["obstacle"][0]["fill"]
    assert numbers(drawn["load"][0]["d"])[:2].tolist() == [55, 20]


def test_fires_go_from_black_to_red_with_their_temperature():
    reds = [int(fire_colour(t)[1:3], 16) for t in np.linspace(0, 1, 11)]
    assert reds == sorted(set(reds))
    assert reds[0] < 32
    assert reds[-1] > 224
    assert int(fire_colour(1.0)[3:], 16) < 0x2020


def test_a_fire_that_is_out_is_grey():
    place = np.array([[40.0, 30.0]]), np.array([8.0])
    fill = elements(drawing((80, 60), [draw_fires(*place, np.array([0.0]), np.array([True]))]))["fire"][0]["fill"]
    red, green, blue = (int(fill[i : i + 2], 16) for i in (1, 3, 5))
    assert max(red, green, blue) - min(red, green, blue) < 16


def test_numbers_are_rounded():
    text = draw_robots(np.array([[100 / 3, 200 / 3]]), np.array([1 / 7]), np.array([5.0]))
    assert max(len(number) for number in NUMBER.findall(text)) <= 7


def test_a_model_of_the_gallery_has_a_title_and_a_thumbnail_that_is_drawn_once():
    assert title("fire_fighting") == "Fire fighting"
    assert thumbnail("fire_fighting").startswith("<svg")
    assert thumbnail("fire_fighting") is thumbnail("fire_fighting")
