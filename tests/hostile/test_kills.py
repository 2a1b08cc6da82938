"""kill -9 at random moments after the first result: nothing goes on by itself, what was flushed is readable, and the
same command goes on and ends in the same bytes as an undisturbed one."""

import json
import os
import re
import shutil
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from mesa_swarm.model.gallery import find_model
from mesa_swarm.recording import Recording
from support.killing import COMMAND, Victim, killed, lines_in
from support.waiting import wait_until

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="processes are looked for in /proc"),
]
SEAL = re.compile(rb"crc32=[0-9a-f]{8} rows=(\d+) step=")


def attack_work(tally, area, tmp_path, kills, script, words, made, files):
    """Kill some work again and again until it is done, in as many folders as it takes, and compare the ends.

    `words(folder, jobs)` are the script's arguments, `made(folder)` counts results on the disk, `files(folder)` returns
    what the end is.
    """
    if not kills:
        pytest.skip("only with --at-length")
    table, chance = tally(area), np.random.default_rng(13)
    errors, done = tmp_path / "errors", 0
    # What is not killed needs no workers, whose start takes most of the time.
    Victim(script, *words(tmp_path / "whole", 1), errors=errors).finish()
    whole = files(tmp_path / "whole")
    assert whole
    for number in range(1000):
        if done >= kills:
            break
        home = tmp_path / f"killed {number}"
        begun = lambda jobs, home=home: Victim(script, *words(home, jobs), errors=errors)  # noqa: E731 - of this folder
        before = done
        for left in killed(begun, lambda home=home: made(home), kills - done, chance, 0.3):
            done += 1
            table.check(f"kill {done}", not left, f"{left} were there after it")
        table.check(f"end {number}", files(home) == whole, "the end differs from that of an undisturbed run")
        assert done > before, "the work was done before it could be killed"
        shutil.rmtree(home)


def contents(folder, *patterns):
    return {path.name: path.read_bytes() for pattern in patterns for path in folder.glob(pattern)}


SWEEP = """
[[run]]
name = "swept"
model = "fire_fighting"
steps = 150
seeds = {seeds}
grid = {{ strategy = ["A", "B"] }}
"""


def test_a_sweep_on_several_processes_goes_on(tally, amount, tmp_path):
    job = tmp_path / "swept.toml"
    job.write_text(SWEEP.format(seeds=amount(10, 150)))
    attack_work(
        tally,
        "kills: sweep",
        tmp_path,
        amount(2, 30),
        COMMAND,
        lambda home, jobs: ["sweep", job, "--jobs", jobs, "--quiet", "--out", home],
        lambda home: lines_in(home / "ledger.jsonl"),
        lambda home: contents(home, "**/runs.parquet"),
    )


CLUSTER = """
import sys
from distributed import Client, LocalCluster
from joblib import parallel_config
from mesa_swarm.experiments.sweep import sweep

if __name__ == "__main__":
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
        parallel_config(backend="dask"),
    ):
        grid = {"strategy": ["A", "B"]}
        sweep("fire_fighting", grid, seeds=int(sys.argv[2]), steps=500, out=sys.argv[1])
"""


@pytest.mark.skipif(find_spec("distributed") is None, reason="needs the extra [cluster]")
def test_a_sweep_on_a_cluster_goes_on(tally, amount, tmp_path):
    attack_work(
        tally,
        "kills: sweep on a cluster",
        tmp_path,
        amount(1, 30),
        CLUSTER,
        lambda home, jobs: [home, amount(6, 100)],
        lambda home: lines_in(home / "ledger.jsonl"),
        lambda home: contents(home, "runs.parquet"),
    )


def test_a_comparison_goes_on(tally, amount, tmp_path):
    line = f"compare fire_fighting --steps 150 --quiet --seeds {amount(8, 150)} --jobs"
    attack_work(
        tally,
        "kills: compare",
        tmp_path,
        amount(2, 30),
        COMMAND,
        lambda home, jobs: [*line.split(), jobs, "--out", home],
        lambda home: lines_in(home / "runs.jsonl"),
        lambda home: contents(home, "*.csv", "*.txt", "*.png"),
    )


def test_a_turn_of_the_dial_goes_on(tally, amount, tmp_path):
    line = f"reality-gap agglomeration --set n_robots=20 --steps 300 --quiet --seeds {amount(4, 40)} --jobs"
    attack_work(
        tally,
        "kills: reality-gap",
        tmp_path,
        amount(0, 30),  # what compare does
        COMMAND,
        lambda home, jobs: [*line.split(), jobs, "--out", home],
        lambda home: lines_in(home / "runs.jsonl"),
        lambda home: contents(home, "*.csv", "*.png"),
    )


def test_the_benchmark_of_learners_goes_on(tally, amount, tmp_path):
    line = f"learn-bench --seeds {amount(4, 30)} --steps 200 --evaluation-steps 20 --maps 3 --task avoid --quiet --only"
    attack_work(
        tally,
        "kills: learn-bench",
        tmp_path,
        amount(1, 30),
        COMMAND,
        lambda home, jobs: [*line.split(), "random;Q (a)", "--jobs", jobs, "--out", home],
        lambda home: lines_in(home / "ledger.jsonl"),
        lambda home: contents(home, "learn_bench.csv"),  # the other files have times
    )


def test_tuning_goes_on(tally, amount, tmp_path):
    line = f"tune --steps 400 --robots 4 --population 4 --seeds {amount(4, 30)} --judged 4 --generations 3 --quiet"
    attack_work(
        tally,
        "kills: tune",
        tmp_path,
        amount(2, 30),
        COMMAND,
        lambda home, jobs: [*line.split(), "--table", "csv", "--jobs", jobs, "--out", home],
        lambda home: lines_in(home / "runs.jsonl") + lines_in(home / "fresh" / "runs.jsonl"),
        lambda home: [(home / name).read_bytes() for name in ("runs.csv", "fresh/runs.csv")],
    )


def test_a_reward_laboratory_goes_on(tally, amount, tmp_path):
    line = f"reward-lab --steps 200 --quiet --table csv --seeds {amount(4, 40)} --jobs"
    attack_work(
        tally,
        "kills: reward-lab",
        tmp_path,
        amount(0, 30),  # what tune does
        COMMAND,
        lambda home, jobs: [*line.split(), jobs, "--out", home],
        lambda home: lines_in(home / "runs.jsonl"),
        lambda home: contents(home, "*.csv", "*.png"),
    )


EVOLUTION = """
import sys
from pathlib import Path
from mesa_swarm.searches.evolved_controllers import Trial, evolve
from mesa_swarm.learning import save_policy

if __name__ == "__main__":
    home = Path(sys.argv[1])
    generations, jobs = map(int, sys.argv[2:])
    how = {"generations": generations, "population": 8, "finalists": 1, "final_trials": 1, "jobs": jobs}
    found = evolve(Trial(robots=3, steps=100), **how, file=home / "reported.json")
    save_policy(found.policy, home / "policy.npz")
"""


def generations(file):
    return len(json.loads(file.read_bytes())["fitness"]) if file.exists() else 0


def test_an_evolution_goes_on(tally, amount, tmp_path):
    attack_work(
        tally,
        "kills: evolve",
        tmp_path,
        amount(1, 30),
        EVOLUTION,
        lambda home, jobs: [home, amount(15, 100), jobs],
        lambda home: generations(home / "reported.json"),
        lambda home: contents(home, "reported.json", "policy.*"),
    )


def test_a_reproduction_goes_on(tally, amount, tmp_path):
    attack_work(
        tally,
        "kills: reproduce",
        tmp_path,
        amount(1, 30),
        COMMAND,
        lambda home, jobs: ["reproduce", "--figure", "5.6", "--quick", "--jobs", jobs, "--quiet", "--out", home],
        lambda home: lines_in(home / "runs.jsonl"),
        lambda home: contents(home, "figure_*"),
    )


def rows_in(file):
    """Return how many rows of a recording are sealed."""
    return sum(int(seal[1]) for seal in SEAL.finditer(file.read_bytes())) if file.exists() else 0


RUN = """
import sys
from mesa_swarm.cli import main
main(["run", "collision_avoidance", "--set", "n_robots=5", "--steps", "10000000", "--quiet", "--record", sys.argv[1]])
"""
PAGE = """
import os, shutil, sys, tempfile
from pathlib import Path
tempfile.tempdir = sys.argv[1] + "_"
os.mkdir(tempfile.tempdir)
from mesa_swarm.dashboard.run.exporting import Exporting
from mesa_swarm.dashboard.page.session import Session
session = Session("collision_avoidance", {"n_robots": 5})
exporting = session.companion(Exporting)
exporting.record(True)
os.symlink(exporting.switch.path, sys.argv[1])
while True:
    session.step()
"""


@pytest.mark.parametrize(("area", "script"), [("run --record", RUN), ("the page's recording", PAGE)])
def test_the_rows_of_a_recording_are_readable_and_its_run_goes_on(tally, amount, tmp_path, area, script):
    if script is PAGE and find_spec("solara") is None:
        pytest.skip("needs the extra [dashboard]")
    table, chance, kills = tally(f"kills: {area}"), np.random.default_rng(13), amount(2, 30)
    files = [tmp_path / f"{number}.arrow" for number in range(kills)]
    for number, file in enumerate(files):
        victim = Victim(script, file, errors=tmp_path / "errors")
        wait_until(lambda file=file, victim=victim: rows_in(file) or victim.ended, every=0.02)
        time.sleep(chance.uniform(0, 1.5))
        assert not victim.ended, victim.errors.read_text()[-2000:]
        flushed = rows_in(file)
        left = victim.kill(group=number % 5 == 4)
        table.check(f"kill {number}", not left, f"{left} were there after it")
        recording = Recording(file)
        steps = recording.steps.tolist()
        table.check(f"rows {number}", steps == list(range(1, len(steps) + 1)) and len(steps) >= flushed, f"{steps}")
    check_resumed(table, files)


def check_resumed(table, files):
    """Compare models that are resumed from recordings with one that was never disturbed."""
    model_class = find_model("collision_avoidance")
    resumed = [model_class.resume(file) for file in files]
    undisturbed = model_class(n_robots=5, rng=1)
    for number, model in sorted(enumerate(resumed), key=lambda each: each[1].steps):
        undisturbed.run(model.steps - undisturbed.steps) if model.steps > undisturbed.steps else None
        table.check(f"state {number}", model.state_hash() == undisturbed.state_hash(), f"differs at {model.steps}")
    latest = undisturbed.steps + 100
    undisturbed.run(100)
    ends = {model.run(latest - model.steps).state_hash() for model in resumed}
    table.check("ends", ends == {undisturbed.state_hash()}, f"{len(ends)} different ends")


def test_an_export_leaves_the_old_file_or_the_new_one_whole(tally, amount, tmp_path):
    table, chance = tally("kills: export"), np.random.default_rng(13)
    model = find_model("collision_avoidance")(n_robots=20, rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(600)
    endings = ["csv", "gif", *(["mp4"] if find_spec("imageio_ffmpeg") else [])]
    how = {"csv": ["--table", "robots"], "gif": ["--every", 10], "mp4": ["--every", 5]}
    for number in range(amount(2, 30)):
        ending = endings[number % len(endings)]
        out = tmp_path / f"{number}.{ending}"
        out.write_bytes(b"what was there before")
        words = ["export", tmp_path / "run.arrow", out, *how[ending], "--force", "--quiet"]
        begun = lambda words=words: Victim(COMMAND, *words, errors=tmp_path / "errors")  # noqa: E731
        victim = begun()
        # The first result: what is written beside the file, whatever its name.
        wait_until(lambda victim=victim: victim.ended or list(tmp_path.glob(".*")), every=0.005)
        time.sleep(chance.uniform(0, 0.5))
        orphans = victim.kill()
        old = out.read_bytes() == b"what was there before"
        left = None if old else out.read_bytes()
        begun().finish()
        table.check(f"kill {number}", not orphans, f"{orphans} were there after it")
        table.check(f"file {number}", old or left == out.read_bytes(), f"{out.name} is neither the old nor the new one")
        for draft in tmp_path.glob(".*"):
            draft.unlink()


WORKERS = {
    "just starting, or at work": """
from mesa_swarm.experiments.worker_pool import on_all
import time
list(on_all(3, time.sleep, [(1000,), (1000,)]))
""",
    "idle": """
import numpy as np, os, sys, time
from mesa_swarm.experiments.worker_pool import on_all
print(list(on_all(3, np.sum, [(np.ones(1_000_000),), (np.ones(1_000_000),)])))
time.sleep(1000)
""",
    "of oscillations": """
from mesa_swarm.experiments.reward_study import reward_study
if __name__ == "__main__":
    reward_study(["b"], actions=4, seeds=3, steps=1_000_000, jobs=2)
""",
    "of the page's comparison": """
import time
from mesa_swarm.dashboard.experiment import many_runs
from mesa_swarm.dashboard.compare.comparing import ComparedRuns
from mesa_swarm.experiments.plan import checked_plan
many_runs.cpu_count = lambda: 3
runs = many_runs.ManyRuns()
runs.start(ComparedRuns(checked_plan("fire_fighting", seeds=20, steps=1_000_000)))
time.sleep(1000)
""",
}


OFTEN = ("idle", "of the page's comparison")


@pytest.mark.parametrize("kind", WORKERS)
def test_workers_end_with_their_parent(tally, amount, tmp_path, kind):
    if not amount(kind in OFTEN, True):
        pytest.skip("only with --at-length")
    table, chance = tally(f"kills: workers {kind}"), np.random.default_rng(13)
    for number in range(amount(1, 30)):
        victim = Victim(WORKERS[kind], errors=tmp_path / "errors")
        wait_until(lambda victim=victim: len(victim.alive()) >= 2 or victim.ended)
        time.sleep(chance.uniform(0, 4))
        assert not victim.ended, victim.errors.read_text()[-2000:]
        orphans = victim.kill()
        table.check(f"kill {number}", not orphans, f"{orphans} were there after it")
        left = [path for path in memory_folders() if f"_{victim.process.pid}_" in path.name]
        table.check(f"memory {number}", not left, f"{left} stayed behind")


def memory_folders():
    """Return the folders in which joblib shares large arrays with workers."""
    return [path for place in ("/dev/shm", os.environ.get("TMPDIR", "/tmp")) for path in Path(place).glob("joblib_*")]
