"""Perimeter, Separate and Cohere: what they command in scenes whose answer is known."""

import math

import pytest

from mesa_swarm import HolonomicDrive, ProximitySensor, RobotDesign, disc
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.control import Cohere, Cruise, Explore, Perimeter, Separate, Subsumption
from support.scenes import ahead, empty

EYES = tuple(ProximitySensor(bearing_degrees=10.0 * k, field_of_view_degrees=10, range=150) for k in range(36))


def decision(layer, other, *, heading=0.0, obstacle=None, drive=None):
    model = empty()
    if obstacle is not None:
        model.add_obstacle(disc(obstacle, 5))
    design = RobotDesign(sensors=EYES) if drive is None else RobotDesign(sensors=EYES, drive=drive)
    others = [] if other is None else [(*other, 0.0)]
    model.add_robots(design, poses=[(200, 150, heading), *others])
    model.control = Subsumption(layer, ahead(speed=0.5))
    model.step()
    return model.swarm.command[0].tolist(), int(model.swarm.layer[0])


class TestPerimeter:
    def test_is_not_active_when_it_sees_no_robot(self):
        assert decision(Perimeter(), None) == ([0.5, 0.5], 1)

    def test_approaches_from_outside_the_ring(self):
        assert decision(Perimeter(ring=40), (280, 150)) == ([1.0, 1.0], 0)
        assert decision(Perimeter(ring=40), (200, 230))[0] == [-1.0, 1.0]

    def test_withdraws_from_inside_the_ring_once_it_has_turned_its_back(self):
        assert decision(Perimeter(ring=40), (180, 150)) == ([1.0, 1.0], 0)
        assert decision(Perimeter(ring=40), (200, 170))[0] == [1.0, -1.0]

    def test_stays_on_the_ring_facing_outwards(self):
        assert decision(Perimeter(ring=40), (155, 150)) == ([0.0, 0.0], 0)

    def test_turns_outwards_on_the_ring(self):
        left, right = decision(Perimeter(ring=40), (245, 150))[0]
        assert left == -right != 0.0

    def test_a_lone_pair_ends_back_to_back_at_the_ring_distance(self):
        model = empty()
        model.add_robots(RobotDesign(sensors=EYES), poses=[(150, 150, 0.3), (250, 150, 2.0)])
        model.control = Subsumption(Perimeter(ring=40, tolerance=2), Explore())
        model.run(500)
        (ax, ay), (bx, by) = model.swarm.position
        assert math.hypot(ax - bx, ay - by) - 5 == pytest.approx(40, abs=2.5)
        apart = math.atan2(ay - by, ax - bx)
        assert math.cos(model.swarm.heading[0] - apart) > 0.95
        assert math.cos(model.swarm.heading[1] - apart) < -0.95


class TestSeparate:
    def test_moves_straight_away_from_what_is_near_and_the_faster_the_nearer(self):
        (far, _), _ = decision(Separate(distance=20), (225, 150), drive=HolonomicDrive())
        (near, _), _ = decision(Separate(distance=20), (215, 150), drive=HolonomicDrive())
        assert near < far < 0

    def test_is_not_active_when_nothing_is_near(self):
        assert decision(Separate(distance=10), (225, 150), drive=HolonomicDrive())[1] == 1

    @pytest.mark.parametrize(
        ("what", "from_robot", "from_obstacle"), [("robots", 0, 1), ("others", 1, 0), ("everything", 0, 0)]
    )
    def test_separates_only_from_the_kinds_that_are_chosen(self, what, from_robot, from_obstacle):
        layer = Separate(distance=20, what=what)
        assert decision(layer, (220, 150), drive=HolonomicDrive())[1] == from_robot
        assert decision(layer, None, obstacle=(220, 150), drive=HolonomicDrive())[1] == from_obstacle

    def test_refuses_an_unknown_thing_by_name(self):
        with pytest.raises(UnknownNameError, match="did you mean 'robots'"):
            Separate(what="robot")


class TestCohere:
    def test_moves_towards_the_centroid_in_any_direction(self):
        (x, y), won = decision(Cohere(distance=20), (200, 190), heading=math.pi / 2, drive=HolonomicDrive())
        assert won == 0
        assert (x, y) == pytest.approx((1.0, 0.0), abs=0.1)

    def test_slows_down_near_the_centroid(self):
        (x, _), _ = decision(Cohere(distance=60), (235, 150), drive=HolonomicDrive())
        assert x == pytest.approx(0.5, abs=0.05)

    def test_drives_neither_robots_of_earlier_layers_nor_those_that_see_none(self):
        assert decision(Cohere(distance=20), None, drive=HolonomicDrive())[1] == 1
        model = empty()
        model.add_robots(RobotDesign(sensors=EYES, drive=HolonomicDrive()), poses=[(200, 150, 0.0), (235, 150, 0.0)])
        model.control = Subsumption(Cruise(speed=0.5), Cohere(distance=20))
        model.step()
        assert model.swarm.layer.tolist() == [0, 0]

    def test_refuses_a_distance_of_nothing(self):
        with pytest.raises(InvalidValueError, match=r"Cohere's distance is 0; expected a finite number above 0"):
            Cohere(distance=0)
