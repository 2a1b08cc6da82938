"""Workers, drivers and a cluster's process are killed; no run is lost, and the table is the same."""

import os
import signal
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import failing_models
import pytest
from failing_models import Dying, DyingOnce, seeds_run
from support.killing import environment, lines_in
from waiting import wait_until

from mesa_swarm.experiments.pool import WorkerDiedError, on_all
from mesa_swarm.experiments.sweep import sweep
from mesa_swarm.gallery import find_model

FIRE = find_model("fire_fighting")


def test_a_worker_that_dies_is_replaced_and_no_run_is_lost(tmp_path):
    settings = {"diary": str(tmp_path / "diary")}
    made = sweep(DyingOnce, seeds=6, steps=1, settings=settings, out=tmp_path, jobs=2)
    assert (made.failed, made.frame()["seed"].tolist()) == (0, [1, 2, 3, 4, 5, 6])


@pytest.mark.slow
def test_a_run_that_always_kills_its_worker_is_recorded_and_the_rest_goes_on(tmp_path):
    settings = {"diary": str(tmp_path / "diary")}
    made = sweep(Dying, seeds=4, steps=1, settings=settings, out=tmp_path, jobs=2)
    assert made.frame()["error"].dropna().to_dict() == {1: "WorkerDiedError: the process died in each of 3 tries"}
    assert seeds_run(tmp_path / "diary")[2] == 3


def test_the_death_of_a_worker_is_noticed_within_five_seconds():
    assert list(on_all(2, abs, [(-1,), (-2,)]))  # workers are there
    seconds = []
    while not seconds or seconds[-1] >= 5:
        assert len(seconds) < 3, seconds  # a machine that is busy may hold it up, not each time
        begun = time.monotonic()
        with pytest.raises(WorkerDiedError):
            list(on_all(2, failing_models.die, [()]))
        seconds.append(time.monotonic() - begun)


DRIVER = """
import sys
from mesa_swarm.gallery import find_model
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
    while lines_in(ledger) < wanted and driver.poll() is None:
        time.sleep(0.01)


def killed_sweep(tmp_path, seeds, kills):
    """Run a sweep whose driver, or one of whose workers, is killed so often; return its table and ledger."""
    folder = tmp_path / "killed"
    ledger = folder / "ledger.jsonl"
    driver = started(tmp_path, folder, seeds)
    for number in range(kills):
        wait_for_more(driver, ledger, 3)
        workers = workers_of(driver)
        if number % 2:
            os.kill(workers[0], signal.SIGKILL)
            continue
        driver.kill()
        driver.wait()
        wait_until(lambda left=workers: not any(map(works, left)), 30.0)  # they end by themselves
        with ledger.open("ab") as file:
            file.write(b'00000000 {"key": "torn')  # as a kill in the midst of a line would
        driver = started(tmp_path, folder, seeds)
    assert driver.wait(timeout=300) == 0, (tmp_path / "errors").read_text()
    return folder / "runs.parquet", ledger


def check_killed_sweep(tmp_path, seeds, kills):
    whole = sweep(FIRE, {"strategy": ["A", "B"]}, seeds=seeds, steps=400, out=tmp_path / "whole", jobs=1).path
    table, ledger = killed_sweep(tmp_path, seeds, kills)
    assert table.read_bytes() == whole.read_bytes()
    keys = [line.split(b'"')[3] for line in ledger.read_bytes().splitlines()]
    assert len(keys) == len(set(keys)) == 2 * seeds


def test_a_sweep_whose_driver_and_worker_are_killed_ends_in_the_same_table_byte_for_byte(tmp_path):
    check_killed_sweep(tmp_path, seeds=12, kills=2)


@pytest.mark.slow
def test_a_sweep_of_100_runs_that_is_killed_10_times_ends_in_the_same_table_byte_for_byte(tmp_path):
    check_killed_sweep(tmp_path, seeds=50, kills=10)


CLUSTER = """
import os, signal, sys, threading, time
from pathlib import Path
from distributed import Client, LocalCluster
from joblib import parallel_config
from mesa_swarm.gallery import find_model
from mesa_swarm.experiments.sweep import sweep

def kill_one(address, process, ledger, scheduler):
    while not ledger.exists() or ledger.read_bytes().count(b"\\n") < 3:
        time.sleep(0.01)
    os.kill(process, signal.SIGKILL)
    begun = time.monotonic()
    while address in scheduler.workers and time.monotonic() - begun < 30:
        time.sleep(0.01)
    print(time.monotonic() - begun, ledger.read_bytes().count(b"\\n"))

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
def test_on_a_dask_cluster_a_killed_worker_is_noticed_within_5_s_and_the_table_has_the_same_bytes(tmp_path):
    whole = sweep(FIRE, {"strategy": ["A", "B"]}, seeds=6, steps=2000, out=tmp_path / "whole", jobs=1).path
    script = tmp_path / "cluster.py"
    script.write_text(CLUSTER)
    command = [sys.executable, script, tmp_path / "cluster"]
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=600, check=False)
    noticed, printed = done.stdout.splitlines() or ["", done.stderr]
    assert printed == "12 0 False"
    seconds, kept = noticed.split()
    assert float(seconds) < 5
    assert 3 <= int(kept) < 12
    assert (tmp_path / "cluster" / "runs.parquet").read_bytes() == whole.read_bytes()
