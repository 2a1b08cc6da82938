"""A live page in a browser: from disk, without a request, with the bits of Python; its buttons, sliders and widths."""

import pytest

from mesa_swarm import SwarmModel, disc
from mesa_swarm.live.live_page import LivePage
from mesa_swarm.models.best_of_n import BestOfN
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.models.foraging import Foraging
from mesa_swarm.recording.continuing import continued
from support.axe import axe_findings
from support.visits import blank_page
from support.waiting import wait_until

pytestmark = pytest.mark.slow

STATE = "(async () => { await swarm.ready; return [swarm.steps, swarm.hash()]; })()"


@pytest.fixture(scope="module")
def fires(tmp_path_factory):
    """The path of a page on which robots fight fires."""
    return FireFighting(rng=1).export(tmp_path_factory.mktemp("live") / "fires.html", live=True, seeds=3)


@pytest.fixture
def opened(chromium, fires):
    """Open the page; nothing may be requested besides it, and nothing complained of."""
    pages, asked, complaints = [], [], []

    def open_page(address="", path=fires, **looks):
        page = blank_page(chromium, **looks)
        page.on("request", lambda request: asked.append(request.url))
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(f"{path.as_uri()}{address}")
        page.locator("html[data-ready]").wait_for(state="attached")
        pages.append(page)
        return page

    yield open_page
    for page in pages:
        page.close()
    assert complaints == []
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []


def run_to(page, steps):
    page.evaluate(f"swarm.ready.then(() => swarm.step({steps} - swarm.steps))")
    return page.evaluate(STATE)


def test_its_fingerprint_is_that_of_python_for_every_seed(opened):
    page = opened()
    for seed in (1, 2, 3):
        page.evaluate(f"swarm.ready.then(() => swarm.reset({{ seed: {seed} }}))")
        model = FireFighting(rng=seed)
        for steps in (1, 100, 1000):
            model.run(steps - model.steps)
            assert run_to(page, steps) == [model.steps, model.state_hash()]


def test_it_plays_pauses_takes_steps_and_begins_anew(opened):
    page = opened()
    page.keyboard.press("Space")
    wait_until(lambda: page.evaluate("swarm.steps") > 20)
    page.locator("#play").click()
    steps = page.evaluate("swarm.steps")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("swarm.steps") == steps + 1
    page.keyboard.press("r")
    assert page.evaluate("swarm.steps") == 0
    assert page.locator("#step").text_content() == "0"


def test_a_run_that_ends_is_reported_and_begins_again(opened):
    page = opened()
    page.evaluate("swarm.ready.then(() => swarm.step(5000))")
    assert "The run has ended at step 1,596." in page.locator("#over").text_content()
    page.locator("#over button").click()
    assert page.evaluate("swarm.steps") == 0
    assert page.locator("#over").is_hidden()


def test_a_slider_changes_what_it_changes_in_python(opened):
    page = opened()
    run_to(page, 100)
    page.locator("#set-k1").evaluate("(slider) => { slider.value = 0.001; slider.dispatchEvent(new Event('input')); }")
    model = continued(FireFighting(rng=1).run(100), k1=page.evaluate("swarm.parameters.k1"))
    assert model.given[1]["k1"] != FireFighting(rng=1).given[1].get("k1")
    assert run_to(page, 300) == [300, model.run(200).state_hash()]


def test_the_address_holds_seed_and_parameters(opened):
    page = opened("#seed=2&strategy=A&k4=0.5")
    assert page.evaluate("[swarm.parameters.strategy, swarm.parameters.k4]") == ["A", 0.5]
    assert run_to(page, 200) == [200, FireFighting(rng=2, strategy="A", k4=0.5).run(200).state_hash()]
    page.locator("#set-strategy").select_option("B")
    assert "strategy" not in page.evaluate("location.hash")


@pytest.mark.parametrize(("address", "complaint"), [
    ("#seed=77", "seed is 77; this page has 1, 2, 3"),
    ("#k1=5", "k1 is 5; expected a number from 0.0001 to 0.003"),
    ("#strategy=C", "strategy is C; expected"),
    ("#n_robots=3", "n_robots is 3; this page can begin with 1, 5, 10, 20, 50"),
    ("#communication=state", "it acts from the beginning of a run"),
    ("#nonsense=3", "there is no such parameter"),
])  # fmt: skip
def test_what_an_address_asks_in_vain_is_reported(opened, address, complaint):
    assert complaint in opened(address).locator("#notes").text_content()


def test_a_click_on_a_robot_explains_it(opened):
    page = opened()
    run_to(page, 50)
    place = page.evaluate("""() => {
      const [x, y] = swarm.column("position");
      const box = document.querySelector("#world").getBoundingClientRect();
      const [px, py] = swarm.stage.toCanvas(x, y);
      return [box.left + px, box.top + py];
    }""")
    page.mouse.click(*place)
    facts = page.locator("#robot").inner_text()
    assert "Robot" in facts
    assert "layer" in facts
    page.locator("#robot summary").click()
    page.locator("#robot-columns dt").first.wait_for()
    assert "tendency" in page.locator("#robot-columns").inner_text()


@pytest.mark.parametrize("looks", [
    {"viewport": {"width": 390, "height": 844}, "color_scheme": "dark"},
    {"viewport": {"width": 1366, "height": 768}, "color_scheme": "light"},
    {"viewport": {"width": 1920, "height": 1080}, "color_scheme": "dark"},
], ids=lambda looks: str(looks["viewport"]["width"]))  # fmt: skip
def test_it_fits_its_window_and_is_accessible(opened, shots, looks):
    page = opened(**looks)
    run_to(page, 400)
    assert not page.evaluate("document.documentElement.scrollWidth > innerWidth")
    assert axe_findings(page) == []
    page.screenshot(path=shots / f"live_{looks['viewport']['width']}.png")


def test_memory_does_not_grow_while_it_runs(opened):
    page = opened()
    page.evaluate("swarm.ready.then(() => { for (let k = 0; k < 20; k++) { swarm.reset(); swarm.step(1500); } })")
    before = page.evaluate("swarm.memory")
    page.evaluate("swarm.ready.then(() => { for (let k = 0; k < 100; k++) { swarm.reset(); swarm.step(1500); } })")
    assert page.evaluate("swarm.memory") == before


def test_names_of_a_model_are_texts(tmp_path, opened):
    name = "</script><img src=x onerror=alert(1)>"
    model_class = type(name, (SwarmModel,), {"__doc__": "</script><b>bold</b>"})
    page = opened(path=model_class(rng=1).export(tmp_path / "odd.html", live=True, seeds=1))
    assert page.locator("img").count() == 0


def test_a_model_with_radio_and_own_sensors_ends_as_in_python(tmp_path, opened):
    page = opened(path=BestOfN(n_robots=15, rng=4).export(tmp_path / "sites.html", live=True, seeds=1))
    model = BestOfN(n_robots=15, rng=4).run(3000)
    assert run_to(page, 3000) == [model.steps, model.state_hash()]


def test_a_page_has_no_more_than_400_kb_with_twenty_seeds_of_fifty_robots():
    assert len(LivePage(FireFighting(n_robots=50, rng=1)).text()) < 400_000


def test_it_begins_with_another_number_of_robots(opened):
    page = opened("#n_robots=20")
    assert page.evaluate("swarm.parameters.n_robots") == 20
    assert run_to(page, 300) == [300, FireFighting(n_robots=20, rng=1).run(300).state_hash()]
    page.locator("#set-n_robots").select_option("5")
    assert page.evaluate("[swarm.steps, swarm.parameters.n_robots]") == [0, 5]
    assert run_to(page, 300) == [300, FireFighting(n_robots=5, rng=1).run(300).state_hash()]
    assert "n_robots=5" in page.evaluate("location.hash")


def test_a_fire_is_put_out_and_lit_again_by_its_button(opened):
    page, model = opened(), FireFighting(rng=1).run(100)
    run_to(page, 100)
    button = page.locator("#fires button").nth(1)
    assert button.text_content() == "Put out"
    button.click()
    model.fires[1].put_out()
    assert (button.text_content(), page.evaluate(STATE)) == ("Light", [100, model.state_hash()])
    page.keyboard.press("ArrowRight")
    button.focus()
    page.keyboard.press("Enter")
    model.run(1).fires[1].light()
    assert (button.text_content(), page.evaluate(STATE)) == ("Put out", [101, model.state_hash()])


def test_events_are_counted_among_the_readings(tmp_path, opened):
    model = Foraging(n_robots=8, rng=2)
    page = opened(path=model.export(tmp_path / "foraging.html", live=True, seeds=0))
    run_to(page, 600)
    model.run(600)
    assert page.evaluate("swarm.events.counts") == [model.events.count("delivered")]
    shown = page.locator("#readings li", has_text="events: delivered").locator("b").text_content()
    assert shown == str(model.events.count("delivered"))
    last = page.evaluate("swarm.events.last.at(-1)")
    step, name, robot, value = model.events.rows()[-1]
    assert last == {"step": step, "name": name, "robot": robot, "value": value}


def place_on_page(page, x, y):
    """Return where a place of the map is in the window."""
    return page.evaluate(
        """([x, y]) => {
      const box = document.querySelector("#world").getBoundingClientRect(), [px, py] = swarm.stage.toCanvas(x, y);
      return [box.left + px, box.top + py];
    }""",
        [x, y],
    )


def test_discs_are_drawn_with_the_pointer_and_taken_away_by_a_click(opened, shots):
    page, model = opened(), FireFighting(rng=1).run(100)
    run_to(page, 100)
    page.keyboard.press("d")
    page.mouse.move(*place_on_page(page, 560, 420))
    page.mouse.down()
    page.mouse.move(*place_on_page(page, 590, 420), steps=3)
    page.mouse.up()
    [[_, x, y, radius]] = page.evaluate("swarm.discs")
    assert max(abs(x - 560), abs(y - 420), abs(radius - 30)) < 2
    obstacle = model.add_obstacle(disc((x, y), radius))
    assert page.evaluate(STATE) == [100, model.state_hash()]
    assert run_to(page, 400) == [400, model.run(300).state_hash()]
    page.screenshot(path=shots / "live_discs.png")
    page.mouse.click(*place_on_page(page, x, y))
    obstacle.remove()
    assert page.evaluate("[swarm.discs, swarm.stage.world.shapes.length]") == [[], 4]
    assert page.evaluate(STATE) == [400, model.state_hash()]


def test_discs_are_added_and_taken_away_by_the_keyboard_and_are_gone_after_a_reset(opened):
    page, model = opened(), FireFighting(rng=1)
    for name, value in (("x", "300"), ("y", "200"), ("radius", "25")):
        page.locator(f"#disc input[name={name}]").fill(value)
    page.keyboard.press("Enter")
    model.add_obstacle(disc((300, 200), 25))
    assert page.evaluate(STATE) == [0, model.state_hash()]
    assert "7 more can be added" in page.locator("#blocking").inner_text()
    assert "300, 200; radius 25" in page.locator("#discs").inner_text()
    assert axe_findings(page) == []
    page.evaluate("swarm.reset()")
    assert page.locator("#discs li").count() == 0
    assert page.evaluate(STATE) == [0, FireFighting(rng=1).state_hash()]


def test_a_disc_where_a_robot_is_is_refused_in_one_line(opened):
    page = opened()
    x, y = page.evaluate("[...swarm.column('position').slice(0, 2)]")
    for name, value in (("x", x), ("y", y)):
        page.locator(f"#disc input[name={name}]").fill(str(value))
    page.locator("#disc button").click()
    assert "a robot is in the way of the disc at" in page.locator("#notes").text_content()
    assert page.evaluate("swarm.discs") == []


def test_a_radius_that_is_none_does_not_stop_what_plays(opened):
    page = opened()
    page.locator("#disc input[name=radius]").fill("-5")
    page.locator("#place").click()
    page.locator("#play").click()
    page.mouse.move(*place_on_page(page, 560, 420))
    page.mouse.down()
    before = page.evaluate("swarm.steps")
    wait_until(lambda: page.evaluate("swarm.steps") > before + 10)
    page.mouse.up()
    assert "radius is 0; expected a number above 0" in page.locator("#notes").text_content()


def test_the_focus_goes_to_the_next_disc_when_one_is_taken_away_by_its_button(opened):
    page = opened()
    page.evaluate("swarm.addDisc(560, 420, 20), swarm.addDisc(560, 120, 20)")
    page.locator("#discs button").first.focus()
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.dataset.disc") == page.locator("#discs button").get_attribute(
        "data-disc"
    )
    page.keyboard.press("Enter")
    assert page.evaluate("document.activeElement.textContent") == "Add"


def test_a_disc_that_is_being_drawn_when_the_run_begins_anew_is_forgotten(opened):
    page = opened()
    page.locator("#place").click()
    page.mouse.move(*place_on_page(page, 560, 420))
    page.mouse.down()
    page.keyboard.press("r")
    page.mouse.up()
    assert page.evaluate("swarm.discs") == []


def test_a_page_without_discs_leaves_the_tool_that_moves_robots_when_it_begins_anew(tmp_path, opened):
    page = opened(path=Foraging(n_robots=8, rng=2).export(tmp_path / "foraging.html", live=True, seeds=0))
    page.locator("#hand").click()
    page.locator("#reset").click()
    assert page.locator("#hand").get_attribute("aria-pressed") == "true"
    assert page.locator("#place").is_hidden()
