"""A model with panels in one output of a notebook, driven without a browser."""

from base64 import b64encode

import numpy as np
import pytest
from ipywidgets.embed import dependency_state, embed_data
from nbconvert import HTMLExporter
from nbformat import v4

from mesa_swarm import AGENT9, Map, SwarmModel, show
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.dashboard.notebook_panels import NotebookCanvas, in_notebooks
from mesa_swarm.dashboard.page.controls import ControlPanel
from mesa_swarm.dashboard.run.charts import ChartBoard
from mesa_swarm.dashboard.run.inspector import Inspector
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.viewing import text_of
from mesa_swarm.viewing.canvas_widget import SwarmCanvas


def made(**changes) -> FireFighting:
    return FireFighting(**{"n_robots": 4, "strategy": "A", "rng": 3, **changes})


def widgets_in(view) -> list:
    """Return the widgets of a view, and those in its boxes."""
    inner = getattr(view, "children", ())
    return [view, *[one for child in inner for one in widgets_in(child)]]


def kinds_in(view) -> set[type]:
    kinds = {ControlPanel, ChartBoard, Inspector, NotebookCanvas}
    return {kind for kind in kinds for one in widgets_in(view) if isinstance(one, kind)}


def panel_in(view, kind):
    return next(one for one in widgets_in(view) if isinstance(one, kind))


def by_hand() -> SwarmModel:
    model = SwarmModel(map="original", rng=1)
    model.add_robots(AGENT9, 3)
    model.control = Subsumption(Avoid(distance=15), Explore())
    return model


@pytest.mark.parametrize(
    ("option", "kinds", "resets"),
    [
        ("controls", {ControlPanel}, True),
        ("charts", {ChartBoard}, False),
        ("inspector", {Inspector}, False),
        ("reset", set(), True),
    ],
)
def test_each_option_may_be_given_alone(option, kinds, resets):
    view = made().show(**{option: True})
    assert kinds_in(view) == {NotebookCanvas, *kinds}
    assert ("reset" in view.canvas.commands) == resets


def test_the_controls_have_the_values_that_the_model_was_made_with():
    view = made(k2=0.02).show(controls=True)
    values = panel_in(view, ControlPanel).values
    assert {name: values[name]["text"] for name in ("n_robots", "strategy", "k2", "seed")} == {
        "n_robots": "4",
        "strategy": "A",
        "k2": "0.02",
        "seed": "3",
    }
    assert not any(value["waits"] for value in values.values())


def test_only_the_named_controls_and_charts_are_shown():
    view = made().show(controls=["n_robots", "strategy"], charts=["layers"])
    panel, board = panel_in(view, ControlPanel), panel_in(view, ChartBoard)
    assert [field["name"] for group in panel.groups for field in group["fields"]] == ["n_robots", "strategy"]
    assert (panel.bare, [one["title"] for one in board.shown]) == (True, ["Layers that drive"])
    view.session.set_parameter("n_robots", 7)
    view.session.reset()
    assert [field["name"] for group in panel.groups for field in group["fields"]] == ["n_robots", "strategy"]


def test_the_model_that_is_given_is_played_and_after_reset_another_one():
    model = made()
    view = model.show(controls=True)
    view.canvas.commands["step"]()
    assert (view.model is model, model.steps) == (True, 1)
    view.session.set_parameter("n_robots", 6)
    view.canvas.commands["reset"]()
    assert (len(view.model.robots), view.model.steps) == (6, 0)
    assert (len(model.robots), model.steps) == (6, 1)  # robots are added to the run that is shown


@pytest.mark.parametrize("rng", [3, None, np.random.SeedSequence(5)])
def test_reset_begins_the_same_run_anew_whatever_the_model_grew_from(rng):
    model = made(rng=rng)
    before = model.state_hash()
    view = model.show(reset=True)
    view.canvas.commands["step"]()
    view.canvas.commands["reset"]()
    assert view.session.error == ""
    assert view.model.state_hash() == before


def test_steps_of_a_program_are_shown_of_the_present_model_only():
    model = made()
    view = model.show(reset=True)
    model.step()
    assert view.session.past.last_step == 1
    view.canvas.commands["reset"]()
    model.run(5)
    assert view.session.past.last_step == 0
    view.model.run(3)
    view.canvas.caught_up()
    assert view.session.past.last_step == 3


def test_a_model_on_a_map_of_the_users_is_reset_on_it():
    chart = Map.from_toml('name = "mine"\nwidth = 300\nheight = 200\n', "mine")
    model = CollisionAvoidance(map=chart, n_robots=2, rng=1)
    view = model.show(controls=True)
    view.canvas.commands["reset"]()
    assert view.session.error == ""
    assert (view.model is model, view.model.map.bounds) == (False, chart.bounds)


def test_a_model_that_got_its_robots_by_hand_is_reset_to_how_it_was_shown():
    model = by_hand().run(20)
    before = model.state_hash()
    view = model.show(reset=True, charts=True, inspector=True)
    view.canvas.commands["step"]()
    view.canvas.commands["reset"]()
    assert (view.model.steps, view.model.state_hash()) == (20, before)
    assert (model.steps, view.model is model) == (21, False)
    with pytest.raises(InvalidValueError, match="derive a class"):
        by_hand().show(controls=True)


def test_all_rows_that_were_collected_remain(monkeypatch):
    monkeypatch.setattr("mesa_swarm.viewing.player.MOST_COLLECTED", 5)
    model = made().run(12)
    view = model.show(charts=True, reset=True)
    for _ in range(12):
        view.canvas.commands["step"]()
    assert len(model.datacollector.model_vars["collisions"]) == 24


def test_an_unknown_parameter_or_chart_is_refused_with_the_known_ones():
    with pytest.raises(UnknownNameError, match="n_robot"):
        made().show(controls=["n_robot"])
    with pytest.raises(UnknownNameError, match="layer"):
        made().show(charts=["layer"])


def test_a_model_is_shown_with_panels_by_its_name():
    view = show("fire_fighting", n_robots=4, rng=1, inspector=True, height=300, width=700)
    assert (len(view.model.robots), view.layout.height, view.layout.width) == (4, "300px", "700px")


def test_a_view_with_panels_is_a_widget_with_a_picture_for_where_none_can_live():
    view = made().show(charts=True)
    bundle = view._repr_mimebundle_()
    assert "application/vnd.jupyter.widget-view+json" in bundle
    assert bundle["image/png"].startswith(b"\x89PNG")
    assert view.canvas.picture


def test_rules_of_the_page_are_written_once_and_hold_in_a_notebook_too():
    page = text_of("dashboard/page/style.css")
    assert in_notebooks(".swarm .swarm-side button { }") == ".swarm-notebook .swarm-side button { }"
    assert in_notebooks(page) in NotebookCanvas._css
    assert NotebookCanvas._css.count("{") == NotebookCanvas._css.count("}")
    assert ".swarm-panel" not in SwarmCanvas._css


@pytest.mark.slow
@pytest.mark.parametrize("panels", [{}, {"charts": True, "controls": True, "inspector": True}])
@pytest.mark.parametrize("has_state", [False, True])
def test_an_exported_notebook_has_the_picture_with_and_without_the_state_of_its_widgets(panels, has_state):
    view = made().show(**panels)
    found = view._repr_mimebundle_()
    bundle = found[0] if isinstance(found, tuple) else found
    written = {**bundle, "image/png": b64encode(bundle["image/png"]).decode()}
    cell = v4.new_code_cell("view", outputs=[v4.new_output("display_data", data=written)])
    notebook = v4.new_notebook(cells=[cell])
    if has_state:
        state = embed_data([view], drop_defaults=False, state=dependency_state([view], False))["manager_state"]
        notebook.metadata["widgets"] = {"application/vnd.jupyter.widget-state+json": state}
    page, _ = HTMLExporter().from_notebook_node(notebook)
    assert ("vnd.jupyter.widget-view+json" in page) == has_state
    assert f"data:image/png;base64,{written['image/png'][:5000]}" in page.replace("\\/", "/")
