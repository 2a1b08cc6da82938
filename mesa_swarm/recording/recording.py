"""Recordings as read: frames, whole columns, tables, events."""

import os
from bisect import bisect_left, bisect_right
from collections import OrderedDict
from collections.abc import Iterable, Iterator
from functools import cached_property
from itertools import accumulate
from operator import index
from pathlib import Path
from typing import Any, overload

import numpy as np
import pandas as pd

from mesa_swarm.base.errors import (
    InvalidValueError,
    RecordingError,
    UnknownNameError,
    check_count,
    shortened,
    unknown_name,
)
from mesa_swarm.model.events import EventLog
from mesa_swarm.recording.changes import HandMove, Intervention, intervention_from_json, moves_from_bytes
from mesa_swarm.recording.container import Checkpoint, from_bytes
from mesa_swarm.recording.frames import Event, Frame, Rows, events_of, field_names, field_values, table_of
from mesa_swarm.recording.layout import PIXELS, TABLES
from mesa_swarm.recording.provenance import from_metadata, join_sceneries
from mesa_swarm.recording.schema import (
    check_recorded_columns,
    checked_content,
    checked_rows,
    checked_scenery,
    find_misplaced,
)
from mesa_swarm.recording.sealed_stream import CHANGE, CHECKPOINT, INTERVENTION, MOVES, Piece, SealedReader

# Decoded chunks in memory, of about 2 MB each.
MOST_CACHED = 8
# A larger one is cached alone.
LARGEST_CACHED = 8_000_000


class Recording:
    """A recorded run. Nothing is decoded before it is read; a torn end is ignored.

    Parameters
    ----------
    path : str or Path

    Attributes
    ----------
    path : Path
    provenance : dict
        model, parameters, map (as TOML), seed, versions, every, exact, start ...
    columns : tuple of str
    complete : bool
        Whether the recording was closed and is whole at its end. If not, and there is no `damage`, its program was
        killed or is still running.
    lost : int
        Bytes at the end that are not a whole chunk and were ignored.

    Raises
    ------
    RecordingError
        If the file cannot be read, or is damaged at its beginning.

    Examples
    --------
    >>> import tempfile
    >>> from mesa_swarm.models.fire_fighting import FireFighting
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     model = FireFighting(n_robots=3, rng=1)
    ...     with model.record(f"{folder}/run.arrow"):
    ...         end = model.run(30)
    ...     recording = Recording(f"{folder}/run.arrow")
    ...     len(recording), recording.at(30)["position"].shape, recording.complete
    (30, (3, 2), True)
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        if not isinstance(path, (str, os.PathLike)):
            raise RecordingError(f"path is {shortened(path)}; expected the name of a recording")
        self.path = Path(path)
        self._reader = SealedReader(self.path)
        self.provenance = from_metadata(self._reader.schema.metadata, self.path)
        check_recorded_columns(self._reader.schema, self.path)
        self._start = self.provenance["start"]["step"]
        self._check_order()
        self.columns = tuple(self._reader.schema.names[3:])
        self.complete = self._reader.complete
        self.lost = 0 if self.complete else self._reader.lost
        self._ends = list(accumulate(piece.rows for piece in self._reader.pieces))
        self._firsts = [piece.step for piece in self._reader.pieces]
        self._chunks: OrderedDict[int, Rows] = OrderedDict()
        self._event_totals: list[tuple[int, int]] = []  # steps of rows, and the number of events up to each

    def _check_order(self) -> None:
        """Refuse seals that are out of order; nothing after a damaged one is read."""
        pieces = sorted((*self._reader.pieces, *self._reader.attached))
        piece = find_misplaced(pieces, self._start, self.provenance["every"])
        if piece is None:
            return
        if self._reader.is_whole(piece):
            raise RecordingError(f"{self.path} has step {piece.step} out of order")
        self._reader.cut(piece)

    def __repr__(self) -> str:
        state = "" if self.complete else ", damaged" if self._reader.broken else ", not closed"
        return f"<Recording of {self.provenance['model']['name']}, {len(self)} rows{state}: {self.path}>"

    def __len__(self) -> int:
        """Return the number of recorded steps."""
        return self._ends[-1] if self._ends else 0

    @cached_property
    def intact(self) -> int:
        """The number of rows before the first damaged one; reading it checks all chunks."""
        damaged_places = (place for place, piece in enumerate(self._reader.pieces) if not self._reader.is_whole(piece))
        damaged = next(damaged_places, len(self._ends))
        return self._ends[damaged - 1] if damaged else 0

    @cached_property
    def damage(self) -> str:
        """What is damaged, as text to follow the file's name; empty if nothing is, even if it was not closed."""
        if self.intact < len(self) or self._reader.broken:
            step = self[self.intact - 1].step if self.intact else self._start
            return f"is damaged after step {step}: {_count_rows(self.intact)} whole, the rest is not read"
        damaged_piece = next((piece for piece in self._reader.attached if not self._reader.is_whole(piece)), None)
        if damaged_piece is None:
            return ""
        return f"is damaged at the piece of step {damaged_piece.step}: {_count_rows(self.intact)} whole"

    @property
    def why_short(self) -> str:
        """Why rows may be missing, as text to end a sentence; empty if it was closed or is damaged."""
        return "" if self.complete or self._reader.broken else "; it is not closed: call close() of its recorder"

    def __iter__(self) -> Iterator[Frame]:
        """Iterate over all frames, oldest first."""
        for place in range(len(self._ends)):
            yield from self._chunk(place)

    @overload
    def __getitem__(self, which: int) -> Frame: ...

    @overload
    def __getitem__(self, which: slice) -> list[Frame]: ...

    @overload
    def __getitem__(self, which: str) -> np.ndarray: ...

    def __getitem__(self, which: int | slice | str) -> Frame | list[Frame] | np.ndarray:
        """Return the frame of one row, from the end if negative, those of a slice, or a column at all steps.

        A column has the shape (k, n, ...).

        Raises
        ------
        IndexError
            If there is no such row.
        UnknownNameError, InvalidValueError
            If there is no such column, or robots were added or removed, so that it has no shape.
        """
        if isinstance(which, str):
            return self._whole(which)
        if isinstance(which, slice):
            return [self._frame(row) for row in range(len(self))[which]]
        return self._frame(_checked_row(which))

    def at(self, step: int) -> Frame:
        """Return the frame after one step.

        Raises
        ------
        InvalidValueError
            If that step was not recorded.
        """
        step = check_count("step", step)
        place = bisect_right(self._firsts, step) - 1
        for frame in self._chunk(place) if place >= 0 else ():
            if frame.step == step:
                return frame
        extent = f"{len(self)} steps from {self[0].step} to {self[-1].step}" if len(self) else "no step"
        raise InvalidValueError(f"step {step} was not recorded; the recording has {extent}{self.why_short}")

    def fields(self, step: int) -> dict[str, np.ndarray]:
        """Return the values of each field after one step, by name, shapes (rows, columns), row 0 at the bottom.

        With ``exact=True`` these are the values themselves. Else they are known to within 0.4 % of the largest value so
        far, the smaller ones better; of a field of more than 120,000 cells they are means of blocks of cells. A field
        that the model did not have then is left out.

        Raises
        ------
        InvalidValueError
            If that step was not recorded.

        Examples
        --------
        >>> import tempfile
        >>> from mesa_swarm import Field, SwarmModel
        >>> model = SwarmModel(rng=1)
        >>> model.add_field(Field("trail", cell=100.0)).deposit((450, 50), 3.0)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     with model.record(f"{folder}/run.arrow"):
        ...         end = model.run(2)
        ...     Recording(f"{folder}/run.arrow").fields(2)["trail"][0].tolist()
        [0.0, 0.0, 0.0, 0.0, 3.0, 0.0, 0.0, 0.0]
        """
        frame = self.at(step)
        return {name: field_values(frame, name) for name in field_names(frame.columns) if frame[PIXELS + name].size}

    @property
    def picture_widths(self) -> dict[str, int]:
        """The columns of the pictures of each field that rows have, by the field's name."""
        schema = self._reader.schema
        names = field_names(self.columns)
        return {name: schema.field(PIXELS + name).type.value_type.list_size for name in names}

    @cached_property
    def steps(self) -> np.ndarray:
        """The steps that were recorded, int64, shape (k,)."""
        return np.array([frame.step for frame in self], np.int64)

    @cached_property
    def hashes(self) -> dict[int, str]:
        """The model's fingerprints by step."""
        return {frame.step: frame.state_hash for frame in self if frame.state_hash is not None}

    @cached_property
    def checkpoints(self) -> tuple[int, ...]:
        """The steps of which the complete state was stored, from which `resume` continues."""
        return tuple(piece.step for piece in self._find_pieces(CHECKPOINT))

    def checkpoint(self, place: int) -> Checkpoint:
        """Return one of the stored states.

        Raises
        ------
        RecordingError
            If it is damaged.
        """
        piece = self._find_pieces(CHECKPOINT)[place]
        checkpoint = from_bytes(self._reader.content(piece))
        if checkpoint.step != piece.step:
            raise RecordingError(f"{self.path} has a checkpoint of step {checkpoint.step} instead of step {piece.step}")
        return checkpoint

    @cached_property
    def interventions(self) -> tuple[Intervention, ...]:
        """Manual changes during the recording, oldest first; older versions did not store them.

        Raises
        ------
        RecordingError
            If they are damaged.
        """
        interventions, states = [], 0
        for place, (name, piece) in enumerate(self._named):
            states += name == CHECKPOINT
            if name == INTERVENTION:
                # A checkpoint of a later step is not the state after it.
                following = [(next_name, after.step) for next_name, after in self._named[place + 1 : place + 2]]
                has_state = following == [(CHECKPOINT, piece.step)]
                content = self._reader.content(piece)
                interventions.append(intervention_from_json(piece.step, content, states if has_state else None))
        return tuple(interventions)

    @cached_property
    def hand_moves(self) -> tuple[HandMove, ...]:
        """Where driven bodies were sent by hand between two steps, oldest first.

        Raises
        ------
        RecordingError
            If they are damaged.
        """
        moves = (move for piece in self._find_pieces(MOVES) for move in moves_from_bytes(self._reader.content(piece)))
        by_moment = {(move.step, move.after): move for move in moves}  # Ctrl-C may have had some written twice
        return tuple(by_moment[key] for key in sorted(by_moment))

    @cached_property
    def changes(self) -> dict[int, list]:
        """The population after robots, obstacles or fires were added or removed, by the next recorded step.

        For each of the three kinds the number, and the last unique_id.

        Raises
        ------
        RecordingError
            If it is damaged.
        """
        # Format 1 stored the population alone.
        return {step: value["there"] if isinstance(value, dict) else value for step, value in self._changes.items()}

    @cached_property
    def sceneries(self) -> tuple[tuple[int, dict], ...]:
        """The shapes of robots and other objects, see `scenery_of`, each with the first step for which it is valid.

        Each includes all robots and loads. Older versions stored no scenery, or only the first one.

        Raises
        ------
        RecordingError
            If they are damaged.
        """
        first = self.provenance.get("scenery")
        later = [(step, change["scenery"]) for step, change in self._changes.items() if "scenery" in change]
        if not first:
            return ()
        try:
            return join_sceneries([(step, checked_scenery(value)) for step, value in [(self._start, first), *later]])
        except RecordingError as error:
            raise RecordingError(f"{self.path} has an invalid scenery: {error}") from None

    @cached_property
    def _changes(self) -> dict[int, Any]:
        try:
            return {
                piece.step: checked_content(CHANGE, self._reader.content(piece)) for piece in self._find_pieces(CHANGE)
            }
        except ValueError:
            raise RecordingError(f"{self.path} has a change of its population that cannot be decoded") from None

    def row_after(self, step: int) -> int:
        """Return the first row of a later step, or the number of rows."""
        return int(np.searchsorted(self.steps, step, side="right"))

    def to_pandas(self, table: str = "robots") -> pd.DataFrame:
        """Return a table with one row a robot and step, or a fire, contact, load, field or event and step.

        Fires are numbered 1, 2, ... as in pictures; frames have their unique_ids. Of loads and driven bodies the last
        column is the name of their kind, of fields their name.

        Parameters
        ----------
        table : str
            "robots", "fires", "contacts", "loads", "fields", "events" or "shown", the discs of added parts.

        Raises
        ------
        UnknownNameError
            If that was not recorded.
        """
        return table_of(self, self.checked_table(table), self.load_kinds)

    @property
    def load_kinds(self) -> dict[int, str]:
        """The kind of each load and driven body by unique_id, of those that are not plain loads."""
        loads = self.sceneries[0][1]["loads"] if self.sceneries else ()
        return {load["id"]: load["kind"] for load in loads if "kind" in load}

    def checked_table(self, table: str) -> str:
        """Return the name of a table if it was recorded, else raise UnknownNameError."""
        tables = ("robots", *(name for name in self.columns if name in TABLES))
        if table not in tables:
            raise UnknownNameError(unknown_name("recorded table", table, tables))
        return table

    @cached_property
    def events(self) -> "RecordedEvents":
        """The events that the model noted, as arrays: `step`, `name`, `unique_id` and `value`, see `SwarmModel.event`.

        Older versions recorded none. Called, as in ``recording.events()``, it returns what can be seen in the run as
        well: a list of `Event`, oldest first, of fires that went out, bursts of collisions, groups that merged, and
        the model's own.

        Examples
        --------
        >>> import tempfile
        >>> from mesa_swarm import SwarmModel
        >>> class Counting(SwarmModel):
        ...     def step(self):
        ...         super().step()
        ...         self.event("counted", value=self.steps)
        >>> model = Counting(rng=1)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     with model.record(f"{folder}/run.arrow"):
        ...         end = model.run(3)
        ...     recording = Recording(f"{folder}/run.arrow")
        ...     recording.events.value.tolist(), str(recording.events()[2])
        ([1.0, 2.0, 3.0], 'step 3: counted: value 3')
        """
        return RecordedEvents(self)

    def events_before(self, step: int) -> int:
        """Return how many events the model had noted in all when the row before that of a step was written."""
        begin, totals = self.provenance["start"].get("events", 0), self._event_totals
        # Rows from this step on may be damaged.
        for row in range(len(totals), len(self) if "events" in self.columns else 0):
            frame = self[row]
            if frame.step >= step:
                break
            totals.append((frame.step, (totals[-1][1] if totals else begin) + len(frame["events"])))
        place = bisect_left(totals, (step,))
        return totals[place - 1][1] if place else begin

    def _find_pieces(self, name: str) -> list[Piece]:
        return [piece for piece_name, piece in self._named if piece_name == name]

    @cached_property
    def _named(self) -> list[tuple[str, Piece]]:
        """The pieces without rows, with their names, which take long to find."""
        return [(self._reader.name(piece), piece) for piece in self._reader.attached]

    def _frame(self, row: int) -> Frame:
        count = len(self)
        place = row + count if row < 0 else row
        if not 0 <= place < count:
            raise IndexError(f"row {row} of {count} in {self.path}")
        chunk = bisect_right(self._ends, place)
        return self._chunk(chunk)[place - (self._ends[chunk - 1] if chunk else 0)]

    def _whole(self, name: str) -> np.ndarray:
        if name in TABLES:
            raise InvalidValueError(f"{name} is a table; read it with to_pandas({name!r}), or frame by frame")
        if name not in self.columns:
            raise UnknownNameError(unknown_name("recorded column", name, self.columns))
        values = [frame[name] for frame in self]
        if len({value.shape for value in values}) > 1 and name.startswith(PIXELS):
            raise InvalidValueError(f"{name} was removed in {self.path}; read it frame by frame")
        if len({value.shape for value in values}) > 1:
            raise InvalidValueError(f"robots were added or removed in {self.path}; read {name} frame by frame")
        return np.stack(values) if values else np.empty((0, 0))

    def _chunk(self, place: int) -> Rows:
        if place in self._chunks:
            self._chunks.move_to_end(place)
            return self._chunks[place]
        piece = self._reader.pieces[place]
        batch = self._reader.batch(piece)
        if batch.num_rows != piece.rows:
            raise RecordingError(
                f"{self.path} has {batch.num_rows} rows from step {piece.step} on; expected {piece.rows}"
            )
        chunk = checked_rows(batch, piece.step, self.provenance["every"], self.path)
        if batch.nbytes > LARGEST_CACHED:
            self._chunks.clear()
        self._chunks[place] = chunk
        if len(self._chunks) > MOST_CACHED:
            self._chunks.popitem(last=False)
        return chunk


class RecordedEvents(EventLog):
    """The events that a recorded model noted; called, all events that can be seen, see `Recording.events`."""

    def __init__(self, frames: Iterable[Frame] = ()) -> None:
        super().__init__()
        self._frames = frames
        for frame in frames:
            for event in frame.columns.get("events", np.empty(0)).tolist():
                self.append(*event)

    def __call__(self) -> list[Event]:
        """Return the events, oldest first."""
        return events_of(self._frames)


def _checked_row(which: Any) -> int:
    try:
        return index(which)
    except TypeError:
        raise InvalidValueError(
            f"row is {shortened(which)}; expected a whole number, a slice or the name of a column"
        ) from None


def _count_rows(rows: int) -> str:
    return f"{rows} row{' is' if rows == 1 else 's are'}"
