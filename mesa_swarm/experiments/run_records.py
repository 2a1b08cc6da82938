"""Recordings of the runs of a job or a sweep: to which file, and what of each run."""

import inspect
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path, PurePosixPath, PureWindowsPath
from tempfile import TemporaryDirectory
from typing import Any

from mesa_swarm.base.errors import InvalidValueError, RecordingError, check_choice, shortened, unknown_name
from mesa_swarm.base.files import free_draft, put_in_place, show_path, unwritable
from mesa_swarm.experiments.experiment import Experiment, first_built
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.experiments.runs import Run, attempt
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.recording.recorder import record

SUFFIX = ".arrow"
# No part of a recording's name may have a special meaning on some system: hidden files, options, streams, devices.
PART = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_+=,.-]{0,99}")
DEVICE = re.compile(r"(con|prn|aux|nul|conin\$|conout\$|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def file_within(folder: Path, name: str) -> Path:
    """Return a file that a job names if it is in the job's folder, and not reached by a link."""
    parts = PurePosixPath(name).parts
    windows = PureWindowsPath(name)
    if name.startswith("/") or windows.drive or windows.root or ".." in (*parts, *windows.parts):
        raise InvalidValueError(f"{shortened(name)} leads out of the job's folder; put the file into it")
    path = folder
    for part in parts:
        path = path / part
        if _is_link(path):
            raise InvalidValueError(f"{shortened(name)} is reached by a link; put the file itself there")
    return path


def recording_within(folder: Path, name: str) -> Path:
    """Return a file to record to if it is in the job's folder and its name is portable.

    It must not be a device's, nor one that could be taken for another kind of file.
    """
    path = file_within(folder, name)
    for part in PurePosixPath(name).parts:
        if DEVICE.fullmatch(part):
            raise InvalidValueError(f"{shortened(name)} is the name of a device; choose another")
        if not PART.fullmatch(part) or part.endswith("."):
            wanted = "letters, digits and _+=,.- between slashes, with no dot or dash before or dot after"
            raise InvalidValueError(f"{shortened(name)} is not a name for a recording; expected {wanted}")
    if path.suffix != SUFFIX:
        raise InvalidValueError(f"{shortened(name)} does not end in {SUFFIX}, as recordings do; add it")
    return path


def _is_link(path: Path) -> bool:
    try:
        return path.is_symlink() or path.is_junction() if hasattr(path, "is_junction") else path.is_symlink()
    except (OSError, ValueError):  # a name too long for the system, or with a null byte
        return False


PLACES = ("name", "seed")
AGAIN = "make room and sweep again"
PLACE = re.compile(r"\{([^{}]*)\}")
# A job's options of a recording are passed on to `record`, except those that the job must not set.
OPTIONS = tuple(
    name for name in inspect.signature(record).parameters if name not in ("model", "path", "overwrite", "rerun")
)


@dataclass(frozen=True, kw_only=True, slots=True)
class RunRecords:
    """Where the runs of an experiment are recorded, and with which options of `mesa_swarm.recording.record`.

    `file` is relative to the folder of the job; ``{seed}`` and ``{name}`` stand for the run's seed and its experiment's
    name.
    """

    folder: Path
    file: str
    options: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the name with places filled in, so that braces left over are refused too."""
        filled_in(self.file, "name", 1)
        self.path("name", 1)

    def path(self, name: str, seed: int) -> Path:
        """Return the file of one run."""
        return recording_within(self.folder, filled_in(self.file, name, seed))

    def check(self, experiment: Experiment) -> None:
        """Refuse impossible options, and one file for several runs."""
        if len(experiment.seeds) > 1 and "{seed}" not in self.file:
            raise InvalidValueError(
                f"{len(experiment.seeds)} runs would be recorded to {shortened(self.file)}; put {{seed}} into its name"
            )
        check_options(self.options, experiment)


def filled_in(file: str, name: str, seed: int) -> str:
    """Return the name of a recording with ``{seed}`` and ``{name}`` filled in."""
    filled = {"name": name, "seed": str(seed)}
    for place in PLACE.findall(file):
        if place not in PLACES:
            raise InvalidValueError(unknown_name("place in the name of a recording", place, PLACES))
    return PLACE.sub(lambda place: filled[place[1]], file)


def chosen_options(record: object) -> Mapping[str, Any] | None:
    """Return the options of recordings, none of them for True, and None if nothing is to be recorded."""
    if record is None or isinstance(record, bool):
        return {} if record else None
    if not isinstance(record, Mapping):
        raise InvalidValueError(
            f"record is {shortened(record)}; expected True, False or a mapping of options, such as {{'every': 10}}"
        )
    return record


def check_options(options: Mapping[str, Any], experiment: Experiment) -> None:
    """Refuse options that `record` would refuse for this experiment, by an empty recording."""
    for name in options:
        check_choice("option of a recording", name, OPTIONS)
    with TemporaryDirectory() as folder:
        first_built(experiment).record(Path(folder, "trial.arrow"), **options).close()


@contextmanager
def recorded(model: EngineModel, path: Path, options: Mapping[str, Any], overwrite: bool = False) -> Iterator[None]:
    """Record a model to a file, in a folder that is made if it is missing, while the context lasts."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(path.parent, error, RecordingError, "choose another place") from None
    with model.record(path, **options, overwrite=overwrite):
        yield


@dataclass(frozen=True, slots=True)
class Archive:
    """The recordings of a sweep: one file per run, named by the run's key."""

    folder: Path
    options: Mapping[str, Any]

    def file(self, key: str) -> Path:
        """Return the file of a run, which exists when all of it was recorded."""
        return self.folder / f"{key}{SUFFIX}"

    def clear(self, key: str) -> None:
        """Delete the draft of a recording that a dead worker left, unless it is still being written."""
        free_draft(self.file(key))

    def attempt(self, run: Run) -> Outcome:
        """Do a run and store its recording; that of a run that fails ends where it failed.

        If the recording cannot be written, a RecordingError is raised: the run is not the cause, and is to be done
        again.
        """
        file = self.file(run.key)
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            draft = free_draft(file)
        except OSError as error:
            raise unwritable(file, error, RecordingError, AGAIN) from None
        try:
            outcome = attempt(run, partial(recorded, path=draft, options=self.options), beyond=(RecordingError,))
            if draft.exists():
                with open(draft, "rb", buffering=0) as whole:
                    put_in_place(whole, file)
        except OSError as error:
            raise unwritable(file, error, RecordingError, AGAIN) from None
        except RecordingError as error:
            raise _of_file(error, draft, file) from None
        finally:
            with suppress(OSError):  # else it would hide why writing failed
                draft.unlink(missing_ok=True)
        return outcome


def _of_file(error: RecordingError, draft: Path, file: Path) -> RecordingError:
    """Return an error about a draft as one about its file, which does not exist."""
    before, named, after = str(error).partition(show_path(draft))
    return RecordingError(f"{before}{show_path(file)}{after.partition(';')[0]}; {AGAIN}") if named else error
