"""A model in outputs of a notebook, in a real browser: views, sizes, a kernel that is gone, a stored picture."""

import re

import pytest

from mesa_swarm.dashboard.page.controls import ControlPanel
from mesa_swarm.dashboard.run.charts import ChartBoard
from mesa_swarm.dashboard.run.inspector import Inspector
from mesa_swarm.models.fire_fighting import FireFighting
from support.notebooks import FakeNotebook
from support.visits import blank_page, settle

pytestmark = pytest.mark.slow

LONGER = "(all) => all.forEach((one) => (one.textContent += ' 123,456'))"
SIZE = "(one, [width, height]) => { one.style.width = `${width}px`; one.style.height = `${height}px`; }"
OVERFLOWING = "(all) => all.filter((one) => one.scrollWidth > one.clientWidth).map((one) => one.className)"
IMAGE = "(one) => one.querySelector('canvas').toDataURL()"
# Every edge of the readings and of what stands below them, and whether anything is wider or higher than the output.
PLACES = """(one) => {
  const place = (name) => one.querySelector(name).getBoundingClientRect();
  const readings = place(".swarm-readings"), stage = place(".swarm-stage"), past = place(".swarm-past");
  const fits = one.scrollWidth <= one.clientWidth && one.scrollHeight <= one.clientHeight;
  return {
    lines: Math.round(readings.height / 20), gap: stage.top - readings.bottom, stage: stage.height,
    inside: fits && past.bottom <= one.getBoundingClientRect().bottom + 0.5,
  };
}"""
PANELS = """async ({ scripts, traits }) => {
  const nothing = () => {}, box = (name, ...children) => {
    const one = document.createElement("div");
    one.className = `widget-box ${name}`;
    one.append(...children);
    return one;
  };
  const shown = await Promise.all(scripts.map(async (script, k) => {
    const { default: widget } = await import(URL.createObjectURL(new Blob([script], { type: "text/javascript" })));
    const el = document.createElement("div");
    widget.render({ model: { get: (name) => traits[k][name], on: nothing, off: nothing, send: nothing }, el });
    return el;
  }));
  const output = document.querySelector(".output"), player = output.firstChild;
  const beside = box("swarm-beside", box("swarm-set", shown[0]), box("swarm-side", ...shown.slice(1)));
  const view = box("swarm-notebook", box("swarm-arranged", player, beside));
  view.style.cssText = "height: 100%; max-width: 100%";
  output.append(view);
}"""


@pytest.fixture
def page(chromium):
    opened = blank_page(chromium, viewport={"width": 1500, "height": 1200})
    complaints = []
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    yield opened
    opened.close()
    assert complaints == []


@pytest.fixture
def notebook(page):
    return FakeNotebook(page, FireFighting(n_robots=5, rng=1).show())


class Broken(FireFighting):
    """Its second step fails."""

    def step(self):
        super().step()
        if self.steps == 2:
            raise ZeroDivisionError("nothing left to share")


def test_why_a_model_stopped_is_shown_above_it(page):
    notebook = FakeNotebook(page, Broken(n_robots=5, rng=1).show())
    view = notebook.open_view()
    notebook.wait(view, "player.rest === 'true'")
    assert view.locator(".swarm-error").is_hidden()
    for step in (1, 2):
        press(view, "Step")
        notebook.wait(view, f"player.step === '{step}' || one.querySelector('.swarm-error:not([hidden])')")
    shown = view.locator(".swarm-error").inner_text()
    assert re.fullmatch(r"test_notebook\.py, line \d+: ZeroDivisionError: nothing left to share", shown)
    assert view.get_by_role("button", name="Play", exact=True).is_disabled()


def data_of(view) -> dict:
    found = view.evaluate("(one) => ({ ...one.dataset })")
    return {name: found[name] for name in ("step", "playing", "rest", "fingerprint")}


def press(view, label: str) -> None:
    view.get_by_role("button", name=label, exact=True).click()


def test_a_second_view_shows_the_true_state_also_when_it_opens_while_the_model_is_played(notebook):
    first = notebook.open_view()
    notebook.wait(first, "player.rest === 'true'")
    press(first, "Step")
    first.get_by_role("slider", name="Speed").fill("3")
    notebook.wait(first, "player.step === '1' && player.rest === 'true'")
    notebook.canvas.selected = 3
    second = notebook.open_view()
    notebook.wait(second, "player.rest === 'true'")
    assert data_of(second) == data_of(first)
    assert second.evaluate(IMAGE) == first.evaluate(IMAGE)
    assert second.locator(".swarm-speed output").inner_text() == "5 steps/s"
    press(second, "Play")
    notebook.wait(first, "player.playing === 'true'")
    third = notebook.open_view()
    notebook.wait(third, "player.playing === 'true' && Number(player.step) > 1")
    press(first, "Pause")
    for view in (first, second, third):
        notebook.wait(view, "player.rest === 'true'")
    assert data_of(third) == data_of(second) == data_of(first)
    third.evaluate("(one) => one.stop()")
    notebook.exchange()
    assert len(notebook.canvas._views) == 2


def test_a_robot_that_is_chosen_in_one_view_is_chosen_in_all(notebook):
    views = [notebook.open_view() for _ in range(2)]
    for view in views:
        notebook.wait(view, "player.rest === 'true'")
    before = views[1].evaluate(IMAGE)
    press(views[0], "Follow the selected robot")
    notebook.exchange()
    notebook.exchange()
    assert notebook.canvas.selected is not None
    notebook.page.wait_for_function(
        "(before) => document.querySelectorAll('.output canvas')[1].toDataURL() !== before", arg=before
    )


def test_keys_pressed_in_an_output_are_the_players_and_not_those_of_the_notebook(notebook):
    view = notebook.open_view()
    notebook.wait(view, "player.rest === 'true'")
    view.locator("canvas").focus()
    assert view.locator("canvas").get_attribute("data-lm-suppress-shortcuts") == "true", "on what has the focus itself"
    notebook.page.keyboard.press("ArrowRight")
    notebook.wait(view, "player.step === '1' && player.rest === 'true'")


def test_a_kernel_that_is_gone_is_stated_over_the_picture_and_no_button_works(notebook, shots):
    view = notebook.open_view()
    notebook.wait(view, "player.rest === 'true'")
    image = view.evaluate(IMAGE)
    notebook.page.evaluate("kernel.set_live(false)")
    assert view.get_by_role("alert").inner_text() == "The kernel is gone: run the cell again"
    assert view.evaluate(IMAGE) == image
    notebook.page.screenshot(path=shots / "notebook_gone.png")
    assert view.locator("button, input, summary").evaluate_all("all => all.every((one) => one.closest('[inert]'))")
    notebook.page.evaluate("kernel.set_live(true)")
    assert view.get_by_role("alert").count() == 0
    press(view, "Step")
    notebook.wait(view, "player.step === '1' && player.rest === 'true'")


@pytest.mark.parametrize("end", ["kernel.statusChanged.emit('autorestarting')", "kernel.disposed.emit()"])
def test_a_kernel_that_died_or_was_shut_down_is_gone_too(notebook, end):
    view = notebook.open_view()
    notebook.wait(view, "player.rest === 'true'")
    notebook.page.evaluate("kernel.statusChanged.emit('busy')")
    assert view.get_by_role("alert").count() == 0
    notebook.page.evaluate(end)
    assert view.get_by_role("alert").inner_text() == "The kernel is gone: run the cell again"
    view.evaluate("(one) => one.stop()")
    notebook.page.evaluate(end)


def test_without_a_kernel_the_stored_picture_is_shown(page, shots):
    canvas = FireFighting(n_robots=5, rng=1).show()
    canvas._repr_mimebundle_()
    view = FakeNotebook(page, canvas, live=False).open_view()
    picture = view.locator(".swarm-still")
    page.wait_for_function("document.querySelector('.swarm-still').naturalWidth > 500")
    assert picture.is_visible()
    assert view.get_by_role("alert").inner_text() == "The last picture, without a kernel: run the cell to play"
    page.screenshot(path=shots / "notebook_stored.png")


def test_the_stored_picture_gives_way_to_the_world(page):
    canvas = FireFighting(n_robots=5, rng=1).show()
    canvas._repr_mimebundle_()
    notebook = FakeNotebook(page, canvas)
    view = notebook.open_view()
    notebook.wait(view, "player.rest === 'true'")
    assert not view.locator(".swarm-still").is_visible()


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_at_every_size_the_readings_have_one_line_and_the_world_has_its_place(notebook, theme, shots):
    notebook.page.emulate_media(color_scheme=theme)
    view = notebook.open_view()
    notebook.wait(view, "player.rest === 'true'")
    output = view.locator("..")
    for width in (360, 500, 700, 1000, 1400):
        for height, least in ((300, 150), (560, 400)):
            output.evaluate(SIZE, [width, height])
            settle(notebook.page)
            places = view.evaluate(PLACES)
            assert (places["lines"], places["inside"]) == (1, True), (width, height)
            assert places["gap"] >= 0
            assert places["stage"] >= least, (width, height)
            output.screenshot(path=shots / f"notebook_{theme}_{width}x{height}.png")
            view.locator(".swarm-readings dd").evaluate_all(LONGER)
            assert view.evaluate(PLACES)["stage"] == places["stage"]
            press(view, "Step")
            notebook.wait(view, "player.rest === 'true' && !one.querySelector('dd').textContent.includes('123,456')")


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_panels_stand_beside_the_world_or_below_it_by_the_width_of_the_output(page, theme, shots):
    page.emulate_media(color_scheme=theme)
    shown = FireFighting(n_robots=5, rng=1).show(controls=True, charts=True, inspector=True)
    shown.session.select(shown.model.robots[0].unique_id)
    shown.session.step()
    notebook = FakeNotebook(page, shown.canvas)
    view = notebook.open_view()
    (beside,) = shown.children[0].children[1:]
    widgets = [widget for box in beside.children for widget in box.children]
    assert [isinstance(one, kind) for one, kind in zip(widgets, (ControlPanel, Inspector, ChartBoard), strict=True)]
    traits = [{name: getattr(one, name) for name in one.keys if not name.startswith("_")} for one in widgets]
    for known in traits:
        known.pop("layout"), known.pop("tabbable", None), known.pop("tooltip", None)
    page.evaluate(PANELS, {"scripts": [one._esm for one in widgets], "traits": traits})
    notebook.wait(view, "player.rest === 'true'")
    for width, columns in ((500, 1), (800, 2), (1400, 3)):
        page.locator(".output").evaluate(SIZE, [width, 560])
        settle(page)
        page.locator(".output").screenshot(path=shots / f"notebook_panels_{theme}_{width}.png")
        lefts = [page.locator(name).bounding_box() for name in (".swarm-player", ".swarm-panel", ".swarm-charts")]
        assert len({round(box["x"] / 60) for box in lefts}) == columns, lefts
        assert lefts[0]["width"] >= 400
        assert lefts[0]["height"] >= 300
        assert page.locator(".swarm-notebook, .swarm-panel, .swarm-side").evaluate_all(OVERFLOWING) == []
