"""A plugin of pytest: how Hypothesis searches, by default the same everywhere, and anew by the profile `deep`.

What a failed search of the deep profile found is work to come rather than a fault of the commit under test: with the
variable `MESA_SWARM_REPORT_FINDS` it is printed, and the run passes.
"""

import os
import random

import pytest
from hypothesis import HealthCheck, is_hypothesis_test, settings
from hypothesis.internal.conjecture import providers

from support.pace import in_time

# Hypothesis draws constants that it reads in the modules that are loaded, which depends on the tests that ran before:
# for it no module is local. `tests/test_searches.py` fails if a version of Hypothesis reads them otherwise.
pytest.MonkeyPatch().setattr(providers, "is_local_module_file", lambda path: False, raising=False)

# The first example of a property may compile a kernel, so that there is no deadline.
settings.register_profile(
    "fast", max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile(
    "deep", parent=settings.get_profile("fast"), max_examples=in_time(2000), derandomize=False, database=None
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fast"))

FIND = "found by the deep search"


def is_deep() -> bool:
    """Whether properties are searched anew."""
    return os.environ.get("HYPOTHESIS_PROFILE") == "deep"


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config):
    """Draw the seed of a deep search before other processes are started, which get it as an option."""
    if is_deep() and config.getoption("hypothesis_seed") is None:
        config.option.hypothesis_seed = str(random.SystemRandom().randrange(2**32))


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    """Count what a deep search found as expected to fail, if finds are only to be reported."""
    report = (yield).get_result()
    searched = is_deep() and is_hypothesis_test(getattr(item, "obj", None))
    if searched and report.when == "call" and report.failed and os.environ.get("MESA_SWARM_REPORT_FINDS"):
        report.outcome, report.wasxfail = "skipped", FIND


def pytest_terminal_summary(terminalreporter, config):
    """Print the seed of a deep search, and what it found."""
    if not is_deep():
        return
    finds = [each for each in terminalreporter.stats.get("xfailed", []) if getattr(each, "wasxfail", "") == FIND]
    terminalreporter.section("deep search")
    terminalreporter.write_line(f"repeated by --hypothesis-seed={config.getoption('hypothesis_seed')}")
    terminalreporter.write_line(f"{len(finds)} found something")
    for find in finds:
        terminalreporter.write_line(f"\n{find.nodeid}\n{find.longreprtext}")
