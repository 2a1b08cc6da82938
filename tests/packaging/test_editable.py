"""An editable installation, as the README has it: everything is found, and nothing besides."""

import subprocess
from pathlib import Path

import pytest

from build_hook import LINKS, link_folder
from support.installing import ROOT, run

PLACES = """
import mesa_swarm.geometry, mesa_swarm.models.boids, mesa_swarm_studies.theory
modules = mesa_swarm.geometry, mesa_swarm.models.boids, mesa_swarm_studies.theory
for module in modules:
    print(module.__file__)
print(*(module.__name__ for module in modules))
"""
STRANGERS = """
from importlib.util import find_spec
print([name for name in ("models", "studies", "tests", "docs", "notebooks", "release") if find_spec(name)])
"""


@pytest.mark.slow
class TestAnEditableInstallation:
    def test_finds_package_models_and_studies_from_any_folder_by_their_own_paths(self, editable, sources, tmp_path):
        first, second, third, names = run(editable, "-c", PLACES, cwd=tmp_path).splitlines()
        assert Path(first) == sources / "mesa_swarm" / "geometry" / "__init__.py"
        assert Path(second) == sources / "models" / "boids.py"
        assert Path(third) == sources / "studies" / "theory" / "__init__.py"
        assert names == "mesa_swarm.geometry mesa_swarm.models.boids mesa_swarm_studies.theory"

    def test_puts_no_other_folder_of_the_repository_on_the_path(self, editable, tmp_path):
        assert run(editable, "-c", STRANGERS, cwd=tmp_path) == "[]\n"

    def test_finds_a_new_model_and_a_new_module_at_once(self, editable, sources, tmp_path):
        new = sources / "models" / "new_model.py", sources / "mesa_swarm" / "new_module.py"
        try:
            for path in new:
                path.write_text("VALUE = 7\n")
            script = (
                "from mesa_swarm import new_module; from mesa_swarm.models import new_model; print(new_model.VALUE)"
            )
            assert run(editable, "-c", script, cwd=tmp_path) == "7\n"
        finally:
            for path in new:
                path.unlink()

    def test_has_the_commands(self, editable, tmp_path):
        assert "fire_fighting" in run(editable.with_name("mesa-swarm"), "list", cwd=tmp_path)
        assert run(editable.with_name("mesa-swarm"), "reproduce", "--list", cwd=tmp_path).startswith("4.12 ")


def test_in_the_repository_every_link_shows_its_folder():
    missing = [str(link) for link, folder in LINKS.items() if (ROOT / link).resolve() != (ROOT / folder).resolve()]
    assert not missing, f"{missing}: install the repository with pip install -e"


def test_git_ignores_the_links():
    if not (ROOT / ".git").exists():
        pytest.skip("not a copy by git")
    done = subprocess.run(
        ["git", "check-ignore", *map(str, LINKS)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == [str(link) for link in LINKS]


class TestALink:
    def test_is_made_once_and_made_anew_if_it_leads_elsewhere(self, tmp_path):
        for name in ("here", "there"):
            (tmp_path / name).mkdir()
        link = tmp_path / "folder" / "link"
        for name in ("here", "here", "there"):
            link_folder(link, tmp_path / name)
            assert link.resolve() == tmp_path / name

    def test_outlives_a_move_of_both(self, tmp_path):
        (tmp_path / "before" / "real").mkdir(parents=True)
        link_folder(tmp_path / "before" / "link", tmp_path / "before" / "real")
        (tmp_path / "before").rename(tmp_path / "after")
        assert (tmp_path / "after" / "link").resolve() == tmp_path / "after" / "real"

    def test_never_replaces_files_of_the_user(self, tmp_path):
        for name in ("real", "link"):
            (tmp_path / name).mkdir()
        (tmp_path / "link" / "precious.py").touch()
        with pytest.raises(FileExistsError, match=r"is in the way of a link to .*: move it elsewhere"):
            link_folder(tmp_path / "link", tmp_path / "real")
        assert (tmp_path / "link" / "precious.py").exists()
