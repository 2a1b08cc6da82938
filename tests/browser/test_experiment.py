"""The tab of experiments in a real browser: a grid, its runs, its picture and its files."""

import csv
import tomllib

import pytest

from support.visits import settle
from support.waiting import wait_until

pytestmark = pytest.mark.long

RUNS = "Number(document.querySelector('.swarm-experiment')?.dataset.runs)"


@pytest.fixture
def experiment(visitor):
    visitor.press("Experiment")
    visitor.page.wait_for_selector(".swarm-experiment[data-runs='0']")
    return visitor


def enter(visit, name, text):
    """Type into a field."""
    field = visit.field(name).locator("input[type=text]").last
    field.fill(text)
    field.press("Enter")


def choose(visit, name, option):
    visit.field(name).locator("select").select_option(option)


def start(visit, label):
    """Press the button that starts the runs, as soon as it has this label."""
    visit.page.get_by_role("button", name=label, exact=True).click()


def downloaded(visit, label):
    """Press a button, and return the name and the content of the file that is saved."""
    with visit.page.expect_download() as download:
        visit.press(label)
    with open(download.value.path(), "rb") as file:
        return download.value.suggested_filename, file.read()


def test_an_experiment_is_run_shown_downloaded_and_a_point_of_it_watched(experiment, shots):
    page = experiment.page
    for name, text in {"values": "2, 4, 6", "seeds": "2", "steps": "30"}.items():
        enter(experiment, name, text)
    choose(experiment, "measure", "robots_at_fires (each step)")
    start(experiment, "Run 6 runs")
    page.wait_for_function(f"{RUNS} === 6")
    page.wait_for_selector(".swarm-start button:has-text('All 6 runs are done')")
    name, table = downloaded(experiment, "All runs as CSV")
    assert name == "experiment_fire_fighting.csv"
    rows = list(csv.DictReader(table.decode().splitlines()))
    assert [(row["n_robots"], row["rng"]) for row in rows] == [(n, seed) for n in "246" for seed in "12"]
    name, job = downloaded(experiment, "Job file")
    assert tomllib.loads(job.decode())["grid"] == {"n_robots": [2, 4, 6]}
    assert page.locator(".swarm-files code").inner_text() == f"mesa-swarm sweep {name}"
    name, picture = downloaded(experiment, "Picture as PNG")
    assert (name, picture[:4]) == ("experiment_fire_fighting.png", b"\x89PNG")
    page.screenshot(path=shots / "experiment_curve.png")
    experiment.press("Watch")
    experiment.press("Experiment")
    page.wait_for_function(f"{RUNS} === 6")
    page.locator(".swarm-plot canvas").focus()
    for key in ("ArrowRight", "ArrowRight"):
        page.keyboard.press(key)
    assert page.locator(".swarm-tip b").inner_text() == "robots 4"
    page.keyboard.press("Enter")
    page.wait_for_selector(".swarm-header button[aria-current]:has-text('Watch')")
    wait_until(lambda: "n_robots=4" in page.url and "seed=1" in page.url)


def test_a_heat_map_fills_in_stops_goes_on_and_names_what_it_is_of(experiment, shots):
    page = experiment.page
    enter(experiment, "values", "5, 10, 15")
    choose(experiment, "q", "noise")
    page.wait_for_selector(".swarm-field[data-name=q_values]")
    enter(experiment, "q_values", "0, 0.5, 3")
    for name, text in {"seeds": "6", "steps": "3000"}.items():
        enter(experiment, name, text)
    choose(experiment, "measure", "fires out")
    start(experiment, "Run 54 runs")
    page.wait_for_selector("progress")
    page.wait_for_function(f"{RUNS} >= 2")
    start(experiment, "Stop")
    page.wait_for_selector(".swarm-start button:has-text('Go on with')")
    done = page.evaluate(RUNS)
    assert 2 <= done < 54
    page.screenshot(path=shots / "experiment_stopped.png")
    page.get_by_role("button", name="Go on with").click()
    page.wait_for_function(f"{RUNS} === 54")
    assert "3 of 9 settings have runs that ended in an error: InvalidValueError: noise is 3" in (
        page.locator(".swarm-experiment .swarm-fault").inner_text()
    )
    box = page.locator(".swarm-plot canvas").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    tip = page.locator(".swarm-tip").inner_text()
    assert "robots 10, noise 0.5" in tip
    assert "n = 6: 6 of 6 runs done" in tip
    page.screenshot(path=shots / "experiment_map.png")
    experiment.press("Curves")
    settle(page)
    page.locator(".swarm-experiment summary").click()
    wait_until(lambda: page.locator(".swarm-experiment tbody tr").count() == 9)
    enter(experiment, "seeds", "7")
    page.wait_for_selector(".swarm-stale:not([hidden])")
    assert "9 settings x 6 seeds" in page.locator(".swarm-experiment header").inner_text()
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")


def test_ticks_and_equal_distances_set_the_values_and_a_wrong_one_is_named(experiment):
    page, values = experiment.page, experiment.field("values")
    for label, text in (("from", "2"), ("to", "8"), ("number", "4")):
        field = values.get_by_label(f"values of robots, {label}")
        field.fill(text)
        field.press("Enter")
    wait_until(lambda: values.locator("input").last.input_value() == "2, 4, 6, 8")
    choose(experiment, "p", "strategy")
    page.wait_for_selector(".swarm-ticks")
    values.get_by_label("B", exact=True).uncheck()
    page.wait_for_selector(".swarm-start button:has-text('Run 20 runs')")
    values.get_by_label("A", exact=True).uncheck()
    page.wait_for_selector(".swarm-field[data-name=values].swarm-wrong")
    enter(experiment, "seeds", "5000")
    page.wait_for_selector(".swarm-field[data-name=seeds] .swarm-fault:not([hidden])")


def test_a_late_answer_to_a_tick_does_not_undo_a_later_one(experiment):
    page = experiment.page
    choose(experiment, "p", "strategy")
    page.wait_for_selector(".swarm-ticks")
    page.evaluate(
        """() => {
          const [a, b] = document.querySelectorAll(".swarm-ticks input");
          const { get, set } = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "checked");
          window.ticked = [];
          Object.defineProperty(a, "checked", { get, set(value) { window.ticked.push(value); set.call(a, value); } });
          a.focus();
          b.click();
          a.click();
        }"""
    )
    page.wait_for_selector(".swarm-field[data-name=values].swarm-wrong")
    assert True not in page.evaluate("window.ticked")
    assert [box.is_checked() for box in page.locator(".swarm-ticks input").all()] == [False, False]


def test_a_late_answer_to_one_end_of_a_range_does_not_undo_the_other(experiment):
    page = experiment.page
    texts = page.evaluate(
        """() => {
          const [from, to, number] = document.querySelectorAll("[data-name=values] .swarm-span .swarm-row input");
          const { get, set } = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value");
          window.written = [];
          const enter = (one, text) => { one.focus(); one.value = text; one.dispatchEvent(new Event("change")); };
          enter(from, "2");
          enter(to, "8");
          Object.defineProperty(to, "value", { get, set(value) { window.written.push(value); set.call(to, value); } });
          number.focus();
          return to.value;
        }"""
    )
    values = experiment.field("values")
    wait_until(lambda: values.locator("input").last.input_value().startswith("2, "))
    wait_until(lambda: values.locator("input").last.input_value().endswith(", 8"))
    assert texts == "8"
    assert set(page.evaluate("window.written")) <= {"8"}
