"""The world is changed by mouse and by numbers; all of it can be undone, linked and saved."""

import pytest

from mesa_swarm.maps.map import Map
from support.waiting import wait_until

pytestmark = pytest.mark.slow

STAGE = "document.querySelector('.swarm-stage canvas').stage"
PICKED = f"""(i) => {{
  const frame = {STAGE}.frame; // none while a new world is entered
  return frame && [frame.ids[i], frame.pose[3 * i], frame.pose[3 * i + 1]];
}}"""


@pytest.fixture
def editing(visit):
    """A page of three robots on which the tools are out."""
    visitor = visit("?model=fire_fighting&n_robots=3")
    visitor.press("Step")
    visitor.wait_for_step(1)
    visitor.page.locator(".swarm-edit > summary").click()
    return visitor


def tool(visitor, name: str) -> None:
    visitor.page.locator(f".swarm-toolbox [data-tool={name}]").click()


def on_page(visitor, x: float, y: float) -> tuple[float, float]:
    """Return where a place of the map is on the page."""
    box = visitor.page.locator(".swarm-stage canvas").bounding_box()
    across, down = visitor.page.evaluate(f"([x, y]) => {STAGE}.toCanvas(x, y)", [x, y])
    return box["x"] + across, box["y"] + down


def drag(visitor, start, end) -> None:
    mouse = visitor.page.mouse
    mouse.move(*on_page(visitor, *start))
    mouse.down()
    mouse.move(*on_page(visitor, *((a + b) / 2 for a, b in zip(start, end, strict=True))))
    mouse.move(*on_page(visitor, *end), steps=3)
    mouse.up()


def robot(visitor, row: int = 0):
    return visitor.page.wait_for_function(PICKED, arg=row).json_value()


def count(visitor, what: str) -> int:
    return visitor.page.evaluate(f"{STAGE}.world.{what}.length")


def test_a_robot_is_dragged_and_put_back_by_undo(editing):
    number, x, y = robot(editing)
    tool(editing, "move")
    drag(editing, (x, y), (420, 60))
    wait_until(lambda: abs(robot(editing)[1] - 420) + abs(robot(editing)[2] - 60) < 4)
    assert robot(editing)[0] == number
    editing.page.wait_for_function(f"location.search.includes('move%2C{number}')")
    editing.page.keyboard.press("Control+z")
    wait_until(lambda: robot(editing)[1:] == [x, y])
    editing.page.wait_for_function("!location.search.includes('edits=')")


def test_walls_discs_bodies_fires_and_robots_are_added_by_mouse(editing):
    shapes, robots = count(editing, "shapes"), editing.page.evaluate(f"{STAGE}.frame?.counts.robots")
    tool(editing, "wall")
    drag(editing, (200, 480), (330, 540))
    wait_until(lambda: count(editing, "shapes") == shapes + 1)
    tool(editing, "obstacle")
    drag(editing, (150, 150), (170, 150))
    wait_until(lambda: count(editing, "shapes") == shapes + 2)
    tool(editing, "load")
    drag(editing, (560, 300), (570, 300))
    wait_until(lambda: count(editing, "loads") == 1)
    tool(editing, "fire")
    drag(editing, (250, 330), (262, 330))
    wait_until(lambda: editing.reading("Fires burning") == "8 of 8")
    tool(editing, "robot")
    editing.page.mouse.click(*on_page(editing, 420, 80))
    wait_until(lambda: editing.page.evaluate(f"{STAGE}.frame?.counts.robots") == robots + 1)
    editing.press("Step")
    editing.wait_for_step(2)


def test_a_fire_is_put_out_and_lit_by_clicks_and_what_is_clicked_is_removed(editing):
    x, y = editing.page.evaluate(f"[...{STAGE}.frame.fires.subarray(6, 8)]")
    tool(editing, "fire")
    for burning in ("6 of 7", "7 of 7"):
        editing.page.mouse.click(*on_page(editing, x, y))
        wait_until(lambda burning=burning: editing.reading("Fires burning") == burning)
    tool(editing, "erase")
    editing.page.mouse.click(*on_page(editing, x, y))
    wait_until(lambda: editing.reading("Fires burning") == "6 of 6")


def test_what_is_typed_is_placed_and_an_impossible_place_is_refused_in_one_line(editing):
    page = editing.page
    tool(editing, "robot")
    page.get_by_text("by numbers").click()
    form = page.locator(".swarm-place")
    for name, value in (("x", "-20"), ("y", "60"), ("heading", "90")):
        form.locator(f"input[name={name}]").fill(value)
    form.locator("input[name=heading]").press("Enter")
    wait_until(lambda: "border of the map" in page.locator(".swarm-edit .swarm-fault").inner_text())
    form.locator("input[name=x]").fill("420")
    form.get_by_role("button", name="Add").click()
    wait_until(lambda: editing.reading("Robots at fires").endswith("of 4"))
    page.locator(".swarm-edit .swarm-fault").wait_for(state="hidden")


def test_the_map_is_saved_with_what_was_drawn_and_can_be_used(editing, tmp_path):
    page = editing.page
    tool(editing, "wall")
    drag(editing, (200, 480), (330, 540))
    page.wait_for_function("location.search.includes('wall')")
    page.locator(".swarm-edit-more > summary").click()
    for kind in ("toml", "svg"):
        with page.expect_download() as download:
            page.get_by_role("button", name=f"Save map as {kind.upper()}").click()
        path = tmp_path / download.value.suggested_filename
        download.value.save_as(path)
        drawn = Map.load(path)
        assert (path.name, len(drawn.fires)) == (f"drawn.{kind}", 7)
        assert len(drawn.obstacles) == len(Map.load("openspace_fire").obstacles) + 1
    page.get_by_role("button", name="Use as map").click()
    wait_until(lambda: editing.field("map").locator("select").input_value() == "drawn")
    editing.wait_for_step(0)


def test_escape_ends_a_tool_and_the_mouse_selects_again(editing):
    tool(editing, "wall")
    editing.page.keyboard.press("Escape")
    number, x, y = robot(editing)
    editing.page.mouse.click(*on_page(editing, x, y))
    wait_until(lambda: editing.page.locator(".swarm-inspector h2").first.inner_text() == f"Robot {number}")
