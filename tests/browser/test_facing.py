"""On the canvas, a body that moves without turning is drawn in its direction of motion."""

import base64

import pytest

from mesa_swarm.models.boids import Boids
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.viewing import palette, text_of
from mesa_swarm.viewing.frame_bytes import PACKED_FROM, packed_frame
from mesa_swarm.viewing.scene import scene_of
from support.visits import blank_page

pytestmark = pytest.mark.long

DRAW = """async ({ script, world, frame, travel, drawn }) => {
  const { Stage, unpacked } = await import(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
  const pictures = drawn.map(([holonomic, heading, command]) => {
    const canvas = document.createElement("canvas");
    canvas.style.cssText = "width: 900px; height: 675px; display: block";
    document.body.replaceChildren(canvas);
    const designs = world.designs.map((design) => ({ ...design, holonomic }));
    const stage = new Stage(canvas, { ...world, designs });
    const one = unpacked(world, Uint8Array.from(atob(frame), (c) => c.charCodeAt(0)));
    for (let i = 0; i < one.counts.robots; i++) {
      one.pose[3 * i + 2] = heading;
      one.command.set(command, 2 * i);
    }
    stage.set("sectors", false);
    // Arrows in the direction of travel are drawn beside bodies; here only the bodies count.
    const context = canvas.getContext("2d"), fill = context.fill.bind(context);
    context.fill = (...path) => { if (context.fillStyle !== travel) fill(...path); };
    stage.show(one);
    return canvas.toDataURL();
  });
  return pictures;
}"""


@pytest.mark.parametrize("robots", [20, 150])
def test_bodies_on_the_canvas_face_where_they_move(chromium, robots):
    """With 20 robots each is drawn, with 150 they are copied."""
    model = Boids(n_robots=robots, rng=1).run(2)
    scene = scene_of(model)
    page = blank_page(chromium, viewport={"width": 900, "height": 675})
    inputs = {
        "script": palette.palette_script() + text_of("viewing/canvas.js"),
        "world": scene.world(),
        "frame": base64.b64encode(packed_frame(frame_of(model, PACKED_FROM), scene)).decode(),
        "travel": palette.LIGHT.travel,
        "drawn": [
            [True, 0.0, [0.0, 1.0]],
            [False, 1.5707963, [1.0, 1.0]],
            [True, 0.0, [0.0, 0.0]],
            [False, 0.0, [0.0, 1.0]],
        ],
    }
    left, turned, standing, wheeled = page.evaluate(DRAW, inputs)
    page.close()
    assert left == turned
    assert standing == wheeled
    assert left != standing
