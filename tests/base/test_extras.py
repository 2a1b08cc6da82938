"""Extras: what works without any of them, and the line that each missing package gives."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from mesa_swarm.base import extras
from mesa_swarm.base.extras import install_command, require_extra

ROOT = Path(__file__).parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
# Packages by the name of their import, as if none of them were installed.
OPTIONAL = "cmaes solara anywidget reacton uvicorn ipywidgets traitlets imageio_ffmpeg gymnasium pettingzoo"
OPTIONAL += " SALib optuna pygame stable_baselines3 torch onnx onnxruntime ribs distributed latex2mathml pygments"
WITHOUT = """
import sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {packages}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

from importlib import util
found = util.find_spec
util.find_spec = lambda name, package=None: None if name.split(".")[0] in {packages} else found(name, package)
sys.meta_path.insert(0, Missing())
{rest}
"""
MAIN = "from mesa_swarm.cli import main; sys.argv[1:] = {words}; main()"
RECORDED = ("--steps", "3", "--record", "few.arrow")
# Command | what is needed | extra.
LINES = {
    "dashboard --no-browser": ("the dashboard needs Solara", "dashboard"),
    "diversity": ("quality-diversity search needs pyribs", "diversity"),
    "design": ("evolution needs cmaes", "evolution"),
    "export few.arrow few.mp4": ("films need imageio-ffmpeg", "video"),
}


def without(packages: str, rest: str, folder: Path) -> subprocess.CompletedProcess:
    """Run Python lines in a process for which these packages are missing."""
    script = WITHOUT.format(packages=set(packages.split()), rest=rest)
    return subprocess.run(
        [sys.executable, "-c", script], cwd=folder, capture_output=True, text=True, timeout=300, check=False
    )


@pytest.mark.slow
def test_without_any_extra_models_run_are_recorded_compared_and_drawn(tmp_path):
    for words in (
        "list",
        "run collision_avoidance --steps 5 --record few.arrow",
        "verify few.arrow",
        "compare collision_avoidance --steps 5 --seeds 2",
        "export few.arrow few.png",
    ):
        done = without(OPTIONAL, MAIN.format(words=words.split()), tmp_path)
        assert done.returncode == 0, f"{words}: {done.stderr}"


@pytest.mark.slow
@pytest.mark.parametrize("words", LINES)
def test_a_missing_package_gives_one_line_with_the_command_that_installs_it(words, tmp_path):
    purpose, extra = LINES[words]
    if "few.arrow" in words:
        recorded = without(OPTIONAL, MAIN.format(words=["run", "boids", *RECORDED]), tmp_path)
        assert recorded.returncode == 0, recorded.stderr
    done = without(OPTIONAL, MAIN.format(words=words.split()), tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"mesa-swarm: {purpose}; install it with: {install_command(extra)}")
    assert extra in EXTRAS


def test_a_copy_of_the_repository_installs_from_itself(tmp_path, monkeypatch):
    (tmp_path / "pyproject.toml").touch()
    monkeypatch.setattr(extras, "PROJECT", tmp_path / "pyproject.toml")
    assert install_command("rl") == f'pip install -e "{tmp_path}[rl]"'


def test_the_published_package_is_installed_by_its_name(tmp_path, monkeypatch):
    monkeypatch.setattr(extras, "PROJECT", tmp_path / "pyproject.toml")
    assert install_command("rl") == 'pip install "mesa-swarm[rl]"'


def test_a_package_that_is_there_is_no_error():
    require_extra("numpy", "rl", "this test needs")
