"""The house as ARCHITECTURE.md draws it: rooms on floors, imports downwards only, and where to find things."""

import ast
import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest
from mesa.experimental.continuous_space import ContinuousSpaceAgent

from mesa_swarm import AGENT9, Field, Lamp, Radio, SwarmModel, disc
from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.model.parts import METHODS

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "mesa_swarm"
PAGE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
LONGEST_PAGE = 200
ROW = re.compile(r"^\| (\d+) \| ((?:`[\w/.]+` ?)+) \|", re.MULTILINE)
# Where | file | name | of the table of questions.
QUESTION = re.compile(r"^\| ([^|]+\?) \| `([^`]+)`[^|]*\| `([^`]+)` \|", re.MULTILINE)
QUESTIONS = QUESTION.findall(PAGE)
# Phase | part | stage of the table of the plan.
STAGE = re.compile(r"^\| (\w+) \| (\w+) \| ([^|]+) \| [^|]+ \| [^|]+ \|$", re.MULTILINE)

# Other packages that a room may import, besides the standard library, where that is less than all declared ones.
OUTSIDE = {
    "base": {"numpy", "tqdm"},
    "kernels": {"numpy", "numba", "llvmlite"},
    "geometry": {"numpy", "numba", "shapely"},
    "world": {"numpy", "shapely", "mesa"},
    "maps": {"numpy", "shapely", "defusedxml", "svgelements"},
    "robots": {"numpy", "mesa"},
    "physics": {"numpy", "shapely"},
    "control": {"numpy", "numba"},
    "fire": {"numpy", "mesa"},
    "learning": {"numpy", "numba", "cmaes", "onnx", "onnxruntime"},
    "analysis": {"numpy", "numba", "scipy"},
    "model": {"numpy", "mesa", "shapely"},
    "recording": {"numpy", "pandas", "pyarrow", "mesa", "shapely"},
    "swarm_model.py": set(),
}
# What analysis measures is arrays, not models.
ONLY = {"analysis": {"analysis", "base", "kernels", "geometry"}}
# Names that others prescribe: PettingZoo for tasks, and what `python -m` runs.
PRESCRIBED = {"env", "export", "main", "parallel_env"}
HEAVY = {"solara", "matplotlib", "anywidget"}
STANDARD = {"__future__", *sys.stdlib_module_names}


def sources() -> Iterator[tuple[str, Path]]:
    """Iterate over all modules of the package, models among them, by their path from the package."""
    for path in sorted(PACKAGE.rglob("*.py")):
        if not path.is_relative_to(PACKAGE / "models"):  # the link of an editable installation
            yield path.relative_to(PACKAGE).as_posix(), path
    for path in sorted((ROOT / "models").glob("*.py")):
        yield f"models/{path.name}", path


MODULES = dict(sources())
NAMES = {"mesa_swarm." + name.removesuffix(".py").removesuffix("/__init__").replace("/", "."): name for name in MODULES}


def floors() -> dict[str, tuple[int, str]]:
    """Return floor and room of each folder or file that the page's table names; the files of a row are one room."""
    places = {}
    for floor, row in ROW.findall(PAGE):
        files = " ".join(part for part in re.findall(r"`([^`]+)`", row) if part.endswith(".py"))
        for part in re.findall(r"`([^`]+)`", row):
            places[part.rstrip("/")] = int(floor), files if part.endswith(".py") else part.rstrip("/")
    return places


FLOORS = floors()


def part_of(name: str) -> str:
    """Return the folder or file below the package in which a module lies."""
    return name.split("/", maxsplit=1)[0]


@cache
def tree_of(name: str) -> ast.Module:
    return ast.parse(MODULES[name].read_text(encoding="utf-8"))


@cache
def imports_of(name: str) -> frozenset[str]:
    """Return all that a module imports: at its top, within functions, and for type checkers only."""
    modules = set()
    for node in ast.walk(tree_of(name)):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name} has a relative import"
            longer = {f"{node.module}.{alias.name}" for alias in node.names}
            modules |= (longer & NAMES.keys()) | ({str(node.module)} if longer - NAMES.keys() else set())
    return frozenset(modules)


def inner_imports_of(name: str) -> list[str]:
    """Return the modules of the package that a module imports."""
    return [NAMES[module] for module in imports_of(name) if module in NAMES]


def test_every_room_has_one_row_with_a_whole_floor():
    parts = {part_of(name) for name in MODULES}
    assert FLOORS.keys() == parts
    assert len(re.findall(r"^\| \d+\.\d", PAGE, re.MULTILINE)) == 0
    assert sum(len(re.findall("`", row)) // 2 for _, row in ROW.findall(PAGE)) == len(FLOORS)


@pytest.mark.slow
@pytest.mark.parametrize("part", sorted(FLOORS))
def test_a_room_imports_only_from_itself_and_from_floors_below(part):
    floor, room = FLOORS[part]
    for name in MODULES:
        if part_of(name) == part:
            for target in inner_imports_of(name):
                below, other = FLOORS[part_of(target)]
                assert other == room or below < floor, f"{name} imports {target}"
                assert part_of(target) in ONLY.get(part, {part_of(target)}), f"{name} imports {target}"


@pytest.mark.parametrize("part", sorted(OUTSIDE))
def test_a_room_imports_only_the_packages_that_it_may(part):
    for name in MODULES:
        if part_of(name) == part:
            first = {module.split(".")[0] for module in imports_of(name)}
            assert first <= {*OUTSIDE[part], *STANDARD, "mesa_swarm"}, name


def test_what_draws_is_imported_on_the_upper_floors_only():
    lowest = FLOORS["viewing"][0]
    low = [name for name in MODULES if FLOORS[part_of(name)][0] < lowest or name.startswith("models/")]
    assert not [name for name in low if HEAVY & {module.split(".")[0] for module in imports_of(name)}]


def test_no_module_imports_the_package_root():
    assert not [name for name in MODULES if "mesa_swarm" in imports_of(name) and not name.startswith("models/")]


def test_the_plan_and_the_physics_do_not_know_the_word_fire():
    engine = [path for name, path in MODULES.items() if name.startswith(("kernels/p", "physics/"))]
    assert len(engine) > 10
    assert [path.name for path in engine if "fire" in path.read_text(encoding="utf-8").lower()] == []


def test_there_is_no_circle_of_imports():
    graph = {name: inner_imports_of(name) for name in MODULES}
    finished: set[str] = set()

    def visit(name: str, trail: tuple[str, ...]) -> None:
        assert name not in trail, " -> ".join((*trail, name))
        if name not in finished:
            for target in graph[name]:
                visit(target, (*trail, name))
            finished.add(name)

    for name in graph:
        visit(name, ())
    assert finished == set(graph)


def test_a_class_name_is_used_once_in_the_package():
    homes: dict[str, list[str]] = {}
    for name in MODULES:
        # A task of a learner and the model of that task have the same documented name.
        for node in () if name.startswith("models/") else tree_of(name).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, []).append(name)
    assert {name: places for name, places in homes.items() if len(places) > 1} == {}


def test_a_function_name_is_used_once_in_the_package():
    homes: dict[str, list[str]] = {}
    for name in MODULES:
        # Each model is read by itself.
        for node in () if name.startswith("models/") else tree_of(name).body:
            is_overload = isinstance(node, ast.FunctionDef) and [ast.unparse(line) for line in node.decorator_list] == [
                "overload"
            ]
            if isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and not is_overload:
                homes.setdefault(node.name, []).append(name)
    repeated = {name: places for name, places in homes.items() if len(places) > 1}
    assert {name: places for name, places in repeated.items() if name not in PRESCRIBED} == {}


def test_the_root_holds_the_public_names_the_model_and_folders_only():
    assert {name for name in MODULES if "/" not in name} == {"__init__.py", "__main__.py", "swarm_model.py"}


def test_the_page_draws_the_plan_of_a_model_with_everything():
    model = SwarmModel(map="openspace_fire", rng=1, communication=Radio(range=100))
    model.add_robots(replace(AGENT9, actuators=(Lamp(),)), 2)
    model.add_field(Field("trail"))
    sheep = ContinuousSpaceAgent(model.space, model)
    sheep.position = (100.0, 100.0)
    model.add_body(disc((100, 100), 5), kind="sheep", agent=sheep)
    model.control = Subsumption(Explore())
    model.watch()
    drawn = [line for line in STAGE.findall(PAGE) if line[0] != "phase"]
    assert drawn == [(stage.phase.name.lower(), part, stage.name) for part, stage in model.plan.stages]
    assert all(f"`{part}`" in PAGE for part in model.parts)


def test_the_page_names_all_members_of_a_part():
    table = PAGE.partition("| member | answers |")[2].partition("\n\n")[0]
    members = {
        name for row in re.findall(r"^\| (`[^|]+) \|", table, re.MULTILINE) for name in re.findall(r"`(\w+)", row)
    }
    assert members == {"name", *METHODS}


def test_the_page_is_short_and_answers_twenty_questions():
    assert len(PAGE.splitlines()) <= LONGEST_PAGE
    assert len(QUESTIONS) >= 20


@pytest.mark.parametrize(("question", "file", "name"), QUESTIONS, ids=[question for question, _, _ in QUESTIONS])
def test_a_thing_is_where_the_page_lists_it(question, file, name):
    path = ROOT / file if (ROOT / file).exists() else PACKAGE / file
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        assert name in set(defined_in(ast.parse(text))), f"{file} does not define {name}"
    else:
        assert re.search(rf"\b{re.escape(name)}\b", text), f"{file} does not hold {name}"


def defined_in(tree: ast.Module) -> Iterator[str]:
    """Iterate over what a module defines: functions, classes, methods as Class.method, and constants."""
    for node in tree.body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            yield node.name
        if isinstance(node, ast.ClassDef):
            for inner in node.body:
                if isinstance(inner, ast.FunctionDef):
                    yield f"{node.name}.{inner.name}"
                elif isinstance(inner, ast.AnnAssign):
                    yield f"{node.name}.{ast.unparse(inner.target)}"
        elif isinstance(node, (ast.Assign, ast.AnnAssign)):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            yield from (ast.unparse(one) for target in targets for one in ast.walk(target) if isinstance(one, ast.Name))
