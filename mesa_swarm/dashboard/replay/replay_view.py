"""The Replay tab: recordings, the open one, its events, and branching off it."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import solara
from reacton import ipyvuetify as rv

from mesa_swarm.dashboard.gallery.gallery_view import title
from mesa_swarm.dashboard.page.controls import (
    ControlPanel,
    PanelLink,
    field_of,
    parameter_label,
    value_at,
    value_of,
    value_text,
)
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.page.widgets import LEFT, RIGHT, Button, ColumnFold, FilePicker, Link, Linked, TroubleCard
from mesa_swarm.dashboard.replay.replaying import MOST_EVENTS, Replaying, ReplayPlayer
from mesa_swarm.dashboard.run.charts import ChartBoard, Charting
from mesa_swarm.dashboard.run.inspector import Inspector, ReplayInspecting
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.parameters import parameters_of
from mesa_swarm.viewing.canvas_widget import ON_A_PAGE, PlayerView
from mesa_swarm.viewing.play_loop import use_changes
from mesa_swarm.viewing.player import Past

NOTHING_LISTED = "Recordings of a folder are listed here when the dashboard is started with"
BRANCHING = (
    "Continue from this step on the Watch page, with identical results or with other parameters. "
    "Reset there starts again from step 0 with the same parameters and seed."
)
NOTHING_OPEN = "Open a recording made by `mesa-swarm run MODEL --record FILE.arrow` or `model.record(...)`."


class Upload(Link):
    """Passes the files of a button on, piece by piece."""

    def __init__(self, picker: FilePicker, replaying: Replaying) -> None:
        self.picker, self.replaying = picker, replaying
        self.connect(picker)

    def act(self, message: dict, buffers: Sequence = ()) -> None:
        """Carry out a message from the browser."""
        match message.get("do"):
            case "begin":
                goes_on = self.replaying.begin_upload(str(message.get("name", "")), int(message.get("size", 0)))
                self.picker.send({"go": goes_on})
            case "piece" if buffers:
                goes_on = self.replaying.take(bytes(buffers[0])) and not message.get("last")
                self.picker.send({"go": goes_on})
                if message.get("last"):
                    self.replaying.end_upload()


class BranchPanel(PanelLink):
    """Connects a control panel and the parameters of a run that branches off the open recording."""

    def __init__(self, widget: ControlPanel, replaying: Replaying) -> None:
        self.replaying, self.player = replaying, replaying.player
        self.parameters = parameters_of(find_model(replaying.model_shown))
        super().__init__(widget, replaying.changed, self._fields, self._settings)

    @property
    def is_current(self) -> bool:
        """Whether the recording of this panel is still open."""
        return self.player is not None and self.player is self.replaying.player

    def refresh(self) -> None:
        """Show all values, unless another recording was opened, which gets its own panel."""
        if self.is_current:
            super().refresh()

    def _fields(self) -> list[dict[str, Any]]:
        """Return the controls of all parameters but the number of robots, which cannot change at the branch."""
        names = [name for name in self.parameters if name not in ("map", "n_robots")]
        fields = [field_of(self.parameters[name], self.replaying.session) for name in names]
        return [{"title": "With other parameters", "fields": [field | {"live": True} for field in fields if field]}]

    def _settings(self) -> dict[str, dict[str, Any]]:
        settings = self.replaying.parameters | self.replaying.changes
        return {
            name: value_of(value, self.parameters[name]) for name, value in settings.items() if name in self.parameters
        }

    def act(self, message: dict, buffers: Sequence = ()) -> None:
        """Carry out a message from the browser."""
        name = message.get("name", "")
        value: Any = message.get("value")
        if self.is_current and name in self.parameters:
            is_place = message.get("do") == "place"
            self.replaying.set_parameter(name, value_at(int(value), self.parameters[name]) if is_place else str(value))


@solara.component
def Replay(session: Session) -> None:
    """Show the recordings on the left, the open one in the middle, and on the right a robot, charts and events."""
    replaying = solara.use_memo(lambda: session.companion(Replaying), [])
    use_changes(replaying.changed)
    player = replaying.player
    with solara.Div(classes=["swarm-watch", "swarm-beside"] if player else ["swarm-watch"]):
        with solara.Div(classes=["swarm-set"]):
            Recordings(replaying)
        ColumnFold.element(side=LEFT, label="Recordings", folded_below=True)
        with solara.Div(classes=["swarm-middle"]):
            for text in replaying.notes:
                rv.Html(tag="p", class_="swarm-hint", children=[text])
            if player:
                RecordingFault(player)
                options = {**ON_A_PAGE, "remember": f"replay {replaying.name}"}
                PlayerView(player, player.rewind, options).key(f"screen {id(player)}")
            else:
                rv.Html(tag="p", class_="swarm-hint", children=[NOTHING_OPEN])
        if player:
            ColumnFold.element(side=RIGHT, label="Events, branch").key(f"fold {id(player)}")
            with solara.Div(classes=["swarm-side"]):
                Linked(Inspector, ReplayInspecting, player).key(f"inspector {id(player)}")
                with solara.Div():
                    Linked(ChartBoard, Charting, player).key(f"charts {id(player)}")
                    Missing(player).key(f"missing {id(player)}")
                with solara.Div():
                    Events(replaying, player).key(f"events {id(player)}")
                with solara.Div():
                    Branch(replaying).key(f"branch {id(player)}")


@solara.component
def Recordings(replaying: Replaying) -> None:
    """Show the listed recordings, the upload, and facts of the open recording."""
    use_changes(replaying.changed)
    solara.HTML(tag="h2", unsafe_innerHTML="Recordings")
    Linked(FilePicker, Upload, replaying, label="Upload a recording")
    for text, kind in ((replaying.busy, "swarm-hint"), (replaying.fault, "swarm-fault")):
        if text:
            rv.Html(tag="p", class_=kind, attributes={"role": "status"}, children=[text])
    names = replaying.listed
    if not names:
        option = rv.Html(tag="code", children=["--recordings FOLDER"])
        rv.Html(tag="p", class_="swarm-hint", children=[NOTHING_LISTED, " ", option, "."])
    with solara.Div(classes=["swarm-list"]):
        for name in names:
            current = "true" if name == replaying.name else ""
            Button(name, partial(replaying.open_listed, name), current=current).key(name)
    if replaying.player:
        About(replaying, replaying.player.past)


@solara.component
def About(replaying: Replaying, past: Past) -> None:
    """Show facts of the open recording."""
    provenance = replaying.provenance
    facts = {
        "file": replaying.name,
        "model": title(replaying.model_shown) if replaying.model_shown else provenance["model"]["name"],
        "seed": provenance["seed"],
        "steps": f"{past.first_step:,} to {past.last_step:,}",
        "version": provenance["versions"].get("mesa-swarm", ""),
        **{name: value_text(value) for name, value in provenance["parameters"].items()},
    }
    solara.HTML(tag="h2", unsafe_innerHTML="About this recording")
    with rv.Html(tag="dl", class_="swarm-facts"):
        for name, value in facts.items():
            rv.Html(tag="dt", children=[parameter_label(name)])
            rv.Html(tag="dd", children=[f"{value!s:.60}"])


@solara.component
def RecordingFault(player: ReplayPlayer) -> None:
    """Show a read error on a card."""
    use_changes(player.changed)
    if player.error:
        way_out = "Go to the first step", player.rewind
        TroubleCard("This step cannot be read", player.error, way_out=way_out)


@solara.component
def Missing(player: ReplayPlayer) -> None:
    """Show what charts cannot show because it was not recorded."""
    use_changes(player.changed)
    text = player.series.note if player.series.complete else "Reading the recording ..."
    if text:
        rv.Html(tag="p", class_="swarm-hint", children=[text])


@solara.component
def Branch(replaying: Replaying) -> None:
    """Show the button that continues from the displayed step."""
    use_changes(replaying.changed)
    solara.HTML(tag="h2", unsafe_innerHTML="Branch from here")
    if replaying.model_shown:
        rv.Html(tag="p", class_="swarm-hint", children=[BRANCHING])
        changes = ", ".join(f"{name} {value_text(value)}" for name, value in replaying.changes.items())
        label = f"Continue live with {changes.replace('_', ' ')}" if changes else "Continue live"
        Button(label, replaying.branch, "swarm-do", enabled=not replaying.busy)
        Linked(ControlPanel, BranchPanel, replaying, bare=True)
    else:
        name = replaying.provenance["model"]["name"]
        rv.Html(tag="p", class_="swarm-hint", children=[f"{name} is not a model of this page; replay only."])


@solara.component
def Events(replaying: Replaying, player: ReplayPlayer) -> None:
    """Show the events as buttons that go to their steps."""
    use_changes(replaying.changed)
    solara.HTML(tag="h2", unsafe_innerHTML="Events")
    events = replaying.events
    if not events:
        text = "Searching the recording ..." if events is None else "The recording has no events."
        rv.Html(tag="p", class_="swarm-hint", children=[text])
        return
    if len(events) > MOST_EVENTS:
        rv.Html(tag="p", class_="swarm-hint", children=[f"The first {MOST_EVENTS} of {len(events):,}."])
    with solara.Div(classes=["swarm-list", "swarm-events"]):
        for place, event in enumerate(events[:MOST_EVENTS]):
            Button(f"{event.step:,}", partial(player.look_at, event.step), more=event.text).key(f"{place}")
