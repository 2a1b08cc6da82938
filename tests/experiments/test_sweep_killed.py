"""Workers, drivers and a cluster's process are killed; no run is lost, and the table is the same."""

import os
import signal
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from joblib import parallel_config

from mesa_swarm.experiments.sweep import sweep
from mesa_swarm.experiments.worker_pool import on_all
from mesa_swarm.experiments.worker_tasks import WorkerDiedError
from mesa_swarm.model.gallery import find_model
from support import failing_models
from support.killing import environment, lines_in
from support.waiting import wait_until

FIRE = find_model("fire_fighting")


@pytest.mark.slow
def test_the_death_of_a_worker_is_noticed_while_another_one_works(tmp_path):
    with pytest.raises(WorkerDiedError):
        list(on_all(2, failing_models.die_beside, [(tmp_path / "diary", dies) for dies in (False, True)]))
    assert not (tmp_path / "diary").exists()


DRIVER = """
import sys
from mesa_swarm.model.gallery import find_model
from mesa_swarm.experiments.sweep import sweep
if __name__ == "__main__":
    grid, out, seeds = {"strategy": ["A", "B"]}, sys.argv[1], int(sys.argv[2])
    sweep(find_model("fire_fighting"), grid, seeds=seeds, steps=400, out=out, jobs=2)
"""


def started(tmp_path, folder, seeds):
    script = tmp_path / "driver.py"
    script.write_text(DRIVER)
    with (tmp_path / "errors").open("w") as errors:
        return subprocess.Popen([sys.executable, script, folder, str(seeds)], env=environment(), stderr=errors)


def workers_of(driver):
    command = ["pgrep", "-P", str(driver.pid), "-f", "popen_loky"]
    return [int(number) for number in subprocess.run(command, capture_output=True, check=False).stdout.split()]


def works(process):
    """Whether a process is there, and not only its entry in a table."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")")[-1].split()[0] != "Z"
    except OSError:
        return False


def wait_for_more(driver, ledger, more):
    wanted = lines_in(ledger) + more
    wait_until(lambda: lines_in(ledger) >= wanted or driver.poll() is not None, 300.0)


def kill_driver(driver, ledger):
    """Kill a driver in the midst of a line of its ledger."""
    workers = workers_of(driver)
    assert workers
    driver.kill()
    driver.wait()
    wait_until(lambda: not any(map(works, workers)), 30.0)  # they end by themselves
    with ledger.open("ab") as file:
        file.write(b'00000000 {"key": "torn')


def killed_sweep(tmp_path, seeds, kills):
    """Run a sweep whose driver, or one of whose workers, is killed so often; return its table and ledger."""
    folder = tmp_path / "killed"
    ledger = folder / "ledger.jsonl"
    driver = started(tmp_path, folder, seeds)
    for number in range(kills):
        wait_for_more(driver, ledger, 3)
        if number % 2:
            os.kill(workers_of(driver)[0], signal.SIGKILL)
            continue
        kill_driver(driver, ledger)
        driver = started(tmp_path, folder, seeds)
    assert driver.wait(timeout=300) == 0, (tmp_path / "errors").read_text()
    return folder / "runs.parquet", ledger


def swept(seeds, folder):
    """Do the driver's sweep in this process."""
    return sweep(FIRE, {"strategy": ["A", "B"]}, seeds=seeds, steps=400, out=folder, jobs=1).path


def check_each_run_was_done_once(ledger, runs):
    keys = [line.split(b'"')[3] for line in ledger.read_bytes().splitlines()]
    assert len(keys) == len(set(keys)) == runs


@pytest.mark.slow
def test_a_sweep_whose_driver_is_killed_ends_in_the_same_table_byte_for_byte(tmp_path):
    folder = tmp_path / "killed"
    driver = started(tmp_path, folder, seeds=12)
    wait_for_more(driver, folder / "ledger.jsonl", 3)
    kill_driver(driver, folder / "ledger.jsonl")
    assert swept(12, folder).read_bytes() == swept(12, tmp_path / "whole").read_bytes()
    check_each_run_was_done_once(folder / "ledger.jsonl", 24)


@pytest.mark.long
def test_a_sweep_of_100_runs_whose_driver_and_workers_are_killed_10_times_ends_in_the_same_table(tmp_path):
    table, ledger = killed_sweep(tmp_path, seeds=50, kills=10)
    assert table.read_bytes() == swept(50, tmp_path / "whole").read_bytes()
    check_each_run_was_done_once(ledger, 100)


CLUSTER = """
import os, signal, sys, threading
from pathlib import Path
from distributed import Client, LocalCluster
from joblib import parallel_config
from mesa_swarm.model.gallery import find_model
from mesa_swarm.experiments.sweep import sweep
from support.killing import lines_in
from support.waiting import comes_true

def kill_one(address, process, ledger, scheduler):
    comes_true(lambda: lines_in(ledger) >= 3)
    os.kill(process, signal.SIGKILL)
    print(comes_true(lambda: address not in scheduler.workers), lines_in(ledger))

if __name__ == "__main__":
    out = Path(sys.argv[1])
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
        parallel_config(backend="dask"),
    ):
        processes = client.run(os.getpid)
        assert os.getpid() not in processes.values()
        address, process = next(iter(processes.items()))
        threading.Thread(target=kill_one, args=(address, process, out / "ledger.jsonl", cluster.scheduler)).start()
        made = sweep(find_model("fire_fighting"), {"strategy": ["A", "B"]}, seeds=6, steps=2000, out=out)
        print(made.runs, made.failed, process in client.run(os.getpid).values())
"""


@pytest.mark.skipif(find_spec("distributed") is None, reason="needs the extra [cluster]")
def test_on_a_dask_cluster_the_table_has_the_same_bytes(tmp_path):
    from distributed import Client, LocalCluster  # noqa: PLC0415 - comes with the extra

    place = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    with LocalCluster(**place) as cluster, Client(cluster), parallel_config(backend="dask"):
        path = sweep(FIRE, {"strategy": ["A", "B"]}, seeds=2, steps=50, out=tmp_path / "cluster").path
    whole = sweep(FIRE, {"strategy": ["A", "B"]}, seeds=2, steps=50, out=tmp_path / "whole", jobs=1).path
    assert path.read_bytes() == whole.read_bytes()


@pytest.mark.slow
@pytest.mark.skipif(find_spec("distributed") is None, reason="needs the extra [cluster]")
def test_on_a_dask_cluster_a_killed_worker_is_noticed_before_the_end_and_the_table_has_the_same_bytes(tmp_path):
    whole = sweep(FIRE, {"strategy": ["A", "B"]}, seeds=6, steps=2000, out=tmp_path / "whole", jobs=1).path
    script = tmp_path / "cluster.py"
    script.write_text(CLUSTER)
    command = [sys.executable, script, tmp_path / "cluster"]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=600, check=False)
    noticed, ended = done.stdout.splitlines() or ["", done.stderr]
    assert ended == "12 0 False"
    gone, done_by_then = noticed.split()
    assert gone == "True"
    assert 3 <= int(done_by_then) < 12
    assert (tmp_path / "cluster" / "runs.parquet").read_bytes() == whole.read_bytes()
