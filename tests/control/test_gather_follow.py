"""Gather and Follow: when they are active, and what they do."""

import math

import pytest

from mesa_swarm import AGENT9, disc
from mesa_swarm.control import Explore, Follow, Gather, Subsumption
from mesa_swarm.errors import InvalidValueError
from support.scenes import empty


def decision(layer, other, *, obstacle=None):
    """Return command and layer of a robot at (200, 150) that heads right and sees another at (x, y) from it."""
    model = empty()
    if obstacle is not None:
        model.add_obstacle(disc((200 + obstacle[0], 150 + obstacle[1]), 5))
    others = [] if other is None else [(200 + other[0], 150 + other[1], math.pi)]
    model.add_robots(AGENT9, poses=[(200, 150, 0.0), *others])
    model.control = Subsumption(layer, Explore(speed=0.5))
    model.step()
    return model.swarm.command[0].tolist(), int(model.swarm.layer[0])


class TestGather:
    def test_is_not_active_when_it_sees_no_robot(self):
        assert decision(Gather(), None) == ([0.5, 0.5], 1)

    def test_does_not_gather_round_obstacles(self):
        assert decision(Gather(), None, obstacle=(0, 30)) == ([0.5, 0.5], 1)

    def test_turns_on_the_spot_towards_a_centroid_that_is_not_ahead(self):
        assert decision(Gather(), (0, 30)) == ([-1.0, 1.0], 0)
        assert decision(Gather(), (0, -30)) == ([1.0, -1.0], 0)

    def test_leaves_a_far_centroid_ahead_to_the_layers_below(self):
        assert decision(Gather(stop_distance=20), (40, 0)) == ([0.5, 0.5], 1)

    def test_stays_when_the_centroid_is_ahead_and_near(self):
        assert decision(Gather(stop_distance=20), (24, 0)) == ([0.0, 0.0], 0)

    def test_stops_at_the_stop_distance_itself(self):
        assert decision(Gather(stop_distance=25), (30, 0))[1] == 0
        assert decision(Gather(stop_distance=25 - 1e-9), (30, 0))[1] == 1

    def test_never_turns_beyond_the_centroid(self):
        (left, right), _ = decision(Gather(critical_angle_degrees=0), (30, 30))
        assert right == -left == 1.0


class TestFollow:
    def test_is_not_active_when_it_sees_no_robot_ahead(self):
        assert decision(Follow(), (-30, 20)) == ([0.5, 0.5], 1)

    def test_does_not_follow_obstacles(self):
        assert decision(Follow(), None, obstacle=(30, 0)) == ([0.5, 0.5], 1)

    def test_turns_on_the_spot_towards_a_robot_at_its_side(self):
        assert decision(Follow(), (17, 30)) == ([-1.0, 1.0], 0)

    def test_chases_a_robot_that_is_farther_than_the_gap(self):
        assert decision(Follow(gap=15), (30, 0)) == ([1.0, 1.0], 0)

    def test_cruises_behind_a_robot_that_is_within_the_gap(self):
        assert decision(Follow(gap=15), (25, 0)) == ([0.7, 0.7], 0)

    def test_always_cruises_without_a_gap(self):
        assert decision(Follow(gap=None), (40, 0)) == ([0.7, 0.7], 0)

    def test_a_follower_catches_up_to_the_gap_and_no_nearer(self):
        model = empty(width=2000)
        model.add_robots(AGENT9, poses=[(150, 150, 0.0), (100, 150, 0.0)])
        model.control = Subsumption(Follow(gap=15), Explore(speed=0.7))
        model.run(400)
        gap = model.swarm.position[0, 0] - model.swarm.position[1, 0] - 10
        assert 14 <= gap <= 15.3


@pytest.mark.parametrize(
    ("layer", "bad", "named"),
    [
        (Gather, {"critical_angle_degrees": 181}, "critical_angle_degrees is 181; expected a finite number at least 0"),
        (Gather, {"stop_distance": -1}, "stop_distance is -1"),
        (Follow, {"gap": -1}, "gap is -1"),
        (Follow, {"chase_speed": 1.5}, "chase_speed is 1.5; expected a finite number at least 0 and at most 1"),
        (Follow, {"cruise_speed": math.nan}, "cruise_speed is nan"),
    ],
)
def test_parameters_out_of_range_are_refused_by_name_with_the_permitted_range(layer, bad, named):
    with pytest.raises(InvalidValueError, match=named):
        layer(**bad)
