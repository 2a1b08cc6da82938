"""Two worlds side by side, their controls and their chart."""

import base64
import secrets
import threading
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from html import escape
from typing import Any

import numpy as np
import solara
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, StrMethodFormatter
from reacton import ipyvuetify as rv

from mesa_swarm.dashboard import page_models
from mesa_swarm.dashboard.compare.comparing import FEWEST_SEEDS, NAMES, Comparing, Pair, Report, Side
from mesa_swarm.dashboard.page.controls import (
    LARGEST_RANDOM_SEED,
    MOST_SLID,
    ControlPanel,
    PanelLink,
    choice_field,
    field_of,
    parameter_label,
    run_fields,
    value_at,
    value_of,
    value_text,
    with_faults,
)
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.page.widgets import LEFT, Button, ColumnFold, Linked, TroubleCard
from mesa_swarm.experiments.figures import window_means
from mesa_swarm.model.parameters import Slider
from mesa_swarm.viewing.canvas_widget import PlayerView, SwarmCanvas, extent_of
from mesa_swarm.viewing.figures import literal, plain_panels, png
from mesa_swarm.viewing.palette import LIGHT
from mesa_swarm.viewing.play_loop import use_changes
from mesa_swarm.viewing.player import PackedFrame

# Shortest time between drawings, s: one takes a tenth of that.
EVERY = 0.5
MOST_PANELS = 3
# Reports of every model are drawn last.
LAST = ("total_collisions", "collisions")
# Most points of a line; each is the mean of the steps in its window.
CORNERS = 300
SIZE, DOTS_PER_INCH = (10.4, 2.05), 150
STYLES = tuple(zip(LIGHT.series, ("-", "--"), strict=False))
_DRAWING = threading.Lock()

# Steps and numbers by name, shapes (m,) and (m,), with the title and the unit.
Reports = dict[str, tuple[np.ndarray, np.ndarray, str, str]]


def series_of_pair(pair: Pair) -> tuple[Reports, Reports]:
    """Return the reports of the models of a pair at the stored steps; empty where there is no model."""
    with pair.lock:
        first, second = (_reports_of(side) for side in pair.sides)
    return first, second


def _reports_of(side: Side) -> Reports:
    if side.model is None:
        return {}
    reports: Reports = {}
    for label, (key, k) in side.series.labels().items():
        (steps, numbers), chart = side.series.rows(key), side.series.chart(key)
        reports[label if len(chart.names) > 1 else key] = steps, numbers[:, k], label, chart.unit
    # A report that was never a number is left out.
    return {name: line for name, line in reports.items() if not len(line[0]) or np.isfinite(line[1]).any()}


def curves_png(series: Sequence[Reports], labels: Sequence[str], chosen_names: Sequence[str] = ()) -> bytes:
    """Return a chart as PNG: a panel for each chosen report, by default the first three, with a line for each world."""
    names = main_reports(series, chosen_names)
    with _DRAWING:
        figure = Figure(figsize=SIZE)
        panels = plain_panels(figure, 1, max(len(names), 1), letters=9)[0]
        figure.subplots_adjust(left=0.055, right=0.985, top=0.77, bottom=0.22, wspace=0.2)
        for name, axes in zip(names, panels, strict=False):
            draw(axes, name, series, labels)
        lines = panels[0].get_legend_handles_labels()
        figure.legend(*lines, loc="upper right", bbox_to_anchor=(1.0, 1.04), ncols=2, fontsize=9.5, frameon=False)
        return png(figure, DOTS_PER_INCH)


def main_reports(series: Sequence[Reports], chosen_names: Sequence[str] = ()) -> list[str]:
    """Return the names of the reports to draw: the chosen ones, or the first ones of all."""
    names = order_reports(dict.fromkeys(name for reports in series for name in reports))
    return [name for name in names if name in chosen_names] or names[:MOST_PANELS]


def order_reports(names: Iterable[str]) -> list[str]:
    """Return the names of reports: those of the model, those of all models, then curves of charts of several."""
    return sorted(names, key=lambda name: (": " in name, LAST.index(name) if name in LAST else -1))


def names_of(pair: Pair) -> dict[str, str]:
    """Return the titles of all reports of both worlds by name, in order."""
    labels = {name: line[2] for reports in series_of_pair(pair) for name, line in reports.items()}
    return {name: labels[name] for name in order_reports(labels)}


def draw(axes: Axes, name: str, series: Sequence[Reports], labels: Sequence[str]) -> None:
    """Draw one report of both worlds into a panel."""
    lines = [reports[name] for reports in series if name in reports]
    for reports, label, (colour, style) in zip(series, labels, STYLES, strict=True):
        if name in reports:
            middles, means = (window_means(part.astype(float), CORNERS)[1] for part in reports[name][:2])
            axes.plot(middles, means, style, color=colour, linewidth=1.8, label=literal(label))
    title, unit = lines[0][2:] if lines else (name, "")
    axes.set_title(literal(title), fontsize=11, loc="left", color=LIGHT.ink)
    axes.set_ylabel(literal(unit), fontsize=9, labelpad=2)
    axes.set_xlabel("step", fontsize=9, labelpad=1)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:,.0f}"))
    finite = [numbers[np.isfinite(numbers)] for _, numbers, *_ in lines]
    counts = all((numbers == np.round(numbers)).all() for numbers in finite)
    axes.yaxis.set_major_locator(MaxNLocator(4, integer=counts, min_n_ticks=1))
    axes.grid(axis="y", color=LIGHT.line, linewidth=0.7)
    axes.set_xlim(0, max([1, *(steps[-1] for steps, *_ in lines if len(steps))]))
    if all(numbers.min(initial=0.0) >= 0.0 for numbers in finite):
        axes.set_ylim(bottom=0.0, top=None if axes.dataLim.y1 > 0 else 1.0)


class CurveThread:
    """Draws the chart of a pair after changes, at most every `EVERY` seconds."""

    def __init__(
        self,
        pair: Pair,
        labels: Callable[[], Sequence[str]],
        take: Callable[[bytes], None],
        chosen: Callable[[], Sequence[str]] = tuple,
    ) -> None:
        self._pair, self._labels, self._take, self._choose = pair, labels, take, chosen
        self._stop = threading.Event()
        threading.Thread(target=self._run, name="curves", daemon=True).start()

    def close(self) -> None:
        """Stop drawing."""
        self._stop.set()

    def _run(self) -> None:
        pictured: tuple = ()
        while not self._stop.is_set():
            labels, names = tuple(self._labels()), tuple(self._choose())
            now = labels, names, *((id(side.model), side.model and side.model.completed) for side in self._pair.sides)
            if now != pictured:
                pictured = now
                self._take(curves_png(series_of_pair(self._pair), labels, names))
            self._stop.wait(EVERY)


class ComparePanel(PanelLink):
    """Connects a control panel and a comparison."""

    def __init__(self, widget: ControlPanel, comparing: Comparing) -> None:
        self.comparing = comparing
        sources = partial(comparison_groups, comparing), partial(comparison_values, comparing)
        super().__init__(widget, comparing.pair.changed, *sources)

    def act(self, message: dict, buffers: Sequence = ()) -> None:
        """Carry out a message from the browser."""
        comparing, name = self.comparing, message.get("name", "")
        value: Any = message.get("value")
        match message.get("do"):
            case "choose" if name == "model":
                comparing.choose_model(str(value))
            case "choose" if name == "parameter":
                comparing.choose_parameter(str(value))
            case "choose" if name in NAMES:
                comparing.set_value(name, str(value))
                comparing.reset()
            case "text" if name in NAMES:
                comparing.set_value(name, str(value))
            case "place" if name in NAMES:
                comparing.set_value(name, value_at(int(value), comparing.choices[comparing.parameter]))
            case "place" if name == "seeds":
                comparing.set_count("seeds", int(value))
            case "text" if name in ("seed", "seeds", "steps"):
                comparing.set_count(name, str(value))
            case "random":
                comparing.set_count("seed", secrets.randbelow(LARGEST_RANDOM_SEED))
                comparing.reset()
            case "defaults":
                comparing.choose_model(comparing.name)


def comparison_groups(comparing: Comparing) -> list[dict[str, Any]]:
    """Return all controls in groups, in the format of the panel."""
    text = "differs between A and B; all others are as on the Watch page"
    fields = [
        choice_field("model", "model", page_models()),
        choice_field("parameter", "parameter", list(comparing.choices), text),
        *(_value_field(comparing, name) for name in NAMES),
    ]
    runs = run_fields(FEWEST_SEEDS, "each is run with A and with B")
    return [{"title": "Two worlds", "fields": fields}, {"title": "Many seeds", "fields": runs}]


def _value_field(comparing: Comparing, name: str) -> dict[str, Any]:
    """Return the control of the value in world A or B."""
    parameter = comparing.choices[comparing.parameter]
    field = field_of(parameter, comparing.session) or {}
    at_once = not isinstance(parameter.control, Slider)
    label = f"{parameter_label(parameter.name)} in {name}"
    text = parameter.help if name == NAMES[0] else ""
    return {**field, "name": name, "label": label, "help": text, "upload": False, "live": at_once}


def comparison_values(comparing: Comparing) -> dict[str, dict[str, Any]]:
    """Return the value of each control, whether it waits for a reset, and its fault."""
    texts = {"model": comparing.name, "parameter": comparing.parameter, "seed": comparing.seed}
    texts |= {"seeds": comparing.seeds, "steps": comparing.steps}
    values: dict[str, dict[str, Any]] = {name: {"text": str(text)} for name, text in texts.items()}
    values["seeds"]["place"] = min(comparing.seeds, MOST_SLID)
    parameter = comparing.choices[comparing.parameter]
    values |= {name: value_of(value, parameter) for name, value in zip(NAMES, comparing.values, strict=True)}
    return with_faults(values, comparing)


OVER_TIME, OVER_SEEDS = "Over time", "Over many seeds"
BAR = {"bar": True, "keys": "page", "stage": False, "toggles": {}}
WORLD = {"bar": False, "head": True, "keys": "", "toggles": {}}


class SideView:
    """Connects a canvas and one side of a pair."""

    def __init__(self, canvas: SwarmCanvas, comparing: Comparing, index: int) -> None:
        self.canvas, self.comparing, self.index = canvas, comparing, index
        self.side = comparing.pair.sides[index]
        self.side.add_viewer(self, first=True)

    @property
    def ready(self) -> bool:
        """Whether the canvas has room for another picture."""
        return self.canvas.ready

    def push(self, number: int, frame: PackedFrame) -> None:
        """Show a picture."""
        self.canvas.show_state(caption=captions(self.comparing)[self.index])
        self.canvas.push(number, frame, rest=not self.side.playing, **extent_of(self.side.past))

    def close(self) -> None:
        """Disconnect."""
        self.side.remove_viewer(self)


@solara.component
def Compare(session: Session) -> None:
    """Show the controls on the left, two worlds in the middle, and the results below them."""
    comparing = solara.use_memo(lambda: session.companion(Comparing), [])
    use_changes(comparing.runs.changed)
    below, choose_below = solara.use_state(OVER_SEEDS if comparing.runs.total else OVER_TIME)
    is_tall = below == OVER_SEEDS and comparing.runs.report is not None
    with solara.Div(classes=["swarm-watch"]):
        with solara.Div(classes=["swarm-set"]):
            Linked(ControlPanel, ComparePanel, comparing)
            Start(comparing, lambda: choose_below(OVER_SEEDS))
        ColumnFold.element(side=LEFT, label="Settings")
        with solara.Div(classes=["swarm-middle", "swarm-pair"]):
            ComparisonFault(comparing)
            with solara.Div(classes=["swarm-clock"]):
                PlayerView(comparing.pair, comparing.reset, BAR)
            with solara.Div(classes=["swarm-worlds"]):
                for index in range(len(NAMES)):
                    options = {**WORLD, "remember": f"compare {NAMES[index]}"}
                    Linked(SwarmCanvas, SideView, comparing, index, options=options).key(NAMES[index])
            with solara.Div(classes=["swarm-below", "swarm-tall"] if is_tall else ["swarm-below"]):
                with rv.Html(tag="nav", class_="swarm-tabs", attributes={"aria-label": "Results"}):
                    for name in (OVER_TIME, OVER_SEEDS):
                        Button(name, partial(choose_below, name), pressed=name == below).key(name)
                if below == OVER_TIME:
                    Curves(comparing)
                else:
                    Result(comparing)


def captions(comparing: Comparing) -> tuple[str, str]:
    """Return the names of the two worlds as built."""
    parameter, settings = parameter_label(comparing.parameter), comparing.built
    first, second = (f"{name}: {parameter} {value_text(settings[name])}" for name in NAMES)
    return first, second


@solara.component
def ComparisonFault(comparing: Comparing) -> None:
    """Show an error in one of the worlds on a card."""
    use_changes(comparing.pair.changed)
    fault = comparing.faults.get("worlds") or comparing.pair.error
    if fault:
        TroubleCard("", fault, way_out=("Reset", comparing.reset))


@solara.component
def Curves(comparing: Comparing) -> None:
    """Show the chart of both worlds, and what can be chosen for it: the choice stays, as that of Watch does."""
    picture, take = solara.use_state(b"")
    _, draw_anew = solara.use_state(0)
    use_changes(comparing.pair.changed)
    charts = comparing.session.chosen_charts

    def chosen() -> list[str]:
        return charts.get(f"compare {comparing.name}", [])

    def choose(name: str) -> None:
        others = [other for other in names if other != name]
        charts[f"compare {comparing.name}"] = others if name in names else [*others, name]
        draw_anew(lambda count: count + 1)

    solara.use_effect(lambda: CurveThread(comparing.pair, lambda: captions(comparing), take, chosen).close, [])
    titles = names_of(comparing.pair)
    names = main_reports(series_of_pair(comparing.pair), chosen())
    with rv.Html(tag="details", class_="swarm-reports"):
        rv.Html(tag="summary", children=[f"Choose up to {MOST_PANELS} reports"])
        with solara.Div():
            for name, title in titles.items():
                has_room = name in names or len(names) < MOST_PANELS
                Button(title, partial(choose, name), pressed=name in names, enabled=has_room).key(name)
    Image(picture, "Reports of both worlds over time", "swarm-curves")


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
    """Show the button that starts the runs, and their progress."""
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
    """Show the results of the runs: a sentence, a table, a picture."""
    runs = comparing.runs
    use_changes(runs.changed)
    if runs.report:
        Found(runs.report)
    elif runs.running:
        rv.Html(tag="p", class_="swarm-hint", children=["Runs in progress; the worlds above can be played."])
    else:
        rv.Html(tag="p", class_="swarm-hint", children=["Start the comparison on the left to see its results."])


@solara.component
def Found(report: Report) -> None:
    """Show a report."""
    with solara.Div(classes=["swarm-found"]):
        with solara.Div(classes=["swarm-results"]):
            rv.Html(tag="p", class_="swarm-finding", attributes={"role": "status"}, children=[report.finding])
            about = {"role": "group", "aria-label": "Table of results", "tabindex": "0"}
            solara.HTML(
                classes=["swarm-scroll"], unsafe_innerHTML=table_html(report.title, report.table), attributes=about
            )
            rv.Html(tag="p", class_="swarm-hint", children=[" ".join(report.notes)])
            with solara.FileDownload(report.runs, filename="runs.csv", mime_type="text/csv"):
                rv.Html(tag="button", attributes={"type": "button"}, children=["All runs as CSV"])
        Image(report.picture, "Every run, and the differences on the same seed", "swarm-pairs")


def table_html(title: str, table: list[list[str]]) -> str:
    """Return a table as HTML; the cells are text."""
    header, *lines = table
    head = "".join(_heading("col", cell) for cell in header)
    body = "".join(
        f"<tr>{_heading('row', first)}" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>"
        for first, *cells in lines
    )
    return f"<table><caption>{escape(title)}</caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _heading(scope: str, cell: str) -> str:
    """Return the heading of a row or a column; an empty one is a plain cell, since it heads nothing."""
    return f'<th scope="{scope}">{escape(cell)}</th>' if cell else "<td></td>"
