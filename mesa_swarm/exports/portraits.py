"""Portraits of recorded steps: what pictures show of a row of a recording."""

import warnings
from collections.abc import Iterator
from itertools import islice

import numpy as np

from mesa_swarm.errors import ExportError, ExportWarning
from mesa_swarm.experiments.portrait import Portrait
from mesa_swarm.exports.scenes import Scene, scene_of
from mesa_swarm.recording.frames import Frame
from mesa_swarm.recording.recording import Recording

NEEDED = ("position", "heading")
NO_FIRES = {"position": np.zeros((0, 2)), "radius": np.zeros(0), "temperature": np.zeros(0), "out": np.zeros(0, bool)}


class SceneRows:
    """The steps of a recording that can be exported, and their frames: as many as are whole.

    Parameters
    ----------
    recording : Recording

    Attributes
    ----------
    recording : Recording
    steps : int64 ndarray, shape (k,)

    Raises
    ------
    ExportError
        If nothing was recorded.
    """

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
        """Return the frame of a recorded step."""
        return self.recording[int(np.searchsorted(self.steps, step))]


class Portraits:
    """What pictures show of the steps of a recording.

    Parameters
    ----------
    rows : SceneRows

    Attributes
    ----------
    scene : Scene
    steps : int64 ndarray, shape (k,)
        Those that can be shown: the recorded ones and, if it is known, the one at which the recording began.

    Raises
    ------
    ExportError
        If positions or headings were not recorded.
    """

    def __init__(self, rows: SceneRows) -> None:
        missing = [name for name in NEEDED if name not in rows.recording.columns]
        if missing:
            raise ExportError(
                f"{missing[0]} was not recorded in {rows.recording.path}; pictures need it, tables do not"
            )
        self.scene: Scene = scene_of(rows.recording)
        if self.scene.note:
            _warn(self.scene.note)
        self._rows = rows
        self._start = _start_before(rows, self.scene)
        self.steps = rows.steps if self._start is None else np.array([self._start.step, *rows.steps])
        self._hot: list[np.ndarray] | None = None

    def frame(self, step: int) -> Frame:
        """Return the frame of one of the steps."""
        return self._start if self._start and step == self._start.step else self._rows.frame(step)

    def at(self, step: int) -> Portrait:
        """Return the portrait of one of the steps."""
        frame, scene = self.frame(step), self.scene
        return Portrait(
            steps=frame.step,
            bounds=scene.bounds,
            obstacles=scene.at(frame.step).obstacles,
            loads=self._loads(frame),
            designs=scene.designs,
            robots=self._robots(frame),
            fires=_fires(frame),
            history={},
            series={},
        )

    def hot(self, frame: Frame) -> np.ndarray:
        """Return which robots are too hot to fight, as recorded or as their temperatures since the first row tell."""
        if "hot" in frame.columns:
            return frame["hot"]
        if "temperature" not in frame.columns or frame is self._start:
            return np.zeros(len(frame.robots), bool)
        if self._hot is None:
            frames = (self._rows.frame(step) for step in self._rows.steps)
            self._hot = list(hot_robots(frames, self.scene))
        return self._hot[int(np.searchsorted(self._rows.steps, frame.step))]

    def radius_of(self, robot: int) -> float:
        """Return the radius of the robot with this unique_id."""
        return self.scene.robots.get(robot, (self.scene.designs[-1].radius, 0))[0]

    def _robots(self, frame: Frame) -> dict[str, np.ndarray]:
        unknown = self.scene.designs[-1].radius, len(self.scene.designs) - 1
        bodies = [self.scene.robots.get(robot, unknown) for robot in frame.robots.tolist()]
        radius, design = np.array(bodies).reshape(-1, 2).T
        return {
            "position": frame["position"].astype(float),
            "heading": frame["heading"].astype(float),
            "radius": radius,
            "design": design.astype(int),
            "hot": self.hot(frame),
        }

    def _loads(self, frame: Frame) -> tuple:
        if "loads" not in frame.columns:
            return ()
        forms = self.scene.forms
        return tuple(forms[load].shape_at(tuple(pose)) for load, *pose in frame["loads"].tolist() if load in forms)


def hot_robots(frames: Iterator[Frame], scene: Scene) -> Iterator[np.ndarray]:
    """Yield which robots are too hot in each frame: from `leave` on, until they have cooled to `join`.

    Robots that are first seen between the two are taken as not too hot.
    """
    hot, robots = np.zeros(0, bool), np.zeros(0, int)
    for frame in frames:
        if not np.array_equal(robots, frame.robots):
            hot, robots = np.isin(frame.robots, robots[hot]), frame.robots
        temperature, setting = frame["temperature"], scene.at(frame.step)
        hot = (temperature >= setting.leave) | (hot & (temperature > setting.join))
        yield hot


def _start_before(rows: SceneRows, scene: Scene) -> Frame | None:
    """Return the frame at which the recording began, if it is known and as far from the first row as rows are."""
    start = scene.start
    before = start is not None and start.step < rows.steps[0] and start.step % rows.recording.provenance["every"] == 0
    return start if before else None


def _fires(frame: Frame) -> dict[str, np.ndarray]:
    if "fires" not in frame.columns:
        return NO_FIRES
    fires = frame["fires"]
    # Single precision may have rounded a temperature to just above 1.
    return {
        "position": np.column_stack([fires["x"], fires["y"]]).astype(float),
        "radius": fires["radius"].astype(float),
        "temperature": np.clip(fires["temperature"].astype(float), 0.0, 1.0),
        "out": fires["out"],
    }


def _warn(text: str) -> None:
    warnings.warn(text, ExportWarning, stacklevel=2)
