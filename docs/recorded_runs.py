"""Runs that pages of the site embed, each a page without a server, small enough for a telephone: recorded, and live."""

import ast
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import nbformat

from mesa_swarm import Recording, model_info
from mesa_swarm.base.wording import quantity
from mesa_swarm.dashboard.gallery.gallery_pictures import SHOTS
from mesa_swarm.errors import ExportError, InvalidValueError
from mesa_swarm.gallery import find_model
from mesa_swarm.live.live_page import LivePage
from mesa_swarm.viewing.replay_page import replay_page

# Rows that a page plays in a second at its usual speed, and seconds that are recorded.
ROWS_A_SECOND, SECONDS = 30, 16
# A shorter run, as of a model that stops soon, would hardly be seen.
LEAST_SECONDS = 3
LARGEST = 400_000  # bytes of a page
SEEDS = 5  # with which a page that runs a model can begin
FILE = Path(__file__).with_name("recorded_runs.toml")
NOTEBOOKS = Path(__file__).parents[1] / "notebooks"


@dataclass(frozen=True, kw_only=True, slots=True)
class RecordedRun:
    """A run to record.

    Parameters
    ----------
    model : str
        A model of the gallery; with `cells`, the class that they define.
    title : str
        What is seen, in a few words.
    settings : dict
        Parameters that are not the defaults.
    rng, start : int
        The seed, and the first recorded step.
    notebook : str
        The name of a notebook that defines the model.
    cells : sequence of str
        The ids of those of its cells that do so.
    """

    model: str
    title: str
    settings: dict[str, Any] = field(default_factory=dict)
    rng: int = 1
    start: int = 0
    notebook: str = ""
    cells: Sequence[str] = ()

    def live_page(self) -> str:
        """Return the page that runs the model; empty where it has Python, or is large."""
        with TemporaryDirectory() as folder:
            model_class = find_model(self._address(Path(folder)))
            try:
                page = LivePage(model_class(rng=self.rng, **self.settings), range(1, SEEDS + 1)).text(LARGEST)
            except ExportError:
                return ""
            return page if len(page) <= LARGEST else ""

    def page(self) -> str:
        """Return the page that plays a recording of it, with as many rows as its size permits."""
        rows = ROWS_A_SECOND * SECONDS
        while len(page := self._page(rows)) > LARGEST:
            rows = int(0.95 * rows * LARGEST / len(page))
        return page

    def _page(self, rows: int) -> str:
        with TemporaryDirectory() as folder:
            model_class = find_model(self._address(Path(folder)))
            model, every = model_class(rng=self.rng, **self.settings).run(self.start), steps_a_row(model_class)
            file = Path(folder) / "run.arrow"
            with model.record(file, every=every, checkpoint_every=0):
                model.run(rows * every)
            recording = Recording(file)
            if len(recording) < LEAST_SECONDS * ROWS_A_SECOND:
                raise InvalidValueError(
                    f"{self.title}: {quantity(len(recording), 'row')} from step {self.start} on; "
                    f"expected {LEAST_SECONDS * ROWS_A_SECOND} or more: begin earlier, or take another seed"
                )
            return replay_page(recording)

    def _address(self, folder: Path) -> str:
        """Return the model's name; one of a notebook is first written to a file, definitions only."""
        if not self.cells:
            return self.model
        sources = {cell.id: cell.source for cell in nbformat.read(NOTEBOOKS / f"{self.notebook}.ipynb", 4).cells}
        tree = ast.parse("\n".join(sources[cell] for cell in self.cells))
        tree.body = [part for part in tree.body if not isinstance(part, ast.Expr)]
        file = folder / "notebook.py"
        file.write_text(ast.unparse(tree), encoding="utf-8")
        return f"{file}:{self.model}"


def steps_a_row(model_class: type) -> int:
    """Return the steps from one row to the next, for the speed at which the dashboard opens the model."""
    return max(1, round(model_info(model_class).speed / ROWS_A_SECOND))


def recorded_runs() -> dict[str, RecordedRun]:
    """Return the runs by their names: one of each model, and those of notebooks; see the file."""
    usual = {
        name: RecordedRun(
            model=name, title=name.replace("_", " "), start=shot.start, settings=shot.settings, rng=shot.seed
        )
        for name, shot in SHOTS.items()
    }
    others = tomllib.loads(FILE.read_text(encoding="utf-8"))
    return usual | {name: RecordedRun(**{"title": name, "notebook": name, **table}) for name, table in others.items()}
