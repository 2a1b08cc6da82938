"""Snapshots: what is stored of each step is what robots knew and did in it, and storing it changes nothing."""

import copy
import pickle

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, UnknownNameError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.robots.snapshots import DECISIONS
from support.pace import processor_seconds
from support.scenes import ahead, blind, empty


def some(n=4, **options):
    model = SwarmModel(map="original", rng=1, **options)
    model.add_robots(AGENT9, n)
    model.control = Subsumption(Avoid(), Explore(turn_interval=20))
    return model


def test_nothing_is_watched_by_default():
    assert some().run(3).watched is None


def test_what_is_stored_is_what_the_swarm_published_after_each_step():
    model = some()
    stored, published = model.watch(last=None), []
    for _ in range(30):
        model.step()
        published.append({name: model.swarm.columns[name].copy() for name in DECISIONS})
    assert stored is model.watched
    assert stored.steps.tolist() == list(range(1, 31))
    for name in DECISIONS:
        assert np.array_equal(stored[name], [columns[name] for columns in published], equal_nan=True), name
        assert np.array_equal(stored.at(7)[name], published[6][name], equal_nan=True), name


def test_heat_is_stored_as_robots_knew_it_when_they_decided():
    model = FireFighting(n_robots=10, rng=1)
    names = ("temperature", "heat", "hot", "fire")
    stored, known = model.watch(last=None, columns=names), []
    for _ in range(600):
        known.append([model.swarm.columns[name].copy() for name in names])
        model.step()
    for place, name in enumerate(names):
        assert np.array_equal(stored[name], [row[place] for row in known]), name
    assert np.ptp(stored["temperature"], axis=0).any()
    assert stored["hot"].any()


@pytest.mark.parametrize(("last", "every", "steps"), [(3, 1, [18, 19, 20]), (2, 7, [7, 14]), (None, 6, [6, 12, 18])])
def test_the_last_steps_that_are_due_are_stored(last, every, steps):
    model = some()
    stored = model.watch(last=last, every=every, columns=("position",))
    model.run(20)
    assert stored.steps.tolist() == steps
    assert len(stored) == len(stored["position"]) == len(steps)


def test_watching_anew_forgets_and_begins_at_the_present_step():
    model = some()
    first = model.watch()
    model.run(5)
    second = model.watch()
    assert (len(first), len(second)) == (5, 0)
    model.run(2)
    assert (len(first), second.steps.tolist()) == (5, [6, 7])


def test_before_the_first_step_a_column_is_empty_and_of_its_own_type():
    stored = some().watch()
    assert len(stored) == 0
    assert stored.steps.tolist() == []
    for name in DECISIONS:
        assert stored[name].shape[:2] == (0, 4)
    assert stored["layer"].dtype == np.int64
    assert stored["hot"].dtype == np.bool_


def test_what_is_stored_does_not_change_with_the_swarm():
    model = some()
    stored = model.watch()
    model.run(1)
    before = stored["position"][0].copy()
    next(iter(model.robots)).position = (400, 300)
    model.run(3)
    assert (stored["position"][0] == before).all()


@pytest.mark.parametrize("options", [{}, {"last": None, "every": 3}, {"columns": ("position",)}])
def test_watching_does_not_change_the_run(options):
    hashes = []
    for watches in (False, True):
        model = FireFighting(n_robots=6, rng=2)
        if watches:
            model.watch(**options)
        hashes.append(model.run(150).state_hash())
    assert hashes[0] == hashes[1]


def test_watching_costs_less_than_the_step():
    def seconds(watches):
        model = some(50)
        if watches:
            model.watch(last=100)
        model.run(20)
        return min(processor_seconds(lambda: model.run(100)) for _ in range(5))

    assert seconds(True) < 2 * seconds(False) + 0.01


def test_adding_robots_drops_what_was_stored_of_the_others():
    model = some(2)
    stored = model.watch(last=None)
    model.run(5)
    model.add_robots(AGENT3, 1)
    assert len(stored) == 0
    assert stored["position"].shape == (0, 3, 2)
    model.run(3)
    assert stored.steps.tolist() == [6, 7, 8]
    assert stored["distance"].shape == (3, 3, 9)


def test_removing_robots_drops_what_was_stored_so_that_no_row_means_another_robot():
    model = some(3)
    stored = model.watch(last=None)
    model.run(5)
    next(iter(model.robots)).remove()
    assert len(stored) == 0
    with pytest.raises(InvalidValueError, match="none are stored yet"):
        stored.at(5)
    model.run(2)
    assert stored["position"].shape == (2, 2, 2)
    assert (stored["position"][-1] == model.swarm.position).all()


def test_as_many_other_robots_are_other_robots():
    model = some(2)
    stored = model.watch(last=None)
    model.run(5)
    model.remove_robots(model.robots)
    model.add_robots(AGENT9, 2)
    model.run(1)
    assert stored.steps.tolist() == [6]


def test_another_control_drops_what_was_stored_since_layers_have_other_numbers():
    model = some()
    stored = model.watch(last=None)
    model.run(5)
    model.control = Subsumption(Explore())
    assert len(stored) == 0
    assert len(model.run(2).watched) == 2


def test_obstacles_that_come_and_go_drop_nothing():
    model = empty()
    model.add_robots(blind(), poses=[(100, 100, 0.0)])
    model.control = Subsumption(ahead)
    stored = model.watch()
    model.run(3)
    model.add_fire((300, 200), radius=5)
    assert stored.steps.tolist() == [1, 2, 3]
    assert stored["position"][:, 0, 0].tolist() == [101.0, 102.0, 103.0]


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_a_copy_of_a_watched_model_stores_its_own_steps(duplicate):
    model = some()
    model.watch(last=10)
    model.run(5)
    twin = duplicate(model)
    model.run(2)
    twin.run(8)
    assert model.watched.steps.tolist() == list(range(1, 8))
    assert twin.watched.steps.tolist() == list(range(4, 14))
    assert (twin.watched["position"][:4] == model.watched["position"][3:]).all()
    assert (twin.watched["position"][-1] == twin.swarm.position).all()
    robot = next(iter(twin.robots))
    assert str(twin.explain(robot, 7)) == str(model.explain(next(iter(model.robots)), 7))


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"last": 0}, InvalidValueError, "last is 0; expected a whole number at least 1"),
        ({"last": 2.5}, InvalidValueError, r"last is 2\.5"),
        ({"every": 0}, InvalidValueError, "every is 0"),
        ({"columns": "position"}, InvalidValueError, r"columns is 'position'; expected names such as"),
        ({"columns": (1,)}, InvalidValueError, r"columns is \(1,\)"),
        ({"columns": ("postion",)}, UnknownNameError, "unknown column 'postion'; did you mean 'position'"),
    ],
)
def test_wrong_settings_are_refused_in_one_line(options, error, words):
    with pytest.raises(error, match=words) as caught:
        some().watch(**options)
    assert "\n" not in str(caught.value)


def test_a_column_that_is_not_watched_suggests_the_nearest():
    stored = some().watch(columns=("position", "layer"))
    with pytest.raises(UnknownNameError, match="unknown watched column 'layers'; did you mean 'layer'"):
        stored["layers"]


def test_a_step_that_is_not_stored_is_refused_with_those_that_are():
    model = some()
    stored = model.watch(last=3)
    model.run(10)
    with pytest.raises(
        InvalidValueError, match="step 2 is not stored; stored are 3 from 8 to 10; store more with watch"
    ):
        stored.at(2)
