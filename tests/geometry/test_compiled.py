"""Compiled functions: NumPy's arithmetic, stored on disk, and a few caches of older sources at most."""

import math
import os
import subprocess
import sys

import numba
import pytest

from mesa_swarm.geometry import compiled as module
from mesa_swarm.geometry.compiled import MOST_CACHES, SeparateFiles, compiled


@compiled
def quotient(a, b):
    return a / b


def test_a_division_by_zero_is_infinite_as_numpys_is_and_raises_nothing():
    assert quotient(1.0, 0.0) == math.inf
    assert math.isnan(quotient(0.0, 0.0))


def test_machine_code_is_stored_in_the_cache_of_these_sources_and_numbas_own_setting_stays():
    before = numba.config.CACHE_DIR
    assert compiled(quotient.py_func).stats.cache_path.startswith(str(module._CACHE))
    assert before == numba.config.CACHE_DIR


def test_code_that_two_processes_store_at_once_for_different_types_is_not_mixed_up(tmp_path, monkeypatch):
    one, other = (SeparateFiles(str(tmp_path), "f", "stamp") for _ in range(2))
    for files in (one, other):  # as if both had read the index before either has written it
        monkeypatch.setattr(files, "_load_index", dict)
    one.save(("int",), "for int")
    other.save(("float",), "for float")
    files = SeparateFiles(str(tmp_path), "f", "stamp")
    assert (files.load(("int",)), files.load(("float",))) == (None, "for float")
    files.save(("int",), "for int")
    assert [files.load((name,)) for name in ("int", "float", "str")] == ["for int", "for float", None]


@pytest.mark.parametrize("exists", [False, True])
def test_a_new_cache_leaves_the_newest_of_the_old_ones_and_an_old_one_leaves_all(tmp_path, monkeypatch, exists):
    for age in range(7):
        folder = tmp_path / f"kernels-{age * 37 % 7}"
        folder.mkdir()
        os.utime(folder, (1000 - age, 1000 - age))
    monkeypatch.setattr(module, "_CACHES", tmp_path)
    monkeypatch.setattr(module, "_CACHE", tmp_path / ("kernels-0" if exists else "kernels-new"))
    module._drop_old_caches()
    newest = {f"kernels-{age * 37 % 7}" for age in range(7 if exists else MOST_CACHES - 1)}
    assert {folder.name for folder in tmp_path.iterdir()} == newest


def test_the_stamp_is_that_of_every_source_that_may_hold_a_compiled_function():
    sources = list(module.PACKAGE.glob("*/*.py"))
    holding = {path.parent.name for path in sources if "geometry.compiled import" in path.read_text(encoding="utf-8")}
    assert holding <= set(module.FLOORS)
    assert (module.PACKAGE / "geometry" / "compiled.py").samefile(module.__file__)


def test_a_compiler_that_is_switched_off_is_named_in_one_line():
    command = [sys.executable, "-m", "mesa_swarm.cli", "run", "boids", "--steps", "1"]
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    ended = subprocess.run(command, env=env, check=False, capture_output=True, text=True)
    assert (ended.returncode, ended.stdout) == (2, "")
    (line,) = ended.stderr.splitlines()
    assert line.startswith("mesa-swarm: Numba's compiler is switched off by NUMBA_DISABLE_JIT")
