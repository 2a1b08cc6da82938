"""Layers are for one kind of drive: a model refuses robots that they would drive by the wrong numbers."""

import numpy as np
import pytest

from mesa_swarm import AGENT9, HolonomicDrive, all_round
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import (
    Align,
    Avoid,
    Cohere,
    Cruise,
    Explore,
    Follow,
    Gather,
    HeadOn,
    Lead,
    MatchVelocity,
    Perimeter,
    Push,
    Respond,
    Separate,
    Subsumption,
    VectorSum,
)
from mesa_swarm.environments.task_world import Commanded
from mesa_swarm.fire.strategy import FightFire
from mesa_swarm.robots.design import RobotDesign
from support.scenes import ahead, empty

FOR_WHEELS = (Avoid, Explore, Follow, Gather, HeadOn, Lead, MatchVelocity, Perimeter, Push, Respond, FightFire)
FOR_ROLLERS = (Align, Cohere, Cruise, Separate)
GLIDER = all_round(12, name="glider", drive=HolonomicDrive())


class Odd:
    """A custom drive that is neither."""

    turns = None

    def motion(self, wheels, radius, motion):
        motion[:] = 0.0

    def wheels(self, motion, radius, wheels):
        wheels[:] = 0.0


MISMATCHED = [(layer, GLIDER) for layer in FOR_WHEELS] + [(layer, AGENT9) for layer in FOR_ROLLERS]


@pytest.mark.parametrize("arbiter", [Subsumption, VectorSum])
@pytest.mark.parametrize(("layer", "design"), MISMATCHED, ids=lambda part: getattr(part, "__name__", "on"))
class TestTheOtherDrive:
    def test_is_refused_when_control_is_set_and_nothing_is_changed(self, layer, design, arbiter):
        model = empty()
        model.add_robots(design, 2)
        model.control = Subsumption(ahead)
        before, control = model.run(3).state_hash(), model.control
        with pytest.raises(InvalidValueError, match=f"{layer.__name__} commands .* the design {design.name} take"):
            model.control = arbiter(ahead, layer())
        assert model.control is control
        assert model.state_hash() == before

    @pytest.mark.slow
    def test_is_refused_when_robots_are_added_and_none_is(self, layer, design, arbiter):
        model, twin = empty(), empty()
        for world in (model, twin):
            world.control = arbiter(layer())
        with pytest.raises(InvalidValueError, match=f"{layer.__name__} commands"):
            model.add_robots(design, 2)
        assert len(model.swarm) == 0
        fitting = AGENT9 if design is GLIDER else GLIDER
        for world in (model, twin):
            world.add_robots(fitting, 2)
        assert model.state_hash() == twin.state_hash()


def test_the_message_is_one_line_with_the_cure():
    model = empty()
    model.add_robots(GLIDER, 1)
    with pytest.raises(InvalidValueError) as caught:
        model.control = Subsumption(Avoid(name="KeepOff"), Explore())
    assert str(caught.value) == (
        "KeepOff commands speeds of wheels left and right, but robots of the design glider take speeds forward and "
        "sideways; give the design another drive, or use layers that are for its drive"
    )


def test_one_robot_of_the_other_drive_is_enough_and_one_that_is_gone_does_not_count():
    model = empty()
    model.add_robots(AGENT9, 3)
    gliders = model.add_robots(GLIDER, 1)
    with pytest.raises(InvalidValueError, match="design glider"):
        model.control = Subsumption(Explore())
    model.remove_robots(gliders)
    model.control = Subsumption(Explore())
    assert np.ptp(model.run(20).swarm.position) > 0


@pytest.mark.parametrize("layer", [ahead, Commanded(2)])
def test_layers_without_a_declared_kind_of_command_drive_everything(layer):
    model = empty()
    for design in (AGENT9, GLIDER):
        model.add_robots(design, 1)
    model.control = Subsumption(layer)
    model.run(5)
    assert model.swarm.layer.tolist() == [0, 0]


@pytest.mark.parametrize("layer", [Avoid, Cruise])
def test_a_drive_that_is_of_neither_kind_may_be_commanded_by_all(layer):
    model = empty()
    model.control = Subsumption(layer())
    model.add_robots(RobotDesign(drive=Odd()), 1)
    model.run(3)
    assert model.swarm.slip.tolist() == [[0.0, 0.0]]
