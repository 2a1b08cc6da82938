"""Fields, kinds of bodies, values and labels of a model's own, as a browser draws them and names them."""

import base64
import subprocess
import sys

import numpy as np
import pytest

from mesa_swarm import AGENT9, ColourMap, Field, Looks, Recording, SwarmModel, disc
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.viewing import palette, text_of
from mesa_swarm.viewing.export import export
from mesa_swarm.viewing.frame_bytes import PACKED_FROM, packed_frame
from mesa_swarm.viewing.palette import DARK, LIGHT, PALETTES, fire_colour, rgb
from mesa_swarm.viewing.replay_page import replay_page
from mesa_swarm.viewing.scene import PART_OPACITY, scene_of
from support.own_parts import Whole
from support.visits import HOST, Visit, answers, blank_page, free_port
from support.waiting import wait_until

pytestmark = pytest.mark.long

SCRIPT = palette.palette_script() + text_of("viewing/canvas.js")
# Draws a frame; returns the legend, the colour at some places of the map, and the texts that are written.
DRAW = """async ({ script, world, frame, theme, off, places }) => {
  const { Stage, fillLegend, togglesOf, unpacked } = await import(
    URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
  const canvas = document.createElement("canvas"), list = document.createElement("ul"), written = [];
  canvas.style.cssText = "width: 800px; height: 600px; display: block";
  document.body.replaceChildren(canvas, list);
  const stage = new Stage(canvas, world, { theme }), context = canvas.getContext("2d"), write = context.fillText;
  context.fillText = (text, ...at) => { written.push(text); write.call(context, text, ...at); };
  for (const name of ["sectors", "trails", ...off]) stage.set(name, false);
  stage.show(unpacked(world, Uint8Array.from(atob(frame), (c) => c.charCodeAt(0))));
  fillLegend(list, stage.legend());
  const pixels = places.map(([x, y]) => [...context.getImageData(...stage.toCanvas(x, y).map(Math.round), 1, 1).data]);
  return { legend: [...list.children].map((item) => [item.dataset.form, item.innerText.replace(/\\s+/g, " ")]),
           toggles: togglesOf(world).map(({ name }) => name), pixels: pixels.map((one) => one.slice(0, 3)), written };
}"""


class Marked(SwarmModel):
    """Two fields, each full in a corner, a nest, a puck, and a robot that is labelled and coloured."""

    looks = Looks(
        kinds={"nest": ("#102030", "#d0e0f0"), "puck": "#c08030"},
        column=ColourMap("number", 0, 4, label="its number"),
        label=lambda model: ["scout"],
    )

    def __init__(self, *, rng=None):
        super().__init__(map="openspace", rng=rng)
        self.add_robots(AGENT9, poses=[(400, 300, 0.0)])
        self.add_body(disc((200, 300), 30), kind="nest", mode="fixed")
        self.add_body(disc((600, 300), 30), kind="puck", mode="pushed", resistance=1.0)
        self.add_field(Field("trail", cell=100.0)).deposit((250, 150), 4.0)
        self.add_field(Field("food", cell=100.0)).deposit((550, 450), 0.25)


@pytest.fixture
def draw(chromium):
    page = blank_page(chromium, viewport={"width": 900, "height": 700})
    model = Marked(rng=1)
    scene = scene_of(model)
    frame = base64.b64encode(packed_frame(frame_of(model, PACKED_FROM), scene)).decode()

    def draw(theme="light", off=(), places=((250, 150), (550, 450), (200, 300), (600, 300))):
        inputs = {"theme": theme, "off": list(off), "places": places}
        return page.evaluate(DRAW, {"script": SCRIPT, "world": scene.world(), "frame": frame, **inputs})

    yield draw
    page.close()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_fields_and_kinds_have_their_colours_and_a_legend_names_them_with_their_ranges(draw, theme):
    found, colours = draw(theme), PALETTES[theme]
    assert found["legend"] == [
        ["body", "obstacle"],
        ["body", "nest"],
        ["body", "puck"],
        ["value", "its number 0 to 4"],
        ["field", "trail 0 to 4"],
        ["field", "food 0 to 0.25"],
    ]
    trail, food, nest, puck = found["pixels"]
    for pixel, shade in ((trail, colours.scalars[0]), (food, colours.scalars[1])):
        opacity = int(shade[7:], 16) / 255
        assert pixel == pytest.approx(opacity * rgb(shade) + (1 - opacity) * rgb(colours.ground), abs=20)
    assert nest == rgb("#102030" if theme == "light" else "#d0e0f0").tolist()
    assert puck == rgb("#c08030").tolist()


def test_a_field_is_hidden_by_its_name_in_the_picture_and_the_legend(draw):
    found = draw(off=["fields.trail"])
    assert found["toggles"][-3:] == ["texts", "fields.trail", "fields.food"]
    assert [name for form, name in found["legend"] if form == "field"] == ["food 0 to 0.25"]
    assert found["pixels"][0] == rgb(LIGHT.ground).tolist()
    assert found["pixels"][1] != rgb(LIGHT.ground).tolist()


def test_labels_of_robots_are_switched_apart_from_numbers_of_fires(draw):
    assert "scout" in draw()["written"]
    assert "scout" in draw(off=["labels"])["written"]
    assert "scout" not in draw(off=["texts"])["written"]


class Fading(Marked):
    """The trail is removed after three steps; the looks are those of columns, which are recorded."""

    looks = Looks(kinds=Marked.looks.kinds, column=ColourMap("number", 0, 4), label="number")

    def step(self):
        super().step()
        if self.completed == 3:
            self.remove_field("trail")


def test_a_replay_switches_and_names_fields_until_they_are_removed(chromium, tmp_path):
    model = Fading(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(5)
    (tmp_path / "run.html").write_text(replay_page(Recording(tmp_path / "run.arrow")), encoding="utf-8")
    page, complaints = blank_page(chromium), []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto((tmp_path / "run.html").as_uri())
    page.wait_for_selector("html[data-ready=true]")
    named = "[...document.querySelectorAll('#colours li')].map((item) => item.innerText.replace(/\\s+/g, ' '))"
    bodies, sectors = ["obstacle", "nest", "puck", "number 0 to 4"], ["sensor that sees nothing"]
    assert page.evaluate(named) == [*bodies, "trail 0 to 4", "food 0 to 0.25", *sectors]
    page.get_by_label("Field food").uncheck()
    assert page.evaluate(named) == [*bodies, "trail 0 to 4", *sectors]
    page.get_by_label("Field food").check()
    page.get_by_role("button", name="Dark").click()
    nest = "getComputedStyle(document.querySelector('#colours li:nth-child(2) i')).backgroundColor"
    assert page.evaluate(nest) == f"rgb{tuple(rgb('#d0e0f0').tolist())}"
    page.evaluate("mesaSwarmReplay.goTo(4)")
    page.wait_for_function("mesaSwarmReplay.stage.frame.step === 5")
    page.wait_for_function(f"{named}.length === {len(bodies) + 2}")
    assert page.evaluate(named) == [*bodies, "food 0 to 0.25", *sectors]
    at = "mesaSwarmReplay.stage.toCanvas(250, 150).map(Math.round)"
    pixel = f"[...document.getElementById('world').getContext('2d').getImageData(...{at}, 1, 1).data].slice(0, 3)"
    assert page.evaluate(pixel) == rgb(DARK.ground).tolist()
    page.close()
    assert complaints == []


MODEL = """
from mesa_swarm import AGENT9, Field, Looks, SwarmModel, disc


class Marked(SwarmModel):
    looks = Looks(kinds={"nest": "#d0a000"}, label=lambda model: ["scout"])

    def __init__(self, *, rng=None):
        super().__init__(map="openspace", rng=rng)
        self.add_robots(AGENT9, poses=[(400, 300, 0.0)])
        self.add_body(disc((200, 300), 30), kind="nest", mode="fixed")
        self.add_field(Field("trail", cell=100.0)).deposit((250, 150), 4.0)
"""
LAUNCH = (
    "import sys; from mesa_swarm.dashboard import launch; launch(sys.argv[1], int(sys.argv[2]), open_browser=False)"
)
# The colour where the field has its largest value.
AT_FIELD = """(() => {
  const canvas = document.querySelector(".swarm-stage canvas"), [left, top, right, bottom] = canvas.arena();
  const x = left + (250 / 800) * (right - left), y = top + (450 / 600) * (bottom - top);
  return [...canvas.getContext("2d").getImageData(Math.round(x), Math.round(y), 1, 1).data].slice(0, 3);
})()"""


@pytest.fixture
def own_page(chromium, tmp_path):
    """A dashboard of a model in a file."""
    (tmp_path / "marked.py").write_text(MODEL, encoding="utf-8")
    port = free_port()
    process = subprocess.Popen([sys.executable, "-c", LAUNCH, f"{tmp_path}/marked.py:Marked", str(port)])
    context = chromium.new_context(viewport={"width": 1366, "height": 768})
    try:
        wait_until(lambda: answers(port), 90)
        visitor = Visit(context, f"http://{HOST}:{port}/")
        yield visitor
        assert visitor.complaints == []
    finally:
        context.close()
        process.kill()
        process.wait()


def test_the_page_switches_fields_and_names_them_with_kinds_of_bodies(own_page):
    own_page.wait_for_step(0)
    key = own_page.page.locator(".swarm-key")
    named = ["robot, its front pale", "obstacle", "nest", "trail 0 to 4", "sensor that sees nothing"]
    assert [" ".join(text.split()) for text in key.locator("li").all_inner_texts()] == named
    shown = own_page.page.evaluate(AT_FIELD)
    assert shown != rgb(LIGHT.ground).tolist()
    own_page.page.locator(".swarm-tools summary").click()
    own_page.page.get_by_label("Field trail").uncheck()
    assert key.locator("li").count() == 4
    assert own_page.page.evaluate(AT_FIELD) == rgb(LIGHT.ground).tolist()
    own_page.page.get_by_label("Field trail").check()
    assert own_page.page.evaluate(AT_FIELD) == pytest.approx(shown, abs=2)


def test_a_browser_draws_the_discs_of_a_part_and_names_them(chromium):
    model = Whole(rng=1).run(2)
    model.parts["boards"].strength[:] = [8.0, 4.0]
    scene = scene_of(model)
    frame = base64.b64encode(packed_frame(frame_of(model, PACKED_FROM), scene)).decode()
    page = blank_page(chromium, viewport={"width": 900, "height": 700})
    facts = {"script": SCRIPT, "world": scene.world(), "frame": frame, "theme": "light"}
    off = ["fields.boards", "fields.trail"]
    drawn = page.evaluate(DRAW, {**facts, "off": off, "places": [[200, 200], [500, 405], [500, 430]]})
    page.close()
    mixed = PART_OPACITY * rgb("#aa3311") + (1 - PART_OPACITY) * rgb(LIGHT.ground)
    assert np.abs(np.array(drawn["pixels"][:2]) - mixed).max() < 3
    assert np.abs(np.array(drawn["pixels"][2]) - rgb(LIGHT.ground)).max() < 3
    assert ["body", "boards"] in [[form, name.strip()] for form, name in drawn["legend"]]


@pytest.mark.parametrize("theme", PALETTES)
def test_a_browser_draws_what_radiates_in_the_colour_of_its_temperature_and_names_it(chromium, theme):
    model = SwarmModel(map="openspace", rng=1)
    model.add_body(disc((200, 300), 30), kind="lamp", mode="fixed", temperature=1.0)
    model.add_body(disc((600, 300), 30), kind="lamp", temperature=0.5)
    scene = scene_of(model)
    frame = base64.b64encode(packed_frame(frame_of(model, PACKED_FROM), scene)).decode()
    page = blank_page(chromium, viewport={"width": 900, "height": 700})
    facts = {"script": SCRIPT, "world": scene.world(), "frame": frame, "theme": theme, "off": []}
    drawn = page.evaluate(DRAW, {**facts, "places": [[200, 300], [600, 300]]})
    page.close()
    assert drawn["pixels"] == [rgb(fire_colour(heat, PALETTES[theme])).tolist() for heat in (1.0, 0.5)]
    assert ["radiant", "lamp, temperature 0 to 1"] in drawn["legend"]


def test_a_replay_has_the_discs_of_every_row(chromium, tmp_path):
    model = Whole(rng=1)
    with model.record(tmp_path / "run.arrow", exact=True):
        model.run(12)
        model.remove_part("boards")
        model.run(3)
    export(tmp_path / "run.arrow", tmp_path / "run.html")
    page = blank_page(chromium, viewport={"width": 900, "height": 700})
    page.goto((tmp_path / "run.html").as_uri())
    page.wait_for_selector("html[data-ready]")
    shown = [page.evaluate(f"[...mesaSwarmReplay.film.at({row}).shown]") for row in (4, 14)]
    page.close()
    rows = Recording(tmp_path / "run.arrow")[4]["shown"]
    expected = np.column_stack([rows[name] for name in ("part", "x", "y", "radius")])
    np.testing.assert_allclose(np.reshape(shown[0], (-1, 4)), expected, rtol=1e-6)
    assert shown[1] == []
