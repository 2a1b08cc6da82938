"""Running a recording again, to find the first step and robot that differ."""

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from mesa_swarm.base.errors import RecordingError, SwarmError, error_line
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.base.wording import quantity
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.recording.changes import Intervention, as_remark
from mesa_swarm.recording.checkpoint import differing_part, restore
from mesa_swarm.recording.collected_data import check_collected, size_of_collected, without_rest
from mesa_swarm.recording.container import Checkpoint
from mesa_swarm.recording.frames import Frame, Rows, name_robots
from mesa_swarm.recording.layout import READINGS, Chunk, Layout, is_table
from mesa_swarm.recording.objects import summary
from mesa_swarm.recording.provenance import describe_bits, hash_in_format, is_of_other_bits, rebuild_model
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.schema import MOST_UNSEEN

# Called after each step that is run again: shows the progress, and raises an error to stop.
Watch = Callable[[EngineModel], None]
# In recordings of this format readings are those before the step, except in rows with a state hash.
LATE_READINGS = 1
# Characters of the description of an intervention in an error.
LONGEST_DESCRIPTION = 120


class Rerun:
    """A model beside its recording.

    `model` is another one after each intervention; `taken` are those after which it continued from a stored state.
    `checkpoint` is the index of the stored state from which it began, -1 if it was started again, and `begin` names
    that state as text to follow a verdict. `unseen` are the stored states, by index and step, to be compared with the
    model: all but those after changes by hand, and that from which it began. `moved` are the steps after which bodies
    were moved by hand. `states` are those that were read, of which the last one is whole. `watch` is called with the
    model after each step.
    """

    def __init__(
        self,
        recording: Recording,
        model: EngineModel,
        checkpoint: int = -1,
        watch: Watch = lambda _: None,
        states: Sequence[Checkpoint] = (),
    ) -> None:
        self.recording, self.model, self._watch = recording, model, watch
        self.interventions: tuple[Intervention, ...] = ()
        self.begin = "" if checkpoint < 0 else f", from the stored state of step {model.completed}"
        self.states = list(states)
        self._layout = _layout_of(recording, model)
        self._format = recording.provenance["format"]
        first, has = model.completed, checkpoint
        # Where a step failed and was taken again there are several: the last one includes all changes.
        last = {change.step: change for change in recording.interventions}.values()
        self._ahead = [
            change for change in last if change.step >= first and (change.checkpoint is None or change.checkpoint > has)
        ]
        self._moves = deque(move for move in recording.hand_moves if move.step >= first and move.after > has)
        self.moved: set[int] = set()
        by_hand = {change.checkpoint for change in recording.interventions}
        steps = enumerate(recording.checkpoints)
        self.unseen = deque((k, step) for k, step in steps if k > has and step >= first and k not in by_hand)

    def to(self, step: int) -> None:
        """Run to a later step, unless the model was changed by hand in between and the state after it is not stored."""
        while self._ahead and self._ahead[0].step < step:
            self._run_on(self._ahead[0].step)
            self._take(self._ahead[0])
        self._run_on(step)

    def move_by_hand(self) -> None:
        """Repeat the moves that were made by hand after the present step."""
        while self._moves and self._moves[0].step == self.model.completed:
            self._moves[0].apply(self.model)
            self.moved.add(self._moves.popleft().step)

    def _run_on(self, step: int) -> None:
        if self.model.completed < step and is_of_other_bits(self.recording.provenance):
            raise RecordingError(describe_bits(self.recording.provenance))
        while self._moves and self._moves[0].step < step:
            run_on(self.model, self._moves[0].step, self._watch)
            self.move_by_hand()
        run_on(self.model, step, self._watch)

    def frame(self, frame: Frame) -> Frame:
        """Run to the step of a frame and return the frame of the model then."""
        self.to(frame.step)
        if self._format > LATE_READINGS:
            self._layout.prepare(self.model)
        state_hash = hash_in_format(self.model, self._format) if frame.state_hash is not None else None
        chunk = Chunk(self._layout, self.model, 1)
        chunk.put(self.model, 0, state_hash, self.recording.events_before(frame.step))
        return Rows(chunk.batch(1))[0]

    def check_change(self, step: int) -> None:
        """If robots, obstacles or fires were added or removed before a recorded step, run to it and compare them."""
        if step not in self.recording.changes:
            return
        self.to(step)
        if summary(self.model) != self.recording.changes[step]:
            raise RecordingError(
                f"does not match the recording when run again: before step {step} robots, obstacles or fires were "
                "added or removed"
            )

    def check_states(self, step: int) -> str:
        """Run to a step, compare the stored states up to there with the model, and return what differs first."""
        while self.unseen and self.unseen[0][1] <= step:
            place, at = self.unseen.popleft()
            self.to(at)
            try:
                name = differing_part(self._restore_state(place), self.model)
            except RecordingError as error:
                return f"its stored state cannot be read: {error}"
            if name:
                return f"its stored state differs in {name}"
        return ""

    def _restore_state(self, place: int) -> EngineModel:
        """Return a new model with a stored state, by its index; each is read once, in their order."""
        if len(self.states) <= place:
            self.states = states_to(self.recording, place, self.states)
        return restore_last(self.recording, type(self.model), self.states)

    def _take(self, intervention: Intervention) -> None:
        """Continue from the state that was stored after an intervention."""
        if intervention.checkpoint is None:
            why = f"{intervention.why_not:.{2 * LONGEST_DESCRIPTION}}"
            raise RecordingError(f"{intervention!s:.{LONGEST_DESCRIPTION}}; the state then was not stored ({why})")
        self.model = self._restore_state(intervention.checkpoint)
        self.interventions += (self._ahead.pop(0),)
        while self._moves and self._moves[0].after <= intervention.checkpoint:
            self._moves.popleft()  # the state includes them


def _layout_of(recording: Recording, model: EngineModel) -> Layout:
    try:
        return Layout(model, recording.columns, recording.provenance["exact"], recording.picture_widths)
    except SwarmError as error:
        raise RecordingError(f"{recording.path} has columns that its model does not have: {error}") from None


def run_on(model: EngineModel, step: int, watch: Watch) -> None:
    """Run a model to a later step."""
    while model.completed < step:
        before = model.completed
        try:
            model.step()
        except Exception as error:  # anything that a model may raise with a forged state
            raise RecordingError(f"step {before + 1} cannot be run again: {error_line(error)}") from error
        if model.completed <= before:
            raise RecordingError(f"step {before + 1} cannot be run again: {type(model).__name__} took no step")
        watch(model)


def start_again(recording: Recording, model_class: type, watch: Watch = lambda _: None) -> Rerun:
    """Return the model at the start of a recording: from its parameters, else from the state stored then.

    A recording that began late is not run again from step 0: its rows do not prove that there were that many steps.
    Where the state at the start is what the parameters make but for something that is not in the state hash, such as an
    attribute set by hand, the model is that state, which `Rerun.begin` names.
    """
    start = recording.provenance["start"]
    model, is_near = rebuild_model(recording.provenance, model_class), start["step"] <= MOST_UNSEEN
    repeats = not is_of_other_bits(recording.provenance)
    if is_near and repeats:
        run_on(model, start["step"], watch)
        if model.completed == start["step"] and _is_at_start(recording, model):
            return _unless_stored_differs(Rerun(recording, model, watch=watch), watch)
    if recording.checkpoints[:1] == (start["step"],):
        states = states_to(recording, 0)
        model = restore_last(recording, model_class, states)
        if _is_at_start(recording, model):
            return Rerun(recording, model, 0, watch, states)
    if not repeats:
        raise RecordingError(describe_bits(recording.provenance))
    if not is_near:
        raise RecordingError(
            f"{recording.path} begins at step {start['step']} without a stored state; expected at most "
            f"{MOST_UNSEEN:,} steps before it; record with checkpoint_every"
        )
    raise RecordingError(
        f"{recording.path} began with a model that {model_class.__name__}'s parameters alone do not make: "
        "it was changed by hand, or made by other versions; build it in a constructor to run it again"
    )


def _is_at_start(recording: Recording, model: EngineModel) -> bool:
    """Return whether a model has the state hash with which a recording began."""
    facts = recording.provenance
    return hash_in_format(model, facts["format"]) == facts["start"]["state_hash"]


def _unless_stored_differs(rerun: Rerun, watch: Watch) -> Rerun:
    """Return a model with the state at the start if that is another one than the parameters make, of the same hash."""
    recording, start = rerun.recording, rerun.recording.provenance["start"]
    if recording.checkpoints[:1] != (start["step"],):
        return rerun
    try:
        states = states_to(recording, 0)
        model = restore_last(recording, type(rerun.model), states)
        name = differing_part(model, rerun.model)
    except RecordingError:  # which `Rerun.check_states` reports
        return rerun
    if name and not _is_at_start(recording, model):
        return rerun
    if not name:  # it has been compared
        rerun.unseen.popleft()
        rerun.states = states
        return rerun
    from_state = Rerun(recording, model, 0, watch, states)
    from_state.begin += f" (its {name} is not what the parameters make)"
    return from_state


def states_to(recording: Recording, checkpoint: int, earlier: Sequence[Checkpoint] = ()) -> list[Checkpoint]:
    """Return the stored states up to one of `Recording.checkpoints`, by index: each builds on those before.

    Only the last one is whole. The others are reduced to their collected data: memory has room for one state. `earlier`
    are the first ones, as returned before.
    """
    states = [*earlier[:-1], *map(without_rest, earlier[-1:])]
    size, file = sum(map(size_of_collected, states)), recording.path.stat().st_size
    try:
        for place in range(len(earlier), checkpoint + 1):
            state = recording.checkpoint(place)
            size += size_of_collected(state)
            check_collected(size, file)
            states.append(state if place == checkpoint else without_rest(state))
    except (LookupError, TypeError, RecursionError):
        raise RecordingError(f"{recording.path} has a stored state that cannot be decoded") from None
    return states


def restore_last(recording: Recording, model_class: type, states: list[Checkpoint]) -> EngineModel:
    """Return a new model with the last of these states."""
    facts, model = recording.provenance, rebuild_model(recording.provenance, model_class)
    made, problem = ({*model.parts.processes.numbered}, {*model.parts}), ""
    try:
        restore(model, states[-1], states[:-1], written_in=facts["format"])
    except RecordingError as error:
        if not is_of_other_bits(facts):
            raise
        problem = f"{error}"
    # What is not stored is removed before anything else is restored, and its absence is why the rest may fail.
    if is_of_other_bits(facts) and (made[0] - {*model.parts.processes.numbered} or made[1] - {*model.parts}):
        problem = f"{model_class.__name__} has other processes and parts now"
    if problem:
        raise RecordingError(f"{problem}; {describe_bits(facts)}")
    return model


@dataclass(frozen=True, kw_only=True, slots=True)
class Verification:
    """The result of running a recording again; as a text one sentence.

    Parameters
    ----------
    same : bool
        Whether nothing differs and nothing of the recording is damaged.
    rows : int
        Rows compared before the first that differs.
    step : int or None
        The first step that differs.
    robots : tuple of int
        unique_ids of the robots that differ in it; empty if something else does.
    column : str or None
        The first recorded column that differs.
    text : str
    interventions : tuple of Intervention
        Manual changes up to there, which are taken from the recording and not verified.
    moved : int
        Number of steps after which driven bodies were moved by hand, which is repeated as recorded.
    """

    same: bool
    rows: int
    step: int | None = None
    robots: tuple[int, ...] = ()
    column: str | None = None
    text: str = ""
    interventions: tuple[Intervention, ...] = ()
    moved: int = 0

    def __str__(self) -> str:
        return self.text + as_remark(self.interventions) + _describe_moves(self.moved)


def verify(recording: Recording | str | os.PathLike[str], model_class: type, progress: bool = False) -> Verification:
    """Run the model of a recording again from its parameters, and compare every row and every stored state.

    A model that its parameters alone do not make, such as one to which robots were added from outside, is run from the
    state that was stored when the recording began; the verdict names that state, which is not verified.

    After a manual change it continues from the state that was stored then; the verdict names these steps. Of a damaged
    recording the rows before the damage are compared, and the verdict names the damage.

    Parameters
    ----------
    recording : Recording or path
    model_class : type
        The class of the recorded model. It is not looked up, so that opening a file runs no code.
    progress : bool
        Whether to show a bar.

    Raises
    ------
    RecordingError
        If the recording is of another class, of a version whose steps have other bits, or of a model that its
        parameters alone do not make and whose state was not stored.

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
    if is_of_other_bits(recording.provenance):
        raise RecordingError(f"{recording.path} cannot be verified: {describe_bits(recording.provenance)}")
    rows = recording.intact
    last = recording[rows - 1].step if rows else recording.provenance["start"]["step"]
    with progress_bar(last, "steps", progress) as bar:
        rerun = start_again(recording, model_class, lambda model: bar.update(model.completed - bar.n))
        verdict = _all_compared(rerun, rows)
    verdict = replace(verdict, text=verdict.text + rerun.begin)
    if recording.damage:
        verdict = replace(verdict, same=False, text=f"{verdict.text}; {recording.path} {recording.damage}")
    return replace(verdict, interventions=rerun.interventions, moved=len(rerun.moved))


def _describe_moves(steps: int) -> str:
    """Return what a verdict adds about moves, an empty text if there were none."""
    if not steps:
        return ""
    return f"; bodies moved by hand after {quantity(steps, 'step')} (repeated as recorded)"


def run_to(rerun: Rerun, step: int) -> None:
    """Run a model to a later step of its recording, and compare the two.

    Compared are the rows with state hashes and the last one, and all additions and removals in between.
    """
    for row, frame in _rows_ahead(rerun, step):
        if frame.state_hash is not None or frame.step == step:
            difference = _difference(row, frame, rerun.frame(frame))
            if difference is not None:
                raise RecordingError(f"does not match the recording when run again: {difference}")
    rerun.to(step)


def last_same(rerun: Rerun, step: int) -> int:
    """Run beside a recording, and return the last step, at most this one, before the first difference."""
    same = rerun.model.completed
    with suppress(RecordingError):
        for row, frame in _rows_ahead(rerun, step):
            if _difference(row, frame, rerun.frame(frame)) is not None:
                break
            same = frame.step
    return same


def _rows_ahead(rerun: Rerun, step: int) -> Iterator[tuple[int, Frame]]:
    """Iterate over the recorded rows up to a step, and compare the population before each."""
    recording = rerun.recording
    for row in range(recording.row_after(rerun.model.completed), len(recording)):
        frame = recording[row]
        if frame.step > step:
            return
        rerun.check_change(frame.step)
        yield row, frame


def check_row(rerun: Rerun) -> None:
    """Refuse a stored state, from which a model was just made, that is not that of the row of its step."""
    recording, step = rerun.recording, rerun.model.completed
    facts, row = recording.provenance, recording.row_after(step) - 1
    if step == facts["start"]["step"]:
        if not _is_at_start(recording, rerun.model):
            raise RecordingError(f"the stored state of step {step} is not that with which the recording began")
        return
    if facts["format"] <= LATE_READINGS:
        return
    difference = _difference(row, recording[row], rerun.frame(recording[row]), _columns_not_compared(rerun))
    if difference is not None:
        raise RecordingError(f"the stored state of step {step} does not match the row of this step: {difference}")


def _columns_not_compared(rerun: Rerun) -> frozenset[str]:
    """Return the columns that a stored state is not compared in: of other bits, readings, which are computed anew."""
    if not is_of_other_bits(rerun.recording.provenance):
        return frozenset()
    return READINGS.union(rerun.model.swarm.table.readings)


def has_row(recording: Recording, step: int) -> bool:
    """Return whether a recording has a row of a step, or begins with it, so that a stored state can be compared."""
    row = recording.row_after(step) - 1
    return step == recording.provenance["start"]["step"] or (row >= 0 and recording[row].step == step)


def _all_compared(rerun: Rerun, rows: int) -> Verification:
    for row, frame in enumerate(islice(rerun.recording, rows)):
        try:
            wrong = rerun.check_states(frame.step - 1)
            difference = _difference(row, frame, rerun.frame(frame)) if not wrong else None
            wrong = wrong or (rerun.check_states(frame.step) if difference is None else "")
            if wrong:
                difference = _verdict(row, rerun.model.completed, None, wrong)
        except RecordingError as error:
            text = f"step {frame.step} is the first that cannot be compared: {error}"
            difference = Verification(same=False, rows=row, step=frame.step, text=text)
        if difference is not None:
            return difference
    last = f" to step {rerun.recording[rows - 1].step}" if rows else ""
    return Verification(same=True, rows=rows, text=f"all {rows} rows{last} are the same")


def _difference(row: int, frame: Frame, again: Frame, but: frozenset[str] = frozenset()) -> Verification | None:
    if not np.array_equal(frame.robots, again.robots):
        return _verdict(
            row, frame.step, "robots", f"{len(frame.robots)} robots recorded, {len(again.robots)} when run again"
        )
    for name in (name for name in frame.columns if name not in but):
        differing = _differing(name, frame, again)
        if differing is not None:
            robots = f" for {name_robots(differing)}" if differing else ""
            return _verdict(row, frame.step, name, f"{name} differs{robots}", differing)
    if frame.state_hash != again.state_hash:
        text = "the state differs in a value that was not recorded, since the last state hash"
        return _verdict(row, frame.step, None, text)
    return None


def _differing(name: str, frame: Frame, again: Frame) -> tuple[int, ...] | None:
    """Return the robots that differ in a column; no robots if it is a table; None if nothing differs."""
    old, new = frame[name], again[name]
    if is_table(name):
        return None if old.tobytes() == new.tobytes() else ()
    same = (old == new) | ((old != old) & (new != new))  # noqa: PLR0124 - NaN equals NaN here
    wrong = ~same.all(axis=tuple(range(1, same.ndim)))
    return tuple(frame.robots[wrong].tolist()) if wrong.any() else None


def _verdict(row: int, step: int, column: str | None, what: str, robots: tuple[int, ...] = ()) -> Verification:
    text = f"step {step} is the first that differs: {what}"
    return Verification(same=False, rows=row, step=step, robots=robots, column=column, text=text)
