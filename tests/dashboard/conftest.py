"""Every test of the dashboard ends with its threads."""

import pytest

from support.waiting import threads, wait_until


@pytest.fixture(autouse=True)
def no_thread_is_left():
    """Fail tests that leave a model playing: it would disturb later tests."""
    yield
    wait_until(lambda: not threads("play"))
