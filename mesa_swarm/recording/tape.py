"""Rows on their way into a file: gathered in chunks, each with what came and went before it."""

import json
from bisect import bisect_left
from time import perf_counter
from typing import Any

import pyarrow as pa

from mesa_swarm.errors import RecordingError
from mesa_swarm.files import shown_path
from mesa_swarm.observed_world import ObservedWorld
from mesa_swarm.recording.layout import Chunk, Layout, population_of
from mesa_swarm.recording.scenery import scenery_of, shows
from mesa_swarm.recording.schema import check_values, checked_change, checked_scenery, longest_gap
from mesa_swarm.recording.sealed_stream import CHANGE, SealedWriter
from mesa_swarm.recording.things import summary

HASH_EVERY = 100
# A chunk ends with whichever comes first. Larger ones make finding a frame slow, smaller ones make the file large.
MOST_ROWS = 256
MOST_BYTES = 2_000_000
MOST_SECONDS = 1.0


class Tape:
    """Rows gathered in a chunk, and the file they go to.

    What is pending follows from two counts, rows put and rows sealed, so that Ctrl-C between any two
    instructions neither loses a row nor writes one twice.
    """

    def __init__(self, layout: Layout, writer: SealedWriter, model: ObservedWorld, every: int = 1) -> None:
        self.writer = writer
        self._gap, self._newest = longest_gap(every), model.completed
        self.rows = 0
        self._layout = layout
        self._seen, self._scenery = _seen(model), scenery_of(model)
        self._chunk: Chunk | None = None
        self._hashed = -1
        self._written_at = self._synced_at = perf_counter()

    def put(self, model: ObservedWorld) -> None:
        """Keep the model as it is now."""
        chunk, step = self._chunk, model.completed
        self._check_gap(step)
        self._layout.prepare(model)
        seen = _seen(model)
        if chunk is None or seen != self._seen:
            self.flush()
            if seen != self._seen:
                self._tell_change(model)
                self._seen = seen
            chunk = self._chunk = self._new_chunk(model)
        state_hash = None
        if step // HASH_EVERY != self._hashed:
            state_hash, self._hashed = model.state_hash(), step // HASH_EVERY
        row = self.rows - self.writer.sealed.rows
        chunk.put(row, step, state_hash)
        self.rows, self._newest = self.rows + 1, step
        if row + 1 == chunk.capacity or perf_counter() - self._written_at > MOST_SECONDS:
            self.flush()

    def attach(self, name: str, content: bytes, step: int) -> None:
        """Write what is no row, after all rows before it."""
        self.flush()
        self.writer.attach(name, content, step)

    def flush(self) -> None:
        """Write the pending rows as one chunk."""
        pending = self.rows - self.writer.sealed.rows
        if self._chunk is not None and pending:
            self._write(self._chunk, pending)
        self._written_at = perf_counter()
        if self._written_at - self._synced_at > MOST_SECONDS:
            self.writer.sync()
            self._synced_at = self._written_at

    def close(self, broken_off: bool = False) -> None:
        """Write what is left and end the file; one without rows replaces no other if it was broken off."""
        if self.writer.closed:
            return
        try:
            self.flush()
            if broken_off and not self.writer.is_in_place:
                self.writer.abandon()
            self.writer.close()
        except (RecordingError, OSError):
            self.writer.abandon()
            raise

    def _write(self, chunk: Chunk, rows: int) -> None:
        """Write the first rows of a chunk; if no reader would take one of them, those before it, and say so."""
        batch, first = chunk.batch(rows), int(chunk.steps[0])
        try:
            check_values(batch, first, shown_path(self.writer.path))
        except RecordingError:
            good = bisect_left(range(1, rows), True, key=lambda number: not _is_readable(chunk.batch(number)))
            if good:
                self.writer.write(chunk.batch(good), first)
            raise
        self.writer.write(batch, first)

    def _tell_change(self, model: ObservedWorld) -> None:
        """Write what there is since the last row, and what it looks like if that is news."""
        told: dict[str, Any] = {"there": summary(model)}
        scenery = scenery_of(model)
        if not shows(self._scenery, scenery):
            told["scenery"] = self._scenery = scenery
        text = json.dumps(told).encode()
        try:
            checked_scenery(checked_change(text).get("scenery", scenery))
        except (RecordingError, ValueError) as error:
            raise RecordingError(
                f"{shown_path(self.writer.path)} cannot hold what came or went at step {model.completed}: {error}"
            ) from None
        self.attach(CHANGE, text, model.completed)

    def _check_gap(self, step: int) -> None:
        if step > self._newest + self._gap:
            raise RecordingError(
                f"{shown_path(self.writer.path)} cannot go on at step {step}: the last row is of step {self._newest}, "
                f"and at most {self._gap:,} steps may lie between two; start another recording"
            )

    def _new_chunk(self, model: ObservedWorld) -> Chunk:
        row_bytes = Chunk(self._layout, model, 1).row_bytes
        return Chunk(self._layout, model, max(1, min(MOST_ROWS, MOST_BYTES // row_bytes)))


def _seen(model: ObservedWorld) -> tuple:
    """Return what differs whenever the model may look other than it did, besides what rows hold."""
    return population_of(model), model.fire_constants


def _is_readable(batch: pa.RecordBatch) -> bool:
    try:
        check_values(batch, 0, "")
    except RecordingError:
        return False
    return True
