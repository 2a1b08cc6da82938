"""Machine code that came with the package: read on processors that have its level, and never for another machine."""

import os
import shutil
import subprocess
import sys

import numba
import pytest

from mesa_swarm.kernels import code_files, machines
from mesa_swarm.kernels.code_files import FOLDER
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.machines import list_levels, list_machines, name_machine, settings_for

V2 = "+cx16,+popcnt,+sahf,+sse3,+sse4.1,+sse4.2,+ssse3"
V3 = f"{V2},+avx,+avx2,+bmi,+bmi2,+f16c,+fma,+lzcnt,+movbe,+xsave"
CACHED = list_machines, name_machine, code_files.list_folders, code_files.why_unwritable


@pytest.fixture
def become(monkeypatch):
    """Let Numba compile for another processor, by its family and features; also for the levels of a user's settings."""

    def change(family, features, processor="theirs"):
        monkeypatch.setattr(machines, "_describe_target", lambda: (f"{family}-unknown-linux", processor, features))
        for function in CACHED:
            function.cache_clear()

    yield change
    monkeypatch.undo()
    for function in CACHED:
        function.cache_clear()


@pytest.mark.parametrize(
    ("family", "features", "levels"),
    [
        ("x86_64", f"+64bit,{V3},-avx512f", ["x86-64-v3", "x86-64-v2"]),
        ("x86_64", V3.replace("+fma", "-fma"), ["x86-64-v2"]),
        ("x86_64", V3.replace("+ssse3", "-ssse3"), []),
        ("x86_64", "", []),
        ("aarch64", "+neon", ["arm64"]),
        ("arm64", "", ["arm64"]),
        ("powerpc64le", "+vsx", []),
    ],
)
def test_a_processor_has_the_levels_of_which_it_has_every_feature_best_first(become, family, features, levels):
    become(family, features)
    assert list(list_levels()) == levels
    assert len(set(list_machines())) == len(levels)


def test_a_process_that_compiles_for_a_level_names_its_machine_as_those_do_that_have_the_level(become):
    become("x86_64", f"+64bit,{V3}")
    names, settings = list_machines(), [settings_for(level) for level in list_levels()]
    for name, words in zip(names, settings, strict=True):
        become("x86_64", words["NUMBA_CPU_FEATURES"], words["NUMBA_CPU_NAME"])
        assert name_machine() == name


@pytest.mark.parametrize(
    ("place", "name", "value"),
    [
        (numba, "__version__", "0.1"),
        (machines.ll, "llvm_version_info", (1, 0, 0)),
        (machines.settings, "USING_SVML", "another"),
        (machines.sysconfig, "get_config_var", lambda _: ".cpython-399-x86_64-linux-gnu.so"),
    ],
)
def test_the_code_of_another_python_numba_or_llvm_is_that_of_another_machine(become, monkeypatch, place, name, value):
    become("x86_64", V3)
    before = {name_machine(), *list_machines()}
    monkeypatch.setattr(place, name, value)
    become("x86_64", V3)
    assert len(before | {name_machine(), *list_machines()}) == 2 * len(before)


@compiled
def tripled(x):
    return 3 * x


def tripled_anew():
    """Call a new dispatcher of a function; return whether the code was on disk."""
    function = compiled(tripled.py_func)
    assert function(2) == 6
    return bool(function.stats.cache_hits)


@pytest.fixture
def shipped(become, monkeypatch, tmp_path):
    """A process with code of its own in one folder; after it was moved, an installation that came with that code."""
    monkeypatch.setattr(code_files, "HOME", tmp_path / "home")
    monkeypatch.setattr(code_files, "SHIPPED", tmp_path / "shipped")
    become("x86_64", V2, "x86-64-v2")
    assert not tripled_anew()
    (tmp_path / "home").rename(tmp_path / "shipped")
    return become


def test_code_that_came_with_the_package_is_read_where_there_is_no_other_and_stays(shipped, tmp_path):
    shipped("x86_64", V3)
    assert tripled_anew()
    assert not list(tmp_path.glob("home/**/*.nbc"))


def test_code_of_a_level_that_a_processor_lacks_is_not_read(shipped, tmp_path):
    shipped("x86_64", V2.replace("+popcnt", "-popcnt"))
    assert not tripled_anew()
    assert tripled_anew()
    assert len(list(tmp_path.glob("home/*/*.nbc"))) == 1


def test_code_in_the_folder_of_another_machine_is_not_read(shipped, tmp_path):
    (file,) = tmp_path.glob("shipped/*/*.nbc")
    shipped("x86_64", "+vsx", "x86-64-v2")
    (tmp_path / "home" / name_machine()).mkdir(parents=True)
    shutil.copy(file, tmp_path / "home" / name_machine())
    assert not tripled_anew()


def test_damaged_code_that_came_with_the_package_is_compiled_anew_and_stored_elsewhere(shipped, tmp_path):
    (file,) = tmp_path.glob("shipped/*/*.nbc")
    file.write_bytes(file.read_bytes()[:-1])
    shipped("x86_64", V3)
    assert [tripled_anew(), tripled_anew()] == [False, True]
    assert [path.name for path in tmp_path.glob("home/*/*.nbc")] == [file.name]


def test_stored_code_names_no_folder_of_the_machine_on_which_it_was_compiled(shipped, tmp_path):
    (file,) = tmp_path.glob("shipped/*/*.nbc")
    assert os.fsencode(os.path.dirname(__file__)) not in file.read_bytes()


RUN = """
import sys
from pathlib import Path
from mesa_swarm.kernels import code_files
from mesa_swarm.kernels.compiling import compilation
from mesa_swarm.model.gallery import find_model
code_files.SHIPPED = Path(sys.argv[1])
compilation.alone = True
model = find_model("boids")(rng=1).run(40)
print(model.state_hash(), len(compilation.compiled))
"""


def run_with(home, shipped, settings):
    """Return the hash of a run, and how many functions it compiled, with code of its own and code that came with it."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    variables = inherited | {"NUMBA_CACHE_DIR": str(home)} | settings
    command = [sys.executable, "-c", RUN, str(shipped)]
    done = subprocess.run(command, env=variables, capture_output=True, text=True, check=True)
    state_hash, count = done.stdout.split()
    return state_hash, int(count)


@pytest.mark.slow
@pytest.mark.skipif(not list_levels(), reason="for this family of processors no code is published")
def test_code_of_every_level_computes_the_same_bits_as_that_of_this_processor(tmp_path):
    expected, count = run_with(tmp_path / "native", tmp_path, {})
    assert count > 50
    for level in list_levels():
        compiled_for = run_with(tmp_path / level, tmp_path, settings_for(level))
        assert compiled_for == (expected, count)
        assert run_with(tmp_path / "empty", tmp_path / level / FOLDER, {}) == (expected, 0)
    # Where some is missing, it is compiled for this processor, and takes in what was compiled for the level.
    shipped = tmp_path / list_levels()[0] / FOLDER
    for path in sorted(shipped.rglob("*.nbc"))[::2]:
        path.unlink()
    state_hash, missing = run_with(tmp_path / "mixed", shipped, {})
    assert state_hash == expected
    assert 0 < missing < count
