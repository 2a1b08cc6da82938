"""The page on approximate Bayesian computation runs, where its library is installed."""

import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "abc.md"


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # of pyABC's dependencies
def test_the_code_of_the_page_draws_from_a_posterior(tmp_path, monkeypatch, capsys):
    pytest.importorskip("pyabc", reason="pyABC is not installed: pip install 'mesa-swarm[abc]'")
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    smaller = code.replace("population_size=100", "population_size=5").replace("STEPS = 500", "STEPS = 50")
    assert smaller.count("=5,") == 1
    exec(compile(smaller, "page.py", "exec"), {"__name__": "page"})
    assert re.search(r"n_robots: .*\[.*\]\nk2: .*\[.*\]", capsys.readouterr().out)
