"""Recorded runs that pages of the site embed: each a page that plays without a server, small enough for a telephone."""

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from mesa_swarm import Recording, model_info
from mesa_swarm.dashboard.gallery_pictures import SHOTS
from mesa_swarm.gallery import find_model, gallery_names
from mesa_swarm.viewing.replay_page import replay_page

# Rows that a page plays in a second at its usual speed, and seconds that are recorded.
ROWS_A_SECOND, SECONDS = 30, 16
LARGEST = 400_000  # bytes of a page
FILE = Path(__file__).with_name("recorded_runs.toml")


@dataclass(frozen=True, kw_only=True, slots=True)
class RecordedRun:
    """A run to record.

    Parameters
    ----------
    model : str
    title : str
        What is seen, in a few words.
    settings : dict
        Parameters that are not the defaults.
    rng, start : int
        The seed, and the first recorded step.
    """

    model: str
    title: str
    settings: dict[str, Any] = field(default_factory=dict)
    rng: int = 1
    start: int = 0

    def page(self) -> str:
        """Return the page that plays it, with as many rows as its size permits."""
        rows = ROWS_A_SECOND * SECONDS
        while len(page := self._page(rows)) > LARGEST:
            rows = int(0.95 * rows * LARGEST / len(page))
        return page

    @property
    def every(self) -> int:
        """Steps from one row to the next: the page plays the model at the speed at which the dashboard opens it."""
        return max(1, round(model_info(self.model).speed / ROWS_A_SECOND))

    def _page(self, rows: int) -> str:
        model = find_model(self.model)(rng=self.rng, **self.settings).run(self.start)
        with TemporaryDirectory() as folder:
            file = Path(folder) / "run.arrow"
            with model.record(file, every=self.every, checkpoint_every=0):
                model.run(rows * self.every)
            return replay_page(Recording(file))


def recorded_runs() -> dict[str, RecordedRun]:
    """Return the runs by their names: one of each model, from the moment of its picture in the gallery, and others."""
    usual = {
        name: RecordedRun(
            model=name, title=name.replace("_", " "), start=SHOTS[name].start, settings=SHOTS[name].settings
        )
        for name in gallery_names()
    }
    others = tomllib.loads(FILE.read_text(encoding="utf-8"))
    return usual | {name: RecordedRun(**{"title": name, **table}) for name, table in others.items()}
