"""compare and sweep: many runs, resumed where an earlier call stopped."""

import os
import shlex
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pandas as pd
import pytest

from mesa_swarm.recording import Recording

MODEL = 'model = "fire_fighting"\n'
RECORDED = MODEL + 'robots = 2\nsteps = 20\nseeds = 2\nrecord = { file = "runs/{seed}.arrow", every = 5 }'


@pytest.mark.slow
def test_compare_prints_a_table_paths_and_a_finding_and_writes_the_files(typed, tmp_path):
    status, out, err = typed("compare fire_fighting --seeds 2 --steps 30 --jobs 1 --quiet")
    folder = Path("results", "compare_fire_fighting")
    assert (status, err) == (0, "")
    assert out.startswith("FireFighting: 2 paired seeds, at most 30 steps each")
    assert out.splitlines()[-1].startswith("With strategy ")
    written = {path.name for path in (tmp_path / folder).iterdir()}
    assert {str(folder / name) for name in written - {"runs.jsonl"}} <= set(out.splitlines())
    assert len(written) == 8
    again = typed("compare fire_fighting --seeds 2 --steps 30 --jobs 1 --quiet")[1]
    assert again == f"4 of 4 runs were done before, see {folder / 'runs.jsonl'}\n{out}"


@pytest.mark.slow
def test_compare_takes_another_parameter_values_settings_and_folder(typed, tmp_path):
    line = "compare collision_avoidance --parameter n_robots --values 2,3 --set map=sparse --out here/there"
    status, out, err = typed(f"{line} --seeds 2 --steps 20 --jobs 1")
    assert status == 0
    assert "4 of 4 runs in " in err
    assert "minus 2 [95 %]" in out
    assert (tmp_path / "here" / "there" / "over_time.png").exists()


def stored(ledger):
    return ledger.exists() and ledger.stat().st_size > 0


@pytest.mark.slow
def test_ctrl_c_stops_a_comparison_on_all_cores_and_leaves_only_its_runs(tmp_path):
    command = [sys.executable, "-m", "mesa_swarm", "compare", "fire_fighting", "--jobs", "2", "--out", "made"]
    running = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    ledger = Path("made", "runs.jsonl")
    while running.poll() is None and not stored(tmp_path / ledger):
        time.sleep(0.05)
    os.killpg(running.pid, signal.SIGINT)  # as a terminal does: to all processes
    try:
        out, err = running.communicate(timeout=120)
    finally:
        with suppress(OSError):  # all of them have ended
            os.killpg(running.pid, signal.SIGKILL)
    # Under -m, Python ends by the signal where a module was being imported: a shell shows 130 for both.
    assert running.returncode in (130, -signal.SIGINT)
    assert out == f"the runs so far are stored in {ledger}; the same command continues from there\n"
    assert "mesa-swarm: interrupted; nothing more was written" in err.splitlines()
    assert "Traceback" not in err
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [tmp_path / ledger]


def test_sweep_writes_a_table_for_each_run_of_the_queue_and_does_nothing_twice(typed, tmp_path):
    Path("job.toml").write_text(f"[[run]]\n{MODEL}steps = 5\nseeds = 2\n" * 2)
    first, again = (typed("sweep job.toml --jobs 1 --quiet") for _ in range(2))
    paths = [Path("results", "job", name, "runs.parquet") for name in ("run_1", "run_2")]
    assert first == (0, "".join(f"{path}: 2 runs\n" for path in paths), "")
    assert again == (0, "".join(f"{path}: 2 runs, 2 of them before\n" for path in paths), "")
    assert all(path.exists() for path in paths)


def test_sweep_ends_runs_at_a_condition_and_writes_series_and_tables_on_request(typed):
    Path("job.toml").write_text(f"{MODEL}steps = 20\nseeds = 2")
    words = "sweep job.toml --jobs 1 --quiet --until 'steps == 4' --series both --table csv --table behaviorspace"
    home = Path("results/job")
    names = ("runs.csv", "behaviorspace.csv", "series/model", "series/agents")
    printed = [f"{home / 'runs.parquet'}: 2 runs", *(str(home / name) for name in names)]
    assert typed(shlex.split(words)) == (0, "\n".join([*printed, ""]), "")
    assert pd.read_parquet(home / "runs.parquet")["ended_by"].tolist() == ["condition"] * 2
    assert pd.read_parquet(home / "series/model")["step"].tolist() == [1, 2, 3, 4] * 2
    assert typed(shlex.split(f"{words} --dry-run"))[1].endswith(
        "2 runs (1 point x 2 seeds, 20 steps each), 2 done, 0 to do\n"
    )


@pytest.mark.slow
def test_compare_ends_runs_at_a_condition_and_writes_series_and_tables_on_request(typed):
    words = "compare fire_fighting --seeds 2 --steps 9 --jobs 1 --quiet --until 'steps == 4' --series model"
    status, out, _ = typed(shlex.split(f"{words} --table behaviorspace"))
    assert status == 0
    home = Path("results/compare_fire_fighting")
    assert {str(home / "behaviorspace.csv"), str(home / "series/model")} <= set(out.splitlines())
    assert len(pd.read_parquet(home / "series/model")) == 4 * 4


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("sweep job.toml --until 'fires_burnin == 0'", "did you mean 'fires_burning'?"),
        ("compare fire_fighting --until 'open(1)'", "expected a comparison of reporters with numbers"),
        ("sweep job.toml --series all", "unknown series 'all'; known: both, model, agents"),
        ("sweep job.toml --table xls", "unknown form of a table 'xls'; known: csv, behaviorspace"),
        ("sweep job.toml --table csv --shard 1/2", "tables are of all shards"),
        ("reality-gap --until 'a == 1'", "--until is given without a model"),
    ],
)
def test_wrong_conditions_series_and_tables_are_one_line_before_any_run(typed, words, message):
    Path("job.toml").write_text(f"{MODEL}steps = 20\nseeds = 2")
    status, out, err = typed(shlex.split(words))
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert message in err
    assert [path for path in Path().rglob("*") if path.is_file()] == [Path("job.toml")]


def test_a_condition_in_a_job_and_on_the_command_line_is_refused(typed):
    Path("job.toml").write_text(f"{MODEL}steps = 20\nuntil = 'steps == 4'")
    assert "ended by" in typed("run job.toml --quiet")[1]
    assert (
        "until is set here and on the command line (--until)"
        in typed(shlex.split("run job.toml --until 'steps == 4'"))[2]
    )


def test_a_dry_run_counts_the_runs_and_writes_nothing(typed, tmp_path):
    Path("job.toml").write_text(f"{MODEL}steps = 5\nseeds = 2\n[grid]\nn_robots = [2, 3, 4]")
    planned = "results/job: 6 runs (3 points x 2 seeds, 5 steps each)"
    assert typed("sweep job.toml --dry-run") == (0, f"{planned}, 0 done, 6 to do\n", "")
    assert not Path("results").exists()
    assert typed("sweep job.toml --jobs 1 --quiet")[0] == 0
    Path("job.toml").write_text(f"{MODEL}steps = 5\nseeds = 3\n[grid]\nn_robots = [2, 3, 4]")
    with Path("results/job/ledger.jsonl").open("ab") as ledger:
        ledger.write(b"torn")
    before = {path: path.read_bytes() for path in Path("results").rglob("*") if path.is_file()}
    assert typed("sweep job.toml --dry-run")[1].endswith("9 runs (3 points x 3 seeds, 5 steps each), 6 done, 3 to do\n")
    assert typed("sweep job.toml --dry-run --record")[1].endswith("0 done, 9 to do\n")
    assert before == {path: path.read_bytes() for path in Path("results").rglob("*") if path.is_file()}


def test_sweep_records_every_run_on_request_with_the_job_s_options(typed):
    Path("job.toml").write_text(RECORDED)
    assert typed("sweep job.toml --jobs 1 --quiet")[0] == 0
    assert not Path("results/job/recordings").exists()
    assert typed("sweep job.toml --jobs 1 --quiet --record") == (0, f"{Path('results/job/runs.parquet')}: 2 runs\n", "")
    assert [Recording(file).steps.tolist() for file in Path("results/job/recordings").iterdir()] == [
        [5, 10, 15, 20]
    ] * 2


def test_a_sweep_prints_why_runs_failed_and_how_to_repeat_them_and_exits_with_1(typed):
    Path("job.toml").write_text(MODEL + "steps = 3\nseeds = 2\n[grid]\nn_robots = [3, 20000, 30000]")
    for done in ("", ", 6 of them before"):
        status, out, err = typed("sweep job.toml --quiet --jobs 1")
        assert (status, out) == (1, f"results/job/runs.parquet: 6 runs{done}, 4 ended in an error\n")
        first, second, last = err.splitlines()
        assert first.startswith("mesa-swarm: results/job/runs.parquet: PlacementError: ")
        assert second.startswith("mesa-swarm: results/job/runs.parquet: PlacementError: ")
        assert first != second
        assert last == "mesa-swarm: --retry-failed repeats the runs that failed"


GONE = """
import math

from mesa_swarm import SwarmModel


class Gone(SwarmModel):
    compares = "gain", (1.0, 2.0)

    def __init__(self, *, gain: float = 1.0, rng=None):
        super().__init__(rng=rng, model_reporters={"left": lambda model: gain if model.steps < 4 else math.nan})
"""
ROWS = "Rows left out, since they have no number: {} of left."


@pytest.mark.slow
def test_reports_are_measured_and_rows_left_out_are_printed(typed):
    Path("gone.py").write_text(GONE)
    line = "compare ./gone.py:Gone --seeds 2 --steps 5 --jobs 1 --quiet --out made"
    status, out, _ = typed([*line.split(), "--measure", "mean of left", "--measure", "final value of left"])
    assert status == 0
    assert ROWS.format(8) in out
    assert out.splitlines()[-1].startswith("mean of left was 2 with gain 2.0")
    status, _, err = typed(line)
    assert status
    assert "Gone has no method results(), which returns what is compared; or name reports" in err


def test_a_sweep_and_a_run_of_a_job_print_how_many_rows_are_left_out(typed):
    Path("gone.py").write_text(GONE)
    Path("job.toml").write_text('model = "./gone.py:Gone"\nsteps = 5\nseeds = 2\nmeasure = ["final value of left"]')
    assert ROWS.format(4) in typed("sweep job.toml --jobs 1 --quiet")[1]
    _, out, _ = typed("run job.toml --quiet")
    assert out.count("rows left out of left") == 2
