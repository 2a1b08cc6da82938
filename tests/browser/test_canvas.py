"""The canvas by itself, in a real browser: many robots, which are copied, look like few, which are drawn."""

import base64
from importlib.resources import files

import numpy as np
import pytest

from mesa_swarm import AGENT9, Map, SwarmModel, disc
from mesa_swarm.models.boids import Boids
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.models.perimeter import Perimeter
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.viewing import palette
from mesa_swarm.viewing.frame_bytes import PACKED_FROM, packed_frame
from mesa_swarm.viewing.scene import scene_of
from support.visits import blank_page, settle

pytestmark = pytest.mark.slow

SCRIPT = palette.palette_script() + (files("mesa_swarm.viewing") / "canvas.js").read_text(encoding="utf-8")
WIDTH, HEIGHT, LEFT = 900, 675, 150
EVERYWHERE = 1e6
DRAW = """async ({ script, world, frame, before, turned, scale }) => {
  const { Stage, unpacked } = await import(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
  const canvas = document.createElement("canvas");
  canvas.style.cssText = "width: 900px; height: 675px; display: block";
  document.body.replaceChildren(canvas);
  const stage = new Stage(canvas, world), all = unpacked(world, Uint8Array.from(atob(frame), (c) => c.charCodeAt(0)));
  stage.set("sectors", false);
  stage.zoom(scale, [0, 0]);
  for (let i = 0; i < all.counts.robots; i++) all.pose[3 * i + 2] += turned;
  const rows = [...all.ids.keys()].filter((i) => all.pose[3 * i] < before / scale);
  const chosen = { ...all, counts: { ...all.counts, robots: rows.length, contacts: 0 } };
  for (const [name, width] of [["ids", 1], ["pose", 3], ["layer", 1], ["design", 1], ["heat", 1], ["heard", 2]]) {
    chosen[name] = all[name].constructor.from(rows.flatMap((i) => [...all[name].subarray(width * i, width * (i + 1))]));
  }
  stage.show(chosen);
  const pixels = canvas.getContext("2d").getImageData(0, 0, 150, 675).data, parts = [];
  for (let i = 0; i < pixels.length; i += 8192) parts.push(String.fromCharCode(...pixels.subarray(i, i + 8192)));
  return { robots: rows.length, pixels: btoa(parts.join("")) };
}"""

# What is written on the canvas and where, and where on it each place of the map is.
WRITE = """async ({ script, world, frame, places }) => {
  const { Stage, unpacked } = await import(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
  const canvas = document.body.appendChild(document.createElement("canvas")), written = [];
  const stage = new Stage(canvas, world);
  canvas.getContext("2d").fillText = (...text) => written.push(text);
  stage.show(unpacked(world, Uint8Array.from(atob(frame), (c) => c.charCodeAt(0))));
  stage.set("labels", false);
  return [written, places.map(([x, y]) => stage.toCanvas(x, y))];
}"""


@pytest.fixture(scope="module")
def drawn(chromium):
    """Draw the robots of a world that are left of a place; return how many, and the pixels of the left part."""
    model = CollisionAvoidance(n_robots=180, rng=1).run(50)
    scene = scene_of(model)
    world, frame = scene.world(), base64.b64encode(packed_frame(frame_of(model, PACKED_FROM), scene)).decode()
    page = blank_page(chromium, viewport={"width": WIDTH, "height": HEIGHT})

    def draw(before: float, turned: float = 0.0, scale: float = 1.0) -> tuple[int, np.ndarray]:
        inputs = {"script": SCRIPT, "world": world, "frame": frame, "before": before, "turned": turned, "scale": scale}
        found = page.evaluate(DRAW, inputs)
        pixels = np.frombuffer(base64.b64decode(found["pixels"]), np.uint8).astype(int)
        return found["robots"], pixels.reshape(HEIGHT, LEFT, 4)[..., :3]

    yield draw
    page.close()


@pytest.mark.parametrize("scale", [0.6, 1.0])
def test_robots_that_are_copied_look_like_those_that_are_drawn(drawn, scale):
    (many, copied), (few, exact) = drawn(EVERYWHERE, scale=scale), drawn(1.1 * LEFT, scale=scale)
    assert few <= 100 < many
    robots = (exact != drawn(0.0, scale=scale)[1]).any(axis=-1)

    def off(other: np.ndarray) -> float:
        return np.abs(other - exact).max(axis=-1)[robots].mean()

    _, turned = drawn(1.1 * LEFT, turned=np.pi, scale=scale)
    shifted = np.roll(exact, 1, axis=1)
    print(f"of 255: {off(copied):.1f} off, turned round {off(turned):.1f}, a pixel away {off(shifted):.1f}")
    assert 0 < off(copied) < min(0.7 * off(turned), 0.25 * off(shifted))


def test_every_fire_has_the_number_that_charts_give_it_written_below_it(chromium):
    model = FireFighting(rng=1).run(20)
    scene = scene_of(model)
    world, frame = scene.world(), base64.b64encode(packed_frame(frame_of(model, PACKED_FROM), scene)).decode()
    page = blank_page(chromium, viewport={"width": WIDTH, "height": HEIGHT})
    page.set_content("<style>canvas { position: fixed; width: 900px; height: 675px }</style>")
    inputs = {"script": SCRIPT, "world": world, "frame": frame, "places": model.fires.position.tolist()}
    written, places = page.evaluate(WRITE, inputs)
    page.close()
    found = {text: place for text, *place in written if text.startswith("fire ")}
    assert list(found) == [f"fire {number}" for number in range(1, len(model.fires) + 1)]
    for (x, y), (middle, centre) in zip(found.values(), places, strict=True):
        assert x == pytest.approx(middle, abs=0.01)
        assert centre < y < centre + 60


# A page with a canvas in a box, on which a world is drawn: `stage`, `frame`, `written` (what was last written on it).
STAND = """async ({ script, world, frame, style }) => {
  const { Stage, unpacked } = await import(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
  document.body.innerHTML = `<div style="height: 100px">above</div><canvas tabindex="0"></canvas>`;
  document.body.style.cssText = "margin: 0; " + style;
  const canvas = document.querySelector("canvas"), context = canvas.getContext("2d"), write = context.fillText;
  canvas.style.cssText = "width: 800px; height: 600px; display: block";
  window.written = [];
  context.fillText = (text, ...at) => { written.push(text); write.call(context, text, ...at); };
  window.heard = [];
  const onSelect = (id) => heard.push(`selected ${id}`), onDense = (dense) => heard.push(`dense ${dense}`);
  window.stage = new Stage(canvas, world, { onSelect, onDense });
  window.frame = unpacked(world, Uint8Array.from(atob(frame), (c) => c.charCodeAt(0)));
  stage.show(window.frame);
}"""
PIXELS = """(() => {
  const { width, height } = document.querySelector("canvas");
  const pixels = document.querySelector("canvas").getContext("2d").getImageData(0, 0, width, height).data, parts = [];
  for (let i = 0; i < pixels.length; i += 8192) parts.push(String.fromCharCode(...pixels.subarray(i, i + 8192)));
  return [height, width, btoa(parts.join(""))];
})()"""
# A tool that notes what it hears, and takes drags that begin on a robot.
NOTING = """(() => {
  const text = (what, x, y, hit) => `${what} ${Math.round(x)} ${Math.round(y)} ${hit?.kind ?? ""}`.trim();
  const note = (what) => ({ x, y, hit }) => heard.push(text(what, x, y, hit));
  const press = (spot) => (note("press")(spot), spot.hit.kind === "robot");
  const cancel = () => heard.push("cancel"), draw = (context, pixel) => {
    context.fillStyle = "black";
    context.fillRect(0, 0, 10 * pixel, 10 * pixel);
  };
  stage.tool = { cursor: "crosshair", press, move: note("move"), release: note("release"), cancel, draw };
})()"""


@pytest.fixture
def stand(chromium):
    """Draw a model on a page of its own; return the page."""
    opened = []

    def draw(model, style: str = "", **looks):
        page = blank_page(chromium, viewport={"width": 900, "height": 720}, **looks)
        opened.append(page)
        scene = scene_of(model)
        packed = base64.b64encode(packed_frame(frame_of(model, PACKED_FROM), scene)).decode()
        page.evaluate(STAND, {"script": SCRIPT, "world": scene.world(), "frame": packed, "style": style})
        return page

    yield draw
    for page in opened:
        page.close()


def pixels_of(page) -> np.ndarray:
    height, width, text = page.evaluate(PIXELS)
    return np.frombuffer(base64.b64decode(text), np.uint8).reshape(height, width, 4)[..., :3].astype(int)


def place_of(page, x: float, y: float) -> tuple[float, float]:
    """Return where in the window a place of the map is."""
    across, down = page.evaluate(f"stage.toCanvas({x}, {y})")
    return across, down + 100


def robots(positions, width: float = 800.0, **more) -> SwarmModel:
    model = SwarmModel(map=Map(name="plain", bounds=(0, 0, width, 0.75 * width)), rng=1)
    model.add_robots(AGENT9, poses=[(x, y, 0.0) for x, y in positions], **more)
    return model


def test_where_too_many_sectors_overlap_those_of_the_selected_robot_only_are_drawn(stand):
    page = stand(Perimeter(rng=1).run(20))
    assert page.evaluate("stage.dense")
    assert page.evaluate("heard") == ["dense true"]
    nothing = pixels_of(page)
    page.evaluate("stage.set('sectors', false)")
    assert np.array_equal(pixels_of(page), nothing)
    page.evaluate("stage.select(frame.ids[0])")
    ring = (pixels_of(page) != nothing).any(axis=-1).sum()
    page.evaluate("stage.set('sectors', true)")
    assert (pixels_of(page) != nothing).any(axis=-1).sum() > 20 * ring


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_few_sectors_are_all_drawn_at_any_zoom_and_many_never(stand, scale):
    few, many = stand(Boids(rng=1).run(50)), stand(Boids(n_robots=500, rng=1).run(50))
    for page, dense in ((few, False), (many, True)):
        page.evaluate(f"stage.zoom({scale})")
        assert page.evaluate("stage.dense") is dense


def test_a_robot_that_is_pointed_at_is_named_with_its_layer_and_shows_its_sectors(stand):
    model = Perimeter(rng=1).run(20)
    page = stand(model)
    before, (x, y), robot = pixels_of(page), model.swarm.position[3], model.robots[3]
    page.mouse.move(*place_of(page, x, y))
    settle(page)
    layer = page.evaluate(f"stage.world.layers[{model.swarm.layer[3]}]")
    assert page.evaluate("written").count(f"robot {robot.unique_id}, {layer}") == 1
    assert (pixels_of(page) != before).any(axis=-1).mean() > 0.05
    page.mouse.move(850, 50)
    settle(page)
    assert np.array_equal(pixels_of(page), before)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_a_robot_of_6_pixels_points_where_it_heads(stand, theme):
    headings = np.linspace(-3, 3, 30)
    model = SwarmModel(map=Map(name="plain", bounds=(0, 0, 800, 600)), rng=1)
    model.add_robots(AGENT9, poses=[(100 + 120 * (k % 6), 100 + 100 * (k // 6), a) for k, a in enumerate(headings)])
    page = stand(model)
    page.evaluate(f"stage.set('sectors', false); stage.theme = '{theme}'")
    page.evaluate("stage.zoom(3 / 5 / stage.view.scale)")
    drawn, ground = pixels_of(page), palette.rgb(palette.PALETTES[theme].ground)
    for (x, y), heading in zip(model.swarm.position, headings, strict=True):
        left, top = (round(place) - 12 for place in page.evaluate(f"stage.toCanvas({x}, {y})"))
        weight = np.abs(drawn[top : top + 25, left : left + 25] - ground).sum(axis=-1) > 60
        rows, columns = np.nonzero(weight)
        offset = page.evaluate(f"stage.toCanvas({x}, {y})")
        ahead = columns.mean() + left + 0.5 - offset[0], offset[1] - (rows.mean() + top + 0.5)
        assert 20 < weight.sum() < 90
        assert abs(np.angle(np.exp(1j * (np.arctan2(ahead[1], ahead[0]) - heading)))) < 0.6


def test_robots_of_a_large_map_are_no_smaller_than_can_be_seen_as_long_as_there_is_room(stand):
    few = stand(robots([(500 + 1000 * (k % 8), 500 + 900 * (k // 8)) for k in range(40)], width=9000.0))
    few.evaluate("stage.set('sectors', false)")
    ground = palette.rgb(palette.LIGHT.ground)
    seen = (np.abs(pixels_of(few)[50:550, 50:750] - ground).sum(axis=-1) > 100).sum()
    assert seen > 30 * 28
    few.evaluate("stage.enlarge = 1.6")
    assert (np.abs(pixels_of(few)[50:550, 50:750] - ground).sum(axis=-1) > 100).sum() > 1.8 * seen
    many = stand(robots([(20 + 40 * (k % 200), 20 + 40 * (k // 200)) for k in range(1900)], width=9000.0))
    many.evaluate("stage.set('sectors', false)")
    filled = (np.abs(pixels_of(many) - ground).sum(axis=-1) > 100).mean()
    assert filled < 0.25


def test_what_is_at_a_place_of_the_map_is_found(stand):
    model = FireFighting(n_robots=3, rng=1)
    model.add_load(disc((250, 150), 14), resistance=1.0)
    page = stand(model)
    (x, y), (left, up) = model.swarm.position[1], model.fires.position[2]
    hit = "stage.hit({}, {})".format
    assert page.evaluate(hit(x, y)) == {"kind": "robot", "id": model.robots[1].unique_id}
    assert page.evaluate(hit(left, up)) == {"kind": "fire", "index": 2}
    assert page.evaluate(hit(255, 150)) == {"kind": "load", "index": 0, "id": model.loads[0].unique_id}
    assert page.evaluate(hit(2, 2))["kind"] == "shape"
    assert page.evaluate(hit(320, 320))["kind"] in (None, "robot")
    assert page.evaluate("stage.toMap(...stage.toCanvas(12, 34))") == pytest.approx([12, 34])


def test_a_tool_takes_drags_that_it_wants_and_leaves_others_to_the_canvas(stand):
    page = stand(robots([(200, 200), (600, 400)]))
    before = page.evaluate("stage.view")
    page.evaluate(NOTING)
    assert page.evaluate("document.querySelector('canvas').style.cursor") == "crosshair"
    assert pixels_of(page).min() == 0  # what the tool draws
    page.mouse.move(*place_of(page, 200, 200))
    page.mouse.down()
    page.mouse.move(*place_of(page, 300, 300), steps=2)
    page.mouse.up()
    assert page.evaluate("heard") == ["press 200 200 robot", "move 250 250", "move 300 300", "release 300 300"]
    assert page.evaluate("stage.view") == before
    page.evaluate("heard.length = 0")
    page.mouse.move(*place_of(page, 600, 400))
    page.mouse.down()
    page.mouse.move(*place_of(page, 650, 400))
    page.keyboard.press("Escape")
    page.mouse.move(*place_of(page, 660, 400))
    page.mouse.up()
    assert page.evaluate("heard") == ["press 600 400 robot", "move 650 400", "cancel"]
    page.evaluate("stage.tool = null; heard.length = 0")
    page.mouse.click(*place_of(page, 600, 400))
    assert page.evaluate("heard").pop().startswith("selected ")


def test_beside_what_a_tool_takes_the_map_is_dragged(stand):
    page = stand(robots([(200, 200)]))
    page.evaluate(NOTING)
    before = page.evaluate("stage.view")
    page.mouse.move(*place_of(page, 500, 300))
    page.mouse.down()
    page.mouse.move(*place_of(page, 550, 300), steps=3)
    page.mouse.up()
    assert page.evaluate("heard") == ["press 500 300"]
    assert page.evaluate("stage.view.x") == pytest.approx(before["x"] - 50, abs=1)


def test_where_the_page_scrolls_the_wheel_zooms_only_with_the_focus_or_control(stand):
    for style, scrolls in (("overflow: hidden; height: 500px", False), ("height: 3000px", True)):
        page = stand(robots([(200, 200)]), style=style)
        scale = "stage.view.scale"
        before = page.evaluate(scale)
        page.mouse.move(400, 300)
        page.mouse.wheel(0, -50)
        page.mouse.wheel(0, 100)
        settle(page)
        if scrolls:
            page.wait_for_function("scrollY > 0")
        assert (page.evaluate(scale) == before) is scrolls
        page.keyboard.down("Control")
        page.mouse.wheel(0, -100)
        page.keyboard.up("Control")
        page.wait_for_function(f"{scale} > {before}")
        before = page.evaluate(scale)
        page.mouse.click(400, 300)
        page.mouse.wheel(0, -100)
        page.wait_for_function(f"{scale} > {before}")


def fingers(session, kind: str, *places) -> None:
    points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(places)]
    session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


def test_a_finger_scrolls_the_page_while_the_whole_map_is_shown_and_two_zoom(stand):
    page = stand(robots([(200, 200)]), style="height: 3000px", has_touch=True)
    session = page.context.new_cdp_session(page)
    before = page.evaluate("stage.view")

    def drag(dx: float, dy: float) -> None:
        fingers(session, "touchStart", (400, 400))
        for k in range(1, 9):
            fingers(session, "touchMove", (400 + k * dx / 8, 400 + k * dy / 8))
        page.wait_for_timeout(200)  # a finger that is lifted while it moves lets the page scroll on
        fingers(session, "touchEnd")

    drag(0, -120)
    page.wait_for_function("scrollY > 50")
    assert page.evaluate("stage.view") == before
    page.evaluate("scrollTo(0, 0)")
    fingers(session, "touchStart", (350, 400), (450, 400))
    for k in range(1, 6):
        fingers(session, "touchMove", (350 - 20 * k, 400), (450 + 20 * k, 400))
    fingers(session, "touchEnd")
    page.wait_for_function(f"stage.view.scale > {1.5 * before['scale']}")
    assert page.evaluate("scrollY") == 0
    middle = page.evaluate("stage.view.y")
    drag(0, -80)
    page.wait_for_function(f"stage.view.y < {middle}")
    assert page.evaluate("scrollY") == 0
