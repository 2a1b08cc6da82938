"""Every page against axe-core's rules of accessibility, light and dark, on a telephone, a laptop and a projector."""

import pytest

from mesa_swarm.recording import Recording
from mesa_swarm.viewing.replay_page import replay_page
from support.axe import axe_findings
from support.visits import blank_page, resize

pytestmark = pytest.mark.long

LINK = "?model=fire_fighting&seed=1&step=50"
SIZES = ((390, 844), (1366, 768), (1920, 1080))
THEMES = ("light", "dark")


def findings(page) -> list[tuple]:
    """Return what axe finds in windows of all sizes."""
    found = []
    for size in SIZES:
        resize(page, *size)
        found += [(size, one) for one in axe_findings(page)]
    return found


def with_a_robot(visitor):
    """Select a robot, and return when the inspector has drawn its readings."""
    visitor.wait_for_step(50)
    visitor.press("Next robot")
    visitor.page.wait_for_selector(".swarm-diagram text")
    return visitor


def test_the_first_page_breaks_no_rule(visit):
    visitor = with_a_robot(visit(LINK))
    assert axe_findings(visitor.page) == []


def test_a_busy_page_breaks_no_rule(visitor):
    visitor.page.evaluate("document.querySelector('.v-progress-linear').style.visibility = 'visible'")
    assert axe_findings(visitor.page) == []


@pytest.mark.parametrize("theme", THEMES)
def test_watch_with_a_robot_a_fault_and_an_error_breaks_no_rule(visit, theme):
    visitor = with_a_robot(visit(LINK, color_scheme=theme))
    assert findings(visitor.page) == []
    visitor.field("n_robots").locator("input[type=text]").fill("many")
    visitor.field("n_robots").locator("input[type=text]").press("Enter")
    visitor.page.wait_for_selector(".swarm-field .swarm-fault:not([hidden])")
    assert findings(visitor.page) == []
    stopped = visit("?model=fire_fighting&n_robots=many", color_scheme=theme)
    stopped.page.wait_for_selector(".swarm-trouble")
    assert findings(stopped.page) == []


@pytest.mark.parametrize("theme", THEMES)
def test_models_break_no_rule(visit, theme):
    visitor = visit(LINK, color_scheme=theme)
    visitor.press("Models")
    visitor.page.wait_for_selector(".swarm-card")
    assert findings(visitor.page) == []


@pytest.mark.parametrize("theme", THEMES)
def test_compare_with_its_results_breaks_no_rule(visit, theme):
    visitor = visit("?model=collision_avoidance", color_scheme=theme)
    visitor.press("Compare")
    visitor.page.wait_for_selector("img.swarm-curves")
    assert findings(visitor.page) == []
    for name, value in (("steps", "20"), ("seeds", "5")):
        field = visitor.field(name).locator("input[type=text]")
        field.fill(value)
        field.press("Enter")
    visitor.press("Compare over 5 seeds")
    visitor.page.wait_for_selector("img.swarm-pairs")
    assert findings(visitor.page) == []


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("second", ["(no other)", "noise"])
def test_an_experiment_with_its_results_breaks_no_rule(visit, theme, second):
    visitor = visit("?model=collision_avoidance", color_scheme=theme)
    visitor.press("Experiment")
    visitor.page.wait_for_selector(".swarm-experiment[data-runs='0']")
    assert findings(visitor.page) == []
    visitor.field("q").locator("select").select_option(second)
    for name, value in (("values", "2, 4"), ("q_values", "0, 0.1"), ("steps", "20"), ("seeds", "5")):
        for field in visitor.field(name).locator("input[type=text]").all()[-1:]:
            field.fill(value)
            field.press("Enter")
    visitor.page.locator(".swarm-start .swarm-do").click()
    visitor.page.wait_for_selector(".swarm-start button:has-text('runs are done')")
    visitor.page.locator(".swarm-experiment summary").click()
    visitor.page.locator(".swarm-plot canvas").focus()
    visitor.page.keyboard.press("ArrowRight")
    assert findings(visitor.page) == []


@pytest.mark.parametrize("theme", THEMES)
def test_an_open_info_panel_breaks_no_rule(visit, theme):
    visitor = visit("?model=q_learning", color_scheme=theme)
    for name in ("Equations", "Code"):
        visitor.page.locator(".swarm-more > summary", has_text=name).click()
    visitor.page.locator(".swarm-more details summary").first.click()
    visitor.page.locator(".swarm-code >> visible=true").first.wait_for()
    assert findings(visitor.page) == []


@pytest.mark.parametrize("theme", THEMES)
def test_the_tools_for_editing_break_no_rule(visit, theme):
    visitor = visit(LINK, color_scheme=theme)
    visitor.wait_for_step(50)
    visitor.page.locator(".swarm-edit > summary").click()
    assert findings(visitor.page) == []


@pytest.mark.parametrize("key", ["?", "tour"])
def test_the_list_of_keys_and_the_tour_break_no_rule(visit, key):
    visitor = visit(LINK)
    visitor.wait_for_step(50)
    if key == "?":
        visitor.page.keyboard.press("?")
    else:
        visitor.page.locator(".swarm-header button", has_text="Tour").click()
    visitor.page.wait_for_selector("dialog[open], .swarm-tour")
    assert findings(visitor.page) == []


@pytest.mark.parametrize("theme", THEMES)
def test_replay_of_a_recording_breaks_no_rule(visit, recorded_fires, theme):
    visitor = visit(LINK, color_scheme=theme)
    visitor.press("Replay")
    visitor.page.wait_for_selector(".swarm-set input[type=file]", state="attached")
    assert findings(visitor.page) == []
    visitor.page.set_input_files(".swarm-set input[type=file]", recorded_fires)
    visitor.page.wait_for_selector(".swarm-events button")
    visitor.wait("player.drawn")
    assert findings(visitor.page) == []


@pytest.mark.parametrize("theme", THEMES)
def test_a_page_that_replays_breaks_no_rule(chromium, recorded_fires, tmp_path, theme):
    path = tmp_path / "page.html"
    path.write_text(replay_page(Recording(recorded_fires)), encoding="utf-8")
    page = blank_page(chromium, color_scheme=theme)
    page.goto(path.as_uri())
    page.wait_for_selector("html[data-ready]")
    page.evaluate("mesaSwarmReplay.stage.select(mesaSwarmReplay.stage.frame.ids[0]); mesaSwarmReplay.report(true)")
    assert findings(page) == []
    page.close()


@pytest.mark.parametrize("button", ["Projector", "Full screen"])
def test_a_projectors_page_and_the_world_alone_break_no_rule(visit, button):
    visitor = visit(LINK)
    visitor.press(button)
    assert findings(visitor.page) == []
