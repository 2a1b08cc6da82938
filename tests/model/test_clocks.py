"""Tests do not depend on how fast the machine is: outside benchmarks none reads the time of day."""

import ast
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
CLOCKS = {"time", "time_ns", "monotonic", "monotonic_ns", "perf_counter", "perf_counter_ns"}
# Deadlines against hangs, and when slow tests are left out.
ALLOWED = {"support/waiting.py": {"monotonic"}, "support/pace.py": {"time"}}


def clocks_read(path: Path) -> set[str]:
    """Return the names of the clocks that a file reads, also in programs that it holds as text."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "time":
            found.add(node.attr)
        elif isinstance(node, ast.ImportFrom) and node.module == "time":
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.update(name for name in CLOCKS if f"time.{name}()" in node.value)
    return found & CLOCKS


@pytest.mark.slow
def test_only_benchmarks_measure_elapsed_time():
    files = {path.relative_to(TESTS).as_posix(): clocks_read(path) for path in TESTS.rglob("*.py")}
    others = {name: read for name, read in files.items() if read and not name.startswith("benchmarks/")}
    assert others == ALLOWED


def test_a_clock_is_found_wherever_it_is_read(tmp_path):
    file = tmp_path / "some.py"
    for text in ("import time\ntime.CLOCK()", "from time import CLOCK", 'CODE = "print(time.CLOCK())"'):
        file.write_text(text.replace("CLOCK", "monotonic"))
        assert clocks_read(file)
    file.write_text("import time\ntime.sleep(1)\ntime.process_time()")
    assert not clocks_read(file)
