"""The dashboard in a real browser: it plays, its controls work, and nothing leaves the machine."""

import time
from pathlib import Path

import pytest

from mesa_swarm.model.gallery import model_names
from support.visits import Visit
from support.waiting import wait_until

NAMELESS = """[...document.querySelectorAll("button, input, select, summary, canvas")]
    .filter((one) => !one.hidden && !one.getAttribute("aria-label") && !one.textContent.trim() && !one.labels?.length)
    .map((one) => one.outerHTML)"""
FOCUS = """(() => {
  const one = document.activeElement, look = getComputedStyle(one);
  if (one === document.body) return ["the end", "solid", "3px"];
  return [one.getAttribute("aria-label") ?? one.textContent, look.outlineStyle, look.outlineWidth];
})()"""
HALL = b'<svg xmlns="http://www.w3.org/2000/svg" width="800" height="600"><circle cx="400" cy="300" r="80"/></svg>'


def seconds_of_processor(process) -> float:
    ticks = Path(f"/proc/{process.pid}/stat").read_text().rsplit(")")[-1].split()[11:13]
    return sum(map(int, ticks)) / 100


def choose_model(visitor, name: str) -> None:
    visitor.press("Models")
    visitor.page.locator(".swarm-card").filter(has_text=name.replace("_", " ").capitalize()).click()
    visitor.page.wait_for_function(f"location.search.includes('model={name}')")
    visitor.wait_for_step(0)


def hand_over(visitor, name: str, content: bytes) -> None:
    file = {"name": name, "mimeType": "image/svg+xml", "buffer": content}
    visitor.page.set_input_files(".swarm-panel input[type=file]", file)


@pytest.mark.slow
def test_every_model_of_the_gallery_plays_pauses_steps_and_resets(visitor):
    for name in model_names():
        choose_model(visitor, name)
        visitor.press("Play")
        visitor.wait("+player.step > 5")
        visitor.press("Pause")
        visitor.wait("player.rest === 'true'")
        before = visitor.step
        visitor.press("Step")
        visitor.wait_for_step(before + 1)
        visitor.press("Step back")
        visitor.wait_for_step(before)
        visitor.press("Reset")
        visitor.wait_for_step(0)


@pytest.mark.slow
def test_a_page_comes_whole_although_its_extension_does_not_know_the_widgets_script(server, chromium):
    """It configures that when it is loaded, which may be after the widgets."""
    context = chromium.new_context()
    context.route(
        "**/anywidget/extension.js*", lambda route: route.fulfill(body="define({});", content_type="text/javascript")
    )
    visit = Visit(context, server[1])
    assert visit.step == 0
    context.close()
    assert visit.complaints == []


@pytest.mark.slow
def test_what_is_being_typed_is_not_replaced_when_the_page_has_news(visitor):
    robots, seed = (visitor.field(name).locator("input[type=text]") for name in ("n_robots", "seed"))
    robots.fill("12")
    before = seed.input_value()
    visitor.page.get_by_role("button", name="Random", exact=True).evaluate("button => button.click()")
    wait_until(lambda: seed.input_value() != before)
    assert robots.input_value() == "12"
    robots.press("Enter")
    wait_until(lambda: visitor.reading("Robots at fires").endswith("of 12"))
    assert robots.input_value() == "12"


@pytest.mark.slow
def test_a_seed_that_is_typed_gives_the_same_frames_again_after_a_reset(visitor):
    seed = visitor.field("seed").locator("input")
    seed.fill("7")
    seed.press("Enter")
    visitor.page.wait_for_function("location.search.includes('seed=7')")
    runs = []
    for _ in range(2):
        visitor.press("Reset")
        visitor.wait_for_step(0)
        frames = []
        for step in range(1, 6):
            visitor.press("Step")
            visitor.wait_for_step(step)
            frames.append((visitor.about("fingerprint"), visitor.image()))
        runs.append(frames)
    assert runs[0] == runs[1]
    assert len({fingerprint for fingerprint, _ in runs[0]}) == 5
    assert "seed=7" in visitor.page.url


@pytest.mark.slow
def test_a_link_shows_the_same_state_again(visit):
    first = visit("?model=flocking&n_robots=30&sight=80.0&seed=11")
    for step in range(1, 4):
        first.press("Step")
        first.wait_for_step(step)
    first.page.wait_for_function("location.search.includes('step=3')")
    second = visit(first.page.url.partition("?")[1] + first.page.url.partition("?")[2])
    second.wait_for_step(3)
    assert second.about("fingerprint") == first.about("fingerprint")
    assert second.reading("Robots") == "30"


def test_wrong_values_in_a_link_are_reported_and_unknown_words_are_not(visit):
    visitor = visit("?model=fire_fighting&utm_source=mail&n_robots=many")
    assert "n_robots is 'many'" in visitor.page.locator(".swarm-trouble").inner_text()
    visitor.press("Continue")
    visitor.page.wait_for_selector(".swarm-trouble", state="detached")
    assert "utm_source" not in visitor.page.url


def test_sliders_change_the_run_at_once_and_what_belongs_to_its_beginning_waits_for_apply(visitor):
    for step in (1, 2):
        visitor.press("Step")
        visitor.wait_for_step(step)
    visitor.field("n_robots").get_by_role("slider").press("ArrowRight")
    wait_until(lambda: visitor.reading("Robots at fires").endswith("of 11"))
    visitor.open_group("Fires and heat")
    k1 = visitor.field("k1")
    k1.get_by_role("slider").press("End")
    wait_until(lambda: k1.locator("input[type=text]").input_value() == "0.003")
    visitor.page.wait_for_function("location.search.includes('k1=0.003') || location.search.includes('k1%2C0.003')")
    assert visitor.page.locator(".swarm-waits").count() == 0
    assert visitor.step == 2
    visitor.field("initial_temperature").get_by_role("slider").press("ArrowLeft")
    visitor.page.wait_for_selector(".swarm-field[data-name=initial_temperature] .swarm-waits")
    visitor.press("Apply")
    visitor.wait_for_step(0)
    visitor.page.get_by_role("button", name="Reset", exact=True).wait_for()
    assert visitor.page.locator(".swarm-waits").count() == 0


def test_an_impossible_value_is_reported_beside_the_control(visitor):
    visitor.open_group("Fires and heat")
    join = visitor.field("join")
    join.get_by_role("slider").press("End")
    wait_until(lambda: "expected join below leave" in join.locator(".swarm-fault").inner_text())
    join.get_by_role("slider").press("Home")
    join.locator(".swarm-fault").wait_for(state="hidden")
    robots = visitor.field("n_robots").locator("input[type=text]")
    robots.fill("20000")
    robots.press("Enter")
    wait_until(lambda: "at most 10000" in visitor.field("n_robots").locator(".swarm-fault").inner_text())


@pytest.mark.slow
def test_required_properties_set_the_constants_and_warn_live(visitor):
    visitor.open_group("Design the constants")
    visitor.open_group("Fires and heat")
    visitor.field("robots").get_by_role("slider").press("Home")
    wait_until(lambda: visitor.page.locator(".swarm-notes .swarm-warning").count() > 0)
    assert "one robot suffices" in visitor.page.locator(".swarm-warning").first.inner_text()
    growth = visitor.field("growth_time").get_by_role("slider")
    growth.press("Home")
    wait_until(lambda: visitor.field("k1").locator("input[type=text]").input_value() == "0.006931")


@pytest.mark.slow
def test_keys_play_and_step_but_not_while_one_types(visitor):
    press = visitor.page.keyboard.press
    press("ArrowRight")
    visitor.wait_for_step(1)
    press("ArrowRight")
    visitor.wait_for_step(2)
    press("ArrowLeft")
    visitor.wait_for_step(1)
    press("r")
    visitor.wait_for_step(0)
    press(" ")
    visitor.wait("player.playing === 'true' && +player.step > 3")
    press(" ")
    visitor.wait("player.rest === 'true'")
    press("r")
    visitor.wait_for_step(0)
    seed = visitor.field("seed").locator("input")
    seed.focus()
    seed.press("ArrowRight")
    seed.press(" ")
    assert (visitor.step, visitor.about("playing")) == (0, "false")


@pytest.mark.slow
def test_a_slider_or_a_box_that_was_touched_takes_only_the_keys_that_move_it(visitor):
    press = visitor.page.keyboard.press
    robots = visitor.field("n_robots").get_by_role("slider")
    robots.click()
    visitor.page.wait_for_function("location.search.includes('n_robots=')")
    before = robots.input_value()
    press("ArrowLeft")
    wait_until(lambda: robots.input_value() != before)  # news of the click may come between
    press(" ")
    visitor.wait("player.playing === 'true' && +player.step > 3")
    press(" ")
    visitor.wait("player.rest === 'true'")
    press("r")
    visitor.wait_for_step(0)
    visitor.page.locator(".swarm-tools summary").click()
    sectors = visitor.page.get_by_label("Sensor sectors")
    sectors.uncheck()
    press(" ")
    visitor.wait("player.playing === 'true' && +player.step > 3")
    assert not sectors.is_checked()


@pytest.mark.slow
def test_a_map_is_uploaded_and_another_file_is_refused_in_one_line(visit):
    visitor = visit("?model=boids")
    visitor.page.set_input_files(
        ".swarm-panel input[type=file]", {"name": "hall.svg", "mimeType": "image/svg+xml", "buffer": HALL}
    )
    wait_until(lambda: visitor.field("map").locator("select").input_value() == "hall")
    visitor.wait_for_step(0)
    hand_over(visitor, "hall.svg", b"<svg")
    wait_until(lambda: visitor.field("map").locator(".swarm-fault").inner_text().startswith("hall.svg: line 1"))
    hand_over(visitor, "large.svg", b" " * 1_000_001)
    wait_until(lambda: "expected at most 1,000,000" in visitor.field("map").locator(".swarm-fault").inner_text())


@pytest.mark.slow
def test_only_maps_on_which_the_model_can_be_built_are_offered(visitor):
    offered = visitor.field("map").locator("option").all_inner_texts()
    assert offered == ["openspace_fire"]


@pytest.mark.slow
def test_a_model_that_cannot_be_built_shows_a_card_with_a_way_back(visitor):
    hand_over(visitor, "hall.svg", HALL)
    card = visitor.page.locator(".swarm-trouble")
    wait_until(lambda: "map hall has no fires" in card.inner_text())
    card.get_by_role("button").click()
    card.wait_for(state="detached")
    visitor.press("Step")
    visitor.wait_for_step(1)


def test_a_robot_is_selected_by_a_click_and_followed(visit):
    visitor = visit("?model=boids")
    follow = visitor.page.get_by_role("button", name="Follow the selected robot")
    before = visitor.image()
    follow.click()
    assert follow.get_attribute("aria-pressed") == "true"
    assert visitor.image() != before
    visitor.press("Show the whole map")
    assert follow.get_attribute("aria-pressed") == "false"


@pytest.mark.slow
def test_everything_is_in_sight_on_a_small_laptop_and_has_a_name(visitor):
    page = visitor.page
    for selector in (".swarm-stage canvas", ".swarm-buttons", ".swarm-readings", ".swarm-past", ".swarm-theme"):
        box = page.locator(selector).bounding_box()
        assert min(box["x"], box["y"]) >= 0
        assert box["x"] + box["width"] <= 1366
        assert box["y"] + box["height"] <= 768
    assert page.locator(".swarm-stage canvas").bounding_box()["height"] > 550
    assert page.evaluate("document.documentElement.scrollHeight <= innerHeight")
    nameless = page.evaluate(NAMELESS)
    assert nameless == []


@pytest.mark.slow
def test_everything_is_reached_by_the_tab_key_and_shows_that_it_was(visitor):
    page = visitor.page
    reached, unseen = [], []
    for _ in range(60):
        page.keyboard.press("Tab")
        name, style, width = page.evaluate(FOCUS)
        reached.append(name)
        if style != "solid" or float(width.removesuffix("px")) < 2:
            unseen.append(name)
    assert {"Models", "Play", "Step", "Reset", "Speed", "robots", "strategy", "Random", "Zoom in"} <= set(reached)
    assert reached.index("Models") < reached.index("Random") < reached.index("Play") < reached.index("Zoom in")
    assert unseen == []


def hear_all(visitor) -> None:
    """Wait until Python has answered a message that is sent after all others."""
    speed = visitor.page.locator(".swarm-speed")
    before = speed.locator("output").inner_text()
    speed.get_by_role("slider").press("ArrowLeft")
    wait_until(lambda: speed.locator("output").inner_text() != before)


@pytest.mark.slow
def test_play_and_pause_pressed_quickly_leave_it_as_the_last_one_requests(visitor):
    for _ in range(15):
        visitor.page.keyboard.press(" ")
    hear_all(visitor)
    visitor.wait("player.playing === 'true' && +player.step > 3")
    visitor.page.keyboard.press(" ")
    hear_all(visitor)
    visitor.wait("player.rest === 'true'")
    at_rest = visitor.step
    visitor.press("Step")
    visitor.wait_for_step(at_rest + 1)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processor time is read from /proc, which is missing")
def test_a_page_that_is_closed_plays_no_more(visitor, server):
    visitor.press("Play")
    visitor.wait("+player.step > 20")
    visitor.page.close()

    def is_idle() -> bool:
        before = seconds_of_processor(server[0])
        time.sleep(0.5)
        return seconds_of_processor(server[0]) - before < 0.05

    wait_until(is_idle)


PLAYED = """async (pictures) => {
  const { stage } = document.querySelector(".swarm-stage canvas"), show = stage.show.bind(stage), steps = [];
  stage.show = (frame) => (steps.push(frame.step), show(frame));
  document.querySelector(".swarm-main").click();
  while (steps.length < pictures) await new Promise((done) => setTimeout(done, 20));
  stage.show = show;
  return steps;
}"""


@pytest.mark.slow
def test_pictures_are_drawn_in_order_each_once_and_the_last_one_at_rest(visitor):
    steps = visitor.page.evaluate(PLAYED, 60)
    assert steps == sorted(set(steps))
    visitor.press("Pause")
    visitor.wait("player.rest === 'true'")
    last = visitor.step
    assert last >= steps[-1]
    visitor.press("Step")
    visitor.wait_for_step(last + 1)
