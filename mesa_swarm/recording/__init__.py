"""Runs written to files and read back: see `record`, `Recording` and `verify`."""

from mesa_swarm.recording.events import Event
from mesa_swarm.recording.recorder import Recorder, record
from mesa_swarm.recording.recording import Frame, Recording
from mesa_swarm.recording.verify import Verification, verify

__all__ = ["Event", "Frame", "Recorder", "Recording", "Verification", "record", "verify"]
