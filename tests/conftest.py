"""What all tests share."""

import os
import signal
import sys
from pathlib import Path

from hypothesis import HealthCheck, settings


def pytest_addoption(parser):
    parser.addoption("--screenshots", metavar="DIR", help="where browser tests write pictures for a person to look at")


sys.path.insert(0, str(Path(__file__).parent))

# Who runs the tests in the background of a shell has told them, and what they start, to ignore Ctrl-C.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# The first example of a property may compile a kernel, so that there is no deadline.
settings.register_profile(
    "fast", max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("deep", parent=settings.get_profile("fast"), max_examples=2000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fast"))
