"""A run that hands stretches of steps to one compiled call is, to the last bit, the run of single steps."""

import copy
import math
from dataclasses import replace

import mesa
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mesa_swarm import (
    AGENT9,
    Previous,
    SwarmModel,
    count,
    disc,
    mean,
    share,
    until,
    until_zero,
)
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.errors import BehaviourError, InvalidValueError, UnknownNameError
from mesa_swarm.kernels import plan
from mesa_swarm.model.driving import FEWEST_STEPS, drive_model
from mesa_swarm.model.gallery import find_model, gallery_names
from mesa_swarm.models.fire_fighting import FireFighting
from support.driven_models import Counting, Plain, Reaching, Season, Watching, assert_same, taken
from support.recorded_twice import steps_driven


@pytest.mark.parametrize("name", gallery_names())
def test_every_model_of_the_gallery_runs_as_its_single_steps_do(name):
    model_class = find_model(name)
    assert_same(model_class(rng=3).run(130), taken(model_class(rng=3), 130))


@settings(max_examples=25)
@given(st.lists(st.integers(0, 60), max_size=6), st.integers(1, 4), st.integers(0, 4), st.integers(1, 15))
def test_stretches_of_any_lengths_are_single_steps(lengths, history_every, collect_every, robots):
    parameters = {"n_robots": robots, "history_every": history_every, "collect_every": collect_every, "rng": 7}
    one, other = Plain(**parameters), Plain(**parameters)
    for length in lengths:
        assert_same(one.run(length), taken(other, length))


@pytest.mark.parametrize("chunk", [1, 10, 1000])
def test_runs_in_chunks_of_1_10_and_1000_steps_have_the_same_bits(chunk):
    model = FireFighting(rng=2)
    while model.steps < 1200 and model.running:
        model.run(min(chunk, 1200 - model.steps))
    assert_same(model, FireFighting(rng=2).run(1200))


def test_a_plain_model_is_driven_and_its_plan_states_it():
    model = Plain(rng=1)
    assert drive_model(model, 50) == 50
    assert model.steps == model.completed == 50
    assert str(model.plan).endswith("driven: up to 1000 steps in one compiled call")
    assert "Python" not in str(model.plan)


def test_so_few_steps_are_taken_one_by_one():
    model = Plain(rng=1)
    assert drive_model(model, FEWEST_STEPS - 1) == 0
    assert model.steps == 0


def test_parameters_set_by_hand_between_runs_count():
    one, other = Plain(rng=4), Plain(rng=4)
    for model, run in ((one, SwarmModel.run), (other, taken)):
        run(model, 40)
        model.control.layers[1].speed = 0.5
        run(model, 40)
        model.fire_constants = replace(model.fire_constants, k1=0.01)
        model.extinguish_range = 40.0
        run(model, 40)
        model.fires.history.every = 7
        model.add_fire((100, 100), radius=15)
        run(model, 40)
        model.add_robots(AGENT9, poses=[(50, 50, 0.0), (52, 50, 1.0)])
        model.add_obstacle(disc((400, 300), 20))
        run(model, 40)
        model.robots[3].position = (60.0, 55.0)
        model.remove_robots([model.robots[0]])
        model.collect_every = 6
        run(model, 40)
    assert_same(one, other)


@pytest.mark.parametrize("interrupted", [1, 2, 3])
def test_ctrl_c_during_a_compiled_call_loses_no_step_and_takes_none_twice(interrupted, monkeypatch):
    def make():
        model = Plain(rng=1, n_robots=20)
        model.run(10)
        model.robots[0].position = model.robots[1].position  # for which Python is needed within a step
        return model

    calls, compiled_call = [], plan.drive_steps

    def interrupt(*arguments):
        code = compiled_call(*arguments)
        calls.append(code)
        if len(calls) == interrupted:
            raise KeyboardInterrupt
        return code

    model, twin = make(), make()
    with monkeypatch.context() as patched:
        patched.setattr(plan, "drive_steps", interrupt)
        try:
            model.run(60)
        except KeyboardInterrupt:
            assert len(calls) >= interrupted
    assert model.steps == model.completed > 10
    assert_same(model, taken(twin, model.completed - 10))
    assert_same(model.run(30), taken(twin, 30))


def test_after_a_step_that_failed_steps_are_taken_one_by_one_and_the_plan_states_it():
    model = Plain(rng=1)
    speed = model.swarm.columns["max_speed"][1]
    model.swarm.columns["max_speed"][1] = math.nan
    with pytest.raises(BehaviourError):
        model.run(10)
    model.swarm.columns["max_speed"][1] = speed
    assert drive_model(model, 10) == 0
    assert "besides: a step failed before" in str(model.plan)


def test_a_copy_in_the_middle_of_a_run_goes_on_in_the_same_way():
    model = Plain(rng=5).run(55)
    twin = copy.deepcopy(model)
    assert_same(twin.run(77), model.run(77))


def test_a_step_of_a_class_is_called_for_each_step_and_the_plan_names_it():
    model = Counting(rng=1)
    model.run(20)
    assert model.state["n"] == 20
    assert "besides: Counting.step, a method in Python; declare stops, measures, parts or processes" in str(model.plan)
    assert str(model.plan).endswith("one step at a time: what is Python is due in each")


def test_a_step_replaced_by_hand_is_called_for_each_step():
    model, calls = Plain(rng=1), []
    step = model.step
    model.step = lambda: (calls.append(model.steps), step())
    model.run(10)
    assert calls == list(range(10))
    assert "besides: model.step was replaced" in str(model.plan)


def test_an_observer_is_called_after_each_step():
    model, observer = Plain(rng=1), Watching()
    model.observers.append(observer)
    model.run(9)
    assert observer.steps == [(step, step, step) for step in range(1, 10)]
    assert "besides: observer Watching" in str(model.plan)


def test_what_is_due_every_seven_steps_interrupts_only_then():
    one, other = Plain(rng=6), Plain(rng=6)
    for model in (one, other):
        model.add_part(Season())
    assert drive_model(one, 100) == 6
    assert_same(one.run(80), taken(other, 86))
    assert str(one.plan).endswith("driven: up to 6 steps in one compiled call, then one in Python")


def test_a_reporter_in_python_is_called_when_it_is_collected():
    def make():
        model = SwarmModel(
            rng=1, collect_every=5, model_reporters={"x": lambda model: float(model.swarm.position.sum())}
        )
        model.add_robots(AGENT9, 4)
        model.control = Subsumption(Avoid(), Explore())
        return model

    one, other = make(), make()
    assert_same(one.run(52), taken(other, 52))
    assert len(one.datacollector.model_vars["x"]) == 10
    assert "besides: reporter x, a function in Python" in str(one.plan)


def test_an_error_of_a_layer_is_raised_in_the_step_in_which_it_occurs_and_what_was_before_is_counted():
    def make():
        model = Plain(rng=1, n_robots=3).run(2)
        model.swarm.columns["max_speed"][1] = math.nan
        return model

    one, other = make(), make()
    with pytest.raises(BehaviourError) as first:
        one.run(40)
    with pytest.raises(BehaviourError) as second:
        taken(other, 40)
    assert str(first.value) == str(second.value)
    assert (one.steps, one.completed) == (other.steps, other.completed)


class Ends(SwarmModel):
    """A model that ends when a number of collisions is reached."""

    stops = until("total_collisions", at_least=5), until(count("position"), equals=99)


def test_a_class_whose_condition_is_of_a_column_of_pairs_is_refused_in_one_line():
    with pytest.raises(InvalidValueError, match=r"^column position has shape \(0, 2\); expected one number a row"):
        Ends(rng=1).run(5)


def test_a_run_ends_in_the_step_in_which_a_condition_of_the_class_holds():
    one, other = Reaching(n_robots=30, rng=1), Reaching(n_robots=30, rng=1)
    one.run(5000)
    taken(other, 5000)
    assert_same(one, other)
    assert not one.running
    assert one.stopped_at == one.steps == other.stopped_at < 5000
    assert one.total_collisions >= 5 > one.total_collisions - one.collisions


def test_a_condition_given_to_run_ends_it_as_the_same_in_python_does():
    declared, plain = Plain(n_robots=30, rng=1), Plain(n_robots=30, rng=1)
    declared.run(3000, until=until("total_collisions", at_least=3))
    plain.run(3000, until=lambda model: model.total_collisions >= 3)
    assert_same(declared, plain)
    assert declared.running


def test_a_model_that_no_longer_meets_its_condition_runs_again():
    model = FireFighting(rng=1, n_robots=1)
    for fire in model.fires:
        fire.remove()
    model.run(10)
    assert (model.steps, model.running, model.stopped_at) == (1, False, 1)
    model.add_fire((100, 100), radius=15)
    model.step()
    assert model.running
    assert model.run(20).steps == 22


def test_a_condition_that_python_computes_is_looked_at_after_the_steps_that_its_interval_divides():
    looked = []

    class Slow(Plain):
        stops = until("number", at_least=20, every=10)

        @property
        def number(self):
            looked.append(self.completed)
            return self.completed

    model = Slow(rng=1).run(100)
    assert model.steps == 20
    assert looked == [10, 20]


WRONG = [
    ("fires_burning", r"^stops is 'fires_burning'; expected conditions such as until_zero"),
    ((until_zero("a"), 3), r"^stops is \(until\('a', at_least=0.0, at_most=0.0\), 3\); expected conditions"),
]


@pytest.mark.parametrize(("stops", "line"), WRONG)
def test_a_class_with_a_wrong_declaration_of_stops_is_refused_in_one_line(stops, line):
    with pytest.raises(InvalidValueError, match=line):
        type("Wrong", (SwarmModel,), {"stops": stops})


def test_a_method_of_a_users_called_stops_is_left_alone():
    class Buses(SwarmModel):
        def stops(self):
            return 7

    assert Buses(rng=1).run(5).stops() == 7


def test_a_measure_of_an_unknown_column_is_refused_with_the_nearest_name():
    model = SwarmModel(rng=1, model_reporters={"x": count("colided")})
    # Newer versions of Mesa wrap what a reporter raises.
    with pytest.raises((UnknownNameError, RuntimeError), match=r"colided.*collided"):
        model.run(5)


@pytest.mark.parametrize("bounds", [{}, {"near": 3}, {"above": "x"}])
def test_wrong_bounds_are_refused_in_one_line(bounds):
    with pytest.raises(InvalidValueError):
        until("collisions", **bounds)


NUMBERS = st.lists(st.floats(-5, 5) | st.sampled_from([0.0, 1.0, -1.0]), max_size=20)


@given(NUMBERS, st.floats(-5, 5), st.sampled_from(["equals", "at_least", "at_most", "above", "below"]))
def test_counts_are_those_of_numpy(numbers, bound, name):
    compare = {
        "equals": np.equal,
        "at_least": np.greater_equal,
        "at_most": np.less_equal,
        "above": np.greater,
        "below": np.less,
    }
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, poses=[(20 + 10 * i, 20, 0.0) for i in range(len(numbers))])
    model.swarm.columns["temperature"][:] = numbers
    expected = int(np.count_nonzero(compare[name](np.array(numbers), bound)))
    assert count("temperature", **{name: bound})(model) == expected
    assert count("temperature")(model) == np.count_nonzero(numbers)
    if numbers:
        assert share("temperature", **{name: bound})(model) == expected / len(numbers)
        assert mean("temperature")(model) == pytest.approx(np.mean(numbers), abs=1e-12)
    else:
        assert math.isnan(mean("temperature")(model))


def test_a_data_collector_of_a_users_own_collects_as_before():
    def make():
        model = Plain(rng=1)
        model.datacollector = mesa.DataCollector(model_reporters={"n": lambda model: len(model.robots)})
        return model

    one, other = make().run(20), taken(make(), 20)
    assert one.datacollector.model_vars == other.datacollector.model_vars
    assert len(one.datacollector.model_vars["n"]) == 20


def test_previous_columns_are_those_before_the_step_and_nan_for_new_robots():
    model = Plain(rng=1)
    previous = model.add_part(Previous("position", "heading"))
    model.run(30)
    before = model.swarm.position.copy()
    model.step()
    np.testing.assert_array_equal(previous.columns()["position"].array, before)
    model.add_robots(AGENT9, 2)
    assert np.isnan(previous.columns()["heading"].array[-2:]).all()
    assert_same(copy.deepcopy(model).run(10), model.run(10))


def test_a_part_that_only_derives_something_leaves_the_fingerprint_as_it_is():
    model = Plain(rng=1).run(5)
    before = model.state_hash()
    model.add_part(Previous("position"))
    assert model.state_hash() == before


@pytest.mark.parametrize("name", ["positions", "layer"])
def test_a_column_that_cannot_be_kept_is_refused(name):
    with pytest.raises((UnknownNameError, InvalidValueError), match=name):
        SwarmModel(rng=1).add_part(Previous(name))


def test_robots_without_room_are_moved_within_a_driven_stretch():
    def make():
        model = Plain(rng=1)
        model.run(10)
        model.robots[0].position = model.robots[1].position
        return model

    assert_same(make().run(30), taken(make(), 30))


def test_however_many_robots_there_are_a_call_takes_the_steps_that_are_worth_one(monkeypatch):
    monkeypatch.setattr("mesa_swarm.model.driving.MOST_ROBOT_STEPS", 10)
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 20)
    assert str(model.plan).endswith("driven: up to 3 steps in one compiled call")
    with steps_driven() as numbers:
        model.run(7)
    assert numbers == [3, 3]
    assert model.steps == 7
