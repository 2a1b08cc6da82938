"""A report of the sizes of the package, to be read: no limit of lines decides where a file ends.

::

    python tests/support/size_report.py

prints lines and files of each room, the longest files and functions, files that only one other file of their room
imports, and how often variables have vague names: participles and `one`.
"""

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "mesa_swarm"
VAGUE = {"found", "one", "known", "given", "made", "taken", "asked", "wanted", "left_over", "each"}
LONGEST_FILES, LONG_FUNCTION = 10, 50


def sources() -> dict[str, Path]:
    """Return all sources of the package, Python and what browsers run, by their path from it."""
    files = (path for kind in ("py", "js", "css") for path in PACKAGE.rglob(f"*.{kind}"))
    return {path.relative_to(PACKAGE).as_posix(): path for path in files if not path.is_relative_to(PACKAGE / "models")}


def lines_of(path: Path) -> int:
    return len(path.read_text(encoding="utf-8").splitlines())


def room_of(name: str) -> str:
    return name.partition("/")[0]


def modules_imported(tree: ast.Module) -> Iterator[str]:
    """Iterate over the modules that a source imports, or may import names from."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            yield str(node.module)
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def only_importers(trees: dict[str, ast.Module]) -> dict[str, str]:
    """Return files that one other file imports, of the same room, with that file."""
    modules = {"mesa_swarm." + name.removesuffix(".py").replace("/", "."): name for name in trees}
    importers = defaultdict(set)
    for name, tree in trees.items():
        for module in set(modules_imported(tree)) & modules.keys():
            importers[modules[module]].add(name)
    single = {name: next(iter(others)) for name, others in importers.items() if len(others) == 1}
    single = {name: other for name, other in single.items() if not other.endswith("__init__.py")}
    return {name: other for name, other in single.items() if room_of(name) == room_of(other)}


def long_functions(trees: dict[str, ast.Module]) -> list[tuple[int, str]]:
    """Return functions of more than `LONG_FUNCTION` lines without their docstring, with their length."""
    functions = []
    for name, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                first = node.body[1 if ast.get_docstring(node) and len(node.body) > 1 else 0].lineno
                functions.append((int(node.end_lineno or 0) - first + 1, f"{name}:{node.lineno} {node.name}"))
    return sorted(pair for pair in functions if pair[0] > LONG_FUNCTION)[::-1]


def vague_names(trees: dict[str, ast.Module]) -> Counter[str]:
    """Count how often vague names are assigned."""
    names = (node for tree in trees.values() for node in ast.walk(tree) if isinstance(node, ast.Name))
    return Counter(node.id for node in names if node.id in VAGUE and isinstance(node.ctx, ast.Store))


def main() -> None:
    """Print the report."""
    files = sources()
    trees = {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in files.items() if path.suffix == ".py"}
    lengths = {name: lines_of(path) for name, path in files.items()}
    print(f"the package: {sum(lengths.values())} lines in {len(lengths)} files")
    for room in sorted({room_of(name) for name in files}):
        of_room = [length for name, length in lengths.items() if room_of(name) == room]
        print(f"  {room}: {sum(of_room)} lines in {len(of_room)} files")
    print("the longest files:")
    for name in sorted(lengths, key=lengths.__getitem__, reverse=True)[:LONGEST_FILES]:
        print(f"  {lengths[name]} {name}")
    print(f"functions of more than {LONG_FUNCTION} lines:")
    for length, name in long_functions(trees):
        print(f"  {length} {name}")
    print("files that only one other of their room imports:")
    for name, other in sorted(only_importers(trees).items()):
        print(f"  {name} by {other}")
    print("vague names:", ", ".join(f"{name} {count}" for name, count in vague_names(trees).most_common()))


if __name__ == "__main__":
    main()
