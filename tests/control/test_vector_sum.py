"""VectorSum: the weighted sum of what active layers ask for."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT3
from mesa_swarm.control import PASS, Avoid, Explore, Subsumption, VectorSum, behaviour
from mesa_swarm.errors import BehaviourError, InvalidValueError
from scenes import empty


@behaviour
def wheels(me, left=0.0, right=0.0):
    """Ask for these wheel speeds."""
    return left, right


@behaviour
def silent(me):
    """Ask for nothing."""
    return PASS if me.max_speed >= 0 else (0.0, 0.0)


def summed(*layers, **options):
    model = empty()
    model.add_robots(AGENT3, poses=[(200, 150, 0.0)], tendency="left")
    model.control = VectorSum(*layers, **options)
    model.step()
    return model.swarm.command[0].tolist(), int(model.swarm.layer[0])


speed = st.floats(-0.4, 0.4)


@given(speed, speed, speed, speed)
def test_small_commands_are_added_up(a, b, c, d):
    command, _ = summed(wheels(left=a, right=b), wheels(left=c, right=d))
    assert command == pytest.approx([a + c, b + d], abs=1e-15)


@given(st.floats(0.1, 5), st.floats(-5, 5))
def test_sums_that_no_wheel_can_do_are_slowed_and_keep_their_direction(left, right):
    command, _ = summed(wheels(left=1.0, right=0.0), wheels(left=0.0, right=1.0), weights=(left, right))
    most = max(1.0, abs(left), abs(right))
    assert command == pytest.approx([left / most, right / most])


def test_layers_that_are_not_active_add_nothing():
    assert summed(silent(), wheels(left=0.5, right=0.5)) == ([0.5, 0.5], 1)


def test_a_robot_for_which_no_layer_is_active_stops():
    assert summed(silent()) == ([0.0, 0.0], -1)


def test_the_layer_with_the_largest_share_is_named_and_the_first_of_equals():
    assert summed(wheels(left=0.1), wheels(left=0.3), wheels(left=-0.3))[1] == 1
    assert summed(wheels(left=0.1), wheels(left=0.3), weights=(9, 1))[1] == 0


def test_one_layer_of_weight_one_does_what_subsumption_does():
    runs = []
    for arbiter in (VectorSum, Subsumption):
        model = empty(rng=4)
        model.add_robots(AGENT3, 5)
        model.control = arbiter(Explore(turn_interval=20))
        runs.append(model.run(100).swarm.position.copy())
    assert (runs[0] == runs[1]).all()


@pytest.mark.parametrize("weights", [(1,), (1, 2, 3), "11", 3, (1, "x"), (1, math.inf)])
def test_weights_that_are_not_one_number_a_layer_are_refused(weights):
    with pytest.raises(InvalidValueError, match="weight"):
        VectorSum(Avoid(), Explore(), weights=weights)


def test_what_is_not_a_layer_is_refused():
    with pytest.raises(InvalidValueError, match="VectorSum got 3; expected layers such as"):
        VectorSum(3)


def test_a_layer_that_asks_for_nan_is_named():
    class Lost:
        name = "Lost"

        def bind(self, swarm, prefix, rng):
            pass

        def decide(self, senses, command, layer, index):
            command[:] = np.nan
            layer[:] = index

    model = empty()
    (robot,) = model.add_robots(AGENT3, 1)
    model.control = VectorSum(Lost(), Explore())
    with pytest.raises(BehaviourError, match=f"commanded NaN to robot {robot.unique_id} in step 1"):
        model.step()
