"""What `python -m build`, pip and uv call to build the package: hatchling, and by default machine code in wheels.

pip builds a wheel where it installs from sources: it would fetch all dependencies twice and compile for minutes, for a
user who may need one model. It gets a wheel without machine code, unless the variable asks for it.
"""

import os
from pathlib import Path
from typing import Any

from hatchling.build import *  # noqa: F403 - what else a builder may call
from hatchling.build import build_wheel as build_by_hatchling
from hatchling.build import get_requires_for_build_wheel as requires_of_hatchling
from hatchling.builders.wheel import WheelBuilder

# As in release/build_hook.py.
LEVELS = "MESA_SWARM_MACHINE_CODE"
PIP = "PIP_BUILD_TRACKER"


def choose_levels() -> str:
    """Return for which levels of processors a wheel is to have machine code."""
    return os.environ.get(LEVELS, "none" if PIP in os.environ else "all")


def get_requires_for_build_wheel(  # type: ignore[no-redef]
    config_settings: dict[str, Any] | None = None,
) -> list[str]:
    """Return what has to be installed to build a wheel: to compile, all that the package needs."""
    more = [] if choose_levels() == "none" else WheelBuilder(str(Path.cwd())).metadata.core.dependencies
    return [*requires_of_hatchling(config_settings), *more]


def build_wheel(  # type: ignore[no-redef]
    wheel_directory: str, config_settings: dict[str, Any] | None = None, metadata_directory: str | None = None
) -> str:
    """Build a wheel into a folder and return its name."""
    os.environ[LEVELS] = choose_levels()
    return build_by_hatchling(wheel_directory, config_settings, metadata_directory)
