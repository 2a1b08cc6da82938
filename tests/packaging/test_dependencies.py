"""What the package imports, what it declares, and the lowest set of versions."""

import ast
import re
import sys
import tomllib
from collections.abc import Iterable
from pathlib import Path

import pytest

from support.installing import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
# What users install; the others are for developers.
FOR_USERS = sorted(EXTRAS.keys() - {"docs", "learners", "notebooks", "release", "test"})
LOWEST = (ROOT / "constraints-lowest.txt").read_text(encoding="utf-8")
# Declared without an import, and why.
NOT_IMPORTED = {
    "ipyvue": "its version 2 does not draw the dashboard",
    "ipyvuetify": "likewise",
    "solara-assets": "Solara serves its files without a connection",
    "altair": "Mesa's own page, SolaraViz, imports it, without declaring it",
    "dask-jobqueue": "starts workers of a cluster through SLURM and the like, as the page on clusters shows",
    "pyabc": "the page on approximate Bayesian computation uses it",
}
# Imported by another name than that of the package.
OF_ANOTHER_NAME = {"PIL": "pillow", "stable_baselines3": "stable-baselines3", "imageio_ffmpeg": "imageio-ffmpeg"}


def name_of(requirement: str) -> str:
    return re.split(r"[\[<>=!~; ]", requirement, maxsplit=1)[0]


def bound_of(requirement: str) -> str | None:
    found = re.search(r">=([\d.]+)", requirement)
    return found and found[1]


FOLDERS = ("mesa_swarm", "models", "studies")


def requirements(extras: Iterable[str]) -> dict[str, str]:
    """Return all requirements of the package with some extras, by the name of the package."""
    found = [*PROJECT["dependencies"], *(line for extra in extras for line in EXTRAS[extra])]
    return {name_of(line): line for line in found if name_of(line) != "mesa-swarm"}


def imported() -> dict[str, set[str]]:
    """Return the packages that modules import, models and studies too, by the name of the import, with the modules."""
    found: dict[str, set[str]] = {}
    for path in [
        *(ROOT / "mesa_swarm").rglob("*.py"),
        *(ROOT / "models").glob("*.py"),
        *(ROOT / "studies").rglob("*.py"),
    ]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            lines = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            lines += [node.module] if isinstance(node, ast.ImportFrom) and node.module else []
            for line in lines:
                found.setdefault(line.split(".")[0], set()).add(path.name)
    known = {*sys.stdlib_module_names, "mesa_swarm", "mesa_swarm_studies"}
    return {name: files for name, files in found.items() if name not in known}


IMPORTED = imported()


@pytest.mark.parametrize("name", sorted(IMPORTED))
def test_every_imported_package_is_declared(name):
    distribution = OF_ANOTHER_NAME.get(name, name)
    assert distribution in requirements(FOR_USERS), f"{name} is imported by {sorted(IMPORTED[name])}"


def test_every_declared_package_is_imported_or_has_a_reason():
    names = {OF_ANOTHER_NAME.get(name, name) for name in IMPORTED}
    assert requirements(FOR_USERS).keys() - names == NOT_IMPORTED.keys()


@pytest.mark.parametrize("requirement", requirements(FOR_USERS).values())
def test_every_requirement_has_a_lower_bound(requirement):
    assert bound_of(requirement)


def test_the_lowest_set_has_exactly_the_lower_bounds():
    pinned = dict(line.split("==") for line in LOWEST.splitlines() if "==" in line and not line.startswith("#"))
    for name, line in requirements({"dashboard", "evolution"}).items():
        lowest = bound_of(line)
        numbers = [int(part) for part in lowest.split(".")]
        first = [int(part) for part in pinned[name].split(".")]
        assert first[: len(numbers)] == numbers, f"{line}, but {name}=={pinned[name]}"
        assert not any(first[len(numbers) :]), f"{line}, but {name}=={pinned[name]}"


def test_everything_installed_for_tests_is_pinned():
    pins = {line.split("==")[0] for line in Path(ROOT / "constraints.txt").read_text().splitlines() if "==" in line}
    names = {name.lower() for name in requirements(set(EXTRAS))}
    assert names <= {pin.lower() for pin in pins}
