"""Warm-up: each model is compiled for in a process of its own, what is there stays, and a failure is one line."""

import pytest

from mesa_swarm import work_done
from mesa_swarm.experiments import warm_up as module
from mesa_swarm.experiments.pool import WorkerDiedError
from mesa_swarm.experiments.warm_up import STEPS, WarmUp, compile_for, missing_functions, warm_up
from mesa_swarm.geometry import compiling

# What a process does in place of compiling for a model.
LISTS = "import sys; open({list!r}, 'a').write({lines!r})"


@pytest.fixture
def needed(monkeypatch, tmp_path):
    """Models that need functions, none of which is compiled, and how their processes list them."""
    table = {"many": ["a", "b", "c"], "few": ["c"], "other": ["d"]}
    listed = tmp_path / "compiled.txt"
    monkeypatch.setattr(module, "needed_functions", lambda: table)
    monkeypatch.setattr(compiling, "COMPILED", listed)
    monkeypatch.setattr(module, "COMPILED", listed)
    started = []

    def script(text):
        model = text.split("'")[1]
        started.append(model)
        lines = "".join(f"{compiling._machine()} {name}\n" for name in table[model])
        return LISTS.format(list=str(listed), lines=lines)

    monkeypatch.setattr(module, "ending_with_us", script)
    return started


def test_models_that_need_most_are_first_and_each_is_run_for_its_own_rules(needed, tmp_path):
    done = warm_up(jobs=1)
    assert needed == ["many", "few", "other"]
    assert (done.functions, done.folder) == (4, tmp_path)
    assert missing_functions() == {}


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_second_time_nothing_is_compiled(needed, jobs):
    warm_up(jobs=jobs)
    needed.clear()
    again = warm_up(jobs=jobs)
    assert (needed, again.functions) == ([], 0)
    assert str(again).startswith("everything is compiled already; the machine code is stored in")


def test_the_bar_counts_up_to_its_total(needed, capsys, monkeypatch):
    monkeypatch.setattr(work_done, "always_drawn", True)
    warm_up(jobs=1, progress=True)
    shown = capsys.readouterr().err
    assert "compiling, once per installation: 0 of 4" in shown
    assert shown.rstrip().endswith(f"compiling, once per installation: 4 of 4 |{'█' * 30}|")


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
    assert str(done) == f"compiled 3 functions in 1 s; they are stored in {tmp_path}"
