"""Charts in a real browser: kinds, numbers at the pointer and by keys, logarithmic axes, files, and Replay's own."""

import numpy as np
import pytest

from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.models.flocking import Flocking
from support.browsers import recorded_run
from support.visits import add_chart, resize, settle
from support.waiting import wait_until

pytestmark = pytest.mark.long

LINK = "?model=flocking&n_robots=20&seed=1&step=600"
TEXTS = "chart => [...chart.querySelectorAll('ul li b')].map((one) => one.textContent)"
# What of the charts lies beyond the side of the page.
BEYOND = """(() => {
    const side = document.querySelector(".swarm-side").getBoundingClientRect();
    return [...document.querySelectorAll(".swarm-charts *, .swarm-chart *")].filter((one) => {
        const box = one.getBoundingClientRect();
        return box.width && (box.left < side.left - 1 || box.right > side.right + 1);
    }).map((one) => one.className || one.tagName);
})()"""


@pytest.fixture(scope="module")
def flock():
    return Flocking(n_robots=20, rng=1).run(600)


@pytest.fixture
def watched(visit):
    visitor = visit(LINK)
    visitor.wait_for_step(600)
    return visitor


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return recorded_run(tmp_path_factory.mktemp("recordings") / "an evening of fires", 120)


def chart(visitor, title: str):
    return visitor.page.locator(".swarm-chart").filter(has=visitor.page.get_by_text(title, exact=True)).first


def shown(value: float) -> str:
    return f"{float(f'{value:.3g}'):g}"


def test_bold_numbers_are_exact_and_those_at_the_pointer_state_their_steps(watched, flock):
    layers = chart(watched, "Layers that drive")
    shares = [100 * np.mean(flock.swarm.layer == k) for k in (0, 1, 2, -1)]
    wait_until(lambda: layers.evaluate(TEXTS) == [shown(share) for share in shares])
    canvas = layers.locator("canvas")
    canvas.hover()
    readout = layers.locator(".swarm-readout")
    assert readout.locator("strong").inner_text().startswith("mean of steps ")
    assert readout.locator("div").count() == 4
    watched.page.mouse.move(0, 0)
    readout.wait_for(state="hidden")
    assert layers.evaluate(TEXTS) == [shown(share) for share in shares]


def test_keys_go_along_a_chart_and_not_through_the_run(watched):
    alignment, step = chart(watched, "Alignment"), watched.step
    canvas, readout = alignment.locator("canvas"), alignment.locator(".swarm-readout strong")
    canvas.focus()
    for key, words in (
        ("Home", "mean of steps 1 to 4"),
        ("ArrowRight", "mean of steps 5 to 8"),
        ("End", "mean of steps 597 to 600"),
        ("ArrowLeft", "mean of steps 593 to 596"),
    ):
        watched.page.keyboard.press(key)
        assert readout.inner_text() == words
        assert words in canvas.get_attribute("aria-label")
    watched.page.keyboard.press("Escape")
    readout.wait_for(state="hidden")
    assert watched.step == step


def test_histograms_and_phase_plots_are_added_read_and_removed(watched, flock, shots):
    page = watched.page
    add_chart(page, "histogram", "heading")
    add_chart(page, "phase plot", "Polarization", "Alignment")
    histogram, phase = chart(watched, "Histogram of heading"), chart(watched, "Polarization against Alignment")
    wait_until(lambda: histogram.get_attribute("data-points") == "24")
    assert histogram.locator(".swarm-summary").inner_text() == "step 600: 20 robots"
    histogram.locator("canvas").focus()
    counts = []
    for key in ("Home", *("ArrowRight",) * 23):
        page.keyboard.press(key)
        counts.append(int(histogram.locator(".swarm-readout b").inner_text().split()[0]))
    assert counts == np.histogram(np.degrees(flock.swarm.heading), np.arange(-180, 181, 15))[0].tolist()
    phase.locator("canvas").focus()
    page.keyboard.press("End")
    assert phase.locator(".swarm-readout strong").inner_text() == "step 600"
    collected = flock.datacollector.model_vars
    values = [shown(collected[name][-1]) for name in ("alignment", "polarization")]
    assert phase.locator(".swarm-readout b").all_inner_texts() == values == phase.evaluate(TEXTS)
    settle(page)
    assert page.evaluate(BEYOND) == []
    page.screenshot(path=shots / "charts.png")
    watched.press("Models")
    page.wait_for_selector(".swarm-gallery")
    watched.press("Watch")
    wait_until(lambda: page.locator(".swarm-chart").count() == 5)
    watched.press("Remove Histogram of heading")
    wait_until(lambda: page.locator(".swarm-chart").count() == 4)


def test_a_log_axis_is_drawn_or_refused_with_the_reason(watched):
    collisions = chart(watched, "Layers that drive")
    collisions.get_by_role("button", name="Logarithmic y axis of Layers that drive").click()
    note = collisions.locator(".swarm-hint")
    wait_until(lambda: note.inner_text() == "no log axis: the least value is 0")
    add_chart(watched.page, "histogram", "smallest distance reading")
    histogram = chart(watched, "Histogram of smallest distance reading")
    wait_until(lambda: histogram.get_attribute("data-points") is not None)
    before = histogram.locator("canvas").evaluate("canvas => canvas.toDataURL()")
    button = histogram.get_by_role("button", name="Logarithmic x axis of Histogram of smallest distance reading")
    button.click()
    wait_until(lambda: button.get_attribute("aria-pressed") == "true")
    wait_until(lambda: histogram.locator("canvas").evaluate("canvas => canvas.toDataURL()") != before)


def test_a_replay_has_the_charts_and_the_inspector_of_watch(visit, recording, shots, tmp_path):
    visitor = visit()
    page = visitor.page
    visitor.press("Replay")
    page.set_input_files(".swarm-set input[type=file]", recording)
    page.wait_for_selector(".swarm-player[data-step]")
    at_fires = chart(visitor, "Robots at each fire")
    wait_until(lambda: at_fires.get_attribute("data-points") == "120")
    page.get_by_role("slider", name="Steps in memory").press("End")
    visitor.wait("player.step === '120'")
    model = FireFighting(strategy="A", initial_temperature=0.02, rng=4).run(120)
    wait_until(lambda: visitor.reading("Collisions") == f"{model.collisions:,} now, {model.total_collisions:,} in all")
    assert at_fires.evaluate(TEXTS) == [str(robots) for robots in model.fires.robots.tolist()]
    visitor.press("Next robot")
    inspector = page.locator(".swarm-inspector")
    wait_until(lambda: inspector.locator("h2").inner_text() == f"Robot {model.robots[0].unique_id}")
    assert inspector.locator("dt", has_text="Not recorded").count() == 1
    assert not inspector.get_by_role("button", name="Move").is_visible()
    (left, top, right, bottom), (x, y) = (
        page.locator(".swarm-stage canvas").evaluate("canvas => canvas.arena()"),
        (model.robots[3].position),
    )
    x0, y0, x1, y1 = model.map.bounds
    place = {"x": left + (x - x0) / (x1 - x0) * (right - left), "y": bottom - (y - y0) / (y1 - y0) * (bottom - top)}
    page.locator(".swarm-stage canvas").click(position=place)
    wait_until(lambda: inspector.locator("h2").inner_text() == f"Robot {model.robots[3].unique_id}")
    add_chart(page, "histogram", "collisions so far")
    with page.expect_download() as download:
        visitor.press("Download Histogram of collisions so far as CSV")
    download.value.save_as(tmp_path / "table.csv")
    lines = (tmp_path / "table.csv").read_text().splitlines()
    assert sum(int(line.rpartition(",")[2]) for line in lines[1:]) == 10
    for width, height in ((1920, 1080), (390, 844), (1366, 768)):
        resize(page, width, height)
        page.screenshot(path=shots / f"replay_charts_{width}.png")
        assert page.evaluate(BEYOND) == []


def test_reports_of_a_comparison_are_chosen(visit, shots):
    visitor = visit("?model=flocking&n_robots=5&seed=3")
    page = visitor.page
    visitor.press("Compare")
    page.wait_for_selector(".swarm-worlds .swarm-player[data-drawn]")
    page.wait_for_selector("img.swarm-curves")
    before = page.locator("img.swarm-curves").get_attribute("src")
    page.locator(".swarm-reports summary").click()
    page.screenshot(path=shots / "compare_reports.png")
    chosen = page.locator(".swarm-reports button[aria-pressed=true]")
    first = chosen.first.inner_text()
    chosen.first.click()
    wait_until(lambda: chosen.count() == 2)
    page.get_by_role("button", name="Layers that drive: Avoid").click()
    wait_until(lambda: "Layers that drive: Avoid" in chosen.all_inner_texts())
    assert first not in chosen.all_inner_texts()
    assert page.locator(".swarm-reports button:disabled").count() > 0, "there is room for three"
    wait_until(lambda: page.locator("img.swarm-curves").get_attribute("src") != before)
    visitor.press("Watch")
    page.wait_for_selector(".swarm-side")
    visitor.press("Compare")
    page.wait_for_selector("img.swarm-curves")
    page.locator(".swarm-reports summary").click()
    wait_until(lambda: first not in chosen.all_inner_texts())
