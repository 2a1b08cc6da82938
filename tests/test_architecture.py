"""The floors: a file imports only from floors below it, and every file has its line in ARCHITECTURE.md."""

import ast
import re
from collections.abc import Iterable
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "mesa_swarm"
MODULES = sorted(PACKAGE.rglob("*.py"))
NAMES = [str(path.relative_to(PACKAGE)) for path in MODULES]

# Floor of each folder or file (HOUSE 2); what may be imported sideways is stated.
FLOORS = {
    "errors.py": 0,
    "files.py": 0.5,
    "progress.py": 0,
    "streams.py": 0,
    "geometry": 1,
    "world": 2,
    "robots": 3,
    "physics": 4,
    "control": 5,
    "fire": 5,
    "learning": 5.2,  # above control: a policy is a layer
    "world_model.py": 5.5,
    "observed_world.py": 5.7,
    "recorded_world.py": 5.8,
    "model.py": 6,
    "parameters.py": 6,
    "reporters.py": 6,
    "analysis": 7,
    "models": 7,
    "gallery.py": 7.5,
    "recording": 7.5,  # above analysis, whose groups tell of merges
    "viewing": 7.8,
    "environments": 8,
    "experiments": 8,
    "exports": 8.3,  # above experiments, whose pictures are its stills
    "teaching": 8.4,  # pictures of experiments, and what a notebook asks of a model
    "reproduction": 8.5,  # above experiments, whose statistics and pictures it uses
    "dashboard": 8.6,
    "study_cli.py": 8.8,
    "cli.py": 9,
}
# `model.record(...)` and `SwarmModel.resume(...)` are what people type; they import what does it when called.
UPWARDS = {
    ("recorded_world.py", "mesa_swarm.recording.recorder"),
    ("recorded_world.py", "mesa_swarm.recording.resume"),
    ("recorded_world.py", "mesa_swarm.recording.recording"),
    ("recorded_world.py", "mesa_swarm.recording.verify"),
    ("recorded_world.py", "mesa_swarm.viewing.canvas_widget"),
    # What they return, for type checkers only.
    ("recorded_world.py", "mesa_swarm.viewing.canvas_widget"),
}
# Narrower than a floor: analysis knows arrays, not the model.
ONLY = {"analysis": {"analysis", "errors.py", "geometry"}}
OUTSIDE = {
    0: {"numpy", "tqdm"},
    1: {"numpy", "numba", "shapely"},
    2: {"numpy", "shapely", "mesa", "defusedxml", "svgelements"},
    3: {"numpy", "mesa"},
    4: {"numpy", "shapely"},
    5: {"numpy", "numba"},
    5.2: {"numpy", "numba", "cmaes"},
    5.5: {"numpy", "mesa"},
    5.7: {"numpy"},
    5.8: set(),
    6: {"numpy", "mesa"},
    "analysis": {"numpy", "numba", "scipy"},
    "recording": {"numpy", "pandas", "pyarrow", "mesa", "shapely"},
    "viewing": {"numpy"},
}
STANDARD = {"__future__", *__import__("sys").stdlib_module_names}


def part_of(module: str) -> str:
    """Return the folder or file below the package that a dotted name belongs to."""
    first = module.removeprefix("mesa_swarm.").split(".")[0]
    return f"{first}.py" if f"{first}.py" in FLOORS else first


def imports_of(path: Path) -> list[str]:
    return imported_by(ast.walk(ast.parse(path.read_text())))


def imported_by(nodes: Iterable[ast.AST]) -> list[str]:
    modules = []
    for node in nodes:
        if isinstance(node, ast.Import):
            modules += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            modules.append(node.module)
    return modules


def imports_when_run(path: Path) -> list[str]:
    """Return what is imported besides what only type checkers import."""
    tree = ast.parse(path.read_text())
    blocks = [n for n in ast.walk(tree) if isinstance(n, ast.If) and ast.unparse(n.test) == "TYPE_CHECKING"]
    unread = {id(node) for block in blocks for node in ast.walk(block)}
    return imported_by(node for node in ast.walk(tree) if id(node) not in unread)


def part_of_file(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0]


@pytest.mark.parametrize("path", MODULES, ids=NAMES)
def test_a_file_imports_only_from_its_own_room_and_from_floors_below_it(path):
    part = part_of_file(path)
    if part == "__init__.py":
        return
    for module in imports_of(path):
        if module.startswith("mesa_swarm.") and (path.name, module) not in UPWARDS:
            target = part_of(module)
            assert target == part or FLOORS[target] < FLOORS[part], f"{path.name} imports {module}"
            assert target in ONLY.get(part, {target}), f"{path.name} imports {module}"


@pytest.mark.parametrize("path", MODULES, ids=NAMES)
def test_a_file_imports_only_the_packages_that_its_floor_may(path):
    part = part_of_file(path)
    allowed = OUTSIDE.get(part, OUTSIDE.get(FLOORS.get(part, 8)))
    if allowed is None:
        return
    for module in imports_of(path):
        first = module.split(".")[0]
        assert first in {*allowed, *STANDARD, "mesa_swarm"}, f"{path.name} imports {module}"


@pytest.mark.parametrize("path", MODULES, ids=NAMES)
def test_no_module_imports_the_package_root(path):
    assert "mesa_swarm" not in imports_of(path)


def test_there_is_no_circle_of_imports():
    names = {".".join(("mesa_swarm", *p.relative_to(PACKAGE).with_suffix("").parts)): p for p in MODULES}
    graph = {n: [m for m in imports_when_run(p) if m in names and (p.name, m) not in UPWARDS] for n, p in names.items()}
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


@pytest.mark.parametrize("name", [n for n in NAMES if not n.endswith("__init__.py")])
def test_every_module_is_described_by_one_line_of_the_architecture_page(name):
    lines = [line for line in (ROOT / "ARCHITECTURE.md").read_text().splitlines() if f"`{name}`" in line]
    assert len(lines) == 1


def test_the_architecture_page_describes_no_module_that_is_gone():
    described = re.findall(r"^\| [\d.]+ \| `([^`]+\.py)`", (ROOT / "ARCHITECTURE.md").read_text(), re.MULTILINE)
    assert len(described) > 200
    assert [name for name in described if not (PACKAGE / name).exists()] == []


@pytest.mark.parametrize("path", sorted((ROOT / "models").glob("*.py")), ids=lambda p: p.name)
def test_a_model_file_is_short_enough_to_be_read_at_one_go(path):
    assert len(path.read_text().splitlines()) < 120


def test_heavy_packages_of_looking_are_imported_on_the_top_floors_only():
    heavy, top = (
        {"solara", "matplotlib", "anywidget"},
        {"experiments", "exports", "reproduction", "dashboard", "cli.py"},
    )
    others = [path for path in MODULES if part_of_file(path) not in top]
    guilty = [
        str(path)
        for path in [*others, *(ROOT / "models").glob("*.py")]
        if heavy & {module.split(".")[0] for module in imports_when_run(path)}
    ]
    assert not guilty
