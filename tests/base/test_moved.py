"""Addresses of earlier versions: each gives the same object as the new one, and warns once."""

import importlib
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

import mesa_swarm
from mesa_swarm import AGENT9, DifferentialDrive, SwarmModel
from mesa_swarm.base.moved import HOMES, NAMES, ROOT, STAYING, MovedFinder
from mesa_swarm.model.gallery import shipped_class
from mesa_swarm.robots.drive import alike

# What README, docs and notebooks of earlier versions import, and other public names, from where they were then.
ADDRESSES = {
    "body_world": "BodyWorld",
    "control.boids": "Align Cohere Cruise Separate",
    "control.match_velocity": "MatchVelocity",
    "control.subsumption": "Subsumption",
    "control.vector_sum": "VectorSum",
    "dashboard.canvas_widget": "SwarmCanvas",
    "dashboard.notebook": "show swarm_canvas",
    "environments.observation": "Observer",
    "experiments.bench": "peer_workload",
    "experiments.comparison_figures": "comparison_figure",
    "experiments.fire_policies": "trained_wheels",
    "experiments.learn_bench": "Benchmark learn_bench",
    "experiments.learning_figures": "regression_figure",
    "experiments.oscillation": "oscillation trained",
    "experiments.pictures": "draw_world world_figure png",
    "experiments.reward_figures": "reward_figure",
    "experiments.run_pictures": "ethogram stages trace",
    "exports": "export",
    "events": "EventLog",
    "fire.model": "FireModel",
    "imperfect_model": "COMMON ImperfectModel SLIP_MAGNITUDE",
    "learning.network_policy": "NetworkPolicy",
    "learning.q_policy": "QPolicy",
    "learning.wire_fitting": "wire_value",
    "learning.wire_policy": "WirePolicy",
    "mesa_model": "MesaModel",
    "model": "ENGINES EngineModel REPORTERS SwarmModel",
    "observers": "Observer",
    "open_model": "OpenModel Process",
    "recording.events": "Event",
    "recording.marks": "Mark",
    "reproduction.differences": "thesis_items",
    "reproduction.published_trails": "trail_run",
    "reproduction.registry": "items find_item",
    "reproduction.theory_motion": "ITEMS",
    "looks": "Chart ColourMap Looks",
    "odd": "odd",
    "parameters": "Slider parameters_of",
    "reporters": "held",
    "robots.parts": "RobotPart",
    "streams": "Streams",
    "world.map": "Map",
    "robots.steering": "approach",
    "state": "State",
    "state_hash": "written_state_hash",
    "teaching": "Wish",
    "teaching.checks": "Wish",
    "teaching.wish": "Wish",
    "world.load": "Load",
    "world.obstacle": "Obstacle",
    "world_model": "World",
}


def imported(module):
    """Import a module as if for the first time, and return it with the warnings."""
    sys.modules.pop(module, None)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        return importlib.import_module(module), caught


@pytest.mark.parametrize("name", STAYING)
def test_an_address_that_stays_is_imported_without_a_warning_and_has_types(name):
    module, caught = imported(ROOT + name)
    assert caught == []
    home = importlib.import_module(ROOT + STAYING[name])
    assert all(getattr(module, each) is getattr(home, each) for each in home.__all__)
    stub = (Path(mesa_swarm.__file__).parent / name.replace(".", "/")).with_suffix(".pyi").read_text()
    assert f"from {home.__name__} import *" in stub


@pytest.mark.parametrize("old", sorted(HOMES.keys() - {ROOT + name for name in STAYING}))
def test_a_module_that_moved_is_imported_with_one_warning_that_names_its_home(old):
    module, caught = imported(old)
    assert module.__name__ == old
    assert [(each.category, str(each.message)) for each in caught] == [
        (DeprecationWarning, f"{old} is deprecated; it is {HOMES[old]} now")
    ]
    home = importlib.import_module(HOMES[old])
    own = [name for name, value in vars(home).items() if getattr(value, "__module__", None) == home.__name__]
    own = [name for name in own if not name.startswith("__")]
    assert own or old == "mesa_swarm.cli.__main__"
    assert all(getattr(module, name) is getattr(home, name) for name in own)


@pytest.mark.parametrize("old", ADDRESSES)
def test_an_old_address_gives_the_very_object_of_the_new_one(old):
    for name in ADDRESSES[old].split():
        script = f"from mesa_swarm.{old} import {name}"
        sys.modules.pop(HOMES.get(f"mesa_swarm.{old}") and f"mesa_swarm.{old}", None)
        space = {}
        with pytest.warns(
            DeprecationWarning, match=rf"^mesa_swarm\.{old}\b.* is deprecated; it is mesa_swarm(_studies)?\."
        ) as caught:
            exec(script, space)
        assert len(caught) == 1
        new = NAMES.get(f"mesa_swarm.{old}.{name}", f"{HOMES.get(f'mesa_swarm.{old}')}.{name}")
        module, _, named = new.rpartition(".")
        assert space[name] is getattr(importlib.import_module(module), named)


@pytest.mark.slow
def test_the_warning_is_about_the_line_that_imports(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(
        "import mesa_swarm\nfrom mesa_swarm.world.load import Load\nfrom mesa_swarm.model import SwarmModel\n"
    )
    done = subprocess.run([sys.executable, program], capture_output=True, text=True, check=True)
    assert [line.split(": ")[0] for line in done.stderr.splitlines() if "Deprecat" in line] == [
        f"{program}:2",
        f"{program}:3",
    ]


@pytest.mark.slow
def test_a_program_that_moved_still_runs_by_its_old_address():
    command = [sys.executable, "-W", "default", "-m", "mesa_swarm.experiments.bench"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "mesa_swarm.experiments.bench is deprecated; it is mesa_swarm_studies.benchmarks.speed now" in done.stderr


def test_modules_of_a_folder_that_moved_are_imported_from_it():
    for name in ("mesa_swarm.reproduction", "mesa_swarm.reproduction.maps"):
        sys.modules.pop(name, None)
    with pytest.warns(DeprecationWarning, match=r"it is mesa_swarm_studies\.thesis\.maps now") as caught:
        exec("from mesa_swarm.reproduction import maps")
    assert len(caught) == 1
    with pytest.raises(ImportError):
        exec("from mesa_swarm.reproduction import mops")


def test_names_that_never_were_are_missing_as_ever():
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("mesa_swarm.world.lode")
    with pytest.raises(ImportError, match="Nothing"):
        exec("from mesa_swarm.model import Nothing")
    with pytest.raises(AttributeError, match=r"module 'mesa_swarm\.model' has no attribute 'Nothing'"):
        _ = importlib.import_module("mesa_swarm.model").Nothing
    assert not hasattr(mesa_swarm, "nothing")


def test_the_finder_is_registered_once_and_last_of_ours():
    importlib.reload(mesa_swarm)
    assert sum(isinstance(finder, MovedFinder) for finder in sys.meta_path) == 1


def test_recordings_of_before_name_the_class_of_models_by_its_old_module():
    assert shipped_class("mesa_swarm.model", "SwarmModel") is SwarmModel
    assert shipped_class("mesa_swarm.model", "EngineModel") is None
    assert shipped_class("os", "path") is None


def test_former_names_of_members_still_work_with_a_warning():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, poses=[(100, 100, 0)])
    swarm = model.swarm
    swarm.remember("body.hit", (), bool, False)
    swarm.columns["heard_task"][:] = 3
    with pytest.warns(DeprecationWarning, match="called drop_body_columns now"):
        swarm.shed()
    with pytest.warns(DeprecationWarning, match="called clear_messages now"):
        swarm.hush()
    assert "body.hit" not in swarm.columns
    assert swarm.heard_task.tolist() == [-1]
    with pytest.warns(DeprecationWarning, match="one == other now"):
        assert alike(AGENT9.drive, DifferentialDrive())
