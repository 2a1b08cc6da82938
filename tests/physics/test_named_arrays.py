"""Arrays that compiled functions take have names: no number is an index into a tuple of them."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from mesa_swarm import physics

ROOM = Path(physics.__file__).parent
# Names of single arrays and of lists, whose places are numbers by nature.
ARRAYS = {"bounds", "radius", "members", "rows", "overlaps", "pairs", "drives"}
# Beside compiled functions all functions of these files.
WHOLE = {"crowd.py", "engine.py", "stage_kernels.py", "travel.py"}
MOST_PASSED_OVER = 2


def is_compiled(function: ast.FunctionDef) -> bool:
    """Return whether a function is decorated with `compiled`."""
    return any("compiled" in ast.unparse(decorator) for decorator in function.decorator_list)


def is_numeric(index: ast.expr) -> bool:
    """Return whether an index is a whole number, or a slice from or to one."""
    if isinstance(index, ast.Slice):
        return any(is_numeric(end) for end in (index.lower, index.upper) if end is not None)
    if isinstance(index, ast.UnaryOp):
        return is_numeric(index.operand)
    return isinstance(index, ast.Constant) and type(index.value) is int


def numbered(function: ast.FunctionDef) -> Iterator[str]:
    """Iterate over numbers as indices of what is not a single array."""
    for node in ast.walk(function):
        if isinstance(node, ast.Subscript) and is_numeric(node.slice):
            name = ast.unparse(node.value)
            is_shape = isinstance(node.value, ast.Attribute) and node.value.attr == "shape"
            if not (is_shape or isinstance(node.value, ast.Call) or name in ARRAYS):
                yield f"line {node.lineno}: {ast.unparse(node)}"


def passed_over(tree: ast.AST) -> Iterator[str]:
    """Iterate over unpackings of which more than two names are underscores."""
    for node in ast.walk(tree):
        names = node.elts if isinstance(node, ast.Tuple) and isinstance(node.ctx, ast.Store) else []
        if sum(ast.unparse(name) == "_" for name in names) > MOST_PASSED_OVER:
            yield f"line {node.lineno}: {ast.unparse(node)}"


def nameless(source: str, whole: bool) -> list[str]:
    """Return where a file has numbers in place of names."""
    tree = ast.parse(source)
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    lines = [line for function in functions if whole or is_compiled(function) for line in numbered(function)]
    return [*lines, *passed_over(tree)]


@pytest.mark.parametrize("path", sorted(ROOM.glob("*.py")), ids=lambda path: path.name)
def test_arrays_of_the_physics_are_named(path):
    assert nameless(path.read_text(encoding="utf-8"), path.name in WHOLE) == []


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("movers = statics[8]", "statics[8]"),
        ("turn(order, crowd[6][4])", "crowd[6]"),
        ("moved = self._travelling[:2] + self._travelling[3:]", "self._travelling[3:]"),
        ("last = statics[-1]", "statics[-1]"),
        ("_, places, _, radii, _ = crowd", "(_, places, _, radii, _)"),
        ("for k, (_, _, _, free) in crowds: pass", "(_, _, _, free)"),
    ],
)
def test_numbers_in_place_of_names_are_found(line, shown):
    source = f"@compiled(nogil=True)\ndef go(statics, crowd):\n    {line}\n"
    assert any(shown in line for line in nameless(source, whole=False))


@pytest.mark.parametrize(
    "line", ["x = bounds[0] + position[i, 0]", "n = statics.edges.shape[0]", "depth = deepest(x, y)[0]", "_, _, a = b"]
)
def test_places_of_arrays_are_numbers(line):
    assert nameless(f"@compiled\ndef go(statics, position):\n    {line}\n", whole=False) == []
