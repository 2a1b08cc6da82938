"""The palette: contrast, colours for any colour vision, and one source for Python, scripts and style sheets."""

import ast
import json
import re
from dataclasses import fields
from itertools import combinations, pairwise
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import CSS4_COLORS, to_hex

import mesa_swarm
from mesa_swarm.dashboard.app import CSS
from mesa_swarm.dashboard.page.series import Series
from mesa_swarm.dashboard.run.charts import OVER_TIME, ChartBoard, ChosenChart, TimeContent
from mesa_swarm.environments import FindFires
from mesa_swarm.environments.rendering import Camera
from mesa_swarm.environments.task_world import TaskWorld
from mesa_swarm.maps import map as maps
from mesa_swarm.models.cooperative_transport import CooperativeTransport
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from mesa_swarm.viewing import replay_page
from mesa_swarm.viewing.canvas_widget import SwarmCanvas
from mesa_swarm.viewing.drawing import drawing_of_model as thumbnail_of
from mesa_swarm.viewing.export import export
from mesa_swarm.viewing.films import Screen
from mesa_swarm.viewing.palette import (
    DARK,
    LIGHT,
    PALETTES,
    Palette,
    fire_colour,
    fire_steps,
    layer_colour,
    ramp,
    rgb,
)
from mesa_swarm.viewing.pictures import Look, world_figure
from mesa_swarm.viewing.recorded_steps import PicturedSteps
from mesa_swarm.viewing.run_pictures import ethogram_figure

PACKAGE = Path(mesa_swarm.__file__).parent
# WCAG 2.2: 1.4.3 for text, 1.4.11 for graphics.
TEXT, GRAPHIC = 4.5, 3.0
# CIEDE2000 between any two layers, or two lines of a chart, with any colour vision; about 2 is seen side by side.
APART = 10.0
# The same between kinds of bodies in the world.
KINDS_APART = 8.0

# Machado, Oliveira and Fernandes, A physiologically-based model for simulation of color vision deficiency, IEEE
# Transactions on Visualization and Computer Graphics 15 (2009) 1291-1298: severity 1, on linear RGB.
VISIONS = {
    "usual": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
# Linear sRGB to CIE XYZ (IEC 61966-2-1); white is the sum of its columns.
TO_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])

themes = pytest.mark.parametrize("palette", [LIGHT, DARK], ids=["light", "dark"])
visions = pytest.mark.parametrize("vision", VISIONS)


def linear(colour: str) -> np.ndarray:
    share = rgb(colour) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def contrast(one: str, two: str) -> float:
    """Return the contrast of two colours, 1 to 21 (WCAG 2.2, relative luminance)."""
    light, dark = sorted(float(linear(colour) @ [0.2126, 0.7152, 0.0722]) + 0.05 for colour in (one, two))[::-1]
    return light / dark


def lab(light: np.ndarray) -> np.ndarray:
    share = TO_XYZ @ light / TO_XYZ.sum(axis=1)
    x, y, z = np.where(share > (6 / 29) ** 3, np.cbrt(share), share / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def ciede2000(one: np.ndarray, two: np.ndarray) -> float:
    """Return the CIEDE2000 difference of two colours in CIE Lab.

    Sharma, Wu and Dalal, The CIEDE2000 color-difference formula, Color Research and Application 30 (2005) 21-30.
    """
    mean_chroma = (np.hypot(*one[1:]) + np.hypot(*two[1:])) / 2
    stretch = 1.5 - 0.5 * np.sqrt(mean_chroma**7 / (mean_chroma**7 + 25.0**7))
    (c1, h1), (c2, h2) = (
        (np.hypot(stretch * a, b), np.degrees(np.arctan2(b, stretch * a)) % 360) for _, a, b in (one, two)
    )
    turn = (h2 - h1 + 180) % 360 - 180
    lightness, chroma, hue = (one[0] + two[0]) / 2, (c1 + c2) / 2, (h1 + turn / 2) % 360
    bend = (
        1 - 0.17 * cosine(hue - 30) + 0.24 * cosine(2 * hue) + 0.32 * cosine(3 * hue + 6) - 0.2 * cosine(4 * hue - 63)
    )
    by_lightness = (two[0] - one[0]) / (1 + 0.015 * (lightness - 50) ** 2 / np.sqrt(20 + (lightness - 50) ** 2))
    by_chroma = (c2 - c1) / (1 + 0.045 * chroma)
    by_hue = 2 * np.sqrt(c1 * c2) * cosine(turn / 2 - 90) / (1 + 0.015 * chroma * bend)
    rotation = -2 * np.sqrt(chroma**7 / (chroma**7 + 25.0**7)) * cosine(60 * np.exp(-(((hue - 275) / 25) ** 2)) - 90)
    return float(np.sqrt(by_lightness**2 + by_chroma**2 + by_hue**2 + rotation * by_chroma * by_hue))


def cosine(degrees: float) -> float:
    return np.cos(np.radians(degrees))


def difference(one: str, two: str, vision: str) -> float:
    return ciede2000(*(lab(np.clip(VISIONS[vision] @ linear(colour), 0, 1)) for colour in (one, two)))


def least(colours: dict[str, str], vision: str) -> tuple[float, str, str]:
    """Return the least difference of any two colours, and which two."""
    pairs = combinations(colours, 2)
    return min((difference(colours[one], colours[two], vision), one, two) for one, two in pairs)


def papers(palette: Palette) -> tuple[str, ...]:
    return palette.page, palette.paper, palette.field, palette.hover


@pytest.mark.parametrize(
    ("one", "two", "expected"),
    [
        ((50.0, 2.6772, -79.7751), (50.0, 0.0, -82.7485), 2.0425),
        ((50.0, -1.3802, -84.2814), (50.0, 0.0, -82.7485), 1.0),
        ((50.0, 2.49, -0.001), (50.0, -2.49, 0.0011), 7.2195),
        ((50.0, 2.5, 0.0), (73.0, 25.0, -18.0), 27.1492),
        ((60.2574, -34.0099, 36.2677), (60.4626, -34.1751, 39.4387), 1.2644),
        ((2.0776, 0.0795, -1.135), (0.9033, -0.0636, -0.5514), 0.9082),
    ],
)
def test_the_difference_of_colours_is_the_published_one(one, two, expected):
    assert ciede2000(np.array(one), np.array(two)) == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("palette", [LIGHT, DARK], ids=["light", "dark"])
def test_colours_are_written_as_six_or_eight_hexadecimal_digits(palette):
    for field in fields(palette):
        value = getattr(palette, field.name)
        for colour in (value,) if isinstance(value, str) else value:
            assert re.fullmatch(r"#[0-9a-f]{6}([0-9a-f]{2})?", colour), field.name


@themes
def test_text_is_readable_on_everything_that_it_may_stand_on(palette):
    inks = ("ink", "soft", "warn", "bad", "good", "selection")
    pairs = [(getattr(palette, ink), paper) for ink in inks for paper in papers(palette)]
    pairs += [(palette.ink, palette.warn_paper), (palette.ink, palette.bad_paper), (palette.bad, palette.bad_paper)]
    pairs += [(palette.on_accent, palette.accent), (palette.on_ashes, palette.ashes)]
    pairs += [(palette.label, ground) for ground in (palette.ground, palette.outside)]
    pairs += [(palette.on_fire, colour) for colour in palette.fire]
    pairs += [(palette.ink, colour) for colour in palette.diverging]
    assert [(pair, contrast(*pair)) for pair in pairs if contrast(*pair) < TEXT] == []


@themes
def test_everything_in_the_world_stands_out_from_the_ground(palette):
    names = ("border", "obstacle", "mark", "load", "fire_rim", "robot", "robot_hot", "perceived", "contact", "message")
    colours = [getattr(palette, name) for name in (*names, "selection", "travel", "no_layer")]
    colours += [*palette.layers, *palette.fire]
    faint = [(colour, ratio) for colour in colours if (ratio := contrast(colour, palette.ground)) < GRAPHIC]
    assert faint == []


@themes
def test_lines_of_charts_and_what_is_chosen_stand_out_from_the_paper(palette):
    grounds = (palette.page, palette.paper, palette.field, palette.ground)
    colours = (*palette.series, *palette.layers, palette.no_layer, palette.faint, palette.accent, palette.focus)
    pairs = [(colour, ground) for colour in colours for ground in grounds]
    assert [(pair, contrast(*pair)) for pair in pairs if contrast(*pair) < GRAPHIC] == []


@themes
@visions
def test_any_two_layers_and_no_layer_are_distinguishable_with_any_colour_vision(palette, vision):
    layers = {f"layer {index}": colour for index, colour in enumerate(palette.layers)}
    assert len(layers) >= 8
    found = least({**layers, "no layer": palette.no_layer}, vision)
    print(f"least difference of layers, {vision}: {found[0]:.1f} ({found[1]}, {found[2]})")
    assert found[0] >= APART, found


@themes
@visions
def test_any_two_lines_of_a_chart_are_distinguishable_with_any_colour_vision(palette, vision):
    found = least({f"line {index}": colour for index, colour in enumerate(palette.series)}, vision)
    assert found[0] >= APART, found


@themes
@visions
def test_kinds_of_bodies_are_distinguishable_with_any_colour_vision(palette, vision):
    kinds = {name: getattr(palette, name) for name in ("obstacle", "mark", "load", "robot")}
    found = least({**kinds, "cold fire": palette.fire[0], "hot fire": palette.fire[-1]}, vision)
    assert found[0] >= KINDS_APART, found


@themes
@visions
def test_a_ring_is_distinguishable_from_the_robot_that_it_surrounds(palette, vision):
    assert min(difference(colour, palette.robot, vision) for colour in palette.layers) >= KINDS_APART
    assert min(difference(colour, palette.robot, vision) for colour in (palette.robot_front, palette.robot_hot)) >= 20


@themes
def test_the_front_of_a_robot_stands_out_from_its_rear(palette):
    assert contrast(palette.robot_front, palette.robot) >= GRAPHIC


@themes
def test_the_hotter_a_fire_the_lighter_with_any_colour_vision(palette):
    for vision in VISIONS.values():
        lightness = [lab(np.clip(vision @ linear(colour), 0, 1))[0] for colour in palette.fire]
        assert all(before < after for before, after in pairwise(lightness))


def test_maps_that_are_written_as_svg_have_the_colours_of_the_palette():
    names = {"GROUND": "ground", "SOLID": "obstacle", "MARK": "mark", "RIM": "fire_rim"}
    assert {name: getattr(maps, name) for name in names} == {name: getattr(LIGHT, ours) for name, ours in names.items()}
    assert fire_colour(1.0) == maps.FLAME


def test_a_ramp_goes_evenly_from_stop_to_stop():
    assert rgb("#ff8000").tolist() == [255, 128, 0]
    assert ramp("#000000", "#204060", steps=3) == ("#000000", "#102030", "#204060")


# One source: what scripts and style sheets get.


def palette_in(text: str) -> dict:
    (found,) = re.findall(r"^const PALETTE = (\{.*\});$", text, re.M)
    return json.loads(found)


@pytest.mark.parametrize("text", [SwarmCanvas._esm, ChartBoard._esm, replay_page.page_script()])
def test_scripts_have_the_colours_that_python_has(text):
    expected = {
        theme: {field.name: getattr(palette, field.name) for field in fields(palette)}
        for theme, palette in PALETTES.items()
    }
    assert palette_in(text) == json.loads(json.dumps(expected))
    assert text.index("const PALETTE") < text.index("PALETTE[")


def rules_of(css: str) -> list[dict[str, str]]:
    """Return the custom properties that each rule sets to a colour."""
    found = [dict(re.findall(r"--swarm-([\w-]+): (#\w+);", rule)) for rule in css.split("}")]
    return [colours for colours in found if colours]


@pytest.mark.parametrize("css", [CSS, SwarmCanvas._css, replay_page.style()])
def test_style_sheets_have_the_colours_that_python_has_and_use_no_other(css):
    single = [field.name for field in fields(Palette) if isinstance(getattr(LIGHT, field.name), str)]
    for colours, palette in zip(rules_of(css), (LIGHT, DARK), strict=True):
        assert colours == {name.replace("_", "-"): getattr(palette, name) for name in single}
    lengths = {"gutter", "head", "large", "left", "right"}  # of the page's arrangement, in layout.css
    assert set(re.findall(r"var\(--swarm-([\w-]+)", css)) - lengths <= {name.replace("_", "-") for name in single}


def test_scripts_use_only_names_that_the_palette_has():
    names = {field.name for field in fields(Palette)}
    canvas = (PACKAGE / "viewing" / "canvas.js").read_text(encoding="utf-8")
    charts = (PACKAGE / "dashboard" / "run" / "charts.js").read_text(encoding="utf-8")
    used = set(re.findall(r"(?:\bcolours|#colours)\.(\w+)", canvas))
    used |= set(re.findall(r"\bpalette\.(?!py)(\w+)", charts))
    assert used - {"length"} <= names
    assert len(used) > 20


# One source: no colour is written anywhere else.

HEX = r"#(?:[0-9a-f]{8}|[0-9a-f]{6}|[0-9a-f]{3,4})\b"
FUNCTION = r"\b(?:rgba?|hsla?|hwb|lab|lch|oklab|oklch)\("
# Words that name no colour: what is not drawn, and what surrounds it.
NO_COLOURS = {"none", "transparent", "currentcolor", "inherit"}
NAMED = sorted(set(CSS4_COLORS) | {name for name in mpl.colors.TABLEAU_COLORS})
# Words of the English language that are also names of colours.
ALSO_WORDS = {"tan", "linen", "snow", "peru", "salmon", "wheat", "plum", "orchid", "gold", "chocolate"}
# Arguments of Matplotlib that take a colour, and those that take a map of colours.
COLOURED = re.compile(r"colou?rs?$|^c$|^mfc$|^mec$|facecolors?|edgecolors?|markerfacecolor(alt)?|^cmap$")
# Why colours stand in these files: the palette; maps as SVG are written below its floor, and compared above.
ELSEWHERE = {"viewing/palette.py", "maps/map.py"}


def literals(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        return literals_of_python(text)
    if path.suffix == ".css":
        return literals_of_css(text)
    return literals_of_script(text)


def literals_of_python(text: str) -> list[str]:
    tree = ast.parse(text)
    documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, documented) and node.body and isinstance(node.body[0], ast.Expr)
    }
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            written = node.value.lower()
            found += re.findall(f"(?:^|[\"':; ]){HEX}|{FUNCTION}", written)
            found += [written] * (written in NAMED and written not in ALSO_WORDS)
        if isinstance(node, ast.keyword) and node.arg and COLOURED.search(node.arg):
            inside = [one.value for one in ast.walk(node.value) if isinstance(one, ast.Constant)]
            found += [one for one in inside if isinstance(one, str) and one.lower() not in NO_COLOURS]
        if isinstance(node, ast.Tuple) and len(node.elts) in (3, 4):
            parts = [one.value for one in node.elts if isinstance(one, ast.Constant)]
            if (
                len(parts) == len(node.elts)
                and all(type(one) is int and one <= 255 for one in parts)
                and max(parts) > 127
            ):
                found.append(str(tuple(parts)))
    return found


def literals_of_css(text: str) -> list[str]:
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S).lower()
    values = re.findall(r"[{;]\s*[\w-]+\s*:\s*([^;{}]+)", text)
    found = [one for value in values for one in re.findall(f"{HEX}|{FUNCTION}", value)]
    words = [word for value in values for word in re.findall(r"(?<![\w-])[a-z]+(?![\w(-])", value)]
    return found + [word for word in words if word in NAMED]


def literals_of_script(text: str) -> list[str]:
    text = re.sub(r"/\*.*?\*/|(?<!:)//[^\n]*", "", text, flags=re.S).lower()
    return re.findall(f"[\"'`: ]{HEX}|{FUNCTION}", text) + re.findall(rf"[\"'`](?:{'|'.join(NAMED)})[\"'`]", text)


SOURCES = sorted(
    path
    for path in PACKAGE.rglob("*")
    if path.suffix in {".py", ".js", ".css", ".html"} and path.relative_to(PACKAGE).as_posix() not in ELSEWHERE
)


@pytest.mark.slow
def test_no_colour_is_written_outside_of_the_palette():
    assert len(SOURCES) > 100
    assert {path.suffix for path in SOURCES} == {".py", ".js", ".css", ".html"}
    found = {path.relative_to(PACKAGE).as_posix(): literals(path) for path in SOURCES}
    assert {name: colours for name, colours in found.items() if colours} == {}


@pytest.mark.parametrize(
    ("find", "text", "expected"),
    [
        (literals_of_python, 'PAIR = "#8a8a8a"', 1),
        (literals_of_python, 'axes.plot(x, color="k")', 1),
        (literals_of_python, 'axes.imshow(x, cmap="viridis")', 1),
        (literals_of_python, "MARK = (226, 211, 176)", 1),
        (literals_of_python, 'f\'<rect fill="#fff" x="{x}"/>\'', 1),
        (literals_of_python, 'ink = "white"', 1),
        (literals_of_python, 'axes.plot(x, color="none", label="k")', 0),
        (literals_of_css, "a { color: red; background: #fff; border: 1px solid rgb(0 0 0 / 18%) }", 3),
        (literals_of_css, "#fade, .red { color: var(--swarm-ink); white-space: pre; fill: none }", 0),
        (literals_of_script, "this.#fade = 1; context.fillStyle = colours.red; // #fff", 0),
        (literals_of_script, 'context.fillStyle = dark ? "#a7aeba" : `rgba(1, 2, 3, .5)`; x = "white"', 3),
    ],
)
def test_colours_are_found_where_they_are_written(find, text, expected):
    assert len(find(text)) == expected


# One source: the same thing looks the same wherever it is drawn.


@pytest.fixture(scope="module")
def model():
    return FireFighting(rng=1).run(30)


def fills(collection) -> set[str]:
    return {to_hex(colour) for colour in collection.get_facecolor()}


def test_a_layer_has_the_same_colour_on_the_canvas_in_charts_and_in_the_ethogram():
    names = [f"layer {index}" for index in range(10)]
    expected = [layer_colour(index) for index in range(10)]
    assert expected[8:] == expected[:2]
    figure = ethogram_figure(np.arange(1, 4), np.array([[0, 9], [1, 8], [-1, 2]]), names)
    above, below = figure.axes
    (image,) = above.images
    assert [to_hex(colour) for colour in image.cmap.colors] == [layer_colour(-1), *expected]
    assert [to_hex(stack.get_facecolor()[0]) for stack in below.collections] == expected
    # canvas.js and charts.js take a layer's colour by the same rule from the same list
    page = palette_in(SwarmCanvas._esm)["light"]
    assert [page["layers"][index % len(page["layers"])] for index in range(10)] == expected
    assert page["no_layer"] == layer_colour(-1)


def test_the_chart_of_layers_has_their_colours(model):
    series = Series()
    series.follow(model)
    lines = TimeContent.of(series, ChosenChart(OVER_TIME, "layers")).figure().axes[0].lines
    layers = len(model.control.layers)
    assert [line.get_color() for line in lines] == [*map(layer_colour, range(layers)), LIGHT.no_layer]


def filled(svg: str, kind: str) -> set[str]:
    """Return the colours in which elements of a class are filled, of those that exist."""
    tags = re.findall(rf'<\w+ class="{kind}"[^>]*>', svg)
    return {re.search(r'fill="([^"]*)"', tag)[1] for tag in tags}


def test_bodies_have_the_same_colours_in_pictures_and_thumbnails(model):
    axes = world_figure({"": model}).axes[0]
    picture, thumbnail = {one.get_label(): fills(one) for one in axes.collections}, thumbnail_of(model)
    assert to_hex(axes.get_facecolor()) == LIGHT.ground
    assert f'<rect width="800" height="600" fill="{LIGHT.ground}"/>' in thumbnail
    assert picture["obstacles"] == filled(thumbnail, "obstacles day") == {LIGHT.obstacle}
    assert picture["fronts"] == {LIGHT.robot_front} == set(re.findall(r'class="robots" color="(#\w+)"', thumbnail))
    assert picture["fires"] == filled(thumbnail, "disc day") == set(map(fire_colour, model.fires.temperature))
    assert filled(thumbnail, "back day") == picture["robots"]
    hot = model.swarm.hot
    assert picture["robots"] == {LIGHT.robot_hot if one else LIGHT.robot for one in hot}


@pytest.mark.slow
def test_marks_and_loads_have_the_same_colours_in_pictures_films_animated_drawings_and_thumbnails(transport, tmp_path):
    recording = Recording(transport)
    (drawing,) = export(recording, tmp_path / "a.svg", animate=True, every=60)
    svg, steps = drawing.read_text(), PicturedSteps(recording)
    model = CooperativeTransport(n_robots=12, load="box", resistance=0.5, rng=1)
    axes = world_figure({"": (steps.frame(120), steps.scene)}).axes[0]
    picture, thumbnail = {one.get_label(): fills(one) for one in axes.collections}, thumbnail_of(model)
    assert picture["marks"] == filled(svg, "marks") == filled(thumbnail, "marks day") == {LIGHT.mark}
    assert picture["loads"] == filled(svg, "body") == filled(thumbnail, "body day") == {LIGHT.load}
    assert filled(svg, "back") == {LIGHT.robot}
    film = Screen(steps, Look()).show(120)[..., :3].reshape(-1, 3)
    shown = {"#" + bytes(pixel).hex() for pixel in np.unique(film, axis=0)}
    # Half the outline lies on a robot's front, and softens all of so small a half disc.
    assert {LIGHT.field, LIGHT.ground, LIGHT.mark, LIGHT.load, LIGHT.robot} <= shown


def test_pictures_of_environments_have_the_same_colours():
    model = TaskWorld(task=FindFires(), commanded=1, rng=1)
    picture = Camera(model.map).picture(model)
    shown = {"#" + bytes(pixel).hex() for pixel in np.unique(picture.reshape(-1, 3), axis=0)}
    assert {LIGHT.ground, LIGHT.obstacle, LIGHT.robot, LIGHT.robot_front} <= shown
    assert set(map(fire_colour, model.fires.temperature)) <= shown


@pytest.mark.parametrize("temperature", [0.0, 0.007, 0.0079, 0.5, 0.992, 1.0])
def test_a_temperature_has_the_nearest_of_its_colours(temperature):
    assert fire_steps(temperature) == round(64 * temperature)
    assert LIGHT.fire[fire_steps(temperature)] == fire_colour(temperature)
