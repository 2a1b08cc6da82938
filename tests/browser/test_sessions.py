"""Many users: none sees another, what they leave is let go, and who may not come in stays out. Slow: own servers."""

import os
import random
import re
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from mesa_swarm.dashboard.page.session import Session
from support.visits import HOST, LAUNCH, Visit, answers, blank_page, free_port
from support.waiting import wait_until

pytestmark = pytest.mark.slow

TOKEN = "a token of this test"
GUARDED = LAUNCH.replace("open_browser=False", "open_browser=False, host='0.0.0.0'")
# Boids that break in their third step, places for two pages, and no long wait for a page that is gone without a word.
BREAKING = """
import sys
from mesa_swarm.dashboard import launch
from mesa_swarm.dashboard.app import PLACES, settings
settings.kernel.cull_timeout = "10s"
from mesa_swarm.models.boids import Boids
step, PLACES.most = Boids.step, 2
def breaking(self):
    if self.steps == 2:
        raise ZeroDivisionError("nothing left to share")
    step(self)
Boids.step = breaking
launch("boids", port=int(sys.argv[1]), open_browser=False)
"""


@contextmanager
def served(code: str, **environment: str):
    """Serve a dashboard of its own; give its process and address."""
    port = free_port()
    command = [sys.executable, "-c", code, str(port)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, env={**os.environ, **environment})
    try:
        wait_until(lambda: answers(port))
        yield process, f"http://{HOST}:{port}/"
    finally:
        process.kill()
        process.wait()


class Twin:
    """A page, and a session without a page to which the same is done."""

    def __init__(self, visitor: Visit, seed: int) -> None:
        self.visitor, self.session, self.draw = visitor, Session("fire_fighting"), random.Random(seed)

    def act(self) -> None:
        """Do something at random to both."""
        getattr(self, self.draw.choice(("step", "step", "step", "back", "reset", "seed", "robots", "k1")))()

    def step(self) -> None:
        self.visitor.press("Step")
        self.session.step()

    def back(self) -> None:
        if self.session.past.index > 0:
            self.visitor.press("Step back")
            self.session.back()

    def reset(self) -> None:
        self.visitor.page.get_by_role("button", name=re.compile("^(Reset|Apply)$")).click()
        self.session.reset()

    def seed(self) -> None:
        self._type("seed", str(self.draw.randrange(1000)))

    def robots(self) -> None:
        self._type("n_robots", str(self.draw.randint(1, 30)))

    def k1(self) -> None:
        self.visitor.open_group("Fires and heat")
        self._type("k1", f"{self.draw.uniform(0.0001, 0.003):.6f}")

    def _type(self, name: str, text: str) -> None:
        field = self.visitor.field(name).locator("input[type=text]")
        field.fill(text)
        field.press("Enter")
        if name == "seed":
            self.session.set_seed(text)
        else:
            self.session.set_parameter(name, text)

    def agree(self) -> None:
        """Wait until the page shows what the session shows."""
        shown = self.session.past.shown
        self.visitor.wait(f"player.step === '{shown.step}' && player.fingerprint === '{shown.fingerprint}'")


def test_two_pages_never_see_each_other_in_two_hundred_random_actions(visit):
    twins = [Twin(visit(), seed) for seed in (1, 2)]
    order = random.Random(3)
    for _ in range(200):
        order.choice(twins).act()
        for twin in twins:
            twin.agree()
    first, second = (twin.session.past.shown for twin in twins)
    assert first.fingerprint != second.fingerprint


def kilobytes(process) -> int:
    status = Path(f"/proc/{process.pid}/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0])


def visited(chromium, address: str) -> None:
    context = chromium.new_context()
    visitor = Visit(context, address)
    visitor.press("Play")
    visitor.wait("+player.step > 30")
    visitor.page.close()
    context.close()


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc, which is missing")
def test_memory_after_twenty_pages_is_as_it_was(chromium):
    with served(LAUNCH) as (process, address):
        for _ in range(3):
            visited(chromium, address)
        time.sleep(1)
        before = kilobytes(process)
        for _ in range(20):
            visited(chromium, address)
        wait_until(lambda: kilobytes(process) < 1.2 * before, 90)
        print(f"memory: {before / 1000:.0f} MB after 3 pages, {kilobytes(process) / 1000:.0f} MB after 23")


def test_a_model_that_breaks_shows_a_card_and_a_third_page_that_there_is_no_place(chromium):
    with served(BREAKING) as (_, address):
        first, second = (Visit(chromium.new_context(), address) for _ in range(2))
        third = blank_page(chromium)
        third.goto(address)
        assert "2 pages of this dashboard are open" in third.get_by_role("alert").inner_text()
        first.press("Play")
        card = first.page.locator(".swarm-trouble")
        assert "ZeroDivisionError: nothing left to share" in card.inner_text()
        card.get_by_role("button").click()
        card.wait_for(state="detached")
        first.wait_for_step(0)
        first.press("Step")
        first.wait_for_step(1)
        second.page.goto("about:blank")
        wait_until(lambda: has_place(third))
        assert first.complaints == second.complaints == []


def has_place(page) -> bool:
    page.reload()
    page.wait_for_selector(".swarm-trouble, .swarm-player")
    return page.locator(".swarm-player").count() == 1


def test_who_listens_to_others_asks_for_a_token(chromium):
    with served(GUARDED, MESA_SWARM_TOKEN=TOKEN) as (_, address):
        page = blank_page(chromium)
        assert page.goto(address).status == 403
        opened = page.evaluate(
            """address => new Promise((resolve) => {
              const connection = new WebSocket(address);
              connection.onopen = () => resolve(true);
              connection.onclose = () => resolve(false);
            })""",
            address.replace("http", "ws") + "_solara/api/watchdog/x",
        )
        assert not opened
        for path in ("static/../", "_solara/cdn/vue", "%2e%2e/", "readyz", "?token=wrong"):
            assert page.goto(address + path).status == 403
        page.get_by_label("Token").fill(TOKEN)
        page.get_by_role("button").click()
        page.wait_for_selector(".swarm-player[data-drawn]")
        assert "token" not in page.url
        page.context.close()
