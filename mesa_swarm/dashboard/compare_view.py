# ruff: noqa: N802 - Solara's components are named like classes
"""Two worlds side by side with one clock and one chart, and what many seeds say of the difference."""

import base64
from collections.abc import Callable
from functools import partial
from html import escape

import solara
from reacton import ipyvuetify as rv

from mesa_swarm.dashboard.buttons import Button, TroubleCard
from mesa_swarm.dashboard.canvas_widget import SwarmCanvas, extent_of, use_connection
from mesa_swarm.dashboard.compare_panel import ComparePanel
from mesa_swarm.dashboard.comparing import Comparing
from mesa_swarm.dashboard.controls import ControlPanel, label_of
from mesa_swarm.dashboard.curves import CurveThread
from mesa_swarm.dashboard.listeners import use_changes
from mesa_swarm.dashboard.many_runs import Report
from mesa_swarm.dashboard.pair import NAMES, Side
from mesa_swarm.dashboard.past import Picture
from mesa_swarm.dashboard.readings import value_text
from mesa_swarm.dashboard.session import Session

OVER_TIME, OVER_SEEDS = "Over time", "Over many seeds"
BAR = {"bar": True, "keys": "page", "stage": False, "toggles": {}}
WORLD = {"bar": False, "head": True, "keys": "", "toggles": {}}


class SideView:
    """Lets a canvas show one side of a pair; the buttons are elsewhere.

    Parameters
    ----------
    canvas : SwarmCanvas
    side : Side
    caption : function
        Returns what stands above the picture.
    """

    def __init__(self, canvas: SwarmCanvas, side: Side, caption: Callable[[], str]) -> None:
        self.canvas, self.side, self._caption = canvas, side, caption
        side.add_viewer(self)

    @property
    def ready(self) -> bool:
        """Whether the canvas has room for another picture."""
        return self.canvas.ready

    def push(self, number: int, picture: Picture) -> None:
        """Hand a picture on."""
        self.canvas.tell(caption=self._caption())
        self.canvas.push(number, picture, rest=not self.side.playing, **extent_of(self.side.past))

    def close(self) -> None:
        """Part them."""
        self.side.remove_viewer(self)


@solara.component
def Compare(session: Session) -> None:
    """Show what is compared on the left, two worlds in the middle, and below them what comes of it."""
    comparing = solara.use_memo(lambda: session.companion(Comparing), [])
    use_changes(comparing.runs.changed)
    below, choose_below = solara.use_state(OVER_SEEDS if comparing.runs.total else OVER_TIME)
    is_tall = below == OVER_SEEDS and comparing.runs.report is not None
    with solara.Div(classes=["swarm-watch"]):
        with solara.Div(classes=["swarm-set"]):
            Choices(comparing)
            Start(comparing, lambda: choose_below(OVER_SEEDS))
        with solara.Div(classes=["swarm-middle", "swarm-pair"]):
            Trouble(comparing)
            with solara.Div(classes=["swarm-clock"]):
                Clock(comparing)
            with solara.Div(classes=["swarm-worlds"]):
                for index in range(len(NAMES)):
                    World(comparing, index).key(NAMES[index])
            with solara.Div(classes=["swarm-below", "swarm-tall"] if is_tall else ["swarm-below"]):
                with rv.Html(tag="nav", class_="swarm-tabs", attributes={"aria-label": "Results"}):
                    for name in (OVER_TIME, OVER_SEEDS):
                        Button(name, partial(choose_below, name), pressed=name == below).key(name)
                if below == OVER_TIME:
                    Curves(comparing)
                else:
                    Result(comparing)


@solara.component
def Choices(comparing: Comparing) -> None:
    """Show the panel in which one says what is compared."""
    panel = ControlPanel.element()
    solara.use_effect(lambda: ComparePanel(solara.get_widget(panel), comparing).close, [])


@solara.component
def Clock(comparing: Comparing) -> None:
    """Show the buttons that play both worlds."""
    use_connection(SwarmCanvas.element(options=BAR), comparing.pair, comparing.reset)


@solara.component
def World(comparing: Comparing, index: int) -> None:
    """Show one of the two worlds."""
    canvas = SwarmCanvas.element(options=WORLD)
    side = comparing.pair.sides[index]
    solara.use_effect(lambda: SideView(solara.get_widget(canvas), side, lambda: captions(comparing)[index]).close, [])


def captions(comparing: Comparing) -> tuple[str, str]:
    """Return what the two worlds are called, as they were built.

    Examples
    --------
    >>> comparing = Comparing(Session("fire_fighting"))
    >>> captions(comparing)
    ('A: strategy A', 'B: strategy B')
    >>> comparing.close()
    """
    parameter, built = label_of(comparing.parameter), comparing.built
    first, second = (f"{name}: {parameter} {value_text(built[name])}" for name in NAMES)
    return first, second


@solara.component
def Trouble(comparing: Comparing) -> None:
    """Show on a card what went wrong in one of the worlds."""
    use_changes(comparing.pair.changed)
    fault = comparing.faults.get("worlds") or comparing.pair.error
    if fault:
        TroubleCard("", fault, way_out=("Reset", comparing.reset))


@solara.component
def Curves(comparing: Comparing) -> None:
    """Show the chart of both worlds."""
    picture, take = solara.use_state(b"")

    solara.use_effect(lambda: CurveThread(comparing.pair, lambda: captions(comparing), take).close, [])
    Image(picture, "What both worlds report, over time", "swarm-curves")


@solara.component
def Image(picture: bytes, name: str, class_: str) -> None:
    """Show a PNG."""
    if picture:
        source = f"data:image/png;base64,{base64.b64encode(picture).decode()}"
        rv.Html(tag="img", class_=f"swarm-figure {class_}", attributes={"src": source, "alt": name}).key("picture")
    else:
        rv.Html(tag="p", class_="swarm-hint", children=["drawing ..."]).key("hint")


@solara.component
def Start(comparing: Comparing, on_start: Callable[[], None]) -> None:
    """Show the button that starts the runs, and while they are under way how far they are."""
    runs = comparing.runs
    use_changes(runs.changed)
    use_changes(comparing.pair.changed)

    def start() -> None:
        comparing.start()
        on_start()

    with solara.Div(classes=["swarm-start"]):
        if runs.running:
            about = {"max": str(runs.total), "value": str(runs.done), "aria-label": "Runs done"}
            rv.Html(tag="progress", attributes=about)
            rv.Html(tag="p", children=[f"{runs.done} of {runs.total} runs, {runs.left or 'starting ...'}"])
            Button("Cancel", runs.cancel)
        else:
            Button(f"Compare over {comparing.seeds} seeds", start, "swarm-do")
            fault = comparing.faults.get("runs") or runs.error
            if fault:
                rv.Html(tag="p", class_="swarm-fault", attributes={"role": "alert"}, children=[fault])


@solara.component
def Result(comparing: Comparing) -> None:
    """Show what came of the runs: a sentence, a table, a picture."""
    runs = comparing.runs
    use_changes(runs.changed)
    if runs.report:
        Found(runs.report)
    elif runs.running:
        rv.Html(tag="p", class_="swarm-hint", children=["The runs are under way; the worlds above can be played."])
    else:
        rv.Html(tag="p", class_="swarm-hint", children=["Start the comparison on the left to see what seeds say."])


@solara.component
def Found(report: Report) -> None:
    """Show a report."""
    with solara.Div(classes=["swarm-found"]):
        with solara.Div(classes=["swarm-said"]):
            rv.Html(tag="p", class_="swarm-finding", attributes={"role": "status"}, children=[report.finding])
            solara.HTML(classes=["swarm-scroll"], unsafe_innerHTML=table_html(report.title, report.table))
            rv.Html(tag="p", class_="swarm-hint", children=[" ".join(report.notes)])
            solara.FileDownload(report.runs, filename="runs.csv", label="All runs as CSV", mime_type="text/csv")
        Image(report.picture, "Every run, and the differences on the same seed", "swarm-pairs")


def table_html(title: str, table: list[list[str]]) -> str:
    """Return a table as HTML; whatever stands in it is text.

    Examples
    --------
    >>> table_html("<t>", [["", "a"], ["x", "1"]])[:45]
    '<table><caption>&lt;t&gt;</caption><thead><tr'
    """
    header, *lines = table
    head = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in header)
    body = "".join(
        f'<tr><th scope="row">{escape(first)}</th>' + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"
        for first, *cells in lines
    )
    return f"<table><caption>{escape(title)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
