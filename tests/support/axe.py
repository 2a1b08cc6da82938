"""What axe-core finds on a page against the accessibility guidelines WCAG."""

from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest


@cache
def script() -> str:
    """Return axe-core, which comes with a package; a page gets it past its content security policy."""
    found = find_spec("axe_playwright_python")
    if found is None or found.origin is None:
        pytest.skip("axe-core is missing (pip install axe-playwright-python)")
    return Path(found.origin).with_name("axe.min.js").read_text(encoding="utf-8")


def axe_findings(page) -> list[str]:
    """Return each rule that is broken, with the elements that break it."""
    page.evaluate(script())
    found = page.evaluate("axe.run()")["violations"]
    return [f"{one['id']}: {[node['html'][:120] for node in one['nodes'][:3]]}" for one in found]
