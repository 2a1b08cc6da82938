"""Who hears what: the range, what stops a broadcast, and communication that is switched off and on."""

import copy
import math

import numpy as np
import pytest

from mesa_swarm import Radio, SwarmModel, disc, polygon, rectangle
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Subsumption
from support.messages import Broadcasting, heard, listener
from support.scenes import blind, circle, empty


def two(*shapes, ends=((100, 100), (200, 100)), **options):
    """Return the task 5 if the second robot hears the first though these shapes are about, else -1."""
    poses = [(*ends[0], 0.0), (*ends[1], 0.0)]
    return listener(poses, Radio(range=200, occlusion=True), [5, -1], shapes=shapes, **options)


# ---- what is heard


def test_a_robot_is_heard_just_as_far_as_the_range_and_no_farther():
    poses = [(100, 100, 0.0), (160, 180, 0.0)]
    assert listener(poses, Radio(range=100), [5, -1]) == 5
    assert listener(poses, Radio(range=100 - 1e-9), [5, -1]) == -1


@pytest.mark.parametrize("heading", [0.0, 1.0, math.pi / 2, -3.0])
def test_places_and_goals_are_heard_in_the_frame_of_the_hearer(heading):
    goal = (30.0, 10.0)  # ahead and to the left of a sender that looks up: 10 to its left is -10 along x
    model = heard([(100, 100, math.pi / 2), (150, 100, heading)], Radio(), [5, -1], [goal, (math.nan,) * 2])
    cosine, sine = math.cos(heading), math.sin(heading)
    for name, (x, y) in {"heard_from": (-50, 0), "heard_goal": (-60, 30)}.items():
        assert getattr(model.swarm, name)[1] == pytest.approx([cosine * x + sine * y, cosine * y - sine * x], abs=1e-9)
    assert model.swarm.heard_layer.tolist() == [-1, 0]
    assert model.swarm.sent_goal[0] == pytest.approx([90, 130], abs=1e-9)


def test_a_robot_hears_neither_itself_nor_those_without_a_task_or_goal():
    model = heard([(100, 100, 0.0), (150, 100, 0.0)], Radio(), [-1, 3])
    assert model.swarm.heard_task.tolist() == [3, -1]
    assert np.isnan(model.swarm.heard_from[1]).all()
    assert np.isnan(model.swarm.heard_goal).all()


def test_what_is_decided_is_heard_one_step_later():
    model = empty(communication=Radio())
    model.add_robots(blind(), poses=[(100, 100, 0.0), (150, 100, 0.0)])
    model.control = Subsumption(Broadcasting([4, -1]))
    assert model.run(1).swarm.heard_task.tolist() == [-1, -1]
    assert model.run(1).swarm.heard_task.tolist() == [-1, 4]


def test_a_goal_stays_where_it_is_though_its_sender_turns_and_moves_after_sending_it():
    target = np.array([180.0, 140.0])

    class Pointing(Broadcasting):
        def decide(self, senses, command, layer, index):
            x, y = target - self.swarm.position[0]
            cosine, sine = math.cos(self.swarm.heading[0]), math.sin(self.swarm.heading[0])
            senses.goal[0] = cosine * x + sine * y, cosine * y - sine * x

    model = empty(communication=Radio())
    model.add_robots(blind(), poses=[(100, 100, 0.3), (150, 100, 0.0)])
    model.control = Subsumption(Pointing([0, 0]), circle(left=-0.5))
    heading = model.swarm.heading[0]
    for _ in range(10):
        place = model.run(1).swarm.position[1].copy(), model.swarm.heading[1]
        model.step()
        (x, y), (cosine, sine) = model.swarm.heard_goal[1], (math.cos(place[1]), math.sin(place[1]))
        assert place[0] + (cosine * x - sine * y, sine * x + cosine * y) == pytest.approx(target, abs=1e-9)
    assert model.swarm.heading[0] != heading


def test_of_several_at_work_the_nearest_is_heard():
    poses = [(100, 100, 0.0), (140, 100, 0.0), (150, 150, 0.0)]
    assert listener(poses, Radio(), [7, 8, -1]) == 8


def test_of_two_equally_near_the_one_created_first_is_heard_whatever_its_row():
    poses = [(50, 50, 0.0), (200, 150, 0.0), (100, 150, 0.0), (150, 150, 0.0)]
    assert listener(poses, Radio(), [-1, 6, 7, -1]) == 6
    model = heard(poses, Radio(), [-1, 6, 7, -1])
    model.remove_robots([model.robots[0]])
    assert model.run(1).swarm.heard_task[-1] == 6


def test_of_several_goals_the_one_nearest_to_the_hearer_is_heard_and_not_that_of_the_nearest_sender():
    none = (math.nan, math.nan)
    poses = [(150, 100, 0.0), (100, 100, 0.0), (170, 100, 0.0)]
    model = heard(poses, Radio(), [-1] * 3, [(200, 0), (60, 0), none])
    assert model.swarm.heard_goal[2] == pytest.approx([-10, 0], abs=1e-9)


@pytest.mark.parametrize("goal", [(5, math.nan), (math.nan, 5), (math.inf, 5), (-math.inf, math.inf)])
def test_a_goal_that_is_not_finite_is_none(goal):
    poses = [(100, 100, 0.5), (140, 100, 0.0), (150, 150, 0.0)]
    model = heard(poses, Radio(), [-1] * 3, [goal, (3, 0), goal])
    assert model.swarm.heard_goal[2] == pytest.approx([-7, -50])
    assert np.isnan(model.swarm.heard_goal[1]).all()


def test_only_what_the_radio_broadcasts_is_heard():
    sent = [(100, 100, 0.0), (150, 100, 0.0)], [5, 5], [(1, 1), (1, 1)]
    state, goal = (heard(sent[0], radio, *sent[1:]).swarm for radio in (Radio(goal=False), Radio(state=False)))
    assert (state.heard_task == 5).all()
    assert np.isnan(state.heard_goal).all()
    assert (goal.heard_task == -1).all()
    assert np.isfinite(goal.heard_goal).all()


def test_a_beacon_is_heard_as_a_goal_within_the_range_and_not_behind_a_wall():
    def beacons_heard(*shapes):
        radio = Radio(range=100, beacons=[(200, 100), (100, 200), (250, 250)], occlusion=True)
        return heard([(100, 100, 0.0), (390, 290, 0.0)], radio, [-1, -1], shapes=shapes).swarm.heard_goal

    assert beacons_heard()[0] == pytest.approx([100, 0])
    assert np.isnan(beacons_heard()[1]).all()
    assert beacons_heard(disc((150, 100), 10))[0] == pytest.approx([0, 100])


# ---- what stops it


def test_walls_and_discs_between_the_centres_stop_a_broadcast():
    assert two() == 5
    assert two(rectangle((140, 50), (160, 110))) == -1
    assert two(disc((150, 110), 15)) == -1
    assert two(polygon([(120, 120), (150, 95), (180, 120)])) == -1


def test_what_is_beside_or_behind_stops_nothing():
    assert two(rectangle((140, 50), (160, 99)), disc((150, 120), 19)) == 5
    assert two(rectangle((20, 80), (80, 120)), rectangle((220, 100), (300, 120)), disc((230, 100), 20)) == 5


def test_touching_stops_a_broadcast_even_through_both_corners_of_a_square():
    assert two(rectangle((140, 100), (160, 120))) == -1
    assert two(disc((150, 120), 20)) == -1
    assert two(rectangle((140, 140), (160, 160)), ends=((100, 100), (200, 200))) == -1
    assert two(rectangle((140, 140), (160, 160)), ends=((100, 200), (200, 100))) == -1


def test_marks_robots_and_fires_stop_nothing():
    assert two(rectangle((140, 50), (160, 150), contact=False), disc((130, 100), 10, contact=False)) == 5
    assert two(fires=[(150, 100)]) == 5
    poses = [(100, 100, 0.0), (150, 100, 0.0), (200, 100, 0.0)]
    assert listener(poses, Radio(occlusion=True), [5, -1, -1]) == 5


def test_nothing_stops_a_broadcast_where_occlusion_is_not_asked_for():
    poses = [(100, 100, 0.0), (200, 100, 0.0)]
    assert listener(poses, Radio(), [5, -1], shapes=[rectangle((140, 50), (160, 110))]) == 5


def test_in_a_hole_of_an_obstacle_robots_hear_each_other_but_none_outside():
    outline, hole = [(100, 50), (300, 50), (300, 250), (100, 250)], [(110, 60), (290, 60), (290, 240), (110, 240)]
    poses = [(150, 150, 0.0), (250, 150, 0.0), (50, 150, 0.0)]
    model = heard(poses, Radio(range=400, occlusion=True), [1, 2, 3], shapes=[polygon(outline, [hole])])
    assert model.swarm.heard_task.tolist() == [2, 1, -1]


# ---- on and off


def test_by_default_there_is_no_communication_and_nothing_is_sent():
    model = heard([(100, 100, 0.0), (150, 100, 0.0)], None, [5, 5], [(1, 1), (1, 1)])
    assert model.communication is SwarmModel(rng=1).communication is None
    assert (model.swarm.task == 5).all()
    assert (model.swarm.goal == 1).all()
    assert (model.swarm.heard_task == -1).all()
    assert np.isnan(model.swarm.sent_goal).all()


def test_communication_may_be_switched_off_and_on_between_steps():
    model = heard([(100, 100, 0.0), (150, 100, 0.0)], Radio(), [5, 5], [(1, 1), (1, 1)])
    model.communication = None
    assert (model.swarm.heard_task == -1).all()
    assert np.isnan(model.run(2).swarm.heard_goal).all()
    model.communication = Radio(range=60)
    assert (model.run(2).swarm.heard_task == 5).all()
    assert np.isfinite(model.swarm.heard_goal).all()
    model.control = None
    assert (model.run(1).swarm.heard_task == -1).all()


def test_robots_that_come_are_heard_and_those_that_go_are_not():
    model = heard([(100, 100, 0.0), (150, 100, 0.0)], Radio(), [-1, -1, 9])
    robot = model.add_robots(blind(), poses=[(120, 120, 0.0)])[0]
    assert model.run(2).swarm.heard_task.tolist() == [9, 9, -1]
    assert robot.task == 9
    robot.remove()
    assert model.run(1).swarm.heard_task.tolist() == [-1, -1]


def test_an_obstacle_that_comes_stops_broadcasts():
    model = heard([(100, 100, 0.0), (200, 100, 0.0)], Radio(occlusion=True), [5, 5])
    wall = model.add_obstacle(rectangle((140, 50), (160, 150)))
    assert (model.run(1).swarm.heard_task == -1).all()
    wall.remove()
    assert (model.run(1).swarm.heard_task == 5).all()


def test_a_copy_goes_on_losing_what_the_model_loses():
    model = heard([(40 + 30 * k, 100, 0.0) for k in range(10)], Radio(loss_probability=0.5), range(10))
    twin_model = copy.deepcopy(model)
    assert model.run(10).state_hash() == twin_model.run(10).state_hash()


def test_a_world_without_robots_exchanges_nothing():
    assert empty(communication=Radio(beacons=[(1, 1)], loss_probability=0.1)).run(2).steps == 2


@pytest.mark.parametrize("wrong", ["state", 5, Radio, {"range": 5}, True])
def test_what_is_no_radio_is_refused_and_the_old_one_stays(wrong):
    model = empty(communication=Radio(range=7))
    with pytest.raises(InvalidValueError, match="expected Radio"):
        model.communication = wrong
    assert model.communication == Radio(range=7)


def test_a_beacon_off_the_map_is_refused():
    with pytest.raises(InvalidValueError, match="is not on map empty"):
        empty(communication=Radio(beacons=[(100, 100), (500, 100)]))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"range": -1}, "range is -1"),
        ({"range": math.nan}, "range is nan"),
        ({"range": "far"}, "range is 'far'"),
        ({"loss_probability": 1.5}, "loss_probability is 1.5"),
        ({"state": 1}, "state is 1; expected True or False"),
        ({"occlusion": None}, "occlusion is None"),
        ({"state": False, "goal": False}, "neither state nor goal"),
        ({"beacons": 5}, "beacons is 5; expected positions"),
        ({"beacons": [(1, 2, 3)]}, "expected positions"),
        ({"beacons": [(1, math.inf)]}, "beacon's y is inf"),
        ({"beacons": [(1, 2)], "goal": False}, "but goal is False"),
        ({"beacons": [(1, 2)] * 10_001}, "at most 10000"),
    ],
)
def test_a_wrong_radio_is_refused_on_one_line(options, words):
    with pytest.raises(InvalidValueError, match=words) as caught:
        Radio(**options)
    assert "\n" not in str(caught.value)
