"""Pages of the dashboard in a real browser, as tests visit them."""

import json
import socket
import urllib.error
import urllib.request
from pathlib import Path

from mesa_swarm.viewing.canvas_widget import SPEEDS
from support.waiting import PATIENCE

HOST = "127.0.0.1"
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
TABS = ("Models", "Watch", "Compare", "Experiment", "Replay")
LAUNCH = "import sys; from mesa_swarm.dashboard import launch; launch(port=int(sys.argv[1]), open_browser=False)"


def free_port() -> int:
    with socket.socket() as free:
        free.bind((HOST, 0))
        return free.getsockname()[1]


def answers(port: int) -> bool:
    try:
        with urllib.request.urlopen(f"http://{HOST}:{port}/readyz", timeout=1):
            return True
    except urllib.error.HTTPError:  # a visitor without a token is answered as well
        return True
    except OSError:
        return False


def blank_page(place, **looks):
    """Return a page of a browser, or of a context, that waits as patiently as all tests do."""
    page = place.new_page(**looks)
    page.set_default_timeout(PATIENCE * 1000)
    return page


def settle(page) -> None:
    """Return when the page has measured and drawn itself anew: after its second frame from now on."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def complete(page) -> None:
    """Return when all parts of the page have come, and none has changed for 0.1 s: those around the canvas come last.

    A widget that is closed before it was drawn leaves an error on the console.
    """
    page.evaluate(
        """new Promise((done) => {
          let waiting;
          const again = () => { clearTimeout(waiting); waiting = setTimeout(check, 100); };
          const check = () => document.querySelector("div[style='height: 100%;']:empty") ? again() : done();
          new MutationObserver(again).observe(document, { subtree: true, childList: true });
          again();
        })"""
    )


def resize(page, width: int, height: int) -> None:
    """Give the page a window of this size, and return when all on it has found its place."""
    page.set_viewport_size({"width": width, "height": height})
    page.wait_for_function(f"innerWidth === {width} && innerHeight === {height}")
    settle(page)


def add_chart(page, kind: str, what: str, against: str = "") -> None:
    """Add a chart beside the canvas."""
    page.locator(".swarm-choice summary").click()
    page.get_by_label("Kind of chart").select_option(kind)
    if against:
        page.get_by_label("Against, on the x axis").select_option(against)
    page.get_by_label("What the chart shows").select_option(what)
    page.get_by_role("button", name="Add", exact=True).click()


def quiet(address: str) -> str:
    """Return an address whose page is at rest and shows no tour when it opens."""
    return f"{address}{'&' if '?' in address else '?'}play=no&tour=no"


class Visit:
    """One user's page; it is at rest when it opens, unless `plays`."""

    def __init__(self, context, address: str, *, plays: bool = False) -> None:
        self.context, self.page = context, blank_page(context)
        self.asked: list[str] = []
        self.complaints: list[str] = []
        page = self.page
        page.on("request", lambda request: self._note(request.url))
        page.on("websocket", lambda connection: self._note(connection.url))
        page.on("console", lambda message: message.type == "error" and self.complaints.append(message.text))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.goto(address if plays else quiet(address))
        page.wait_for_selector(".swarm-player[data-drawn]")
        if not plays:
            complete(page)

    def _note(self, url: str) -> None:
        if not url.startswith(("data:", "blob:")):
            self.asked.append(url)

    def about(self, name: str) -> str:
        """Return what the player shows of its state: step, drawn, playing, rest, fingerprint."""
        return self.page.locator(".swarm-player").get_attribute(f"data-{name}")

    @property
    def step(self) -> int:
        return int(self.about("step"))

    def wait(self, expression: str) -> None:
        """Wait until a condition on `player`, the player's data, holds in the page."""
        player = "document.querySelector('.swarm-player')?.dataset"
        self.page.wait_for_function(f"(() => {{ const player = {player}; return player && ({expression}); }})()")

    def wait_for_step(self, step: int) -> None:
        """Wait until this step is shown at rest."""
        self.wait(f"player.step === '{step}' && player.rest === 'true'")

    def press(self, label: str) -> None:
        """Press a button; of a tab, return when it is open."""
        self.page.get_by_role("button", name=label, exact=True).click()
        if label in TABS:
            self.page.locator(".swarm-header button[aria-current]").filter(has_text=label).wait_for()

    def play_slowly(self) -> None:
        """Let steps come so slowly that what a busy machine does late is still early in the run: five a second."""
        self.page.get_by_role("slider", name="Speed").fill(str(SPEEDS.index(5.0)))

    def field(self, name: str):
        return self.page.locator(f".swarm-field[data-name={json.dumps(name)}]")

    def open_group(self, title: str) -> None:
        group = self.page.locator(f"details[data-title={json.dumps(title)}]")
        if group.get_attribute("open") is None:
            group.locator("summary").click()

    def reading(self, name: str) -> str:
        row = self.page.locator(".swarm-readings div").filter(has=self.page.locator("dt", has_text=name))
        return row.locator("dd").first.inner_text()

    def image(self) -> str:
        """Return what is drawn, as text."""
        return self.page.evaluate("document.querySelector('.swarm-stage canvas').toDataURL()")
