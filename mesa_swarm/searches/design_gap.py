"""The reality gap of designed controllers: state machines and evolved networks of the same budget, over the dial."""

import json
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm.base.errors import LearningError, check_choice, check_count
from mesa_swarm.base.files import show_path, write_whole
from mesa_swarm.control import Subsumption
from mesa_swarm.control.arbiter import Arbiter
from mesa_swarm.experiments.figures import COLOURS
from mesa_swarm.experiments.ledger import Outcome
from mesa_swarm.experiments.reality_gap import DIAL, checked_dial
from mesa_swarm.experiments.run_tables import RunFiles, TableHead
from mesa_swarm.experiments.runs import Run, done_in_order
from mesa_swarm.experiments.statistics import Interval, bootstrap_mean
from mesa_swarm.experiments.tables import Study, csv_text, fitting, with_limits
from mesa_swarm.experiments.worker_pool import checked_jobs
from mesa_swarm.learning.policy import PolicyLayer
from mesa_swarm.maps.map import Map
from mesa_swarm.maps.random_map import random_map
from mesa_swarm.robots.imperfections import PRESETS
from mesa_swarm.searches.automatic_design import (
    MachineSpace,
    Mission,
    checked_mission,
    design_machine,
    evolve_network,
    settings_of_mission,
)
from mesa_swarm.viewing.figures import plain_figure, png
from mesa_swarm.viewing.palette import LIGHT

MACHINE, NETWORK = "state machine", "evolved network"
KINDS = (MACHINE, NETWORK)
# Maps of the search and of the evaluation: numbers of random maps, none in both.
SEARCHED, EVALUATED = range(100, 110), 10_000
SIZE, OBSTACLES = (480.0, 360.0), 3
FORMAT = "mesa_swarm designed controller 1"


@dataclass(frozen=True, kw_only=True, slots=True)
class Budget:
    """How much is searched for one controller; the same for both kinds.

    Parameters
    ----------
    generations, population, finalists, final_trials : int
        See `design_machine`.

    Examples
    --------
    >>> Budget(generations=10, population=8, finalists=2, final_trials=5).runs
    90
    """

    generations: int = 20
    population: int = 12
    finalists: int = 5
    final_trials: int = 8

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, least in (("generations", 1), ("population", 4), ("finalists", 1), ("final_trials", 1)):
            check_count(name, getattr(self, name), minimum=least, maximum=1_000_000)

    @property
    def runs(self) -> int:
        """How many runs a controller takes."""
        finalists = min(self.finalists, self.generations)
        return self.generations * self.population + finalists * self.final_trials


@dataclass(frozen=True, kw_only=True, slots=True)
class DesignGap(Study):
    """Scores of designed controllers over the dial: by kind one row a design, a column a place of the dial.

    Each score is the mean over the evaluation seeds; `texts` are the machines that were designed, and `settings` all
    that decides the result.
    """

    mission: str
    preset: str
    dial: tuple[float, ...]
    seeds: int
    scores: dict[str, list[list[float]]]
    texts: list[str] = field(default_factory=list)
    settings: dict[str, Any] = field(default_factory=dict)

    def mean(self, kind: str, place: int) -> Interval:
        """Return the mean score over designs at a place of the dial, by its index."""
        return bootstrap_mean([row[place] for row in self.scores[kind]])

    def lost(self, kind: str, place: int) -> Interval:
        """Return the mean over designs of the score lost since the first place of the dial, same seeds."""
        return bootstrap_mean(self._losses(kind, place).tolist())

    def more_lost(self, place: int) -> Interval:
        """Return by how much more networks lose than machines: means over pairs of designs with the same seed."""
        return bootstrap_mean((self._losses(NETWORK, place) - self._losses(MACHINE, place)).tolist())

    def advantage(self, place: int) -> Interval:
        """Return by how much machines score higher than networks: means over pairs of designs with the same seed."""
        machine, network = (np.array(self.scores[kind])[:, place] for kind in KINDS)
        return bootstrap_mean((machine - network).tolist())

    def _losses(self, kind: str, place: int) -> np.ndarray:
        rows = np.array(self.scores[kind])
        return rows[:, 0] - rows[:, place]

    def table(self, width: int | None = None) -> str:
        """Return the scores and losses as text, the table at most `width` columns wide if that is given."""
        head = [
            "dial",
            *(f"{kind} [95 %]" for kind in KINDS),
            *(f"lost by {kind}" for kind in KINDS),
            "network loses more",
        ]
        rows = []
        for k, place in enumerate(self.dial):
            scores = [with_limits(self.mean(kind, k)) for kind in KINDS]
            losses = [
                with_limits(one, signed=True) for one in (*(self.lost(kind, k) for kind in KINDS), self.more_lost(k))
            ]
            rows.append([f"{place:g}", *scores, *(losses if k else ["", "", ""])])
        count = len(self.scores[MACHINE])
        title = f"{self.mission}, {self.preset} robots: {count} designs of each kind, {self.seeds} seeds each"
        return "\n".join([title, "", *fitting([head, *rows], width), "", self.finding()])

    def finding(self) -> str:
        """Return a sentence about losses at the last place of the dial, and one about scores at both ends."""
        end = len(self.dial) - 1
        last = self.more_lost(end)
        verdict = "no difference in loss was detected"
        if last.excludes_zero:
            verdict = f"{NETWORK if last.estimate > 0 else MACHINE}s lose more"
        ends = " and ".join(f"{with_limits(self.advantage(k), signed=True)} at dial {self.dial[k]:g}" for k in (0, end))
        return (
            f"At dial {self.dial[-1]:g}, {verdict}: {with_limits(last, signed=True)}. "
            f"Score of machines minus that of networks: {ends}."
        )

    def csv(self) -> str:
        """Return one line a design and place of the dial."""
        rows = [
            [kind, design + 1, place, score]
            for kind in KINDS
            for design, row in enumerate(self.scores[kind])
            for place, score in zip(self.dial, row, strict=True)
        ]
        return csv_text([["controller", "design", "dial", "score"], *rows])

    def _texts(self) -> dict[str, str]:
        return {"design_gap.csv": self.csv(), "machines.txt": "\n".join(self.texts)}

    def _pictures(self) -> dict[str, bytes]:
        return {"design_gap.png": png(design_gap_figure(self))}


def design_gap(
    mission: Mission | None = None,
    *,
    space: MachineSpace | None = None,
    budget: Budget | None = None,
    designs: int = 20,
    seeds: int = 30,
    dial: Sequence[float] = DIAL,
    preset: str = "measured",
    rng: int = 1,
    jobs: int = 1,
    out: str | os.PathLike[str] | None = None,
    progress: bool = False,
    tables: Sequence[str] = (),
) -> DesignGap:
    """Design machines and networks for ideal robots by the same budget, and evaluate both over the reality dial.

    The n-th machine and the n-th network are searched on the same maps; all are evaluated on maps and seeds of their
    own, the same for every controller and place of the dial.

    Parameters
    ----------
    mission : Mission, optional
    space : MachineSpace, optional
        By default of 3 states with 2 transitions out of each.
    budget : Budget, optional
    designs, seeds : int
        Controllers of each kind, and runs of each at each place of the dial, at least 2 and 1.
    dial : sequence of float
        Rising places, 0 to 1.
    preset : str
        See `reality_gap`.
    rng : int
        Seed of the first design; the others have the next ones.
    jobs : int
        Processes, -1 for one on each core.
    out : path, optional
        Folder in which each controller and its scores are stored when they are done; a call with the same settings
        continues from there; one with other settings is refused.
    progress : bool
    tables : sequence of str
        Forms of tables with a row for each controller and place of the dial, see `sweep`; they need `out`.

    Raises
    ------
    SwarmError

    Examples
    --------
    >>> small = Budget(generations=1, population=4, finalists=1, final_trials=1)
    >>> gap = design_gap(Mission(robots=3, steps=20), budget=small, designs=2, seeds=1, dial=(0, 1))
    >>> np.shape(gap.scores["state machine"])
    (2, 2)
    """
    task, places = checked_mission(mission), checked_dial(dial)
    work = _Work(
        mission=task,
        space=MachineSpace(states=3, transitions=2) if space is None else space,
        budget=Budget() if budget is None else budget,
        seeds=check_count("seeds", seeds, minimum=1, maximum=100_000),
        dial=places,
        preset=check_choice("preset", preset, PRESETS),
    )
    first = check_count("rng", rng)
    count = check_count("designs", designs, minimum=2, maximum=10_000)
    files = RunFiles.checked(out, tables=tables)
    settings = json.loads(json.dumps(work.settings))
    runs = [
        Run(work.result, {"kind": kind}, seed, key=f"{kind.replace(' ', '_')}_{seed}")
        for seed in range(first, first + count)
        for kind in KINDS
    ]
    done = done_in_order(
        runs,
        ledger=None if files.folder is None else ControllerFiles(files.folder, settings),
        workers=checked_jobs(jobs),
        progress=progress,
        unit="designs",
    )
    files.write(TableHead(__name__, task.name, (0.0, 0.0, *SIZE)), lambda: work.rows(done))
    results = {kind: [outcome.numbers for run, outcome in done if run.settings["kind"] == kind] for kind in KINDS}
    scores = {kind: [result["scores"] for result in of_kind] for kind, of_kind in results.items()}
    texts = [result["controller"] for result in results[MACHINE]]
    return DesignGap(
        mission=task.name, preset=preset, dial=places, seeds=seeds, scores=scores, texts=texts, settings=settings
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class _Work:
    """What is done for each controller."""

    mission: Mission
    space: MachineSpace
    budget: Budget
    seeds: int
    dial: tuple[float, ...]
    preset: str

    @property
    def settings(self) -> dict:
        """All that decides a result besides kind and seed."""
        maps = search_maps()
        rest = {"space": asdict(self.space), "budget": asdict(self.budget), "seeds": self.seeds, "dial": self.dial}
        return {**settings_of_mission(self.mission, maps), **rest, "preset": repr(PRESETS[self.preset])}

    def result(self, *, kind: str, rng: int) -> dict[str, Any]:
        """Design one controller and evaluate it; return the controller and its score at each place of the dial."""
        maps, search = search_maps(), asdict(self.budget)
        control: Arbiter
        if kind == MACHINE:
            control = design_machine(self.mission, space=self.space, maps=maps, rng=rng, **search).machine
            described: Any = control.text()  # type: ignore[attr-defined]
        else:
            policy = evolve_network(self.mission, maps=maps, rng=rng, **search).policy
            control, described = Subsumption(PolicyLayer(policy=policy)), policy.wheel.tolist()
        return {"controller": described, "scores": [self._score(control, place) for place in self.dial]}

    def rows(self, done: Iterable[tuple[Run, Outcome]]) -> Iterator[tuple[Run, Outcome]]:
        """Yield a row of a table for each design and place of the dial."""
        for run, outcome in done:
            for place, score in zip(self.dial, outcome.numbers["scores"], strict=True):
                settings = {"controller": run.settings["kind"], "dial": place}
                yield replace(run, settings=settings), Outcome(self.mission.steps, results={"score": score})

    def _score(self, control: Arbiter, place: float) -> float:
        imperfections = PRESETS[self.preset].at(place)
        run = partial(self.mission.score, control, imperfections=imperfections)
        return float(np.mean([run(world=_map(EVALUATED + k), rng=EVALUATED + k) for k in range(self.seeds)]))


def search_maps() -> list[Map]:
    """Return the maps on which controllers are searched: random ones with few obstacles."""
    return [_map(k) for k in SEARCHED]


def _map(number: int) -> Map:
    return random_map(number, obstacles=OBSTACLES, size=SIZE)


@dataclass(frozen=True, slots=True)
class ControllerFiles:
    """Designed controllers with their scores, a file each: a store of outcomes, as a ledger is.

    A file of a controller that was designed with other settings is refused, and never replaced.
    """

    path: Path
    settings: dict[str, Any]

    def outcome(self, key: str) -> Outcome | None:
        """Return the stored result of a design, None if there is none."""
        file, stored = self.path / f"{key}.json", None
        with suppress(OSError, ValueError, RecursionError):
            stored = json.loads(file.read_text(encoding="utf-8"))
        if not isinstance(stored, dict) or stored.get("format") != FORMAT:
            return None
        before = stored.get("settings")
        if not isinstance(before, dict):
            return None
        changed = sorted(name for name, now in self.settings.items() if before.get(name) != now)
        if changed:
            raise LearningError(
                f"{show_path(file)} is of controllers with other {', '.join(changed)}; "
                "use its settings or another folder"
            )
        return Outcome(results={name: stored[name] for name in ("controller", "scores")})

    def append(self, key: str, outcome: Outcome) -> None:
        """Write the file of a design, whole or not at all."""
        content = {"format": FORMAT, "settings": self.settings, **outcome.numbers}
        write_whole(self.path / f"{key}.json", json.dumps(content), LearningError)


def design_gap_figure(gap: DesignGap) -> Figure:
    """Return two charts over the dial: the scores of both kinds, and what they lose; thin lines are single designs."""
    figure, ((left, right),) = plain_figure((11, 4.6), 1, 2, grid=True)
    for place, kind in enumerate(KINDS):
        rows = np.array(gap.scores[kind])
        _draw(left, gap.dial, rows, [gap.mean(kind, k) for k in range(len(gap.dial))], place, kind)
        _draw(right, gap.dial, rows[:, :1] - rows, [gap.lost(kind, k) for k in range(len(gap.dial))], place, kind)
    right.axhline(0, color=LIGHT.ink, linewidth=1)
    left.set(ylabel="score", title=f"{gap.mission}: score")
    right.set(ylabel="score lost since dial 0", title="loss over the gap")
    for axes in (left, right):
        axes.set_xlabel(f"dial: 0 ideal, 1 {gap.preset}")
    left.legend(frameon=False)
    return figure


def _draw(axes: Axes, dial: Sequence[float], rows: np.ndarray, means: list[Interval], place: int, label: str) -> None:
    """Draw the designs of one kind, and their mean with its interval."""
    colour, aside = COLOURS[place], 0.012 * (2 * place - 1)
    at = np.array(dial) + aside
    axes.plot(at, rows.T, color=colour, linewidth=0.6, alpha=0.28)
    reach = np.nan_to_num([[m.estimate - m.low for m in means], [m.high - m.estimate for m in means]])
    style = "os"[place] + "-"
    axes.errorbar(
        at, [m.estimate for m in means], reach, fmt=style, color=colour, linewidth=2.2, capsize=4, label=label
    )
