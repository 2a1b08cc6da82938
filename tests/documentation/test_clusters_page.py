"""The scripts of docs/clusters.md run as they stand, with a stand-in for SLURM, and make the tables of one machine."""

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from mesa_swarm.cli import main
from mesa_swarm.experiments.sweep import sweep
from mesa_swarm_studies.benchmarks.overhead import RUNS
from support import slurm
from support.waiting import wait_until

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="SLURM's scripts are those of a shell"),
]
ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "clusters.md").read_text(encoding="utf-8")
NAMED = re.compile(r"^# (\S+\.\w+)$", re.MULTILINE)
GRID = {"strategy": ["A", "B"], "n_robots": [5, 10]}


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)


@pytest.fixture
def folder(tmp_path):
    """A folder with all files that the page shows."""
    for block in (block for language in ("toml", "bash", "python") for block in blocks(language)):
        if found := NAMED.search(block):
            (tmp_path / found[1]).write_text(block)
    return tmp_path


@pytest.fixture
def environment(tmp_path):
    """The environment in which the commands of SLURM are the stand-in's; its jobs end with the test."""
    made = slurm.installed(tmp_path / "slurm") | {"PYTHONPATH": str(ROOT)}
    yield made
    jobs = [home.name for home in (tmp_path / "slurm" / "jobs").iterdir()]
    subprocess.run(["scancel", *jobs], env=made, check=True)


def run(folder, environment, *words):
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def wait_for_jobs(folder, environment):
    wait_until(lambda: not run(folder, environment, "squeue"), 300.0, every=0.2)


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """The table of one machine."""
    made = sweep("fire_fighting", GRID, seeds=3, steps=200, out=tmp_path_factory.mktemp("one"), jobs=1)
    return made.path.read_bytes()


def test_the_array_does_all_runs_and_the_job_after_it_makes_the_table_of_one_machine(folder, environment, table):
    (submit,) = blocks("sh")
    assert "sweep" in run(folder, environment, "sh", "-c", submit)
    wait_for_jobs(folder, environment)
    assert all(f"{k}-of-4.jsonl: 3 runs\n" in (folder / f"sweep-{k}.txt").read_text() for k in (1, 2, 3, 4))
    assert "12 runs, 12 of them before" in (folder / "table.txt").read_text()
    assert (folder / "results" / "grid" / "runs.parquet").read_bytes() == table


def test_an_array_that_is_killed_continues_and_makes_the_same_table(folder, environment, table):
    ledgers = folder / "results" / "grid"
    job = run(folder, environment, "sbatch", "--parsable", "sweep.sbatch").strip()
    wait_until(lambda: any(path.stat().st_size for path in ledgers.glob("ledger-*.jsonl")), 300.0)
    run(folder, environment, "scancel", job)
    assert not (ledgers / "runs.parquet").exists()
    for task in "1234":  # a task by itself does the same part as in an array
        run(folder, environment, "sbatch", f"--array={task}", "sweep.sbatch")
    wait_for_jobs(folder, environment)
    printed = run(folder, environment, sys.executable, "-m", "mesa_swarm", "sweep", "grid.toml", "--jobs", "1")
    assert "12 runs, 12 of them before" in printed
    assert (ledgers / "runs.parquet").read_bytes() == table


@pytest.mark.skipif(find_spec("dask_jobqueue") is None, reason="needs dask-jobqueue, of the extra [cluster]")
def test_the_jobs_of_dask_jobqueue_do_all_runs_and_end_with_the_script(folder, environment, table):
    assert run(folder, environment, sys.executable, "on_slurm.py").splitlines()[-1] == "12 0"
    assert (folder / "results" / "on_slurm" / "runs.parquet").read_bytes() == table
    wait_for_jobs(folder, environment)


@pytest.mark.skipif(find_spec("distributed") is None, reason="needs the extra [cluster]")
def test_processes_of_this_machine_stand_for_a_cluster(folder, environment):
    assert run(folder, environment, sys.executable, "here.py") == "6 0\n"


def test_the_calls_of_shards_in_one_process_do_what_the_page_shows(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    exec(next(block for block in blocks("python") if "shard=" in block), {})
    assert capsys.readouterr().out.splitlines() == ["3 ledger-1-of-2.jsonl", "3 ledger-2-of-2.jsonl", "6 6"]


def test_the_options_that_the_page_shows_are_those_of_the_command(capsys):
    with pytest.raises(SystemExit):
        main(["sweep", "--help"])
    shown = capsys.readouterr().out
    assert all(option in shown for option in ("--shard", "--scheduler", "--dry-run", "--jobs"))


def test_the_page_names_the_number_of_runs_that_are_measured():
    assert f"{RUNS:,} runs without robots" in PAGE
