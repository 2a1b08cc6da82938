"""What tests of learners share."""

import pytest

from support.q_learners import learned, trained


@pytest.fixture
def policy():
    return learned(trained())
