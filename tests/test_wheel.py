"""The package as others install it: a wheel, away from the repository."""

import os
import shutil
import subprocess
import sys
import sysconfig
import tomllib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parent.parent
SOURCES = ("mesa_swarm", "models", "pyproject.toml", "README.md", "LICENSE")
CODE = {".py", ".pyc"}


def run(*command, cwd: Path) -> str:
    """Return what a command prints; it may see neither the repository nor this process's settings of Python."""
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=cwd, capture_output=True, text=True, timeout=300, check=False, env=clean())
    assert done.returncode == 0, done.stderr
    return done.stdout


def clean() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}


def how_to_build() -> tuple[str, ...]:
    """Return what spares pip from fetching setuptools where it is there, as new as pyproject.toml asks for."""
    (wanted,) = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    try:
        installed = int(version("setuptools").split(".")[0])
    except PackageNotFoundError:
        return ()
    return ("--no-build-isolation", "--no-index") if installed >= int(wanted.removeprefix("setuptools>=")) else ()


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """Build from a copy: setuptools leaves folders of its own beside the sources."""
    home = tmp_path_factory.mktemp("wheel")
    for name in SOURCES:
        source = ROOT / name
        if source.is_dir():
            passed_over = shutil.ignore_patterns("__pycache__", "models" if name == "mesa_swarm" else "")
            shutil.copytree(source, home / "sources" / name, ignore=passed_over)
        else:
            shutil.copy(source, home / "sources" / name)
    run(
        sys.executable, "-m", "pip", "wheel", home / "sources", "--no-deps", "-q", "-w", home, *how_to_build(), cwd=home
    )
    (built,) = home.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def program(wheel, tmp_path_factory) -> Path:
    """Install it into an environment of its own, which finds the packages that it needs where this one has them."""
    home = tmp_path_factory.mktemp("installed")
    run(sys.executable, "-m", "venv", "--without-pip", home, cwd=home)
    own = home / "lib" / f"python{sys.version_info[0]}.{sys.version_info[1]}" / "site-packages"
    for path in Path(sysconfig.get_path("purelib")).iterdir():
        if not path.name.startswith(("mesa_swarm", "__")) and path.suffix != ".pth":
            (own / path.name).symlink_to(path)
    pip = (sys.executable, "-m", "pip", f"--python={home / 'bin' / 'python'}")
    run(*pip, "install", "--no-deps", "--no-index", "-q", wheel, cwd=home)
    return home / "bin" / "mesa-swarm"


@pytest.mark.slow
class TestTheWheel:
    def test_holds_every_file_of_the_package_besides_code(self, wheel):
        package = ROOT / "mesa_swarm"
        wanted = {
            path.relative_to(ROOT).as_posix()
            for path in package.rglob("*")
            if path.is_file() and path.suffix not in CODE and "__pycache__" not in path.parts
        }
        wanted |= {f"mesa_swarm/models/{path.name}" for path in (ROOT / "models").glob("*.toml")}
        assert {path.rsplit(".", 1)[1] for path in wanted} >= {"toml", "svg", "js", "css", "html", "typed"}
        assert wanted <= set(ZipFile(wheel).namelist())

    def test_holds_every_module_and_every_model_and_nothing_else_that_is_code(self, wheel):
        modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "mesa_swarm").rglob("*.py")}
        models = {f"mesa_swarm/models/{path.name}" for path in (ROOT / "models").glob("*.py")}
        assert {name for name in ZipFile(wheel).namelist() if name.endswith(".py")} == modules | models

    def test_lists_its_models_far_from_the_repository(self, program, tmp_path):
        assert "fire_fighting" in run(program, "list", cwd=tmp_path)

    def test_runs_a_model_on_a_map_of_its_own(self, program, tmp_path):
        text = run(program, "run", "collision_avoidance", "--steps", "10", cwd=tmp_path)
        assert "state hash" in text

    def test_declares_its_types_to_type_checkers(self, program, tmp_path):
        where = "import mesa_swarm, pathlib; print(pathlib.Path(mesa_swarm.__file__).parent)"
        home = Path(run(program.with_name("python"), "-c", where, cwd=tmp_path).strip())
        assert not home.is_relative_to(ROOT)
        assert (home / "py.typed").exists()
