"""The recipe for conda-forge, as rattler-build reads it; its channels are not needed."""

import re
import shlex
import shutil
import tomllib

import pytest
from rattler_build import Stage0Recipe, VariantConfig

import mesa_swarm
from support.installing import ROOT, environment, run

PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = PYPROJECT["project"]
# What conda-forge calls differently: its matplotlib brings Qt, and its packages have no extras.
NAMES = {"matplotlib": "matplotlib-base", "mesa[network]": "mesa"}
OF_EXTRAS = {"networkx"}


@pytest.fixture(scope="module")
def recipe():
    (rendered,) = Stage0Recipe.from_file(str(ROOT / "release" / "recipe" / "recipe.yaml")).render(VariantConfig())
    return rendered.recipe.to_dict()


def as_conda(requirement: str) -> str:
    """Return a requirement as conda writes it."""
    name, bounds = re.fullmatch(r"([\w\[\]-]+)(.*)", requirement).groups()
    return f"{NAMES.get(name, name)} {bounds}"


def test_the_recipe_is_of_this_version(recipe):
    assert recipe["package"] == {"name": PROJECT["name"], "version": mesa_swarm.__version__}
    assert recipe["about"]["license"] == PROJECT["license"]
    assert recipe["about"]["summary"] == PROJECT["description"]


def test_its_requirements_are_those_of_the_package(recipe):
    python = f"python {PROJECT['requires-python']}"
    listed = [line for line in recipe["requirements"]["run"] if line not in OF_EXTRAS]
    assert listed == [python, *map(as_conda, PROJECT["dependencies"])]
    assert set(recipe["requirements"]["run"]) >= OF_EXTRAS
    assert set(map(as_conda, PYPROJECT["build-system"]["requires"])) <= set(recipe["requirements"]["host"])


def test_its_commands_are_those_of_the_package(recipe):
    assert recipe["build"]["python"]["entry_points"] == [f"{name} = {at}" for name, at in PROJECT["scripts"].items()]


@pytest.mark.slow
def test_its_script_installs_what_its_tests_import(recipe, sources, tmp_path):
    python = environment(tmp_path / "host")
    script = recipe["build"]["script"].replace("${{ PYTHON }}", str(python))
    run(*shlex.split(script), "--quiet", "--no-index", cwd=shutil.copytree(sources, tmp_path / "work"))
    for module in recipe["tests"][0]["python"]["imports"]:
        run(python, "-c", f"import {module}", cwd=tmp_path)
    assert mesa_swarm.__version__ in run(python.with_name("mesa-swarm"), "--version", cwd=tmp_path)
