"""Processes that help to compile: what they compile is loaded, and they end with the one that started them."""

import json
import os
import subprocess
import sys

import pytest

from mesa_swarm.kernels import compiling, precompile
from mesa_swarm.kernels.compiling import Compilation, name_of, needed_functions
from mesa_swarm.kernels.digests import FUNCTIONS
from mesa_swarm.kernels.type_names import types_in_words

COMPANION = [sys.executable, "-m", "mesa_swarm.kernels.precompile"]
ONE = "geometry.overlap.wrap_angle float64"


@pytest.mark.parametrize("model", ["fire_fighting", "boids", "learning_fires"])
def test_the_types_of_what_models_need_are_read_from_their_names(model):
    functions = {name_of(function, ()).strip(): function for function in FUNCTIONS}
    for name in needed_functions()[model]:
        function, _, words = name.partition(" ")
        if function in functions and "Literal" not in words:
            assert name_of(functions[function], types_in_words(words)) == name


@pytest.mark.parametrize("words", ["float64 Dispatcher", "Literal[int](0)", "weird"])
def test_types_that_cannot_be_made_from_their_names_are_refused(words):
    with pytest.raises(LookupError):
        types_in_words(words)


def stored(folder):
    """Return the names of the files of machine code in a folder."""
    return [path.name for path in folder.rglob("*.nbc")]


@pytest.mark.slow
def test_such_a_process_compiles_what_it_is_given_and_passes_over_what_it_cannot(tmp_path):
    settings = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_OPT": "0"}
    process = subprocess.Popen(COMPANION, env=settings, stdin=subprocess.PIPE, text=True)
    process.stdin.write(
        json.dumps(["geometry.no_such.function int64", "geometry.overlap.wrap_angle weird", ONE]) + "\n"
    )
    process.stdin.flush()
    assert process.wait(60) == 0
    process.communicate()
    assert stored(tmp_path) == [compiling._file_of(ONE)]


def test_such_a_process_ends_when_the_process_that_started_it_does(tmp_path):
    settings = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_OPT": "0"}
    process = subprocess.Popen(COMPANION, env=settings, stdin=subprocess.PIPE, text=True)
    process.communicate(json.dumps(sorted(needed_functions()["fire_fighting"])) + "\n", timeout=60)
    assert process.returncode == 0
    assert len(stored(tmp_path)) < 20


@pytest.mark.parametrize(("cores", "names", "processes"), [(1, 50, 0), (2, 19, 0), (2, 50, 1), (4, 50, 3), (64, 50, 3)])
def test_processes_share_the_names_where_cores_are_free_and_there_are_many(monkeypatch, cores, names, processes):
    started, given = [], [f"a.b{k:02}" for k in range(names)]
    monkeypatch.setattr(precompile, "count_processors", lambda: cores)
    monkeypatch.setattr(precompile, "_start_process", started.append)
    precompile.start_compiling(given)
    assert len(started) == processes
    assert sorted(name for one in started for name in one) == (given if processes else [])
    assert all(one == sorted(one, reverse=True) for one in started)


def test_where_no_process_can_be_started_all_is_compiled_by_this_one(monkeypatch):
    refused = []

    def refuse(*given, **_):
        refused.append(given)
        raise OSError("no processes here")

    monkeypatch.setattr(precompile, "count_processors", lambda: 2)
    monkeypatch.setattr(precompile.subprocess, "Popen", refuse)
    precompile.start_compiling([f"a.b{k}" for k in range(30)])
    assert len(refused) == 1


def test_what_other_processes_have_compiled_counts(monkeypatch, tmp_path):
    there = set()
    monkeypatch.setattr(compiling, "stored_functions", there.intersection)
    compilation = Compilation()
    compilation.expected = dict.fromkeys(["a", "b", "c"])
    assert compilation.text() == "compiling, once per installation: 0 of 3"
    there |= {"b", "c"}
    assert compilation.text() == "compiling, once per installation: 2 of 3"
    compilation.compiled = {"a": None}
    assert compilation.text() == ""
