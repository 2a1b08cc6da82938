"""What is said when the packages of the extra `rl` are not installed."""

from importlib.util import find_spec

from mesa_swarm.errors import SwarmError


def need(package: str) -> None:
    """Refuse to go on without a package of the extra `rl`.

    Raises
    ------
    SwarmError
        One line that says how to install it.

    Examples
    --------
    >>> need("numpy")
    """
    if find_spec(package) is None:
        raise SwarmError(f"this environment needs {package}; install it with: pip install 'mesa-swarm[rl]'")
