"""The page on PPO: its code trains, saves, loads and measures a policy, here a small one."""

import contextlib
import io
import re
from pathlib import Path

import numpy as np
import pytest

from mesa_swarm import cli
from mesa_swarm_studies.benchmarks.benchmark_tasks import TRAIN
from mesa_swarm_studies.benchmarks.ppo import ROBOT_STEPS, SETTINGS, WORLDS

PAGE = Path(__file__).parents[2] / "docs" / "ppo.md"
SMALL = {"1_500_000, range(50_101, 50_201)": "3_000, range(50_101, 50_103)", "n_worlds=16": "n_worlds=2"}
BRIEF = "--maps 1 --seeds 1 --evaluation-steps 30 --jobs 1 --quiet"


@pytest.mark.slow
def test_the_page_trains_a_policy_that_its_command_measures(tmp_path, monkeypatch, capsys):
    pytest.importorskip("stable_baselines3")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page"}
    text = PAGE.read_text(encoding="utf-8")
    code = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    for large, small in SMALL.items():
        assert sum(block.count(large) for block in code) == 1
        code = [block.replace(large, small) for block in code]
    with contextlib.redirect_stdout(io.StringIO()):
        for block in code:
            exec(block, names)
    assert np.isfinite(list(names["found"].values())).sum() >= 5
    (command,) = re.findall(r"^mesa-swarm (.*)$", text, re.MULTILINE)
    with pytest.raises(SystemExit) as end:
        cli.main([*command.split(), *BRIEF.split()])
    assert end.value.code == 0
    assert "| ppo.zip " in capsys.readouterr().out


def test_the_page_shows_the_settings_of_the_contestant():
    text = PAGE.read_text(encoding="utf-8")
    first, last = re.search(r"range\(([\d_]+), ([\d_]+)\)", text).groups()
    assert range(int(first), int(last)) == TRAIN
    assert f"n_worlds={WORLDS}," in text
    assert f"{ROBOT_STEPS:_}," in text
    shown = dict(re.findall(r"^    (\w+)=(.*),$", text, re.MULTILINE))
    assert {name: eval(shown[name]) for name in SETTINGS} == SETTINGS
