"""Measures of functions of arrays: the same in single steps and in compiled calls, held, pickled, refused."""

import copy
import math
import pickle

import numpy as np
import pytest

from mesa_swarm import AGENT9, Column, Part, SwarmModel, disc, held, measure, process, until
from mesa_swarm.base.errors import BehaviourError, InvalidValueError, UnknownNameError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.learning import TableQLearning
from mesa_swarm.models.q_learning import QLearning


@process(memory={"passed": 0})
def gate(position, passed):
    for i in range(len(position)):
        passed[0] += position[i, 0] > 400


class Counting(SwarmModel):
    """Robots that explore, and numbers of all kinds."""

    def __init__(self, rng=None, limit=300.0, every=7, **more):
        reporters = {"ahead": "ahead", "order": "order", **held("passages", "left", every=every)}
        super().__init__(rng=rng, model_reporters=reporters, **more)
        self.limit = limit
        self.add_body(disc((200, 300), 5), kind="mark")
        self.add_robots(AGENT9, 8)
        self.add_process(gate)
        self.control = Subsumption(Avoid(distance=15), Explore())

    @measure
    @staticmethod
    def ahead(position, limit):
        """How many robots are beyond a line."""
        return np.sum(position[:, 0] > limit)

    @measure
    @staticmethod
    def order(heading):
        """Length of the mean heading."""
        x, y = 0.0, 0.0
        for i in range(len(heading)):
            x, y = x + math.cos(heading[i]), y + math.sin(heading[i])
        return math.hypot(x, y) / len(heading)

    @measure
    @staticmethod
    def passages(gate_passed, step, share=0.5):
        return share * gate_passed[0] / max(step, 1)

    middle = measure(lambda position: np.mean(position[:, 0]))

    @measure
    @staticmethod
    def left(position, bodies_position):
        return np.sum(position[:, 0] < bodies_position[-1, 0])


def in_single_steps(model, steps):
    for _ in range(steps):
        model.step()
    return model


def test_a_measure_is_a_property_of_the_model_as_it_is_now():
    model = Counting(rng=1)
    assert model.ahead == int((model.swarm.position[:, 0] > 300).sum())
    assert type(model.ahead) is int
    model.limit = 100.0
    assert model.ahead == int((model.swarm.position[:, 0] > 100).sum())
    headings = model.swarm.heading
    assert model.order == pytest.approx(abs(np.exp(1j * headings).mean()))
    assert Counting.order.__doc__ == "Length of the mean heading."


@pytest.mark.parametrize("every", [1, 3, 7])
@pytest.mark.parametrize("collect_every", [1, 4])
@pytest.mark.parametrize("splits", [(60,), (10, 1, 20, 29), (3, 3, 54)])
def test_rows_of_a_driven_run_are_those_of_single_steps(every, collect_every, splits):
    driven, single = (Counting(rng=2, every=every, collect_every=collect_every) for _ in range(2))
    for steps in splits:
        driven.run(steps)
    in_single_steps(single, 60)
    assert "driven: up to 1000 steps" in str(driven.plan)
    assert driven.datacollector.model_vars == single.datacollector.model_vars
    types = [{type(number) for number in driven.datacollector.model_vars[name]} for name in ("ahead", "left")]
    assert types == [{int}, {int}]


def test_rows_are_the_same_where_single_steps_and_compiled_calls_take_turns():
    mixed, single = Counting(rng=3), in_single_steps(Counting(rng=3), 100)
    while mixed.completed < 100:
        mixed.run(13)
        in_single_steps(mixed, min(2, 100 - mixed.completed))
        mixed.run(min(5, 100 - mixed.completed))
    assert mixed.datacollector.model_vars == single.datacollector.model_vars


def test_what_a_function_reads_of_the_model_is_read_when_a_run_begins():
    model = Counting(rng=4).run(20)
    model.limit = -1.0
    model.run(20)
    assert model.datacollector.model_vars["ahead"][-1] == 8


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_a_copy_goes_on_measuring(duplicate):
    model = Counting(rng=5).run(25)
    other = duplicate(model)
    assert other.run(25).datacollector.model_vars == model.run(25).datacollector.model_vars
    assert other.order == model.order
    assert pickle.loads(pickle.dumps(Counting.middle)) is Counting.middle
    assert repr(Counting.middle) == "measure Counting.middle"
    assert other.middle == pytest.approx(other.swarm.position[:, 0].mean())


def test_a_recording_goes_on_measuring(tmp_path):
    model = Counting(rng=6)
    with model.record(tmp_path / "run.arrow", checkpoint_every=20):
        model.run(45)
    again = Counting.resume(tmp_path / "run.arrow", step=40).run(5)
    assert again.datacollector.model_vars == model.datacollector.model_vars


def test_a_run_ends_by_a_measure():
    class Ending(Counting):
        stops = until("ahead", at_least=6)

    model = Ending(rng=7).run(3_000)
    assert model.ahead >= 6
    assert not model.running
    single = Ending(rng=7)
    while single.running:
        single.step()
    assert single.completed == model.completed
    assert Counting(rng=7).run(3_000, until=until(Counting.ahead, at_least=6)).completed == model.completed


class Failing(Counting):
    @measure
    @staticmethod
    def order(position, step):
        if step == 30:
            raise ValueError("thirty")
        return 1.0


@pytest.mark.parametrize("steps", [1, 50])
def test_an_error_of_a_function_names_it_and_the_step(steps):
    model = Failing(rng=8).run(29 if steps == 1 else 0)
    with pytest.raises(BehaviourError, match=r"^measure Failing.order failed in step 30: it raised ValueError: thirty"):
        model.run(steps)


@pytest.mark.parametrize("take", [lambda model, n: model.run(n), lambda model, n: [model.step() for _ in range(n)]])
def test_after_an_error_of_a_function_the_run_goes_on_behind_a_whole_step(take):
    model = Failing(rng=8)
    with pytest.raises(BehaviourError):
        take(model, 50)
    take(model, 20)
    assert (model.steps, model.completed) == (50, 50)
    assert "driven: up to 1000 steps" in str(model.plan)


class Bodies(SwarmModel):
    """Bodies that come and go."""

    def __init__(self, rng=None, **reporters):
        super().__init__(rng=rng, model_reporters={"weight": "weight", **reporters})
        self.add_robots(AGENT9, 2)
        self.k = np.int64(2)

    @measure
    @staticmethod
    def weight(bodies_position, k):
        return len(bodies_position) * k


@pytest.mark.parametrize("first", range(1, 8))
def test_rows_and_stops_follow_bodies_that_are_added_and_numbers_of_other_types(first):
    model = Bodies(rng=1)
    walls = len(model.bodies)
    for k in range(first):
        model.add_body(disc((100 + 30 * k, 300), 5))
    model.run(5)
    model.add_body(disc((100, 100), 5))
    model.run(5)
    assert model.datacollector.model_vars["weight"] == [2 * (walls + first)] * 5 + [2 * (walls + first + 1)] * 5
    ended = model.run(50, until=until("weight", at_least=2 * (walls + first + 1)))
    assert ended.completed == 11
    model.k = 2.0
    model.run(5)
    assert type(model.datacollector.model_vars["weight"][-1]) is float


def test_a_number_that_is_held_for_one_step_is_measured_in_each():
    model = Bodies(rng=1, **held("counted", every=1))
    type(model).counted = property(lambda model: model.completed)
    model.run(7)
    assert model.datacollector.model_vars["counted"] == [1, 2, 3, 4, 5, 6, 7]


def test_what_cannot_be_measured_yet_is_not_asked_for():
    class Late(SwarmModel):
        @measure
        @staticmethod
        def late(step):
            if step < 10:
                raise ValueError("too early")
            return 1.5

    model = Late(rng=1, collect_every=10, model_reporters=held("late", every=10))
    model.add_robots(AGENT9, 1)
    assert model.run(20).datacollector.model_vars["late"] == [1.5, 1.5]


def test_columns_that_are_not_contiguous_are_read_as_they_are():
    class Pairs(Part):
        name = "pairs"

        def __init__(self):
            self.base = np.arange(6.0).reshape(3, 2)

        def columns(self):
            return {"second": Column(self.base[:, 1], None)}

    model = SwarmModel(rng=1, model_reporters={"sum": measure(lambda pairs_second: pairs_second.sum())})
    model.add_part(Pairs())
    model.add_robots(AGENT9, 1)
    assert model.run(4).datacollector.model_vars["sum"] == [9.0] * 4


def test_an_attribute_that_is_no_number_is_named():
    model = Bodies(rng=1)
    model.k = None
    with pytest.raises(
        InvalidValueError, match=r"parameter k of measure Bodies.weight is the attribute k of the model"
    ):
        _ = model.weight
    assert repr(until(Bodies.weight, at_least=1)).startswith("until('measure Bodies.weight'")


def test_a_function_that_numba_refuses_is_run_in_python_with_a_warning():
    class Odd(SwarmModel):
        @measure
        @staticmethod
        def named(position):
            return len(position.tolist()) / 2

    model = Odd(rng=9, model_reporters={"named": "named"})
    model.add_robots(AGENT9, 2)
    with pytest.warns(match="measure .*Odd.named cannot be compiled"):
        model.run(5)
    assert model.datacollector.model_vars["named"] == [1.0] * 5
    assert "reporter named, a function in Python" in str(model.plan)


def test_a_parameter_that_names_nothing_is_refused_with_what_there_is():
    class Wrong(SwarmModel):
        @measure
        @staticmethod
        def far(positon):
            return 1.0

    with pytest.raises(
        UnknownNameError, match=r"unknown parameter of measure .*far 'positon'; did you mean 'position'"
    ):
        _ = Wrong(rng=1).far


def test_a_name_that_is_a_column_and_a_number_of_the_model_is_refused():
    class Twice(SwarmModel):
        def __init__(self, rng=None):
            super().__init__(rng=rng)
            self.add_robots(AGENT9, 1)
            self.heading = 3.0

        turned = measure(lambda heading: heading)

    with pytest.raises(InvalidValueError, match=r"parameter heading of measure .* is a column, and a number"):
        _ = Twice(rng=1).turned


def drawing(position):
    return np.random.random()  # noqa: NPY002 - what is refused


def lettered(position, letter="a"):
    return 1.0


@pytest.mark.parametrize("wrong", [3, "text", lettered, drawing])
def test_what_is_no_function_of_arrays_and_numbers_is_refused(wrong):
    with pytest.raises((InvalidValueError, BehaviourError)):
        measure(wrong)


def test_a_column_that_only_one_layer_has_is_named_without_the_layer():
    class Cooling(QLearning):
        @measure
        @staticmethod
        def coolest(control_temperature):
            return control_temperature.min()

        @measure
        @staticmethod
        def fewest(control_TableQLearning_lessons):  # noqa: N803 - the name of a class
            return control_TableQLearning_lessons.min()

        @measure
        @staticmethod
        def unclear(control_values):
            return control_values.min()

    for memory in ("networks", "table"):
        model = Cooling(n_robots=4, memory=memory, beta=0.01, rng=1).run(30)
        assert model.coolest == model.learner.temperature.min() < 1
        assert model.temperature == pytest.approx(model.learner.temperature.mean())
        assert model.reward == pytest.approx(model.learner.last_reward.mean())
    assert model.fewest == model.swarm.columns["0.TableQLearning.lessons"].min() > 0
    model.control = {AGENT9: Subsumption(TableQLearning(), TableQLearning(gamma=0.5))}
    with pytest.raises(UnknownNameError, match=r"unknown parameter of measure .*unclear 'control_values'"):
        model.unclear  # noqa: B018 - it is read
