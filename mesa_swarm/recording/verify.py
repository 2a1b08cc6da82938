"""Running a recorded model again, and finding the first step and robot that differ."""

import os
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from mesa_swarm.errors import RecordingError
from mesa_swarm.progress import progress_bar
from mesa_swarm.recording.frames import Frame
from mesa_swarm.recording.interventions import Intervention, in_words
from mesa_swarm.recording.layout import TABLES
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.rerun import Rerun, started_again

MOST_NAMED = 3


@dataclass(frozen=True, kw_only=True, slots=True)
class Verification:
    """What running a recording again has shown; as a text one sentence.

    Parameters
    ----------
    same : bool
        Whether nothing differs and nothing of the recording is damaged.
    rows : int
        How many rows were compared before the first that differs.
    step : int or None
        The first step that differs.
    robots : tuple of int
        unique_ids of the robots that differ in it; none if something else does.
    column : str or None
        The first recorded column that differs.
    text : str
    interventions : tuple of Intervention
        What was changed by hand up to there. It is not verified but taken from the recording.
    """

    same: bool
    rows: int
    step: int | None = None
    robots: tuple[int, ...] = ()
    column: str | None = None
    text: str = ""
    interventions: tuple[Intervention, ...] = ()

    def __str__(self) -> str:
        return self.text + in_words(self.interventions)


def verify(recording: Recording | str | os.PathLike[str], model_class: type, progress: bool = False) -> Verification:
    """Run the model of a recording again from its parameters and compare every row.

    A model that its parameters alone do not make, such as one to which robots were added from outside, is run from the
    state that was stored when the recording began; the verdict says so, and tells nothing of how that state came about.

    Where somebody changed the model by hand, it goes on from the state that was stored after that; the verdict names
    these places. Of a damaged recording the rows before the damage are compared, and the verdict names it.

    Parameters
    ----------
    recording : Recording or path
    model_class : type
        The class of the model that was recorded. It is given and not looked up: opening a file runs no code.
    progress : bool
        Whether to show a bar.

    Raises
    ------
    RecordingError
        If the recording is of another class, or of a model that its parameters alone do not make and whose state was
        not stored.

    Examples
    --------
    >>> import tempfile
    >>> from mesa_swarm.models.fire_fighting import FireFighting
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     model = FireFighting(rng=1)
    ...     with model.record(f"{folder}/run.arrow"):
    ...         end = model.run(20)
    ...     print(verify(f"{folder}/run.arrow", FireFighting))
    all 20 rows to step 20 are the same
    """
    recording = recording if isinstance(recording, Recording) else Recording(recording)
    rows = recording.intact
    last = recording[rows - 1].step if rows else recording.provenance["start"]["step"]
    with progress_bar(last, "steps", progress) as bar:
        rerun = started_again(recording, model_class, lambda model: bar.update(model.completed - bar.n))
        verdict = _all_compared(rerun, rows)
    verdict = replace(verdict, text=verdict.text + rerun.begin)
    if recording.damage:
        verdict = replace(verdict, same=False, text=f"{verdict.text}; {recording.path} {recording.damage}")
    return replace(verdict, interventions=rerun.taken)


def run_to(rerun: Rerun, step: int) -> None:
    """Run what is as it was at some step of a recording to a later one, compared with what was recorded.

    Rows are compared where they have fingerprints, and the last one; what came and went in between, always.

    Raises
    ------
    RecordingError
        If what was recorded does not come out.
    """
    recording = rerun.recording
    for row in range(recording.row_after(rerun.model.completed), len(recording)):
        frame = recording[row]
        if frame.step > step:
            break
        rerun.check_change(frame.step)
        if frame.state_hash is not None or frame.step == step:
            difference = _difference(row, frame, rerun.frame(frame))
            if difference is not None:
                raise RecordingError(f"does not come out the same when run again: {difference}")
    rerun.to(step)


def last_same(rerun: Rerun, step: int) -> int:
    """Run beside a recording, and return the last step, at most the given one, at which all is the same."""
    recording, same = rerun.recording, rerun.model.completed
    for row in range(recording.row_after(same), len(recording)):
        frame = recording[row]
        try:
            rerun.check_change(frame.step)
            different = frame.step > step or _difference(row, frame, rerun.frame(frame)) is not None
        except RecordingError:
            return same
        if different:
            return same
        same = frame.step
    return same


def _all_compared(rerun: Rerun, rows: int) -> Verification:
    for row, frame in enumerate(islice(rerun.recording, rows)):
        difference = _compared(rerun, row, frame)
        if difference is not None:
            return difference
    last = f" to step {rerun.recording[rows - 1].step}" if rows else ""
    return Verification(same=True, rows=rows, text=f"all {rows} rows{last} are the same")


def _compared(rerun: Rerun, row: int, frame: Frame) -> Verification | None:
    """Return how a frame differs from what is now, None if it does not."""
    try:
        return _difference(row, frame, rerun.frame(frame))
    except RecordingError as error:
        text = f"step {frame.step} is the first that cannot be compared: {error}"
        return Verification(same=False, rows=row, step=frame.step, text=text)


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
    wrong = ~same.all(axis=tuple(range(1, same.ndim)))
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
