"""Work on a dask cluster: chunks, absent workers, lost schedulers, and tasks that kill their workers."""

import os
import signal
import subprocess
import sys
from contextlib import ExitStack, contextmanager, suppress
from importlib.util import find_spec
from queue import Empty

import pandas as pd
import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.cli import main
from mesa_swarm.experiments.sweep import sweep
from mesa_swarm.experiments.worker_tasks import SchedulerLostError
from support.killing import COMMAND, environment, lines_in
from support.waiting import wait_until

pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="needs the extra [cluster]")
# Runs that take long enough to be interrupted between two of them.
JOB = """
model = "collision_avoidance"
steps = 15000
seeds = 10
grid = { n_robots = [50, 60] }
"""


class Scheduler:
    """One that has these numbers of workers whenever it is asked, one after the other."""

    address = "tcp://there:8786"

    def __init__(self, *workers):
        self.workers = list(workers)

    def ncores(self):
        return {f"tcp://there:{k}": 2 for k in range(self.workers.pop(0))}


class Connection:
    """A client of such a scheduler."""

    def __init__(self, *workers):
        self.scheduler = Scheduler(*workers)

    def sync(self, function, callback_timeout):
        return function()


def lines_about(monkeypatch, capsys, times, workers):
    """Count workers at these times, and return the threads and the lines that were printed each time."""
    from mesa_swarm.experiments import dask_pool  # noqa: PLC0415 - needs the extra

    found, crew = [], dask_pool.Crew(Connection(*workers))
    for now in times:
        monkeypatch.setattr(dask_pool, "monotonic", lambda now=now: now)
        crew.count()
        found.append((crew.threads, capsys.readouterr().err.count("\n")))
    return found


def test_the_absence_of_workers_is_reported_in_one_line_which_is_repeated_rarely(monkeypatch, capsys):
    found = lines_about(monkeypatch, capsys, [100.0, 101.0, 103.0, 400.0, 701.0], [0, 0, 0, 0])
    assert found == [(0, 1), (0, 0), (0, 0), (0, 0), (0, 1)]


def test_workers_that_are_back_are_reported_once_and_their_next_absence_at_once(monkeypatch, capsys):
    found = lines_about(monkeypatch, capsys, [100.0, 103.0, 106.0, 109.0], [0, 3, 3, 0])
    assert found == [(0, 1), (6, 1), (6, 0), (0, 1)]


def test_nothing_is_reported_while_there_are_workers(monkeypatch, capsys):
    assert lines_about(monkeypatch, capsys, [100.0, 103.0], [1, 2]) == [(2, 0), (4, 0)]


def test_the_line_names_the_command_that_starts_a_worker(capsys):
    from mesa_swarm.experiments.dask_pool import Crew  # noqa: PLC0415 - needs the extra

    Crew(Connection(0)).count()
    assert "; start one with: dask worker tcp://there:8786 --nthreads 1\n" in capsys.readouterr().err


def test_chunks_grow_to_a_fifth_of_a_second_and_shrink_at_once():
    from mesa_swarm.experiments.dask_pool import LARGEST_CHUNK, Chunks  # noqa: PLC0415 - needs the extra

    chunks, sizes = Chunks(Connection(), pow), []
    for seconds_each in (0.02, 0.02, 0.02, 0.02, 0.02, 5.0, 1e-9):
        chunks._adapt(chunks._size, seconds_each * chunks._size)
        sizes.append(chunks._size)
    assert sizes == [2, 4, 8, 10, 10, 1, 2]
    for _ in range(20):
        chunks._adapt(chunks._size, 0.0)
    assert chunks._size == LARGEST_CHUNK


def test_a_connection_that_is_closed_already_is_reported_before_anything_is_handed_out():
    from mesa_swarm.experiments.dask_pool import on_cluster  # noqa: PLC0415 - needs the extra

    closed = Connection()
    closed.status = "closed"
    with pytest.raises(SchedulerLostError, match="the connection to the dask scheduler at tcp://there:8786 is lost"):
        list(on_cluster(closed, pow, [(2, 3)]))


class Done:
    """What a cluster would return of a task: its result, or an error."""

    status = "error"

    def __init__(self, outcome):
        self.key, self.outcome = object(), outcome

    def add_done_callback(self, heard):
        heard(self)

    def result(self, timeout):
        if isinstance(self.outcome, BaseException):
            raise self.outcome
        return self.outcome

    def cancelled(self):
        return False

    def release(self):
        pass


class Cluster(Connection):
    """A client of a cluster that ends each task with the next of these outcomes."""

    status = "running"

    def __init__(self, *outcomes):
        super().__init__(*[1] * 10)
        self.outcomes = list(outcomes)

    def submit(self, work, content, pure):
        outcome = self.outcomes.pop(0)
        if isinstance(outcome, type):
            raise outcome("closed")
        return Done(outcome)


def of_the_graph(cause):
    error = RuntimeError("Error during deserialization of the task graph")
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("outcome", "error", "words"),
    [
        (Empty("mine"), Empty, "mine"),
        (TimeoutError("mine"), TimeoutError, "mine"),
        (RuntimeError("mine"), RuntimeError, "mine"),
        (
            of_the_graph(ModuleNotFoundError("No module named 'ants'")),
            SwarmError,
            "or a worker cannot import",
        ),
    ],
    ids=["an empty queue", "a time-out", "an error of its own", "a package that the scheduler lacks"],
)
def test_an_error_of_a_task_ends_the_call(outcome, error, words):
    from mesa_swarm.experiments.dask_pool import on_cluster  # noqa: PLC0415 - needs the extra

    with pytest.raises(error, match=words):
        list(on_cluster(Cluster(outcome), pow, [(2, 3)]))


def test_a_client_that_closes_while_tasks_are_handed_out_is_reported_as_a_lost_scheduler():
    from distributed.client import ClosedClientError  # noqa: PLC0415 - needs the extra

    from mesa_swarm.experiments.dask_pool import on_cluster  # noqa: PLC0415 - needs the extra

    with pytest.raises(SchedulerLostError):
        list(on_cluster(Cluster(ClosedClientError), pow, [(2, 3)]))


def test_a_chunk_ends_with_the_run_that_takes_it_too_long_and_the_rest_is_handed_out_again(monkeypatch):
    from mesa_swarm.experiments import dask_pool  # noqa: PLC0415 - needs the extra

    clock = iter(range(1000))
    monkeypatch.setattr(dask_pool, "perf_counter", lambda: next(clock) * dask_pool.CHUNK_SECONDS * 0.9)
    content = dask_pool.dumps(([], pow, [(2, k) for k in range(10)]))
    results, _ = dask_pool._results_and_seconds(content)
    assert results == [1, 2, 4]

    class Working(Cluster):
        def submit(self, work, content, pure):
            return Done(work(content))

    tasks = [(2, k) for k in range(30)]
    assert sorted(dask_pool.on_cluster(Working(), pow, tasks)) == [2**k for k in range(30)]


@pytest.mark.parametrize(
    "address", ["nonsense", "", "tcp://", "tcp://there", "there:port", "foo://there:1", "tls://there:1"]
)
def test_what_is_no_address_is_refused_in_one_line(tmp_path, address, capsys):
    (tmp_path / "job.toml").write_text(JOB)
    with pytest.raises(SystemExit) as end:
        main(["sweep", str(tmp_path / "job.toml"), "--out", str(tmp_path / "out"), "--scheduler", address])
    (line,) = capsys.readouterr().err.splitlines()
    assert end.value.code == 2
    assert "no dask scheduler answers at" in line


def test_processes_of_this_machine_are_not_counted_for_a_scheduler(tmp_path, capsys):
    (tmp_path / "job.toml").write_text(JOB)
    with pytest.raises(SystemExit):
        main(["sweep", str(tmp_path / "job.toml"), "--jobs", "2", "--scheduler", "tcp://there:1"])
    assert "leave it out with --scheduler" in capsys.readouterr().err


@contextmanager
def started(*words, **streams):
    """A process that is killed at the end."""
    process = subprocess.Popen(list(map(str, words)), env=environment(), **streams)
    try:
        yield process
    finally:
        with suppress(OSError):
            process.kill()
        process.wait()


def dask(log, *words):
    return started(sys.executable, "-m", "dask", *words, stdout=subprocess.DEVNULL, stderr=log)


@contextmanager
def scheduler(folder):
    """A scheduler, and its address."""
    file = folder / "scheduler"
    with (
        file.open("w") as log,
        dask(log, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard") as process,
    ):
        wait_until(lambda: "Scheduler at:" in file.read_text(), every=0.1)
        line = next(line for line in file.read_text().splitlines() if "Scheduler at:" in line)
        yield process, line.split()[-1]


def worker(address):
    return dask(subprocess.DEVNULL, "worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard")


@pytest.mark.slow
def test_after_kills_of_all_workers_and_of_the_scheduler_the_same_call_makes_the_table_of_one_machine(tmp_path):
    (tmp_path / "job.toml").write_text(JOB)
    out, errors = tmp_path / "out", tmp_path / "errors"
    ledger = out / "ledger.jsonl"
    command = [sys.executable, "-c", COMMAND, "sweep", tmp_path / "job.toml", "--quiet", "--out", out, "--scheduler"]
    with ExitStack() as stack:
        master, address = stack.enter_context(scheduler(tmp_path))
        complaints = stack.enter_context(errors.open("w"))
        driver = stack.enter_context(started(*command, address, stderr=complaints, stdout=subprocess.DEVNULL))
        wait_until(lambda: errors.read_text().count("no worker is connected") == 1, every=0.1)
        first = stack.enter_context(worker(address))
        wait_until(lambda: lines_in(ledger) >= 2, every=0.05)
        first.kill()
        wait_until(lambda: errors.read_text().count("no worker is connected") == 2, every=0.1)
        stack.enter_context(worker(address))
        done = lines_in(ledger)
        wait_until(lambda: lines_in(ledger) >= done + 2, every=0.05)
        # Workers are counted every other second: a report may come after the results of the worker.
        wait_until(lambda: errors.read_text().count("the work continues") == 2, every=0.05)
        assert lines_in(ledger) < 20, "the scheduler is killed while it has work"
        master.kill()
        assert driver.wait(120) == 2
        done = lines_in(ledger)
        assert 4 <= done < 20, "it was killed in the midst of the sweep"
        last = errors.read_text().splitlines()[-1]
        assert "lost; finished runs are stored in" in last
        assert last.endswith("call it again for the rest")
    with scheduler(tmp_path) as (_, address), worker(address):
        again = subprocess.run([*command, address], env=environment(), capture_output=True, text=True, check=True)
    assert f"20 runs, {done} of them before" in again.stdout
    assert lines_in(ledger) == 20, "no run was done twice"
    whole = sweep("collision_avoidance", {"n_robots": [50, 60]}, seeds=10, steps=15_000, out=tmp_path / "one", jobs=1)
    assert (out / "runs.parquet").read_bytes() == whole.path.read_bytes()


FATAL = """
import os
from mesa_swarm_studies.benchmarks.overhead import ShortRun

class Fatal(ShortRun):
    def __init__(self, *, series=0, rng=None):
        if rng == 3 and os.environ.get("FATAL"):
            os._exit(1)
        super().__init__(series=series, rng=rng)
"""
WORKERS = "while true; do {python} -m dask worker {address} --nthreads 1 --no-nanny --no-dashboard; done"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="workers are started by a shell")
def test_a_run_that_kills_its_workers_is_recorded_as_failed_and_all_others_are_done(tmp_path, monkeypatch):
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "0")  # else it takes twelve workers
    monkeypatch.setenv("FATAL", "yes")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fatal.py").write_text(FATAL)
    (tmp_path / "job.toml").write_text('model = "./fatal.py:Fatal"\nsteps = 1\nseeds = 5\n')
    with scheduler(tmp_path) as (_, address):
        loop = WORKERS.format(python=sys.executable, address=address)
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "start_new_session": True}
        with started("sh", "-c", loop, **quiet) as workers:
            words = [sys.executable, "-c", COMMAND, "sweep", "job.toml", "--out", "out", "--scheduler", address]
            done = subprocess.run(words, env=environment(), capture_output=True, text=True, timeout=400, check=False)
            os.killpg(workers.pid, signal.SIGKILL)
    assert done.stdout.splitlines() == ["out/runs.parquet: 5 runs, 1 ended in an error"], done.stderr
    failed = pd.read_parquet("out/runs.parquet").set_index("rng")["error"].dropna()
    assert failed.to_dict() == {3: "WorkerDiedError: the process died in each of 3 tries"}
