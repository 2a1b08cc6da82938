"""VectorSum: the weighted sum of what active layers ask for."""

import math
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT3, HolonomicDrive, RobotDesign
from mesa_swarm.base.errors import BehaviourError, InvalidValueError
from mesa_swarm.control import PASS, Avoid, Explore, Subsumption, VectorSum, behaviour
from support.scenes import empty


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


@pytest.mark.slow
@given(speed, speed, speed, speed)
def test_small_commands_are_added_up(a, b, c, d):
    command, _ = summed(wheels(left=a, right=b), wheels(left=c, right=d))
    assert command == pytest.approx([a + c, b + d], abs=1e-15)


@pytest.mark.slow
@given(st.floats(0.1, 5), st.floats(-5, 5))
def test_sums_beyond_what_a_wheel_can_do_are_slowed_in_the_same_direction(left, right):
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


@pytest.mark.parametrize("weights", [(1,), (1, 2, 3), "11", 3, (1, "x"), (1, math.inf), (1, 1.7e308)])
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


class Asks:
    """A custom layer that asks for the same speeds always."""

    def __init__(self, name, speed):
        self.name, self.speed = name, speed

    def bind(self, swarm, prefix, rng):
        pass

    def decide(self, senses, command, layer, index):
        command[:], layer[:] = self.speed, index


@pytest.mark.parametrize("order", list(permutations(["A", "B", "Lost"])))
def test_nan_is_attributed_to_the_layer_that_commanded_it(order):
    model = empty()
    model.add_robots(AGENT3, 3)
    model.control = VectorSum(*(Asks(name, math.nan if name == "Lost" else 1.0) for name in order))
    with pytest.raises(BehaviourError, match=r"^Lost commanded NaN"):
        model.step()


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_a_layer_of_weight_zero_has_no_effect_whatever_it_commands(wrong):
    command, _ = summed(Asks("Lost", wrong), wheels(left=0.25, right=0.5), weights=(0, 1))
    assert command == [0.25, 0.5]


@pytest.mark.parametrize("design", [AGENT3, RobotDesign(drive=HolonomicDrive())])
def test_however_much_is_asked_for_the_sum_is_what_a_robot_can_do(design):
    model = empty()
    model.add_robots(design, poses=[(200, 150, 0.0)])
    model.control = VectorSum(Asks("A", math.inf), Asks("B", 1e308), Asks("C", -1.0), weights=(1e6, 1e6, 1e6))
    model.step()
    longest = np.hypot(*model.swarm.command[0]) if design is not AGENT3 else model.swarm.command[0].max()
    assert longest == pytest.approx(1.0)
    assert model.swarm.command[0, 0] == model.swarm.command[0, 1]


@pytest.mark.parametrize("arbiter", [Subsumption, VectorSum])
def test_a_layer_without_a_name_is_refused_in_words(arbiter):
    class Nameless:
        def bind(self, swarm, prefix, rng): ...

        def decide(self, senses, command, layer, index): ...

    with pytest.raises(InvalidValueError, match=f"{arbiter.__name__} got a Nameless without a name; give"):
        arbiter(Explore(), Nameless())
