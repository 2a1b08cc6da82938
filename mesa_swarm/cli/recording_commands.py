"""What the options `run --record` and the command `verify` do with what was typed."""

from pathlib import Path

from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.resume import shipped_class_of
from mesa_swarm.recording.verify import verify as run_again


def verify(file: Path, progress: bool) -> bool:
    """Run a recording again, print what differs first or that nothing does, and return whether it is the same.

    It is not if it is damaged, whatever the rows before the damage say.
    """
    recording = Recording(file)
    if not recording.complete and not recording.damage:
        print(f"{file} was not closed: {len(recording)} rows are whole, {recording.lost} bytes after them are not")
    verification = run_again(recording, shipped_class_of(recording), progress)
    print(verification)
    return verification.same
