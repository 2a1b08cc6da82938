"""Measure every model of the gallery, with its defaults and with each of its presets, and store the values of each run.

::

    python docs/measure_models.py                     # all models, about ten minutes on one core
    python docs/measure_models.py boids flocking      # these, the others stay as they are

The plan was fixed before the runs: the seeds below, on which no text of a model had been based, and the numbers of
steps. `model_results.toml` holds one value a seed, `nan` where an event did not happen in that run; the tables of the
models' pages (`model_pages.py`) and the tests of what the texts of the models state are computed from it.
"""

import math
import sys
import tomllib
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm import model_info
from mesa_swarm.gallery import find_model, gallery_names

STORED = Path(__file__).with_name("model_results.toml")
SEEDS = range(301, 321)
DEFAULTS = "Defaults"
STEPS = {
    "agglomeration": 1_000,
    "ant_trails": 1_500,
    "best_of_n": 2_000,
    "boids": 500,
    "chain_formation": 1_500,
    "collision_avoidance": 3_000,
    "cooperative_transport": 2_000,
    "fire_fighting": 4_000,
    "flocking": 500,
    "foraging": 1_000,
    "learning_fires": 12_000,
    "perimeter": 1_000,
    "puck_clustering": 1_000,
    "q_learning": 4_000,
    "shepherding": 1_000,
    "signposts": 2_000,
    "task_allocation": 2_000,
}
# The last steps of a run, in which a robot that is displaced by less than its diameter counts as at rest.
REST = 200
DIAMETER = 10.0
# Of `results` these are not stored: times of single fires besides the largest.
LEFT_OUT = {"fire_fighting": [f"fire {number} out at" for number in (1, 3, 4, 5, 6, 7)]}
# Digits of a stored value.
DIGITS = 6


class Run(NamedTuple):
    """A model after its last step, and where its robots were 200 steps before."""

    model: Any
    before: np.ndarray

    def collected(self, name: str, part: slice = slice(None)) -> np.ndarray:
        """Return what a reporter collected in a part of the run."""
        return np.array(self.model.datacollector.model_vars[name], dtype=float)[part]

    @property
    def at_rest(self) -> float:
        """Share of robots that were displaced by less than 10 units in the last 200 steps."""
        return float(np.mean(np.hypot(*(self.model.swarm.position - self.before).T) < DIAMETER))

    @property
    def colliding(self) -> float:
        """Mean share of robots that collide in a step, over the last 200 steps."""
        return float(self.collected("collisions", slice(-REST, None)).mean() / len(self.model.swarm))

    @property
    def at_walls(self) -> float:
        """Share of robots whose centre is nearer than 20 units to a wall around the map, which is 20 units thick."""
        x0, y0, x1, y1 = self.model.map.bounds
        x, y = self.model.swarm.position.T
        return float(np.mean(np.min([x - x0, x1 - x, y - y0, y1 - y], axis=0) < 40.0))

    @property
    def outwards(self) -> tuple[np.ndarray, np.ndarray]:
        """Where robots are from their centroid (complex), and the cosines of their headings to straight outwards."""
        position = self.model.swarm.position @ (1, 1j)
        away = position - position.mean()
        return away, np.cos(np.angle(away) - self.model.swarm.heading)

    def work(self, caste: str) -> float:
        """Mean share of a caste at work in the second half."""
        return float(self.collected(caste, slice(self.model.steps // 2, None)).mean())


# What is measured besides `results`.
MORE: dict[str, dict[str, Callable[[Run], float | None]]] = {
    "agglomeration": {"share at rest": lambda run: run.at_rest, "share colliding in a step": lambda run: run.colliding},
    "ant_trails": {"share of the branch used more": lambda run: max(_upper(run), 1.0 - _upper(run))},
    "boids": {"share colliding in a step": lambda run: run.colliding, "share at rest": lambda run: run.at_rest},
    "chain_formation": {
        "share colliding in a step": lambda run: run.colliding,
        "share at rest": lambda run: run.at_rest,
    },
    "collision_avoidance": {"share at rest": lambda run: run.at_rest},
    "fire_fighting": {"fires in all": lambda run: len(run.model.fires)},
    "flocking": {"share colliding in a step": lambda run: run.colliding},
    "foraging": {
        "least energy": lambda run: float(run.collected("energy").min()),
        "share outside in the second half": lambda run: float(
            run.collected("outside", slice(run.model.steps // 2, None)).mean() / len(run.model.swarm)
        ),
    },
    "perimeter": {
        "mean distance from the centroid": lambda run: float(abs(run.outwards[0]).mean()),
        "share turned outwards": lambda run: float(np.mean(run.outwards[1] > 0)),
        "share at walls": lambda run: run.at_walls,
    },
    "puck_clustering": {"share of pucks carried": lambda run: float(np.mean(run.model.movers.carried))},
    "q_learning": {
        "collisions per robot and 1,000 steps, first 1,000": lambda run: float(
            run.collected("collisions", slice(0, 1_000)).sum() / len(run.model.swarm)
        ),
        "forward speed in the last 1,000 steps": lambda run: float(
            run.collected("forward_speed", slice(-1_000, None)).mean()
        ),
    },
    "task_allocation": {
        "share at work, second half": lambda run: run.work("active"),
        "minors at work, second half": lambda run: run.work("active_minors"),
        "majors at work, second half": lambda run: run.work("active_majors"),
        "stimulus, second half": lambda run: run.work("stimulus"),
        "stimulus at half time": lambda run: float(run.collected("stimulus")[run.model.steps // 2]),
    },
}


def _upper(run: Run) -> float:
    share = run.model.results()["share of the upper branch"]
    return math.nan if share is None else float(share)


def settings_of(name: str) -> dict[str, Mapping[str, Any]]:
    """Return what is measured of a model: its defaults, and its presets by their labels."""
    return {DEFAULTS: {}, **{one.label: one.settings for one in model_info(name).presets}}


def measured(name: str, settings: Mapping[str, Any], seed: int) -> dict[str, float]:
    """Return the measures of one run, rounded; not a number where an event did not happen."""
    model = find_model(name)(rng=seed, **settings)
    model.run(STEPS[name] - REST)
    before = model.swarm.position.copy()
    if model.running:
        model.run(REST)
    run = Run(model, before)
    found = {key: value for key, value in model.results().items() if key not in LEFT_OUT.get(name, ())}
    found |= {key: measure(run) for key, measure in MORE.get(name, {}).items()}
    return {key: math.nan if value is None else float(f"{value:.{DIGITS}g}") for key, value in found.items()}


def measure(name: str, seeds: Iterable[int] = SEEDS) -> dict[str, dict[str, list[float]]]:
    """Return the values of each measure, one a seed, by the settings."""
    found = {}
    for label, settings in settings_of(name).items():
        rows = [measured(name, settings, seed) for seed in seeds]
        found[label] = {key: [row[key] for row in rows] for key in rows[0]}
    return found


def stored() -> dict[str, dict[str, dict[str, list[float]]]]:
    """Return all stored values: by model, settings and measure."""
    return tomllib.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}


def store(values: Mapping[str, Mapping[str, Mapping[str, list[float]]]]) -> None:
    """Write all values."""
    lines = [f"# Written by measure_models.py: seeds {SEEDS[0]} to {SEEDS[-1]}, a value a seed, nan: did not happen."]
    for name in sorted(values):
        for label, rows in values[name].items():
            lines.append(f'\n[{name}."{label}"]')
            lines += [f'"{key}" = [{", ".join(f"{value:.{DIGITS}g}" for value in row)}]' for key, row in rows.items()]
    STORED.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main(names: Iterable[str]) -> None:
    """Measure these models, and store the values of each when it is done."""
    for name in names:
        values = measure(name)
        store({**stored(), name: values})
        print(name, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or gallery_names())
