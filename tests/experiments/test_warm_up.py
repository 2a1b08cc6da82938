"""Warm-up: each model is compiled for in a process of its own, what is there stays, and a failure is one line."""

from pathlib import Path

import pytest

from mesa_swarm.base import work_line as work_done
from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.experiments import warm_up as module
from mesa_swarm.experiments.warm_up import STEPS, WarmUp, compile_for, missing_functions, warm_up
from mesa_swarm.experiments.worker_pool import WorkerDiedError
from mesa_swarm.kernels import code_files, compiling

# What a process does in place of compiling for a model.
STORES = (
    "from pathlib import Path; from mesa_swarm.kernels import code_files; "
    "code_files.list_folders = lambda: (Path({folder!r}),); "
    "[code_files.write_code(name, b'code') for name in {files!r}]"
)


@pytest.fixture
def needed(monkeypatch, tmp_path):
    """Models that need functions, none of which is compiled, and how their processes store them."""
    table = {"many": ["a", "b", "c"], "few": ["c"], "other": ["d"]}
    monkeypatch.setattr(module, "needed_functions", lambda: table)
    monkeypatch.setattr(compiling, "_file_of", lambda name: f"{name}.nbc")
    for each in (module, code_files):
        monkeypatch.setattr(each, "list_folders", lambda: (tmp_path,))
    started = []

    def script(text):
        model = text.split("'")[1]
        started.append(model)
        return STORES.format(
            folder=str(tmp_path), files=[*map(compiling._file_of, table[model]), f"custom/{model}.nbc"]
        )

    monkeypatch.setattr(module, "ending_with_us", script)
    return started


@pytest.mark.slow
def test_models_that_need_most_are_first_and_each_is_run_for_its_own_rules(needed, tmp_path):
    done = warm_up(jobs=1)
    assert needed == ["many", "few", "other"]
    assert (done.functions, done.folder, done.before) == (4, tmp_path, ())
    assert missing_functions() == {}


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_second_time_nothing_is_compiled(needed, tmp_path, jobs):
    warm_up(jobs=jobs)
    needed.clear()
    again = warm_up(jobs=jobs)
    assert (needed, again.functions) == ([], 0)
    assert str(again) == f"everything is compiled already; the machine code is stored in {tmp_path}"


@pytest.mark.slow
def test_damaged_code_is_compiled_again_and_counted(needed, tmp_path):
    warm_up(jobs=1)
    needed.clear()
    (tmp_path / compiling._file_of("c")).write_bytes(b"")
    again = warm_up(jobs=1)
    assert (needed, again.functions, again.before) == (["many", "few"], 1, (tmp_path,))
    assert warm_up(jobs=1).functions == 0


@pytest.mark.slow
def test_damaged_code_of_rules_is_compiled_again_by_whatever_model_has_them(needed, tmp_path):
    warm_up(jobs=1)
    needed.clear()
    (tmp_path / "custom" / "other.nbc").write_bytes(b"damage")
    (tmp_path / "custom" / "of_a_user.nbc").write_bytes(b"damage")
    again = warm_up(jobs=1)
    assert (needed, again.functions) == (["many", "few", "other"], 1)
    needed.clear()
    assert (warm_up(jobs=1).functions, needed) == (0, [])


def test_where_nothing_can_be_stored_nothing_is_begun_and_the_reason_is_one_line(needed, monkeypatch):
    monkeypatch.setattr(module, "why_not_stored", lambda: "machine code cannot be stored (here: denied); do this")
    with pytest.raises(InvalidValueError, match=r"^machine code cannot be stored \(here: denied\); do this$"):
        warm_up(jobs=1)
    assert needed == []


def test_a_process_that_cannot_store_what_it_compiles_fails(monkeypatch):
    monkeypatch.setattr("mesa_swarm.swarm_model.SwarmModel.run", lambda model, count: model)
    monkeypatch.setattr(module, "problems", ["machine code cannot be stored (here: disk full); do this"])
    with pytest.raises(SwarmError, match="disk full"):
        compile_for("boids")


@pytest.mark.slow
def test_the_bar_counts_up_to_its_total(needed, capsys, monkeypatch):
    monkeypatch.setattr(work_done, "always_drawn", True)
    warm_up(jobs=1, progress=True)
    shown = capsys.readouterr().err
    assert "compiling, once per installation: 0 of 4" in shown
    assert shown.rstrip().endswith(f"compiling, once per installation: 4 of 4 |{'█' * 30}|")


@pytest.mark.slow
def test_a_process_that_fails_is_one_line_with_its_reason_and_what_others_compiled_stays(needed, monkeypatch):
    good = module.ending_with_us
    monkeypatch.setattr(module, "ending_with_us", lambda text: "1 / 0" if "other" in text else good(text))
    with pytest.raises(WorkerDiedError, match=r"^compiling for other failed: ZeroDivisionError: division by zero$"):
        warm_up(jobs=1)
    assert list(missing_functions()) == ["other"]


def test_a_process_that_is_killed_is_one_line(needed, monkeypatch):
    monkeypatch.setattr(module, "ending_with_us", lambda text: "import os; os._exit(7)")
    with pytest.raises(WorkerDiedError, match="its process ended with status 7"):
        warm_up(jobs=2)


def test_a_model_is_compiled_for_by_its_first_steps(monkeypatch):
    steps = []
    monkeypatch.setattr("mesa_swarm.swarm_model.SwarmModel.run", lambda model, count: steps.append(count))
    compile_for("boids")
    assert steps == [STEPS]


def test_what_was_done_is_one_line(tmp_path):
    done = WarmUp(functions=3, seconds=1.2, folder=tmp_path)
    assert str(done) == f"compiled 3 functions in 1 s; stored in {tmp_path}"
    more = WarmUp(functions=1, seconds=1.2, folder=Path("mine"), before=(Path("shared"), Path("mine")))
    assert str(more) == "compiled 1 function in 1 s; stored in mine, those of before in shared"
    none = WarmUp(functions=0, seconds=1.2, folder=Path("mine"), before=(Path("shared"), Path("mine")))
    assert str(none) == "everything is compiled already; the machine code is stored in shared and mine"
