"""What the command reproduce does with what was typed."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from time import perf_counter

from mesa_swarm.errors import InvalidValueError, SwarmError
from mesa_swarm.experiments.pool import checked_jobs
from mesa_swarm.files import check_writable, checked_file, write_all, write_whole
from mesa_swarm.reproduction.drawing import svg
from mesa_swarm.reproduction.judging import Result
from mesa_swarm.reproduction.laboratory import Laboratory
from mesa_swarm.reproduction.registry import Item, Made, find_item, items, report
from mesa_swarm.viewing.pictures import png

FEW = "Few seeds and short runs: this shows that it works; the verdicts mean nothing."


def list_figures() -> None:
    """Print every result with its number, section and title."""
    for item in items().values():
        print(f"{item.figure:5} {item.title} (thesis {item.section})")


def reproduce(
    figures: Sequence[str],
    *,
    out: Path,
    quick: bool,
    jobs: int,
    report_to: Path | None,
    progress: bool,
) -> None:
    """Make results one after the other, write the files of each, and print what came of it.

    Parameters
    ----------
    figures : sequence of str
        Their numbers; all if there is none.
    out : Path
        Folder for pictures, tables and the runs, which are kept.
    quick : bool
        Whether few seeds and short runs are enough; the names of files then end in _quick.
    jobs : int
    report_to : Path, optional
        Where to write the page of all that were made.
    progress : bool
    """
    chosen = chosen_items(figures)
    workers, folder = checked_jobs(jobs), check_writable(out)
    if report_to is not None:
        checked_file(report_to, ".md", "report")
    with Laboratory(folder, quick=quick, jobs=workers, progress=progress) as laboratory:
        try:
            made = [announced(one, folder, "_quick" if quick else "") for one in made_by(laboratory, chosen)]
        except KeyboardInterrupt:
            print(f"the runs so far are kept in {folder}; the same command goes on where this one stopped")
            raise
    if quick:
        print(FEW)
    if report_to is not None:
        print(write_whole(report_to, report(made, quick=quick)))


def chosen_items(figures: Sequence[str]) -> list[Item]:
    """Return the results of these numbers in the thesis's order, each once; all where none is given.

    Examples
    --------
    >>> [item.figure for item in chosen_items(["8.1", "7.3", "8.1"])]
    ['7.3', '8.1']
    """
    wanted = {find_item(figure).figure for figure in figures}
    return [item for item in items().values() if item.figure in wanted or not figures]


def made_by(laboratory: Laboratory, chosen: Sequence[Item]) -> Iterator[Made]:
    """Yield results as they are made.

    Raises
    ------
    InvalidValueError
        If nothing can be made of runs that were stored before, because their numbers are not those of such runs.
    """
    for item in chosen:
        started = perf_counter()
        try:
            result = item.make(laboratory)
        except SwarmError:
            raise
        except (ArithmeticError, LookupError, TypeError, ValueError) as error:
            if not laboratory.found:
                raise
            raise InvalidValueError(
                f"figure {item.figure} cannot be made of the runs in {laboratory.path} ({type(error).__name__}); "
                "remove the file to make them again"
            ) from error
        yield Made(item=item, result=result, seconds=perf_counter() - started)


def announced(one: Made, folder: Path, mark: str) -> Made:
    """Write the files of a result, print what came of it, and return it."""
    paths = written(one.item.figure, one.result, folder, mark)
    print(f"{one.item.figure:5} {one.result.verdict}: {one.item.title} ({one.seconds:.0f} s)")
    for check in one.result.checks:
        print(f"        {check.outcome}: {check.claim}: {check.measured} (the thesis: {check.reported})")
    print(f"        {paths[0]}", flush=True)
    return one


def written(figure: str, result: Result, folder: Path, mark: str) -> list[Path]:
    """Write the pictures and the table of a result, each whole or not at all; the first is its picture.

    The mark ends their names: quick results do not take the place of full ones.
    """
    contents: dict[str, str | bytes] = {}
    for word, picture in result.pictures.items():
        name = f"figure_{figure}" + (f"_{word}" if word else "") + mark
        contents |= {f"{name}.png": png(picture), f"{name}.svg": svg(picture)}
    contents[f"figure_{figure}{mark}.csv"] = result.csv()
    return write_all(folder, contents)
