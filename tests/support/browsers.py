"""A dashboard that is served, a browser, and pages that note what they ask for and complain of."""

import signal
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from mesa_swarm.models.fire_fighting import FireFighting
from support.visits import CHROMIUM, FLAGS, HOST, LAUNCH, Visit, answers, free_port
from support.waiting import wait_until


@pytest.fixture(scope="session")
def server():
    """A dashboard's process, and its address; one for all tests, since it starts slowly."""
    port = free_port()
    process = subprocess.Popen([sys.executable, "-c", LAUNCH, str(port)], stdout=subprocess.DEVNULL)
    try:
        wait_until(lambda: answers(port), 90)
        yield process, f"http://{HOST}:{port}/"
        process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0, "Ctrl-C is how one ends it: no error"
    finally:
        process.kill()


@pytest.fixture(scope="module")
def chromium():
    if not CHROMIUM.exists():
        pytest.skip(f"there is no {CHROMIUM} (Debian: apt install chromium)")
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is missing (pip install playwright)")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def visit(server, chromium):
    """Open pages of the dashboard; when the test ends, none may have complained or asked the outside."""
    opened = []

    def open_page(query: str = "", *, plays: bool = False, **looks) -> Visit:
        context = chromium.new_context(**({"viewport": {"width": 1366, "height": 768}} | looks))
        opened.append(Visit(context, server[1] + query, plays=plays))
        return opened[-1]

    yield open_page
    for one in opened:
        one.context.close()
        assert one.complaints == []
        assert {urlsplit(url).hostname for url in one.asked} <= {HOST}


def recorded_run(path, steps):
    """Record a run in which a fire goes out, and return the path."""
    model = FireFighting(strategy="A", initial_temperature=0.02, rng=4)
    with model.record(path):
        model.run(steps)
    return path


@pytest.fixture(scope="session")
def recorded_fires(tmp_path_factory):
    """A recording of 60 steps in which a fire goes out."""
    return recorded_run(tmp_path_factory.mktemp("recordings") / "fires.arrow", 60)


@pytest.fixture
def visitor(visit):
    return visit()


@pytest.fixture
def shots(request, tmp_path):
    """Return a folder for pictures that a person looks at."""
    folder = Path(request.config.getoption("--screenshots") or tmp_path)
    folder.mkdir(parents=True, exist_ok=True)
    return folder
