"""The package as others install it: a wheel, away from the repository."""

from pathlib import Path
from zipfile import ZipFile

import pytest

from support.installing import ROOT, run

CODE = {".py", ".pyc"}
MODELS = ROOT / "models"


@pytest.mark.slow
class TestTheWheel:
    def test_holds_every_file_of_the_package_besides_code(self, wheel):
        package = ROOT / "mesa_swarm"
        wanted = {
            path.relative_to(ROOT).as_posix()
            for path in package.rglob("*")
            if path.is_file() and path.suffix not in CODE and "__pycache__" not in path.parts
        }
        wanted |= {f"mesa_swarm/models/{path.name}" for path in MODELS.glob("*.toml")}
        assert {path.rsplit(".", 1)[1] for path in wanted} >= {"toml", "svg", "js", "css", "html", "typed"}
        assert {
            name for name in ZipFile(wheel).namelist() if not name.endswith(".py") and ".dist-info/" not in name
        } == wanted

    def test_holds_every_module_and_every_model_and_nothing_else_that_is_code(self, wheel):
        modules = {path.relative_to(ROOT).as_posix() for path in (ROOT / "mesa_swarm").rglob("*.py")}
        models = {f"mesa_swarm/models/{path.name}" for path in MODELS.glob("*.py")}
        assert {name for name in ZipFile(wheel).namelist() if name.endswith(".py")} == modules | models

    def test_lists_its_models_far_from_the_repository(self, installed, tmp_path):
        assert "fire_fighting" in run(installed.with_name("mesa-swarm"), "list", cwd=tmp_path)

    def test_runs_a_model_on_a_map_of_its_own(self, installed, tmp_path):
        command = installed.with_name("mesa-swarm"), "run", "collision_avoidance", "--steps", "10"
        assert "state hash" in run(*command, cwd=tmp_path)

    def test_declares_its_types_to_type_checkers(self, installed, tmp_path):
        where = "import mesa_swarm, pathlib; print(pathlib.Path(mesa_swarm.__file__).parent)"
        home = Path(run(installed, "-c", where, cwd=tmp_path).strip())
        assert not home.is_relative_to(ROOT)
        assert (home / "py.typed").exists()
