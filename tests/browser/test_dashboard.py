"""The dashboard in a real browser: it plays, nothing leaves the machine, and nothing is wrong in the console."""

import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from mesa_swarm.dashboard import HOST

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
LAUNCH = "import sys; from mesa_swarm.dashboard import launch; launch(port=int(sys.argv[1]), open_browser=False)"

pytestmark = pytest.mark.skipif(not CHROMIUM.exists(), reason=f"there is no {CHROMIUM} (Debian: apt install chromium)")
sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is missing (pip install playwright)")


@pytest.fixture(scope="module")
def server():
    with socket.socket() as free:
        free.bind((HOST, 0))
        port = free.getsockname()[1]
    process = subprocess.Popen([sys.executable, "-c", LAUNCH, str(port)], stdout=subprocess.DEVNULL)
    try:
        wait_until(lambda: answers(port), 60)
        yield process, f"http://{HOST}:{port}/"
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0, "Ctrl-C is how one ends it: no error"
    finally:
        process.kill()


@pytest.fixture(scope="module")
def chromium(tmp_path_factory):
    folder = tmp_path_factory.mktemp("profile")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch_persistent_context(
            folder, executable_path=CHROMIUM, args=FLAGS, viewport={"width": 1366, "height": 768}
        )
        browser.set_default_timeout(30_000)
        yield browser
        browser.close()


@pytest.fixture
def page(server, chromium):
    """A page that has drawn its world, and notes what it asks for and complains of."""
    page = chromium.new_page()
    page.requests, page.complaints = [], []
    page.on("request", lambda request: page.requests.append(request.url))
    page.on("websocket", lambda connection: page.requests.append(connection.url))
    page.on("console", lambda message: message.type == "error" and page.complaints.append(message.text))
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.goto(server[1])
    page.wait_for_selector(".swarm-world svg")
    yield page
    page.close()


def answers(port: int) -> bool:
    try:
        with urllib.request.urlopen(f"http://{HOST}:{port}/readyz", timeout=1):
            return True
    except OSError:
        return False


def wait_until(condition, seconds: float = 20.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.1)


def click(page, label: str) -> None:
    page.get_by_role("button", name=label, exact=True).click()


def step(page) -> int:
    return int(page.locator(".swarm-reading b").first.inner_text().replace(",", ""))


def rests(page) -> bool:
    before = step(page)
    page.wait_for_timeout(400)
    return step(page) == before


def seconds_of_processor(process) -> float:
    ticks = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")")[-1].split()[11:13]
    return sum(map(int, ticks)) / 100


def test_it_plays_pauses_steps_and_resets_without_a_word_to_the_outside(page):
    click(page, "Play")
    wait_until(lambda: step(page) > 20)
    click(page, "Pause")
    wait_until(lambda: rests(page))
    before = step(page)
    click(page, "Step")
    wait_until(lambda: step(page) == before + 1)
    click(page, "Reset")
    wait_until(lambda: step(page) == 0)
    assert {urlsplit(url).hostname for url in page.requests if not url.startswith(("data:", "blob:"))} == {HOST}
    assert page.complaints == []


def test_everything_is_in_sight_on_a_small_laptop(page):
    for selector in (".swarm-world svg", ".swarm-buttons", ".swarm-bar"):
        box = page.locator(selector).bounding_box()
        assert box["x"] >= 0
        assert box["y"] >= 0
        assert box["x"] + box["width"] <= 1366
        assert box["y"] + box["height"] <= 768
    assert page.locator(".swarm-world svg").bounding_box()["height"] > 600
    assert page.evaluate("document.documentElement.scrollHeight <= innerHeight")


def test_a_slider_changes_the_run_and_the_page_says_what_is_impossible(page):
    name = page.locator(".swarm-name span").filter(has_text="join")
    slider = name.locator("xpath=following::*[@role='slider'][1]")
    slider.press("End")
    wait_until(lambda: name.inner_text() == "join 999")
    assert "expected join below leave" in page.locator(".v-alert").inner_text()
    slider.press("Home")
    wait_until(lambda: name.inner_text() == "join 0")
    wait_until(lambda: page.locator(".v-alert").count() == 0)


def test_two_pages_do_not_share_a_model(page, chromium, server):
    other = chromium.new_page()
    other.goto(server[1])
    other.wait_for_selector(".swarm-world svg")
    click(page, "Step")
    wait_until(lambda: step(page) == 1)
    assert step(other) == 0
    other.close()


def test_walls_that_overlap_stay_filled(page):
    assert page.evaluate(
        "(() => { const wall = document.querySelector('.obstacle'), point = wall.ownerSVGElement.createSVGPoint();"
        "point.x = point.y = 10; return wall.isPointInFill(point); })()"
    )


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processor time is read from /proc, which is missing")
def test_a_page_that_is_closed_plays_no_more(page, server):
    click(page, "Play")
    wait_until(lambda: step(page) > 20)
    page.close()

    def is_idle() -> bool:
        before = seconds_of_processor(server[0])
        time.sleep(0.5)
        return seconds_of_processor(server[0]) - before < 0.05

    wait_until(is_idle)
