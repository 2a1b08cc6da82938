"""Sweeps over time: memory that stays, machines that vanish, progress in a notebook."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

MEMORY = """
import gc
import sys
from pathlib import Path
import psutil
from mesa_swarm.experiments import sweep
from support.failing_models import Counting
from mesa_swarm.experiments.experiment import checked_experiment
from mesa_swarm.experiments.run_tables import RunFiles
from mesa_swarm.experiments.sweep import run_experiment

if __name__ == "__main__":
    out, jobs = Path(sys.argv[1]), int(sys.argv[2])
    sweep.ROWS_AT_ONCE = 100  # what is held at a time, which fewer runs than usual fill
    for seeds in (1500, 3500):  # from 1,025 runs on the ledger holds its keys sorted
        experiment = checked_experiment(Counting, seeds=seeds, steps=1, settings={"diary": str(out / "diary")})
        run_experiment(experiment, RunFiles(out), jobs)
        gc.collect()
        print(psutil.Process().memory_info().rss)
"""

VANISHED = """
import os, signal, sys, threading
from pathlib import Path
import dask
from distributed import Client, LocalCluster
from joblib import parallel_config
from mesa_swarm.model.gallery import find_model
from mesa_swarm.experiments.sweep import sweep
from support.killing import lines_in
from support.waiting import comes_true

def freeze_one(process, ledger, scheduler):
    comes_true(lambda: lines_in(ledger) >= 2)
    os.kill(process, signal.SIGSTOP)  # the connection stays open, as that of a machine without power does
    # 5 s of silence, and what dask takes to try to start it again
    print(comes_true(lambda: len(scheduler.workers) < 2, 20.0), flush=True)
    os.kill(process, signal.SIGKILL)

if __name__ == "__main__":
    out = Path(sys.argv[1])
    with (
        dask.config.set({"distributed.scheduler.worker-ttl": "1s"}),
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
        parallel_config(backend="dask"),
    ):
        process = next(iter(client.run(os.getpid).values()))
        threading.Thread(target=freeze_one, args=(process, out / "ledger.jsonl", cluster.scheduler)).start()
        made = sweep(find_model("fire_fighting"), {"strategy": ["A", "B"]}, seeds=8, steps=6000, out=out)
        print(made.runs, made.failed)
"""

CELL = """
from mesa_swarm.model.gallery import find_model
from mesa_swarm.experiments.sweep import sweep
sweep(find_model("fire_fighting"), seeds=3, steps=5, out={out!r}, jobs=1, progress=True).runs
"""


def printed_by(tmp_path, program, *words):
    script = tmp_path / "program.py"
    script.write_text(program)
    tests = Path(__file__).parents[1]
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(tmp_path), "PYTHONPATH": f"{tests.parent}:{tests}"}
    command = [sys.executable, script, *map(str, words)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.long
@pytest.mark.skipif(find_spec("psutil") is None, reason="needs psutil, which comes with the extra [cluster]")
@pytest.mark.parametrize("jobs", [1, 2])
def test_memory_does_not_grow_with_the_number_of_runs(tmp_path, jobs):
    few, many = map(int, printed_by(tmp_path, MEMORY, tmp_path, jobs))
    assert many - few < 2_000 * 2_000, "2 kB a run: a model has a hundred times as much"


@pytest.mark.slow
@pytest.mark.skipif(find_spec("distributed") is None, reason="needs the extra [cluster]")
def test_a_dask_worker_that_falls_silent_is_noticed_and_its_runs_are_done_by_others(tmp_path):
    noticed, ended = printed_by(tmp_path, VANISHED, tmp_path)
    assert (noticed, ended) == ("True", "16 0")


@pytest.mark.slow
@pytest.mark.skipif(find_spec("ipykernel") is None, reason="needs a Jupyter kernel")
def test_a_notebook_shows_the_time_left_and_when_it_will_be_done(tmp_path):
    from jupyter_client.manager import start_new_kernel  # noqa: PLC0415 - comes with the kernel

    contents = []
    kernel, client = start_new_kernel(kernel_name="python3", cwd=str(Path(__file__).parents[2]))
    try:
        code = CELL.format(out=str(tmp_path / "out"))
        reply = client.execute_interactive(
            code, timeout=300, output_hook=lambda message: contents.append(message["content"])
        )
    finally:
        client.stop_channels()
        kernel.shutdown_kernel(now=True)
    assert reply["content"]["status"] == "ok", contents
    text = "".join(content.get("text", "") for content in contents if isinstance(content.get("text"), str))
    assert "3/3 runs" in text
    assert "left, done at" in text
