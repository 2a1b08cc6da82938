"""Pages that replay a recording without a network."""

from pathlib import Path

from mesa_swarm.errors import ExportError
from mesa_swarm.files import write_whole
from mesa_swarm.recording.recording import Recording


def export_page(recording: Recording, path: Path) -> None:
    """Write a page that plays a recording in any browser, whole or not at all."""
    from mesa_swarm.viewing.replay_page import replay_page  # noqa: PLC0415 - pictures and tables do without it

    write_whole(path, replay_page(recording), ExportError)
