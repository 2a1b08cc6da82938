"""The page on PPO: its code trains, saves, loads and measures a policy, here a small one."""

import contextlib
import io
import re
from pathlib import Path

import numpy as np
import pytest

PAGE = Path(__file__).parents[2] / "docs" / "ppo.md"
SMALL = {
    "1_500_000, range(11, 15)": "3_000, range(11, 12)",
    "range(50_101, 50_201)": "range(50_101, 50_103)",
    "n_worlds=16": "n_worlds=2",
    "range(60_001, 60_021), 5000": "range(60_001, 60_002), 30",
}


@pytest.mark.slow
def test_the_page_trains_and_measures_a_policy(tmp_path, monkeypatch):
    pytest.importorskip("stable_baselines3")
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page"}
    code = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    for large, small in SMALL.items():
        assert sum(block.count(large) for block in code) == 1
        code = [block.replace(large, small) for block in code]
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        for block in code:
            exec(block, names)
    assert [line.split()[:2] for line in printed.getvalue().splitlines()] == [["11", "PPO"], ["11", "rule"]]
    one, other = (names["measured"](11, "ppo_11.zip") for _ in range(2))
    assert (one == other).all()
    assert np.isfinite(one).all()
    assert not (one == names["measured"](11)).all()


def test_training_and_test_maps_of_the_page_are_apart():
    text = PAGE.read_text(encoding="utf-8")
    training, test = re.findall(r"_MAPS(?:, STEPS)? = range\(([\d_]+), ([\d_]+)\)", text)
    assert int(training[1]) <= int(test[0])
