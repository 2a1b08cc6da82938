"""Functions compiled apart from their callers: the same results and errors, in one copy, also when loaded from disk."""

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tests.support.apart_functions import halves, quarters, twice_the_sum

SCRIPT = "tests.support.apart_functions"
SHOW_CODE = f"""
import numpy as np
from {SCRIPT} import quarters
quarters(np.ones(2))
print(*quarters.inspect_llvm().values())
"""


@pytest.mark.slow
@given(arrays(np.float64, st.integers(1, 9), elements=st.integers(-999, 999).map(float)))
def test_a_function_apart_returns_to_compiled_callers_what_it_returns_to_python(values):
    assert quarters(values).tolist() == halves(halves(values)).tolist()
    assert twice_the_sum(values, values) == (2 * quarters(values).sum(), values[0] / 2)


def test_an_error_of_a_function_apart_reaches_the_caller():
    with pytest.raises(ValueError, match="nothing to halve"):
        quarters(np.empty(0))


def test_arrays_that_a_function_apart_returns_are_freed_once():
    values = np.arange(1e4)
    made = [quarters(values) for _ in range(300)]
    del made[::2]
    assert all((one == values / 4).all() for one in made)


@pytest.mark.slow
def test_the_code_of_a_function_apart_is_not_in_that_of_its_callers(tmp_path):
    """Both are new here: of code from the disk Numba shows nothing."""
    settings = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", SHOW_CODE], env=settings, capture_output=True, text=True, check=True)
    names = [line for line in done.stdout.splitlines() if "apart_functions" in line and "halves" in line]
    assert any(line.startswith("declare") for line in names)
    assert not any(line.startswith("define") for line in names)


@pytest.mark.slow
def test_another_process_loads_callers_and_what_they_call_from_disk(tmp_path):
    def run():
        settings = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
        done = subprocess.run([sys.executable, "-m", SCRIPT], env=settings, capture_output=True, text=True, check=True)
        return done.stdout.split()

    first, later = run(), run()
    assert first[:2] == later[:2] == ["18.0", "1.5"]
    assert [int(first[3]), int(later[3])] == [5, 0]
    assert int(later[2]) == 1


@pytest.mark.slow
def test_a_caller_finds_a_function_apart_that_was_compiled_again_since(tmp_path):
    """The machine code of the callee alone is removed from disk: the caller's is loaded, and calls the new one."""
    settings = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-m", SCRIPT]
    first = subprocess.run(command, env=settings, capture_output=True, text=True, check=True).stdout.split()
    removed = [path for path in tmp_path.rglob("apart_functions.halves-*")]
    for path in removed:
        path.unlink()
    again = subprocess.run(command, env=settings, capture_output=True, text=True, check=True).stdout.split()
    assert removed
    assert again == [*first[:2], "1", "2"]
