import numpy as np
import pytest

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.environments.actions import checked_choice, shares
from mesa_swarm.learning.actions import ACTIONS


def test_the_thesis_s_actions_come_in_its_order():
    expected = [(-1, -1), (-1, 1), (1, -1), (1, 1), (-1, 0), (0, -1), (1, 0), (0, 1)]
    assert shares(8, np.arange(8), (8,)).tolist() == [list(map(float, pair)) for pair in expected]
    assert np.array_equal(shares(4, [[0, 1], [2, 3]], (2, 2)), ACTIONS[:4].reshape(2, 2, 2))


def test_continuous_actions_pass_unchanged():
    commands = np.array([[-1, 1], [0.25, 0]], np.float32)
    assert np.array_equal(shares("continuous", commands, (2,)), commands)


@pytest.mark.parametrize("actions", [5, True, "discrete", None, 4.5, [4], np.array([4, 8])])
def test_other_kinds_of_actions_are_refused(actions):
    with pytest.raises(InvalidValueError, match=r"expected 'continuous', 4 or 8$"):
        checked_choice(actions)


@pytest.mark.parametrize("bad", [1.001, -1.5, np.nan, np.inf])
def test_the_robot_whose_wheels_are_out_of_range_is_named(bad):
    commands = np.zeros((3, 4, 2))
    commands[1, 2, 1] = bad
    with pytest.raises(InvalidValueError, match=r"^the action of robot 2 in world 1 is .*; expected two wheel speeds"):
        shares("continuous", commands, (3, 4))
    with pytest.raises(InvalidValueError, match=r"^the action of robot 2 is "):
        shares("continuous", commands[1], (4,))


@pytest.mark.parametrize("bad", [-1, 4, 1.5, np.nan])
def test_the_robot_whose_action_has_no_such_number_is_named(bad):
    with pytest.raises(InvalidValueError, match=r"^the action of robot 1 is .*, a whole number from 0 to 3$"):
        shares(4, [0, bad], (2,))


@pytest.mark.parametrize("commands", [[[0, 0]], np.zeros((2, 3)), [0, 0], [[0, 0], [0]], "ab", None, [{}, {}]])
def test_actions_of_another_shape_are_refused(commands):
    with pytest.raises(InvalidValueError, match=r"^actions .*expected .*two wheel speeds for each robot$"):
        shares("continuous", commands, (2,))
