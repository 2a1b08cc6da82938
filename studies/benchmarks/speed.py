"""What a step, a start and a robot cost, beside targets and peers, and the worlds that are measured."""

import math
import os
import tracemalloc
from collections.abc import Callable, Generator, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any, NamedTuple

import joblib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mesa_swarm import AGENT3, AGENT6, AGENT9, Map, RobotDesign, SwarmModel, compare, disc
from mesa_swarm.base.files import write_all
from mesa_swarm.control import Avoid, Explore, Gather, Subsumption
from mesa_swarm.experiments import csv_text, fitting
from mesa_swarm.gallery import find_model
from mesa_swarm.viewing import LIGHT, literal, plain_figure, png
from mesa_swarm_studies.benchmarks.bare_c import BareProgram
from mesa_swarm_studies.benchmarks.goals import (
    FULL,
    QUICK,
    Effort,
    Goal,
    Measurement,
    NotMeasuredError,
    goals_csv,
    mean_seconds,
    measured,
    printed_numbers,
    repeated,
    rounded_text,
    step_seconds,
)

AREA_PER_ROBOT = 40  # in robot bodies
ROBOTS_PER_OBSTACLE = 10
OBSTACLE_RADIUS = 5.0
# Without control robots drive in circles: straight on, all would end in heaps at the border.
CIRCLE = (1.0, 0.8)
PEER = AGENT9.with_proximity(range=16)
BY_SENSORS = {3: AGENT3, 6: AGENT6, 9: AGENT9}


def peer_workload(n: int, rng: int = 1) -> SwarmModel:
    """Return the world in which other simulators were timed.

    AGENT9 with range 16, Avoid and Explore, 40 robot bodies of area a robot, a small obstacle per 10 robots.
    """
    model = SwarmModel(map=peer_map(n, rng), rng=rng)
    model.add_robots(PEER, n)
    model.control = Subsumption(Avoid(distance=15), Explore())
    return model


def peer_map(n: int, rng: int = 1) -> Map:
    """Return the map of that world."""
    return _scattered(n, PEER.radius, rng)


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


def gathering(n: int, rng: int = 1) -> SwarmModel:
    """Return n robots that gather in crowds on an empty square, with 40 bodies of area a robot."""
    side = math.sqrt(AREA_PER_ROBOT * math.pi * n) * AGENT9.radius
    model = SwarmModel(map=Map(name=f"{n} gathering", bounds=(0, 0, side, side)), rng=rng, collect_every=0)
    model.add_robots(AGENT9, n)
    model.control = Subsumption(Gather(), Explore())
    return model


# ms a step: required, and measured of other simulators on a machine of the same kind.
TARGETS = {50: 0.03, 200: 0.07, 1000: 0.32, 5000: 1.4, 10_000: 2.8}
# Robot-steps of the bare C program that are timed at least.
FEWEST_ROBOT_STEPS = 200_000
# How many times as long as the bare C program a collected step of this number of robots may take.
BESIDE_C = {10: 8.0, 50: 4.0, 1000: 2.0, 10_000: 2.5, 100_000: 1.5}
PEERS = {
    "Enki (C++)": {50: 0.061, 200: 0.53},
    "ARGoS (C++)": {1000: 5.5, 5000: 47.0, 10_000: 121.0},
    "Mesa boids": {50: 1.9, 1000: 44.0},
    "ir-sim": {50: 12.0, 1000: 201.0},
}
# Steps before the measurement, until the number of meetings no longer grows; crowds take longer.
WARM_UP = 150
CROWDED = 300
FEW, MANY, MOST = 1000, 10_000, 1_000_000
# Of memory that is free before the largest world is made, for each of its robots.
BYTES_NEEDED = 3000
# Of a comparison of the two strategies of fire-fighting: 60 runs.
SEEDS_COMPARED = 30
# Seconds to place its robots, ms a step of `FEW` robots, and of all with one thread and two; GB of memory at most.
LARGEST = """
import sys
from pathlib import Path
from time import perf_counter
from mesa_swarm import SwarmModel
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm_studies.benchmarks.speed import FEW, PEER, paired_seconds, peer_map, peer_workload, step_seconds
n = int(sys.argv[1])
few = step_seconds(peer_workload(FEW).run(3).step, 5, 0.05)
model = SwarmModel(map=peer_map(n), rng=1)
start = perf_counter()
model.add_robots(PEER, n)
placed = perf_counter() - start
model.control = Subsumption(Avoid(distance=15), Explore())
model.run(3)
one, two, _ = paired_seconds(model, repetitions=5, budget=0.1)
status = Path("/proc/self/status")
lines = status.read_text(encoding="utf-8").splitlines() if status.exists() else ["VmHWM: nan kB"]
peak = next(float(line.split()[1]) for line in lines if line.startswith("VmHWM"))
print(placed, 1000 * few, 1000 * one, 1000 * two, peak / 1e6)
"""
FIRST_STEP = """
from os import times
from time import perf_counter
start = perf_counter()
import mesa_swarm
bare = perf_counter()
from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.control import Avoid, Explore, Subsumption
model = SwarmModel(rng=1)
model.add_robots(AGENT9, 10)
model.control = Subsumption(Avoid(), Explore())
model.step()
print(bare - start, perf_counter() - start, sum(times()[:4]))
"""
CUSTOM_RULE = """
from time import perf_counter
from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.control import PASS, Avoid, Explore, Subsumption, behaviour
model = SwarmModel(rng=1)
model.add_robots(AGENT9, 10)
model.control = Subsumption(Avoid(), Explore())
model.step()
start = perf_counter()
LIMIT = 10 + start % 1  # another rule each time: one that was compiled before could be found on disk

@behaviour
def timid(me):
    if 0 <= me.distance[me.front] < LIMIT:
        return -me.max_speed, -me.max_speed
    return PASS

model.control = Subsumption(timid(), Avoid(), Explore())
model.step()
print(perf_counter() - start)
"""
LISTING = """
import subprocess, sys
from time import perf_counter
start = perf_counter()
subprocess.run([sys.executable, "-m", "mesa_swarm", "list"], check=True, capture_output=True)
print(perf_counter() - start)
"""
LEARNERS = """
import sys
import numpy as np
from time import process_time
from mesa_swarm.environments import CollisionAvoidance, VectorSwarmEnv
robots, worlds = map(int, sys.argv[1:])
task, steps = CollisionAvoidance(n_robots=robots), max(24_000 // (robots * worlds), 5)
rng = np.random.default_rng(0)

def commands(worlds):
    return rng.uniform(-0.2, 1, (steps, worlds, robots, 2)).astype(np.float32)

def seconds(env, rows):
    start = process_time()
    for row in rows:
        env.step(row)
    return process_time() - start

few = VectorSwarmEnv(task, n_worlds=2)  # compiles
few.reset(seed=1)
seconds(few, commands(2))
env = VectorSwarmEnv(task, n_worlds=worlds)
start = process_time()
env.reset(seed=1)
reset = process_time() - start
rows = commands(worlds)
median = np.median([seconds(env, rows) for _ in range(6)][1:])
print(steps * worlds * robots / median, 1000 * reset / worlds)
"""
TRAINING = """
from time import process_time
from mesa_swarm_studies.benchmarks.contestants import contestants
train = contestants()["shared Q (b), cooled"]
train(1, 10)
start = process_time()
train(1, 33_000)
print(process_time() - start)
"""
OVERHEAD = """
from mesa_swarm_studies.benchmarks.overhead import print_overheads
if __name__ == "__main__":
    print_overheads()
"""


def paired_seconds(model: SwarmModel, repetitions: int, budget: float) -> tuple[float, float, float]:
    """Return the seconds of a step with one thread and with two, and how many times as fast two are: all medians.

    Both are measured in turn, so that what disturbs one disturbs the other, and the median is of the ratios of pairs.
    """
    count = max(int(budget / repetitions / 2 / max(step_seconds(model.step, 1, 0.0), 1e-7)), 1)
    pairs = np.array([[_with_threads(model, threads, count) for threads in (1, 2)] for _ in range(repetitions)])
    one, two = np.median(pairs, axis=0)
    return float(one), float(two), float(np.median(pairs[:, 0] / pairs[:, 1]))


def _with_threads(model: SwarmModel, threads: int, count: int) -> float:
    model.threads = threads
    model.step()
    return mean_seconds(lambda: model.run(count), 1) / count


def two_threads(n: int, effort: Effort) -> Sequence[float]:
    """Return ms a step with one thread and two, and how many times as fast two are."""
    if joblib.cpu_count() < 2:
        raise NotMeasuredError("this machine has one processor")
    one, two, faster = paired_seconds(peer_workload(n).run(WARM_UP), effort.repetitions, effort.budget)
    return 1000 * one, 1000 * two, faster


def largest_world(n: int) -> Sequence[float]:
    """Return seconds to place n robots, ms a step with two threads, the growth exponent of one, and GB of memory."""
    needed, free = BYTES_NEEDED * n, free_bytes()
    if free < needed:
        raise NotMeasuredError(f"{needed / 1e9:.1f} GB of free memory are needed, {free / 1e9:.1f} GB are free")
    placed, few, one, two, peak = printed_numbers(LARGEST, str(n))
    return placed, two if joblib.cpu_count() > 1 else math.nan, exponent({FEW: few, n: one}), peak


def free_bytes() -> float:
    """Return how much memory is free, infinity where the system does not show it."""
    shown = Path("/proc/meminfo")
    lines = shown.read_text(encoding="utf-8").splitlines() if shown.exists() else []
    return next((1024 * float(line.split()[1]) for line in lines if line.startswith("MemAvailable")), math.inf)


def uncompiled_start() -> Sequence[float]:
    """Return the seconds from import to first step where nothing is compiled, and those of processor time."""
    with TemporaryDirectory() as folder:
        return printed_numbers(FIRST_STEP, environment={"NUMBA_CACHE_DIR": folder})[1:]


def fire_fighting_step(effort: Effort) -> float:
    """Return the µs of processor time of a step of ten robots that fight fires, one of which they never put out."""
    model = find_model("fire_fighting")(n_robots=10, strategy="A", rng=1).run(WARM_UP)
    return 1e4 * step_seconds(lambda: model.run(100), effort.repetitions, effort.budget, process_time)


def comparison_seconds(seeds: int) -> Sequence[float]:
    """Return the seconds of processor time of `compare fire_fighting` in one process, and the µs of each step."""
    compare("fire_fighting", seeds=1, steps=WARM_UP, jobs=1)
    start = process_time()
    runs = compare("fire_fighting", seeds=seeds, jobs=1).runs
    seconds = process_time() - start
    return seconds, 1e6 * seconds / sum(run.steps for run in runs)


def recorded_step(n: int, effort: Effort) -> float:
    """Return how many times as long as a plain step one of n robots takes that is recorded: the median over rounds."""
    plain, recorded = (peer_workload(n).run(WARM_UP) for _ in range(2))
    steps = max(int(effort.budget / effort.repetitions / 2 / max(run_seconds(plain, 5), 1e-7)), 3)
    with TemporaryDirectory() as folder, recorded.record(Path(folder, "run.arrow")):
        pairs = [(run_seconds(recorded, steps), run_seconds(plain, steps)) for _ in range(effort.repetitions)]
    return float(np.median([longer / shorter for longer, shorter in pairs]))


def run_seconds(model: SwarmModel, steps: int) -> float:
    """Return the seconds of processor time of a step in a run."""
    return mean_seconds(lambda: model.run(steps), 1, process_time) / steps


def gathering_step(effort: Effort) -> float:
    """Return the ms of a step of ten thousand robots that have gathered for a while."""
    return 1000 * step_seconds(gathering(MANY).run(CROWDED).step, effort.repetitions, effort.budget)


MS, S, MICROSECONDS = "ms a step", "s", "µs a step"
CPU, ROBOT_STEPS = "s of processor time", "robot-steps a second of processor time"


def _faster(n: int) -> Goal:
    return Goal(what=f"{n:,} robots, two threads", unit="times as fast as one", limit=1.7, least=True)


MEASUREMENTS = (
    Measurement(goals=(_faster(5000),), measure=lambda effort: two_threads(5000, effort)[2:]),
    Measurement(goals=(_faster(MANY),), measure=lambda effort: two_threads(MANY, effort)[2:], quick=True),
    Measurement(
        goals=(
            Goal(what="100,000 robots, one thread", unit=MS, limit=35.0),
            Goal(what="100,000 robots, two threads", unit=MS, limit=20.0),
            _faster(100_000),
        ),
        measure=lambda effort: two_threads(100_000, effort),
    ),
    Measurement(
        goals=(
            Goal(what=f"placing {MOST:,} robots", unit=S, limit=2.0),
            Goal(what=f"{MOST:,} robots, two threads", unit=MS, limit=250.0),
            Goal(what=f"growth exponent from {FEW:,} to {MOST:,} robots", unit="one thread", limit=1.05),
            Goal(what=f"memory of a process with {MOST:,} robots", unit="GB", limit=1.5),
        ),
        measure=lambda effort: largest_world(MOST),
    ),
    Measurement(
        goals=(Goal(what=f"{MANY:,} gathering robots", unit=MS, limit=4.0),),
        measure=lambda effort: [gathering_step(effort)],
    ),
    Measurement(
        goals=(Goal(what="memory", unit="bytes a robot", limit=1000),),
        measure=lambda effort: [bytes_per_robot(2000 if effort is QUICK else MANY)],
        quick=True,
    ),
    Measurement(
        goals=(
            Goal(what="from import to first step, nothing compiled", unit=S, limit=6.0),
            Goal(what="a process that takes its first step, nothing compiled", unit=CPU),
        ),
        measure=lambda effort: uncompiled_start(),
    ),
    Measurement(
        goals=(
            Goal(what="import mesa_swarm", unit=S, limit=0.1),
            Goal(what="from import to first step, compiled before", unit=S, limit=0.7),
        ),
        measure=lambda effort: repeated(FIRST_STEP, effort.repetitions // 2)[:2],
        quick=True,
    ),
    Measurement(
        goals=(Goal(what="first step with a custom rule", unit=S, limit=0.4),),
        measure=lambda effort: repeated(CUSTOM_RULE, effort.repetitions // 2),
    ),
    Measurement(
        goals=(Goal(what="mesa-swarm list", unit=S, limit=0.5),),
        measure=lambda effort: repeated(LISTING, effort.repetitions // 2),
    ),
    Measurement(
        goals=(Goal(what="fire fighting, 10 robots, collected, processor time", unit=MICROSECONDS, limit=12.0),),
        measure=lambda effort: [fire_fighting_step(effort)],
        quick=True,
    ),
    Measurement(
        goals=(
            Goal(what="compare fire_fighting, 60 runs, one process", unit=CPU, limit=8.0),
            Goal(what="compare fire_fighting, one process, processor time", unit=MICROSECONDS, limit=15.0),
        ),
        measure=lambda effort: comparison_seconds(SEEDS_COMPARED),
    ),
    Measurement(
        goals=(
            Goal(what="16 learning worlds of 15 robots", unit=ROBOT_STEPS, limit=1_000_000, least=True),
            Goal(what="a new episode of 15 robots", unit="ms of processor time"),
        ),
        measure=lambda effort: printed_numbers(LEARNERS, "15", "16"),
        quick=True,
    ),
    Measurement(
        goals=(
            Goal(what="4,096 learning worlds of one robot", unit=ROBOT_STEPS),
            Goal(what="a new episode of one robot", unit="ms of processor time"),
        ),
        measure=lambda effort: printed_numbers(LEARNERS, "1", "4096"),
    ),
    Measurement(
        goals=(Goal(what="training of shared Q-networks, 990,000 robot-steps", unit=CPU),),
        measure=lambda effort: printed_numbers(TRAINING),
    ),
    Measurement(
        goals=(Goal(what="50 robots, a recorded step beside a plain one", unit="times as long"),),
        measure=lambda effort: [recorded_step(50, effort)],
        quick=True,
    ),
    Measurement(
        goals=(
            Goal(what="overhead of a run, two processes", unit="ms", limit=2.0),
            Goal(what="overhead of a run, dask, two workers", unit="ms", limit=10.0),
        ),
        measure=lambda effort: printed_numbers(OVERHEAD),
    ),
)
# In the thesis's order: dense, sparse, open.
MAPS = ("original", "sparse", "openspace")


def report(folder: Path, quick: bool = False, width: int | None = None) -> Iterator[str]:
    """Yield the report line by line as it is measured, and write its tables and its picture.

    They are `step.csv`, `bare_c.csv`, `goals.csv` and `complexity.png`. A quick report takes a few seconds, is rougher,
    and leaves out what takes longer. Printed tables are at most `width` columns wide.
    """
    effort = QUICK if quick else FULL
    yield from _surroundings()
    seconds = {n: _one_thread(n, effort) for n in TARGETS}
    yield from ("", *step_table(seconds, width), "")
    growth = Goal(what=f"growth exponent from {FEW:,} to {MANY:,} robots", unit="one thread", limit=1.05)
    rows: list[tuple[Goal, float]] = [(growth, exponent({n: seconds[n] for n in (FEW, MANY)}))]
    yield growth.verdict(rows[0][1])
    beside = yield from _beside_c([n for n in BESIDE_C if n <= FEW or not quick], effort, width)
    rows += [(_beside_c_goal(n), steps.collected_ratio) for n, steps in beside.items()]
    for measurement in MEASUREMENTS:
        if measurement.quick or not quick:
            values = yield from measured(measurement, effort)
            rows += zip(measurement.goals, values, strict=True)
    curves = complexity(3 if quick else 7, 0.01 if quick else 0.15)
    files: dict[str, str | bytes] = {
        "step.csv": step_csv(seconds),
        "bare_c.csv": bare_c_csv(beside),
        "goals.csv": goals_csv(rows),
        "complexity.png": png(complexity_figure(curves)),
    }
    yield from ("", *map(str, write_all(folder, files)))


def _one_thread(n: int, effort: Effort) -> float:
    model = peer_workload(n)
    model.threads = 1
    return step_seconds(model.run(WARM_UP).step, effort.repetitions, effort.budget)


class StepBesideC(NamedTuple):
    """Seconds of processor time of a step: of a bare C program, and of `SwarmModel.run`, collected in each step or not.

    Each is a median. The ratios are medians of how many times as long as that of the program a step took.
    """

    bare: float
    plain: float
    collected: float
    plain_ratio: float
    collected_ratio: float


NO_STEP = StepBesideC(*[math.nan] * 5)


def step_beside_c(program: BareProgram, n: int, effort: Effort) -> StepBesideC:
    """Return what a step of the peers' workload with n robots takes beside the program.

    All three are measured in turn, from the state that the model is in then: what disturbs one disturbs the others.
    """
    model = peer_workload(n)
    model.threads = 1
    seconds = max(run_seconds(model.run(WARM_UP), 5), 1e-7)
    steps = max(int(effort.budget / effort.repetitions / 3 / seconds), 3)
    rounds = np.array([_seconds_in_turn(program, model, steps) for _ in range(effort.repetitions)])
    return StepBesideC(*np.median(rounds, axis=0), *np.median(rounds[:, 1:] / rounds[:, :1], axis=0))


def _seconds_in_turn(program: BareProgram, model: SwarmModel, steps: int) -> list[float]:
    """Return the seconds of a step of the program, and of runs that collect nothing and that collect in each step."""
    # The program is fast: in the same few steps, its start would count.
    longer = max(steps, FEWEST_ROBOT_STEPS // len(model.swarm))
    seconds = [program.time_steps(model, longer, untimed=longer)]
    for collect_every in (0, 1):
        model.collect_every = collect_every
        seconds.append(run_seconds(model, steps))
    return seconds


def _beside_c(counts: Sequence[int], effort: Effort, width: int | None) -> Generator[str, None, dict[int, StepBesideC]]:
    """Yield the table of steps beside a bare C program, or why there is none, and return them by number of robots."""
    what = "a step beside a bare C program of the same work"
    try:
        with TemporaryDirectory() as folder:
            program = BareProgram.compile_into(Path(folder))
            steps = {n: step_beside_c(program, n, effort) for n in counts}
    except NotMeasuredError as error:
        yield f"{what}: not measured, {error}"
        return dict.fromkeys(counts, NO_STEP)
    yield from ("", f"A{what[1:]}: µs of processor time, medians.", *bare_c_table(steps, width), "")
    return steps


def _beside_c_goal(n: int) -> Goal:
    what = f"{n:,} robots, a collected step beside a bare C program"
    return Goal(what=what, unit="times as long", limit=BESIDE_C[n])


def bare_c_table(steps: dict[int, StepBesideC], width: int | None = None) -> list[str]:
    """Return the table of steps beside a bare C program, by number of robots, of at most this width."""
    header = ["robots", "C", "not collected", "times C", "collected", "times C", "required", "passed"]
    return fitting([header, *(_beside_c_cells(n, step) for n, step in steps.items())], width)


def _beside_c_cells(n: int, step: StepBesideC) -> list[str]:
    numbers = step.bare * 1e6, step.plain * 1e6, step.plain_ratio, step.collected * 1e6, step.collected_ratio
    passed = "yes" if _beside_c_goal(n).passed(step.collected_ratio) else "no"
    return [f"{n:,}", *map(rounded_text, numbers), rounded_text(BESIDE_C[n]), passed]


def bare_c_csv(steps: dict[int, StepBesideC]) -> str:
    """Return the same table for other programs, without numbers where nothing was measured."""
    header = ["robots", "bare_us", "plain_us", "collected_us", "plain_ratio", "collected_ratio", "required"]
    rows = [[n, *(1e6 * t for t in step[:3]), *step[3:], BESIDE_C[n]] for n, step in steps.items()]
    return csv_text([header, *([None if math.isnan(cell) else cell for cell in row] for row in rows)])


def _surroundings() -> Iterator[str]:
    """Yield what is measured, and whether other programs disturb it."""
    yield "The peers' workload: AGENT9, range 16, Avoid and Explore, 40 bodies of area a robot; medians."
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 0.0
    if load > 0.5:
        yield f"Other programs are busy here (load {load:.1f} on {os.cpu_count()} cores): steps may take longer."


def step_table(seconds: dict[int, float], width: int | None = None) -> list[str]:
    """Return the table of milliseconds a step, of at most this width."""
    header = ["robots", "ms a step", "required", "passed", "steps/s", *PEERS]
    rows = [
        [f"{n:,}", *_beside_target(n, t), *(rounded_text(peer.get(n)) for peer in PEERS.values())]
        for n, t in seconds.items()
    ]
    return fitting([header, *rows], width)


def _beside_target(n: int, t: float) -> list[str]:
    passed = "yes" if 1000 * t <= TARGETS[n] else "no"
    return [rounded_text(1000 * t), rounded_text(TARGETS[n]), passed, f"{1 / t:,.0f}"]


def step_csv(seconds: dict[int, float]) -> str:
    """Return the same table for other programs."""
    header = ["robots", "ms_per_step", "target_ms", *PEERS]
    rows = [[n, 1000 * t, TARGETS[n], *(peer.get(n) for peer in PEERS.values())] for n, t in seconds.items()]
    return csv_text([header, *rows])


def exponent(seconds: dict[int, float]) -> float:
    """Return the b of t = a n^b between the first and the last number of robots.

    Examples
    --------
    >>> exponent({10: 1.0, 1000: 100.0})
    1.0
    """
    few, *_, many = seconds
    return math.log(seconds[many] / seconds[few]) / math.log(many / few)


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
    figure, (panels,) = plain_figure((4.2 * len(curves), 3.8), 1, len(curves), grid=True)
    for axes, (title, lines) in zip(panels, curves.items(), strict=True):
        _draw_curves(axes, title, lines)
    return figure


def _draw_curves(axes: Axes, title: str, lines: dict[str, dict[int, float]]) -> None:
    for i, (label, points) in enumerate(lines.items()):
        milliseconds = [1000 * t for t in points.values()]
        style = "os^"[i % 3] + "-"
        axes.plot(list(points), milliseconds, style, color=LIGHT.series[i], markersize=4, label=literal(label))
    if max(max(points) for points in lines.values()) > 100:
        axes.set(xscale="log", yscale="log")
    else:
        axes.set_ylim(bottom=0)
    axes.set(title=literal(title), xlabel="robots", ylabel="ms a step")
    axes.legend(fontsize=9, frameon=False)
