"""Windows of all sizes, in a real browser: the world stays large, nothing is cut off, and text can be read."""

import pytest

from support.visits import resize

pytestmark = pytest.mark.long

# The width and height of every map that is shown, as far as it is within its canvas, px.
MAPS = """[...document.querySelectorAll(".swarm-stage canvas")].map((canvas) => {
    const [left, top, right, bottom] = canvas.arena();
    const within = (from, to, size) => Math.min(to, size) - Math.max(from, 0);
    return [within(left, right, canvas.clientWidth), within(top, bottom, canvas.clientHeight)];
})"""
TOO_WIDE = "document.documentElement.scrollWidth > innerWidth"
# Of all text that is shown, how large it is on the screen.
TEXT = """(() => {
    const texts = document.createTreeWalker(document.querySelector(".swarm"), NodeFilter.SHOW_TEXT), found = [];
    while (texts.nextNode()) {
        const { nodeValue, parentElement: one } = texts.currentNode;
        if (!nodeValue.trim() || !one.getClientRects().length || one.closest("svg, option, style")) continue;
        found.push([parseFloat(getComputedStyle(one).fontSize) * one.currentCSSZoom, nodeValue]);
    }
    for (const one of document.querySelectorAll(".swarm-diagram text")) {
        found.push([parseFloat(one.getAttribute("font-size")) * one.getScreenCTM().a, one.textContent]);
    }
    return found;
})()"""
CHART = """(() => {
    const canvas = document.querySelector(".swarm-chart canvas");
    return canvas.width / canvas.getBoundingClientRect().width;
})()"""
# The window's width and height, and the least width of the map on Watch and Replay, and of each on Compare.
WINDOWS = {(1366, 768): (600, 380), (1024, 768): (600, 400), (911, 512): (340, 300), (800, 600): (440, 300)}
WINDOWS |= {(683, 384): (260, 240), (400, 700): (280, 120)}


@pytest.fixture
def watched(visit):
    """A page on which a robot is looked at that sees something."""
    visitor = visit("?model=fire_fighting&seed=1&step=50")
    visitor.wait_for_step(50)
    visitor.press("Next robot")
    visitor.page.wait_for_selector(".swarm-diagram text")
    return visitor


def open_tab(visitor, tab: str, recorded_fires) -> None:
    """Show a page with all that it has."""
    visitor.press(tab)
    if tab == "Replay":
        visitor.page.set_input_files(".swarm-set input[type=file]", recorded_fires)
        visitor.page.wait_for_selector(".swarm-events button")
    if tab == "Watch":
        for selector in (".swarm-chart[data-points='50']", ".swarm-diagram text"):
            visitor.page.wait_for_selector(selector)
    if tab == "Compare":
        visitor.page.wait_for_selector("img.swarm-curves")
    visitor.page.wait_for_function(
        f"document.querySelectorAll('.swarm-stage canvas').length === {1 + (tab == 'Compare')}"
    )
    visitor.wait("player.drawn")


@pytest.mark.parametrize("tab", ["Watch", "Compare", "Replay"])
def test_the_world_is_large_in_a_window_of_any_size(watched, recorded_fires, tab, shots):
    page = watched.page
    open_tab(watched, tab, recorded_fires)
    for (width, height), least in WINDOWS.items():
        resize(page, width, height)
        page.screenshot(path=shots / f"size_{tab}_{width}.png", full_page=True)
        assert [size for size in page.evaluate(MAPS) if size[0] < least[tab == "Compare"]] == [], (width, height)
        assert not page.evaluate(TOO_WIDE), (width, height)


def test_three_columns_stand_beside_each_other_on_a_laptop_and_two_or_one_where_there_is_less_room(watched):
    page = watched.page

    def left(selector: str) -> float:
        return page.locator(selector).bounding_box()["x"]

    columns = [".swarm-watch > :first-child", ".swarm-middle", ".swarm-side"]
    assert [left(one) for one in columns] == [0, 290, 1366 - 340]
    resize(page, 1024, 768)
    assert [left(one) for one in columns] == [0, 290, 290]
    resize(page, 800, 600)
    watched.press("Settings")
    assert [left(one) for one in columns] == [0, 0, 0]
    last = page.get_by_role("button", name="Export", exact=True)
    last.scroll_into_view_if_needed()
    assert last.bounding_box()["y"] < 600
    assert page.locator(".swarm-header").bounding_box()["y"] == 0, "the tabs stay in sight"


def test_on_a_projector_all_text_is_a_quarter_larger(watched, recorded_fires, shots):
    page = watched.page
    for tab in ("Compare", "Replay", "Models", "Watch"):
        watched.press(tab) if tab == "Models" else open_tab(watched, tab, recorded_fires)
        for size, least in (((1366, 768), 11), ((1920, 1080), 13.5)):
            resize(page, *size)
            page.screenshot(path=shots / f"text_{tab}_{size[0]}.png")
            assert [text for text in page.evaluate(TEXT) if text[0] < least] == [], (tab, size)
    assert page.evaluate(CHART) == pytest.approx(1, abs=0.01), "it is drawn as large as it is seen"
