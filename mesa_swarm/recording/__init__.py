"""Runs written to files and read back, see `record`, `Recording`, `verify` and `resume`, or continued: `continued`."""

from mesa_swarm.recording.continuing import continued
from mesa_swarm.recording.frames import Event, Frame
from mesa_swarm.recording.recorder import Recorder, record
from mesa_swarm.recording.recording import Recording
from mesa_swarm.recording.resume import resume
from mesa_swarm.recording.verify import Verification, verify

__all__ = ["Event", "Frame", "Recorder", "Recording", "Verification", "continued", "record", "resume", "verify"]
