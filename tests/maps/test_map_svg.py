"""SVG maps: what is read from a drawing of any editor, and what is refused."""

import itertools
import math
import re
from concurrent.futures import CancelledError

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm.base.errors import MapError
from mesa_swarm.maps import svg as map_svg
from mesa_swarm.maps.map import FireSpot, Map
from mesa_swarm.maps.map_parts import stop_reading_when
from mesa_swarm.maps.svg import TOLERANCE_OF_SIDE
from mesa_swarm.world.shapes import disc, polygon, rectangle
from support.pace import work_within

TOLERANCE = 800 * TOLERANCE_OF_SIDE
ROOT = '<svg xmlns="http://www.w3.org/2000/svg" width="800" height="600">\n{}\n</svg>'


def shapes(content):
    """Return the obstacles of a drawing of 800 x 600."""
    return Map.from_svg(ROOT.format(content)).obstacles


def shape(content):
    """Return the one obstacle of a drawing of 800 x 600."""
    (only,) = shapes(content)
    return only


def refused(content):
    """Return why a drawing is refused, on one line and within two seconds of work."""
    with work_within(2), pytest.raises(MapError) as error:
        Map.from_svg(content, "hall.svg")
    text = str(error.value)
    assert text.startswith("hall.svg: ")
    assert "\n" not in text
    assert len(text) <= 300
    return text


def test_y_is_turned_to_point_up():
    assert shape('<rect x="10" y="20" width="30" height="40"/>') == rectangle((10, 580), (40, 540))
    assert shape('<circle cx="10" cy="20" r="5"/>') == disc((10, 580), 5)
    assert shape('<polygon points="0,0 10,0,10 20"/>') == polygon([(0, 600), (10, 600), (10, 580)])


def test_a_drawing_without_namespace_or_title_is_named_after_its_file():
    assert Map.from_svg('<svg width="80" height="60"/>', "folder/hall.svg").name == "hall"


def test_the_title_names_the_map_and_titles_of_shapes_do_not():
    text = ROOT.format("<title> great\n hall </title><g><title>group</title></g>")
    assert Map.from_svg(text).name == "great hall"


@pytest.mark.parametrize(
    ("text", "pixels"),
    [
        ("96", 96),
        ("96px", 96),
        ("25.4mm", 96),
        ("2.54cm", 96),
        ("1in", 96),
        ("72pt", 96),
        ("6pc", 96),
        ("96e0", 96),
    ],
)
def test_lengths_have_units(text, pixels):
    assert shape(f'<circle cx="400" cy="300" r="{text}"/>').radius == pytest.approx(pixels, rel=1e-15)


def test_the_size_of_the_drawing_has_units_too():
    drawing = '<svg width="210mm" height="297mm" viewBox="0 0 210 297"><rect width="210" height="10"/></svg>'
    sheet = Map.from_svg(drawing)
    assert sheet.width == pytest.approx(210 / 25.4 * 96)
    assert sheet.obstacles[0].bounds == pytest.approx((0, sheet.height * 287 / 297, sheet.width, sheet.height))


@pytest.mark.parametrize("size", ["", 'width="100%" height="100%"', 'width="auto"'])
def test_a_drawing_without_size_has_that_of_its_view_box(size):
    drawn = Map.from_svg(f'<svg {size} viewBox="10 20 400 300"><circle cx="10" cy="20" r="5"/></svg>')
    assert drawn.bounds == (0, 0, 400, 300)
    assert drawn.obstacles == (disc((0, 300), 5),)


@pytest.mark.parametrize(
    ("aspect", "centre", "radius"),
    [
        ("", (400, 300), 60),
        ("xMinYMin", (300, 300), 60),
        ("xMaxYMax meet", (500, 300), 60),
        ("xMidYMin slice", (400, 200), 80),
        ("xMidYMax slice", (400, 400), 80),
    ],
)
def test_the_view_box_is_fitted_by_its_aspect(aspect, centre, radius):
    drawing = f'<svg width="800" height="600" viewBox="0 0 100 100" preserveAspectRatio="{aspect}">'
    (only,) = Map.from_svg(drawing + '<circle cx="50" cy="50" r="10"/></svg>').obstacles
    assert only.position == pytest.approx(centre)
    assert only.radius == pytest.approx(radius)


def test_a_view_box_may_be_stretched():
    drawing = '<svg width="800" height="600" viewBox="0 0 100 100" preserveAspectRatio="none">'
    (only,) = Map.from_svg(drawing + '<rect width="100" height="50"/></svg>').obstacles
    assert only == rectangle((0, 300), (800, 600))


def test_transforms_nest():
    content = '<g transform="scale(2)"><rect x="5" width="10" height="10"/></g>'
    assert shape(f'<g transform="translate(100 50)">{content}</g>') == rectangle((110, 550), (130, 530))
    assert shape('<rect width="10" height="5" transform="matrix(1 0 0 1 7 8)"/>') == rectangle((7, 592), (17, 587))


def test_a_right_angle_keeps_a_rectangle_a_rectangle():
    assert shape('<rect x="10" y="-40" width="20" height="10" transform="rotate(90)"/>').kind == "rectangle"


@pytest.mark.parametrize(
    "transform", ["rotate(30 100 100)", "scale(2)", "scale(-1 1) translate(-400 0)", "rotate(7)scale(.5)"]
)
def test_a_circle_stays_a_disc_under_a_similarity(transform):
    assert shape(f'<circle cx="200" cy="200" r="10" transform="{transform}"/>').kind == "disc"


@pytest.mark.parametrize("transform", ["scale(2 1)", "skewX(20)"])
def test_a_stretched_circle_becomes_a_polygon_within_the_tolerance(transform):
    squeezed = shape(f'<circle cx="200" cy="200" r="100" transform="{transform}"/>')
    linear = np.array([[2, 0], [0, 1]]) if "scale" in transform else np.array([[1, math.tan(math.radians(20))], [0, 1]])
    angles = np.linspace(0, math.tau, 5000)
    truth = np.column_stack([200 + 100 * np.cos(angles), 200 + 100 * np.sin(angles)]) @ linear.T
    truth[:, 1] = 600 - truth[:, 1]
    assert squeezed.kind == "polygon"
    assert shapely.distance(shapely.points(truth), squeezed.geometry.exterior).max() <= TOLERANCE


def test_an_ellipse_with_equal_radii_is_a_disc():
    assert shape('<ellipse cx="10" cy="10" rx="5" ry="5"/>') == disc((10, 590), 5)
    assert shape('<ellipse cx="50" cy="50" rx="20" ry="5"/>').geometry.area == pytest.approx(100 * math.pi, rel=0.02)


@pytest.mark.parametrize(("corners", "area"), [('rx="10"', 100), ('rx="10" ry="5"', 50), ('rx="99" ry="99"', 20 * 50)])
def test_rounded_rectangles_lose_their_corners(corners, area):
    rounded = shape(f'<rect x="9" y="9" width="100" height="40" {corners}/>')
    rx, ry = (50, 20) if "99" in corners else (10, 10 if "ry" not in corners else 5)
    assert rounded.geometry.area == pytest.approx(4000 - (4 - math.pi) * rx * ry, abs=TOLERANCE * 300)
    assert rounded.bounds == pytest.approx((9, 551, 109, 591))


def test_curves_of_a_path_stay_within_the_tolerance():
    circle = shape('<path d="M 100 300 a 100 100 0 1 0 200 0 a 100 100 0 1 0 -200 0 z"/>').geometry
    radii = np.hypot(*(np.array(circle.exterior.coords) - [200, 300]).T)
    assert radii == pytest.approx(100)
    assert circle.exterior.distance(shapely.Point(200, 300)) >= 100 - TOLERANCE


@pytest.mark.parametrize(
    ("path", "area"),
    [
        ("M 0 100 C 0 300 300 300 300 100 z", 36_000),
        ("M 0 100 c 0 200 300 200 300 0 z", 36_000),
        ("M 0 100 Q 150 370 300 100 z", 27_000),
        ("M 0 0 c 0 200 300 200 300 0 s 300 -200 300 0 v -200 h -600 z", 120_000),
    ],
)
def test_bezier_curves_have_the_area_from_calculus(path, area):
    assert shape(f'<path d="{path}" transform="translate(50 250)"/>').geometry.area == pytest.approx(area, rel=1e-3)


def test_holes_follow_the_fill_rule():
    same = "M 0 0 h 100 v 100 h -100 z M 10 10 h 50 v 50 h -50 z"
    opposite = "M 0 0 h 100 v 100 h -100 z M 10 10 v 50 h 50 v -50 z"
    holed = polygon([(0, 600), (100, 600), (100, 500), (0, 500)], [[(10, 590), (60, 590), (60, 540), (10, 540)]])
    assert shape(f'<path fill-rule="evenodd" d="{same}"/>') == holed
    assert shape(f'<path d="{opposite}"/>') == holed
    assert shape(f'<path d="{same}"/>') == rectangle((0, 600), (100, 500))


def test_an_island_in_a_hole_is_a_shape_of_its_own():
    rings = " ".join(f"M {i} {i} h {100 - 2 * i} v {100 - 2 * i} h {2 * i - 100} z" for i in (0, 10, 20, 30))
    outer, inner = shapes(f'<path style="fill-rule:evenodd" d="{rings}"/>')
    assert [len(outer.geometry.interiors), len(inner.geometry.interiors)] == [1, 1]
    assert outer.geometry.area + inner.geometry.area == 10000 - 6400 + 3600 - 1600


def test_parts_of_a_path_side_by_side_are_shapes_of_their_own():
    assert len(shapes('<path d="m 0 0 h 9 v 9 z m 20 0 h 9 v 9 z"/>')) == 2


def test_lines_are_as_thick_as_their_stroke():
    assert shape('<line x1="10" y1="20" x2="60" y2="20" stroke-width="4"/>') == rectangle((10, 582), (60, 578))
    assert shape('<g style="stroke-width:4"><line x2="60" y2="0" y1="0"/></g>') == rectangle((0, 602), (60, 598))
    assert shape('<line x1="10" y1="20" x2="60" y2="20"/>') == rectangle((10, 580.5), (60, 579.5))


def test_open_outlines_are_closed_if_filled_and_thick_lines_if_not():
    points = "0,0 100,0 100,100"
    assert shape(f'<polyline points="{points}"/>').geometry.area == 5000
    band = f'<polyline fill="none" stroke-width="2" points="{points}"/>'
    assert shape(band).geometry.area == pytest.approx(2 * 200)
    assert shape('<path d="M 0 0 h 100 v 100" fill="none" stroke-width="2"/>') == shape(band)
    assert shape('<path d="M 0 0 h 100 v 100"/>').geometry.area == 5000


def test_marks_lie_on_the_ground_and_backgrounds_do_not_count():
    content = '<g class="thin mark"><rect width="9" height="9"/></g><circle data-kind="mark" r="9"/>'
    content += '<rect class="background" width="100%" height="100%"/><g data-kind="background"><circle r="3"/></g>'
    assert [part.contact for part in shapes(content)] == [False, False]


def test_circles_marked_as_fire_are_fires():
    content = '<circle class="fire" cx="50" cy="50" r="20"/>'
    content += '<g transform="scale(2)" data-kind="fire"><circle cx="50" cy="50" r="20" data-temperature="0.3"/></g>'
    fires = Map.from_svg(ROOT.format(content)).fires
    assert fires == (FireSpot((50, 550), 20), FireSpot((100, 500), 40, 0.3))


@pytest.mark.parametrize(
    "content",
    [
        *('<ellipse class="fire" rx="3" ry="4"/>', '<rect class="fire" width="5" height="5"/>'),
        *('<circle class="fire" r="3" transform="scale(1 2)"/>', '<circle class="fire" r="0"/>'),
        *(
            '<circle class="fire" r="3" data-temperature="hot"/>',
            '<circle class="fire" r="3" data-temperature="7"/>',
        ),
        '<circle class="fire" cx="-90" r="3"/>',
    ],
)
def test_a_fire_that_is_no_circle_or_not_hot_is_refused_with_its_line(content):
    assert " on line 2: " in refused(ROOT.format(content))


def test_what_is_not_displayed_is_not_read():
    content = '<g display="none"><circle r="-5"/></g><rect style="fill:red; display: none"/><circle r="5"/>'
    content += '<defs><rect width="5" height="5"/></defs><text>hello</text><metadata><a:b xmlns:a="c"/></metadata>'
    assert shapes(content) == (disc((0, 600), 5),)


def test_elements_of_other_namespaces_are_passed_over():
    assert shapes('<i:view xmlns:i="http://inkscape"><i:rect/></i:view><circle r="5"/>') == (disc((0, 600), 5),)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ('<rect id="box" width="-5" height="5"/>', "<rect> 'box' on line 2: width is -5"),
        ('<rect height="5"/>', "width is 0"),
        ('<rect width="5" height="nan"/>', "height is 'nan'"),
        ('<rect width="50%" height="5"/>', "width is '50%'"),
        ('<rect width="1e999" height="5"/>', "width is inf"),
        ('<rect width="5" height="5" rx="-1"/>', "rx is -1"),
        ('<circle r="0"/>', "r is 0"),
        ('<circle r="3em"/>', "r is '3em'"),
        ('<circle cx="5000" r="3"/>', "shape at (5000, 600) lies outside the map"),
        ('<ellipse rx="5"/>', "ry is 0"),
        ('<ellipse rx="5e8" ry="1e8"/>', "far larger than the map"),
        ('<polygon points="0,0 9,9 9,0 0,9"/>', "not simple"),
        ('<polygon points="0,0 9,9 9"/>', "5 numbers; expected pairs"),
        ('<polygon points="0,0 9,x 9,9"/>', "expected numbers"),
        ('<polygon points="0,0 1e999,0 9,9"/>', "finite"),
        ("<polygon/>", "expected pairs"),
        ('<line x2="9" stroke-width="0"/>', "stroke-width is 0"),
        ('<line stroke-width="3"/>', "without length"),
        ("<path/>", "begins with M"),
        ('<path d="L 5 5"/>', "begins with M"),
        ('<path d="M 0 0"/>', "draws nothing"),
        ('<path d="M 0 0 L 5"/>', "complete path commands"),
        ('<path d="M 0 0 L 5 5 z 5 5"/>', "complete path commands"),
        ('<path d="M 0 0 h"/>', "complete path commands"),
        ('<path d="M 0 0 a 5 5 0 1"/>', "complete path commands"),
        ('<path d="M 0 0 c 5 5 0 1"/>', "complete path commands"),
        ('<path d="M 0 0 L five 5"/>', "begins with M"),
        ('<path d="M 0 0 C 1 1 1e999 0 0 9 z"/>', "larger than the map"),
        ('<path d="M 0 0 L 1e999 0 L 0 9 z"/>', "not finite"),
        ('<path d="M 0 0 A 1e9 1e9 0 0 1 1e9 1e9 z"/>', "larger than the map"),
        ('<path fill-rule="evenodd" d="M0 0h9v9h-9zM5 5h9v9h-9z"/>', "cross each other"),
        ('<rect width="5" height="5" transform="twist(3)"/>', "transform is 'twist(3)'"),
        ('<rect width="5" height="5" transform="matrix(1 2 3)"/>', "transform is"),
        ('<rect width="5" height="5" transform="translate(1mm 2)"/>', "transform is"),
        ('<rect width="5" height="5" transform="scale(0)"/>', "to nothing"),
        ('<rect width="5" height="5" transform="scale(1e300)"/>', "beyond 1e+12"),
        ('<rect width="5" height="5" style="transform: rotate(45deg)"/>', "transform is"),
        ('<rect width="5" height="5" clip-path="url(#a)"/>', "cut by a clip-path"),
        ('<rect width="5" height="5" data-kind="frie"/>', "did you mean 'fire'"),
        ('<image href="file:///etc/passwd"/>', "<image> is not allowed"),
        ("<script>alert(1)</script>", "<script> is not allowed"),
        ("<defs><script/></defs>", "<script> is not allowed"),
        ('<svg width="5" height="5"/>', "<svg> is not allowed"),
        ("<blob/>", "not a shape that maps know"),
    ],
)
def test_a_wrong_element_is_refused_with_its_line(content, reason):
    text = refused(ROOT.format(content))
    assert "on line 2" in text
    assert reason in text


@pytest.mark.parametrize(
    ("drawing", "reason"),
    [
        ("", "not XML"),
        ("no drawing", "line 1, column 1: not XML"),
        ('<svg width="8" height="6">', "not XML"),
        ('<svg width="8" height="6"><rect x=5/></svg>', "not XML"),
        ("<html/>", "expected <svg>"),
        ("<svg/>", "width is '100%'"),
        ('<svg width="0" height="5"/>', "width is 0"),
        ('<svg width="8" height="2e9"/>', "height is 2e+09"),
        ('<svg width="8" height="6" viewBox="0 0 8"/>', "viewBox"),
        ('<svg width="8" height="6" viewBox="0 0 0 6"/>', "width of viewBox is 0"),
        ('<svg width="8" height="6" viewBox="0 0 8 6" preserveAspectRatio="left"/>', "preserveAspectRatio"),
        ('<svg width="8" height="6" data-bounds="0 0 9 6"/>', "data-bounds spans 9 x 6"),
        ('<svg width="8" height="6" data-bounds="0 0"/>', "bounds"),
        (b'<?xml version="1.0" encoding="klingon"?><svg/>', "not XML"),
    ],
)
def test_a_wrong_drawing_is_refused_on_one_line(drawing, reason):
    assert reason in refused(drawing)


BOMB = '<!DOCTYPE svg [<!ENTITY a "ha">' + "".join(
    f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
DEFINED = '<defs><g id="a"><use href="#b"/></g><g id="b"><use href="#a"/></g></defs><use href="#a"/>'
USE_BOMB = "".join(f'<g id="u{i}">' + f'<use href="#u{i - 1}"/>' * 10 + "</g>" for i in range(1, 30))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("drawing", "reason"),
    [
        ("<!DOCTYPE svg>" + ROOT.format(""), "document type"),
        ('<!DOCTYPE svg SYSTEM "file:///etc/passwd">' + ROOT.format(""), "document type"),
        (BOMB + "]>" + ROOT.format("<title>&i;</title>"), "document type"),
        ('<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/passwd">]>' + ROOT.format("&x;"), "document type"),
        (ROOT.format("&undefined;"), "not XML"),
        (ROOT.format(DEFINED), "<use> is not allowed"),
        (ROOT.format(USE_BOMB), "<use> is not allowed"),
        (ROOT.format("<g>" * 200_000), "nested deeper"),
        (ROOT.format("<g/>" * 200_000), "more than 10000 elements"),
        (ROOT.format('<i:x xmlns:i="y"/>' * 200_000), "more than 10000 elements"),
        (ROOT.format('<g transform="scale(10)">' * 50 + '<circle r="1"/>' + "</g>" * 50), "beyond"),
        (ROOT.format(f'<g transform="{"scale(1)" * 100_000}"/>'), "transform"),
        (ROOT.format(f'<g style="{";" * 1_000_000}"/>'), "more than 5000 characters"),
        (ROOT.format(f'<rect width="5{" " * 1_000_000}!"/>'), "more than 5000 characters"),
        (ROOT.format(f'<path d="M 0 0{" L 1 1" * 500_000} z"/>'), "numbers"),
        (ROOT.format(f'<path d="M 0 0{"z" * 500_000}"/>'), "numbers"),
        (ROOT.format(f'<path d="M 0 0 {"A 9e4 9e4 0 1 1 9 9 9e4 9e4 0 1 1 0 0" * 1000} z"/>'), "points"),
        (ROOT.format(f'<polygon points="{"1 1 " * 1_000_000}"/>'), "more than 200000 points"),
        (ROOT.format('<ellipse rx="1e5" ry="2e5"/>' * 9999), "more than 200000 points"),
        (ROOT.format(f'<path d="{"M 0 0 h 1 v 1 z " * 3000}"/>'), "parts"),
    ],
    ids=lambda value: value[:40],
)
def test_bombs_are_refused_within_a_second(drawing, reason):
    assert reason in refused(drawing)


@pytest.mark.slow
@pytest.mark.parametrize("n", [500, 2000, 20_000])
@pytest.mark.parametrize("tag", ['polyline fill="none" stroke-width="3"', "polygon"])
def test_a_line_or_outline_that_crosses_itself_without_end_is_refused_before_it_is_made(n, tag, monkeypatch):
    monkeypatch.setattr(shapely.LineString, "buffer", None)
    points = " ".join(f"{x:.2f},{y:.2f}" for x, y in np.random.default_rng(n).random((n, 2)) * 100)
    assert re.search("come|crosses|cross", refused(ROOT.format(f'<{tag} points="{points}"/>')))


def test_slanted_teeth_that_never_cross_are_refused_where_each_lies_in_the_boxes_of_all():
    teeth = [(1 + i / 100 + 50 * (j == i % 2), 1 + 94 * (j == i % 2)) for i in range(5000) for j in (0, 1)]
    points = " ".join(f"{x:g},{y:g}" for x, y in teeth)
    assert "come near each other too often" in refused(ROOT.format(f'<polygon points="{points}"/>'))


def test_a_thick_line_that_crosses_itself_a_few_times_is_read():
    points = " ".join(
        f"{400 + 300 * math.sin(3 * t):.1f},{300 + 200 * math.sin(4 * t):.1f}" for t in np.arange(0, 6, 0.05)
    )
    assert shape(f'<polyline fill="none" stroke-width="3" points="{points}"/>').geometry.interiors


def wall(width, corners):
    """Return a thick line."""
    points = " ".join(f"{x:.3f},{y:.3f}" for x, y in corners)
    return f'<polyline fill="none" stroke-width="{width}" points="{points}"/>'


def scanned(n):
    """Return the corners of a wall as a laser scanner sees it."""
    x, y = np.arange(n) * 0.23, 300 + 200 * np.sin(np.arange(n) / 100)
    return np.column_stack([50 + x, y]) + np.random.default_rng(1).uniform(-1, 1, (n, 2))


def zigzag(n):
    """Return the corners of a line that goes back and forth in rows and crosses nothing."""
    x, row = np.arange(n) % 790, np.arange(n) // 790
    return np.column_stack([np.where(row % 2, 789 - x, x) + 1, row * 7 + np.arange(n) % 2 + 1])


def freehand(n):
    """Return a path of curves that wanders as a hand does."""
    turns = np.random.default_rng(3).uniform(-0.4, 0.4, 3 * n).cumsum()
    at = np.column_stack([np.cos(turns), np.sin(turns)]).cumsum(axis=0) * 0.5
    at += [400, 300] - at.mean(axis=0)
    curves = " ".join("C" + " ".join(f"{number:.5f}" for number in curve) for curve in at.reshape(-1, 6))
    return f'<path style="fill:none;stroke-width:3" d="M{at[0, 0]:.5f},{at[0, 1]:.5f} {curves}"/>'


def repeated(n, element):
    """Return elements side by side; x and y stand for where."""
    return "".join(element.format(x=i % 90 * 8 + 1, y=i // 90 * 8 + 1) for i in range(n))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("content", "number"),
    [
        (repeated(3000, '<line x1="{x}" y1="{y}" x2="{x}.5" y2="{y}.9" stroke-width="2"/>'), 3000),
        (repeated(2500, '<polyline fill="none" points="{x},{y} {x},0 0,0"/>'), 2500),
        (repeated(3500, '<rect x="{x}" y="{y}" width="5" height="5" rx="1"/>'), 3500),
        (repeated(700, '<ellipse cx="{x}" cy="{y}" rx="400" ry="200"/>'), 700),
        (wall(4, scanned(3000)), 1),
        (freehand(5000), 1),
        (wall(0.1, zigzag(60_000)), 1),
    ],
    ids=["lines", "corners", "rounded", "ellipses", "scanned", "freehand", "zigzag"],
)
def test_large_drawings_as_people_make_them_are_read(content, number):
    with work_within(2):
        assert len(shapes(content)) == number


def test_looking_for_crossings_of_a_long_line_stops_once_the_map_is_waited_for_no_longer():
    asked = itertools.count()
    with stop_reading_when(lambda: next(asked) > 4), pytest.raises(CancelledError):
        Map.from_svg(ROOT.format(wall(0.1, zigzag(60_000))))


@pytest.mark.parametrize(("apart", "around"), [(1000, 11), (1100, 18)])
def test_outlines_of_which_many_lie_in_many_are_refused_wherever_those_stand_in_the_path(apart, around):
    squares = [(i // around % 30 * 16 + 10, i // around // 30 * 16 + 10, 0.3 * (i % around + 1)) for i in range(apart)]
    squares += [(590, 300, 0.1 * (i + 1)) for i in range(1999 - apart)]
    corners = "M{0:g},{1:g} {2:g},{1:g} {2:g},{3:g} {0:g},{3:g}Z"
    rings = "".join(corners.format(x - half, y - half, x + half, y + half) for x, y, half in squares)
    assert "more work" in refused(ROOT.format(f'<path fill-rule="evenodd" d="{rings}"/>'))


@pytest.mark.parametrize(
    "content",
    [
        f'<path transform="{"rotate(1)" * 8}" d="M500,500 501,500 500,501Z"/>' * 7400,
        f'<g transform="{"rotate(1,2,3)" * 38}"/>' * 1950,
        f'<g transform="{"skewX(1)" * 8}"/>' * 9900,
        '<path d="M500,500 501,500 500,501Z"/>' * 9900,
    ],
    ids=["paths", "long", "groups", "straight"],
)
def test_transforms_and_paths_without_number_are_refused(content):
    assert "more work" in refused(ROOT.format(content))


def test_a_spiral_drawn_with_a_pen_wider_than_itself_is_refused():
    turns = np.linspace(0, 100 * np.pi, 5000)
    corners = 400 + (2 + 0.13 * turns[:, None]) * np.column_stack([np.cos(turns), np.sin(turns)])
    assert "crosses itself" in refused(ROOT.format(wall(90, corners)))


def test_elements_without_a_namespace_are_read_in_a_drawing_with_one():
    assert len(shapes('<g xmlns=""><rect width="3" height="3"/></g>')) == 1


def test_a_mistake_of_our_own_is_not_taken_for_one_of_the_encoding(monkeypatch):
    def fail(*_):
        raise TypeError("a mistake")

    monkeypatch.setattr(map_svg, "_inherit", fail)
    with pytest.raises(TypeError, match="a mistake"):
        shapes('<rect width="3" height="3"/>')


@pytest.mark.slow
def test_two_thousand_outlines_in_each_other_are_refused_before_they_are_compared():
    rings = "".join(f"M{i / 9} {i / 9}H{600 - i / 9}V{600 - i / 9}H{i / 9}Z" for i in range(1999))
    assert "more work" in refused(ROOT.format(f'<path fill-rule="evenodd" d="{rings}"/>'))


@pytest.mark.parametrize(
    "content",
    [
        *(f'<rect width="5" height="5" transform="{kind}(1e308)"/>' for kind in ("rotate", "skewX", "skewY")),
        *('<line x2="9" stroke-width="1e308"/>', '<polyline fill="none" stroke-width="1e-320" points="0 0 9 9 9 0"/>'),
        '<polyline fill="none" points="1e308 0 9 9"/>',
    ],
)
def test_numbers_beyond_reach_are_refused(content):
    assert "on line 2" in refused(ROOT.format(content))


@pytest.mark.parametrize("encoding", ["utf-7", "gb18030", "idna", "punycode", "undefined", "hex", "klingon"])
def test_an_encoding_that_cannot_be_read_is_refused(encoding):
    assert "not XML" in refused(f'<?xml version="1.0" encoding="{encoding}"?><svg width="8" height="6"/>'.encode())


def test_half_a_surrogate_pair_is_refused():
    assert "character 6: not Unicode text" in refused("<svg/>"[:5] + "\ud800")


def test_a_long_name_of_a_namespace_is_refused_before_it_is_written_out_for_each_element():
    assert "namespace" in refused(f'<svg xmlns:a="{"x" * 500_000}" width="9" height="9">{"<a:b/>" * 9000}</svg>')


@pytest.mark.parametrize("side", ["1e-320", "5e-324"])
def test_a_drawing_of_no_size_to_speak_of_is_read_or_refused(side):
    for content in ('<ellipse rx="1" ry="2"/>', '<path d="M0 0q1 1 2 0z"/>'):
        refused(f'<svg width="{side}" height="{side}">{content}</svg>')


def test_errors_have_at_most_300_characters_however_long_the_name_of_the_file():
    with pytest.raises(MapError) as error:
        Map.from_svg(f'<svg width="8" height="6"><rect id="{"i" * 400}" width="{"w" * 400}"/></svg>', "x" * 1000)
    assert len(str(error.value)) <= 300


def test_reading_stops_at_the_next_shape_once_the_map_is_waited_for_no_longer():
    asked = iter([False, False, True])
    with stop_reading_when(lambda: next(asked)), pytest.raises(CancelledError):
        Map.from_svg(ROOT.format('<circle r="5"/>' * 100))


@settings(deadline=None)
@given(st.binary(max_size=80) | st.text("<>svgrect/ =\"'0123", max_size=60).map(str.encode))
def test_any_bytes_are_a_map_or_a_map_error(content):
    try:
        Map.from_svg(content)
    except MapError as error:
        assert "\n" not in str(error)


@settings(deadline=None)
@given(st.text("MLHVCSQTAZmlhvcsqtaz 0123456789.-,e", max_size=40))
def test_any_path_data_is_a_shape_or_a_map_error(text):
    try:
        shapes(f'<path d="M 0 0 {text}" fill="none" stroke-width="2"/>')
    except MapError as error:
        assert "\n" not in str(error)
