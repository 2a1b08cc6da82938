import contextlib
import io
import re
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "environments.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)


@pytest.mark.slow
def test_the_page_s_code_runs_and_prints_what_the_page_shows():
    names, printed = {}, io.StringIO()
    with contextlib.redirect_stdout(printed):
        for block in blocks("python"):
            if "stable_baselines3" not in block:
                exec(block, names)
    assert printed.getvalue() == "".join(blocks("text"))
    assert names["picture"].shape == (480, 640, 3)


@pytest.mark.slow
def test_the_page_s_code_for_stable_baselines_runs():
    pytest.importorskip("stable_baselines3")
    names = {}
    exec("from mesa_swarm.environments import CollisionAvoidance, Variation", names)
    exec("from mesa_swarm.maps.random_map import random_map", names)
    (block,) = [block for block in blocks("python") if "stable_baselines3" in block]
    exec(block, names)
    assert names["actions"].shape == (240, 2)
