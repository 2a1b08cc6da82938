"""What the command `export` does with what was typed."""

from pathlib import Path
from typing import Any

from mesa_swarm.cli.picture_commands import parsed_steps
from mesa_swarm.viewing.export import export as write
from mesa_swarm.viewing.pictures import parsed_size


def export(
    file: Path, out: Path, *, steps: str | None, size: str | None, force: bool, progress: bool, **wanted: Any
) -> None:
    """Write what was asked for and print where it is."""
    paths = write(
        file,
        out,
        steps=None if steps is None else parsed_steps(steps, several=True),
        size=None if size is None else parsed_size(size),
        overwrite=force,
        progress=progress,
        **wanted,
    )
    print("\n".join(map(str, paths)))
