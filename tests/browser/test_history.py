"""Links, Back and Forward, a page that is loaded again, and a server that is gone."""

import signal
import subprocess
import sys

import pytest

from mesa_swarm.models.fire_fighting import FireFighting
from support.visits import HOST, LAUNCH, Visit, answers, free_port
from support.waiting import wait_until

pytestmark = pytest.mark.slow

LINK = "?model=fire_fighting&n_robots=4&seed=3"
SIDES = ".swarm-worlds .swarm-player"
HIDE = """hidden => {
  Object.defineProperty(document, "hidden", { value: hidden, configurable: true });
  document.dispatchEvent(new Event("visibilitychange"));
}"""


def tab_of(visitor) -> str:
    return " ".join(visitor.page.locator(".swarm-header button[aria-current]").all_inner_texts())


def choose(visitor, name: str) -> None:
    visitor.press("Models")
    visitor.page.locator(".swarm-card").filter(has_text=name.replace("_", " ").capitalize()).click()
    visitor.page.wait_for_function(f"location.search.startsWith('?model={name}')")


def addressed(visitor, *words: str) -> None:
    """Wait until the address has all of these words."""
    for word in words:
        visitor.page.wait_for_function("word => location.search.slice(1).split('&').includes(word)", arg=word)


def test_back_and_forward_walk_through_models_and_tabs(visit):
    visitor = visit(LINK)
    visitor.press("Step")
    visitor.wait_for_step(1)
    addressed(visitor, "step=1")
    choose(visitor, "boids")
    visitor.press("Compare")
    addressed(visitor, "tab=compare", "model=boids")
    page = visitor.page
    page.go_back()
    wait_until(lambda: tab_of(visitor) == "Watch")
    page.wait_for_selector(".swarm-header b:text('Boids')")
    page.go_back()
    wait_until(lambda: tab_of(visitor) == "Models")
    page.go_back()
    page.wait_for_selector(".swarm-header b:text('Fire fighting')")
    visitor.wait_for_step(1)
    assert visitor.about("fingerprint") == FireFighting(n_robots=4, rng=3).run(1).state_hash()
    page.go_forward()
    page.go_forward()
    page.wait_for_selector(".swarm-header b:text('Boids')")
    visitor.wait_for_step(0)
    page.go_forward()
    page.wait_for_selector(SIDES)
    wait_until(lambda: tab_of(visitor) == "Compare")


def test_settings_and_steps_are_no_steps_back(visit):
    visitor = visit(LINK)
    length = visitor.page.evaluate("history.length")
    visitor.press("Step")
    addressed(visitor, "step=1")
    visitor.field("n_robots").get_by_role("slider").press("ArrowRight")
    addressed(visitor, "n_robots=4", "edits=1%2Cset%2Cn_robots%2C5")
    assert visitor.page.evaluate("history.length") == length


def test_every_tab_has_a_link(visit):
    visitor = visit(
        f"{LINK}&tab=compare&compare.parameter=slip&compare.A=0.1&compare.B=0.2&compare.seeds=7&compare.steps=90"
    )
    visitor.page.wait_for_selector(f"{SIDES}[data-drawn]")
    assert visitor.field("seeds").locator("input[type=text]").input_value() == "7"
    assert visitor.page.locator(".swarm-caption").all_inner_texts()[-2:] == ["A: slip 0.1", "B: slip 0.2"]
    visitor.field("steps").locator("input").fill("80")
    visitor.field("steps").locator("input").press("Enter")
    addressed(visitor, "compare.steps=80", "tab=compare", "n_robots=4", "compare.A=0.1")
    visitor.press("Watch")
    visitor.wait_for_step(0)
    assert visitor.reading("Robots at fires").endswith("of 4")


def test_the_link_is_copied(visit):
    visitor = visit(LINK, permissions=["clipboard-read", "clipboard-write"])
    visitor.press("Link")
    visitor.page.get_by_role("button", name="Copied").wait_for()
    assert visitor.page.evaluate("navigator.clipboard.readText()") == visitor.page.url
    visitor.page.get_by_role("button", name="Link", exact=True).wait_for()


def test_a_page_that_is_loaded_again_goes_on_where_it_was(visit):
    visitor = visit(LINK)
    page, speed = visitor.page, visitor.page.get_by_role("slider", name="Speed")
    speed.fill("3")
    page.wait_for_selector(".swarm-speed output:text('5 steps/s')")
    for _ in range(3):
        visitor.press("Step")
    visitor.wait_for_step(3)
    page.reload()
    visitor.wait_for_step(3)
    assert speed.input_value() == "3"
    visitor.press("Play")
    visitor.wait("+player.step > 7")
    page.reload()
    visitor.wait("+player.step > 7 && player.playing === 'true'")
    visitor.press("Pause")
    visitor.wait("player.rest === 'true'")
    assert visitor.about("fingerprint") == FireFighting(n_robots=4, rng=3).run(visitor.step).state_hash()


def test_a_run_that_was_paused_farther_than_links_reach_is_there_again(visit):
    visitor = visit("?model=fire_fighting&n_robots=1&seed=2")
    visitor.page.get_by_role("slider", name="Speed").press("End")
    visitor.press("Play")
    visitor.wait("+player.step > 20000")
    visitor.press("Pause")
    visitor.wait("player.rest === 'true'")
    step, fingerprint = visitor.step, visitor.about("fingerprint")
    assert "step=" not in visitor.page.url
    visitor.page.reload()
    visitor.wait_for_step(step)
    assert visitor.about("fingerprint") == fingerprint


def test_a_page_in_another_tab_of_the_browser_pauses(visit):
    visitor = visit(LINK)
    visitor.press("Play")
    visitor.wait("+player.step > 3")
    visitor.page.evaluate(HIDE, True)
    visitor.wait("player.rest === 'true'")
    visitor.page.evaluate(HIDE, False)
    visitor.wait("player.playing === 'true'")


def test_a_server_that_is_gone_is_stated_and_the_page_can_be_loaded_again(chromium):
    port = free_port()
    command = [sys.executable, "-c", LAUNCH, str(port)]
    server = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    try:
        wait_until(lambda: answers(port), 90)
        visitor = Visit(chromium.new_context(), f"http://{HOST}:{port}/{LINK}")
        visitor.press("Step")
        visitor.wait_for_step(1)
        assert visitor.complaints == []
        server.send_signal(signal.SIGKILL)
        server.wait()
        bar = visitor.page.get_by_role("alert")
        bar.filter(has_text="does not answer: its program has ended or was restarted").wait_for(timeout=2000)
        server = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        wait_until(lambda: answers(port), 90)
        bar.get_by_role("button", name="Reload").click()
        visitor.wait_for_step(1)
        assert bar.count() == 0
    finally:
        server.kill()
        server.wait()


def test_a_connection_that_was_lost_for_a_moment_leaves_no_trace(visit):
    visitor = visit(LINK)
    visitor.press("Step")
    visitor.wait_for_step(1)
    visitor.page.evaluate(
        """() => {
          window.statuses = [];
          solara.debug.kernel().connectionStatusChanged.connect((kernel, status) => window.statuses.push(status));
          solara.debug.dropConnection();
        }"""
    )
    visitor.page.wait_for_function("window.statuses.at(-1) === 'connected'")
    visitor.press("Step")
    visitor.wait_for_step(2)
    visitor.page.wait_for_function("!document.querySelector('.swarm-gone')")
