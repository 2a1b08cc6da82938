"""Quality-diversity search: an archive of controllers that behave differently, each the best of its kind found."""

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from mesa_swarm.analysis.clusters import clusters
from mesa_swarm.base.errors import InvalidValueError, LearningError, check_choice, check_count, check_number
from mesa_swarm.base.extras import require_extra
from mesa_swarm.base.files import write_whole
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.base.streams import Streams
from mesa_swarm.control import Subsumption
from mesa_swarm.experiments.fingerprints import engine_hash, fingerprint
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.experiments.run_tables import RunFiles, TableHead
from mesa_swarm.experiments.runs import Run, done_in_order
from mesa_swarm.experiments.tables import csv_text
from mesa_swarm.experiments.worker_pool import checked_jobs
from mesa_swarm.learning.policy import PolicyLayer
from mesa_swarm.learning.reflex_policy import ReflexPolicy
from mesa_swarm.maps.map import Map
from mesa_swarm.searches.automatic_design import LINK
from mesa_swarm.searches.drive_measures import driven_world, tallied
from mesa_swarm.searches.evolved_controllers import Trial, checked_maps, checked_trial, settings_of
from mesa_swarm.viewing.figures import plain_figure
from mesa_swarm.viewing.palette import LIGHT

# Measures of behaviour with their ranges.
MEASURES = {"coverage": (0.0, 1.0), "speed": (0.0, 1.0), "largest group": (0.0, 1.0)}
# Every how many steps groups are counted.
COUNTED_EVERY = 25
FORMAT = "mesa_swarm archive 1"
# Trials depend on these files and on the engine; after a change they are repeated.
SOURCES = tuple(f"searches/{name}.py" for name in ("diversity", "drive_measures", "evolved_controllers"))


def need_ribs() -> None:
    """Check that pyribs is installed; if not, the error gives the command that installs it."""
    require_extra("ribs", "diversity", "quality-diversity search needs", "pyribs")


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class BehaviourMap:
    """The outcome of `diversify`: the best controller found in each cell of a grid over two measures.

    Parameters
    ----------
    measures : (str, str)
        Of the rows and the columns.
    fitness : ndarray, shape (rows, columns)
        Of the best controller of each cell, NaN where none was found.
    genomes : ndarray, shape (rows, columns, genes)
        Its weights, NaN where none was found.
    trial : Trial
        How they were tried.
    tried : int
        How many controllers were tried.
    """

    measures: tuple[str, str]
    fitness: np.ndarray
    genomes: np.ndarray
    trial: Trial = field(default_factory=Trial)
    tried: int = 0

    @property
    def filled(self) -> float:
        """The share of cells in which a controller was found."""
        return float(np.isfinite(self.fitness).mean())

    def policy(self, row: int, column: int) -> ReflexPolicy:
        """Return the controller of a cell.

        Raises
        ------
        InvalidValueError
            If there is no such cell, or no controller in it.
        """
        rows, columns = self.fitness.shape
        check_count("row", row, maximum=rows - 1)
        check_count("column", column, maximum=columns - 1)
        if not np.isfinite(self.fitness[row, column]):
            raise InvalidValueError(f"no controller was found for row {row}, column {column}; choose a filled cell")
        return self.trial.policy(self.genomes[row, column], steps=self.tried * self.trial.robots * self.trial.steps)

    def csv(self) -> str:
        """Return one line for each filled cell: the middles of its measures, and the fitness."""
        middles = [cell_middles(name, count) for name, count in zip(self.measures, self.fitness.shape, strict=True)]
        cells = np.argwhere(np.isfinite(self.fitness)).tolist()
        rows = [[round(middles[0][r], 6), round(middles[1][c], 6), float(self.fitness[r, c])] for r, c in cells]
        return csv_text([[*self.measures, "fitness"], *rows])

    def save(self, file: str | os.PathLike[str]) -> None:
        """Write fitness and weights to a .json file, whole or not at all."""
        cells = np.argwhere(np.isfinite(self.fitness)).tolist()
        found = [[r, c, float(self.fitness[r, c]), self.genomes[r, c].tolist()] for r, c in cells]
        named = {"format": FORMAT, "measures": self.measures, "cells": self.fitness.shape, "tried": self.tried}
        write_whole(Path(file), json.dumps({**named, "found": found}), LearningError)


def cell_middles(measure: str, cells: int) -> list[float]:
    """Return the value of a measure in the middle of each of its cells."""
    low, high = MEASURES[measure]
    return (low + (high - low) * (np.arange(cells) + 0.5) / cells).tolist()


def diversify(
    trial: Trial | None = None,
    *,
    measures: Sequence[str] = ("coverage", "speed"),
    cells: int = 20,
    generations: int = 40,
    emitters: int = 3,
    batch: int = 12,
    sigma: float = 0.5,
    world: Map | str | os.PathLike[str] = "openspace",
    rng: int = 1,
    jobs: int = 1,
    progress: bool = False,
    out: str | os.PathLike[str] | None = None,
    tables: Sequence[str] = (),
) -> BehaviourMap:
    """Search for reflexes that behave differently, by CMA-ME of pyribs [1]_: the best of each cell of two measures.

    All controllers are tried with one seed on one map, so that the cells can be compared. The result depends only on
    the arguments, and not on `jobs`. It needs the extra `diversity`.

    Parameters
    ----------
    trial : Trial, optional
        How a controller is tried, and its fitness; by default of reflexes without hidden units.
    measures : two of "coverage", "speed", "largest group"
        The share of the map's squares that were visited; the mean absolute speed of the wheels as a share of max_speed;
        the mean share of robots in the largest group.
    cells : int
        Along each measure, 2 to 200.
    generations, emitters, batch : int
        Controllers a generation: `batch` of each emitter.
    sigma : float
        Standard deviation of the first weights.
    world : map, name or path
    rng, jobs : int
    progress : bool
    out : path, optional
        Folder in which each trial is stored as soon as it is done: a search that was interrupted, or killed,
        continues when it is called again with the same arguments.
    tables : sequence of str
        Forms of tables with a row for each trial, see `sweep`; they need `out`.

    Returns
    -------
    BehaviourMap

    Raises
    ------
    SwarmError
        If pyribs is not installed, or anything is wrong.

    References
    ----------
    .. [1] Fontaine, Togelius, Nikolaidis and Hoover, Covariance matrix adaptation for the rapid illumination of
       behavior space, GECCO 2020; Tjanaka et al., pyribs: a bare-bones Python library for quality diversity
       optimization, GECCO 2023.
    """
    need_ribs()
    task = checked_trial("trial", Trial(robots=10, steps=400, units=0, encoding="typed") if trial is None else trial)
    names = check_two_measures(measures)
    check_count("cells", cells, minimum=2, maximum=200)
    check_number("sigma", sigma, above=0, maximum=1000)
    count = check_count("generations", generations, minimum=1, maximum=1_000_000)
    place, workers = checked_maps("world", world)[0], checked_jobs(jobs)
    streams = Streams(np.random.SeedSequence(check_count("rng", rng, maximum=2**63 - 1)))
    seeds = streams["search"].integers(2**31, size=check_count("emitters", emitters, minimum=1, maximum=1000) + 1)
    size = check_count("batch", batch, minimum=4, maximum=10_000)
    files = RunFiles.checked(out, tables=tables)
    archive, search = _begun(task.genes, names, cells, float(sigma), size, seeds.tolist())
    seed = int(streams["world"].integers(2**63))
    work = partial(_numbers_of, task, names, place)
    decisive = engine_hash(*SOURCES), version("mesa-swarm"), settings_of(task, [place]), names
    done: list[tuple[Run, Outcome]] = []
    with progress_bar(count, "generations", progress) as bar, files.ledger() as ledger:
        for _ in range(count):
            settings = [{"genome": genome.tolist()} for genome in search.ask()]
            runs = [Run(work, each, seed, task.steps, fingerprint(*decisive, each, seed)) for each in settings]
            done += done_in_order(runs, ledger=ledger, workers=workers)
            worth = np.array([list(outcome.numbers.values()) for _, outcome in done[-len(runs) :]])
            search.tell(worth[:, 0], worth[:, 1:])
            bar.update()
    files.write(TableHead(__name__, "diversity", place.bounds), lambda: done)
    fitness, genomes = best_of_cells(archive.data(), cells, task.genes)
    return BehaviourMap(measures=names, fitness=fitness, genomes=genomes, trial=task, tried=count * size * emitters)


def _begun(
    genes: int, measures: tuple[str, str], cells: int, sigma: float, batch: int, seeds: list[int]
) -> tuple[Any, Any]:
    """Return the archive and the scheduler of a search by CMA-ME; the first seed is the archive's, others emitters'."""
    from ribs.archives import GridArchive  # noqa: PLC0415 - optional
    from ribs.emitters import EvolutionStrategyEmitter  # noqa: PLC0415
    from ribs.schedulers import Scheduler  # noqa: PLC0415

    archive = GridArchive(
        solution_dim=genes,
        dims=(cells, cells),
        ranges=[MEASURES[name] for name in measures],
        seed=seeds[0],
        learning_rate=1.0,
        threshold_min=-np.inf,
    )
    of_emitter: dict[str, Any] = {"x0": np.zeros(genes), "sigma0": sigma, "batch_size": batch}
    return archive, Scheduler(
        archive, [EvolutionStrategyEmitter(archive, **of_emitter, seed=seed) for seed in seeds[1:]]
    )


def best_of_cells(stored: Any, cells: int, genes: int) -> tuple[np.ndarray, np.ndarray]:
    """Return fitness (cells, cells) and genome (cells, cells, genes) of the best of each cell, NaN in empty ones."""
    fitness, genomes = np.full((cells, cells), np.nan), np.full((cells, cells, genes), np.nan)
    rows, columns = np.unravel_index(stored["index"], (cells, cells))
    fitness[rows, columns], genomes[rows, columns] = stored["objective"], stored["solution"]
    return fitness, genomes


def check_two_measures(measures: Sequence[str]) -> tuple[str, str]:
    """Return two different measures."""
    names = [check_choice("measure", name, MEASURES) for name in measures] if not isinstance(measures, str) else []
    if len(set(names)) != 2 or len(names) != 2:
        raise InvalidValueError(f"measures is {measures!r}; expected two different ones of {', '.join(MEASURES)}")
    return names[0], names[1]


def behaviour_of(
    trial: Trial, measures: tuple[str, str], world: Map, rng: int, genome: np.ndarray
) -> tuple[float, float, float]:
    """Return the fitness of a controller, and two measures of how its robots behave."""
    model = driven_world(Subsumption(PolicyLayer(policy=trial.policy(genome))), trial.design, trial.robots, world, rng)
    groups, speeds = [], []

    def measure(step: int) -> None:
        if step % COUNTED_EVERY == 0:
            groups.append(clusters(model.swarm.position, LINK).largest_fraction)
        columns = model.swarm.columns
        speeds.append(np.abs(columns["command"]).mean(axis=1) / np.maximum(columns["max_speed"], 1e-12))

    means = tallied(model, trial.steps, measure, square=trial.fitness.square).means()
    found = {"coverage": means["covered"], "speed": float(np.mean(speeds)), "largest group": float(np.mean(groups))}
    return trial.fitness.of(**means), found[measures[0]], found[measures[1]]


def _numbers_of(
    trial: Trial, measures: tuple[str, str], world: Map, *, genome: list[float], rng: int
) -> dict[str, float]:
    """Return the same by name, as a run does."""
    return dict(zip(("fitness", *measures), behaviour_of(trial, measures, world, rng, np.array(genome)), strict=True))


def behaviour_figure(found: BehaviourMap) -> Figure:
    """Return the map of behaviours: a cell for each pair of measures, coloured by the best fitness found there.

    A quarter of the cells at most, those of the lowest fitness, share the last colour: a few that collide without end
    would else leave one colour to all others.
    """
    figure, ((axes,),) = plain_figure((7.2, 5.6))
    figure.set_facecolor(LIGHT.paper)
    axes.set_facecolor(LIGHT.outside)
    (low, high), (left, right) = (MEASURES[name] for name in found.measures)
    shown = np.ma.masked_invalid(found.fitness)
    colours = ListedColormap(LIGHT.values)
    least = float(np.quantile(shown.compressed(), 0.25)) if shown.count() else None
    extent = (left, right, low, high)
    image = axes.imshow(shown, origin="lower", extent=extent, aspect="auto", cmap=colours, vmin=least)
    axes.set(xlabel=found.measures[1], ylabel=found.measures[0])
    axes.set_title(f"{found.filled:.0%} of the cells filled by {found.tried:,} controllers", fontsize=11)
    figure.colorbar(image, ax=axes, extend="min", label="best fitness in the cell")
    return figure
