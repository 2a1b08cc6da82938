"""Packages that only some features need: they are extras, and their absence is one line with the command to type."""

from importlib.util import find_spec
from pathlib import Path

from mesa_swarm.base.errors import SwarmError

# Beside the package only in a copy of the repository, whose editable installation this is then.
PROJECT = Path(__file__).resolve().parents[2] / "pyproject.toml"


def install_command(extra: str) -> str:
    """Return the command that installs an extra: of the published package, or of this copy of the repository.

    Its quotes are those that every shell knows, that of Windows too.

    Examples
    --------
    >>> install_command("video").endswith('[video]"')
    True
    """
    return f'pip install -e "{PROJECT.parent}[{extra}]"' if PROJECT.exists() else f'pip install "mesa-swarm[{extra}]"'


def missing_package_line(purpose: str, package: str, extra: str) -> str:
    """Return the line for a missing package: ``purpose`` is what needs it, in the plural or as a verb demands."""
    return f"{purpose} {package}; install it with: {install_command(extra)}"


def require_extra(package: str, extra: str, purpose: str, name: str | None = None) -> None:
    """Check that the package of an extra is installed.

    Parameters
    ----------
    package : str
        The name by which it is imported.
    extra : str
        The extra of mesa_swarm that installs it.
    purpose : str
        What needs it, with the verb.
    name : str, optional
        What the package is called, if not as it is imported.

    Raises
    ------
    SwarmError
        If it is missing; the error gives the command that installs it.

    Examples
    --------
    >>> require_extra("numpy", "test", "this page needs")
    """
    if find_spec(package) is None:
        raise SwarmError(missing_package_line(purpose, name or package, extra))
