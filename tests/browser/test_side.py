"""What stands beside the canvas, in a real browser: charts, the inspector, export."""

import base64

import pytest
from PIL import Image

from mesa_swarm.models.boids import Boids
from mesa_swarm.recording import Recording
from mesa_swarm.viewing.scene import scene_of
from support.visits import add_chart, settle
from support.waiting import wait_until

pytestmark = pytest.mark.long

LISTEN = """(() => {
    const send = WebSocket.prototype.send;
    window.sent = [];
    WebSocket.prototype.send = function (data) { window.sent.push(String(data)); send.call(this, data); };
})()"""
ASKED = """window.sent.filter((data) => data.includes('"do":"export"')).length"""
# What of the export panel is shown but not wholly within the side of the page.
CUT_OFF = """(() => {
    const side = document.querySelector(".swarm-side").getBoundingClientRect();
    const panel = document.querySelector(".swarm-export"), cut = [];
    for (const part of panel.querySelectorAll("h2, button, select, label, p, progress, .swarm-busy")) {
        const box = part.getBoundingClientRect();
        const wide = part.tagName !== "SELECT" && part.scrollWidth > part.clientWidth + 1 && part.clientWidth > 0;
        const within = box.left >= side.left && box.right <= side.right && box.bottom <= side.bottom;
        if (box.width && (!within || wide)) cut.push(part.textContent);
    }
    if (panel.scrollLeft || panel.scrollTop) cut.push("scrolled");
    return cut;
})()"""
DRAWN = "document.querySelector('.swarm-charts').dataset.drawn"


def downloaded(visitor, label: str, path):
    with visitor.page.expect_download() as download:
        visitor.press(label)
    download.value.save_as(path / download.value.suggested_filename)
    return path / download.value.suggested_filename


def on_canvas(canvas, bounds, place) -> dict[str, float]:
    """Return where on the canvas a place of the map is."""
    (left, top, right, bottom), (x0, y0, x1, y1) = canvas.evaluate("canvas => canvas.arena()"), bounds
    along, up = (place[0] - x0) / (x1 - x0), (place[1] - y0) / (y1 - y0)
    return {"x": left + along * (right - left), "y": bottom + up * (top - bottom)}


def points(visitor) -> int:
    return int(visitor.page.locator(".swarm-chart").first.get_attribute("data-points"))


def test_charts_grow_while_it_plays_are_cleared_by_a_reset_and_downloaded(visitor, tmp_path):
    page = visitor.page
    assert page.locator(".swarm-chart").count() == 3
    visitor.play_slowly()  # a curve has a point for each of its first 256 steps
    visitor.press("Play")
    visitor.wait("+player.step > 5")
    before = int(page.evaluate(DRAWN))
    wait_until(lambda: int(page.evaluate(DRAWN)) >= before + 6)
    visitor.press("Pause")
    visitor.wait("player.playing === 'false' && player.fingerprint !== ''")
    wait_until(lambda: points(visitor) == visitor.step)
    table = downloaded(visitor, "Download Layers that drive as CSV", tmp_path).read_text().splitlines()
    assert table[0] == "step,Avoid (% of robots),FightFire (% of robots),Explore (% of robots),no layer (% of robots)"
    assert len(table) == visitor.step + 1
    picture = downloaded(visitor, "Download Layers that drive as PNG", tmp_path)
    assert picture.read_bytes().startswith(b"\x89PNG")
    visitor.press("Reset")
    wait_until(lambda: points(visitor) == 0)


def test_charts_are_chosen_and_stay_chosen(visitor):
    page = visitor.page
    add_chart(page, "over time", "fire_temperature")
    visitor.press("Remove Collisions in a step")
    titles = page.locator(".swarm-chart figcaption span")
    wait_until(lambda: "Temperature of each fire" in titles.all_inner_texts())
    visitor.press("Models")
    visitor.press("Watch")
    # Two looks would see two states: charts come and go while the page is built again.
    wait_until(lambda: titles.all_inner_texts()[2:] == ["Temperature of each fire"])


def test_a_robot_is_looked_into_and_moved(visitor):
    page = visitor.page
    visitor.press("Next robot")
    heading = page.locator(".swarm-inspector h2")
    wait_until(lambda: heading.inner_text().startswith("Robot "))
    visitor.press("Step")
    visitor.wait_for_step(1)
    wait_until(lambda: "in step 1" in page.locator(".swarm-inspector .swarm-hint >> visible=true").inner_text())
    assert page.locator(".swarm-diagram polygon.range").count() == 9
    assert page.locator(".swarm-why b").inner_text() in ("Avoid", "FightFire", "Explore")
    before = visitor.about("fingerprint")
    fields = {name: page.get_by_label(name, exact=True) for name in ("x", "y")}
    fields["x"].fill("2")
    visitor.press("Move")
    fault = page.locator(".swarm-inspector .swarm-fault")
    wait_until(lambda: "would overlap an obstacle" in fault.inner_text())
    fields["x"].fill("300")
    fields["y"].fill("420")
    visitor.press("Move")
    visitor.page.wait_for_function(f"document.querySelector('.swarm-player').dataset.fingerprint !== '{before}'")
    fault.wait_for(state="hidden")
    page.wait_for_function("location.search.includes('move%2C')")
    visitor.press("Step")
    visitor.wait_for_step(2)


def test_a_click_on_the_canvas_selects_a_robot_for_the_inspector(visit):
    visitor = visit("?model=boids&n_robots=20&seed=1")
    heading, canvas = (visitor.page.locator(f".swarm-{part}") for part in ("inspector h2", "stage canvas"))
    model = Boids(n_robots=20, rng=1)
    bounds = scene_of(model).world()["bounds"]
    assert heading.inner_text() == "Robot"
    for robot in model.robots[:3]:
        canvas.click(position=on_canvas(canvas, bounds, robot.position))
        wait_until(lambda robot=robot: heading.inner_text() == f"Robot {robot.unique_id}")


def test_a_run_is_recorded_and_exported(visitor, tmp_path):
    page = visitor.page
    for step in (1, 2):
        visitor.press("Step")
        visitor.wait_for_step(step)
    visitor.press("Record")
    page.get_by_role("button", name="Stop recording").wait_for()
    visitor.press("Step")
    visitor.wait_for_step(3)
    assert downloaded(visitor, "Export", tmp_path).name == "fire_fighting_3.png"
    page.get_by_label("Kind of file").select_option("arrow")
    source = page.get_by_label("Source of steps")
    assert Recording(downloaded(visitor, "Export", tmp_path)).steps.tolist() == [1, 2, 3]
    source.select_option("recording")
    assert Recording(downloaded(visitor, "Export", tmp_path)).steps.tolist() == [3]
    visitor.press("Models")
    visitor.press("Watch")
    page.get_by_role("button", name="Stop recording").wait_for()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_all_of_the_export_panel_is_in_sight_and_stays_there(visit, theme):
    page = visit("?model=fire_fighting&step=3", color_scheme=theme).page
    start = page.get_by_role("button", name="Export", exact=True)
    for kind in ("png", "mp4"):
        page.get_by_label("Kind of file").select_option(kind)
        page.locator(".swarm-side").evaluate("side => side.scrollTop = side.scrollHeight")
        assert page.evaluate(CUT_OFF) == []
    start.focus()
    assert page.evaluate(CUT_OFF) == []
    page.get_by_label("Source of steps").evaluate("list => list.append(new Option('gone', 'gone'))")
    page.get_by_label("Source of steps").select_option("gone")
    start.click()
    fault = page.locator(".swarm-export .swarm-fault")
    fault.wait_for()
    settle(page)
    assert fault.inner_text()
    assert page.evaluate(CUT_OFF) == [], "what went wrong is in sight without scrolling"


def test_titles_of_charts_are_whole_and_every_curve_has_a_name(visitor):
    page = visitor.page
    visitor.press("Step")
    visitor.wait_for_step(1)
    wait_until(lambda: page.locator(".swarm-chart li").count() > 4)
    titles = page.locator(".swarm-chart figcaption span")
    assert titles.count() == 3
    assert titles.evaluate_all("all => all.filter((one) => one.scrollWidth > one.clientWidth)") == []
    assert all(page.locator(".swarm-chart li span").all_inner_texts())


def test_what_is_on_screen_is_saved_as_it_is_without_asking_the_server(visit, tmp_path):
    visitor = visit("?model=fire_fighting&step=30", device_scale_factor=2)
    page, whole = visitor.page, visitor.image()
    visitor.press("Zoom in")
    page.locator(".swarm-tools summary").click()
    page.get_by_label("Sensor sectors").uncheck()
    seen = visitor.image()
    page.get_by_label("Kind of file").select_option(label="Picture as on screen (PNG)")
    page.evaluate(LISTEN)
    file = downloaded(visitor, "Export", tmp_path)
    assert page.evaluate(ASKED) == 0
    assert file.name == "fire_fighting_30_screen.png"
    assert file.read_bytes() == base64.b64decode(seen.partition(",")[2]) != base64.b64decode(whole.partition(",")[2])
    box = page.locator(".swarm-stage canvas").bounding_box()
    with Image.open(file) as picture:
        assert picture.size == tuple(pytest.approx(2 * box[side], abs=6) for side in ("width", "height"))
    page.get_by_label("Kind of file").select_option("png")
    assert downloaded(visitor, "Export", tmp_path).name == "fire_fighting_30.png"
    assert page.evaluate(ASKED) == 1


def test_everything_beside_the_canvas_is_looked_at(visit, shots):
    for theme in ("light", "dark"):
        visitor = visit("?model=fire_fighting&step=400", color_scheme=theme)
        visitor.press("Next robot")
        visitor.page.wait_for_selector(".swarm-diagram svg")
        settle(visitor.page)
        visitor.page.screenshot(path=shots / f"side_{theme}.png")
        assert visitor.page.locator(".swarm-diagram svg").is_visible()
        assert visitor.page.locator(".swarm-chart").count() > 0
