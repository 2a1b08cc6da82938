"""Who hears what: the range, what stops a broadcast, what is lost, and the same as a twin that tries all pairs."""

import copy
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT9, Radio, SwarmModel, disc, polygon, rectangle
from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.errors import InvalidValueError
from scenes import blind, circle, empty
from worlds import random_world

HEARD = ("heard_layer", "heard_task", "heard_from", "heard_goal")
seeds = st.integers(0, 2**32 - 1)


class Saying:
    """A layer that stands still and says, for each robot in order of creation, this task and this goal."""

    name = "Saying"

    def __init__(self, tasks, goals=()):
        self.tasks, self.goals = np.array(tasks), np.reshape(np.array(goals, float), (-1, 2))

    def bind(self, swarm, prefix, rng):
        self.swarm = swarm

    def decide(self, senses, command, layer, index):
        number = self.swarm.number
        senses.task[:] = self.tasks[number]
        senses.goal[:] = self.goals[number] if len(self.goals) else np.nan
        layer[:] = index


def heard(poses, radio, tasks, goals=(), *, shapes=(), fires=(), **options):
    """Return a model whose robots have said this, and heard it of each other."""
    model = empty(communication=radio, **options)
    for shape in shapes:
        model.add_obstacle(shape)
    for place in fires:
        model.add_fire(place, radius=10)
    model.add_robots(blind(), poses=poses)
    model.control = Subsumption(Saying(tasks, goals))
    return model.run(2)


def listener(*arguments, **options):
    """Return the task that the last of several robots hears."""
    return int(heard(*arguments, **options).swarm.heard_task[-1])


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


def test_a_robot_hears_neither_itself_nor_those_that_have_nothing_to_say():
    model = heard([(100, 100, 0.0), (150, 100, 0.0)], Radio(), [-1, 3])
    assert model.swarm.heard_task.tolist() == [3, -1]
    assert np.isnan(model.swarm.heard_from[1]).all()
    assert np.isnan(model.swarm.heard_goal).all()


def test_what_is_decided_is_heard_one_step_later():
    model = empty(communication=Radio())
    model.add_robots(blind(), poses=[(100, 100, 0.0), (150, 100, 0.0)])
    model.control = Subsumption(Saying([4, -1]))
    assert model.run(1).swarm.heard_task.tolist() == [-1, -1]
    assert model.run(1).swarm.heard_task.tolist() == [-1, 4]


def test_a_goal_stays_where_it_is_though_its_sender_turns_and_moves_after_having_said_it():
    target = np.array([180.0, 140.0])

    class Pointing(Saying):
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
    said = [(100, 100, 0.0), (150, 100, 0.0)], [5, 5], [(1, 1), (1, 1)]
    state, goal = (heard(said[0], radio, *said[1:]).swarm for radio in (Radio(goal=False), Radio(state=False)))
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


def test_in_a_hole_of_an_obstacle_robots_hear_each_other_but_nobody_outside():
    outline, hole = [(100, 50), (300, 50), (300, 250), (100, 250)], [(110, 60), (290, 60), (290, 240), (110, 240)]
    poses = [(150, 150, 0.0), (250, 150, 0.0), (50, 150, 0.0)]
    model = heard(poses, Radio(range=400, occlusion=True), [1, 2, 3], shapes=[polygon(outline, [hole])])
    assert model.swarm.heard_task.tolist() == [2, 1, -1]


# ---- what is lost


def counts(probability, steps=300, n=10):
    """Return, in rows of steps, which of n robots about a speaker heard it."""
    azimuths = 2 * math.pi * np.arange(n) / n
    poses = [(200, 150, 0.0), *((200 + 50 * math.cos(a), 150 + 50 * math.sin(a), 0.0) for a in azimuths)]
    model = heard(poses, Radio(loss_probability=probability), [1] + [-1] * n)
    return np.array([model.run(1).swarm.heard_task[1:] == 1 for _ in range(steps)])


def test_nothing_is_lost_with_probability_0_and_everything_with_1():
    assert counts(0.0, steps=3).all()
    assert not counts(1.0, steps=3).any()


def test_broadcasts_are_lost_with_the_given_probability_to_each_hearer_and_in_each_step_alone():
    arrived = counts(0.3)
    sigma = math.sqrt(0.3 * 0.7 / arrived.size)
    assert arrived.mean() == pytest.approx(0.7, abs=4 * sigma)
    both = (arrived[:, 0::2] & arrived[:, 1::2]).mean(), (arrived[:-1] & arrived[1:]).mean()
    assert both == pytest.approx((0.49, 0.49), abs=8 * sigma)


def test_to_hear_and_to_be_heard_are_lost_independently():
    model = heard([(100, 100, 0.0), (150, 100, 0.0)], Radio(loss_probability=0.5), [1, 1])
    pairs = np.array([model.run(1).swarm.heard_task == 1 for _ in range(400)])
    assert (pairs[:, 0] != pairs[:, 1]).mean() == pytest.approx(0.5, abs=0.1)


def test_the_same_seed_loses_the_same_and_another_seed_something_else():
    poses = [(40 + 30 * k, 100, 0.0) for k in range(10)]
    runs = [heard(poses, Radio(loss_probability=0.5), range(10), rng=rng).run(20).state_hash() for rng in (1, 1, 2)]
    assert runs[0] == runs[1] != runs[2]


def test_a_robot_that_goes_changes_nothing_of_what_the_others_lose():
    poses, tasks = [(40 + 30 * k, 100, 0.0) for k in range(10)], [-1, *range(1, 10)]
    stays, goes = (heard(poses, Radio(loss_probability=0.5), tasks) for _ in range(2))
    goes.remove_robots([goes.robots[0]])
    for _ in range(20):
        stays.step()
        goes.step()
        assert (stays.swarm.heard_task[1:] == goes.swarm.heard_task).all()
    assert (stays.swarm.heard_task == -1).any() or (np.diff(stays.swarm.heard_task) != 0).any()


def test_losses_disturb_no_other_random_stream_and_looking_loses_nothing_more():
    def run(radio, look=False):
        model = SwarmModel(map="original", rng=1, communication=radio)
        model.add_robots(AGENT9.with_slip(probability=0.2, magnitude=0.5), 10)
        model.control = Subsumption(Explore(turn_interval=20))
        for _ in range(30):
            if look:
                model.sense()
                model.state_hash()
            model.step()
        return model.state_hash()

    assert run(Radio(loss_probability=0.5)) == run(None) == run(Radio(loss_probability=0.5), look=True)


# ---- the twin


def in_python(word, sender, hearer, probability):
    """Tell whether a broadcast is lost, by Python's own whole numbers."""
    whole = 2**64

    def mixed(bits):
        bits = (bits ^ bits >> 30) * 0xBF58476D1CE4E5B9 % whole
        bits = (bits ^ bits >> 27) * 0x94D049BB133111EB % whole
        return bits ^ bits >> 31

    golden = 0x9E3779B97F4A7C15
    return (mixed((mixed((word + golden * sender) % whole) + golden * hearer) % whole) >> 11) / 2**53 < probability


def hears(model, place, sender, i, word):
    """Tell whether robot i hears a sender at a place, by Shapely."""
    radio, way = model.communication, shapely.LineString([place, model.swarm.position[i]])
    if way.length > radio.range or in_python(word, sender, int(model.swarm.number[i]), radio.loss_probability):
        return False
    solids = [obstacle.shape for obstacle in model.obstacles if obstacle.contact]
    outlines = (s.geometry if s.is_disc else s.geometry.boundary for s in solids)
    return not radio.occlusion or all(o.distance(way) > s.radius for o, s in zip(outlines, solids, strict=True))


def framed(model, i, point):
    return shapely.affinity.rotate(
        shapely.Point(point - model.swarm.position[i]), -model.swarm.heading[i], origin=(0, 0), use_radians=True
    ).coords[0]


def twin(model, word):
    """Return what is heard in the next step, by trying all pairs."""
    swarm, radio, n = model.swarm, model.communication, len(model.swarm)
    out = {name: np.full_like(getattr(swarm, name), np.nan if name[6:] in ("from", "goal") else -1) for name in HEARD}
    beacons = [(np.array(b), k - len(radio.beacons)) for k, b in enumerate(radio.beacons)]
    robots = [(swarm.position[j], int(swarm.number[j])) for j in range(n)]
    goals = [b for b, _ in beacons] + list(swarm.sent_goal)
    for i in range(n):
        others = [k for k, (p, s) in enumerate(robots) if k != i and hears(model, p, s, i, word)]
        away = {j: np.hypot(*(swarm.position[j] - swarm.position[i])) for j in others if swarm.task[j] >= 0}
        if away and radio.state:
            j = min(away, key=away.get)
            out["heard_layer"][i], out["heard_task"][i] = swarm.layer[j], swarm.task[j]
            out["heard_from"][i] = framed(model, i, swarm.position[j])
        told = [k for k, (p, s) in enumerate(beacons) if hears(model, p, s, i, word)]
        told += [len(beacons) + j for j in others if np.isfinite(swarm.sent_goal[j]).all()]
        if told and radio.goal:
            k = min(told, key=lambda k: np.hypot(*(goals[k] - swarm.position[i])))
            out["heard_goal"][i] = framed(model, i, goals[k])
    return out


@settings(max_examples=60)
@given(seeds)
def test_random_worlds_are_heard_as_a_twin_that_tries_all_pairs_hears_them(seed):
    rng = np.random.default_rng(seed)
    world = random_world(seed, most_robots=25)
    model = world.model()
    state, goal = [(True, True), (True, False), (False, True)][rng.integers(3)]
    model.communication = Radio(
        range=rng.uniform(5, 150),
        state=state,
        goal=goal,
        occlusion=bool(rng.random() < 0.7),
        loss_probability=rng.choice([0.0, 0.4]),
        beacons=rng.uniform((0, 0), (200, 150), (rng.integers(3) if goal else 0, 2)),
    )
    n = len(model.swarm)
    goals = np.where(rng.random((n, 1)) < 0.5, rng.uniform(-40, 40, (n, 2)), np.nan)
    model.control = Subsumption(Saying(rng.integers(-1, 3, n), goals))
    model.step()
    ahead = copy.deepcopy(model.streams)["communication"]
    expected = twin(model, int(ahead.integers(2**64, dtype=np.uint64)))
    model.step()
    for name in HEARD:
        np.testing.assert_allclose(getattr(model.swarm, name), expected[name], rtol=0, atol=1e-9, err_msg=name)


@settings(max_examples=30)
@given(seeds)
def test_robots_created_in_another_order_hear_the_same(seed):
    rng = np.random.default_rng(seed)
    n = 40
    poses, goals = rng.uniform((10, 10, -3), (390, 290, 3), (n, 3)), rng.uniform(-40, 40, (n, 2))
    tasks, order = rng.integers(-1, 3, n), rng.permutation(n)
    models = []
    for rows in (np.arange(n), order):
        model = empty(communication=Radio(occlusion=True))
        model.add_obstacle(rectangle((180, 50), (200, 200)))
        model.add_robots(blind(radius=0.01), poses=poses[rows])
        model.control = Subsumption(Saying(tasks[rows], goals[rows]))
        models.append(model.run(2).swarm)
    for name in HEARD:
        np.testing.assert_allclose(getattr(models[0], name)[order], getattr(models[1], name), rtol=0, atol=1e-9)


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
