"""Two programs written against version 0.1.0 run unchanged, and print what they printed then."""

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAMS = Path(__file__).parent / "programs"


@pytest.mark.parametrize("name", ["fire_study", "own_rules"])
def test_a_program_of_version_0_1_0_prints_the_same_lines(name):
    command = [sys.executable, "-W", "error", "-W", "default::DeprecationWarning", PROGRAMS / f"{name}.py"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("Traceback")) == (0, 0), done.stderr[-2000:]
    assert done.stdout.splitlines() == (PROGRAMS / f"{name}.txt").read_text().splitlines()
