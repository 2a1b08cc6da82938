"""A model that is run again beside its recording, and given what was changed by hand where that was."""

from mesa_swarm.errors import RecordingError
from mesa_swarm.observed_world import ObservedWorld
from mesa_swarm.recording.checkpoint import restore
from mesa_swarm.recording.container import Checkpoint
from mesa_swarm.recording.frames import Frame, Rows
from mesa_swarm.recording.interventions import Intervention
from mesa_swarm.recording.layout import Chunk, Layout
from mesa_swarm.recording.provenance import rebuilt
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.things import summary

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

    Attributes
    ----------
    model : ObservedWorld
        Another one after each intervention.
    taken : tuple of Intervention
        Those after which it went on from a stored state.
    begin : str
        If it is not what the parameters alone make, from what it began, in words that follow a verdict.
    """

    def __init__(self, recording: Recording, model: ObservedWorld, checkpoint: int = -1) -> None:
        self.recording, self.model = recording, model
        self.taken: tuple[Intervention, ...] = ()
        self.begin = "" if checkpoint < 0 else f", from the stored state of step {model.completed}"
        self._states: list[Checkpoint] = []
        self._layout = Layout(model, recording.columns, recording.provenance["exact"])
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
        while self.model.completed < step:
            self.model.step()

    def _take(self, intervention: Intervention) -> None:
        """Go on from the state that was stored after an intervention."""
        if intervention.checkpoint is None:
            raise RecordingError(f"{intervention}, and what came of it is not stored ({intervention.why_not})")
        self._states += states_to(self.recording, intervention.checkpoint, known=len(self._states))
        self.model = restored(self.recording, type(self.model), self._states)
        self.taken += (self._ahead.pop(0),)


def started_again(recording: Recording, model_class: type) -> Rerun:
    """Return the model as the recording began with it: from its parameters, else from the state stored then.

    Raises
    ------
    RecordingError
        If its parameters alone do not make that model, and the state is not stored.
    """
    facts = recording.provenance
    start = facts["start"]
    model = rebuilt(facts, model_class)
    while model.completed < start["step"]:
        model.step()
    if model.state_hash() == start["state_hash"]:
        return Rerun(recording, model)
    if recording.checkpoints[:1] == (start["step"],):
        model = restored(recording, model_class, states_to(recording, 0))
        if model.state_hash() == start["state_hash"]:
            return Rerun(recording, model, 0)
    raise RecordingError(
        f"{recording.path} began with a model that {model_class.__name__}'s parameters alone do not make: "
        "it was changed by hand, or other versions made it; build it in a constructor to run it again"
    )


def states_to(recording: Recording, checkpoint: int, known: int = 0) -> list[Checkpoint]:
    """Return the stored states up to one of `Recording.checkpoints`, by its place: each goes on from those before.

    Parameters
    ----------
    recording : Recording
    checkpoint : int
    known : int
        So many first ones are left out.

    Raises
    ------
    RecordingError
        If one of them is damaged.
    """
    return [recording.checkpoint(place) for place in range(known, checkpoint + 1)]


def restored(recording: Recording, model_class: type, states: list[Checkpoint]) -> ObservedWorld:
    """Return a model with the last of these states.

    Raises
    ------
    RecordingError
        If it cannot be restored.
    """
    return restore(rebuilt(recording.provenance, model_class), states[-1], states[:-1])
