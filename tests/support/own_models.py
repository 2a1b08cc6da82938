"""Models outside of the repository: as files, and in a package that is installed as pip installs one."""

from pathlib import Path

MODEL = '''
from typing import Annotated

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.model.parameters import Slider


class {name}(SwarmModel):
    """Robots that forage."""

    compares = "n_robots", (2, 3)
    steps_to_compare = 5

    def __init__(self, *, n_robots: Annotated[int, Slider(1, 50, 1, "robots")] = 2, rng=None):
        super().__init__(map="openspace", rng=rng)
        self.add_robots(AGENT9, n_robots)
        self.control = Subsumption(Avoid(distance=10), Explore())

    def results(self):
        return {{"x": float(self.swarm.position[:, 0].mean())}}
'''
# As beginners write one: positional parameters, no annotations, no docstring, one parameter without a default.
BARE = """
from mesa_swarm import AGENT9, SwarmModel


class Bare(SwarmModel):
    def __init__(self, n_robots=2, flag=True, size=None, note="", shape=(1, 2), *, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, n_robots)
"""


def write_model(folder: Path, file: str = "mine.py", name: str = "Foraging") -> Path:
    """Write a file with one model, and return its path."""
    path = folder / file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(MODEL.format(name=name), encoding="utf-8")
    return path


def install_package(folder: Path, entries: dict[str, str], package: str = "anthill") -> None:
    """Write a package with a model `AntTrails` and these entry points into a folder of the interpreter's path."""
    (folder / package).mkdir(parents=True)
    (folder / package / "__init__.py").touch()
    write_model(folder / package, "trails.py", "AntTrails")
    about = folder / f"{package}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    lines = [f"{name} = {value}" for name, value in entries.items()]
    (about / "entry_points.txt").write_text("\n".join(["[mesa_swarm.models]", *lines, ""]))
