"""Every test of the dashboard ends with its threads."""

import pytest

from support.waiting import threads, wait_until


@pytest.fixture(autouse=True)
def no_thread_is_left():
    """Fail whoever leaves a model playing: it would disturb the tests after it."""
    yield
    wait_until(lambda: not threads("play"))
