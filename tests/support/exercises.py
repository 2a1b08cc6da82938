"""Exercises of the notebooks: their cells, solutions and further answers, and the verdicts on them."""

import ast
import io
import re
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import nbformat
import pytest

from mesa_swarm.teaching.checks import Verdict

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
NAMES = [path.stem for path in NOTEBOOKS]
EXERCISES = ("exercise-1", "exercise-2")
ANSWERS = ROOT / "tests" / "notebooks" / "answers"


def read(path: Path) -> nbformat.NotebookNode:
    return nbformat.read(path, as_version=4)


def cells_of(path: Path) -> dict[str, str]:
    """Return the sources of a notebook's cells by id."""
    return {cell.id: cell.source for cell in read(path).cells}


def check_of(exercise: str) -> str:
    return exercise.replace("exercise", "check")


def parts_of(path: Path) -> dict[str, str]:
    """Return the parts of a file between lines such as `# %% exercise-1`, by what stands on these lines."""
    parts = re.split(r"^# %% (.+)\n", path.read_text(), flags=re.MULTILINE)[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def solutions_of(path: Path) -> dict[str, str]:
    """Return what stands in the file of solutions for each exercise."""
    return parts_of(path.parent / "solutions" / f"{path.stem}.py")


def answers_of(path: Path) -> dict[str, str]:
    """Return further answers to a notebook's exercises, by exercise, kind (right, wrong, hint) and title."""
    return parts_of(ANSWERS / f"{path.stem}.py")


def last_value(source: str, place: dict[str, Any], path: Path) -> Any:
    """Run a cell and return the value of its last line, as a notebook shows it."""
    path.write_text(source)  # rules are compiled, for which their source must be in a file
    *body, last = ast.parse(source).body
    exec(compile(ast.Module(body, []), str(path), "exec"), place)
    if not isinstance(last, ast.Expr):
        exec(compile(ast.Module([last], []), str(path), "exec"), place)
        return None
    return eval(compile(ast.Expression(last.value), str(path), "eval"), place)


def names_of(number: int, *cells: str, folder: Path, **given: Any) -> dict[str, Any]:
    """Run cells of a notebook in full size and return the names that they define.

    What is `given` replaces names of the notebook after each of these cells, such as its seeds.
    """
    (path,) = (path for path in NOTEBOOKS if path.stem.startswith(f"{number:02}_"))
    sources, place = cells_of(path), {"__name__": "__main__"}
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(io.StringIO()):
        patch.delenv("MESA_SWARM_QUICK", raising=False)
        patch.setenv("MPLBACKEND", "agg")
        for cell in cells:
            last_value(sources[cell], place, folder / f"{cell.replace('-', '_')}.py")
            place |= given
    return place


class Desk:
    """A notebook at which answers to its exercises are given and checked, one after the other."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.cells, self.folder, self.place = cells_of(path), folder, {"__name__": "__main__"}
        self.number = 0
        self._run("setup", self.cells["setup"])

    def verdict_on(self, exercise: str, answer: str) -> Verdict:
        """Return the verdict of an exercise on an answer, the source of its cell."""
        self._run("answer", answer)
        return self._run("check", self.cells[check_of(exercise)])

    def _run(self, name: str, source: str) -> Any:
        self.number += 1
        with redirect_stdout(io.StringIO()):
            return last_value(source, self.place, self.folder / f"{name}_{self.number}.py")


def verdict_of(path: Path, exercise: str, answer: str, folder: Path) -> Verdict:
    """Return the verdict of an exercise on an answer given in a notebook of its own."""
    return Desk(path, folder).verdict_on(exercise, answer)


def name_of_answer(path: Path, exercise: str) -> str:
    """Return the name that the cell of an exercise defines last, which its check takes."""
    last = ast.parse(solutions_of(path)[exercise]).body[-1]
    return last.targets[0].id if isinstance(last, ast.Assign) else last.name  # type: ignore[union-attr]
