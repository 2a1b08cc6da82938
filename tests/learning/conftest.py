"""What tests of learners share."""

import pytest
from taught import learned, trained


@pytest.fixture
def policy():
    return learned(trained())
