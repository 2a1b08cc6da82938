"""Actions and Boltzmann's choice: what is refused."""

import numpy as np
import pytest

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.learning import QLearning
from mesa_swarm.learning.actions import boltzmann, checked_actions


@pytest.mark.parametrize("values", ["ab", None, [], [[1.0]], [1.0, np.nan], [[1], [1, 2]], 3.0])
def test_values_that_are_no_row_of_numbers_are_refused(values):
    with pytest.raises(InvalidValueError, match=r"^values is .*; expected a row of finite numbers$"):
        boltzmann(values, 1)


@pytest.mark.parametrize("actions", [8.0, "8", 5, None, np.array([4, 8])])
def test_actions_are_the_whole_number_4_or_8(actions):
    with pytest.raises(InvalidValueError, match=r"^actions is .*; expected 4 or 8, a whole number$"):
        QLearning(actions=actions)
    assert checked_actions(np.int64(8)) == 8
