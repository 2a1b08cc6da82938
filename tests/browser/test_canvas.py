"""The canvas by itself, in a real browser: many robots, which are copied, look like few, which are drawn."""

import base64
from importlib.resources import files

import numpy as np
import pytest

from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.viewing import palette
from mesa_swarm.viewing.packing import PACKED_FROM, packed_frame
from mesa_swarm.viewing.scene import scene_of
from support.visits import blank_page

pytestmark = pytest.mark.slow

SCRIPT = palette.script() + (files("mesa_swarm.viewing") / "canvas.js").read_text(encoding="utf-8")
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
