"""Parts of drawings against closed forms: view boxes, transforms, rounded corners, fill rules, thick lines, styles."""

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.base.errors import MapError
from mesa_swarm.maps.map import Map
from mesa_swarm.maps.svg import (
    is_similarity,
    length,
    numbers,
    points,
    properties,
    scale_of,
    transform,
    viewbox,
    viewbox_numbers,
)
from mesa_swarm.world.shapes import polygon, rectangle

coordinates = st.floats(-50, 50)
ROOT = '<svg width="800" height="600">{}</svg>'


def shapes(content):
    """Return the obstacles of a drawing of 800 x 600."""
    return Map.from_svg(ROOT.format(content)).obstacles


def moved(matrix, x, y):
    return (matrix @ [x, y, 1.0])[:2].tolist()


@pytest.mark.parametrize("crop", ["meet", "slice"])
@pytest.mark.parametrize(("x", "x_share"), [("xMin", 0.0), ("xMid", 0.5), ("xMax", 1.0)])
@pytest.mark.parametrize(("y", "y_share"), [("YMin", 0.0), ("YMid", 0.5), ("YMax", 1.0)])
def test_a_view_box_is_as_large_as_fits_or_covers_and_its_spare_room_is_shared(x, y, x_share, y_share, crop):
    for box_width, box_height in ((40.0, 10.0), (10.0, 40.0)):
        matrix = viewbox(f"7 -3 {box_width} {box_height}", f" {x}{y}  {crop} ", 200.0, 100.0)
        scale = (min if crop == "meet" else max)(200 / box_width, 100 / box_height)
        left, top = moved(matrix, 7, -3)
        right, bottom = moved(matrix, 7 + box_width, -3 + box_height)
        assert (right - left, bottom - top) == pytest.approx((scale * box_width, scale * box_height))
        assert left == pytest.approx(x_share * (200 - scale * box_width))
        assert top == pytest.approx(y_share * (100 - scale * box_height))


def test_a_view_box_that_may_be_stretched_fills_the_drawing():
    matrix = viewbox("7 -3 40 10", "none", 200.0, 100.0)
    assert moved(matrix, 7, -3) == pytest.approx([0, 0])
    assert moved(matrix, 47, 7) == pytest.approx([200, 100])
    assert viewbox_numbers("7 -3 40,10") == [7, -3, 40, 10]
    assert (viewbox("7 -3 40 10", "", 200.0, 100.0) == viewbox("7 -3 40 10", "xMidYMid meet", 200.0, 100.0)).all()


@given(coordinates, coordinates, coordinates, coordinates, st.floats(-170, 170), st.floats(-80, 80))
def test_transforms_move_points_as_their_definitions_do(x, y, p, q, degrees, slant):
    t, s = math.radians(degrees), math.tan(math.radians(slant))
    c, d = math.cos(t), math.sin(t)
    expected = {
        f"translate({p} {q})": (x + p, y + q),
        f"translate({p})": (x + p, y),
        f"scale({p + 60}, {q + 60})": (x * (p + 60), y * (q + 60)),
        f"scale({p + 60})": (x * (p + 60), y * (p + 60)),
        f"rotate({degrees})": (c * x - d * y, d * x + c * y),
        f"rotate({degrees} {p} {q})": (p + c * (x - p) - d * (y - q), q + d * (x - p) + c * (y - q)),
        f"skewX({slant})": (x + s * y, y),
        f"skewY({slant})": (x, y + s * x),
        f"matrix(2 3 4 7 {p} {q})": (2 * x + 4 * y + p, 3 * x + 7 * y + q),
        f"translate({p} {q}) scale(3)": (3 * x + p, 3 * y + q),
    }
    for text, place in expected.items():
        assert moved(transform(text), x, y) == pytest.approx(place, rel=1e-9, abs=1e-6), text


@pytest.mark.parametrize(
    ("matrix", "similar", "scale"),
    [
        ([[3, -4], [4, 3]], True, 5),
        ([[3, 4], [4, -3]], True, 5),
        ([[2, 0], [0, 1]], False, 2),
        ([[1, 0], [0, 2]], False, 2),
        ([[1, 1], [0, 1]], False, (1 + math.sqrt(5)) / 2),
        ([[0.6, 0.8], [0.8, 0.6]], False, 1.4),
    ],
)
def test_a_similarity_keeps_circles_round_and_its_scale_is_its_largest_stretch(matrix, similar, scale):
    whole = np.eye(3)
    whole[:2, :2] = matrix
    assert is_similarity(whole) is similar
    assert scale_of(whole) == pytest.approx(scale)


@pytest.mark.parametrize(
    ("corners", "rx", "ry"),
    [
        ("", 0, 0),
        ('ry="5"', 5, 5),
        ('rx="8"', 8, 8),
        ('rx="8" ry="5"', 8, 5),
        ('rx="auto" ry="5"', 5, 5),
        ('rx="8" ry="0"', 0, 0),
        ('rx="0" ry="8"', 0, 0),
        ('rx="60" ry="5"', 50, 5),
        ('rx="5" ry="60"', 5, 20),
        ('rx="30"', 30, 20),
    ],
)
def test_corners_are_rounded_by_their_radii_one_of_which_holds_for_both_and_no_more_than_half_a_side(corners, rx, ry):
    (shape,) = shapes(f'<rect x="100" y="50" width="100" height="40" {corners}/>')
    assert shape.bounds == pytest.approx((100, 510, 200, 550))
    # Chords are inside the curve, by at most the tolerance of 0.04.
    missing = 4000 - (4 - math.pi) * rx * ry - shape.geometry.area
    assert -1e-9 <= missing <= 0.04 * math.pi * (rx + ry)
    assert (shape.kind == "rectangle") is (rx == 0)
    if rx:
        x, y = np.abs(np.array(shape.geometry.exterior.coords) - [150, 530]).T
        x, y = np.maximum(x - 50 + rx, 0), np.maximum(y - 20 + ry, 0)
        assert ((x / rx) ** 2 + (y / ry) ** 2 <= 1 + 1e-9).all()


@given(st.lists(st.booleans(), min_size=1, max_size=6), st.booleans(), st.randoms(use_true_random=False))
def test_rings_in_each_other_are_solid_where_the_fill_rule_means_so(turns, even_odd, random):
    # Ring k is a square of half side 60 - 8 k; where its turn is true it runs the other way round.
    paths, n = [], len(turns)
    for k, turned in enumerate(turns):
        half = 60 - 8 * k
        step = f"v {2 * half} h {2 * half} v {-2 * half}" if turned else f"h {2 * half} v {2 * half} h {-2 * half}"
        paths.append(f"M {200 - half} {200 - half} {step} z")
    random.shuffle(paths)
    rule = "evenodd" if even_odd else "nonzero"
    found = shapes(f'<path fill-rule="{rule}" d="{" ".join(paths)}"/><rect x="700" width="9" height="9"/>')[:-1]
    for k in range(n + 1):
        winding = sum(-1 if turned else 1 for turned in turns[:k])
        solid = k % 2 == 1 if even_odd else winding != 0
        place = shapely.Point(264 - 8 * k, 400)
        assert any(shape.geometry.contains(place) for shape in found) is solid
    assert sum(shape.geometry.area for shape in found) == pytest.approx(
        shapely.union_all([s.geometry for s in found]).area
    )


def test_a_thick_line_has_square_ends_and_mitred_corners_up_to_the_limit():
    def band(coordinates):
        (shape,) = shapes(f'<polyline fill="none" stroke-width="4" points="{coordinates}"/>')
        return shape

    assert band("100,100 200,100 200,200").geometry.equals(
        polygon([(100, 502), (202, 502), (202, 400), (198, 400), (198, 498), (100, 498)]).geometry
    )
    # A corner of 45 degrees reaches half the width over the sine of its half beyond its point; a sharper one is cut.
    half = math.radians(22.5)
    assert band("100,100 200,100 100,200").bounds[2] == pytest.approx(200 + 2 / math.sin(half) * math.cos(half))
    assert 200 < band("100,100 200,100 100,110").bounds[2] < 208.5


def test_a_style_overrides_attributes_and_inherit_leaves_the_parents():
    assert properties({"fill": "red", "r": "5", "style": "fill : none!important;; stroke-width:3; odd"}) == {
        "fill": "none", "r": "5", "stroke-width": "3",
    }  # fmt: skip
    line = '<g stroke-width="4" fill="none"><polyline {} points="10,20 60,20"/></g>'
    for style in ("", 'style="stroke-width:inherit"', 'stroke-width="inherit" fill="inherit"', 'fill="transparent"'):
        assert shapes(line.format(style)) == (rectangle((10, 582), (60, 578)),)
    triangle = '<g fill="none"><polyline fill="red" points="10,20 60,20 60,90"/></g>'
    assert shapes(triangle)[0].geometry.area == 0.5 * 50 * 70
    ring = "M 0 0 h 100 v 100 h -100 z M 10 10 h 50 v 50 h -50 z"
    outer, inner = (f'<g fill-rule="evenodd"><path {rule} d="{ring}"/></g>' for rule in ("", 'fill-rule="nonzero"'))
    assert (len(shapes(outer)[0].geometry.interiors), len(shapes(inner)[0].geometry.interiors)) == (1, 0)


@pytest.mark.parametrize(
    ("text", "values"),
    [("3-4", [3, -4]), (".5.5", [0.5, 0.5]), ("1e-2-3", [0.01, -3]), (" 1,2 ,3 ", [1, 2, 3]), ("+7+8", [7, 8])],
)
def test_coordinatesmay_be_separated_by_their_signs_and_points_alone(text, values):
    assert numbers("d", text) == values
    if len(values) % 2 == 0:
        assert points("d", text).tolist() == np.reshape(values, (-1, 2)).tolist()


def test_lengths_are_in_pixels_of_which_an_inch_has_96():
    assert [length("r", f" 3{unit} ") for unit in ("", "px", "PX", "in", "pc")] == [3, 3, 3, 288, 48]
    assert [length("r", f"3{unit}") for unit in ("pt", "cm", "mm")] == pytest.approx([4, 288 / 2.54, 28.8 / 2.54])


def test_the_bounds_of_a_drawing_agree_with_its_size_but_for_rounding():
    text = '<svg width="{}" height="60" data-bounds="-10 5 70 65"><circle cx="4" cy="3" r="2"/></svg>'
    moved_map = Map.from_svg(text.format(80 * (1 + 1e-10)))
    assert moved_map.bounds == (-10, 5, 70, 65)
    assert moved_map.obstacles[0].position == pytest.approx((-6, 62))
    with pytest.raises(MapError, match="data-bounds spans 80 x 60, the drawing 80 x 60"):
        Map.from_svg(text.format(80 * (1 + 1e-7)))


RINGS = {
    '<rect x="100" y="100" width="200" height="80" {}/>': 204 * 84 - 196 * 76,
    '<polygon points="100,100 300,100 300,180 100,180" {}/>': 204 * 84 - 196 * 76,
    '<polyline points="100,100 300,100 300,180 100,180 100,100" {}/>': 204 * 84 - 196 * 76,
    '<path d="M100 100H300V180H100Z" {}/>': 204 * 84 - 196 * 76,
    '<path d="M 100 100 L 300 100 L 300 180 L 100 180 Z" {}/>': 204 * 84 - 196 * 76,
    '<circle cx="200" cy="200" r="60" {}/>': math.pi * (62**2 - 58**2),
    '<ellipse cx="200" cy="200" rx="60" ry="60.0001" {}/>': math.pi * (62**2 - 58**2),
    '<rect x="100" y="100" width="200" height="80" rx="20" {}/>': 4 * (2 * 160 + 2 * 40 + math.tau * 20),
    '<circle cx="100" cy="100" r="30" transform="scale(2)" {}/>': math.pi * (64**2 - 56**2),
}


@pytest.mark.parametrize("element", RINGS)
@pytest.mark.parametrize(
    "style", ['fill="none" stroke="#000" stroke-width="4"', 'style="fill:none;stroke:red;stroke-width:4"']
)
def test_an_outline_without_fill_is_a_ring_as_wide_as_its_stroke(element, style):
    (ring,) = shapes(element.format(style))
    assert ring.geometry.area == pytest.approx(RINGS[element], rel=2e-3)
    assert len(ring.geometry.interiors) == 1
    (inherited,) = shapes(f'<g fill="none" stroke="blue" stroke-width="4">{element.format("")}</g>')
    assert inherited.geometry.equals(ring.geometry)


def test_an_outline_with_a_fill_or_without_a_stroke_is_solid():
    element = '<rect x="100" y="100" width="200" height="80" {}/>'
    for style in ("", 'stroke="#000"', 'fill="none" stroke="none"', 'fill="none"'):
        assert shapes(element.format(style))[0].geometry.area == 200 * 80


def test_each_part_of_a_path_without_fill_is_a_ring_and_may_lie_in_another():
    rings = shapes('<path fill="none" stroke="#000" stroke-width="2" d="M100 100H300V200H100Z M150 120h50v50h-50z"/>')
    assert [ring.geometry.area for ring in rings] == pytest.approx([202 * 102 - 198 * 98, 52 * 52 - 48 * 48])


def test_a_ring_as_wide_as_its_outline_is_solid():
    (shape,) = shapes('<rect x="100" y="100" width="20" height="20" fill="none" stroke="#000" stroke-width="20"/>')
    assert shape.geometry.area == pytest.approx(40 * 40)


def test_a_fire_without_fill_is_a_fire_and_a_mark_without_fill_a_ring_on_the_ground():
    ring = '<circle class="{}" cx="200" cy="200" r="60" fill="none" stroke="#000" stroke-width="4"/>'
    assert Map.from_svg(ROOT.format(ring.format("fire"))).fires[0].radius == 60
    (mark,) = shapes(ring.format("mark"))
    assert not mark.contact
    assert len(mark.geometry.interiors) == 1
