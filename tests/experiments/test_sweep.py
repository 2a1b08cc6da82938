import hashlib
import importlib.util
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from importlib.util import find_spec
from pathlib import Path

import failing_models
import numpy as np
import pytest
from failing_models import Counting, Dying, DyingOnce, Raising
from pyarrow import parquet

from mesa_swarm.errors import SwarmError
from mesa_swarm.experiments.experiment import Outcome, checked_experiment
from mesa_swarm.experiments.ledger import Ledger
from mesa_swarm.experiments.pool import WorkerDiedError, on_all
from mesa_swarm.experiments.sampling import Sample, grid
from mesa_swarm.experiments.source import source_hash
from mesa_swarm.experiments.sweep import sweep
from mesa_swarm.gallery import find_model

FIRE = find_model("fire_fighting")
GRID = {"strategy": ["A", "B"], "n_robots": [2, 3]}


def seeds_run(diary):
    """How often each seed was run, from what its runs wrote down."""
    return Counter(int(line.split()[0]) for line in diary.read_text().splitlines())


def key(number):
    return hashlib.blake2b(str(number).encode(), digest_size=16).hexdigest()


# ---- the table


def test_each_row_is_what_the_model_does_alone(tmp_path):
    table = sweep(FIRE, GRID, seeds=[5, 6], steps=30, out=tmp_path, jobs=1).frame()
    assert table[["strategy", "n_robots", "rng"]].iloc[3].tolist() == ["A", 3, 6]
    alone = [
        FIRE(strategy=strategy, n_robots=n, rng=rng).run(30).state_hash()
        for strategy in "AB"
        for n in (2, 3)
        for rng in (5, 6)
    ]
    assert table["state_hash"].tolist() == alone


def test_the_table_does_not_depend_on_the_number_of_processes(tmp_path):
    paths = [sweep(FIRE, GRID, seeds=4, steps=10, out=tmp_path / str(n), jobs=n).path for n in (1, 2)]
    assert paths[0].read_bytes() == paths[1].read_bytes()


def test_a_sweep_that_is_widened_does_only_what_is_new(tmp_path):
    diary = tmp_path / "diary"
    first, second = (
        sweep(Counting, seeds=n, steps=1, settings={"diary": str(diary)}, out=tmp_path, jobs=1) for n in (2, 4)
    )
    assert (first.done_before, second.done_before, second.runs) == (0, 2, 4)
    assert seeds_run(diary) == {1: 1, 2: 1, 3: 1, 4: 1}
    assert second.frame()["seed"].tolist() == [1, 2, 3, 4]


def test_other_steps_and_parameters_are_other_runs():
    keys = {
        task.key
        for steps in (5, 6)
        for n in (2, 3)
        for task in checked_experiment(FIRE, {"n_robots": [n]}, seeds=2, steps=steps).tasks()
    }
    assert len(keys) == 8


def test_only_what_is_wanted_becomes_a_column(tmp_path):
    path = sweep(FIRE, seeds=1, steps=5, measure=["fires out"], out=tmp_path, jobs=1).path
    assert parquet.read_schema(path).names == ["rng", "steps", "state_hash", "fires out", "error"]


def test_points_that_a_sample_has_twice_are_run_once(tmp_path):
    sample = Sample("latin_hypercube", {"n_robots": (2, 3)}, points=6)
    table = sweep(FIRE, sample, seeds=1, steps=5, out=tmp_path, jobs=2).frame()
    assert sorted(table["n_robots"]) == [2, 2, 2, 3, 3, 3]
    assert len((tmp_path / "ledger.jsonl").read_text().splitlines()) == 2


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"varied": {"n_robotz": [1]}}, "did you mean 'n_robots'"),
        ({"varied": [{"n_robots": 1}, {"k1": 0.1}]}, "expected the same parameters"),
        ({"seeds": 0}, "seeds is 0"),
        ({"seeds": "12"}, "seeds is '12'"),
        ({"measure": ["fires"]}, "did you mean 'fires out'"),
        ({"jobs": 0}, "jobs is 0"),
        ({"varied": {"n_robots": [10**6]}}, "do not fit"),
    ],
)
def test_a_wrong_sweep_is_refused_before_anything_is_run(tmp_path, wrong, said):
    with pytest.raises(SwarmError, match=said):
        sweep(FIRE, **{"steps": 5, "out": tmp_path, **wrong})
    assert list(tmp_path.iterdir()) == []


# ---- other code


MODEL_FILE = """
from mesa_swarm.model import SwarmModel

FACTOR = 1

class Edited(SwarmModel):
    def __init__(self, *, odd: float = 0.0, rng=None):
        super().__init__(rng=rng)

    def results(self):
        return {"number": 1.0 * FACTOR}
"""


def loaded(path, text):
    """Write a module and import it, as a new process would."""
    path.write_text(text)
    spec = importlib.util.spec_from_file_location("edited_model", path)
    module = sys.modules["edited_model"] = importlib.util.module_from_spec(spec)
    exec(compile(text, path, "exec"), vars(module))
    return module.Edited


@pytest.mark.parametrize(("old", "new"), [("1.0 *", "2.0 *"), ("FACTOR = 1", "FACTOR = 2")])
def test_a_model_that_was_edited_is_run_again_and_one_that_was_not_is_not(tmp_path, old, new):
    numbers = []
    for text in (MODEL_FILE, MODEL_FILE, MODEL_FILE.replace(old, new)):
        made = sweep(loaded(tmp_path / "edited_model.py", text), seeds=2, steps=1, out=tmp_path / "out", jobs=1)
        numbers.append((made.done_before, made.frame()["number"].tolist()))
    assert numbers == [(0, [1.0, 1.0]), (2, [1.0, 1.0]), (0, [2.0, 2.0])]


def test_a_class_without_a_file_is_known_by_the_code_of_its_methods():
    hashes = []
    for text in (MODEL_FILE, MODEL_FILE, MODEL_FILE.replace("1.0 *", "2.0 *")):
        space = {"__name__": "a_notebook"}
        exec(compile(text, "<cell>", "exec"), space)
        hashes.append(source_hash(space["Edited"]))
    assert hashes[0] == hashes[1] != hashes[2]


def test_the_fingerprint_of_a_source_is_the_same_in_every_process():
    code = "from mesa_swarm.experiments.source import source_hash; from mesa_swarm.gallery import find_model\n"
    code += "print(source_hash(find_model('fire_fighting')))"
    said = {
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
            cwd=Path(__file__).parent.parent.parent,
        ).stdout.strip()
        for seed in ("1", "2")
    }
    assert said == {source_hash(FIRE)}


# ---- what goes wrong


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_run_that_raises_is_recorded_in_one_line_and_the_rest_goes_on(tmp_path, jobs):
    settings = {"diary": str(tmp_path / "diary")}
    made = sweep(Raising, seeds=4, steps=1, settings=settings, out=tmp_path, jobs=jobs)
    table = made.frame()
    assert (made.runs, made.failed) == (4, 1)
    assert table["error"].dropna().to_dict() == {1: "RuntimeError: it broke in <object object>"}
    assert table["seed"].dropna().tolist() == [1, 3, 4]


def test_an_error_is_kept_until_it_is_to_be_tried_again(tmp_path):
    settings = {"diary": str(tmp_path / "diary")}
    wanted = {"seeds": 3, "steps": 1, "settings": settings, "out": tmp_path, "jobs": 1}
    made = [sweep(Raising, **wanted, retry_failed=retry) for retry in (False, False, True)]
    assert [(one.failed, one.done_before) for one in made] == [(1, 0), (1, 3), (1, 2)]
    assert seeds_run(tmp_path / "diary") == {1: 1, 2: 2, 3: 1}


def test_what_a_second_try_says_takes_the_place_of_the_error(tmp_path):
    path, good = tmp_path / "ledger.jsonl", Outcome(steps=1, state_hash="", results={})
    with Ledger(path) as ledger:
        ledger.append(key(1), Outcome(error="it broke"))
        ledger.append(key(2), good)
    with Ledger(path, retry_failed=True) as ledger:
        assert (key(1) in ledger, key(2) in ledger) == (False, True)
        ledger.append(key(1), good)
        assert ledger.outcome(key(1)) == good
    with Ledger(path) as ledger:
        assert ledger.outcome(key(1)) == good


def test_a_worker_that_dies_is_replaced_and_no_run_is_lost(tmp_path):
    settings = {"diary": str(tmp_path / "diary")}
    made = sweep(DyingOnce, seeds=6, steps=1, settings=settings, out=tmp_path, jobs=2)
    assert (made.failed, made.frame()["seed"].tolist()) == (0, [1, 2, 3, 4, 5, 6])


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_sweep_adds_less_than_20_ms_to_a_run_or_twice_as_much_on_a_busy_machine(tmp_path, jobs):
    sweep(FIRE, seeds=4, steps=30, out=tmp_path / "warm", jobs=jobs)  # starts workers, loads kernels

    def seconds(work):
        start = time.perf_counter()
        work()
        return time.perf_counter() - start

    runs = 100
    rounds = []
    for i in range(3):  # the machine may be busy: of three rounds the best counts
        bare = seconds(lambda: [FIRE(rng=rng).run(30).results() for rng in range(1, runs + 1)])
        swept = seconds(lambda i=i: sweep(FIRE, seeds=runs, steps=30, out=tmp_path / str(i), jobs=jobs))
        rounds.append((swept - bare) / runs)
    print(f"{jobs} jobs: {[f'{1000 * extra:.2f}' for extra in rounds]} ms a run")
    busy = os.getloadavg()[0] > os.cpu_count()  # each run waits for the disk, and so do others
    assert min(rounds) < (0.040 if busy else 0.020)


@pytest.mark.slow
def test_a_run_that_always_kills_its_worker_is_recorded_and_the_rest_goes_on(tmp_path):
    settings = {"diary": str(tmp_path / "diary")}
    made = sweep(Dying, seeds=4, steps=1, settings=settings, out=tmp_path, jobs=2)
    assert made.frame()["error"].dropna().to_dict() == {1: "WorkerDiedError: the process died in each of 3 tries"}
    assert seeds_run(tmp_path / "diary")[2] == 3


def test_the_death_of_a_worker_is_noticed_within_five_seconds():
    assert list(on_all(2, abs, [(-1,), (-2,)]))  # workers are there
    begun = time.monotonic()
    with pytest.raises(WorkerDiedError):
        list(on_all(2, failing_models.die, [()]))
    assert time.monotonic() - begun < 5


DRIVER = """
import sys
from mesa_swarm.gallery import find_model
from mesa_swarm.experiments.source import source_hash
from mesa_swarm.experiments.sweep import sweep
if __name__ == "__main__":
    grid, out, seeds = {"strategy": ["A", "B"]}, sys.argv[1], int(sys.argv[2])
    sweep(find_model("fire_fighting"), grid, seeds=seeds, steps=400, out=out, jobs=2)
"""


def lines_in(ledger):
    return ledger.read_bytes().count(b"\n") if ledger.exists() else 0


def environment():
    """The environment of a process that imports what this one does."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[2]), *sys.path])}


def started(tmp_path, folder, seeds):
    script = tmp_path / "driver.py"
    script.write_text(DRIVER)
    with (tmp_path / "errors").open("w") as errors:
        return subprocess.Popen([sys.executable, script, folder, str(seeds)], env=environment(), stderr=errors)


def workers_of(driver):
    command = ["pgrep", "-P", str(driver.pid), "-f", "popen_loky"]
    return [int(number) for number in subprocess.run(command, capture_output=True, check=False).stdout.split()]


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
        for worker in workers:
            os.kill(worker, signal.SIGKILL)
        with ledger.open("ab") as file:
            file.write(b'00000000 {"key": "torn')  # as a kill in the midst of a line would
        driver = started(tmp_path, folder, seeds)
    assert driver.wait(timeout=300) == 0, (tmp_path / "errors").read_text()
    return folder / "runs.parquet", ledger


def check_killed_sweep(tmp_path, seeds, kills):
    whole = sweep(FIRE, {"strategy": ["A", "B"]}, seeds=seeds, steps=400, out=tmp_path / "whole", jobs=2).path
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
from mesa_swarm.experiments.source import source_hash
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
    done = subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=120, check=False)
    noticed, said = done.stdout.splitlines() or ["", done.stderr]
    assert said == "12 0 False"
    seconds, kept = noticed.split()
    assert float(seconds) < 5
    assert 3 <= int(kept) < 12
    assert (tmp_path / "cluster" / "runs.parquet").read_bytes() == whole.read_bytes()


# ---- the ledger


def test_the_ledger_gives_back_what_it_took_whatever_the_order(tmp_path):
    order = np.random.default_rng(1).permutation(3_000)
    with Ledger(tmp_path / "l") as ledger:
        ledger._file.flush()
        for number in order[:1500]:
            ledger.append(key(number), Outcome(steps=int(number)))
        assert all((key(number) in ledger) == (number in set(order[:1500])) for number in range(0, 3_000, 7))
    with Ledger(tmp_path / "l") as ledger:
        assert all(ledger.outcome(key(number)).steps == number for number in order[:1500])
        assert key(order[1500]) not in ledger


@pytest.mark.parametrize("ending", ["00", "0000", "ab00"])
def test_keys_that_end_in_zeros_are_told_apart(tmp_path, ending):
    keys = ["11" * (16 - len(end) // 2) + end for end in (ending, "00" * 3, "0a", "")]
    with Ledger(tmp_path / "l") as ledger:
        for steps, one in enumerate(dict.fromkeys(keys)):
            ledger.append(one, Outcome(steps=steps))
    with Ledger(tmp_path / "l") as ledger:
        assert [ledger.outcome(one).steps for one in dict.fromkeys(keys)] == list(range(len(set(keys))))


@pytest.mark.parametrize("kept", range(1, 60, 7))
def test_a_torn_line_is_cut_off_and_the_run_done_again(tmp_path, kept):
    with Ledger(tmp_path / "l") as ledger:
        ledger.append(key(1), Outcome(steps=1))
        whole = (tmp_path / "l").stat().st_size
        ledger.append(key(2), Outcome(steps=2))
    os.truncate(tmp_path / "l", whole + kept)
    with Ledger(tmp_path / "l") as ledger:
        assert (key(1) in ledger, key(2) in ledger) == (True, False)
        assert (tmp_path / "l").stat().st_size == whole
        ledger.append(key(2), Outcome(steps=2))
    with Ledger(tmp_path / "l") as ledger:
        assert ledger.outcome(key(2)).steps == 2


def test_a_line_that_the_disk_spoilt_counts_as_never_written(tmp_path):
    with Ledger(tmp_path / "l") as ledger:
        for number in range(3):
            ledger.append(key(number), Outcome(steps=number))
    lines = (tmp_path / "l").read_bytes().splitlines(keepends=True)
    (tmp_path / "l").write_bytes(b"".join([lines[0], lines[1].replace(b'"steps": 1', b'"steps": 7'), lines[2]]))
    with Ledger(tmp_path / "l") as ledger:
        assert [key(number) in ledger for number in range(3)] == [True, False, True]


def test_two_sweeps_cannot_write_to_one_ledger(tmp_path):
    with Ledger(tmp_path / "l"), pytest.raises(SwarmError, match="is being written by another sweep"):
        Ledger(tmp_path / "l")


# ---- samples


def test_a_grid_has_every_combination_and_the_last_name_varies_fastest():
    assert [tuple(point.values()) for point in grid(FIRE, GRID)] == [("A", 2), ("A", 3), ("B", 2), ("B", 3)]


@pytest.mark.parametrize("kind", ["latin_hypercube", "sobol"])
def test_a_sample_has_one_point_in_each_slice_of_every_range(kind):
    points = Sample(kind, {"k1": (0.0, 64.0), "k3": (1.0, 2.0)}, points=64, rng=3).settings(FIRE)
    assert sorted(int(point["k1"]) for point in points) == list(range(64))
    assert sorted(int((point["k3"] - 1) * 64) for point in points) == list(range(64))


def test_a_sample_depends_on_its_seed_only():
    ranges = {"k1": (0.0, 1.0)}
    one, same, other = (Sample("sobol", ranges, points=8, rng=rng).settings(FIRE) for rng in (1, 1, 2))
    assert one == same != other


def test_whole_numbers_of_a_sample_reach_both_ends_equally_often():
    points = Sample("latin_hypercube", {"n_robots": (3, 6)}, points=400).settings(FIRE)
    assert Counter(point["n_robots"] for point in points) == {3: 100, 4: 100, 5: 100, 6: 100}
