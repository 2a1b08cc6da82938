"""Looks that can be computed: text that is readable, and colours that people with any colour vision tell apart."""

import re
from importlib.resources import files
from itertools import combinations

import numpy as np
import pytest

STYLE, PLAYER = (
    (files("mesa_swarm") / name).read_text(encoding="utf-8") for name in ("dashboard/style.css", "viewing/widget.css")
)
CANVAS = (files("mesa_swarm.viewing") / "canvas.js").read_text(encoding="utf-8")
READABLE = 4.5
SEEN = 3.0

# Machado, Oliveira and Fernandes (2009), severity 1, on linear RGB.
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


def linear(colour: str) -> np.ndarray:
    share = np.array([int(colour[place : place + 2], 16) for place in (1, 3, 5)]) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def contrast(one: str, two: str) -> float:
    """Return the contrast of two colours, 1 to 21 (WCAG 2.2, 1.4.3)."""
    light, dark = sorted(float(linear(colour) @ [0.2126, 0.7152, 0.0722]) + 0.05 for colour in (one, two))[::-1]
    return light / dark


def lab(light: np.ndarray) -> np.ndarray:
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    x, y, z = np.cbrt(np.clip(to_xyz @ light / [0.9505, 1.0, 1.089], 1e-6, None))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def difference(one: str, two: str, vision: str) -> float:
    """Return how far apart two colours are to somebody, in CIE Lab; 2 is just seen side by side."""
    seen = [lab(np.clip(VISIONS[vision] @ linear(colour), 0, 1)) for colour in (one, two)]
    return float(np.linalg.norm(seen[0] - seen[1]))


def variables(css: str, selector: str) -> dict[str, str]:
    block = css[css.index(selector + " {") :].split("}", maxsplit=1)[0]
    return dict(re.findall(r"--(?:swarm|p)-(\w+): (#[0-9a-f]{6})", block))


def themes() -> dict[str, dict[str, str]]:
    page, player = variables(STYLE, ".v-application"), variables(PLAYER, ".swarm-player")
    return {
        "page, light": page,
        "page, dark": page | variables(STYLE, ".v-application.theme--dark"),
        "player, light": player,
        "player, dark": player | variables(PLAYER, '.swarm-player[data-theme="dark"]'),
    }


def colours_of_canvas(theme: str) -> dict[str, str]:
    block = re.search(rf"  {theme}: {{(.*?)\n  }}", CANVAS, re.S).group(1)
    return dict(re.findall(r'(\w+): "(#[0-9a-f]{6})"', block))


@pytest.mark.parametrize("name", themes())
def test_text_is_readable_on_everything_that_it_may_stand_on(name):
    colours = themes()[name]
    papers = {"page", "paper", "field", "hover"} & colours.keys()
    inks = {"ink", "soft", "warn", "bad"} & colours.keys()
    pairs = [(ink, paper) for ink in sorted(inks) for paper in sorted(papers)] + [("on", "accent")]
    if "badpaper" in colours:
        pairs += [("ink", "badpaper"), ("bad", "badpaper")]
    assert {pair: ratio for pair in pairs if (ratio := contrast(*(colours[one] for one in pair))) < READABLE} == {}


@pytest.mark.parametrize("name", themes())
def test_what_is_chosen_and_where_the_focus_is_stands_out(name):
    colours = themes()[name]
    papers = {"page", "paper", "field"} & colours.keys()
    assert min(contrast(colours["accent"], colours[paper]) for paper in papers) >= SEEN
    assert min(contrast(colours["focus"], colours[paper]) for paper in papers) >= SEEN


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_what_stands_in_the_world_stands_out_from_the_ground(theme):
    colours = colours_of_canvas(theme)
    for name in ("solid", "mark", "load", "contact", "message", "chosen", "perceived", "travel"):
        assert contrast(colours[name], colours["ground"]) >= SEEN, name
    assert contrast(colours["text"], colours["ground"]) >= READABLE
    assert contrast(colours["onAshes"], colours["ashes"]) >= READABLE
    for red in ("cold", "hot"):
        shares = re.search(rf"{red}: \[([\d, ]+)\]", CANVAS[CANVAS.index(f"  {theme}: {{") :]).group(1)
        fire = "#" + "".join(f"{int(share):02x}" for share in shares.split(","))
        assert contrast(colours["onFire"], fire) >= SEEN, "large text"


@pytest.mark.parametrize("vision", VISIONS)
def test_layers_are_told_apart_with_any_colour_vision(vision):
    colours = re.findall(r'"(#[0-9a-f]{6})"', re.search(r"LAYER_COLOURS = \[(.*?)\]", CANVAS).group(1))
    assert len(colours) == 8
    near = {pair: d for pair in combinations(colours[:5], 2) if (d := difference(*pair, vision)) < 10}
    assert near == {}


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("vision", VISIONS)
def test_front_and_rear_of_a_robot_are_told_apart_with_any_colour_vision(theme, vision):
    colours = colours_of_canvas(theme)
    assert difference(colours["front"], colours["rear"], vision) > 30
