"""No command writes to a file that it reads, under whatever name, also where files may be replaced."""

import os
import shutil

import numpy as np
import pytest

from mesa_swarm.base.errors import ExportError
from mesa_swarm.base.files import check_apart
from mesa_swarm.learning import save_policy
from mesa_swarm.learning.q_learning import QPolicy
from mesa_swarm.maps.map import Map
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.robots.design import AGENT9
from mesa_swarm.viewing.export import export

MODEL = """
from mesa_swarm import AGENT3, SwarmModel

class Mine(SwarmModel):
    def __init__(self, *, map="openspace", rng=None):
        super().__init__(map=map, rng=rng)
        self.add_robots(AGENT3, 1)

    def results(self):
        return {"collisions": self.collisions}
"""
JOB = "model = 'fire_fighting'\nsteps = 2\nseeds = 1\nrobots = 2\n"


@pytest.fixture(scope="module")
def originals(tmp_path_factory):
    """Return a folder with a recording, a map, a model, a job, a policy and a state machine."""
    folder = tmp_path_factory.mktemp("originals")
    model = FireFighting(n_robots=2, rng=1)
    with model.record(folder / "run.arrow"):
        model.run(3)
    Map.load("original").save(folder / "rooms.toml")
    (folder / "mine.py").write_text(MODEL)
    (folder / "job.toml").write_text(JOB)
    save_policy(QPolicy.untrained(AGENT9, rng=np.random.default_rng(1)), folder / "policy.npz")
    (folder / "machine.txt").write_text("explore\n")
    return folder


@pytest.fixture
def folder(originals, model_folder):
    """Return a copy of them, in which commands are run."""
    shutil.copytree(originals, model_folder, dirs_exist_ok=True)
    return model_folder


def linked(source, name):
    os.symlink(source, name)
    return name


def hard_linked(source, name):
    os.link(source, name)
    return name


# Other names of a file in this folder.
SPELLINGS = {
    "as it is": lambda name, folder: name,
    "relative": lambda name, folder: f"../{folder.name}/./{name}",
    "absolute": lambda name, folder: str(folder / name),
    "symbolic link": lambda name, folder: linked(name, f"linked_{name}"),
    "hard link": lambda name, folder: hard_linked(name, f"linked_{name}"),
}


@pytest.mark.slow
@pytest.mark.parametrize("spelling", SPELLINGS)
@pytest.mark.parametrize("target", ["run.csv", "run.parquet", "run.html", "run.gif", "run.png", "run.svg"])
def test_a_recording_is_not_exported_over_itself(typed, folder, spelling, target):
    os.rename("run.arrow", target)
    before = (folder / target).read_bytes()
    out = SPELLINGS[spelling](target, folder)
    status, printed, err = typed(["export", target, out, "--force"])
    assert (status, printed, err.count("\n")) == (2, "", 1)
    assert "is the file that is read" in err
    assert (folder / target).read_bytes() == before


def test_no_still_of_several_replaces_the_recording(folder):
    os.rename("run.arrow", "out_2.png")
    before = (folder / "out_2.png").read_bytes()
    with pytest.raises(ExportError, match=r"out_2\.png is the file that is read"):
        export("out_2.png", "out.png", steps=[1, 2], overwrite=True)
    assert (folder / "out_2.png").read_bytes() == before
    assert not (folder / "out_1.png").exists()


# Commands that read {0} and would write to {1}.
COMMANDS = [
    ("rooms.toml", ".toml", "map import {0} {1} --force"),
    ("rooms.toml", ".png", "map show {0} --out {1}"),
    ("rooms.toml", ".png", "picture collision_avoidance --set map={0} --steps 0 --out {1}"),
    ("rooms.toml", ".arrow", "run collision_avoidance --set map={0} --steps 1 --record {1} --force"),
    ("mine.py", ".arrow", "run ./{0}:Mine --steps 1 --record {1} --force"),
    ("mine.py", ".png", "picture ./{0} --steps 0 --out {1}"),
    ("policy.npz", ".c", "policy export {0} --name {stem} --force"),
    ("policy.npz", ".onnx", "policy export {0} --name {stem} --to onnx --force"),
    ("machine.txt", ".h", "policy export {0} --name {stem} --force"),
    ("policy.npz", ".md", "learn-bench --policy {0} --report {1} --quick"),
]


@pytest.mark.parametrize("link", [os.symlink, os.link], ids=["symbolic", "hard"])
@pytest.mark.parametrize(("source", "ending", "command"), COMMANDS, ids=[command for *_, command in COMMANDS])
def test_no_command_writes_over_what_it_reads_by_a_link(typed, folder, source, ending, command, link):
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    link(folder / source, folder / f"other{ending}")
    status, printed, err = typed(command.format(source, f"other{ending}", stem="other"))
    assert (status, printed, err.count("\n")) == (2, "", 1)
    assert f"other{ending} is the file that is read" in err
    after = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    assert after == before | {f"other{ending}": before[source]}


@pytest.mark.parametrize("name", ["job.toml", "rooms.toml", "mine.py"])
def test_no_run_of_a_job_is_recorded_over_the_job_or_its_map(typed, folder, name):
    (folder / "job.toml").write_text(
        JOB.replace("robots = 2\n", "").replace("fire_fighting'", "./mine.py:Mine'\nmap = 'rooms.toml'")
    )
    before = (folder / name).read_bytes()
    os.link(folder / name, folder / "other.arrow")
    status, printed, err = typed("run job.toml --record other.arrow --force")
    assert (status, printed, err.count("\n")) == (2, "", 1)
    assert "other.arrow is the file that is read" in err
    assert (folder / "other.arrow").read_bytes() == before


@pytest.mark.parametrize("out", [[], ["rooms.toml"], ["./rooms.toml"]])
def test_a_map_is_not_imported_over_itself(typed, folder, out):
    before = (folder / "rooms.toml").read_bytes()
    for force in ([], ["--force"]):
        status, _, err = typed(["map", "import", "rooms.toml", *out, *force])
        assert (status, err) == (
            2,
            f"mesa-swarm: {(out or ['rooms.toml'])[0].removeprefix('./')} is the file that is read, rooms.toml; "
            "choose another name\n",
        )
    assert (folder / "rooms.toml").read_bytes() == before


def test_a_file_that_is_not_there_or_another_one_is_permitted(folder):
    check_apart(folder / "new.csv", ["run.arrow", "nowhere", "no\0name"])
    check_apart(folder / "mine.py", ["run.arrow"])
