"""What the options `run --record` and the command `verify` do with what was typed."""

from pathlib import Path

from mesa_swarm.errors import RecordingError, shortened
from mesa_swarm.gallery import PACKAGE, find_model, model_names
from mesa_swarm.model import SwarmModel
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.verify import verify as run_again


def verify(file: Path, progress: bool) -> bool:
    """Run a recording again, print what differs first or that nothing does, and return whether it is the same.

    It is not if it is damaged, whatever the rows before the damage say.
    """
    recording = Recording(file)
    if not recording.complete and not recording.damage:
        print(f"{file} was not closed: {len(recording)} rows are whole, {recording.lost} bytes after them are not")
    verification = run_again(recording, class_of(recording), progress)
    print(verification)
    return verification.same


def class_of(recording: Recording) -> type:
    """Return the class of a recorded model, one of those that come with mesa_swarm.

    Others are not looked up by what a file says: importing is running.

    Raises
    ------
    RecordingError
        If it is another one.
    """
    recorded = recording.provenance["model"]
    known = [SwarmModel, *(find_model(name) for name in model_names() if recorded["module"] == f"{PACKAGE}.{name}")]
    for model_class in known:
        if (model_class.__module__, model_class.__qualname__) == (recorded["module"], recorded["name"]):
            return model_class
    raise RecordingError(
        f"{recording.path} is of {shortened(recorded['name'])}, which does not come with mesa_swarm; "
        "call mesa_swarm.recording.verify(recording, its_class)"
    )
