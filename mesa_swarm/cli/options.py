"""What several commands share: their options, and how they build a model and print its numbers."""

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mesa_swarm.base.files import write_all
from mesa_swarm.base.lazy import without_collection
from mesa_swarm.base.wording import in_brief
from mesa_swarm.cli.lines import print_lines, terminal_width
from mesa_swarm.model.gallery import BASE, check_model_name, find_model

if TYPE_CHECKING:
    from mesa_swarm.experiments.tables import Study
    from mesa_swarm.swarm_model import SwarmModel

__all__ = ["Folder", "Jobs", "Quiet", "Tables", "print_files", "resumable"]

# Typer checks limits before anything slow is imported.
MOST_STEPS = 100_000_000
# Steps that are stored take memory.
MOST_STORED = 1_000_000
# Exit status when all was done but a recording differs or a run failed.
FAILED = 1


def known_model(name: str | None) -> str | None:
    """Return the name or address of a model, or None."""
    return name if name is None else check_model_name(name)


Model = Annotated[
    str,
    typer.Argument(
        callback=known_model,
        metavar="MODEL",
        help="One of `mesa-swarm list`, package.module:Class or ./file.py:Class.",
    ),
]
RecordingFile = Annotated[
    Path, typer.Argument(metavar="FILE", help="A recording, written by `mesa-swarm run --record`.")
]
Settings = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Set a parameter; may be repeated.")
]
_SEED = typer.Option("--rng", min=0, max=2**63 - 1, help="Seed, 1 by default; the same seed gives the same run.")
Seed = Annotated[int, _SEED]
SeedOrNone = Annotated[int | None, _SEED]
StepsOfRuns = Annotated[
    int | None, typer.Option("--steps", min=1, max=MOST_STEPS, help="At most, in each run; the model's own by default.")
]
Until = Annotated[
    str | None,
    typer.Option("--until", metavar="CONDITION", help="End a run when its reporters are so: 'fires_burning == 0'."),
]
Series = Annotated[
    str | None,
    typer.Option(
        "--series", metavar="both|model|agents", help="Store the rows of each run and step, as Parquet in series/."
    ),
]
Tables = Annotated[
    list[str] | None,
    typer.Option("--table", metavar="FORM", help="Write a table of the runs: csv or behaviorspace; may be repeated."),
]
Jobs = Annotated[int, typer.Option(min=-1, max=1024, help="Processes at a time, -1 for one on each core.")]
Folder = Annotated[Path, typer.Option("--out", help="Folder for tables, pictures and stored runs.")]
Force = Annotated[bool, typer.Option("--force", help="Replace files that exist.")]
NoBrowser = Annotated[bool, typer.Option("--no-browser", help="Only serve, and print the address.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress bar.")]


def prepare() -> None:
    """Import what every run needs, before anything of a user's, unless this is part of another program.

    Garbage collection never looks at it: a third of the time of a short command, most of it at its very end.
    """
    if "mesa" not in sys.modules:
        with without_collection(for_good=True):
            import_module(BASE)


def built_model(name: str, settings: Sequence[str] | None, rng: int) -> "SwarmModel":
    """Build a model with settings such as "n_robots=5"."""
    prepare()
    from mesa_swarm.model.parameters import parse_settings

    model_class = find_model(name)
    return model_class(**parse_settings(model_class, settings or ()), rng=rng)


def files_of(model: str, settings: Sequence[str] | None = None) -> list[str]:
    """Return the names of what may be files that a model is built from: its module, and values such as its map.

    Examples
    --------
    >>> files_of("./mine.py:Mine", ["map=rooms.svg", "n_robots=5"])
    ['./mine.py', 'rooms.svg', '5']
    """
    module = model.rpartition(":")[0] or model
    return [module, *(text.partition("=")[2].strip() for text in settings or ())]


@contextmanager
def resumable(place: Path) -> Iterator[None]:
    """Print after Ctrl-C where finished runs are stored."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"the runs so far are stored in {place}; the same command continues from there")
        raise


def print_study(study: "Study", folder: Path, others: Iterable[Path] = (), *, finding: bool = False) -> None:
    """Write the files of a study; print its table, their paths and those of other files, and on request the finding."""
    width = terminal_width()
    table, paths = study.table() if width is None else study.table(width), [*study.save(folder), *others]
    print_lines([table, "", *map(str, dict.fromkeys(paths)), *(["", study.finding()] if finding else [])], 0)


def print_files(folder: Path, contents: Mapping[str, str | bytes], table: Sequence[str] | None = None) -> None:
    """Write files, by name, all of them or none, and print their paths and those of the tables of runs."""
    from mesa_swarm.experiments.run_tables import RunFiles, checked_forms

    tables = RunFiles(folder, forms=checked_forms(table or ())).tables
    print_lines(map(str, [*write_all(folder, contents), *tables]), 0)


def print_pairs(pairs: dict) -> None:
    """Print names and values in two columns."""
    width = max(map(len, pairs))
    print_lines((f"{name:{width}}  {in_brief(value)}" for name, value in pairs.items()), width + 2)
