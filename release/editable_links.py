"""What the build does beyond copying files: links for an editable installation."""

import os
import shutil
import sys
from pathlib import Path
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


class EditableLinks(BuildHookInterface):  # type: ignore[misc]  # a generic class, of no matter here
    """Before an editable installation, make the links by which all is found."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Make the links, if this wheel is for an editable installation."""
        if version == "editable":
            root = Path(self.root)
            # Left by installations of version 0.1.0: programs started here would read the version from it.
            shutil.rmtree(root / "mesa_swarm.egg-info", ignore_errors=True)
            for link, folder in LINKS.items():
                link_folder(root / link, root / folder)


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
