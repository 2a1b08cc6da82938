"""Two programs written against version 0.1.0 run unchanged, and print what they printed then.

State hashes are the exception: since version 0.2.0 they include what a model was made with, and since version 0.3.0 the
bits are others. The programs print those of the form of version 0.1.0, as version 0.3.0 gives them.
"""

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAMS = Path(__file__).parent / "programs"
WITH_FORMER_HASHES = """
import runpy, sys
from mesa_swarm import SwarmModel
from mesa_swarm.model.state_hash import written_state_hash
SwarmModel.state_hash = written_state_hash
sys.argv = sys.argv[1:]
sys.path.insert(0, sys.argv[1])
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def ran(*arguments):
    command = [sys.executable, "-W", "error", "-W", "default::DeprecationWarning", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("Traceback")) == (0, 0), done.stderr[-2000:]
    return done.stdout.splitlines()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fire_study", "own_rules"])
def test_a_program_of_version_0_1_0_prints_the_same_lines(name):
    lines = ran("-c", WITH_FORMER_HASHES, PROGRAMS / f"{name}.py", PROGRAMS)
    assert lines == (PROGRAMS / f"{name}.txt").read_text().splitlines()


@pytest.mark.slow
def test_a_program_of_version_0_1_0_runs_as_it_is():
    lines, former = ran(PROGRAMS / "fire_study.py"), (PROGRAMS / "fire_study.txt").read_text().splitlines()
    different = [k for k, (line, before) in enumerate(zip(lines, former, strict=True)) if line != before]
    assert all(len(former[k].split()[-1]) == 32 for k in different)
