"""What the build does beyond copying files: links for an editable installation, machine code for a wheel.

Code is compiled as users compile it, by `warm_up`, once for each level of processors that this one has. It serves the
Python, the operating system and the version of Numba with which it is built: others compile for themselves.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

# The only folder that an editable installation puts on the path. It holds nothing but links to the packages: with the
# repository itself on it, `import models`, `import tests` and `import docs` of a user's project would find ours.
EDITABLE = Path(".editable")
# Where each link is, and what it shows. Type checkers and IDEs run no code to find modules: they need real folders.
LINKS = {
    EDITABLE / "mesa_swarm": Path("mesa_swarm"),
    EDITABLE / "mesa_swarm_studies": Path("studies"),
    Path("mesa_swarm", "models"): Path("models"),
    Path("mesa_swarm_studies"): Path("studies"),
}


# For which levels of processors a wheel has machine code: "none", "all", or names with blanks between them. Without it
# hatchling compiles none, and other builders all (release/backend.py).
LEVELS = "MESA_SWARM_MACHINE_CODE"
# Where a wheel has the folders of the repository, and its machine code.
PLACES = {"mesa_swarm": "mesa_swarm", "models": "mesa_swarm/models", "studies": "mesa_swarm_studies"}
CODE = "mesa_swarm/machine_code"
LIST_LEVELS = """
import json
from mesa_swarm.kernels.machines import list_levels, settings_for
print(json.dumps({level: settings_for(level) for level in list_levels()}))
"""
COMPILE_ALL = """
from mesa_swarm.experiments.warm_up import warm_up
from mesa_swarm.live.live_page import compile_pages
folder = warm_up().folder
compile_pages()
print(folder)
"""


class BuildHook(BuildHookInterface):  # type: ignore[misc]  # a generic class, of no matter here
    """Make links before an editable installation, and machine code before a wheel that carries some."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Make links or machine code; a wheel with code is for this Python and platform."""
        root, words = Path(self.root), os.environ.get(LEVELS, "none").split()
        if version == "editable":
            make_links(root)
        elif words != ["none"]:
            self._folder = TemporaryDirectory()
            compile_levels(root, words, Path(self._folder.name))
            build_data["force_include"][self._folder.name] = CODE
            build_data.update(pure_python=False, infer_tag=True)

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove what has been copied into the wheel."""
        if hasattr(self, "_folder"):
            self._folder.cleanup()


def make_links(root: Path) -> None:
    """Make the links of an editable installation."""
    # Left by installations of version 0.1.0: programs started here would read the version from it.
    shutil.rmtree(root / "mesa_swarm.egg-info", ignore_errors=True)
    for link, folder in LINKS.items():
        link_folder(root / link, root / folder)


def compile_levels(root: Path, words: list[str], folder: Path) -> None:
    """Compile what the models of the gallery need into a folder, for the levels of processors that these words name.

    Raises
    ------
    ValueError
        If this processor has no such level: the code is run while it is compiled.
    """
    with TemporaryDirectory() as stage:
        for source, place in PLACES.items():
            # In a repository mesa_swarm/models is a link to models.
            ignored = shutil.ignore_patterns("__pycache__", *(["models"] if source == "mesa_swarm" else []))
            shutil.copytree(root / source, Path(stage, place), ignore=ignored)
        levels = json.loads(_run(LIST_LEVELS, stage, {}))
        chosen = list(levels) if words == ["all"] else words
        if not levels.keys() >= set(chosen):
            raise ValueError(f"{LEVELS} is {' '.join(words)!r}; expected none, all, or some of: {' '.join(levels)}")
        for level in chosen:
            compiled = Path(_run(COMPILE_ALL, stage, {"NUMBA_CACHE_DIR": str(Path(stage, level))} | levels[level]))
            shutil.copytree(compiled, folder / compiled.name)


def _run(script: str, stage: str, settings: dict[str, str]) -> str:
    """Return what a script prints that imports the package from a folder; of Numba's settings it has only these."""
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    paths = os.pathsep.join([stage, os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    variables = inherited | settings | {"PYTHONPATH": paths, "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=stage, env=variables, stdout=subprocess.PIPE, text=True, check=True
    )
    return done.stdout.strip()


def link_folder(link: Path, folder: Path) -> None:
    """Let one folder show another: by a symbolic link, on Windows by a junction, which needs no permission."""
    link.parent.mkdir(exist_ok=True)
    if link.exists() and link.samefile(folder):
        return
    if link.is_symlink():
        link.unlink()
    if link.exists():
        raise FileExistsError(f"{link} is in the way of a link to {folder}: move it elsewhere, then install again")
    if sys.platform == "win32":
        import _winapi  # noqa: PLC0415 - only there

        _winapi.CreateJunction(str(folder), str(link))
    else:
        link.symlink_to(os.path.relpath(folder, link.parent), target_is_directory=True)
