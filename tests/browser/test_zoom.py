"""What is in sight on the canvas outlasts other tabs, a reset and a reload, in a real browser."""

import pytest

from support.waiting import wait_until

pytestmark = pytest.mark.long

ARENA = "document.querySelector('.swarm-stage canvas')?.arena?.().map(Math.round)"


def arena(visitor) -> list[int] | None:
    """Return where the map is on the canvas: left, top, right, bottom; None while there is no canvas."""
    return visitor.page.evaluate(ARENA)


def choose_model(visitor, name: str) -> None:
    visitor.press("Models")
    visitor.page.locator(".swarm-card").filter(has_text=name.replace("_", " ").capitalize()).first.click()
    visitor.page.wait_for_function(f"location.search.includes('model={name}')")
    visitor.wait_for_step(0)


@pytest.fixture
def zoomed(visitor):
    """A page on which the map is zoomed in twice, moved, and its sectors are switched off."""
    page = visitor.page
    visitor.press("Zoom in")
    visitor.press("Zoom in")
    box = page.locator(".swarm-stage canvas").bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 300)
    page.mouse.down()
    page.mouse.move(box["x"] + 340, box["y"] + 320, steps=3)
    page.mouse.up()
    page.locator(".swarm-tools summary").click()
    page.get_by_label("Sensor sectors").uncheck()
    return visitor


def test_the_zoom_is_the_same_after_another_tab_and_after_a_reset(zoomed):
    before = arena(zoomed)
    zoomed.press("Models")
    zoomed.press("Watch")
    zoomed.wait("player.drawn")
    wait_until(lambda: arena(zoomed) == before)
    zoomed.page.locator(".swarm-tools summary").click()
    assert not zoomed.page.get_by_label("Sensor sectors").is_checked()
    zoomed.press("Reset")
    zoomed.wait_for_step(0)
    assert arena(zoomed) == before


def test_the_zoom_is_the_same_after_a_reload(zoomed):
    before = arena(zoomed)
    zoomed.page.reload()
    zoomed.page.wait_for_selector(".swarm-player[data-drawn]")
    wait_until(lambda: arena(zoomed) == before)
    zoomed.press("Show the whole map")
    fitted = arena(zoomed)
    zoomed.page.reload()
    zoomed.page.wait_for_selector(".swarm-player[data-drawn]")
    wait_until(lambda: arena(zoomed) == pytest.approx(fitted, abs=2))


def test_another_model_begins_with_its_whole_map_and_the_first_one_is_found_as_it_was_left(zoomed):
    before = arena(zoomed)
    choose_model(zoomed, "flocking")
    left, top, right, bottom = arena(zoomed)
    box = zoomed.page.locator(".swarm-stage canvas").bounding_box()
    assert min(left, top) >= 0
    assert right <= box["width"]
    assert bottom <= box["height"]
    choose_model(zoomed, "fire_fighting")
    wait_until(lambda: arena(zoomed) == before)


def test_a_robot_is_followed_again_after_another_tab(visitor):
    follow = visitor.page.get_by_role("button", name="Follow the selected robot")
    follow.click()
    visitor.press("Models")
    visitor.press("Watch")
    visitor.wait("player.drawn")
    wait_until(lambda: follow.get_attribute("aria-pressed") == "true")


def test_on_a_projector_lines_and_texts_of_the_canvas_are_larger(visitor):
    before = visitor.image()
    visitor.page.evaluate("document.querySelector('.swarm').dataset.projector = '1'")
    wait_until(lambda: visitor.image() != before)
    visitor.page.evaluate("delete document.querySelector('.swarm').dataset.projector")
    wait_until(lambda: visitor.image() == before)
