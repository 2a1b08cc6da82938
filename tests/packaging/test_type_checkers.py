"""What mypy and pyright (by basedpyright, which needs nothing else) find in the program of a user."""

import json

import pytest

from support.installing import run

PROGRAM = '''"""A program of a user, in a folder far from the repository."""

import numpy as np

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.analysis import clusters
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.fire import design_constants
from mesa_swarm.models.fire_fighting import FireFighting


class Mine(SwarmModel):
    """A model."""

    def __init__(self, n_robots: int = 10, rng: int | None = None) -> None:
        super().__init__(map="original", rng=rng)
        self.add_robots(AGENT9, n_robots)
        self.control = Subsumption(Avoid(distance=15), Explore())


class Hotter(FireFighting):
    """A model of the gallery with a measure more."""

    def mean_heading(self) -> float:
        """Return it."""
        return float(np.mean(self.swarm.heading))


print(Mine(rng=1).run(10).state_hash(), clusters, design_constants)
print(Hotter(rng=1).mean_heading(), Hotter(rng=1).run(3).results())
'''
# A line more, and what is wrong with it.
WRONG = {
    "Hotter(rng=1).run('three')": ("arg-type", "reportArgumentType"),
    "import mesa_swarm.models.nothing": ("import-not-found", "reportMissingImports"),
}


@pytest.fixture(params=["editable", "installed"])
def python(request):
    """Return the Python of either installation."""
    return request.getfixturevalue(request.param)


@pytest.fixture
def program(tmp_path):
    (tmp_path / "pyrightconfig.json").write_text('{"typeCheckingMode": "standard"}')
    file = tmp_path / "program.py"
    lines = [PROGRAM, *WRONG]
    file.write_text("\n".join([*lines, ""]))
    return file


@pytest.mark.slow
class TestATypeChecker:
    def test_by_mypy_finds_all_of_the_package_and_what_is_wrong(self, python, program):
        words = "-m", "mypy", "--strict", "--no-error-summary", "--output=json", program
        found = [json.loads(line) for line in run(python, *words, cwd=program.parent, check=False).splitlines()]
        assert [each["code"] for each in found if each["severity"] == "error"] == [mypy for mypy, _ in WRONG.values()]

    def test_by_pyright_finds_all_of_the_package_and_what_is_wrong(self, python, program):
        words = "-m", "basedpyright", "--outputjson", "--pythonpath", python, program
        found = json.loads(run(python, *words, cwd=program.parent, check=False))["generalDiagnostics"]
        assert [each["rule"] for each in found if each["severity"] == "error"] == [each for _, each in WRONG.values()]
