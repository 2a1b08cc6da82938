"""The package as others install it: a wheel, away from the repository."""

from pathlib import Path
from zipfile import ZipFile

import pytest

from support.installing import ROOT, run

# Folders of the repository, and where a wheel has them.
PLACES = {"mesa_swarm": "mesa_swarm", "models": "mesa_swarm/models", "studies": "mesa_swarm_studies"}


def wanted() -> set[str]:
    """Return the files that a wheel is to have, by their paths in it, but those of its installation."""
    files = {
        f"{place}/{path.relative_to(ROOT / folder).as_posix()}"
        for folder, place in PLACES.items()
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    }
    return {name for name in files if "__pycache__" not in name}


@pytest.mark.slow
class TestTheWheel:
    def test_holds_every_file_of_both_packages_and_nothing_else(self, wheel):
        assert {path.rsplit(".", 1)[1] for path in wanted()} >= {"toml", "svg", "js", "css", "html", "typed", "py"}
        assert {name for name in ZipFile(wheel).namelist() if ".dist-info/" not in name} == wanted()

    def test_lists_its_models_far_from_the_repository(self, installed, tmp_path):
        assert "fire_fighting" in run(installed.with_name("mesa-swarm"), "list", cwd=tmp_path)

    def test_has_the_commands_of_the_studies(self, installed, tmp_path):
        command = installed.with_name("mesa-swarm")
        printed = run(command, "--help", cwd=tmp_path)
        assert all(f"  {name} " in printed for name in ("bench", "learn-bench", "reproduce", "validate"))
        assert run(command, "reproduce", "--list", cwd=tmp_path).startswith("4.12 ")

    def test_runs_a_model_on_a_map_of_its_own(self, installed, tmp_path):
        command = installed.with_name("mesa-swarm"), "run", "collision_avoidance", "--steps", "10"
        assert "state hash" in run(*command, cwd=tmp_path)

    def test_declares_its_types_to_type_checkers(self, installed, tmp_path):
        where = "import mesa_swarm, pathlib; print(pathlib.Path(mesa_swarm.__file__).parent)"
        home = Path(run(installed, "-c", where, cwd=tmp_path).strip())
        assert not home.is_relative_to(ROOT)
        assert (home / "py.typed").exists()
