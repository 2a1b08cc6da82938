"""What a run of a sweep costs besides the run itself, on processes of this machine and on a dask cluster.

`python -m mesa_swarm_studies.benchmarks.overhead` measures both.
"""

import logging
import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from joblib import parallel_config

from mesa_swarm import SwarmModel, sweep

WORKERS = 2
RUNS = 2000
# Runs before the measurement, in which workers start and import.
FIRST_RUNS = 40


class ShortRun(SwarmModel):
    """A world without robots, whose result is how long it took, s, from its first line to its last."""

    def __init__(self, *, series: int = 0, rng: int | None = None) -> None:
        self._begin = perf_counter()
        super().__init__(rng=rng, collect_every=0)
        self.series = series

    def results(self) -> dict[str, float]:
        """Return the time that the run took so far."""
        return {"seconds": perf_counter() - self._begin}


def overhead_per_run(runs: int, workers: int, repetitions: int = 3) -> tuple[float, float]:
    """Return the overhead of a run in ms, the least of several sweeps, and the seconds in which workers start.

    That of N runs on W workers which take T in all is (W T - sum of the runs' own times) / N: what each takes of a
    worker's time besides the run itself. T has everything from reading the points to writing the table.

    Parameters
    ----------
    runs, workers : int
    repetitions : int
        Of the sweep: what else this machine does can only add to the overhead.
    """
    start, _ = _seconds_and_own(-1, FIRST_RUNS, workers)
    measured = (_seconds_and_own(series, runs, workers) for series in range(repetitions))
    return min(1000 * (workers * seconds - own) / runs for seconds, own in measured), start


def _seconds_and_own(series: int, runs: int, workers: int) -> tuple[float, float]:
    """Return the seconds that a sweep of short runs took, and the sum of their own."""
    with TemporaryDirectory() as folder:
        begin = perf_counter()
        made = sweep(ShortRun, {"series": [series]}, seeds=runs, steps=1, out=Path(folder), jobs=workers)
        seconds = perf_counter() - begin
        return seconds, float(made.frame()["seconds"].sum())


@contextmanager
def local_cluster(workers: int) -> Iterator[None]:
    """Let joblib use a dask cluster of this many processes of this machine."""
    from distributed import Client, LocalCluster  # noqa: PLC0415 - comes with the extra

    how = {"threads_per_worker": 1, "dashboard_address": None, "silence_logs": logging.CRITICAL}
    with ExitStack() as stack:
        cluster = stack.enter_context(LocalCluster(n_workers=workers, **how))
        client = stack.enter_context(Client(cluster, set_as_default=False))
        stack.enter_context(parallel_config(backend="dask", client=client))
        yield


def print_overheads() -> None:
    """Print the overhead of a run, ms, with joblib and with dask (nan if that is not installed)."""
    on_dask = math.nan
    with_joblib, _ = overhead_per_run(RUNS, WORKERS)
    if find_spec("distributed") is not None:
        with local_cluster(WORKERS):
            on_dask, _ = overhead_per_run(RUNS, WORKERS)
    print(f"{with_joblib:.2f} {on_dask:.2f}")


if __name__ == "__main__":
    print_overheads()
