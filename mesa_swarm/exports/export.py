"""Export: a recording as pictures, films, pages and tables, by the ending of the file's name."""

import os
from collections.abc import Sequence
from pathlib import Path

from mesa_swarm.errors import ExportError, InvalidValueError, check_choice, check_number, shortened
from mesa_swarm.exports.animation import export_animation
from mesa_swarm.exports.chosen import Choice
from mesa_swarm.exports.film import check_even, export_film, ffmpeg
from mesa_swarm.exports.gif import export_gif
from mesa_swarm.exports.look import Look
from mesa_swarm.exports.page import export_page
from mesa_swarm.exports.portraits import Portraits, Rows
from mesa_swarm.exports.stills import export_stills, still_paths
from mesa_swarm.exports.tables import export_csv, export_parquet
from mesa_swarm.files import check_writable, checked_place, shown_path, unwritable
from mesa_swarm.recording.recording import Recording

RANGE = ("every", "first", "last")
DRAWN = ("sectors", "trails")
# What may be asked for of each kind of file.
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
# Faster GIFs are played slower than they should.
FASTEST = {".svg": 120.0, ".gif": 50.0, ".mp4": 120.0}


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
    """Write a recording as what the ending of the path says: .png .svg .gif .mp4 .html .csv .parquet.

    Parameters
    ----------
    recording : Recording, or the path of one
    path : str or Path
        If several stills are wanted, they are named by their steps too: out_500.png.
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
        "robots" (the default), "fires", "contacts" or "loads".
    overwrite : bool
        Whether files that are there are replaced.
    progress : bool
        Whether to show a bar.

    Returns
    -------
    list of Path
        What was written, each whole.

    Raises
    ------
    InvalidValueError, UnknownNameError
        If something is asked for that this kind of file cannot show, or steps that are not there.
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
        Choice(steps=steps, every=every, first=first, last=last),
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
    """What is to be written where, once it has been checked."""

    def __init__(self, path: Path, choice: Choice, look: Look, fps: float | None, overwrite: bool, progress: bool):
        self.path, self.kind = path, path.suffix.lower()
        self.choice, self.look = choice, look
        self.fps = fps or FPS.get(self.kind, 0.0)
        self.overwrite, self.progress = overwrite, progress

    def write(self, recording: Recording, sheet: bool, animate: bool, table: str) -> list[Path]:
        """Write it and return what was written."""
        if self.kind in (".png", ".svg") and not animate:
            return self._stills(Rows(recording), sheet)
        _check_free([self.path], self.overwrite)
        if self.kind == ".html":
            export_page(recording, self.path)
        elif self.kind in (".csv", ".parquet"):
            self._table(Rows(recording), table)
        else:
            self._moving(Rows(recording))
        return [self.path]

    def _stills(self, rows: Rows, sheet: bool) -> list[Path]:
        portraits = Portraits(rows)
        steps = self.choice.among(portraits.steps) if self.choice.is_made else portraits.steps[-1:].tolist()
        files = still_paths(self.path, steps, sheet)
        _check_free(files, self.overwrite)
        export_stills(portraits, files, self.look, self.progress)
        return list(files)

    def _table(self, rows: Rows, table: str) -> None:
        writer = export_csv if self.kind == ".csv" else export_parquet
        writer(rows, self.path, self.choice.among(rows.steps), table, self.progress)

    def _moving(self, rows: Rows) -> None:
        if self.kind == ".mp4":  # said before the work begins
            ffmpeg()
            check_even(self.look)
        portraits = Portraits(rows)
        steps = self.choice.thinned(portraits.steps, MOST_FRAMES[self.kind])
        if self.kind == ".svg":
            export_animation(portraits, self.path, steps, fps=self.fps, progress=self.progress)
            return
        writer = export_film if self.kind == ".mp4" else export_gif
        writer(portraits, self.path, steps, fps=self.fps, look=self.look, progress=self.progress)


def _checked_path(path: object) -> Path:
    if not isinstance(path, (str, os.PathLike)):
        raise InvalidValueError(f"path is {shortened(path)}; expected the name of a file such as 'out.mp4'")
    target = Path(path)
    check_choice("kind of file", target.suffix.lower(), PERMITTED)
    return target


def _check_permitted(path: Path, asked: set[str], animate: bool) -> None:
    kind = path.suffix.lower()
    permitted = ANIMATED if animate and kind == ".svg" else PERMITTED[kind]
    for name in sorted(asked - permitted):
        what = "an animated .svg" if permitted is ANIMATED else f"a {kind}"
        rule = f"it takes {', '.join(sorted(permitted))}" if permitted else "it shows the whole recording"
        raise InvalidValueError(f"{name} is given, which {what} does not take; {rule}")


def _check_free(paths: Sequence[Path] | dict, overwrite: bool) -> None:
    for path in paths:
        try:
            checked_place(path)
        except OSError as error:
            raise unwritable(path, error, ExportError, "choose another name") from None
        if os.path.lexists(path) and not overwrite:
            raise ExportError(
                f"{shown_path(path)} exists already; choose another name, or replace it with overwrite=True (--force)"
            )
    for folder in {path.parent for path in paths}:
        if not folder.is_dir():
            raise ExportError(f"there is no folder {shown_path(folder)}; make it first, or choose another place")
        check_writable(folder)
