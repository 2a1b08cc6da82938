"""Room for the world, in a real browser: columns fold, the world fills the screen, type grows for a projector."""

import gzip
import urllib.request

import pytest

from mesa_swarm.recording import Recording
from mesa_swarm.viewing.replay_page import replay_page
from support.visits import blank_page, resize, settle

LINK = "?model=fire_fighting&seed=1&step=5"
PANEL, SIDE = ".swarm-panel", ".swarm-side"
STAGE = "document.querySelector('.swarm-stage').clientWidth"
TYPE = """(() => {
    const one = document.querySelector(".swarm-readings dd");
    return parseFloat(getComputedStyle(one).fontSize) * one.currentCSSZoom;
})()"""
TOO_WIDE = "document.documentElement.scrollWidth > innerWidth"
# What a finger or a pointer hits that is smaller than this: its width and height on the screen, px. Of a box with
# a label it is the label.
SMALL = """(least) => {
    const all = document.querySelectorAll("button, a[href], input:not([type=file]), select, summary");
    return [...all].filter((one) => one.checkVisibility({ visibilityProperty: true })).map((one) => {
        const { width, height } = (one.closest("label") ?? one).getBoundingClientRect();
        return [one.ariaLabel ?? one.textContent, Math.round(width), Math.round(height)];
    }).filter(([, width, height]) => width < least || height < least);
}"""
IN_SIGHT = """(name) => {
    const tabs = document.querySelector(".swarm-header nav"), tab = tabs.querySelector("[aria-current]");
    const box = tabs.getBoundingClientRect(), { left, right } = tab?.getBoundingClientRect() ?? {};
    return tab?.textContent === name && left >= box.left - 1 && right <= box.right + 1;
}"""
FOCUSED = "document.activeElement.textContent"
PHONE = {"has_touch": True, "is_mobile": True, "viewport": {"width": 390, "height": 844}}


@pytest.fixture
def opened(visit):
    visitor = visit(LINK)
    visitor.wait_for_step(5)
    return visitor


@pytest.mark.slow
def test_the_page_names_its_language_and_its_model_and_can_be_enlarged(opened):
    page = opened.page
    assert page.evaluate("document.documentElement.lang") == "en"
    viewport = page.locator("meta[name=viewport]").get_attribute("content")
    assert "user-scalable" not in viewport
    assert "maximum-scale" not in viewport
    page.wait_for_function("document.title === 'Fire fighting - mesa_swarm'")
    opened.press("Models")
    page.wait_for_function("document.title === 'Models: Fire fighting - mesa_swarm'")


@pytest.mark.parametrize("taken", ["gzip", "identity"])
def test_a_page_is_completed_and_compressed_if_the_browser_takes_that(server, taken):
    request = urllib.request.Request(server[1], headers={"Accept": "text/html", "Accept-Encoding": taken})
    with urllib.request.urlopen(request) as answer:
        page, packed = answer.read(), answer.headers["content-encoding"] == "gzip"
        assert int(answer.headers["content-length"]) == len(page)
    assert packed == (taken == "gzip")
    assert b'<html lang="en">' in (gzip.decompress(page) if packed else page)


@pytest.mark.long
def test_columns_fold_by_click_and_key_and_stay_folded_on_the_next_visit(opened):
    page, before = opened.page, opened.page.evaluate(STAGE)
    opened.press("Settings")
    assert page.locator(PANEL).is_hidden()
    page.get_by_role("button", name="Robot, charts, export").press("Enter")
    assert page.locator(SIDE).is_hidden()
    settle(page)
    assert page.evaluate(STAGE) == before + 290 + 340
    page.reload()
    page.wait_for_selector(".swarm-player[data-drawn]")
    assert page.locator(PANEL).is_hidden()
    assert page.locator(SIDE).is_hidden()
    opened.press("Settings")
    page.get_by_role("button", name="Robot, charts, export").press("Space")
    assert page.locator(PANEL).is_visible()
    page.wait_for_function("document.querySelector('.swarm-chart canvas').width > 100")


@pytest.mark.long
def test_full_screen_shows_the_world_with_its_bar_only_until_escape(opened):
    page, before = opened.page, opened.page.evaluate(STAGE)
    opened.press("Full screen")
    for hidden in (PANEL, SIDE, ".swarm-header nav"):
        assert page.locator(hidden).is_hidden()
    assert page.get_by_role("button", name="Play", exact=True).is_visible()
    assert page.evaluate(STAGE) > before + 600
    page.wait_for_function("document.fullscreenElement")
    opened.press("Leave full screen")
    page.wait_for_function("!document.fullscreenElement")
    assert page.locator(PANEL).is_visible()
    page.evaluate("void (document.documentElement.requestFullscreen = () => Promise.reject(new Error('refused')))")
    opened.press("Full screen")
    assert page.locator(PANEL).is_hidden(), "also where the browser refuses"
    page.keyboard.press("Escape")
    assert page.locator(PANEL).is_visible()


@pytest.mark.long
def test_a_projector_gets_large_type_and_few_controls_until_the_button_is_pressed_again(opened, shots):
    page, before = opened.page, opened.page.evaluate(TYPE)
    opened.press("Projector")
    settle(page)
    assert page.locator("html").get_attribute("data-projector") == "1"
    assert page.evaluate(TYPE) >= 1.3 * before
    assert page.locator(PANEL).is_hidden()
    resize(page, 1920, 1080)
    page.screenshot(path=shots / "projector.png")
    assert page.evaluate(TYPE) >= 1.55 * before
    assert not page.evaluate(TOO_WIDE)
    page.reload()
    page.wait_for_selector(".swarm-player[data-drawn]")
    assert page.locator("html").get_attribute("data-projector") == "1"
    opened.press("Projector")
    assert page.locator(PANEL).is_visible()
    assert page.evaluate(TYPE) == pytest.approx(1.25 * before)


@pytest.mark.long
def test_on_a_telephone_the_world_is_first_its_bar_below_and_the_panels_fold(visit, shots):
    visitor = visit(LINK, **PHONE)
    visitor.wait_for_step(5)
    page = visitor.page
    page.screenshot(path=shots / "telephone.png", full_page=True)
    stage, play = (page.locator(one).bounding_box() for one in (".swarm-stage", ".swarm-main"))
    assert (stage["x"], stage["width"]) == (0, 390)
    assert stage["y"] < 60
    assert stage["height"] >= 350
    assert stage["y"] + stage["height"] < play["y"] < 844 - 48
    assert page.locator(PANEL).is_hidden()
    visitor.press("Settings")
    assert page.locator(PANEL).is_visible()
    assert page.locator(PANEL).bounding_box()["y"] > play["y"]
    visitor.press("Robot, charts, export")
    assert page.locator(SIDE).is_hidden()


@pytest.mark.long
def test_on_a_telephone_the_present_tab_is_in_sight_also_where_more_buttons_come(visit, recorded_fires):
    visitor = visit(LINK, **PHONE)
    page = visitor.page
    for tab in ("Replay", "Models", "Experiment", "Watch", "Replay"):
        visitor.press(tab)
        page.wait_for_function(IN_SIGHT, arg=tab)
    page.set_input_files(".swarm-set input[type=file]", recorded_fires)
    page.wait_for_selector(".swarm-events button")
    page.wait_for_selector(".swarm-full", state="visible")
    page.wait_for_function(IN_SIGHT, arg="Replay")


@pytest.mark.long
@pytest.mark.parametrize("size", [(390, 844), (844, 390), (820, 1180), (320, 640)])
def test_no_tab_of_a_touched_screen_scrolls_sideways_or_has_a_target_below_44_px(visit, recorded_fires, size, shots):
    width, height = size
    visitor = visit(LINK, **(PHONE | {"viewport": {"width": width, "height": height}}))
    visitor.wait_for_step(5)
    page = visitor.page
    shown = {"Models": ".swarm-card", "Experiment": ".swarm-experiment[data-runs]"}
    for tab in ("Watch", "Models", "Compare", "Experiment", "Replay"):
        visitor.press(tab)
        if tab == "Replay":
            page.set_input_files(".swarm-set input[type=file]", recorded_fires)
            page.wait_for_selector(".swarm-events button")
        page.wait_for_selector(shown.get(tab, ".swarm-player[data-drawn]"))
        for fold in page.locator(".swarm-fold [aria-expanded=false]").all():
            fold.click()
        settle(page)
        page.screenshot(path=shots / f"touched_{tab}_{width}.png", full_page=True)
        assert not page.evaluate(TOO_WIDE), tab
        assert page.evaluate(SMALL, 44) == [], tab


@pytest.mark.long
def test_every_target_of_a_pointer_is_at_least_24_px(opened):
    shown = {"Models": ".swarm-card", "Compare": ".swarm-clock", "Experiment": ".swarm-experiment"}
    for tab, part in {**shown, "Replay": ".swarm-list", "Watch": SIDE}.items():
        opened.press(tab)
        opened.page.wait_for_selector(part, state="attached")
        settle(opened.page)
        assert opened.page.evaluate(SMALL, 24) == [], tab


@pytest.mark.long
def test_a_field_is_described_by_its_help_and_by_its_fault(opened):
    field = opened.field("initial_temperature")
    typed = field.locator("input[type=text]")
    described = (
        "(one) => one.getAttribute('aria-describedby').split(' ').map((id) => document.getElementById(id).textContent)"
    )
    assert typed.evaluate(described) == ["temperature of all fires at the start"]
    assert typed.get_attribute("aria-invalid") is None
    typed.fill("hot")
    typed.press("Enter")
    field.locator(".swarm-fault:not([hidden])").wait_for()
    assert typed.get_attribute("aria-invalid") == "true"
    assert "hot" in typed.evaluate(described)[0]
    assert opened.field("n_robots").locator("small").is_hidden(), "it only repeats the label"
    opened.field("strategy").locator("label").click()
    assert opened.page.evaluate("document.activeElement.tagName") == "SELECT"


@pytest.mark.long
def test_in_colours_of_the_system_and_without_motion_the_page_can_be_used(visit, shots):
    visitor = visit(LINK, forced_colors="active", reduced_motion="reduce")
    visitor.wait_for_step(5)
    visitor.page.screenshot(path=shots / "forced_colours.png")
    chosen = visitor.page.get_by_role("button", name="Watch", exact=True)
    assert chosen.evaluate("one => getComputedStyle(one).outlineStyle") == "solid"
    moving = (
        "document.getAnimations().filter((one) => one.playState === 'running' && one.effect.getTiming().duration > 1)"
    )
    visitor.page.wait_for_function(f"{moving}.length === 0")


@pytest.mark.long
def test_the_page_that_replays_cuts_nothing_off_and_its_details_fold(chromium, recorded_fires, tmp_path, shots):
    path = tmp_path / "page.html"
    path.write_text(replay_page(Recording(recorded_fires)), encoding="utf-8")
    page = blank_page(chromium, viewport={"width": 1366, "height": 768})
    page.goto(path.as_uri())
    page.wait_for_selector("html[data-ready]")
    cut = "[...document.querySelectorAll('aside *')].filter((one) => one.getBoundingClientRect().right > innerWidth)"
    for size, least in (((1366, 768), 24), ((1920, 1080), 24), ((820, 1180), 24), ((390, 844), 44), ((320, 640), 44)):
        resize(page, *size)
        page.screenshot(path=shots / f"replays_{size[0]}.png", full_page=True)
        assert page.evaluate(f"{cut}.length") == 0, size
        assert not page.evaluate(TOO_WIDE), size
        assert page.evaluate(SMALL, least) == [], size
    resize(page, 1366, 768)
    width = page.locator(".stage").bounding_box()["width"]
    page.get_by_role("button", name="Details").click()
    assert page.locator("aside").is_hidden()
    assert page.locator(".stage").bounding_box()["width"] == width + 292
    page.get_by_role("button", name="Full screen").click()
    page.wait_for_function("document.fullscreenElement")
    page.close()
