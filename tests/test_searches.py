"""How Hypothesis searches: the same everywhere by default, anew by the deep profile, whose finds may be reported."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow  # other runs of pytest
TESTS = Path(__file__).parent
DRAWN = """
from hypothesis import given, strategies as st
{imports}
drawn = []

@given(st.floats(), st.integers())
def test_drawn(x, n):
    drawn.append((x, n))

def test_print():
    print("drawn", drawn)
"""
FALSE = """
from hypothesis import given, strategies as st

@given(st.integers(0, 10**6))
def test_all_are_small(n):
    assert n < 10

def test_plain():
    {plain}
"""


def ran(folder, text, *options, **variables):
    """Run a file of tests with the plugin, and return its code and what it printed."""
    (folder / "test_one.py").write_text(text)
    (folder / "pytest.ini").touch()
    there = {**os.environ, "PYTHONPATH": str(TESTS), "PYTEST_ADDOPTS": "", **variables}
    command = [sys.executable, "-m", "pytest", "-q", "-s", "-p", "support.searches", "-p", "no:cacheprovider", *options]
    done = subprocess.run(command, cwd=folder, env=there, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


def drawn(folder, imports="", **variables):
    code, printed = ran(folder, DRAWN.format(imports=imports), **variables)
    assert code == 0, printed
    return re.search("drawn .*", printed)[0]


def test_what_is_drawn_does_not_depend_on_the_modules_that_are_loaded(tmp_path):
    (tmp_path / "numbers_of_mine.py").write_text(f"LIST = [{', '.join(f'{k}.25, {k}777' for k in range(1, 400))}]\n")
    alone = drawn(tmp_path)
    assert len(alone) > 1000
    assert drawn(tmp_path, "import numbers_of_mine") == alone
    assert drawn(tmp_path, "import mesa_swarm.experiments") == alone


def test_the_deep_profile_draws_anew_and_prints_the_seed_that_repeats_it(tmp_path):
    deep = {"HYPOTHESIS_PROFILE": "deep", "MESA_SWARM_SLOWNESS": "20"}
    assert drawn(tmp_path, **deep) != drawn(tmp_path, **deep)
    _, printed = ran(tmp_path, DRAWN.format(imports=""), **deep)
    seed = re.search(r"--hypothesis-seed=\d+", printed)[0]
    again = ran(tmp_path, DRAWN.format(imports=""), seed, **deep)[1]
    assert re.search("drawn .*", printed)[0] == re.search("drawn .*", again)[0]


@pytest.mark.parametrize("workers", [(), ("-n", "1")])
def test_finds_of_the_deep_profile_are_reported_with_their_example_and_fail_no_run_that_asks_for_it(tmp_path, workers):
    deep = {"HYPOTHESIS_PROFILE": "deep", "MESA_SWARM_SLOWNESS": "20"}
    text = FALSE.format(plain="assert True")
    code, printed = ran(tmp_path, text, *workers, **deep, MESA_SWARM_REPORT_FINDS="1")
    assert code == 0, printed
    assert "1 found something" in printed
    assert "n=10" in printed
    assert "test_one.py::test_all_are_small" in printed
    assert ran(tmp_path, text, *workers, **deep)[0] == 1
    assert ran(tmp_path, text, *workers, MESA_SWARM_REPORT_FINDS="1")[0] == 1


def test_a_test_without_a_search_fails_a_deep_run(tmp_path):
    deep = {"HYPOTHESIS_PROFILE": "deep", "MESA_SWARM_SLOWNESS": "20", "MESA_SWARM_REPORT_FINDS": "1"}
    code, printed = ran(tmp_path, FALSE.format(plain="assert False"), **deep)
    assert (code, "1 failed, 1 xfailed" in printed) == (1, True)
