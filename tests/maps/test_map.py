"""Maps: the built-in ones, TOML, saving, and every way in which a map can be wrong."""

import errno
import math
import os
import re
from pathlib import Path

import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from mesa_swarm.base.errors import InvalidValueError, MapError
from mesa_swarm.maps import map as map_module
from mesa_swarm.maps.map import FireSpot, Map, builtin_maps
from mesa_swarm.maps.toml import parse_toml
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.world.shapes import disc, polygon, rectangle
from support.pace import work_within

HEAD = "name = 'hall'\nwidth = 80\nheight = 60\n"
FILES = Path(map_module.__file__).parent / "standard"


@st.composite
def star_polygons(draw, centre, reach):
    """Draw simple polygons around a centre, some with a hole."""
    lengths = draw(st.lists(st.floats(0.3 * reach, reach), min_size=3, max_size=9))
    turn = draw(st.floats(0, 6))
    angles = [turn + 2 * math.pi * i / len(lengths) for i in range(len(lengths))]
    x, y = centre
    outline = [(x + r * math.cos(a), y + r * math.sin(a)) for r, a in zip(lengths, angles, strict=True)]
    hole = [(x + 0.5 * (px - x), y + 0.5 * (py - y)) for px, py in outline]
    return polygon(outline, [hole] if draw(st.booleans()) else [], contact=draw(st.booleans()))


@st.composite
def maps(draw):
    """Draw maps anywhere in the plane, with every kind of shape, and with awkward floats."""
    x, y = draw(st.sampled_from([0.0, -300.0, 0.1])), draw(st.floats(-1e4, 1e4))
    width, height = draw(st.floats(0.5, 1e4)), draw(st.floats(0.5, 1e4))
    points = st.tuples(st.floats(x, x + width), st.floats(y, y + height))
    sizes = st.floats(1e-3, 1e3)
    discs = st.builds(disc, points, sizes, contact=st.booleans())
    boxes = st.builds(lambda p, w, h: rectangle(p, (p[0] + w, p[1] - h)), points, sizes, sizes)
    stars = points.flatmap(lambda p: sizes.flatmap(lambda reach: star_polygons(p, reach)))
    fires = st.builds(FireSpot, points, sizes, st.floats(0.01, 1))
    name = draw(st.text(st.characters(categories=["L", "N", "P", "S"]), min_size=1, max_size=9))
    obstacles, spots = draw(st.lists(discs | boxes | stars, max_size=5)), draw(st.lists(fires, max_size=3))
    try:
        return Map(name=name, bounds=(x, y, x + width, y + height), obstacles=obstacles, fires=spots)
    except InvalidValueError:  # the hole of a star may be all of it that is within the bounds
        reject()


def one_line(error: pytest.ExceptionInfo) -> str:
    """Return the message, having made sure that it is one line of readable length."""
    text = str(error.value)
    assert "\n" not in text
    assert len(text) < 400
    return text


@pytest.mark.parametrize("name", builtin_maps())
def test_reading_the_svg_gives_the_same_map_as_the_toml(name):
    assert Map.load(FILES / f"{name}.svg") == Map.load(FILES / f"{name}.toml") == Map.load(name)


def test_the_original_map_is_the_one_of_the_thesis():
    boxes = [(0, 0, 20, 600), (0, 0, 800, 20), (780, 0, 800, 600), (0, 580, 800, 600), (70, 70, 110, 530)]
    boxes += [(110, 280, 400, 320), (220, 0, 260, 150), (480, 0, 520, 500)]
    discs = [(650, 160, 30), (650, 360, 30), (300, 450, 50)]
    flipped = [rectangle((x0, 600 - y0), (x1, 600 - y1)) for x0, y0, x1, y1 in boxes]
    flipped += [disc((x, 600 - y), radius) for x, y, radius in discs]
    original = Map.load("original")
    assert original.obstacles == tuple(flipped)
    assert original.bounds == (0, 0, 800, 600)


def test_maze_is_another_name_of_sparse():
    assert Map.load("maze") == Map.load("sparse")


def test_the_fire_map_has_its_large_fire_second_and_in_the_centre():
    fires = Map.load("openspace_fire").fires
    assert len(fires) == 7
    assert (fires[1].position, fires[1].area) == ((400, 300), 16)
    assert all(1.5 <= fire.area <= 4 for i, fire in enumerate(fires) if i != 1)


def test_robots_get_around_every_fire_of_the_fire_map():
    for fire in Map.load("openspace_fire").fires:
        x, y = fire.position
        assert min(x - 20, 780 - x, y - 20, 580 - y) - fire.radius >= 60


def test_a_map_is_loaded_as_itself():
    hall = Map(name="hall", bounds=(0, 0, 80, 60))
    assert Map.load(hall) is hall


@settings(max_examples=40, deadline=None)
@given(maps())
def test_a_map_written_as_toml_reads_back_equal(drawn):
    assert Map.from_toml(drawn.to_toml()) == drawn


@settings(max_examples=40, deadline=None)
@given(maps())
def test_a_map_written_as_svg_reads_back_equal(drawn):
    assert Map.from_svg(drawn.to_svg()) == drawn


def test_a_written_map_has_a_line_for_each_number_and_whole_numbers_have_no_point():
    hall = Map(name="hall", bounds=(0, 0, 80, 60), obstacles=[disc((40, 20.5), 5)])
    *head, centre, radius = hall.to_toml().splitlines()[1:]
    assert head == ['name = "hall"', "width = 80", "height = 60", "", "[[obstacle]]", 'shape = "disc"']
    assert (centre, radius) == ("centre = [40, 20.5]", "radius = 5")
    assert '    <circle cx="40" cy="20.5" r="5"/>\n' in hall.to_svg()


def test_a_drawing_has_marks_brown_and_fires_the_paler_the_cooler_with_all_that_is_needed_to_read_it():
    marked = Map(
        name="hall", bounds=(-5, 3, 75, 63), obstacles=[rectangle((1, 4), (2, 6), contact=False)],
        fires=[FireSpot((30, 20), 5), FireSpot((50, 20.5), 5, 0.2)],
    )  # fmt: skip
    drawing = marked.to_svg()
    assert 'width="80" height="60" viewBox="0 0 80 60" data-bounds="-5 3 75 63"' in drawing
    assert '<g transform="translate(5 -3)">' in drawing
    assert '<rect class="mark" fill="#9c8858" x="1" y="4" width="1" height="2"/>' in drawing
    hot, cool = re.findall(r'r="5" data-temperature="(.*?)" fill="#e81c14" fill-opacity="(.*?)" stroke', drawing)
    assert (hot, cool) == (("1", "1.00"), ("0.2", "0.48"))
    assert drawing.count("<g ") == drawing.count("</g>") == 2
    moved = Map(name="hall", bounds=(0, 3, 75, 63))
    assert "data-bounds" in moved.to_svg()
    assert "data-bounds" not in Map(name="hall", bounds=(0, 0, 75, 63)).to_svg()


@pytest.mark.parametrize("name", ["x & <y> \"z\" 'w'", "back\\slash", "Häuschen 房子"])
def test_awkward_names_survive_both_formats(name):
    hall = Map(name=name, bounds=(0, 0, 80, 60))
    assert Map.from_toml(hall.to_toml()) == Map.from_svg(hall.to_svg()) == hall


@pytest.mark.parametrize("name", ["", "  ", " hall", "a\nb", "a\0b", "\ud800", "x" * 201, None, 5])
def test_names_that_do_not_fit_on_a_line_are_refused(name):
    with pytest.raises(InvalidValueError, match="name of the map"):
        Map(name=name, bounds=(0, 0, 80, 60))


@pytest.mark.parametrize(
    "bounds",
    [
        *((0, 0, 0, 60), (0, 0, -80, 60), (0, 0, math.nan, 60), (0, 0, math.inf, 60), (0, 0, 2e9, 60)),
        *((-1e9, 0, 1e9, 60), (0, 0, 80), 5, None, "wide", ("a", 0, 80, 60)),
    ],
)
def test_bounds_that_span_nothing_or_too_much_are_refused(bounds):
    with pytest.raises(InvalidValueError, match=r"bounds|width|height"):
        Map(name="hall", bounds=bounds)


@pytest.mark.parametrize("part", [{"obstacles": 5}, {"obstacles": ["disc"]}, {"fires": [disc((1, 1), 1)]}])
def test_parts_of_the_wrong_type_are_refused(part):
    with pytest.raises(InvalidValueError, match="expected a"):
        Map(name="hall", bounds=(0, 0, 80, 60), **part)


def test_an_obstacle_or_fire_outside_the_bounds_is_named():
    inside = disc((1, 1), 1)
    with pytest.raises(InvalidValueError, match=r"obstacle 2 at \(200, 1\) lies outside"):
        Map(name="hall", bounds=(0, 0, 80, 60), obstacles=[inside, disc((200, 1), 5)])
    with pytest.raises(InvalidValueError, match="fire 1 at"):
        Map(name="hall", bounds=(0, 0, 80, 60), fires=[FireSpot((1, -50), 20)])


def test_an_obstacle_that_reaches_into_the_map_may_stick_out_of_it():
    reaching = [disc((-4, 30), 5), rectangle((-9, -9), (1, 1))]
    assert list(Map(name="hall", bounds=(0, 0, 80, 60), obstacles=reaching).obstacles) == reaching


@pytest.mark.parametrize(
    "arguments",
    [
        *(((1, 1), 0), ((1, 1), -3), ((1, 1), math.nan), ((math.inf, 1), 3), ((1,), 3), (5, 3), ("ab", 3)),
        *(((1, 1), 3, 0), ((1, 1), 3, 1.5), ((1, 1), 3, math.nan), ((1, 1), 3, "hot")),
    ],
)
def test_fires_without_size_place_or_heat_are_refused(arguments):
    with pytest.raises(InvalidValueError, match="of a fire is"):
        FireSpot(*arguments)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("name = hall", "line 1, column 8"),
        (HEAD + "[[obstacle]\n", "line 4, column 11"),
        ("width = 80\nheight = 60", "name is missing"),
        ("name = 'hall'\nwidth = 80", "height is missing"),
        (HEAD + "hieght = 3", "did you mean 'height'"),
        (HEAD + "bounds = [0, 0, 1, 1]", "keep one of them"),
        (HEAD + "origin = 5", "origin"),
        (HEAD + "origin = [nan, 0]", "origin is nan"),
        (HEAD + "obstacle = 5", "double brackets"),
        (HEAD + "obstacle = [5]", "obstacle 1: is 5"),
        (HEAD + "[obstacle]\nshape = 'disc'", "double brackets"),
        (HEAD + "[[obstacle]]\nshape = 'dics'", "obstacle 1: unknown shape 'dics'; did you mean 'disc'"),
        (HEAD + "[[obstacle]]\ncentre = [1, 1]", "obstacle 1: shape is missing"),
        (HEAD + "[[obstacle]]\nshape = 'disc'\ncentre = [1, 1]\nradius = -2", "obstacle 1: radius is -2"),
        (HEAD + "[[obstacle]]\nshape = 'disc'\ncentre = [1, 1]\nradios = 2", "did you mean 'radius'"),
        (HEAD + "[[obstacle]]\nshape = 'disc'\ncentre = 2020-01-01\nradius = 2", "obstacle 1: centre"),
        (HEAD + "[[obstacle]]\nshape = 'disc'\ncentre = ['1', '1']\nradius = 2", "obstacle 1: centre"),
        (HEAD + "[[obstacle]]\nshape = 'disc'\ncentre = [1, 1]\nradius = 0x" + "f" * 9000, "a huge int"),
        (HEAD + "[[obstacle]]\nshape = 'disc'\ncentre = [1, 1]\nradius = " + "9" * 9000, "4300 digits"),
        (HEAD + "[[obstacle]]\nshape = 'rectangle'\ncorners = [[0, 0]]", "obstacle 1: corners"),
        (HEAD + "[[obstacle]]\nshape = 'rectangle'\ncorners = [[0, 0], [0, 9]]", "no area"),
        (HEAD + "[[obstacle]]\nshape = 'polygon'\noutline = [[0,0],[9,9],[9,0],[0,9]]", "not simple"),
        (HEAD + "[[obstacle]]\nshape = 'polygon'\noutline = 5", "obstacle 1: outline is 5"),
        (HEAD + "[[obstacle]]\nshape = 'disc'\ncentre = [1, 1]\nradius = 2\nmark = 1", "mark is 1"),
        (HEAD + "[[obstacle]]\nshape = 'disc'\ncentre = [500, 1]\nradius = 2", "obstacle 1 at (500, 1)"),
        (
            HEAD + "[[fire]]\ncentre = [1, 1]\nradius = 2\n[[fire]]\ncentre = [nan, 1]\nradius = 1",
            "fire 2: x",
        ),
        (HEAD + "[[fire]]\ncentre = [1, 1]\nradius = inf", "fire 1: radius of a fire is inf"),
        (HEAD + "a = " + "[" * 5000, ""),
    ],
    ids=lambda value: value[:40],
)
def test_a_wrong_toml_map_is_refused_with_its_place(text, place):
    with pytest.raises(MapError) as error:
        Map.from_toml(text, "hall.toml")
    assert one_line(error).startswith("hall.toml: ")
    assert place in one_line(error)


def test_origin_moves_the_bounds():
    assert Map.from_toml(HEAD + "origin = [-40, -30]").bounds == (-40, -30, 40, 30)


def test_a_missing_file_is_reported_with_the_nearest_built_in_name(tmp_path):
    for missing in ("orginal", "orginal.toml", tmp_path / "orginal.svg"):
        with pytest.raises(MapError, match="did you mean 'original'") as error:
            Map.load(missing)
        one_line(error)


@pytest.mark.parametrize("source", [None, 5, 1.5, ["original"], b"original"])
def test_what_is_no_map_name_or_path_is_refused(source):
    with pytest.raises(MapError, match="expected a Map, a name or a path"):
        Map.load(source)


@pytest.mark.parametrize("source", ["", "a\0b.toml", "x" * 5000, "two\nlines.svg", "/", "."])
def test_impossible_paths_are_refused_on_one_line(source):
    with pytest.raises(MapError) as error:
        Map.load(source)
    one_line(error)


@pytest.mark.parametrize("suffix", [".toml", ".svg", ".map"])
def test_a_folder_is_not_a_map(tmp_path, suffix):
    folder = tmp_path / f"hall{suffix}"
    folder.mkdir()
    with pytest.raises(MapError, match="folder"):
        Map.load(folder)


@pytest.mark.parametrize("suffix", [".toml", ".svg", ".map"])
def test_binary_garbage_is_refused_on_one_line(tmp_path, suffix):
    path = tmp_path / f"hall{suffix}"
    path.write_bytes(bytes(range(256)) * 40)
    with pytest.raises(MapError, match="hall") as error:
        Map.load(path)
    one_line(error)


@pytest.mark.parametrize("suffix", [".toml", ".svg", ".map"])
def test_a_file_of_100_megabytes_is_refused_within_a_second(tmp_path, suffix):
    path = tmp_path / f"hall{suffix}"
    path.touch()
    os.truncate(path, 100_000_000)
    with work_within(1), pytest.raises(MapError, match="100000000 bytes"):
        Map.load(path)


def test_a_named_pipe_is_refused_instead_of_waited_for(tmp_path):
    os.mkfifo(tmp_path / "hall.toml")
    with pytest.raises(MapError, match="expected a file"):
        Map.load(tmp_path / "hall.toml")


def test_other_suffixes_are_refused_for_reading_and_writing(tmp_path):
    (tmp_path / "hall.png").touch()
    with pytest.raises(MapError, match=r"\.toml, \.svg, \.map"):
        Map.load(tmp_path / "hall.png")
    with pytest.raises(MapError, match=r"\.toml, \.svg$"):
        Map.load("sparse").save(tmp_path / "hall.map")


@pytest.mark.parametrize("suffix", [".toml", ".svg", ".SVG"])
def test_a_saved_map_is_loaded_equal_and_leaves_nothing_else_behind(tmp_path, suffix):
    Map.load("original").save(tmp_path / f"hall{suffix}")
    assert Map.load(str(tmp_path / f"hall{suffix}")) == Map.load("original")
    assert len(list(tmp_path.iterdir())) == 1


def test_a_file_with_a_byte_order_mark_and_windows_lines_is_read(tmp_path):
    path = tmp_path / "hall.toml"
    path.write_bytes(b"\xef\xbb\xbf" + HEAD.replace("\n", "\r\n").encode())
    assert Map.load(path).bounds == (0, 0, 80, 60)


@pytest.mark.parametrize("failing", ["fsync", "replace"])
def test_a_write_that_fails_leaves_the_old_file_and_no_draft(tmp_path, monkeypatch, failing):
    def fail(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    path = tmp_path / "hall.toml"
    Map.load("sparse").save(path)
    monkeypatch.setattr(map_module.os, failing, fail)
    with pytest.raises(MapError, match="cannot be written: No space left"):
        Map.load("original").save(path)
    assert Map.load(path) == Map.load("sparse")
    assert list(tmp_path.iterdir()) == [path]


def test_saving_into_a_missing_folder_or_over_a_folder_is_an_error_of_one_line(tmp_path):
    (tmp_path / "taken.toml").mkdir()
    for target in (tmp_path / "missing" / "hall.toml", tmp_path / "taken.toml"):
        with pytest.raises(MapError, match="cannot be written") as error:
            Map.load("sparse").save(target)
        one_line(error)


@pytest.mark.slow
def test_a_polygon_of_a_hundred_thousand_corners_goes_through_both_formats():
    ring = [
        (400 + 300 * math.cos(i / 1e5 * math.tau), 300 + 300 * math.sin(i / 1e5 * math.tau)) for i in range(100_000)
    ]
    large = Map(name="large", bounds=(0, 0, 800, 600), obstacles=[polygon(ring)])
    svg, toml = large.to_svg(), large.to_toml()
    with work_within(2):
        assert Map.from_svg(svg) == large
    assert Map.from_toml(toml) == large


def test_a_file_far_down_in_folders_is_named_by_its_end(tmp_path):
    deep = tmp_path.joinpath(*["folder-with-a-long-name"] * 8)
    deep.mkdir(parents=True)
    path = deep / "hall.toml"
    path.write_bytes(b"\xff")
    with pytest.raises(MapError, match=r"^\.\.\..*/hall\.toml: ") as error:
        Map.load(path)
    assert len(str(error.value)) < 200


@pytest.mark.parametrize(
    "text",
    [
        ".".join("a" * 20_000) + " = 1",
        "1." * 20_000 + "1 = 1",
        ".".join(['"a"'] * 20_000) + " = 1",
        "".join(f"[{'.'.join('a' * 200)}.b{i}]\n" for i in range(1000)),
        "".join(f"{'.'.join([f'a{i}'] * 9)} = 1\n" for i in range(10_000)),
        "a = 'x' # \"\n" + 'b = """ \\""" # """\n' + ".".join("a" * 20_000) + " = 1",
        f"[{'.'.join('a' * 100)}]\n" + "".join(f"k{i} = 1\n" for i in range(80_000)),
    ],
    ids=["letters", "digits", "quotes", "headers", "lines", "after strings", "one header"],
)
def test_dotted_names_of_thousands_of_parts_are_refused(text):
    with work_within(1), pytest.raises(MapError, match="dotted names") as error:
        Map.from_toml(text)
    one_line(error)


def test_dots_in_remarks_and_strings_are_no_names():
    remarks = "".join(f"# shelf {i} of www.example.com\n" for i in range(3000))
    notes = "".join(f"  'rooms/room{i}.v2.toml', \"a.b.c\",\n" for i in range(3000))
    text = f"{remarks}maps = [\n{notes}]\nmore = '''\n{remarks}'''\nlearn.robot.speed = 3"
    assert parse_toml(text, "job.toml")["learn"] == {"robot": {"speed": 3}}


@pytest.mark.parametrize("height", ["5e-324", "1e-320"])
def test_a_map_of_almost_no_height_is_refused_without_a_warning(height):
    wall = '[[obstacle]]\nshape = "rectangle"\ncorners = [[0, 580], [800, 600]]\n'
    with pytest.raises(MapError, match="lies outside the map") as error:
        Map.from_toml(f'name = "flat"\nwidth = 800\nheight = {height}\n{wall}')
    one_line(error)


@pytest.mark.slow
def test_twenty_thousand_discs_in_a_map_of_our_own_are_read():
    crowd = Map(name="crowd", bounds=(0, 0, 80, 60), obstacles=[disc((40, 30), 5)] * 20_000)
    assert len(Map.from_toml(crowd.to_toml()).obstacles) == 20_000


@pytest.mark.parametrize(
    ("text", "name"),
    {
        "openspace_FIRE": "openspace_fire",
        "openspace_FIRE.map": "openspace_fire",
        "maze.map": "sparse",
        "sparse.map": "sparse",
        "Original": "original",
        "original.map": "original",
    }.items(),
)
def test_the_thesis_names_of_maps_load_the_built_in_ones(tmp_path, monkeypatch, text, name):
    monkeypatch.chdir(tmp_path)
    assert Map.load(text).name == name


def test_a_file_comes_before_a_built_in_map_of_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("original.map").write_text("[Obstacle('cir', [[20, 20], 10])]")
    assert Map.load("original.map").bounds == (0, 0, 30, 30)
    assert Map.load("original") == Map.load("Original") != Map.load("original.map")


@pytest.mark.parametrize(
    "source", ["original.toml", "maps/original", "./maze.svg", Path("original"), Path("openspace_FIRE")]
)
def test_a_missing_file_with_a_built_in_name_is_not_called_an_unknown_map(source):
    with pytest.raises(MapError, match=r"no such file: .* the built-in map is the text '\w+'$") as error:
        Map.load(source)
    assert "unknown" not in str(error.value)


@given(st.text("oOrRiIgGnNaAlL ._\u200bи", max_size=12))
def test_no_map_is_unknown_under_the_name_that_is_suggested(text):
    try:
        assert Map.load(text).name == "original"
    except MapError as error:
        found = re.search(r"unknown map (.*); did you mean (.*)\?", str(error))
        assert found is None or found[1] != found[2]


def test_a_map_of_obstacles_alone_has_the_size_of_the_maps_of_the_thesis():
    hall = Map(obstacles=[disc((40, 30), 5)])
    assert (hall.name, hall.bounds, len(hall.obstacles)) == ("map", Map.load("openspace").bounds, 1)
    assert Map.from_toml(hall.to_toml()) == hall
    assert len(SwarmModel(map=hall, rng=1).obstacles) == 1
