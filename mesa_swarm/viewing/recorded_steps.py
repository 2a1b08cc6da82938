"""The steps of a recording that are exported: frames for tables; frames and what stands behind them for pictures."""

import warnings
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from typing import cast

import numpy as np

from mesa_swarm.base.errors import ExportError, ExportWarning, RecordingError, SwarmError
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.recording.frames import Frame, Rows
from mesa_swarm.recording.layout import Chunk, Layout
from mesa_swarm.recording.provenance import hash_in_format, rebuild_model, scenery_of
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.resume import shipped_class_of
from mesa_swarm.viewing.scene import UNKNOWN, Scene, scene_of_recording, usual_scenery

NEEDED = ("position", "heading")


class RecordedSteps:
    """The whole rows of a recording."""

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self.steps = np.array([frame.step for frame in islice(recording, recording.intact)], np.int64)
        if not len(self.steps):
            raise ExportError(f"{recording.path} {recording.damage or 'has no rows'}; there is nothing to export")
        if recording.damage:
            _warn(f"{recording.path} {recording.damage}; the whole rows are exported")
        elif not recording.complete:
            _warn(f"{recording.path} was not closed: its {len(self.steps)} whole rows are exported")

    def frame(self, step: int) -> Frame:
        """Return the frame of one of the steps."""
        return self.recording[int(np.searchsorted(self.steps, step))]


class PicturedSteps(RecordedSteps):
    """The steps of a recording that can be drawn: its rows and, if it is known, the state in which it began.

    That state is known of models that come with mesa_swarm and were not changed by hand before: a recording never
    makes a program import other code. Robots and loads that recordings of old versions do not describe are taken from
    such a model too; of other models obstacles are those of the map, and robots have a radius of 5.
    """

    def __init__(self, recording: Recording) -> None:
        super().__init__(recording)
        missing = [name for name in NEEDED if name not in recording.columns]
        if missing:
            raise ExportError(f"{missing[0]} was not recorded in {recording.path}; pictures need it, tables do not")
        model = _first_state(recording)
        self.scene = _picture_scene(recording, model)
        # The state in which the recording began, if it is known.
        self.start = None if model is None else _first_frame(recording, model)
        self._rows = self.steps
        # What cannot be drawn as it was.
        self.note = self._limits(bool(recording.sceneries) or model is not None)
        if self.note:
            _warn(self.note)
        if self._begins_before():
            self.steps = np.array([cast(Frame, self.start).step, *self._rows])
        self._hot: list[np.ndarray] | None = None

    def frame(self, step: int) -> Frame:
        """Return the frame of one of the steps; its column `hot` is there even if it was not recorded."""
        if len(self.steps) > len(self._rows) and step == self.steps[0]:
            return cast(Frame, self.start)
        frame = self._row(step)
        return (
            frame if "hot" in frame.columns else replace(frame, columns={**frame.columns, "hot": self._hot_of(frame)})
        )

    def _row(self, step: int) -> Frame:
        return self.recording[int(np.searchsorted(self._rows, step))]

    def _hot_of(self, frame: Frame) -> np.ndarray:
        """Return which robots are too hot to fight, as their temperatures since the first row show."""
        if "temperature" not in frame.columns:
            return np.zeros(len(frame.robots), bool)
        if self._hot is None:
            self._hot = list(hot_robots(map(self._row, self._rows), self.scene))
        return self._hot[int(np.searchsorted(self._rows, frame.step))]

    def _begins_before(self) -> bool:
        """Whether the state in which it began is known, and as far from the first row as rows are from each other."""
        start, first = self.start, self._rows[0]
        return start is not None and start.step < first and start.step % self.recording.provenance["every"] == 0

    def _limits(self, described: bool) -> str:
        if not described:
            return (
                f"{self.scene.name} cannot be made again: all robots are drawn with a radius of {UNKNOWN.radius:g}, "
                "obstacles as they are on the map, loads not at all"
            )
        ids = np.concatenate([self._row(step).robots for step in self._rows[[0, -1]]])
        if (self.scene.design_of(ids) < 0).any():
            return f"robots that were added while this was recorded are drawn with a radius of {UNKNOWN.radius:g}"
        return ""


def hot_robots(frames: Iterator[Frame], scene: Scene) -> Iterator[np.ndarray]:
    """Yield which robots are too hot in each frame: from `leave` on, until they have cooled to `join`.

    Robots that are first seen between the two are taken as not too hot.
    """
    hot, robots = np.zeros(0, bool), np.zeros(0, int)
    for frame in frames:
        if not np.array_equal(robots, frame.robots):
            hot, robots = np.isin(frame.robots, robots[hot]), frame.robots
        temperature, (leave, join) = frame["temperature"], scene.limits(frame.step)
        hot = (temperature >= leave) | (hot & (temperature > join))
        yield hot


def _first_state(recording: Recording) -> EngineModel | None:
    """Return the model as the recording began, None if its constructor does not make that."""
    try:
        model = rebuild_model(recording.provenance, shipped_class_of(recording))
    except SwarmError:
        return None
    facts, start = recording.provenance, recording.provenance["start"]
    same = model.completed == start["step"] and hash_in_format(model, facts["format"]) == start["state_hash"]
    return cast(EngineModel, model) if same else None


def _first_frame(recording: Recording, model: EngineModel) -> Frame:
    """Return what the first row would be, had the state before the first step been recorded."""
    chunk = Chunk(Layout(model, recording.columns, recording.provenance["exact"]), model, 1)
    chunk.put(model, 0, None, len(model.events))
    frame = Rows(chunk.batch(1))[0]
    return replace(frame, columns={"hot": np.zeros(len(frame.robots), bool), **frame.columns})


def _picture_scene(recording: Recording, model: EngineModel | None) -> Scene:
    sceneries = recording.sceneries
    if not sceneries and model is not None:
        sceneries = ((model.completed, scenery_of(model)),)
    if not sceneries:
        sceneries = ((0, {**usual_scenery(recording), "loads": [], "leave": np.inf}),)
    join = np.inf if model is None else model.fire_constants.join
    complete = [(step, {"join": min(join, scenery["leave"]), **scenery}) for step, scenery in sceneries]
    scene = scene_of_recording(recording, complete)
    try:
        scene.build()
    except SwarmError as error:
        raise RecordingError(f"{recording.path} has an invalid scenery: {error}") from None
    return scene


def _warn(text: str) -> None:
    warnings.warn(text, ExportWarning, stacklevel=2)
