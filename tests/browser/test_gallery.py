"""The gallery in a real browser: its pictures are there at once, and move when they are pointed at."""

from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from mesa_swarm.model.gallery import gallery_names
from mesa_swarm.viewing import text_of
from support.visits import blank_page, resize

pytestmark = pytest.mark.slow

# What is on the cards in the first frame in which there are cards: their number, and that of drawn pictures.
FIRST = """() => {
  window.first = new Promise((done) => new MutationObserver((_, watch) => {
    const cards = document.querySelectorAll(".swarm-card");
    if (!cards.length) return;
    watch.disconnect();
    requestAnimationFrame(() => {
      const drawn = [...cards].filter((card) => card.querySelector(".swarm-picture > svg")?.getBBox().width > 0);
      done([cards.length, drawn.length]);
    });
  }).observe(document.body, { childList: true, subtree: true }));
}"""
SMALLEST = "Math.min(...[...document.querySelectorAll('.swarm-card')].flatMap((card) => {" + (
    "const box = card.getBoundingClientRect(); return [box.width, box.height]; }))"
)
LATER = "new Promise((done) => setTimeout(done, 500))"
# A gallery of one model of a user's, whose picture is drawn later.
OWN = """async (script) => {
    const { default: widget } = await import(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
    const card = { name: "./mine.py:Ants", title: "<b>Ants", about: "<i>walk", still: "", moving: "" };
    const traits = { cards: [card], drawn: {}, chosen: "" }, listeners = {}, el = document.createElement("div");
    const on = (name, listener) => (listeners[name] = listener);
    widget.render({ model: { get: (name) => traits[name], on, off() {} }, el });
    document.body.append(el);
    const seen = [el.querySelector(".swarm-picture").textContent, el.querySelector("strong").textContent];
    traits.drawn = { "./mine.py:Ants": '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 4 3"><path/></svg>' };
    listeners["change:drawn"]();
    return [...seen, el.querySelectorAll(".swarm-picture > svg path").length];
}"""


def requests(visitor) -> list[str]:
    """Return the names of the moving pictures that the page has loaded."""
    paths = [url.partition("/gallery/")[2] for url in visitor.asked if "/gallery/" in url]
    return [path.partition(".svg?v=")[0] for path in paths]


def picture(visitor, name: str):
    return visitor.page.locator(f".swarm-card[data-name={name}] .swarm-picture")


def wait_until_it(visitor, name: str, moves: bool) -> None:
    visitor.page.wait_for_selector(f"[data-name={name}] .swarm-picture[data-moves={str(moves).lower()}]")


def test_all_pictures_are_on_their_cards_in_the_first_frame_and_nothing_is_loaded_for_them(visitor):
    assert visitor.page.locator(".swarm-picture").count() == 0
    visitor.page.evaluate(FIRST)
    visitor.press("Models")
    assert visitor.page.evaluate("window.first") == [len(gallery_names())] * 2
    assert requests(visitor) == []


def test_a_picture_moves_while_it_is_pointed_at_and_is_loaded_once(visitor):
    visitor.press("Models")
    shown = picture(visitor, "boids")
    before = shown.inner_html()
    shown.hover()
    wait_until_it(visitor, "boids", moves=True)
    assert shown.inner_html() != before
    time = "document.querySelector('[data-name=boids] svg').getCurrentTime()"
    visitor.page.wait_for_function(f"{time} > 0.2")
    visitor.page.mouse.move(1, 1)
    wait_until_it(visitor, "boids", moves=False)
    assert shown.locator("svg").evaluate("(svg) => svg.animationsPaused()")
    stopped = visitor.page.evaluate(time)
    shown.hover()
    wait_until_it(visitor, "boids", moves=True)
    visitor.page.wait_for_function(f"{time} > {stopped}")
    assert requests(visitor) == ["boids"]


def test_nothing_moves_and_nothing_is_loaded_for_those_who_want_less_motion(visit):
    visitor = visit(reduced_motion="reduce")
    visitor.press("Models")
    before = picture(visitor, "boids").inner_html()
    picture(visitor, "boids").hover()
    visitor.page.evaluate(LATER)
    assert (requests(visitor), picture(visitor, "boids").inner_html()) == ([], before)
    visitor.page.emulate_media(reduced_motion="no-preference")
    wait_until_it(visitor, "boids", moves=True)
    visitor.page.emulate_media(reduced_motion="reduce")
    wait_until_it(visitor, "boids", moves=False)


def test_cards_are_reached_and_pressed_by_keyboard_and_the_current_one_is_marked(visitor):
    page = visitor.page
    visitor.press("Models")
    page.wait_for_selector(".swarm-card")
    assert page.locator(".swarm-card[aria-current=true]").evaluate("(card) => card.dataset.name") == "fire_fighting"
    page.locator(".swarm-card").first.focus()
    for name in gallery_names()[1:4]:
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.dataset.name") == name
    assert page.evaluate("getComputedStyle(document.activeElement).outlineWidth") == "3px"
    wait_until_it(visitor, "boids", moves=True)
    page.keyboard.press("Tab")
    wait_until_it(visitor, "boids", moves=False)
    page.keyboard.press("Enter")
    page.wait_for_function("location.search.includes('model=chain_formation')")
    visitor.wait_for_step(0)


def test_a_model_without_a_picture_has_its_initial_letter_until_the_picture_is_drawn(chromium):
    page = blank_page(chromium)
    assert page.evaluate(OWN, text_of("viewing/elements.js", "dashboard/gallery/gallery.js")) == ["<", "<b>Ants", 1]
    page.close()


def pixels(shown) -> np.ndarray:
    return np.asarray(Image.open(BytesIO(shown.screenshot())).convert("RGB"), float)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_moving_pictures_begin_as_those_at_rest_in_both_themes(visit, theme):
    visitor = visit(color_scheme=theme)
    visitor.press("Models")
    for name in ("ant_trails", "best_of_n", "boids", "fire_fighting", "puck_clustering", "shepherding"):
        shown = picture(visitor, name)
        shown.scroll_into_view_if_needed()
        at_rest = pixels(shown)
        shown.hover()
        wait_until_it(visitor, name, moves=True)
        shown.locator("svg").evaluate("(svg) => (svg.pauseAnimations(), svg.setCurrentTime(0))")
        differ = np.abs(pixels(shown) - at_rest).max(axis=2) > 60
        assert differ.mean() < 0.005, name


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("size", [(390, 844), (1366, 768), (1920, 1080)], ids="{0[0]}x{0[1]}".format)
def test_cards_fit_every_screen_and_are_large_enough_to_press(visit, shots, size, theme):
    visitor = visit(color_scheme=theme)
    visitor.press("Models")
    resize(visitor.page, *size)
    visitor.page.wait_for_selector(".swarm-card")
    visitor.page.screenshot(path=shots / f"gallery-{theme}-{size[0]}.png")
    assert visitor.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert visitor.page.evaluate(SMALLEST) >= 44
