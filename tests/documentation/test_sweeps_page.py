"""The examples of docs/sweeps.md run as described."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pandas as pd
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
    lines = [shlex.split(line) for block in blocks("sh") for line in block.splitlines()]
    assert len(lines) == 8
    printed = [run(tmp_path, "-m", "mesa_swarm", *words) for _, *words in lines]
    assert len(Recording(tmp_path / "runs" / "2.arrow")) == 400
    assert "0 done, 12 to do" in printed[1]
    assert (tmp_path / "results" / "grid" / "runs.parquet").exists()
    assert len(list((tmp_path / "results" / "sample" / "recordings").iterdir())) == 8
    assert "ended by" in printed[5]
    rows = pd.read_parquet(tmp_path / "results" / "grid" / "series" / "model")
    assert len(rows) == 12 * 200
    table = (tmp_path / "results" / "grid" / "behaviorspace.csv").read_text().splitlines()
    assert len(table) == 7 + len(rows)
    assert (tmp_path / "results" / "compare_fire_fighting" / "series" / "model").is_dir()


@pytest.mark.slow
def test_the_programs_on_the_page_run(tmp_path):
    first, second = blocks("python")
    for name, program in (("first.py", first), ("second.py", second)):
        (tmp_path / name).write_text(program)
    assert run(tmp_path, "first.py").startswith("6 0")
    lines = run(tmp_path, "second.py").splitlines()
    assert len(json.loads(lines[1])) == 6
