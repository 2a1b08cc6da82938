"""Recordings in a real browser: they play from disk and from the server, and what is drawn is what was recorded."""

import re
import signal
import subprocess
import sys
from base64 import b64encode
from dataclasses import replace
from urllib.parse import urlsplit

import numpy as np
import pytest

from mesa_swarm import AGENT9, Scale, all_round, disc
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.models.cooperative_transport import CooperativeTransport
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from mesa_swarm.recording.frames import Frame, frame_of
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing import palette, text_of
from mesa_swarm.viewing.frame_bytes import PACKED_FROM, packed_frame
from mesa_swarm.viewing.replay_page import replay_page
from mesa_swarm.viewing.scene import Scene, scene_of, scene_of_recording
from support.visits import blank_page, settle
from support.waiting import comes_true

pytestmark = pytest.mark.slow

STEPS = 600
# Draws, and returns how long it takes, milliseconds a drawing.
TWENTY_DRAWINGS = """(() => {
    const began = performance.now();
    for (let i = 0; i < 20; i++) stage.draw();
    document.getElementById("world").getContext("2d").getImageData(0, 0, 1, 1);
    return (performance.now() - began) / 20;
})()"""
# No machine is so slow that a page's own time gets there before the test, milliseconds.
LATER = 3_600_000
SECONDS = Scale(units_per_metre=1000, seconds_per_step=2.5)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "run.arrow"
    model = FireFighting(n_robots=20, strategy="A", rng=5)
    with model.record(path):
        model.run(STEPS)
    return path


@pytest.fixture(scope="module")
def html(recorded):
    path = recorded.with_suffix(".html")
    path.write_text(replay_page(Recording(recorded)), encoding="utf-8")
    return path


@pytest.fixture
def blank(chromium):
    """A page that notes what it asks for and complains of."""
    page = blank_page(chromium, viewport={"width": 1366, "height": 768})
    page.requests, page.complaints = [], []
    page.on("request", lambda request: page.requests.append(request.url))
    page.on("console", lambda message: message.type in ("error", "warning") and page.complaints.append(message.text))
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    yield page
    page.close()
    assert page.complaints == []
    assert {urlsplit(url).hostname or "" for url in page.requests} <= {"", "127.0.0.1"}


def opened(page, address):
    page.goto(address)
    page.wait_for_selector("html[data-ready]")
    return page


@pytest.fixture
def page(blank, html):
    yield opened(blank, html.as_uri())
    assert [url for url in blank.requests if not url.startswith(("file:", "data:", "blob:"))] == []


@pytest.fixture
def still(blank, html):
    """A page whose time passes only when a test lets it: how long a key takes to reach it does not matter."""
    blank.clock.install()
    opened(blank, html.as_uri())
    blank.clock.pause_at(blank.evaluate("Date.now()") + LATER)
    return blank


def until(page, condition: str, seconds: float = 60.0) -> None:
    """Wait; the page's own policy forbids what Playwright's waiting would do in it."""
    assert comes_true(lambda: page.evaluate(condition), seconds, every=30, pause=page.wait_for_timeout), condition


def step(page) -> int:
    return page.evaluate("mesaSwarmReplay.stage.frame.step")


def poses(page) -> np.ndarray:
    return np.array(page.evaluate("[...mesaSwarmReplay.stage.frame.pose]")).reshape(-1, 3)


def assert_shows(page, frame):
    drawn = poses(page)
    assert step(page) == frame.step
    np.testing.assert_allclose(drawn[:, :2], frame["position"], atol=800 / 65535)
    assert (np.abs(np.sin((drawn[:, 2] - frame["heading"]) / 2)) < 1e-4).all()
    columns = ("fires", 6), ("distance", frame["distance"].shape[1])
    fires, distance = (
        np.array(page.evaluate(f"[...mesaSwarmReplay.stage.frame.{name}]")).reshape(-1, width)
        for name, width in columns
    )
    np.testing.assert_allclose(fires[:, 3], frame["fires"]["temperature"], atol=0.5 / 255 + 1e-6)
    np.testing.assert_array_equal(fires[:, 5], frame["fires"]["out"])
    np.testing.assert_array_equal(distance < 0, frame["distance"] < 0)
    np.testing.assert_array_equal(page.evaluate("[...mesaSwarmReplay.stage.frame.layer]"), frame["layer"])


def press(page, *keys):
    for key in keys:
        page.keyboard.press(key)
    until(page, "mesaSwarmReplay.row === mesaSwarmReplay.wanted")


def test_it_plays_from_disk_to_the_end_and_stops(page):
    assert step(page) == 1
    page.get_by_role("button", name="Play", exact=True).click()
    until(page, "mesaSwarmReplay.stage.frame.step > 20")
    page.get_by_label("Speed").fill("31")
    until(page, f"mesaSwarmReplay.stage.frame.step === {STEPS}")
    page.get_by_role("button", name="Play", exact=True).wait_for()


def test_it_plays_thirty_steps_a_second_at_first(still):
    still.keyboard.press(" ")
    steps = []
    for _ in range(4):
        still.clock.run_for(2000)
        steps.append(step(still))
    assert np.diff(steps).tolist() == pytest.approx([60, 60, 60], abs=1)


def test_scrubbing_shows_the_robots_where_they_were(page, recorded):
    recording = Recording(recorded)
    for row in (0, 300, 255, 256, STEPS - 1, 17):
        page.get_by_label("Step", exact=True).fill(str(row))
        until(page, f"mesaSwarmReplay.stage.frame.step === {row + 1}")
        assert_shows(page, recording[row])


def test_keys_step_forth_and_back_and_to_the_ends(still, recorded):
    recording = Recording(recorded)
    press(still, "End", "ArrowLeft", "ArrowLeft")
    assert_shows(still, recording[STEPS - 3])
    press(still, "Home", "ArrowRight", "Shift+ArrowRight")
    assert_shows(still, recording[11])
    still.get_by_label("Speed").focus()
    press(still, "End", " ", " ")
    assert step(still) == 12, "End moves the slider that is touched, and what plays is paused"
    press(still, "n")
    assert step(still) == min(event.step for event in recording.events() if event.step > 12)


def test_keys_go_on_from_the_row_asked_for_though_it_is_not_at_hand_yet(page):
    asked = """
        for (const key of ["End", "ArrowLeft", "ArrowLeft"])
            document.body.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
        mesaSwarmReplay.wanted;
    """
    assert page.evaluate(asked) == STEPS - 3
    until(page, "mesaSwarmReplay.row === mesaSwarmReplay.wanted")
    assert step(page) == STEPS - 2


def test_events_are_listed_marked_and_jumped_to(page, recorded):
    events = [event.step for event in Recording(recorded).events()]
    assert page.locator("#events button").count() == page.locator("#marks i").count() == len(events) > 2
    later = sorted({at for at in events if at > 1})
    press(page, "n", "n")
    assert step(page) == later[1]
    press(page, "p")
    assert step(page) == later[0]
    page.locator("#events button").last.click()
    until(page, f"mesaSwarmReplay.stage.frame.step === {events[-1]}")


def test_switches_change_the_picture_and_every_control_has_a_name(page):
    press(page, "End")
    picture = "document.getElementById('world').toDataURL()"
    for box in page.get_by_role("checkbox").all():
        before, name = page.evaluate(picture), box.get_attribute("name")
        box.click()
        if name in ("sectors", "layers", "labels", "perceived"):
            assert page.evaluate(picture) != before, name
    nameless = page.evaluate(
        "[...document.querySelectorAll('button, input, summary')].filter(one => !one.getAttribute('aria-label') && "
        "!one.textContent.trim() && !one.closest('label')?.textContent.trim()).map(one => one.id)"
    )
    assert nameless == []


def test_a_robot_that_is_clicked_is_described_and_can_be_followed(page, recorded):
    x, y = page.evaluate("mesaSwarmReplay.stage.toCanvas(...mesaSwarmReplay.stage.frame.pose.subarray(6, 8))")
    page.locator("#world").click(position={"x": x, "y": y})
    assert page.locator("#robot-name").inner_text() == f"Robot {Recording(recorded)[0].robots[2]}"
    page.get_by_role("button", name="Follow").click()
    press(page, "End")
    drawn, box = poses(page)[2], page.locator("#world").bounding_box()
    where = page.evaluate(f"mesaSwarmReplay.stage.toCanvas({drawn[0]}, {drawn[1]})")
    np.testing.assert_allclose(where, [box["width"] / 2, box["height"] / 2], atol=0.6)


def test_wheel_and_drag_keep_what_is_under_the_pointer_there(page):
    box = page.locator("#world").bounding_box()
    at = "mesaSwarmReplay.stage.toCanvas(400, 300)"
    x, y = page.evaluate(at)
    page.mouse.move(box["x"] + x, box["y"] + y)
    page.mouse.wheel(0, -400)
    until(page, f"mesaSwarmReplay.stage.toCanvas(500, 300)[0] - {at}[0] > 110")
    np.testing.assert_allclose(page.evaluate(at), [x, y], atol=0.6)
    page.mouse.down()
    page.mouse.move(box["x"] + x + 60, box["y"] + y - 30, steps=4)
    page.mouse.up()
    np.testing.assert_allclose(page.evaluate(at), [x + 60, y - 30], atol=0.6)


@pytest.mark.parametrize("size", [(1366, 768), (1920, 1080), (1024, 768), (844, 390), (568, 320)])
def test_all_that_plays_is_in_sight(page, size):
    page.set_viewport_size(dict(zip(("width", "height"), size, strict=True)))
    settle(page)
    for selector in ("#world", "#first", "#play", "#scrub", "#speed", "#next", "#step"):
        box = page.locator(selector).bounding_box()
        assert box["x"] >= 0, selector
        assert box["y"] >= 0, selector
        assert box["x"] + box["width"] <= size[0], selector
        assert box["y"] + box["height"] <= size[1], selector
    assert page.locator("#speed").bounding_box()["width"] >= 50
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_light_and_dark_differ_and_follow_the_button(page):
    colour = "getComputedStyle(document.body).backgroundColor"
    light, pixel = page.evaluate(colour), page.evaluate("document.getElementById('world').toDataURL()")
    page.get_by_role("button", name="Dark").click()
    assert page.evaluate(colour) != light
    assert page.evaluate("document.getElementById('world').toDataURL()") != pixel


def test_the_command_serves_the_same_frames_and_ends_with_ctrl_c(blank, recorded):
    words = [sys.executable, "-m", "mesa_swarm", "replay", str(recorded), "--no-browser"]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        address = re.search(r"http://\S+", process.stdout.readline())[0]
        page = opened(blank, address)
        page.evaluate("mesaSwarmReplay.goTo(400)")
        until(page, "mesaSwarmReplay.stage.frame.step === 401")
        assert_shows(page, Recording(recorded).at(401))
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
    finally:
        process.kill()
        process.communicate()


def staged(page, world, frame: bytes):
    """Draw a packed frame on a stage of its own, as the dashboard does."""
    page.set_content('<canvas id="world" style="width:1000px;height:700px"></canvas>')
    code = (palette.palette_script() + text_of("viewing/canvas.js")).encode()
    page.evaluate(
        """async ([code, world, bytes]) => {
          const source = new Blob([new Uint8Array(code)], { type: "text/javascript" });
          const module = await import(URL.createObjectURL(source));
          window.stage = new module.Stage(document.getElementById("world"), world);
          window.module = module;
          window.frame = module.unpacked(world, Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0)));
          window.stage.show(window.frame);
        }""",
        [list(code), world, b64encode(frame).decode()],
    )


def test_bytes_of_a_live_model_are_drawn_as_they_are(blank):
    model = FireFighting(n_robots=12, rng=1).run(60)
    scene = scene_of(model)
    staged(blank, scene.world(), packed_frame(frame_of(model, PACKED_FROM), scene))
    pose = np.column_stack([model.swarm.position, model.swarm.heading]).astype(np.float32)
    np.testing.assert_array_equal(blank.evaluate("[...frame.pose]"), pose.ravel().astype(float))
    sensors, contacts = model.swarm.distance.shape[1], int(model.swarm.collided.sum())
    counts = {"robots": 12, "sensors": sensors, "fires": 7, "loads": 0, "contacts": contacts}
    assert blank.evaluate("frame.counts") == counts
    shifted = "new DataView(Uint8Array.from([0, ...new Uint8Array(frame.ids.buffer)]).buffer, 1)"
    assert blank.evaluate(f"[...module.unpacked(stage.world, {shifted}).pose]") == pose.ravel().astype(float).tolist()
    x, y = blank.evaluate("stage.toCanvas(frame.pose[0], frame.pose[1])")
    blank.locator("#world").click(position={"x": x, "y": y})
    assert blank.evaluate("stage.selected") == model.robots[0].unique_id
    blank.evaluate("stage.world = { ...stage.world, bounds: [0, 0, 100, 100] }")
    x, y = blank.evaluate("stage.toCanvas(50, 50)")
    assert (x, y) == (500, 350)


def test_a_load_is_drawn_where_it_was_pushed_to(blank, tmp_path):
    model = CooperativeTransport(n_robots=12, load="disc", resistance=0.5, rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(200)
    recording = Recording(tmp_path / "run.arrow")
    scene = scene_of_recording(recording)
    staged(blank, scene.world(), packed_frame(recording[-1], scene))
    x, y = model.load.position
    colour = blank.evaluate(
        f"(([x, y]) => [...stage_pixel(x, y)])(stage.toCanvas({x}, {y}))".replace(
            "stage_pixel(x, y)", "document.getElementById('world').getContext('2d').getImageData(x, y, 1, 1).data"
        )
    )
    assert colour[:3] == palette.rgb(palette.LIGHT.load).tolist()


@pytest.mark.parametrize(("robots", "most"), [(50, 5.0), (10_000, 40.0)])
def test_drawing_is_quick(blank, robots, most):
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(all_round(9, range=50.0), 1)
    scene = scene_of(model)
    measured, frame = [], crowd(frame_of(model, PACKED_FROM), scene, robots)
    for _ in range(8):  # of some of which something else had the processor; a canvas is read back once
        staged(blank, scene.world(), frame)
        measured.append(blank.evaluate(TWENTY_DRAWINGS))
    took = min(measured)
    print(f"{robots} robots: {took:.2f} ms a frame")
    assert took < most


def crowd(frame: Frame, scene: Scene, robots: int) -> bytes:
    """Return a packed frame of this number of robots all over the map, a third of whose sensors see something."""
    rng = np.random.default_rng(1)
    rows = {name: np.repeat(table, robots, axis=0) for name, table in frame.columns.items() if len(table) == 1}
    rows["position"] = rng.uniform([30, 30], [770, 570], (robots, 2))
    rows["heading"] = rng.uniform(-3, 3, robots)
    rows["distance"] = np.where(rng.random((robots, 9)) < 0.33, rng.uniform(0, 50, (robots, 9)), -1.0)
    rows["layer"] = rng.integers(0, 3, robots)
    return packed_frame(replace(frame, robots=np.arange(robots), columns=frame.columns | rows), scene)


def test_what_was_changed_while_it_was_recorded_is_drawn_from_then_on(blank, tmp_path):
    model = SwarmModel(map="openspace", rng=5)
    model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
    model.control = Subsumption(Avoid(), Explore())
    with model.record(tmp_path / "run.arrow"):
        model.run(5)
        model.add_obstacle(disc((400, 300), 40))
        model.add_robots(replace(AGENT9, name="wide", radius=20.0), poses=[(200, 480, 0.0)])
        model.control = Subsumption(Explore())
        model.run(5)
    (tmp_path / "run.html").write_text(replay_page(Recording(tmp_path / "run.arrow")), encoding="utf-8")
    page = opened(blank, (tmp_path / "run.html").as_uri())
    middle = "(([x, y]) => [...document.getElementById('world').getContext('2d').getImageData(x, y, 1, 1).data])"
    middle = f"{middle}(mesaSwarmReplay.stage.toCanvas(400, 300)).slice(0, 3)"
    layers = "[...document.querySelectorAll('#layers li')].length"
    shapes = "mesaSwarmReplay.stage.world.shapes.length"
    assert (page.evaluate(shapes), page.evaluate(layers)) == (len(model.obstacles) - 1, 2)
    page.evaluate("mesaSwarmReplay.goTo(9)")
    until(page, "mesaSwarmReplay.stage.frame.step === 10")
    assert page.evaluate(middle) == [0x64, 0x6B, 0x75]
    assert (page.evaluate(shapes), page.evaluate(layers)) == (len(model.obstacles), 1)
    assert page.evaluate("mesaSwarmReplay.stage.world.designs[mesaSwarmReplay.stage.frame.design[1]].radius") == 20
    page.evaluate("mesaSwarmReplay.goTo(2)")
    until(page, "mesaSwarmReplay.stage.frame.step === 3")
    assert page.evaluate(shapes) == len(model.obstacles) - 1


# What is written on the canvas, in the order of drawing.
WRITTEN = """const write = CanvasRenderingContext2D.prototype.fillText;
    window.written = [];
    CanvasRenderingContext2D.prototype.fillText = function (text, ...more) {
        written.push(text);
        return write.call(this, text, ...more);
    };"""


@pytest.mark.parametrize(
    ("scale", "step", "bar"), [(SECONDS, "4, 10 s", " cm"), (None, "4", " units")], ids=["scale", "none"]
)
def test_a_model_with_a_scale_has_its_time_and_a_bar_in_units_of_length(blank, tmp_path, scale, step, bar):
    model = SwarmModel(map="openspace", rng=1, scale=scale)
    model.add_robots(AGENT9, 3)
    with model.record(tmp_path / "run.arrow"):
        model.run(4)
    path = tmp_path / "run.html"
    path.write_text(replay_page(Recording(tmp_path / "run.arrow")), encoding="utf-8")
    blank.add_init_script(WRITTEN)
    blank.goto(path.as_uri())
    blank.keyboard.press("End")
    comes_true(lambda: blank.inner_text("#step") == step)
    assert any(text.endswith(bar) for text in blank.evaluate("written"))
