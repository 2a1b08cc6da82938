"""A model in one output of a notebook: its canvas, and beside it controls, charts and the inspector of the page."""

import re
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from typing import Any

import anywidget
import ipywidgets

from mesa_swarm.base.errors import InvalidValueError, UnknownNameError, unknown_name
from mesa_swarm.dashboard.page.controls import ControlPanel, Panel
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.run.charts import ChartBoard, Charting
from mesa_swarm.dashboard.run.inspector import Inspecting, Inspector
from mesa_swarm.maps.map import Map
from mesa_swarm.recording.provenance import parameters_of_run
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing import palette, text_of
from mesa_swarm.viewing.canvas_widget import IN_A_NOTEBOOK, Beside, SwarmCanvas, give_size, show_on

# The canvas is in each view of a notebook, and knows which theme surrounds it.
LIGHT, DARK = ".swarm-notebook", '.swarm-notebook:has(> * > .swarm-player[data-theme="dark"])'
# Style sheets of the page whose rules panels need.
PAGE = ("dashboard/page/style.css", "dashboard/run/charts.css")


def in_notebooks(rules: str) -> str:
    """Return rules of the page, such as those of ``.swarm .swarm-side``, for what stands in a notebook."""
    return re.sub(r"\.swarm(?![-\w])", LIGHT, rules)


class NotebookCanvas(SwarmCanvas):
    """A canvas that brings the style sheet of the panels beside it, which have it from the page elsewhere."""

    _css = (
        palette.style_sheet(LIGHT, DARK)
        + in_notebooks(text_of(*PAGE))
        + SwarmCanvas._css
        + text_of("dashboard/notebook.css")
    )


class NotebookSession(Session):
    """A session of a model that was made elsewhere, and of those that Reset makes of its class.

    A model that is a plain `SwarmModel` got its robots after it was made: Reset returns to a copy of how it was shown.
    All rows that models have collected remain.
    """

    def __init__(self, model: SwarmModel) -> None:
        settings = parameters_of_run(model)
        self._first: SwarmModel | None = model
        self._copy = deepcopy(model) if is_made_by_hand(model) else None
        seed, chart = seed_of(model, settings.pop("rng", None)), settings.get("map")
        if isinstance(chart, Map):
            settings["map"] = f"{chart.name} (yours)"
        super().__init__(type(model).__name__, settings, seed, find=lambda _: type(model))
        if isinstance(chart, Map):
            self.uploads[settings["map"]] = chart

    def _make_model(self, settings: Mapping[str, Any]) -> SwarmModel:
        """Return first the model that was shown, then new ones."""
        first, self._first = self._first, None
        if first is not None:
            return first
        return super()._make_model(settings) if self._copy is None else deepcopy(self._copy)

    def _limit_collected(self, model: Any) -> None:
        """Drop nothing: the rows are the user's."""


class NotebookView(ipywidgets.Box):
    """A model with panels beside its canvas.

    Attributes
    ----------
    model : SwarmModel
        The one that is shown: at first the one that was given, after Reset a new one.
    session : Session
        Plays the model, and makes others.
    canvas : SwarmCanvas
    """

    def __init__(self, session: Session, canvas: SwarmCanvas, panels: Sequence[anywidget.AnyWidget]) -> None:
        settings = [panel for panel in panels if isinstance(panel, ControlPanel)]
        readings = [panel for panel in panels if not isinstance(panel, ControlPanel)]
        beside = [_box("swarm-set", settings)] if settings else []
        beside += [_box("swarm-side", readings)] if readings else []
        parts = [_box("swarm-beside", beside)] if beside else []
        super().__init__(children=[_box("swarm-arranged", [canvas, *parts])])
        self.add_class("swarm-notebook")
        self.session, self.canvas = session, canvas

    @property
    def model(self) -> SwarmModel | None:
        """The model that is shown."""
        return self.session.model

    def _repr_mimebundle_(self, **options: Any) -> dict[str, Any] | None:
        """Return the widget, and a PNG for places that show no widgets."""
        bundle = super()._repr_mimebundle_(**options)
        return bundle | {"image/png": self.canvas.still()} if bundle and self.canvas.still else bundle


def _box(name: str, children: Sequence[ipywidgets.Widget]) -> ipywidgets.Box:
    box = ipywidgets.Box(children=children)
    box.add_class(name)
    return box


def show_with_panels(
    model: SwarmModel, beside: Beside, *, speed: float, width: int | None, height: int
) -> NotebookView:
    """Return a model with panels beside its canvas, as a widget; see `SwarmModel.show`."""
    if beside.controls and is_made_by_hand(model):
        raise InvalidValueError(
            "controls need a model that its constructor makes whole, and this SwarmModel got its robots afterwards; "
            "derive a class of it, or leave controls out"
        )
    session = NotebookSession(model)
    canvas = NotebookCanvas(options=IN_A_NOTEBOOK)
    view = NotebookView(session, canvas, list(_panels(session, beside)))
    give_size(view, width, height)
    show_on(canvas, session, speed, session.reset if beside.reset or beside.controls else None)
    return view


def _panels(session: Session, beside: Beside) -> Sequence[anywidget.AnyWidget]:
    """Make the panels, and connect them."""
    panels: list[anywidget.AnyWidget] = []

    def connect(widget: Any, link: Callable[..., object], *more: object) -> None:
        link(widget, session, *more)
        panels.append(widget)

    if beside.controls:
        names = None if beside.controls is True else check_known("parameter", beside.controls, session.parameters)
        connect(ControlPanel(bare=names is not None), Panel, names)
    if beside.inspector:
        connect(Inspector(), Inspecting)
    if beside.charts:
        if beside.charts is not True:
            charts = {chart.key.removeprefix("own "): chart.key for chart in session.series.charts()}
            keys = [charts[name] for name in check_known("chart", beside.charts, charts)]
            session.chosen_charts[session.name] = keys
        connect(ChartBoard(), Charting)
    return panels


def check_known(what: str, names: Any, choices: Any) -> list[str]:
    """Return names of parameters or charts, all of which must be known."""
    for name in names:
        if name not in choices:
            raise UnknownNameError(unknown_name(what, name, choices))
    return list(names)


def is_made_by_hand(model: SwarmModel) -> bool:
    """Return whether a model got its robots after it was made, so that its class alone makes none like it."""
    return type(model) is SwarmModel


def seed_of(model: SwarmModel, rng: object) -> int:
    """Return the whole number from which a model grew; 1 for one that grew from a generator of another kind."""
    seed = model.streams.seed
    if isinstance(rng, int):
        return rng
    return seed.entropy if isinstance(seed.entropy, int) and not seed.spawn_key else 1
