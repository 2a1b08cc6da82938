"""Compiled functions: NumPy's arithmetic, stored on disk, and never stale."""

import math
import os
import subprocess
import sys

import numba
import pytest

from mesa_swarm.kernels import code_files
from mesa_swarm.kernels.code_files import FOLDER, list_folders
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.machines import name_machine


@compiled
def quotient(a, b):
    return a / b


def test_a_division_by_zero_is_infinite_as_numpys_is_and_raises_nothing():
    assert quotient(1.0, 0.0) == math.inf
    assert math.isnan(quotient(0.0, 0.0))


def test_machine_code_is_stored_in_the_cache_of_these_sources_and_numbas_own_setting_stays():
    before = numba.config.CACHE_DIR
    assert compiled(quotient.py_func).stats.cache_path == str(list_folders()[-1])
    assert (list_folders()[0].parent.name, list_folders()[0].name) == (FOLDER, name_machine())
    assert before == numba.config.CACHE_DIR


def test_code_for_different_types_that_two_processes_store_at_once_is_not_mixed_up(tmp_path, monkeypatch):
    monkeypatch.setattr(code_files, "list_folders", lambda: (tmp_path,))
    one, other = compiled(quotient.py_func), compiled(quotient.py_func)
    assert (one(1, 2), other(1.0, 2.0)) == (0.5, 0.5)
    again = compiled(quotient.py_func)
    assert (again(1, 2), again(1.0, 2.0)) == (0.5, 0.5)
    assert sum(again.stats.cache_hits.values()) == 2


def test_a_function_whose_source_is_in_no_file_is_compiled_and_not_stored():
    space = {"__name__": "typed"}
    exec("def double(x):\n    return 2 * x\n", space)
    double = compiled(space["double"])
    assert double(21) == 42
    assert double.stats.cache_path is None


def test_a_function_in_a_file_that_has_changed_is_compiled_anew(tmp_path, monkeypatch):
    monkeypatch.setattr(code_files, "list_folders", lambda: (tmp_path / "code",))
    source, results = tmp_path / "mine.py", []
    for factor in (2, 2, 3):
        source.write_text(f"def times(x):\n    return {factor} * x\n")
        space = {"__name__": "mine"}
        exec(compile(source.read_text(), source, "exec"), space)
        times = compiled(space["times"])
        results.append((times(10), sum(times.stats.cache_hits.values())))
    assert results == [(20, 0), (20, 1), (30, 0)]


@pytest.mark.slow
def test_a_compiler_that_is_switched_off_is_named_in_one_line():
    command = [sys.executable, "-m", "mesa_swarm", "run", "boids", "--steps", "1"]
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    ended = subprocess.run(command, env=env, check=False, capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (2, "")
    (line,) = ended.stderr.splitlines()
    assert line.startswith("mesa-swarm: Numba's compiler is switched off by NUMBA_DISABLE_JIT")
