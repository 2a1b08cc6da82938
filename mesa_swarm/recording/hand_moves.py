"""Poses of driven bodies that are set by hand between two steps: small entries, which are replayed as they were."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mesa_swarm.base.errors import RecordingError
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.recording.container import Checkpoint, from_bytes, to_bytes

# Poses in one piece of a file, 1.3 MB in memory.
MOST_POSES = 1 << 15


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class HandMove:
    """Where driven bodies were sent by hand after a step, and before the next one.

    Parameters
    ----------
    step : int
    after : int
        How many complete states had been stored before, so that a move is not repeated on a state that includes it.
    bodies : int64 ndarray, shape (k,)
        unique_ids.
    poses : ndarray, shape (k, 3)
        x, y, heading.
    """

    step: int
    after: int
    bodies: np.ndarray
    poses: np.ndarray

    def apply(self, model: EngineModel) -> None:
        """Send the bodies of a model there, which has to have them."""
        table = model.parts.bodies.table
        rows = {body.unique_id: body.row for body in model.movers.agents}
        low, high = model.space.dimensions.T
        places, headings = self.poses[:, :2], self.poses[:, 2]
        if not rows.keys() >= set(self.bodies.tolist()):
            raise RecordingError(f"step {self.step + 1} cannot be run again: a body that was moved by hand is missing")
        if not ((places >= low) & (places <= high)).all() or not (np.abs(headings) <= np.pi).all():
            raise RecordingError(f"step {self.step + 1} cannot be run again: a body was moved off the map")
        body_rows = [rows[body] for body in self.bodies.tolist()]
        table.aim[body_rows], table.aim_heading[body_rows] = places, headings


def move_of(model: EngineModel, rows: np.ndarray, after: int) -> HandMove:
    """Return where driven bodies, by their rows, are to go in the next step."""
    movers = model.movers
    poses = np.column_stack([movers.aim[rows], movers.aim_heading[rows]])
    bodies = np.array([movers.agents[row].unique_id for row in rows.tolist()], np.int64)
    return HandMove(step=model.completed, after=after, bodies=bodies, poses=poses)


def moves_to_bytes(moves: Sequence[HandMove]) -> bytes:
    """Return moves as stored."""
    heads = np.array([[move.step, move.after, len(move.bodies)] for move in moves], np.int64)
    bodies, poses = (np.concatenate([getattr(move, name) for move in moves]) for name in ("bodies", "poses"))
    return to_bytes(Checkpoint(step=moves[0].step, state_hash="", facts={}, arrays=[heads, bodies, poses]))


def moves_from_bytes(content: bytes) -> list[HandMove]:
    """Return stored moves, checked but for what only the model knows."""
    try:
        heads, bodies, poses = from_bytes(content).arrays
        _check_stored(heads, bodies, poses)
    except ValueError:
        raise RecordingError("moves made by hand cannot be decoded") from None
    ends = np.cumsum(heads[:, 2]).tolist()
    return [
        HandMove(step=step, after=after, bodies=bodies[end - count : end], poses=poses[end - count : end])
        for (step, after, count), end in zip(heads.tolist(), ends, strict=True)
    ]


def _check_stored(heads: np.ndarray, bodies: np.ndarray, poses: np.ndarray) -> None:
    kinds = [(array.dtype.str, array.ndim) for array in (heads, bodies, poses)]
    if kinds != [("<i8", 2), ("<i8", 1), ("<f8", 2)] or heads.shape[1:] != (3,) or poses.shape != (len(bodies), 3):
        raise ValueError
    is_ordered = (np.diff(heads[:, :2], axis=0) >= 0).all()
    if not is_ordered or (heads < 0).any() or (heads[:, 2] > len(bodies)).any() or heads[:, 2].sum() != len(bodies):
        raise ValueError
