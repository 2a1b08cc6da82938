"""Running a recorded model again, and finding the first step and robot that differ."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mesa_swarm.errors import RecordingError
from mesa_swarm.observed_world import ObservedWorld
from mesa_swarm.progress import progress_bar
from mesa_swarm.recording.layout import TABLES, Chunk, Layout
from mesa_swarm.recording.provenance import rebuilt
from mesa_swarm.recording.recording import Frame, Recording, chunk_of
from mesa_swarm.recording.things import summary

MOST_NAMED = 3


@dataclass(frozen=True, kw_only=True, slots=True)
class Verification:
    """What running a recording again has shown; as a text one sentence.

    Parameters
    ----------
    same : bool
        Whether nothing differs.
    rows : int
        How many rows were compared before the first that differs.
    step : int or None
        The first step that differs.
    robots : tuple of int
        unique_ids of the robots that differ in it; none if something else does.
    column : str or None
        The first recorded column that differs.
    text : str
    """

    same: bool
    rows: int
    step: int | None = None
    robots: tuple[int, ...] = ()
    column: str | None = None
    text: str = ""

    def __str__(self) -> str:
        return self.text


def verify(recording: Recording, model_class: type, progress: bool = False) -> Verification:
    """Run the model of a recording again from its parameters and compare every row.

    Parameters
    ----------
    recording : Recording
    model_class : type
        The class of the model that was recorded. It is given and not looked up: opening a file runs no code.
    progress : bool
        Whether to show a bar.

    Raises
    ------
    RecordingError
        If the recording is of another class, or was made of a model that its parameters alone do not make.

    Examples
    --------
    >>> import tempfile
    >>> from mesa_swarm.models.fire_fighting import FireFighting
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     model = FireFighting(rng=1)
    ...     with model.record(f"{folder}/run.arrow"):
    ...         end = model.run(20)
    ...     print(verify(Recording(f"{folder}/run.arrow"), FireFighting))
    all 20 rows to step 20 are the same
    """
    model = started_again(recording, model_class)
    layout = Layout(model, recording.columns, recording.provenance["exact"])
    with progress_bar(len(recording), "rows", progress) as bar:
        for row, (frame, again) in enumerate(_pairs(recording, model, layout)):
            difference = _difference(row, frame, again)
            if difference is not None:
                return difference
            bar.update()
    last = f" to step {recording[-1].step}" if len(recording) else ""
    return Verification(same=True, rows=len(recording), text=f"all {len(recording)} rows{last} are the same")


def started_again(recording: Recording, model_class: type) -> ObservedWorld:
    """Return the model as it was when the recording began.

    Raises
    ------
    RecordingError
        If its parameters alone do not make that model.
    """
    facts = recording.provenance
    model = rebuilt(facts, model_class)
    while model.completed < facts["start"]["step"]:
        model.step()
    if model.state_hash() != facts["start"]["state_hash"]:
        raise RecordingError(
            f"{recording.path} began with a model that {model_class.__name__}'s parameters alone do not make: "
            "it was changed by hand, or other versions made it; build it in a constructor to run it again"
        )
    return model


def run_to(recording: Recording, model: ObservedWorld, step: int) -> None:
    """Run a model that is as it was at some step of a recording to a later one, compared with what was recorded.

    Rows are compared where they have fingerprints, and the last one; what came and went in between, always.

    Raises
    ------
    RecordingError
        If what was recorded does not come out.
    """
    layout = Layout(model, recording.columns, recording.provenance["exact"])
    begin = model.completed
    for row in range(recording.row_after(begin), len(recording)):
        frame = recording[row]
        if frame.step > step:
            break
        _check_change(recording, model, frame.step)
        if frame.state_hash is not None or frame.step == step:
            difference = _difference(row, frame, _again(frame, model, layout))
            if difference is not None:
                raise RecordingError(f"does not come out the same when run again: {difference}")
    while model.completed < step:
        model.step()


def last_same(recording: Recording, model: ObservedWorld, step: int) -> int:
    """Run a model beside a recording, and return the last step, at most the given one, at which all is the same."""
    layout = Layout(model, recording.columns, recording.provenance["exact"])
    same = model.completed
    for row in range(recording.row_after(same), len(recording)):
        frame = recording[row]
        try:
            _check_change(recording, model, frame.step)
        except RecordingError:
            return same
        if frame.step > step or _difference(row, frame, _again(frame, model, layout)) is not None:
            return same
        same = frame.step
    return same


def _check_change(recording: Recording, model: ObservedWorld, step: int) -> None:
    """Run to a step after which other robots, obstacles or fires were recorded, and see whether they are there."""
    if step not in recording.changes:
        return
    while model.completed < step:
        model.step()
    if summary(model) != recording.changes[step]:
        raise RecordingError(
            f"does not come out the same when run again: step {step} is the first with robots, obstacles or fires "
            "that were added or removed by hand"
        )


def _pairs(recording: Recording, model: ObservedWorld, layout: Layout) -> Iterator[tuple[Frame, Frame]]:
    """Run beside the recording: each frame, and what it is now."""
    for frame in recording:
        yield frame, _again(frame, model, layout)


def _again(frame: Frame, model: ObservedWorld, layout: Layout) -> Frame:
    """Run to the step of a frame and return what it is now."""
    while model.completed < frame.step:
        model.step()
    chunk = Chunk(layout, model, 1)
    chunk.put(0, model.completed, model.state_hash() if frame.state_hash is not None else None)
    return chunk_of(chunk.batch(1))[0]


def _difference(row: int, frame: Frame, again: Frame) -> Verification | None:
    if not np.array_equal(frame.robots, again.robots):
        return _verdict(row, frame, "robots", f"{len(frame.robots)} robots were recorded, now {len(again.robots)} are")
    for name in frame.columns:
        differing = _differing(name, frame, again)
        if differing is not None:
            return _verdict(row, frame, name, f"{name} differs{_named(differing)}", differing)
    if frame.state_hash != again.state_hash:
        text = "the state differs in something that was not recorded, since the last state hash"
        return _verdict(row, frame, None, text)
    return None


def _differing(name: str, frame: Frame, again: Frame) -> tuple[int, ...] | None:
    """Return which robots differ in a column; none of them if a table differs of which robots are no part."""
    old, new = frame[name], again[name]
    if name in TABLES:
        return None if old.tobytes() == new.tobytes() else ()
    same = (old == new) | ((old != old) & (new != new))  # noqa: PLR0124 - NaN is as good as NaN
    wrong = ~same.reshape(len(same), -1).all(axis=1)
    return tuple(frame.robots[wrong].tolist()) if wrong.any() else None


def _named(robots: tuple[int, ...]) -> str:
    if not robots:
        return ""
    shown = ", ".join(map(str, robots[:MOST_NAMED]))
    more = f" and {len(robots) - MOST_NAMED} more" if len(robots) > MOST_NAMED else ""
    return f" for robot{'s' if len(robots) > 1 else ''} {shown}{more}"


def _verdict(row: int, frame: Frame, column: str | None, what: str, robots: tuple[int, ...] = ()) -> Verification:
    text = f"step {frame.step} is the first that differs: {what}"
    return Verification(same=False, rows=row, step=frame.step, robots=robots, column=column, text=text)
