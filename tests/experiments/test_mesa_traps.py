"""The traps of mesa.batch_run, and that sweep does not have them: see docs/mesa.md."""

import gc
import inspect
import os
import re
import subprocess
import sys
import tracemalloc
from pathlib import Path

import mesa
import pytest

from mesa_swarm.experiments.sweep import sweep
from support.failing_models import Dying, Raising
from support.trap_models import Counted
from support.waiting import wait_until

ROOT = Path(__file__).parent.parent.parent
PAGE = (ROOT / "docs" / "mesa.md").read_text()
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
IS_THERE = hasattr(mesa, "batch_run")
TAKES_SEEDS = IS_THERE and "rng" in inspect.signature(mesa.batch_run).parameters
with_batch_run = pytest.mark.skipif(not IS_THERE, reason="Mesa 4 has no batch_run")
old_mesa = pytest.mark.skipif(TAKES_SEEDS or not IS_THERE, reason="this Mesa has it right, or no batch_run")
QUIET = {"number_processes": 1, "display_progress": False}


def seeded(settings, seeds):
    """Return parameters and seeds as this Mesa takes them."""
    return {"parameters": settings, "rng": seeds} if TAKES_SEEDS else {"parameters": {**settings, "rng": seeds}}


def test_mesa_is_one_of_the_versions_of_the_page():
    assert mesa.__version__.startswith(("3.3", "3.4", "3.5", "4.0"))


@pytest.mark.slow
@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.strip().splitlines()[-1][:30])
def test_every_block_of_the_page_runs(block, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    page = {"__name__": "page"}
    exec(compile(block, "docs/mesa.md", "exec"), page)  # an error of the block fails the test
    assert page.keys() - {"__name__", "__builtins__"}


def test_the_page_has_blocks_to_run_and_names_this_file():
    assert len(BLOCKS) == 5
    assert f"tests/experiments/{Path(__file__).name}" in PAGE


# ---- one step too many


@old_mesa
def test_batch_run_of_mesa_3_3_takes_one_step_more_than_asked():
    (row,) = mesa.batch_run(Counted, {}, max_steps=5, **QUIET)
    assert row["taken"] == 6


@pytest.mark.skipif(not TAKES_SEEDS, reason="Mesa 3.3 takes one more, and Mesa 4 has no batch_run")
def test_batch_run_of_mesa_3_5_takes_as_many_steps_as_asked():
    (row,) = mesa.batch_run(Counted, {}, max_steps=5, **QUIET)
    assert row["taken"] == 5


def test_sweep_takes_as_many_steps_as_asked(tmp_path):
    table = sweep(Counted, seeds=2, steps=5, out=tmp_path, jobs=1).frame()
    assert table["taken"].tolist() == table["steps"].tolist() == [5, 5]


# ---- identical runs


@old_mesa
def test_batch_run_of_mesa_3_3_repeats_one_run_if_the_seed_is_fixed():
    rows = mesa.batch_run(Counted, {"rng": 7}, iterations=3, max_steps=3, **QUIET)
    assert len({row["place"] for row in rows}) == 1


@with_batch_run
def test_batch_run_without_a_seed_gives_runs_that_no_caller_can_have_again():
    twice = [mesa.batch_run(Counted, {}, max_steps=3, **QUIET)[0] for _ in range(2)]
    assert twice[0]["place"] != twice[1]["place"]
    assert twice[0].get("rng") is None


def test_sweep_gives_different_runs_that_any_caller_can_have_again(tmp_path):
    first, second = (sweep(Counted, seeds=3, steps=3, out=tmp_path / name, jobs=1).frame() for name in "ab")
    assert len(set(first["place"])) == 3
    assert first.equals(second)


# ---- everything in memory


def kept_by(work):
    """Return the bytes that are taken, with what it returned, once garbage is collected."""
    gc.collect()
    tracemalloc.start()
    try:
        made = work()
        gc.collect()
        size = tracemalloc.get_traced_memory()[0]
        del made
        return size
    finally:
        tracemalloc.stop()


@with_batch_run
@pytest.mark.long
def test_batch_run_keeps_every_row_of_every_run_in_memory_and_sweep_none(tmp_path):
    def batch(runs):
        odd = {"odd": list(range(runs))}
        return mesa.batch_run(Counted, odd, max_steps=20, data_collection_period=1, **QUIET)

    def swept(runs):
        odd = {"odd": list(range(runs))}
        return sweep(Counted, odd, seeds=1, steps=20, out=tmp_path / str(runs), jobs=1)

    few, many = 20, 320
    grown = {}
    for work in (batch, swept):
        work(2)
        grown[work] = (kept_by(lambda work=work: work(many)) - kept_by(lambda work=work: work(few))) / (many - few)
    assert grown[batch] > 5_000  # 20 rows of each run
    assert grown[swept] < 200


# ---- what goes wrong


@with_batch_run
def test_batch_run_ends_with_the_first_error_and_sweep_goes_on(tmp_path):
    settings = {"diary": str(tmp_path / "diary")}
    with pytest.raises(RuntimeError, match="it broke"):
        mesa.batch_run(Raising, **seeded(settings, [1, 2, 3]), max_steps=1, **QUIET)
    made = sweep(Raising, seeds=3, steps=1, settings=settings, out=tmp_path / "out", jobs=1)
    assert (made.runs, made.failed) == (3, 1)


HANG = """
import mesa
from support.failing_models import Dying
if __name__ == "__main__":
    mesa.batch_run(Dying, number_processes=2, max_steps=1, display_progress=False, **{WANTED})
"""


@with_batch_run
@pytest.mark.long
def test_batch_run_waits_for_ever_if_a_worker_dies_and_sweep_does_not(tmp_path):
    diary = tmp_path / "diary"
    script = tmp_path / "hang.py"
    script.write_text(HANG.replace("{WANTED}", repr(seeded({"diary": str(diary)}, [1, 2, 3]))))
    path = os.pathsep.join([str(ROOT / "tests"), str(ROOT)])
    child = subprocess.Popen(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    try:
        wait_until(lambda: diary.exists() and len(diary.read_text().splitlines()) >= 3)  # all were begun
        with pytest.raises(subprocess.TimeoutExpired):
            child.communicate(timeout=20)
        assert {line.split()[0] for line in diary.read_text().splitlines()} == {"1", "2", "3"}
    finally:
        os.killpg(child.pid, 9)
        child.communicate()
    settings = {"diary": str(tmp_path / "ours")}
    made = sweep(Dying, seeds=3, steps=1, settings=settings, out=tmp_path / "out", jobs=2)
    assert (made.runs, made.failed) == (3, 1)
