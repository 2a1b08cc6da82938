"""What tests are made of."""

import pytest

# An assertion of a fixture states what it found, like one of a test.
pytest.register_assert_rewrite("support.browsers")
