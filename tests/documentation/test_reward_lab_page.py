import contextlib
import io
import re
from pathlib import Path

PAGE = (Path(__file__).parents[2] / "docs" / "reward_lab.md").read_text()


def test_the_page_s_code_runs_and_prints_what_the_page_shows():
    code, text = (re.findall(rf"^```{what}\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE) for what in ("python", "text"))
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        for block in code:
            exec(block, {})
    assert printed.getvalue() == "".join(text)
