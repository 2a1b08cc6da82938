"""The panel that explains the model in a real browser: its presets, equations and code."""

import pytest

from mesa_swarm.model.info import model_info
from support.waiting import wait_until

pytestmark = pytest.mark.long


def test_pressing_a_preset_sets_its_parameters_and_plays(visit):
    visitor = visit("?model=boids&n_robots=20&sight=100")
    page, preset = visitor.page, model_info("boids").presets[0]
    button = page.get_by_role("button", name=preset.label, exact=True)
    assert button.get_attribute("aria-pressed") == "false"
    button.click()
    visitor.wait("player.playing === 'true' && +player.step > 3")
    wait_until(lambda: button.get_attribute("aria-pressed") == "true")
    page.wait_for_function("location.search.includes('separation_weight=0.0')")
    assert "n_robots" not in page.evaluate("location.search")
    assert visitor.field("separation_weight").locator("input[type=text]").input_value() == "0"
    visitor.press("Play with the defaults")
    page.wait_for_function("!location.search.includes('separation_weight')")
    wait_until(lambda: button.get_attribute("aria-pressed") == "false")
    visitor.press("Pause")


def test_equations_are_drawn_and_code_is_shown_when_it_is_opened(visit, shots):
    visitor = visit("?model=q_learning")
    page = visitor.page
    page.locator(".swarm-more > summary", has_text="Equations").click()
    equations = page.locator(".swarm-equation math >> visible=true")
    assert equations.count() == 3
    assert all(equations.nth(place).bounding_box()["height"] > 15 for place in range(3))
    too_wide = (
        "[...document.querySelectorAll('.swarm-equation')].filter((one) => one.scrollWidth > one.clientWidth).length"
    )
    assert page.evaluate(too_wide) == 0
    assert page.locator(".swarm-code").count() == 0
    page.locator(".swarm-more > summary", has_text="Code").click()
    page.locator(".swarm-more details summary").first.click()
    code = page.locator(".swarm-code >> visible=true").first
    code.wait_for()
    assert "def learn_and_choose(" in code.inner_text()
    page.screenshot(path=shots / "info.png")


def test_the_panel_follows_the_model_and_can_be_folded(visitor):
    page = visitor.page
    first = page.locator(".swarm-try button").first
    assert first.inner_text() == model_info("fire_fighting").presets[0].label
    visitor.press("Models")
    page.locator(".swarm-card", has_text="Perimeter").click()
    wait_until(lambda: first.inner_text() == model_info("perimeter").presets[0].label)
    page.locator(".swarm-info > summary").click()
    first.wait_for(state="hidden")
