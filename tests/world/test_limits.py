"""Limits and defaults of worlds: what is documented is accepted, and what is beyond it refused."""

import math

import numpy as np
import pytest

from mesa_swarm import Map, SwarmModel, disc, polygon, rectangle
from mesa_swarm.base.errors import InvalidValueError, MapError, PlacementError
from mesa_swarm.maps.map import FireSpot, read_legacy
from mesa_swarm.maps.map_parts import Work, file_content, refusal
from mesa_swarm.maps.random_map import random_map
from mesa_swarm.maps.svg import chord_count, length, numbers, transform, viewbox_numbers
from mesa_swarm.maps.toml import number_text, parse_toml
from mesa_swarm.world.bodies import check_resistance
from mesa_swarm.world.placement import MOST_ROBOTS
from mesa_swarm.world.shapes import MOST_VERTICES, check_rings
from support.scenes import blind


def hall(**changes):
    """Return a map."""
    return Map(**{"name": "hall", "bounds": (0, 0, 80, 60), **changes})


def legacy(text):
    return Map(**read_legacy(text, "hall.map", "hall"))


def drawing(content, **attributes):
    more = "".join(f' {name.replace("_", ":")}="{value}"' for name, value in attributes.items())
    return Map.from_svg(f'<svg width="80" height="60"{more}>{content}</svg>')


BOX = "Obstacle('rec', [[0, 0], [9, 9]])"
WITHIN = {
    "coordinates": (lambda: disc((1e9, -1e9), 1), lambda: disc((0, 1.001e9), 1), "at most 1e"),
    "coordinates of arrays": (
        lambda: check_rings(np.array([[1e9, 0], [0, -1e9], [1.0, 1.0]])),
        lambda: check_rings(np.array([[1.001e9, 0], [0, -1e9], [1.0, 1.0]])),
        "at most 1e",
    ),
    "radius": (lambda: disc((0, 0), 1e9), lambda: disc((0, 0), 1.001e9), "radius is"),
    "corners": (lambda: polygon([(0, 0), (1, 0), (0, 1)]), lambda: polygon([(0, 0), (1, 0)]), "fewer than 3"),
    "corners of holes": (
        lambda: polygon([(0, 0), (9, 0), (0, 9)], [[(1, 1), (2, 1), (1, 2)]]),
        lambda: polygon([(0, 0), (9, 0), (0, 9)], [[(1, 1), (2, 1)]]),
        "fewer than 3",
    ),
    "points of an array": (
        lambda: check_rings(np.zeros((MOST_VERTICES, 2))),
        lambda: check_rings(np.zeros((MOST_VERTICES + 1, 2))),
        "more than 200000 points",
    ),
    "points of a list": (
        lambda: check_rings([(0, 0)] * 200_000),
        lambda: check_rings([(0, 0)] * 200_001),
        "more than 200000 points",
    ),
    "resistance": (lambda: check_resistance(1e9), lambda: check_resistance(1.001e9), "resistance is"),
    "fire's radius": (lambda: FireSpot((0, 0), 1e9), lambda: FireSpot((0, 0), 1.001e9), "radius of a fire is"),
    "fire's x": (lambda: FireSpot((-1e9, 0), 1), lambda: FireSpot((-1.001e9, 0), 1), "x of a fire is"),
    "fire's y": (lambda: FireSpot((0, 1e9), 1), lambda: FireSpot((0, 1.001e9), 1), "y of a fire is"),
    "fire's heat": (lambda: FireSpot((0, 0), 1, 1), lambda: FireSpot((0, 0), 1, 1.001), "temperature of a fire is"),
    "bounds": (
        lambda: hall(bounds=(-1e9, 0, 0, 1e9)),
        lambda: hall(bounds=(-1, 0, 1e9, 1)),
        "width of the map is 1e+09",
    ),
    "height": (lambda: hall(bounds=(0, 0, 1, 1e-9)), lambda: hall(bounds=(0, 1, 1, 1)), "height of the map is 0"),
    "tall": (lambda: hall(bounds=(0, 0, 1, 1e9)), lambda: hall(bounds=(0, -1, 1, 1e9)), "height of the map is 1e"),
    "name": (lambda: hall(name="x" * 200), lambda: hall(name="x" * 201), "at most 200 characters"),
    "obstacle at the left border": (
        lambda: hall(obstacles=[disc((-5, 30), 5)]),
        lambda: hall(obstacles=[disc((-5.001, 30), 5)]),
        "lies outside",
    ),
    "obstacle at the upper border": (
        lambda: hall(obstacles=[disc((40, 65), 5)]),
        lambda: hall(obstacles=[disc((40, 65.001), 5)]),
        "lies outside",
    ),
    "fire at a corner": (
        lambda: hall(fires=[FireSpot((83, 64), 5)]),
        lambda: hall(fires=[FireSpot((83, 64.001), 5)]),
        "lies outside",
    ),
    "number of a random map": (lambda: random_map(0, obstacles=0), lambda: random_map(-1), "number is"),
    "obstacles of a random map": (
        lambda: random_map(0, obstacles=30, passage=200, size=(200, 200)),
        lambda: random_map(0, obstacles=31),
        "obstacles is",
    ),
    "passage": (
        lambda: random_map(0, obstacles=0, passage=200),
        lambda: random_map(0, obstacles=0, passage=200.1),
        "passage is",
    ),
    "size": (
        lambda: random_map(0, obstacles=0, size=(200, 10_000)),
        lambda: random_map(0, obstacles=0, size=(200, 10_001)),
        "size is",
    ),
    "least size": (
        lambda: random_map(0, obstacles=0, size=(10_000, 200)),
        lambda: random_map(0, obstacles=0, size=(10_000, 199)),
        "size is",
    ),
    "characters of a legacy map": (
        lambda: legacy(BOX + " " * (1_000_000 - len(BOX))),
        lambda: legacy(BOX + " " * (1_000_001 - len(BOX))),
        "more than 1000000 characters",
    ),
    "words of a legacy map": (
        lambda: legacy("\n" * (150_000 - 20) + BOX),
        lambda: legacy("\n" * (150_001 - 20) + BOX),
        "has 150,001 words",
    ),
    "nesting of a legacy map": (
        lambda: legacy("Obstacle('rec', [[[0, 0], [9, 9]]])"),
        lambda: legacy("Obstacle('rec', [[[[0, 0], [9, 9]]]])"),
        "plain numbers",
    ),
    "dots on a line": (
        lambda: parse_toml(".".join("abcdefghijk") + ".l = 1\n" * 1 + "m.n.o = 1", "job"),
        lambda: parse_toml(".".join("abcdefghijkl") + ".m = 1", "job"),
        "dotted names",
    ),
    "dots in a file": (
        lambda: parse_toml("".join(f"a{i}.b.c = 1\n" for i in range(2000)), "job"),
        lambda: parse_toml("".join(f"a{i}.b.c = 1\n" for i in range(2001)), "job"),
        "line 2001: has dotted names of more than 10 dots, or 2000 in the file",
    ),
    "elements of a drawing": (
        lambda: drawing("<g/>" * 9_999),
        lambda: drawing("<g/>" * 10_000),
        "more than 10000 elements",
    ),
    "depth of a drawing": (
        lambda: drawing("<g>" * 99 + "</g>" * 99),
        lambda: drawing("<g>" * 100 + "</g>" * 100),
        "deeper than 100 groups",
    ),
    "an attribute": (
        lambda: drawing(f'<g id="{"x" * 5000}"/>'),
        lambda: drawing(f'<g id="{"x" * 5001}"/>'),
        "more than 5000 characters",
    ),
    "a namespace": (
        lambda: drawing("", xmlns_a="x" * 500),
        lambda: drawing("", xmlns_a="x" * 501),
        "more than 500 characters",
    ),
    "a transform": (
        lambda: transform("scale(2)" + " " * 492),
        lambda: transform("scale(2)" + " " * 493),
        "transform is",
    ),
    "an entry of a transform": (
        lambda: transform("translate(1e12 -1e12)"),
        lambda: transform("translate(0 -1.001e12)"),
        "beyond 1e+12",
    ),
    "a length": (
        lambda: length("r", " 5mm" + " " * 96),
        lambda: length("r", " 5m"),
        "expected a length",
    ),
    "chords": (lambda: chord_count(10_000), lambda: chord_count(10_000.1), "far larger than the map"),
    "numbers of an attribute": (
        lambda: numbers("points", "1 " * 400_000),
        lambda: numbers("points", "1 " * 400_001),
        "more than 200000 points",
    ),
    "view box": (
        lambda: viewbox_numbers("-1e9 -7 1e9 1e9"),
        lambda: viewbox_numbers("0 0 1 1.001e9"),
        "height of viewBox is",
    ),
    "corner of a view box": (
        lambda: viewbox_numbers("1e9 -1e9 1 1"),
        lambda: viewbox_numbers("1.001e9 0 1 1"),
        "x of viewBox is",
    ),
    "side of a drawing": (
        lambda: Map.from_svg('<svg width="1e9" height="1e-3"/>'),
        lambda: Map.from_svg('<svg width="1.001e9" height="1"/>'),
        "width is",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", WITHIN)
def test_values_are_accepted_up_to_their_limits_and_refused_beyond(what):
    right, wrong, words = WITHIN[what]
    right()
    with pytest.raises((InvalidValueError, MapError)) as caught:
        wrong()
    assert words in str(caught.value)


def test_a_file_is_read_up_to_its_limit(tmp_path):
    path = tmp_path / "hall.toml"
    path.write_bytes(b"#" * 100)
    assert len(file_content(path, 100)) == 100
    with pytest.raises(MapError, match="has 100 bytes; expected at most 99"):
        file_content(path, 99)
    path.write_bytes(b"")
    with path.open("r+b") as large:
        large.truncate(20_000_001)
    with pytest.raises(MapError, match="has 20000001 bytes; expected at most 20000000"):
        Map.load(path)
    legacy_file = path.rename(tmp_path / "hall.map")
    with pytest.raises(MapError, match="has 20000001 bytes; expected at most 1000000"):
        Map.load(legacy_file)


def test_a_text_of_a_refusal_loses_its_middle_only_if_it_is_longer_than_300_characters():
    assert str(refusal("hall.map", "", "w" * 290)) == f"hall.map: {'w' * 290}"
    long = str(refusal("hall.map", "", "w" * 280 + " is wrong; expected less"))
    assert len(long) == 300
    assert (long[:12], long[-24:]) == ("hall.map: ww", " is wrong; expected less")
    assert " ... " in long
    assert str(refusal("hall.map", "line 3", " two\n lines ")) == "hall.map: line 3: two lines"


def test_whole_numbers_have_no_point_as_far_as_every_whole_number_is_a_float():
    assert [number_text(x) for x in (3.0, -0.5, 2.0**53 - 1, -(2.0**53) + 1)] == [
        *("3", "-0.5", "9007199254740991", "-9007199254740991")
    ]
    assert number_text(2.0**54) == repr(2.0**54)


def test_work_may_be_spent_to_the_last_and_grows_with_files_above_a_megabyte():
    work = Work(10)
    with pytest.raises(InvalidValueError, match="more work than its file may make"):
        work.spend(work.left * 1.001)
    work.spend(work.left)
    work.spend(0.0)
    with pytest.raises(InvalidValueError, match="more work"):
        work.spend(1e-3)
    assert Work(0).left == Work(1_000_000).left == Work(2_000_000).left / 2


def test_more_than_ten_million_robots_are_more_than_one_world_holds():
    model = SwarmModel(map=Map(name="vast", bounds=(0, 0, 8e8, 8e8)), rng=1)
    with pytest.raises(PlacementError, match=r"10000001 robots of radius 5 do not fit on one world.*10000000 would"):
        model.add_robots(blind(), 10_000_001)
    assert MOST_ROBOTS == 10_000_000


def test_a_shape_is_solid_unless_it_is_to_be_a_mark():
    for make in (lambda **o: disc((0, 0), 1, **o), lambda **o: rectangle((0, 0), (1, 2), **o),
                 lambda **o: polygon([(0, 0), (1, 0), (0, 1)], **o)):  # fmt: skip
        assert make().contact is True
        assert make(contact=0).contact is False
        assert make(contact=1) == make()


def test_random_maps_have_eight_obstacles_and_wide_passages_unless_asked_otherwise():
    assert random_map(3) == random_map(3, obstacles=8, passage=30.0, size=(800.0, 600.0))
    assert random_map(3) != random_map(3, passage=90)


def test_a_fire_spot_is_at_its_hottest_unless_asked_otherwise():
    assert FireSpot((1, 2), 3) == FireSpot((1, 2), 3, 1.0)
    fire = "[[fire]]\ncentre = [1, 2]\nradius = 3\n"
    assert Map.from_toml("name = 'hall'\nwidth = 80\nheight = 60\n" + fire).fires[0].temperature == 1.0
    assert drawing('<circle class="fire" cx="1" cy="2" r="3"/>').fires[0].temperature == 1.0
    assert math.isclose(FireSpot((1, 2), 3).area, 0.09)
