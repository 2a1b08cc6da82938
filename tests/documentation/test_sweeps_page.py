"""The examples of docs/sweeps.md run as described."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from mesa_swarm.recording import Recording

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "sweeps.md").read_text()


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)


def written_jobs(folder):
    for block in blocks("toml"):
        (folder / block.split()[1]).write_text(block)


def run(folder, *words):
    environment = {"PATH": "/usr/bin:/bin", "HOME": str(folder), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, *words]
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_the_commands_on_the_page_run(tmp_path):
    written_jobs(tmp_path)
    lines = [line.split() for block in blocks("sh") for line in block.splitlines()]
    assert len(lines) == 4
    printed = [run(tmp_path, "-m", "mesa_swarm", *words) for _, *words in lines]
    assert len(Recording(tmp_path / "runs" / "2.arrow")) == 400
    assert "0 done, 12 to do" in printed[1]
    assert (tmp_path / "results" / "grid" / "runs.parquet").exists()
    assert len(list((tmp_path / "results" / "sample" / "recordings").iterdir())) == 8


@pytest.mark.slow
def test_the_program_on_the_page_runs(tmp_path):
    (program,) = blocks("python")
    (tmp_path / "program.py").write_text(program)
    assert run(tmp_path, "program.py").startswith("6 0")
