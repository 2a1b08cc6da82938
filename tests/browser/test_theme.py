"""Light and dark, in a real browser: whatever is drawn follows the button, the system, and the notebook around it."""

import pytest

from mesa_swarm.viewing.canvas_widget import SwarmCanvas
from support.visits import blank_page

pytestmark = pytest.mark.long

LINK = "?model=fire_fighting&seed=1&step=50"
# What is drawn: the world, and every chart.
DRAWN = """[...document.querySelectorAll(".swarm-stage canvas, .swarm-chart canvas")].map((one) => one.toDataURL())"""
POINTS = """document.querySelectorAll(".swarm-chart[data-points='50']").length === 3"""
# A widget as a notebook makes one: it is put on the page after it was built.
NOTEBOOK = """async (script) => {
    const { default: widget } = await import(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
    const options = { bar: true, keys: "own", toggles: {} }, nothing = () => {}, el = document.createElement("div");
    const get = (name) => (name === "options" ? options : null);
    widget.render({ model: { get, on: nothing, off: nothing, send: nothing }, el });
    document.body.append(el);
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
}"""
THEME = "document.querySelector('.swarm-player').dataset.theme"


@pytest.fixture
def opened(visit):
    """Open the same run in a theme of the system, with all of its charts drawn."""

    def open_page(system: str):
        visitor = visit(LINK, color_scheme=system, reduced_motion="reduce")
        visitor.wait_for_step(50)
        visitor.page.wait_for_function(POINTS)
        return visitor

    return open_page


def is_drawn(visitor, images: list[str]) -> None:
    visitor.page.wait_for_function(f"(images) => String({DRAWN}) === String(images)", arg=images)


def test_the_button_and_the_system_change_all_that_is_drawn(opened, shots):
    light, dark = opened("light"), opened("dark")
    day, night = (visitor.page.evaluate(DRAWN) for visitor in (light, dark))
    assert [one == other for one, other in zip(day, night, strict=True)] == [False] * 4
    light.press("Theme: as the system")
    is_drawn(light, night)
    assert light.about("theme") == "dark"
    light.page.screenshot(path=shots / "theme_dark.png")
    light.press("Theme: dark")
    is_drawn(light, day)
    light.press("Theme: light")
    light.page.emulate_media(color_scheme="dark")
    is_drawn(light, night)
    dark.press("Theme: as the system")
    dark.press("Theme: dark")
    is_drawn(dark, day)
    dark.press("Models")
    dark.press("Watch")
    dark.wait_for_step(50)
    assert dark.about("theme") == "light"


def test_in_a_notebook_it_is_the_notebooks_theme_or_the_systems(chromium):
    page = blank_page(chromium, color_scheme="dark")
    page.evaluate(NOTEBOOK, SwarmCanvas._esm)
    assert page.evaluate(THEME) == "dark"
    page.emulate_media(color_scheme="light")
    page.wait_for_function(f"{THEME} === 'light'")
    page.evaluate("document.body.dataset.jpThemeLight = 'false'")
    page.wait_for_function(f"{THEME} === 'dark'")
    page.close()
