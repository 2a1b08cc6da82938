"""Export of a recording to the format of the file's ending: picture, film, page or table."""

import os
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import parquet

from mesa_swarm.base.errors import (
    ExportError,
    ExportWarning,
    InvalidValueError,
    check_choice,
    check_count,
    check_number,
    shortened,
)
from mesa_swarm.base.files import (
    check_apart,
    check_present_format,
    check_writable,
    checked_place,
    draft_of,
    show_path,
    unwritable,
    write_whole,
)
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.recording.frames import table_of
from mesa_swarm.recording.recording import Recording
from mesa_swarm.robots.real_robots import Scale
from mesa_swarm.viewing.drawing import export_animation
from mesa_swarm.viewing.films import check_even, export_film, export_gif, ffmpeg
from mesa_swarm.viewing.pictures import Look, export_stills, still_paths
from mesa_swarm.viewing.recorded_steps import PicturedSteps, RecordedSteps
from mesa_swarm.viewing.scene import scale_in

STEPS_AT_ONCE = 256
RANGE = ("every", "first", "last")
DRAWN = ("sectors", "trails")
# Options of each kind of file.
PERMITTED = {
    ".png": {"steps", *RANGE, "sheet", "size", *DRAWN},
    ".svg": {"steps", *RANGE, "sheet", "animate", *DRAWN},
    ".gif": {*RANGE, "fps", "size", *DRAWN},
    ".mp4": {*RANGE, "fps", "size", *DRAWN},
    ".html": set(),
    ".csv": {"steps", *RANGE, "table"},
    ".parquet": {"steps", *RANGE, "table"},
}
ANIMATED = {*RANGE, "fps", "animate"}
# Frames a second, and how many frames there are at most unless `every` is given.
FPS = {".svg": 20.0, ".gif": 25.0, ".mp4": 30.0}
MOST_FRAMES = {".svg": 300, ".gif": 300, ".mp4": 900}
# Browsers play faster GIFs too slowly.
FASTEST = {".svg": 120.0, ".gif": 50.0, ".mp4": 120.0}


@dataclass(frozen=True, kw_only=True, slots=True)
class StepChoice:
    """Which steps to export.

    Parameters
    ----------
    steps : sequence of int, optional
        Exactly these.
    every : int, optional
        All that are multiples of it, at least 1.
    first, last : int, optional
        The range of steps, both included.

    Raises
    ------
    InvalidValueError
        If steps are given beside the others, or `last` is before `first`.
    """

    steps: Sequence[int] | None = None
    every: int | None = None
    first: int | None = None
    last: int | None = None

    def __post_init__(self) -> None:
        """Check every value."""
        if self.steps is not None:
            self._check_steps(self.steps)
        if self.every is not None:
            check_count("every", self.every, minimum=1)
        first = 0 if self.first is None else check_count("first (--from)", self.first)
        if self.last is not None and check_count("last (--to)", self.last) < first:
            raise InvalidValueError(f"last (--to) is {self.last}, before first (--from), {first}; exchange them")

    @property
    def is_made(self) -> bool:
        """Whether any restriction is given."""
        return (self.steps, self.every, self.first, self.last) != (None, None, None, None)

    def _check_steps(self, steps: Sequence[int]) -> None:
        if (self.every, self.first, self.last) != (None, None, None):
            raise InvalidValueError("steps are given beside every, first or last; give either")
        if isinstance(steps, (str, int)) or not len(steps):
            raise InvalidValueError(f"steps is {shortened(steps)}; expected a list such as [0, 1000, 3000]")
        for step in steps:
            check_count("step", step)

    def among(self, there: np.ndarray) -> list[int]:
        """Return the chosen ones of the recorded steps, ascending.

        Raises
        ------
        InvalidValueError
            If one of them was not recorded, or none of the recorded steps is chosen.

        Examples
        --------
        >>> StepChoice(every=10, first=5).among(np.arange(1, 31))
        [10, 20, 30]
        >>> StepChoice(steps=[3, 1]).among(np.arange(1, 31))
        [1, 3]
        """
        if self.steps is not None:
            return sorted({_checked_step(int(step), there) for step in self.steps})
        every = _checked_every(self.every, there)
        first, last = _checked_ends(self.first, self.last, there)
        wanted = there[(there >= first) & (there <= last) & (there % every == 0)]
        if not len(wanted):
            raise InvalidValueError(f"no step from {first} to {last} is a multiple of {every}; choose a smaller every")
        return wanted.tolist()

    def thinned(self, there: np.ndarray, most: int) -> list[int]:
        """Return the chosen steps; without `every`, at most `most` of them, evenly spaced."""
        if self.every is not None:
            return self.among(there)
        all_steps = self.among(there)
        gap = _gap(there)
        stride = -(-len(all_steps) // most) * gap
        thinned = [step for step in all_steps if step % stride == 0]
        return thinned if len(thinned) > 1 else all_steps[:: stride // gap]


def _checked_step(step: int, there: np.ndarray) -> int:
    if step in there:
        return step
    place = int(np.searchsorted(there, step))
    near = f"; the nearest are {there[place - 1]} and {there[place]}" if 0 < place < len(there) else ""
    raise InvalidValueError(f"step {step} was not recorded; {_in_words(there)}{near}")


def _checked_every(every: int | None, there: np.ndarray) -> int:
    """Return the interval; raise if it is not a multiple of the recorded one, as it would silently become longer."""
    gap = _gap(there)
    if every is not None and every % gap:
        raise InvalidValueError(f"every is {every}; every {gap} steps were recorded, so give a multiple of {gap}")
    return 1 if every is None else every


def _checked_ends(first: int | None, last: int | None, there: np.ndarray) -> tuple[int, int]:
    for name, end in (("first (--from)", first), ("last (--to)", last)):
        if end is not None and not 0 <= end <= there[-1]:
            raise InvalidValueError(f"{name} is {end}; {_in_words(there)}")
    return int(there[0]) if first is None else first, int(there[-1]) if last is None else last


def _gap(there: np.ndarray) -> int:
    """Return how many steps are between two rows."""
    return int(np.gcd.reduce(np.diff(there))) if len(there) > 1 else 1


def _in_words(there: np.ndarray) -> str:
    return f"there are {len(there)} steps from {there[0]} to {there[-1]}"


def export_csv(rows: RecordedSteps, path: Path, steps: Sequence[int], table: str, progress: bool) -> None:
    """Write a table as CSV, whole or not at all."""
    with draft_of(path, ExportError) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        for number, piece in enumerate(pieces(rows, steps, table, progress)):
            piece.to_csv(file, index=False, header=number == 0, lineterminator="\n")


def export_parquet(rows: RecordedSteps, path: Path, steps: Sequence[int], table: str, progress: bool) -> None:
    """Write a table as Parquet, whole or not at all."""
    found = pieces(rows, steps, table, progress)
    first = pa.Table.from_pandas(next(found), preserve_index=False)
    with draft_of(path, ExportError) as draft, parquet.ParquetWriter(draft, first.schema, compression="zstd") as writer:
        writer.write_table(first)
        for piece in found:
            writer.write_table(pa.Table.from_pandas(piece, first.schema, preserve_index=False))


def pieces(rows: RecordedSteps, steps: Sequence[int], table: str, progress: bool) -> Iterator[pd.DataFrame]:
    """Yield the table of some steps, never more than 256 at once; warn at the end if it is empty.

    Raises
    ------
    UnknownNameError
        If that table was not recorded.
    """
    rows.recording.checked_table(table)
    kinds = rows.recording.load_kinds if table == "loads" else {}
    sceneries = rows.recording.sceneries
    scale = scale_in(sceneries[0][1]) if sceneries else None
    count = 0
    with progress_bar(len(steps), "steps", progress) as bar:
        for begin in range(0, len(steps), STEPS_AT_ONCE):
            chosen = steps[begin : begin + STEPS_AT_ONCE]
            piece = measured(table_of((rows.frame(step) for step in chosen), table, kinds), scale)
            count += len(piece)
            yield piece
            bar.update(len(chosen))
    if not count:
        text = f"{rows.recording.path} has no {table} in these steps: the table is empty"
        warnings.warn(text, ExportWarning, stacklevel=2)


def measured(table: pd.DataFrame, scale: Scale | None) -> pd.DataFrame:
    """Return a table with columns of seconds and metres behind the others, if a scale is known."""
    if scale is None:
        return table
    lengths = {f"{name}_m": scale.metres(table[name]) for name in ("x", "y", "radius") if name in table}
    return table.assign(time_s=scale.seconds(table["step"]), **lengths)


def export_page(recording: Recording, path: Path) -> None:
    """Write a page that plays a recording in any browser, whole or not at all."""
    from mesa_swarm.viewing.replay_page import replay_page  # noqa: PLC0415 - pictures and tables do without it

    write_whole(path, replay_page(recording), ExportError)


def export(
    recording: Recording | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    steps: Sequence[int] | None = None,
    every: int | None = None,
    first: int | None = None,
    last: int | None = None,
    sheet: bool = False,
    animate: bool = False,
    fps: float | None = None,
    size: tuple[int, int] | None = None,
    sectors: bool = False,
    trails: int = 0,
    table: str | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> list[Path]:
    """Write a recording in the format of the path's ending: .png .svg .gif .mp4 .html .csv .parquet.

    Parameters
    ----------
    recording : Recording, or the path of one
    path : str or Path
        Of several stills each is named by its step too: out_500.png.
    steps : sequence of int, optional
        Of stills and tables. Stills show the last step by default, tables all.
    every : int, optional
        All steps that are multiples of it; films by default show as many as fit into 900 frames, animations 300.
    first, last : int, optional
        No steps before and after these.
    sheet : bool
        Whether stills are put on one sheet, side by side.
    animate : bool
        Whether an SVG moves.
    fps : float, optional
        Frames a second of what moves, at least 1: 30 in a film, 25 in a GIF, 20 in an SVG unless given.
    size : (width, height), optional
        Pixels, 64 to 4096 each; even for films.
    sectors : bool
        Whether to show where the robots' proximity sensors look.
    trails : int
        Over how many steps to show where robots were, 0 for none.
    table : str, optional
        "robots" (the default), "fires", "contacts", "loads", "fields" or "events".
    overwrite : bool
        Whether files that are there are replaced.
    progress : bool
        Whether to show a bar.

    Returns
    -------
    list of Path
        The files that were written, each whole.

    Raises
    ------
    InvalidValueError, UnknownNameError
        If an option does not apply to this kind of file, or steps were not recorded.
    ExportError
        If a file exists already or cannot be written, its folder is not there, or nothing was recorded.
    RecordingError
        If the recording cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> from mesa_swarm.models.fire_fighting import FireFighting
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     model = FireFighting(n_robots=3, rng=1)
    ...     with model.record(f"{folder}/run.arrow"):
    ...         end = model.run(30)
    ...     [table] = export(f"{folder}/run.arrow", f"{folder}/fires.csv", table="fires", steps=[30])
    ...     len(table.read_text().splitlines())
    8
    """
    target = _checked_path(path)
    asked = {"steps": steps, "every": every, "first": first, "last": last, "fps": fps, "size": size, "table": table}
    asked |= {"sheet": sheet or None, "animate": animate or None, "sectors": sectors or None, "trails": trails or None}
    _check_permitted(target, {name for name, value in asked.items() if value is not None}, animate)
    job = _Job(
        target,
        StepChoice(steps=steps, every=every, first=first, last=last),
        Look(size=size, sectors=sectors, trails=trails),
        None if fps is None else check_number("fps", fps, minimum=1, maximum=FASTEST[target.suffix.lower()]),
        overwrite,
        progress,
    )
    source = recording if isinstance(recording, Recording) else Recording(recording)
    source.checked_table("robots" if table is None else table)
    try:
        return job.write(source, sheet, animate, "robots" if table is None else table)
    except OSError as error:
        raise unwritable(target, error, ExportError) from None


class _Job:
    """A checked export: what to write, and where."""

    def __init__(self, path: Path, choice: StepChoice, look: Look, fps: float | None, overwrite: bool, progress: bool):
        self.path, self.kind = path, path.suffix.lower()
        self.choice, self.look = choice, look
        self.fps = fps or FPS.get(self.kind, 0.0)
        self.overwrite, self.progress = overwrite, progress

    def write(self, recording: Recording, sheet: bool, animate: bool, table: str) -> list[Path]:
        """Write it and return what was written."""
        if self.kind in (".png", ".svg") and not animate:
            return self._stills(PicturedSteps(recording), sheet)
        _check_free([self.path], self.overwrite, recording)
        if self.kind == ".html":
            export_page(recording, self.path)
        elif self.kind in (".csv", ".parquet"):
            self._table(RecordedSteps(recording), table)
        else:
            self._moving(recording)
        return [self.path]

    def _stills(self, drawn: PicturedSteps, sheet: bool) -> list[Path]:
        steps = self.choice.among(drawn.steps) if self.choice.is_made else drawn.steps[-1:].tolist()
        files = still_paths(self.path, steps, sheet)
        _check_free(list(files), self.overwrite, drawn.recording)
        export_stills(drawn, files, self.look, self.progress)
        return list(files)

    def _table(self, rows: RecordedSteps, table: str) -> None:
        writer = export_csv if self.kind == ".csv" else export_parquet
        writer(rows, self.path, self.choice.among(rows.steps), table, self.progress)

    def _moving(self, recording: Recording) -> None:
        if self.kind == ".mp4":  # checked before the work begins
            ffmpeg()
            check_even(self.look)
        drawn = PicturedSteps(recording)
        steps = self.choice.thinned(drawn.steps, MOST_FRAMES[self.kind])
        if self.kind == ".svg":
            export_animation(drawn, self.path, steps, fps=self.fps, progress=self.progress)
            return
        writer = export_film if self.kind == ".mp4" else export_gif
        writer(drawn, self.path, steps, fps=self.fps, look=self.look, progress=self.progress)


def _checked_path(path: object) -> Path:
    if not isinstance(path, (str, os.PathLike)):
        raise InvalidValueError(f"path is {shortened(path)}; expected the name of a file such as 'out.mp4'")
    target = Path(path)
    check_present_format(target)
    check_choice("kind of file", target.suffix.lower(), PERMITTED)
    return target


def _check_permitted(path: Path, options: set[str], animate: bool) -> None:
    kind = path.suffix.lower()
    permitted = ANIMATED if animate and kind == ".svg" else PERMITTED[kind]
    for name in sorted(options - permitted):
        what = "an animated .svg" if permitted is ANIMATED else f"a {kind}"
        rule = f"it takes {', '.join(sorted(permitted))}" if permitted else "it shows the whole recording"
        raise InvalidValueError(f"{name} is given, which {what} does not take; {rule}")


def _check_free(paths: Sequence[Path], overwrite: bool, recording: Recording) -> None:
    for path in paths:
        check_apart(path, [recording.path], ExportError)
        try:
            checked_place(path)
        except OSError as error:
            raise unwritable(path, error, ExportError, "choose another name") from None
        if os.path.lexists(path) and not overwrite:
            raise ExportError(
                f"{show_path(path)} exists already; choose another name, or replace it with overwrite=True (--force)"
            )
    for folder in {path.parent for path in paths}:
        if not folder.is_dir():
            raise ExportError(f"folder {show_path(folder)} does not exist; make it first, or choose another place")
        check_writable(folder)
