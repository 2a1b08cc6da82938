"""The cost of a step, beside targets and peers, and the worlds that are timed."""

import math
import os
import subprocess
import sys
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.experiments.figures import COLOURS
from mesa_swarm.experiments.tables import aligned, csv_text
from mesa_swarm.files import write_all
from mesa_swarm.robots.design import AGENT3, AGENT6, AGENT9, RobotDesign
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.pictures import literal, png
from mesa_swarm.world.map import Map
from mesa_swarm.world.shapes import disc

AREA_PER_ROBOT = 40  # in robot bodies
ROBOTS_PER_OBSTACLE = 10
OBSTACLE_RADIUS = 5.0
# Without control robots drive in circles: straight on, all would end in heaps at the border.
CIRCLE = (1.0, 0.8)
BY_SENSORS = {3: AGENT3, 6: AGENT6, 9: AGENT9}


def peer_workload(n: int, rng: int = 1) -> SwarmModel:
    """Return the world in which other simulators were timed.

    AGENT9 with range 16, Avoid and Explore, 40 robot bodies of area a robot, a small obstacle per 10 robots.
    """
    design = AGENT9.with_proximity(range=16)
    model = SwarmModel(map=_scattered(n, design.radius, rng), rng=rng)
    model.add_robots(design, n)
    model.control = Subsumption(Avoid(distance=15), Explore())
    return model


def _scattered(n: int, radius: float, rng: int) -> Map:
    """Return a square map with obstacles in the cells of a grid, drawn so that none overlap."""
    side = math.sqrt(AREA_PER_ROBOT * math.pi * n) * radius
    obstacles = max(n // ROBOTS_PER_OBSTACLE, 1)
    cells = math.ceil(math.sqrt(obstacles))
    random = np.random.default_rng(rng)
    chosen = random.permutation(cells * cells)[:obstacles]
    room = side / cells - 2 * OBSTACLE_RADIUS
    corners = np.column_stack(np.divmod(chosen, cells)) * (side / cells)
    centres = corners + OBSTACLE_RADIUS + random.random((obstacles, 2)) * room
    return Map(
        name=f"{n} robots", bounds=(0, 0, side, side), obstacles=tuple(disc(c, OBSTACLE_RADIUS) for c in centres)
    )


def contact_alone(n: int, rng: int = 1) -> SwarmModel:
    """Return a world of robots without sensors and control that drive in circles."""
    model = SwarmModel(map=_scattered(n, 5.0, rng), rng=rng)
    model.add_robots(RobotDesign(name="blind", radius=5.0, max_speed=1.0), n)
    model.swarm.columns["command"][:] = CIRCLE
    return model


def on_map(n: int, name: str = "original", sensors: int = 9, rng: int = 1) -> SwarmModel:
    """Return n robots that avoid and explore on a map of the thesis."""
    model = SwarmModel(map=name, rng=rng)
    model.add_robots(BY_SENSORS[sensors], n)
    model.control = Subsumption(Avoid(distance=15), Explore())
    return model


def step_seconds(step: Callable[[], None], repetitions: int, budget: float) -> float:
    """Return the seconds of one step: the median over repetitions, each of as many steps as its budget allows.

    `budget` is in seconds, about, for all of them together.
    """
    for _ in range(5):
        step()
    started = perf_counter()
    step()
    count = max(int(budget / repetitions / max(perf_counter() - started, 1e-7)), 1)
    return float(np.median([mean_seconds(step, count) for _ in range(repetitions)]))


def mean_seconds(step: Callable[[], object], count: int, clock: Callable[[], float] = perf_counter) -> float:
    """Return the mean seconds of a step over this number of steps."""
    started = clock()
    for _ in range(count):
        step()
    return (clock() - started) / count


# ms a step: required, and measured of other simulators on a machine of the same kind.
TARGETS = {50: 0.06, 200: 0.15, 1000: 0.5, 5000: 2.5, 10_000: 5.0}
PEERS = {
    "Enki (C++)": {50: 0.061, 200: 0.53},
    "ARGoS (C++)": {1000: 5.5, 5000: 47.0, 10_000: 121.0},
    "Mesa boids": {50: 1.9, 1000: 44.0},
    "ir-sim": {50: 12.0, 1000: 201.0},
}
# Steps before the measurement, until the number of meetings no longer grows.
WARM_UP = 100
MOST_BYTES = 1000
STEEPEST = 1.05
FEW, MANY = 200, 10_000
# In the thesis's order: dense, sparse, open.
MAPS = ("original", "sparse", "openspace")
FIRST_STEP = """
from time import perf_counter
start = perf_counter()
import mesa_swarm
bare = perf_counter()
from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.control import Avoid, Explore, Subsumption
imported = perf_counter()
model = SwarmModel(rng=1)
model.add_robots(AGENT9, 10)
model.control = Subsumption(Avoid(), Explore())
model.step()
print(bare - start, imported - start, perf_counter() - imported)
"""


def report(folder: Path, quick: bool = False) -> Iterator[str]:
    """Yield the report line by line as it is measured, and write `step.csv` and `complexity.png`.

    A quick report takes a few seconds, and is rougher.
    """
    repetitions, budget = (3, 0.1) if quick else (9, 3.0)
    yield from _surroundings()
    seconds = {n: step_seconds(peer_workload(n).run(WARM_UP).step, repetitions, budget) for n in TARGETS}
    yield from ("", *step_table(seconds), "")
    yield verdict("growth exponent from 200 to 10,000 robots", exponent(seconds), STEEPEST)
    many = 2000 if quick else MANY
    yield verdict(f"memory in bytes a robot ({many:,} robots, after a step)", bytes_per_robot(many), MOST_BYTES)
    bare, imported, first = start_times()
    yield verdict("import mesa_swarm, s", bare, 1.0)
    yield f"import SwarmModel and control as well, s: {imported:.3g}"
    yield verdict("first model and step of a new process, compiled before, s", first, 2.0)
    curves = complexity(3 if quick else 7, 0.01 if quick else 0.15)
    files: dict[str, str | bytes] = {"step.csv": step_csv(seconds), "complexity.png": png(complexity_figure(curves))}
    yield from ("", *map(str, write_all(folder, files)))


def _surroundings() -> Iterator[str]:
    """Yield what is measured, and whether other programs disturb it."""
    yield "The peers' workload: AGENT9, range 16, Avoid and Explore, 40 bodies of area a robot; medians."
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    if load > 0.5:
        yield f"Other programs are busy here (load {load:.1f} on {os.cpu_count()} cores): steps may take longer."


def step_table(seconds: dict[int, float]) -> list[str]:
    """Return the table of milliseconds a step."""
    header = ["robots", "ms a step", "required", "passed", "steps/s", *PEERS]
    rows = [
        [f"{n:,}", *_measured(n, t), *(_number(peer.get(n)) for peer in PEERS.values())] for n, t in seconds.items()
    ]
    return aligned([header, *rows])


def _measured(n: int, t: float) -> list[str]:
    passed = "yes" if 1000 * t <= TARGETS[n] else "no"
    return [_number(1000 * t), _number(TARGETS[n]), passed, f"{1 / t:,.0f}"]


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


def step_csv(seconds: dict[int, float]) -> str:
    """Return the same table for other programs."""
    header = ["robots", "ms_per_step", "target_ms", *PEERS]
    rows = [[n, 1000 * t, TARGETS[n], *(peer.get(n) for peer in PEERS.values())] for n, t in seconds.items()]
    return csv_text([header, *rows])


def verdict(what: str, value: float, most: float) -> str:
    """Return one line: what was measured, what is required, and whether it is passed."""
    shown = f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
    return f"{what}: {shown} (required: at most {most:g}, {'passed' if value <= most else 'FAILED'})"


def exponent(seconds: dict[int, float]) -> float:
    """Return the b of t = a n^b between 200 and 10,000 robots."""
    return math.log(seconds[MANY] / seconds[FEW]) / math.log(MANY / FEW)


def bytes_per_robot(n: int) -> float:
    """Return the memory of a robot: that of a world of n after a step minus one of 10, over n - 10."""
    peer_workload(10).step()
    return (_traced_bytes(n) - _traced_bytes(10)) / (n - 10)


def _traced_bytes(n: int) -> int:
    tracemalloc.start()
    model = peer_workload(n)
    model.step()
    size, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return size


def start_times() -> list[float]:
    """Return the seconds of the bare import, of all imports, and of the first model and step, in a new process."""
    command = [sys.executable, "-c", FIRST_STEP]
    subprocess.run(command, check=True, capture_output=True)  # fills the cache
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return [float(word) for word in done.stdout.split()]


def complexity(repetitions: int, budget: float) -> dict[str, dict[str, dict[int, float]]]:
    """Return seconds a step by panel, curve and number of robots: the thesis's complexity curves.

    `budget` is in seconds for each point, about.
    """
    few, many = (1, 5, 10, 20, 30, 40, 50), (10, 30, 100, 300, 1000, 3000)

    def timed(counts: Sequence[int], world: Callable[..., SwarmModel], *details: Any) -> dict[int, float]:
        return {n: step_seconds(world(n, *details).step, repetitions, budget) for n in counts}

    return {
        "contact alone": {"no sensors, no control": timed(many, contact_alone)},
        "whole step on three maps": {name: timed(few, on_map, name) for name in MAPS},
        "whole step, map original": {f"{s} sensors": timed(few, on_map, "original", s) for s in (3, 6, 9)},
    }


def complexity_figure(curves: dict[str, dict[str, dict[int, float]]]) -> Figure:
    """Return a figure with a panel for each set of curves."""
    figure = Figure(figsize=(4.2 * len(curves), 3.8), layout="constrained")
    panels = figure.subplots(1, len(curves), squeeze=False).ravel()
    for axes, (title, lines) in zip(panels, curves.items(), strict=True):
        _draw_curves(axes, title, lines)
    return figure


def _draw_curves(axes: Axes, title: str, lines: dict[str, dict[int, float]]) -> None:
    for i, (label, points) in enumerate(lines.items()):
        milliseconds = [1000 * t for t in points.values()]
        axes.plot(list(points), milliseconds, "os^"[i % 3] + "-", color=COLOURS[i], markersize=4, label=literal(label))
    if max(max(points) for points in lines.values()) > 100:
        axes.set(xscale="log", yscale="log")
    else:
        axes.set_ylim(bottom=0)
    axes.set(title=literal(title), xlabel="robots", ylabel="ms a step")
    axes.legend(fontsize=9, frameon=False)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
