"""Trails: where robots were in all of the last steps, so that none crosses a wall that its robot did not cross."""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.observers import Observer
from mesa_swarm.viewing.frame_bytes import on_map

# Steps that a trail on a page shows; ``canvas.js`` has the same number.
TRAIL_STEPS = 100
# Places of a picture, of all robots and steps together: the trails of many robots are shorter at high speeds.
MOST_PLACES = 20_000
# Steps of a place on the map, of its width and of its height.
PLACES = 65535
# A robot does not go farther than this times its speed in a step: what does was put there. See `reach`.
MARGIN = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class TrailPoint:
    """Where all robots were after a step.

    Parameters
    ----------
    step : int
    places : ndarray of float32, shape (n, 2)
    moved : tuple of int
        The rows of robots that were put there: they have not gone there from the point before.
    """

    step: int
    places: np.ndarray
    moved: tuple[int, ...] = ()


class TrailKeeper(Observer):
    """Notes where a model's robots are, after each step and whenever they were moved between two steps.

    While no model is followed it costs nothing. When robots are added or removed, it begins anew.
    """

    def __init__(self) -> None:
        self._model: EngineModel | None = None
        self._points: deque[TrailPoint] = deque()
        self._robots: np.ndarray = np.empty(0, int)
        self._version = -1
        self._in_step = False

    def follow(self, model: EngineModel | None) -> None:
        """Note the places of this model's robots from now on, and no other's; None for none."""
        if model is self._model:
            return
        if self._model is not None and self in self._model.observers:
            self._model.observers.remove(self)
        self._model, self._version, self._in_step = model, -1, False
        if model is None:
            self._points.clear()
        elif self not in model.observers:
            model.observers.append(self)

    def points(self) -> tuple[TrailPoint, ...]:
        """Return the last points, oldest first; during a step that of the step before is the last one."""
        if self._model is not None and not self._in_step:
            self._note(self._model)
        return tuple(self._points)

    def before_step(self, model: EngineModel) -> None:
        """Notice what was moved between two steps."""
        self._note(model)
        self._in_step = True

    def between_steps(self, model: EngineModel) -> None:
        """Notice where robots have gone."""
        self._in_step = False
        self._note(model)

    def after_failure(self, model: EngineModel) -> None:
        """Notice that a step failed, after which robots may be anywhere."""
        self._in_step = False

    def replaced(self, old: EngineModel, new: EngineModel, what: list[str]) -> None:
        """Go on with the model that has taken the place of another."""
        self._model, self._version = new, -1

    def _note(self, model: EngineModel) -> None:
        step, places = model.completed, model.swarm.position.astype(np.float32)
        same, last = self._has_same_robots(model), self._points[-1] if self._points else None
        moved: tuple[int, ...] = ()
        if last is None or not same or not last.step <= step <= last.step + 1:
            self._points.clear()
        elif step == last.step:
            if places.tobytes() == last.places.tobytes():  # as a rule, and sooner known than by comparing numbers
                return
            differ = np.flatnonzero((places != last.places).any(axis=1))
            moved = tuple(sorted({*last.moved, *differ.tolist()}))
            self._points.pop()
        self._points.append(TrailPoint(step, places, moved))
        while len(self._points) > most_points(len(places)):
            self._points.popleft()

    def _has_same_robots(self, model: EngineModel) -> bool:
        if model.swarm.version == self._version:
            return True
        robots = model.swarm.unique_ids
        same = np.array_equal(robots, self._robots)
        self._robots, self._version = robots.copy(), model.swarm.version
        return same


def news(points: Sequence[TrailPoint], last: TrailPoint | None) -> tuple[Sequence[TrailPoint], bool]:
    """Return the points that a page lacks which has all up to `last`, and whether they go on from there.

    Examples
    --------
    >>> first, second = (TrailPoint(step, np.zeros((1, 2))) for step in (1, 2))
    >>> news((first, second), first) == ((second,), True), news((first, second), None) == ((first, second), False)
    (True, True)
    """
    begin = next((place + 1 for place in range(len(points) - 1, -1, -1) if points[place] is last), 0)
    return points[begin:], begin > 0


def reach(radius: float, max_speed: float, steps: int) -> float:
    """Return how far a robot may get in some steps: one that is farther away was put there, and its trail is broken.

    Whatever is put on the other side of a wall is farther away, since no robot is nearer to a wall than its radius.

    Examples
    --------
    >>> reach(5.0, 1.0, 1), reach(5.0, 1.0, 10)
    (10.0, 15.0)
    """
    return max(2 * radius, MARGIN * max_speed * steps)


def stride(radius: float, max_speed: float) -> int:
    """Return how many steps may lie between two points of a line: between them a robot goes less than two radii.

    A straight line between them then crosses no wall: it is nowhere farther from the robot's way than half of it, less
    than the radius, and the way nowhere nearer to a wall than the radius.

    Examples
    --------
    >>> stride(5.0, 1.0), stride(5.0, 8.0)
    (9, 1)
    """
    return max(1, math.ceil(2 * radius / max_speed) - 1) if max_speed > 0 else TRAIL_STEPS


def packed_points(points: Sequence[TrailPoint], bounds: Sequence[float]) -> bytes:
    """Return the places of points as uint16 from 0 to 65535 along the width and the height of the map."""
    return on_map(np.concatenate([point.places for point in points]), bounds, PLACES).tobytes() if points else b""


def most_points(robots: int) -> int:
    """Return how many points a trail has at most, that of the picture itself included."""
    return max(1, min(TRAIL_STEPS + 1, MOST_PLACES // max(1, robots)))
