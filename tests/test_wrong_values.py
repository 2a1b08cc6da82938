"""Values of wrong kinds are refused in one line wherever they are given, a few at each place; see tests/hostile."""

import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

from mesa_swarm import AGENT9, Map, Radio, SwarmModel, disc
from mesa_swarm.base.errors import (
    InvalidValueError,
    SwarmError,
    check_choice,
    check_count,
    check_flag,
    check_number,
    shortened,
    unknown_name,
)
from mesa_swarm.control import Avoid, Subsumption, VectorSum
from mesa_swarm.control.head_on import HeadOn
from mesa_swarm.fire.constants import design_constants
from mesa_swarm.learning.policy import PolicyLayer
from mesa_swarm.learning.q_learning import QPolicy
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.imperfections import Imperfection, Imperfections


class Unfriendly:
    def _refuse(self, *given):
        raise RuntimeError("a line\nand another")

    __float__ = __int__ = __repr__ = __array__ = _refuse


class Untouchable:
    """Raises whatever attribute is read."""

    def __getattr__(self, name):
        raise RuntimeError("a line\nand another")


def nested():
    found = []
    for _ in range(2000):
        found = [found]
    return found


WRONG = [10**400, 10**5000, "x" * 100_000, "a\nb", Fraction(10**400), Decimal("sNaN"), Unfriendly(), nested(), 1j]
WRONG += [np.array([0.5]), np.array([[1, 2]]), b"1", None, math.nan, Untouchable()]


def refused(call, *given):
    with pytest.raises(SwarmError) as refusal:
        call(*given)
    text = str(refusal.value)
    assert 0 < len(text) <= 300
    assert "\n" not in text


@pytest.mark.parametrize("wrong", WRONG, ids=range(len(WRONG)))
def test_other_values_than_numbers_and_points_are_refused_in_one_line(wrong):
    model = SwarmModel(map="openspace", rng=1)
    (robot,) = model.add_robots(AGENT9, poses=[(100, 100, 0)])
    fire, load = model.add_fire((300, 300), radius=20), model.add_load(disc((200, 100), 15), resistance=1.5)
    for owner, name in ((robot, "heading"), (robot, "temperature"), (robot, "max_speed"), (fire, "temperature"),
                        (load, "resistance"), (model, "collect_every")):  # fmt: skip
        refused(setattr, owner, name, wrong)
    for point in (wrong, (wrong, 100)):
        refused(setattr, robot, "position", point)
        refused(model.add_fire, point)
    refused(lambda: model.add_robots(AGENT9, poses=[(wrong, 1, 0)]))
    refused(lambda: model.add_robots(AGENT9, poses=[(50, 50, wrong)]))
    refused(lambda: model.add_robots(AGENT9, 1, tendency=[wrong]))
    refused(model.remove_robots, [wrong])
    refused(robot.get_neighbors_in_radius, wrong)
    refused(robot.get_nearest_neighbors, wrong)
    refused(Subsumption, wrong)
    refused(lambda: VectorSum(Avoid(), weights=[wrong]))
    refused(lambda: Radio(beacons=[(wrong, 1)]))
    refused(lambda: Imperfections(sensing=wrong))
    refused(check_count, "n", wrong)
    assert len(shortened(wrong)) <= 80
    assert len(unknown_name("map", wrong, ["original"])) <= 300


@pytest.mark.parametrize("name", [math.nan, None, "", "two\nlines", "x" * 101, "\0", "\udcff", 10**5000], ids=range(8))
def test_a_name_is_one_short_line(name):
    refused(lambda: Avoid(name=name))
    refused(lambda: RobotDesign(name=name))
    layer = Avoid()
    object.__setattr__(layer, "name", name)
    refused(Subsumption, layer)


def test_what_raises_whatever_it_is_asked_for_is_refused_in_one_line():
    wrong, model = Untouchable(), SwarmModel(rng=1)
    refused(setattr, model, "control", wrong)
    refused(lambda: RobotDesign(drive=wrong))
    refused(lambda: RobotDesign(sensors=(wrong,)))
    refused(lambda: PolicyLayer(policy=wrong))
    refused(lambda: Map(name="hall", bounds=(0, 0, 9, 9), fires=[wrong]))
    refused(lambda: Map(name="hall", bounds=wrong))
    refused(check_flag, "shared", wrong)
    refused(check_choice, "map", wrong, ["original"])
    assert shortened(wrong).startswith("<") or shortened(wrong) == "a Untouchable"


def test_flags_of_a_policy_layer_are_flags():
    policy = QPolicy.untrained(AGENT9, rng=np.random.default_rng(1))
    refused(lambda: PolicyLayer(policy=policy, explore="yes"))


def test_numbers_of_other_kinds_work_as_the_floats_that_they_are():
    for half in (Decimal("0.5"), Fraction(1, 2), np.float32(0.5), np.array(0.5)):
        assert check_number("half", half) == 0.5
        assert Imperfections(driving=Imperfection(dropout=half, outliers=0.25), battery=half).at(half).battery == 1.0
        assert design_constants(balance_temperature=half) == design_constants(balance_temperature=0.5)
        model = SwarmModel(map="openspace", rng=1)
        model.add_robots(AGENT9, 2)
        model.control = Subsumption(HeadOn(slowest=half))
        model.run(2)


def test_an_array_of_one_number_is_not_taken_for_the_number():
    with pytest.raises(InvalidValueError, match="expected a finite number"):
        check_number("distance", np.array([15.0]))
