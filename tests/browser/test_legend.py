"""The legend of the canvas, in a real browser: it names what there is, folds, and hides no more than it may."""

import pytest

from support.visits import resize, settle
from support.waiting import wait_until

pytestmark = pytest.mark.long

KEY = ".swarm-key"
# The share of the canvas that the legend covers, and whether it covers any of the map.
COVERS = """(() => {
  const canvas = document.querySelector(".swarm-stage canvas"), whole = canvas.getBoundingClientRect();
  const key = document.querySelector(".swarm-key").getBoundingClientRect(), [left, top, right, bottom] = canvas.arena();
  const beside = key.left >= whole.x + right || key.top >= whole.y + bottom;
  return [(key.width * key.height) / (whole.width * whole.height), !beside];
})()"""


def names(visitor) -> list[str]:
    return [" ".join(text.split()) for text in visitor.page.locator(f"{KEY} li").all_inner_texts()]


def fold(visitor):
    return visitor.page.get_by_role("button", name="Legend")


def switch(visitor, label: str) -> None:
    visitor.page.locator(".swarm-tools summary").click()
    visitor.page.get_by_label(label).click()
    visitor.page.locator(".swarm-tools summary").click()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_legend_names_every_colour_of_what_there_is_and_is_switched_on(visit, theme, shots):
    visitor = visit("?model=fire_fighting&seed=1&step=600", color_scheme=theme)
    visitor.wait_for_step(600)
    layers = ["Avoid", "FightFire", "Explore"]
    fires = ["heat of a robot", "fire, temperature 0 to 1", "fire, out", "obstacle"]
    sectors = ["sensor that sees something", "sensor that sees nothing"]
    hot = ["robot too hot to fight"]
    wait_until(lambda: [name for name in names(visitor) if name not in hot][1:] == [*layers, *fires, *sectors])
    assert names(visitor)[0] == "robot, its front pale"
    visitor.page.screenshot(path=shots / f"legend_{theme}.png")
    switch(visitor, "Sensor sectors")
    assert names(visitor)[-1] == "obstacle"
    switch(visitor, "Winning layer")
    assert not set(layers) & set(names(visitor))
    visitor.press("Next robot")
    wait_until(lambda: names(visitor)[-1] == "selected robot")


def test_sectors_that_are_too_many_are_explained_in_the_menu_and_left_out_of_the_legend(visit):
    visitor = visit("?model=perimeter&seed=1&step=20")
    visitor.wait_for_step(20)
    visitor.page.locator(".swarm-tools summary").click()
    menu = visitor.page.locator(".swarm-tools details")
    assert "Sensor sectors: of the selected robot only, too many in sight" in menu.inner_text()
    assert not any(name.startswith("sensor") for name in names(visitor))
    visitor.press("Next robot")
    wait_until(lambda: "sensor that sees something" in names(visitor))


def test_the_legend_covers_at_most_a_quarter_of_the_canvas_and_none_of_the_map(visit):
    visitor = visit("?model=fire_fighting&seed=1&step=300")
    visitor.wait_for_step(300)
    for size in ((1366, 768), (1920, 1080), (1024, 768), (800, 600)):
        resize(visitor.page, *size)
        settle(visitor.page)
        share, covers = visitor.page.evaluate(COVERS)
        assert share <= 0.25, size
        assert not covers, size


def test_the_legend_is_folded_on_a_phone_and_as_it_was_left_elsewhere(visit, shots):
    visitor = visit("?model=fire_fighting&seed=1&step=60")
    visitor.wait_for_step(60)
    shown = visitor.page.locator(f"{KEY} ul")
    assert (fold(visitor).get_attribute("aria-expanded"), shown.is_visible()) == ("true", True)
    resize(visitor.page, 390, 844)
    wait_until(lambda: fold(visitor).get_attribute("aria-expanded") == "false")
    visitor.page.screenshot(path=shots / "legend_phone.png")
    fold(visitor).click()
    assert visitor.page.locator(f"{KEY} li").first.is_visible()
    share, _ = visitor.page.evaluate(COVERS)
    assert share <= 0.25
    resize(visitor.page, 1366, 768)
    fold(visitor).click()
    assert not visitor.page.locator(f"{KEY} li").first.is_visible()
    visitor.page.reload()
    visitor.page.wait_for_selector(".swarm-player[data-drawn]")
    assert fold(visitor).get_attribute("aria-expanded") == "false"
