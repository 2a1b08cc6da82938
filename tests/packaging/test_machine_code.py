"""Machine code in wheels: compiled when they are built, read by a user's first step, and never found by others."""

import json
import shutil
import sys
from zipfile import ZipFile

import pytest

import backend
from build_hook import CODE, LEVELS, compile_levels
from mesa_swarm.kernels.machines import list_levels, list_machines
from support.installing import ROOT, build, environment, pip, run

MODEL = "fire_fighting"
FIRST_STEP = f"""
from mesa_swarm.kernels.compiling import compilation
from mesa_swarm.model.gallery import find_model
find_model({MODEL!r})(rng=1).run(1)
print(len(compilation.compiled))
"""


@pytest.fixture
def builder(monkeypatch):
    """A builder that runs in the repository, with no setting of machine code."""
    monkeypatch.chdir(ROOT)
    monkeypatch.delenv(LEVELS, raising=False)
    monkeypatch.delenv(backend.PIP, raising=False)
    return monkeypatch


def test_builders_compile_for_all_levels_unless_pip_installs_or_the_variable_decides(builder):
    assert backend.LEVELS == LEVELS
    assert backend.choose_levels() == "all"
    builder.setenv(backend.PIP, "a folder")
    assert backend.choose_levels() == "none"
    builder.setenv(LEVELS, "x86-64-v3")
    assert backend.choose_levels() == "x86-64-v3"


def test_only_to_compile_a_builder_needs_what_the_package_needs(builder):
    assert any(name.startswith("numba") for name in backend.get_requires_for_build_wheel())
    builder.setenv(LEVELS, "none")
    assert not any(name.startswith("numba") for name in backend.get_requires_for_build_wheel())
    builder.setenv(LEVELS, "all")
    assert not any(name.startswith("numba") for name in backend.get_requires_for_build_editable())


@pytest.mark.slow
def test_a_level_that_this_processor_lacks_is_refused_in_one_line(tmp_path):
    with pytest.raises(ValueError, match=r"^MESA_SWARM_MACHINE_CODE is 'x86-64-v9'; expected none, all, or some of: "):
        compile_levels(ROOT, ["x86-64-v9"], tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(not list_levels(), reason="for this family of processors no code is published")
def test_with_a_wheel_that_has_machine_code_the_first_step_compiles_nothing(sources, tmp_path, monkeypatch):
    shutil.copytree(sources, tmp_path / "sources")
    # Of one model, so that the test is quick.
    file = tmp_path / "sources" / "mesa_swarm" / "kernels" / "needed.json"
    needed = json.loads(file.read_text())
    file.write_text(json.dumps({name: needed[name] for name in ("every", MODEL)}))
    monkeypatch.setenv(LEVELS, list_levels()[0])
    wheel = build("wheel", tmp_path / "sources", tmp_path / "wheel")
    version = f"cp{sys.version_info[0]}{sys.version_info[1]}"
    assert wheel.name.split("-")[2:4] == [version, version]
    folders = {name.split("/")[2] for name in ZipFile(wheel).namelist() if name.startswith(f"{CODE}/")}
    assert folders == {list_machines()[0]}
    python = environment(tmp_path / "environment")
    pip(python, wheel)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    assert run(python, "-c", FIRST_STEP, cwd=tmp_path).split() == ["0"]
    assert list((tmp_path / "cache").rglob("*.nbc")) == []
