"""A model that is run again beside its recording, and given what was changed by hand where that was."""

from collections.abc import Callable, Sequence

from mesa_swarm.errors import RecordingError, SwarmError
from mesa_swarm.observed_world import ObservedWorld
from mesa_swarm.recording.checkpoint import restore
from mesa_swarm.recording.collected import check_collected, size_of_collected, without_rest
from mesa_swarm.recording.container import Checkpoint
from mesa_swarm.recording.frames import Frame, Rows
from mesa_swarm.recording.interventions import Intervention
from mesa_swarm.recording.layout import Chunk, Layout
from mesa_swarm.recording.provenance import LONGEST_REASON, reason_of, rebuilt
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.schema import MOST_UNSEEN
from mesa_swarm.recording.things import summary

# Called after each step that is run again: shows how far it is, and raises what ends it.
Watch = Callable[[ObservedWorld], None]
# In recordings of this format readings are those from which a step began, except in rows with a fingerprint.
LATE_READINGS = 1


class Rerun:
    """A model beside its recording.

    Parameters
    ----------
    recording : Recording
    model : ObservedWorld
        As it was at some step.
    checkpoint : int
        The place of the stored state that it has; -1 if it was started again.
    watch : callable
        Called with the model after each step.

    Attributes
    ----------
    model : ObservedWorld
        Another one after each intervention.
    taken : tuple of Intervention
        Those after which it went on from a stored state.
    begin : str
        If it is not what the parameters alone make, from what it began, in words that follow a verdict.
    """

    def __init__(
        self, recording: Recording, model: ObservedWorld, checkpoint: int = -1, watch: Watch = lambda _: None
    ) -> None:
        self.recording, self.model, self._watch = recording, model, watch
        self.taken: tuple[Intervention, ...] = ()
        self.begin = "" if checkpoint < 0 else f", from the stored state of step {model.completed}"
        self._states: list[Checkpoint] = []
        self._layout = _layout_of(recording, model)
        first, has = model.completed, checkpoint
        # Where a step failed and was taken again there are several: the last one knows all that is other.
        last = {one.step: one for one in recording.interventions}.values()
        self._ahead = [one for one in last if one.step >= first and (one.checkpoint is None or one.checkpoint > has)]

    def to(self, step: int) -> None:
        """Run to a later step.

        Raises
        ------
        RecordingError
            If the model was changed by hand in between, and what came of it is not stored.
        """
        while self._ahead and self._ahead[0].step < step:
            self._run(self._ahead[0].step)
            self._take(self._ahead[0])
        self._run(step)

    def frame(self, frame: Frame) -> Frame:
        """Run to the step of a frame and return what it is now."""
        self.to(frame.step)
        if self.recording.provenance["format"] > LATE_READINGS:
            self._layout.prepare(self.model)
        state_hash = self.model.state_hash() if frame.state_hash is not None else None
        chunk = Chunk(self._layout, self.model, 1)
        chunk.put(0, self.model.completed, state_hash)
        return Rows(chunk.batch(1))[0]

    def check_change(self, step: int) -> None:
        """If other robots, obstacles or fires were recorded at a step than before, run to it and look for them.

        Raises
        ------
        RecordingError
            If they are not there.
        """
        if step not in self.recording.changes:
            return
        self.to(step)
        if summary(self.model) != self.recording.changes[step]:
            raise RecordingError(
                f"does not come out the same when run again: step {step} is the first with robots, obstacles or fires "
                "that were added or removed"
            )

    def _run(self, step: int) -> None:
        run_on(self.model, step, self._watch)

    def _take(self, intervention: Intervention) -> None:
        """Go on from the state that was stored after an intervention."""
        if intervention.checkpoint is None:
            why = f"{intervention.why_not:.{2 * LONGEST_REASON}}"
            raise RecordingError(f"{intervention!s:.{LONGEST_REASON}}, and what came of it is not stored ({why})")
        self._states = states_to(self.recording, intervention.checkpoint, self._states)
        self.model = restored(self.recording, type(self.model), self._states)
        self.taken += (self._ahead.pop(0),)


def _layout_of(recording: Recording, model: ObservedWorld) -> Layout:
    try:
        return Layout(model, recording.columns, recording.provenance["exact"])
    except SwarmError as error:
        raise RecordingError(f"{recording.path} has columns that its model does not have: {error}") from None


def run_on(model: ObservedWorld, step: int, watch: Watch) -> None:
    """Run a model to a later step.

    Raises
    ------
    RecordingError
        If a step fails, as it did not when it was recorded.
    """
    while model.completed < step:
        before = model.completed
        try:
            model.step()
        except Exception as error:  # whatever a model raises whose parameters or state are not its own
            raise RecordingError(f"step {before + 1} cannot be run again: {reason_of(error)}") from error
        if model.completed <= before:
            raise RecordingError(f"step {before + 1} cannot be run again: {type(model).__name__} took no step")
        watch(model)


def started_again(recording: Recording, model_class: type, watch: Watch = lambda _: None) -> Rerun:
    """Return the model as the recording began with it: from its parameters, else from the state stored then.

    A recording that began late is not run again from step 0: its rows do not bear out that there were so many steps.

    Raises
    ------
    RecordingError
        If its parameters alone do not make that model, and the state is not stored.
    """
    facts = recording.provenance
    start = facts["start"]
    model, is_near = rebuilt(facts, model_class), start["step"] <= MOST_UNSEEN
    if is_near:
        run_on(model, start["step"], watch)
        if model.completed == start["step"] and model.state_hash() == start["state_hash"]:
            return Rerun(recording, model, watch=watch)
    if recording.checkpoints[:1] == (start["step"],):
        model = restored(recording, model_class, states_to(recording, 0))
        if model.state_hash() == start["state_hash"]:
            return Rerun(recording, model, 0, watch)
    if not is_near:
        raise RecordingError(
            f"{recording.path} begins at step {start['step']} without a stored state of it, more than the "
            f"{MOST_UNSEEN:,} steps that are run again unseen; record with checkpoint_every"
        )
    raise RecordingError(
        f"{recording.path} began with a model that {model_class.__name__}'s parameters alone do not make: "
        "it was changed by hand, or other versions made it; build it in a constructor to run it again"
    )


def states_to(recording: Recording, checkpoint: int, known: Sequence[Checkpoint] = ()) -> list[Checkpoint]:
    """Return the stored states up to one of `Recording.checkpoints`, by its place: each goes on from those before.

    Only the last one is whole. Of the others there is what they collected: memory holds one state at a time.

    Parameters
    ----------
    recording : Recording
    checkpoint : int
    known : sequence of Checkpoint
        The first ones, as this has returned them.

    Raises
    ------
    RecordingError
        If one of them is damaged.
    """
    states = [*known[:-1], *map(without_rest, known[-1:])]
    size, file = sum(map(size_of_collected, states)), recording.path.stat().st_size
    try:
        for place in range(len(known), checkpoint + 1):
            state = recording.checkpoint(place)
            size += size_of_collected(state)
            check_collected(size, file)
            states.append(state if place == checkpoint else without_rest(state))
    except (LookupError, TypeError, RecursionError):
        raise RecordingError(f"{recording.path} has a stored state that is none") from None
    return states


def restored(recording: Recording, model_class: type, states: list[Checkpoint]) -> ObservedWorld:
    """Return a model with the last of these states.

    Raises
    ------
    RecordingError
        If it cannot be restored.
    """
    return restore(rebuilt(recording.provenance, model_class), states[-1], states[:-1])
