"""The tab of experiments: its controls, the picture of its results, and its files."""

import math
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import anywidget
import solara
import traitlets
from reacton import ipyvuetify as rv

from mesa_swarm.dashboard import page_models
from mesa_swarm.dashboard.experiment.experiment_results import MEAN, SHARE, GridCell, GridResults
from mesa_swarm.dashboard.experiment.experimenting import Experimenting, options_of, values_in_words
from mesa_swarm.dashboard.page.controls import (
    MOST_SLID,
    ControlPanel,
    PanelLink,
    choice_field,
    parameter_label,
    run_fields,
    value_text,
    with_faults,
)
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.page.widgets import LEFT, Button, ColumnFold, Link, Linked, view_script
from mesa_swarm.experiments.reports import OF, REDUCTIONS, notes_on_rows, split_measure
from mesa_swarm.experiments.statistics import FEWEST, TIME
from mesa_swarm.experiments.tables import percent, with_limits
from mesa_swarm.model.parameters import Parameter, parameters_of
from mesa_swarm.viewing import palette
from mesa_swarm.viewing.play_loop import use_changes

# Shortest time between updates of the picture, s.
EVERY = 0.5
NO_OTHER = "(no other)"
EACH_STEP = " (each step)"
INTERVALS = {MEAN: "bootstrap, BCa", SHARE: "Wilson"}
LONGEST_LIST = 3


class ExperimentPanel(PanelLink):
    """Connects a control panel and an experiment."""

    def __init__(self, widget: ControlPanel, experimenting: Experimenting) -> None:
        self.experimenting = experimenting
        sources = partial(experiment_groups, experimenting), partial(experiment_values, experimenting)
        super().__init__(widget, experimenting.changed, *sources)

    def act(self, message: dict, buffers: Sequence = ()) -> None:
        """Carry out a message from the browser."""
        experimenting, name = self.experimenting, message.get("name", "")
        value: Any = message.get("value")
        match message.get("do"):
            case "choose" if name == "q":
                experimenting.set("q", "" if value == NO_OTHER else str(value))
            case "choose" if name == "measure":
                experimenting.set("measure", measure_named(str(value), experimenting))
            case "choose" if name == "reduction":
                _, reporter = split_measure(experimenting.measure) or ("", "")
                experimenting.set("measure", f"{value}{OF}{reporter}")
            case "choose" if name in ("model", "p", "summary"):
                experimenting.set(name, str(value))
            case "tick" if name in ("values", "q_values"):
                experimenting.set(name, ", ".join(map(str, value)))
            case "span" if name in ("values", "q_values") and len(value) == 3:
                experimenting.space(name, *map(str, value))
            case "place" if name == "seeds":
                experimenting.set(name, str(int(value)))
            case "text" if name in ("values", "q_values", "seeds", "steps"):
                experimenting.set(name, str(value))


def measure_named(option: str, experimenting: Experimenting) -> str:
    """Return the measure of an option: a report is reduced as the last one was."""
    if not option.endswith(EACH_STEP):
        return option
    reduction, _ = split_measure(experimenting.measure) or ("mean", "")
    return f"{reduction}{OF}{option.removesuffix(EACH_STEP)}"


def experiment_groups(experimenting: Experimenting) -> list[dict[str, Any]]:
    """Return all controls in groups, in the format of the panel."""
    names = [name for name in experimenting.choices if name != experimenting.p]
    all_others = "all other parameters are as on the Watch page"
    grid = [
        choice_field("model", "model", page_models()),
        choice_field("p", "parameter", list(experimenting.choices)),
        _values_field("values", experimenting.p, experimenting),
        choice_field("q", "second parameter", [NO_OTHER, *names], all_others),
    ]
    if experimenting.q:
        grid.append(_values_field("q_values", experimenting.q, experimenting))
    return [
        {"title": "Grid", "fields": grid},
        {"title": "Runs", "fields": run_fields(1, "the same at each setting")},
        {"title": "Measure", "fields": _measure_fields(experimenting)},
    ]


def _values_field(name: str, parameter_name: str, experimenting: Experimenting) -> dict[str, Any]:
    """Return the control of the values of a parameter."""
    parameter = experimenting.choices[parameter_name]
    about = {
        "name": name,
        "label": f"values of {parameter_label(parameter_name)}",
        "help": parameter.help,
        "live": True,
    }
    options = options_of(parameter, experimenting.map_names())
    if options:
        return {**about, "kind": "ticks", "options": options}
    return {**about, "kind": "span" if parameter.kind in (int, float) else "text"}


def _measure_fields(experimenting: Experimenting) -> list[dict[str, Any]]:
    reports = [split_measure(name) for name in experimenting.measures]
    measures = [name for name, parts in zip(experimenting.measures, reports, strict=True) if not parts]
    reporters = dict.fromkeys(f"{parts[1]}{EACH_STEP}" for parts in reports if parts)
    fields = [choice_field("measure", "measure", [*measures, *reporters], "may be changed after the runs")]
    if split_measure(experimenting.measure):
        fields.append(choice_field("reduction", "over the run", list(REDUCTIONS)))
    if experimenting.can_be_missing:
        fields.append(choice_field("summary", "over the seeds", [MEAN, SHARE]))
    return fields


def experiment_values(experimenting: Experimenting) -> dict[str, dict[str, Any]]:
    """Return the value of each control, and its fault."""
    parts = split_measure(experimenting.measure)
    texts = {
        "model": experimenting.name,
        "p": experimenting.p,
        "q": experimenting.q or NO_OTHER,
        "seeds": experimenting.seeds,
        "steps": experimenting.steps,
        "measure": f"{parts[1]}{EACH_STEP}" if parts else experimenting.measure,
        "reduction": parts[0] if parts else "",
        "summary": experimenting.summary,
    }
    values: dict[str, dict[str, Any]] = {name: {"text": str(text)} for name, text in texts.items()}
    values["seeds"]["place"] = min(experimenting.seeds, MOST_SLID)
    for name, listing in (("values", experimenting.values), ("q_values", experimenting.q_values)):
        numbers = [value for value in listing if isinstance(value, (int, float))]
        span = [min(numbers), max(numbers), len(numbers)] if numbers else ["", "", ""]
        about = {"ticked": list(map(str, listing)), "span": [values_in_words([end]) for end in span]}
        values[name] = {"text": values_in_words(listing), **about}
    return with_faults(values, experimenting)


class ExperimentPicture(anywidget.AnyWidget):
    """A heat map or curves drawn in the browser, with a table and files."""

    _esm = palette.palette_script() + view_script("dashboard/experiment/experiment.js")
    picture = traitlets.Dict().tag(sync=True)


class PictureLink(Link):
    """Connects a picture and an experiment; it is drawn anew at most every `EVERY` seconds during the runs."""

    def __init__(
        self, widget: ExperimentPicture, experimenting: Experimenting, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.widget, self.experimenting, self._clock = widget, experimenting, clock
        self._sent_at = 0.0
        self._lock = threading.Lock()
        leave = [experimenting.changed.add(self.refresh), experimenting.runs.changed.add(self._on_run)]
        self.connect(widget, *leave)
        self.refresh()

    def refresh(self) -> None:
        """Show the results so far."""
        with self._lock:
            self._sent_at = self._clock()
            self.widget.picture = picture_of(self.experimenting)

    def act(self, message: dict, buffers: Sequence = ()) -> None:
        """Carry out a message from the browser."""
        experimenting, results = self.experimenting, self.experimenting.grid
        match message.get("do"):
            case "watch":
                experimenting.watch(int(message.get("value", -1)))
            case "csv" if results is not None:
                self.downloads.send(f"{results.job_name}.csv", results.csv(shown_measure(experimenting)).encode())
            case "job":
                self.downloads.send(*shown_results(experimenting).job_file(shown_measure(experimenting)))

    def _on_run(self) -> None:
        if not self.experimenting.runs.running or self._clock() - self._sent_at >= EVERY:
            self.refresh()


def shown_results(experimenting: Experimenting) -> GridResults:
    """Return the last results, without any those of what is chosen, which are empty."""
    return experimenting.preview() if experimenting.grid is None else experimenting.grid


def shown_measure(experimenting: Experimenting) -> str:
    """Return the chosen measure, or the first one of the results if they do not have it."""
    measures, measure = shown_results(experimenting).experiment.measures, experimenting.measure
    return measure if measure in measures or not measures else measures[0]


def picture_of(experimenting: Experimenting) -> dict[str, Any]:
    """Return all that is shown of the results, as the browser needs it."""
    results, measure = shown_results(experimenting), shown_measure(experimenting)
    summary = experimenting.summary if measure.endswith(TIME) else MEAN
    cells, seeds = results.cells(measure, summary), len(results.experiment.seeds)
    parameters = parameters_of(results.experiment.model_class)
    axes = [_axis(parameters[name], values) for name, values in results.values.items()]
    what = f"{measure}: {summary}" if summary == SHARE else f"{measure}: {summary} over seeds"
    return {
        "title": f"{what}, by {' and '.join(axis['name'] for axis in axes)}",
        "about": about_of(results),
        "stale": "" if experimenting.grid is None or experimenting.is_current else STALE,
        "axes": axes,
        "measure": _measure_axis(measure, summary),
        "share": summary == SHARE,
        "interval": f"95 % interval ({INTERVALS[summary]})",
        "note": " ".join([note_of(measure, summary, seeds), *notes_on_rows(results.left_out(measure))]),
        "seeds": seeds,
        "cells": [_numbers(cell, summary) for cell in cells],
        "errors": {str(place): error for place, error in results.errors().items()},
        "fault": fault_of(results),
        "runs": len(results.outcomes),
        "command": results.command,
        "packed": bool(results.maps),
    }


STALE = "The choices changed after this experiment was started: the picture shows the experiment described here."


def _axis(parameter: Parameter, values: list) -> dict[str, Any]:
    numbers = all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values)
    return {
        "name": parameter_label(parameter.name),
        "help": parameter.help,
        "labels": [value_text(value) for value in values],
        "numbers": values if numbers else None,
    }


def _measure_axis(measure: str, summary: str) -> str:
    if summary == SHARE:
        return f"{measure}: share of runs, %"
    return f"{measure}, steps" if measure.endswith(TIME) else measure


def about_of(results: GridResults) -> str:
    """Return a line about what was run."""
    experiment = results.experiment
    points, seeds = len(experiment.points), len(experiment.seeds)
    size = f"{results.model}: {points:,} settings x {seeds:,} seeds, at most {experiment.steps:,} steps each"
    others = ", ".join(f"{parameter_label(name)} {value_text(value)}" for name, value in results.settings.items())
    return f"{size}; {others}" if others else f"{size}; all other parameters at their defaults"


def note_of(measure: str, summary: str, seeds: int) -> str:
    """Return what the picture shows, and of which kind the intervals are."""
    what = "Shares of the runs in which it occurred" if summary == SHARE else "Means"
    left_out = " Runs in which it did not occur are left out." if summary == MEAN and measure.endswith(TIME) else ""
    few = f" Fewer than {FEWEST} numbers have no interval." if summary == MEAN else ""
    return f"{what} over n = {seeds} seeds at each setting, 95 % intervals ({INTERVALS[summary]}).{few}{left_out}"


def fault_of(results: GridResults) -> str:
    """Return a line about runs that ended in an error, with the first different errors; empty if there are none."""
    errors = results.errors()
    if not errors:
        return ""
    different = list(dict.fromkeys(errors.values()))
    more = f"; and {len(different) - LONGEST_LIST} more" if len(different) > LONGEST_LIST else ""
    what = f"{len(errors)} of {len(results.experiment.points)} settings have runs that ended in an error"
    return f"{what}: {'; '.join(different[:LONGEST_LIST])}{more}"


def _numbers(cell: GridCell, summary: str) -> list:
    """Return a cell for the browser: estimate, limits, what they are as text, and the numbers of runs."""
    interval, scale = cell.interval, 100.0 if summary == SHARE else 1.0
    parts = [interval.estimate, interval.low, interval.high]
    numbers = [None if math.isnan(part) else part * scale for part in parts]
    text = "" if numbers[0] is None else cell_text(cell, summary)
    return [*numbers, text, cell.counted, cell.done, cell.failed]


def cell_text(cell: GridCell, summary: str) -> str:
    """Return an estimate with its interval, with digits according to its width."""
    if summary == SHARE:
        return f"{100 * cell.interval.estimate:.0f} % [{percent(cell.interval)}]"
    return with_limits(cell.interval)


@solara.component
def ExperimentTab(session: Session) -> None:
    """Show the controls on the left, and the results beside them."""
    experimenting = solara.use_memo(lambda: session.companion(Experimenting), [])
    solara.use_memo(experimenting.follow, [])
    with solara.Div(classes=["swarm-watch", "swarm-grid"]):
        with solara.Div(classes=["swarm-set"]):
            Linked(ControlPanel, ExperimentPanel, experimenting, bare=True)
            StartOrStop(experimenting)
        ColumnFold.element(side=LEFT, label="Settings")
        with solara.Div(classes=["swarm-middle"]):
            Linked(ExperimentPicture, PictureLink, experimenting)


@solara.component
def StartOrStop(experimenting: Experimenting) -> None:
    """Show the number of runs and the button that starts, stops or continues them, with their progress."""
    runs = experimenting.runs
    use_changes(runs.changed)
    use_changes(experimenting.changed)
    with solara.Div(classes=["swarm-start"]):
        if runs.running:
            about = {"max": str(runs.total), "value": str(runs.done), "aria-label": "Runs done"}
            rv.Html(tag="progress", attributes=about).key("progress")
            text = f"{runs.done:,} of {runs.total:,} runs, {runs.left or 'starting ...'}"
            rv.Html(tag="p", children=[text]).key("text")
            Button("Stop", experimenting.stop).key("stop")
        else:
            rv.Html(tag="p", attributes={"role": "status"}, children=[experimenting.size_in_words()]).key("size")
            label, enabled = experimenting.next_action()
            Button(label, experimenting.start, "swarm-do", enabled=enabled).key("start")
        fault = experimenting.faults.get("runs") or runs.error
        if fault:
            rv.Html(tag="p", class_="swarm-fault", attributes={"role": "alert"}, children=[fault]).key("fault")
