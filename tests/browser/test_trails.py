"""Trails in a real browser: lines through the places of all steps, dots where steps are missing, none through walls."""

import numpy as np
import pytest

from mesa_swarm.recording import Recording
from mesa_swarm.viewing import palette, text_of
from mesa_swarm.viewing.canvas_widget import SPEEDS
from mesa_swarm.viewing.replay_page import replay_page
from mesa_swarm.viewing.trails import TRAIL_STEPS
from support.visits import blank_page
from support.waiting import comes_true
from support.walls import Circling, crosses

pytestmark = pytest.mark.slow

# Draws the trails of a stage, and nothing else that is switched, and returns their lines and dots in map units.
DRAWN = """(canvas, stage) => {
  const context = canvas.getContext("2d"), lines = [], dots = [], { arc } = Path2D.prototype, on = stage.toggles;
  const begins = {}, isTrail = () => context.lineJoin === "bevel";
  let path = [];
  for (const name of ["beginPath", "moveTo", "lineTo", "stroke"]) begins[name] = context[name].bind(context);
  context.beginPath = () => { path = []; begins.beginPath(); };
  context.moveTo = (x, y) => { path.push([[x, y]]); begins.moveTo(x, y); };
  context.lineTo = (x, y) => { path.at(-1).push([x, y]); begins.lineTo(x, y); };
  context.stroke = (...given) => { if (isTrail() && !given.length) lines.push(...path); begins.stroke(...given); };
  Path2D.prototype.arc = function (x, y, radius, ...more) {
    if (isTrail() && radius * stage.view.scale < 2.5) dots.push([x, y]);
    return arc.call(this, x, y, radius, ...more);
  };
  for (const name of Object.keys(on)) stage.set(name, false);
  lines.length = dots.length = 0;
  stage.set("trails", true);
  for (const name of Object.keys(begins)) delete context[name];
  Path2D.prototype.arc = arc;
  for (const name of Object.keys(on)) stage.set(name, on[name]);
  return { lines: lines.filter((line) => line.length > 1), dots };
}"""
WATCHED = "document.querySelector('.swarm-stage canvas')"
REPLAYED = f"({DRAWN})(document.getElementById('world'), mesaSwarmReplay.stage)"
# Draws the last of some frames of one robot, which have places (step, x, y) as their trail.
ALONE = """async ({ script, world, frames }) => {
  const { Stage } = await import(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
  const canvas = document.createElement("canvas");
  canvas.style.cssText = "position: fixed; inset: 0; width: 800px; height: 480px";
  document.body.replaceChildren(canvas);
  const stage = new Stage(canvas, world), counts = { robots: 1, sensors: 0, fires: 0, loads: 0, contacts: 0 };
  const shown = ({ step, place, trail }) => ({
    step, counts, ids: Int32Array.of(1), pose: Float32Array.of(...place, 0), design: Int8Array.of(0),
    trail: trail && { more: trail.more, points: trail.points.map(([step, x, y, moved]) => (
      { step, values: Float32Array.of(x, y), stride: 2, moved: moved ? new Set([0]) : null })) },
  });
  for (const frame of frames) frame.passed ? stage.pass(shown(frame)) : stage.show(shown(frame));
  return { ...(DRAWN)(canvas, stage), legend: stage.legend().map(({ form }) => form) };
}""".replace("(DRAWN)", f"({DRAWN})")
# Notes the trails of all frames that the page is sent from now on: whether each goes on, and its steps.
NOTED = f"""(() => {{
  const {{ stage }} = {WATCHED}, show = stage.show.bind(stage), pass = stage.pass.bind(stage);
  const stepsOf = ({{ points }}) => points.map(({{ step }}) => step);
  const note = ({{ trail }}) => trail?.points.length && trails.push([trail.more, stepsOf(trail)]);
  window.trails = [];
  stage.show = (frame) => {{ note(frame); show(frame); }};
  stage.pass = (frame) => {{ note(frame); pass(frame); }};
}})()"""
WORLD = {
    "model": "A", "map": "a", "bounds": [0, 0, 200, 120], "shapes": [], "loads": [], "layers": [], "reach": 1,
    "fastest": 1, "designs": [{"name": "a", "radius": 5, "max_speed": 1, "holonomic": False, "sensors": []}],
    "columns": [{"name": name, "table": "robots", "width": 1, "type": "f4"} for name in ("ids", "pose", "design")],
}  # fmt: skip


@pytest.fixture
def alone(chromium):
    """Draw frames of one robot, each (step, place, trail), and return what is drawn of the last."""
    page = blank_page(chromium, viewport={"width": 800, "height": 480})

    def draw(*frames) -> dict:
        named = [dict(zip(("step", "place", "trail", "passed"), frame, strict=False)) for frame in frames]
        return page.evaluate(ALONE, {"script": script(), "world": WORLD, "frames": named})

    yield draw
    page.close()


def script() -> str:

    return palette.palette_script() + text_of("viewing/canvas.js")


def points(*steps, at=10.0, moved=()) -> list:
    return [[step, at + step, 50.0, step in moved] for step in steps]


def test_a_trail_goes_on_from_the_frame_before_and_is_a_line_where_no_step_is_missing(alone):
    first = (3, [13, 50], {"more": False, "points": points(1, 2, 3)})
    found = alone(first, (26, [36, 50], {"more": True, "points": points(*range(4, 27))}))
    assert found["dots"] == []
    ((begin, *_, end),) = found["lines"]
    assert (begin, end) == ([11, 50], [36, 50])
    assert "trail" in found["legend"]
    assert "places" not in found["legend"]


def test_a_frame_that_is_left_out_leaves_its_part_of_the_trail(alone):
    frames = [(step, [10 + step, 50], {"more": step > 1, "points": points(step)}, step == 2) for step in range(1, 21)]
    found = alone(*frames)
    assert (len(found["lines"]), found["dots"]) == (1, [])


def test_places_between_which_steps_are_missing_are_dots_and_the_legend_explains_them(alone):
    found = alone((40, [50, 50], {"more": False, "points": points(10, 20, 30)}))
    assert found["lines"] == []
    assert {tuple(dot) for dot in found["dots"]} == {(20, 50), (30, 50), (40, 50), (50, 50)}
    assert "places" in found["legend"]
    assert "trail" not in found["legend"]


def test_a_robot_that_was_put_elsewhere_leaves_nothing_between(alone):
    by_hand = alone((30, [40, 50], {"more": False, "points": points(*range(1, 31), moved=[13])}))
    assert [(line[0], line[-1]) for line in by_hand["lines"]] == [([11, 50], [22, 50]), ([23, 50], [40, 50])]
    far = alone((4, [114, 50], {"more": False, "points": [*points(1, 2), *points(3, 4, at=110)]}))
    assert [(line[0], line[-1]) for line in far["lines"]] == [([11, 50], [12, 50]), ([113, 50], [114, 50])]
    sparse = alone((30, [190, 50], {"more": False, "points": points(10, 20)}))
    assert {tuple(dot) for dot in sparse["dots"]} == {(20, 50), (30, 50)}


def test_a_frame_without_a_trail_and_one_of_other_robots_begin_anew(alone):
    before = (3, [13, 50], {"more": False, "points": points(1, 2, 3)})
    assert alone(before, (4, [14, 50], None))["lines"] == []
    assert alone(before, (90, [60, 50], {"more": False, "points": points(90)}))["lines"] == []


def test_trails_are_no_longer_than_a_hundred_steps(alone):
    found = alone((150, [160, 50], {"more": False, "points": points(*range(1, 151))}))
    assert found["lines"][0][0] == [60, 50]


def settled(visitor):
    visitor.wait("player.playing === 'false' && player.rest === 'true'")


def test_at_any_speed_the_page_shows_the_way_of_all_steps_and_asks_for_nothing_while_trails_are_off(visit):
    visitor = visit("?model=boids&n_robots=12")
    page = visitor.page
    page.get_by_role("slider", name="Speed").fill(str(SPEEDS.index(1000.0)))
    page.evaluate(NOTED)
    visitor.press("Play")
    visitor.wait("player.step > 300")
    visitor.press("Pause")
    settled(visitor)
    found = page.evaluate(f"({DRAWN})({WATCHED}, {WATCHED}.stage)")
    trails, last = page.evaluate("trails"), -1
    assert len(trails) < visitor.step, "there are fewer pictures than steps"
    for more, steps in trails:  # it begins anew where there are as many steps between two pictures as a trail has
        whole = len(steps) > TRAIL_STEPS and steps[0] == last + 1
        assert (steps[0] == last + 1) if more else (last < 0 or steps[0] > last + 1 or whole)
        last = steps[-1]
        assert steps == list(range(steps[0], last + 1))
    assert last == visitor.step
    assert (len(found["lines"]), found["dots"]) == (12, [])
    for line in found["lines"]:
        assert np.hypot(*np.diff(np.array(line), axis=0).T).max() < 10, "of a robot of radius 5"
    page.locator(".swarm-tools summary").click()
    page.get_by_label("Trails", exact=True).uncheck()
    last = visitor.step
    visitor.press("Step")
    visitor.wait_for_step(last + 1)
    assert page.evaluate(f"{WATCHED}.stage.frame.trail") is None
    page.evaluate("trails.length = 0")
    page.locator(".swarm-tools summary").click()
    page.get_by_label("Trails", exact=True).check()
    visitor.press("Step")
    visitor.wait_for_step(last + 2)
    assert page.evaluate("trails") == [[False, [last + 1, last + 2]]]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Pages of recordings of 500 steps around a wall, of every step and of every tenth."""
    folder = tmp_path_factory.mktemp("trails")
    for every in (1, 10):
        model = Circling(rng=1)
        with model.record(folder / f"{every}.arrow", every=every, rerun=False):
            model.run(500)
        page = replay_page(Recording(folder / f"{every}.arrow"))
        (folder / f"{every}.html").write_text(page, encoding="utf-8")
    return folder


def goes_to(page, row: int) -> dict:
    """Go to a row, and return what is drawn of its trails."""
    page.evaluate(f"mesaSwarmReplay.goTo({row})")
    assert comes_true(lambda: page.evaluate("mesaSwarmReplay.row") == row, 60, every=30, pause=page.wait_for_timeout)
    return page.evaluate(REPLAYED)


def test_a_page_of_a_recording_shows_the_way_of_all_steps_from_whichever_row_it_comes(chromium, recorded):
    page, rows = blank_page(chromium), Recording(recorded / "1.arrow")
    page.goto((recorded / "1.html").as_uri())
    page.wait_for_selector("html[data-ready]")
    # The second is far ahead, behind the beginning of a chunk; the last two go back.
    for row in (40, 260, 280, 499, 300, 299):
        found = goes_to(page, row)
        assert (len(found["lines"]), found["dots"], crosses(found["lines"])) == (3, [], False)
        for robot, line in enumerate(found["lines"]):
            ends = rows[max(0, row - 100)]["position"][robot], rows[row]["position"][robot]
            np.testing.assert_allclose([line[0], line[-1]], ends, atol=0.01)
    page.locator("#toggles [name=trails]").uncheck()
    assert comes_true(lambda: page.evaluate("mesaSwarmReplay.stage.frame.trail === undefined"), 60)
    page.locator("#toggles [name=trails]").check()
    assert comes_true(lambda: page.evaluate("Boolean(mesaSwarmReplay.stage.frame.trail)"), 60)
    page.close()


def test_a_page_of_a_recording_of_every_tenth_step_shows_dots(chromium, recorded):
    page = blank_page(chromium)
    page.goto((recorded / "10.html").as_uri())
    page.wait_for_selector("html[data-ready]")
    found = goes_to(page, 30)
    assert found["lines"] == []
    assert len(found["dots"]) == 3 * 10 * 2, "the two ends of each way that is not known"
    assert "where it was, way unknown" in page.locator("#colours").inner_text()
    page.close()
