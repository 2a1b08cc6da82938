"""What is compiled while a user waits: counted truly, up to a total that is known before."""

import subprocess
import sys
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import types

from mesa_swarm.base import work_line as work_done
from mesa_swarm.base.progress import progress_bar
from mesa_swarm.kernels import code_files, compiling
from mesa_swarm.kernels.compiling import (
    Compilation,
    compiling_progress,
    name_of,
    needed_by,
    needed_functions,
    stored_functions,
)
from mesa_swarm.kernels.digests import FUNCTIONS
from mesa_swarm.model.gallery import find_model, gallery_names
from mesa_swarm.swarm_model import SwarmModel
from support.compiled_rooms import import_compiled_rooms
from tests.support.compiled_functions import compiled_by

FIRST = (types.float64,)


@pytest.fixture
def functions(monkeypatch, tmp_path):
    """Three functions that a model needs, and an empty folder for their code."""
    monkeypatch.setattr(code_files, "list_folders", lambda: (tmp_path,))
    made = [SimpleNamespace(__module__="mesa_swarm.geometry.made", __qualname__=name) for name in ("a", "b", "c")]
    names = [name_of(function, FIRST) for function in made]
    table = {compiling.EVERY: names[:1], "boids": names[1:]}
    stored = SimpleNamespace(_cache=SimpleNamespace(digest=lambda: "digest"))
    for name, value in {"_table": lambda: table, "FUNCTIONS": Among(made), "function_named": lambda _: stored}.items():
        monkeypatch.setattr(compiling, name, value)
    return made


class Among(list):
    """The functions that are counted."""


def compile_one(compilation, function, shown):
    """Act as Numba does when it compiles, and store what is shown."""
    about = SimpleNamespace(py_func=function)
    for report in (compilation.on_start, compilation.on_end):
        report(SimpleNamespace(data={"dispatcher": about, "args": FIRST}))
        shown.append(compilation.text())
    if function.__module__:
        code_files.write_code(compiling._file_of(name_of(function, FIRST)), b"code")


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_the_count_of_a_model_of_the_gallery_rises_by_one_from_0_and_ends_at_its_total(functions, order):
    compilation, shown = Compilation(), []
    compilation.expect(find_model("boids"))
    for place in order:
        compile_one(compilation, functions[place], shown)
    zero, one, two = (compiling_progress(done, 3) for done in range(3))
    assert shown == [zero, one, one, two, two, ""]


def test_what_another_process_has_compiled_is_not_counted(functions):
    shown = []
    compile_one(Compilation(), functions[1], [])
    later = Compilation()
    later.expect(find_model("boids"))
    assert later.lacks(find_model("boids"))
    compile_one(later, functions[0], shown)
    assert shown == [compiling_progress(0, 2), compiling_progress(1, 2)]
    compile_one(later, functions[2], [])
    assert not later.lacks(find_model("boids"))
    names = {name_of(function, FIRST) for function in functions}
    assert stored_functions({*names, "geometry.made.d float64"}) == names


def test_code_that_is_damaged_on_disk_is_missing(functions, tmp_path):
    compile_one(Compilation(), functions[0], [])
    (file,) = tmp_path.iterdir()
    name = name_of(functions[0], FIRST)
    file.write_bytes(file.read_bytes()[:-1])
    assert stored_functions([name]) == set()
    compile_one(Compilation(), functions[0], [])
    assert stored_functions([name]) == {name}


def test_of_a_model_of_ones_own_the_total_is_a_lower_bound_that_rises_with_the_count(functions):
    compilation, shown = Compilation(), []
    compilation.expect(SwarmModel)
    for function in functions:
        compile_one(compilation, function, shown)
    counts = [(0, 1), (1, 1), (1, 1), (2, 2), (2, 2), (3, 3)]
    assert shown == [compiling_progress(done, total, exact=False) for done, total in counts]
    assert not Compilation().lacks(SwarmModel)


def test_a_function_of_a_users_is_not_counted(functions):
    compilation, shown = Compilation(), []
    compilation.expect(find_model("boids"))
    compile_one(compilation, SimpleNamespace(__module__=None, __qualname__="mine"), shown)
    assert shown == [""] * 2
    assert not compilation.compiled


def test_a_subclass_needs_at_least_what_its_model_of_the_gallery_needs():
    boids = find_model("boids")
    own = type("Own", (boids,), {})
    names, exact = needed_by(base.__module__ for base in boids.__mro__)
    assert exact
    assert needed_by(base.__module__ for base in own.__mro__) == (names, False)
    assert set(names) > set(needed_by(["mine"])[0])


def test_a_text_stands_in_place_of_the_innermost_bar_until_work_is_done(capsys, monkeypatch):
    monkeypatch.setattr(work_done, "always_drawn", True)
    with progress_bar(3, "runs", is_shown=True), progress_bar(4, "steps", is_shown=True) as bar:
        compiling.note(compiling_progress(34, 60))
        assert "\rcompiling, once per installation: 34 of 60" in capsys.readouterr().err
        assert str(bar) == "compiling, once per installation: 34 of 60"
        bar.update()
        assert str(bar).startswith(" 25 % |")
        compiling.note("compiling")
        compiling.note("")
        assert str(bar).startswith(" 25 % |")


def test_without_a_bar_nothing_is_shown(capsys):
    with progress_bar(3, "runs", is_shown=False):
        compiling.note(compiling_progress(34, 60))
    assert capsys.readouterr() == ("", "")


@given(st.sampled_from([(types.float64, types.int64), (types.Array(types.float64, 2, "C"), types.none)]))
def test_names_depend_on_the_types_and_on_nothing_else(arguments):
    function = next(iter(FUNCTIONS))
    assert name_of(function, arguments) == name_of(function, list(arguments))
    assert name_of(function, arguments) != name_of(function, arguments[::-1])
    read_only = types.Array(types.float64, 2, "C", readonly=True)
    assert name_of(function, [read_only]) != name_of(function, [types.Array(types.float64, 2, "C")])


def test_what_is_listed_as_needed_are_functions_of_the_package_by_every_model_of_the_gallery():
    import_compiled_rooms()
    known = {name_of(function, FIRST).partition(" ")[0] for function in FUNCTIONS}
    needed = needed_functions()
    assert sorted(needed) == gallery_names(), "run: python tests/support/compiled_functions.py"
    for names in needed.values():
        assert {name.partition(" ")[0] for name in names} <= known, "run: python tests/support/compiled_functions.py"


CALLED = """
import gc, sys
from numba.core.registry import CPUDispatcher
from mesa_swarm.experiments.warm_up import compile_for
from mesa_swarm.kernels.digests import FUNCTIONS
from mesa_swarm.kernels.compiling import name_of
compile_for(sys.argv[1])
for one in gc.get_objects():
    if isinstance(one, CPUDispatcher) and one.py_func in FUNCTIONS:
        for types in one.overloads:
            print(name_of(one.py_func, types))
"""


@pytest.mark.slow
@pytest.mark.parametrize("model", ["fire_fighting", "shepherding"])
def test_what_a_model_calls_is_listed_as_needed(model):
    done = subprocess.run([sys.executable, "-c", CALLED, model], capture_output=True, text=True, check=True)
    called = set(done.stdout.splitlines())
    assert called
    assert called <= set(needed_functions()[model]), "run: python tests/support/compiled_functions.py"


@pytest.mark.long
def test_what_is_listed_as_needed_is_compiled_when_nothing_is_there_and_nothing_when_it_is(tmp_path):
    assert set(compiled_by("fire_fighting", tmp_path)) == set(needed_functions()["fire_fighting"])
    assert compiled_by("fire_fighting", tmp_path) == []
