"""Gather, Lead and Follow: when they are active, and what they do."""

import math

import numpy as np
import pytest

from mesa_swarm import AGENT9, Radio, disc
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Explore, Follow, Gather, Lead, Subsumption
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


class TestLead:
    @staticmethod
    def group(poses, reach=100.0):
        """Return a model of robots that lead or stay."""
        model = empty(rng=5)
        model.add_robots(AGENT9, poses=poses)
        model.communication = Radio(range=reach, state=False, goal=False, message=("rank",))
        model.control = Subsumption(Lead(speed=0.25))
        return model.run(2)

    def test_of_robots_in_range_only_the_one_of_the_lowest_rank_drives(self):
        model = self.group([(100, 100, 0.0), (140, 100, 0.0), (120, 140, 0.0)])
        lowest = int(model.swarm.columns["0.Lead.rank"].argmin())
        assert np.flatnonzero(model.swarm.layer == 0).tolist() == [lowest]
        assert model.swarm.command[lowest].tolist() == [0.25, 0.25]
        assert (model.swarm.columns["0.Lead.rank"] > 0).all()

    def test_a_robot_that_hears_no_other_does_not_lead(self):
        assert (self.group([(100, 100, 0.0), (300, 100, 0.0)]).swarm.layer == -1).all()

    def test_groups_out_of_range_have_a_leader_each(self):
        model = self.group([(60, 60, 0.0), (100, 60, 0.0), (300, 240, 0.0), (340, 240, 0.0)], reach=50)
        assert (model.swarm.layer[:2] == 0).sum() == (model.swarm.layer[2:] == 0).sum() == 1

    def test_without_messages_it_is_refused_in_one_line(self):
        model = empty()
        model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
        model.control = Subsumption(Lead())
        with pytest.raises(InvalidValueError, match=r"Lead compares ranks, .* model\.communication = Radio"):
            model.step()


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
