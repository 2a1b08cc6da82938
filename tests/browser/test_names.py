"""Files of hostile names, listed, opened and uploaded in a real browser: names are text, and nothing of them runs."""

import signal
import subprocess
import sys

import pytest

from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from mesa_swarm.viewing.replay_page import replay_page
from support.names import HOSTILE_NAMES, IMAGE
from support.visits import HOST, LAUNCH, answers, blank_page, free_port
from support.waiting import wait_until

pytestmark = pytest.mark.long

HALL = b'<svg width="800" height="600"><circle cx="400" cy="300" r="80"/></svg>'
HARMED = "window.harmed === undefined && !document.querySelector('img[src=x], b img, svg[onload]')"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("recordings")
    model = FireFighting(n_robots=2, rng=4)
    with model.record(place / "run.arrow"):
        model.run(3)
    for name in (*HOSTILE_NAMES, "\udcff"):
        (place / f"{name.replace('/', '_')}.arrow").write_bytes((place / "run.arrow").read_bytes())
    return place


@pytest.fixture(scope="module")
def server(folder):
    port = free_port()
    launch = LAUNCH.replace("open_browser=False", f"open_browser=False, recordings={str(folder)!r}")
    process = subprocess.Popen([sys.executable, "-c", launch, str(port)], stdout=subprocess.DEVNULL)
    try:
        wait_until(lambda: answers(port), 90)
        yield process, f"http://{HOST}:{port}/"
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
    finally:
        process.kill()


def test_recordings_in_the_folder_are_listed_by_name_and_open(visit, folder):
    visitor = visit("?model=boids")
    visitor.press("Replay")
    items = visitor.page.locator(".swarm-list button")
    wait_until(lambda: items.count() == len(HOSTILE_NAMES) + 2)
    shown = visitor.page.evaluate("[...document.querySelectorAll('.swarm-list button')].map((one) => one.textContent)")
    for name in HOSTILE_NAMES:
        assert any(name.replace("/", "_") in text for text in shown)
    items.filter(has_text=IMAGE).click()
    visitor.page.wait_for_selector(".swarm-player[data-step]")
    assert visitor.page.evaluate(HARMED)


def test_a_map_of_a_hostile_name_is_an_option_and_stays_a_text(visit):
    visitor = visit("?model=boids")
    field = visitor.field("map")
    for name in (IMAGE, '"><script>window.harmed=1<script>', "a$\\frac{$b"):
        file = {"name": f"{name}.svg", "mimeType": "image/svg+xml", "buffer": HALL}
        visitor.page.set_input_files(".swarm-panel input[type=file]", file)
        wait_until(lambda name=name: field.locator("select").input_value() == name)
    visitor.wait_for_step(0)
    assert visitor.page.evaluate(HARMED)


def test_a_page_that_replays_runs_nothing_of_what_a_recording_is_called(chromium, folder, tmp_path):
    recording = Recording(folder / "run.arrow")
    recording.provenance["model"]["name"] = f"</script>{IMAGE}"
    recording.provenance["parameters"][IMAGE] = IMAGE
    path = tmp_path / "page.html"
    path.write_text(replay_page(recording), encoding="utf-8")
    page = blank_page(chromium)
    complaints = []
    page.on("console", lambda message: complaints.append(message.text))
    page.goto(path.as_uri())
    page.wait_for_function("window.mesaSwarmReplay")
    assert page.title() == f"</script>{IMAGE}: replay"
    assert page.evaluate(HARMED)
    assert complaints == []
    # What might become an element one day would be stopped by the page's policy.
    page.evaluate("document.body.insertAdjacentHTML('beforeend', '<img src=data:, onerror=window.harmed=1>')")
    page.wait_for_timeout(200)
    assert page.evaluate("window.harmed === undefined")
    assert any("Content Security Policy" in text for text in complaints)
    page.close()
