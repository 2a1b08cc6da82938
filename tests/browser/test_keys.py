"""Keys of the page: the space bar plays and pauses whatever was clicked, and all keys are listed."""

import pytest

from mesa_swarm.dashboard.page.navigation import KEYS

pytestmark = pytest.mark.slow

# What of the Watch page is clicked before the space bar.
CLICKED = [
    ".swarm-theme",
    ".swarm-page-bar button:text('Link')",
    ".swarm-tools button[title='Zoom in']",
    ".swarm-charts button:text('PNG') >> nth=0",
    ".swarm-charts summary",
    ".swarm-panel summary >> nth=0",
    ".swarm-header button:text('Watch')",
    ".swarm-tools summary",
    ".swarm-tools input[type=checkbox] >> nth=0",
]
SIDES = ".swarm-worlds .swarm-player"
CLOCK = ".swarm-clock .swarm-player"


def reach(visitor, selector: str) -> None:
    """Move the focus to a control as the Tab key does."""
    visitor.page.locator(selector).focus()
    visitor.page.keyboard.press("Shift+Tab")
    visitor.page.keyboard.press("Tab")


def toggles(visitor, player: str = ".swarm-player") -> bool:
    """Return whether the space bar starts and stops the player."""
    for playing in ("true", "false"):
        visitor.page.keyboard.press(" ")
        visitor.page.wait_for_selector(f"{player}[data-playing={playing}]")
    return True


def test_space_plays_and_pauses_whatever_was_clicked(visitor):
    for selector in CLICKED:
        visitor.page.locator(selector).click()
        assert toggles(visitor), selector
    box, theme = visitor.page.locator(".swarm-tools input[type=checkbox]").first, visitor.page.locator(".swarm-theme")
    was = box.is_checked(), theme.get_attribute("title")
    for one in (box, theme):
        one.click()
        assert toggles(visitor)
    now = box.is_checked(), theme.get_attribute("title")
    assert (now[0] != was[0], now[1] != was[1]) == (True, True)
    one = visitor.page.locator(".swarm-charts button:text('PNG')").first
    with visitor.page.expect_download():
        one.click()
    visitor.page.keyboard.press("ArrowRight")
    visitor.page.keyboard.press("r")
    visitor.wait_for_step(0)


def test_a_control_that_was_reached_by_tab_reacts_to_space_itself(visitor):
    page = visitor.page
    page.locator(".swarm-tools summary").click()
    box = page.locator(".swarm-tools input[type=checkbox]").first
    before = box.is_checked()
    reach(visitor, ".swarm-tools input[type=checkbox] >> nth=0")
    page.keyboard.press(" ")
    assert box.is_checked() != before
    group = page.locator(".swarm-panel details").first
    is_open = group.get_attribute("open")
    reach(visitor, ".swarm-panel summary >> nth=0")
    page.keyboard.press(" ")
    assert group.get_attribute("open") != is_open
    reach(visitor, ".swarm-theme")
    title = page.locator(".swarm-theme").get_attribute("title")
    page.keyboard.press(" ")
    page.wait_for_function("title => document.querySelector('.swarm-theme').title !== title", arg=title)
    assert (visitor.step, visitor.about("playing")) == (0, "false")
    page.keyboard.press("ArrowRight")  # of no use to a button
    visitor.wait_for_step(1)
    page.locator(".swarm-theme").click()  # by pointer, while it has the focus
    assert toggles(visitor)


def test_space_plays_two_worlds_and_a_list_keeps_it(visitor):
    page = visitor.page
    visitor.press("Compare")
    page.wait_for_selector(f"{SIDES}[data-drawn]")
    assert toggles(visitor, CLOCK)
    visitor.press("Over many seeds")
    assert toggles(visitor, CLOCK)
    visitor.field("steps").locator("input").click()
    page.keyboard.press(" ")
    visitor.field("parameter").locator("select").focus()
    page.keyboard.press("r")
    assert page.locator(".swarm-clock .swarm-player").get_attribute("data-playing") == "false"


def test_the_list_of_keys_is_a_dialog_that_keeps_all_keys_and_closes_by_escape(visitor):
    page = visitor.page
    visitor.field("seed").locator("input").focus()
    page.keyboard.press("?")
    dialog = page.get_by_role("dialog", name="Keys")
    assert not dialog.is_visible()
    page.locator(".swarm-stage canvas").focus()
    for open_list in (lambda: page.keyboard.press("?"), lambda: visitor.press("Keys")):
        open_list()
        assert [row.inner_text().split("\t") for row in dialog.locator("tr").all()] == [list(row) for row in KEYS]
        page.keyboard.press("r")
        page.keyboard.press("ArrowRight")
        page.keyboard.press("Escape")
        dialog.wait_for(state="hidden")
    assert visitor.step == 0
    page.keyboard.press("ArrowRight")
    visitor.wait_for_step(1)
