"""Observers of a model: what is called when, for classes derived from `Observer` and for any other object."""

import pickle
from copy import deepcopy
from types import SimpleNamespace

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel, process
from mesa_swarm.base.errors import BehaviourError, InvalidValueError
from mesa_swarm.base.trigger import Trigger
from mesa_swarm.control import Explore, Subsumption
from mesa_swarm.model.observers import HOOKS, Observer, Observers
from support.driven_models import taken
from support.recorded_twice import steps_driven


class Diary(Observer):
    """Derived, with every method."""

    def __init__(self):
        self.entries = []

    def before_step(self, model):
        self.entries.append(("before_step", model.completed))

    def after_step(self, model, step):
        self.entries.append(("after_step", step))

    def between_steps(self, model):
        self.entries.append(("between_steps", model.completed))

    def after_failure(self, model):
        self.entries.append(("after_failure", model.completed))

    def after_run(self, model, steps):
        self.entries.append(("after_run", steps))

    def close(self):
        self.entries.append(("close",))


class Counter:
    """Of a user: derived from nothing, with the one method that was documented first."""

    def __init__(self):
        self.steps = []

    def after_step(self, model, step):
        self.steps.append(step)


class Failing(SwarmModel):
    def step(self):
        super().step()
        if self.completed == 2:
            raise RuntimeError("broken")


def observed(observer, model=None):
    model = SwarmModel(rng=1) if model is None else model
    model.observers.append(observer)
    return model


def test_a_derived_observer_is_called_around_every_step_and_after_the_run():
    diary = Diary()
    observed(diary).run(2)
    step = [("before_step", 0), ("after_step", 1), ("between_steps", 1)]
    step += [("before_step", 1), ("after_step", 2), ("between_steps", 2)]
    assert diary.entries == [*step, ("after_run", 2)]


def test_a_step_that_fails_is_reported_and_the_run_closes_the_observer():
    diary = Diary()
    with pytest.raises(RuntimeError, match="broken"):
        observed(diary, Failing(rng=1)).run(5)
    assert diary.entries[-3:] == [("after_step", 2), ("after_failure", 2), ("close",)]


def test_what_is_not_overridden_does_nothing():
    model = observed(Observer.__new__(type("Silent", (Observer,), {})), Failing(rng=1))
    with pytest.raises(RuntimeError, match="broken"):
        model.run(5)
    assert model.completed == 2


def test_an_object_with_after_step_only_is_called_and_survives_a_run_that_fails():
    counter = Counter()
    observed(counter).run(3)
    assert counter.steps == [1, 2, 3]
    counter = Counter()
    with pytest.raises(RuntimeError, match="broken"):
        observed(counter, Failing(rng=1)).run(5)
    assert counter.steps == [1, 2]


@pytest.mark.parametrize("hook", HOOKS)
def test_an_object_with_any_single_method_is_called_by_it_and_by_nothing_else(hook):
    calls = []
    single = type("Single", (), {hook: lambda self, *given: calls.append(given[1:])})
    with pytest.raises(RuntimeError, match="broken"):
        observed(single(), Failing(rng=1)).run(5)
    new = observed(single(), SwarmModel(rng=1)).run(2).continued()
    expected = {
        "before_step": [()] * 4,
        "after_step": [(1,), (2,), (1,), (2,)],
        "between_steps": [()] * 3,
        "after_failure": [()],
        "after_run": [(2,)],
        "replaced": [(new, [])],
        "break_off": [()],
        "close": [()],
    }
    assert calls == expected[hook]


def test_break_off_comes_instead_of_close_where_there_are_both():
    calls = []
    both = type(
        "Both", (Counter,), {"break_off": lambda self: calls.append("off"), "close": lambda self: calls.append("close")}
    )
    with pytest.raises(RuntimeError, match="broken"):
        observed(both(), Failing(rng=1)).run(5)
    assert calls == ["off"]


def test_methods_that_are_none_count_as_missing():
    counter = Counter()
    counter.before_step = counter.break_off = None
    with pytest.raises(RuntimeError, match="broken"):
        observed(counter, Failing(rng=1)).run(5)
    assert counter.steps == [1, 2]


def test_the_list_holds_the_objects_that_were_added():
    first, second, third = Counter(), Counter(), Diary()
    model = SwarmModel(rng=1)
    model.observers.append(first)
    model.observers.extend([third])
    model.observers.insert(0, second)
    assert list(model.observers) == [second, first, third]
    assert first in model.observers
    assert model.observers.index(third) == 2
    assert model.observers[0] is second
    model.observers.remove(first)
    assert first not in model.observers
    assert len(model.observers) == 2


CHANGES = {
    "append": lambda observers, a, b: observers.append(b),
    "extend": lambda observers, a, b: observers.extend([b, b]),
    "insert": lambda observers, a, b: observers.insert(0, b),
    "remove": lambda observers, a, b: observers.remove(a),
    "pop": lambda observers, a, b: observers.pop(),
    "clear": lambda observers, a, b: observers.clear(),
    "reverse": lambda observers, a, b: observers.reverse(),
    "sort": lambda observers, a, b: observers.sort(key=id),
    "set": lambda observers, a, b: observers.__setitem__(0, b),
    "slice": lambda observers, a, b: observers.__setitem__(slice(0, 1), [b, b]),
    "delete": lambda observers, a, b: observers.__delitem__(0),
    "add": lambda observers, a, b: observers.__iadd__([b]),
    "multiply": lambda observers, a, b: observers.__imul__(2),
}


@pytest.mark.parametrize("name", CHANGES)
def test_after_any_change_of_the_list_its_objects_are_called_in_its_order(name):
    calls = []
    labelled = type("Labelled", (), {"after_step": lambda self, model, step: calls.append(self)})
    one, two, other = labelled(), labelled(), labelled()
    model = SwarmModel(rng=1)
    model.observers += [one, two]
    CHANGES[name](model.observers, one, other)
    model.step()
    assert calls == list(model.observers)


def test_a_list_may_be_assigned():
    counter = Counter()
    model = SwarmModel(rng=1)
    model.observers = [counter]
    assert model.run(2).observers == [counter]
    assert counter.steps == [1, 2]


@pytest.mark.parametrize("wrong", [3, "a text", print, Counter.__init__])
def test_what_has_none_of_the_methods_is_refused_and_the_list_stays(wrong):
    counter = Counter()
    model = observed(counter)
    with pytest.raises(InvalidValueError, match=r"observer is .*; expected an object with after_step\(model, step\)"):
        model.observers.append(wrong)
    assert model.observers == [counter]
    model.step()
    assert counter.steps == [1]


def test_an_observer_that_removes_itself_leaves_the_others_their_turn():
    class Once(Counter):
        def after_step(self, model, step):
            super().after_step(model, step)
            model.observers.remove(self)

    once, counter = Once(), Counter()
    model = observed(once)
    observed(counter, model).run(3)
    assert (once.steps, counter.steps) == ([1], [1, 2, 3])


def test_copies_of_a_model_have_no_observers():
    model = observed(Counter())
    for copy in (deepcopy(model), pickle.loads(pickle.dumps(model))):
        assert copy.observers == []
        assert isinstance(copy.observers, Observers)
        assert copy.run(1).completed == 1
    assert model.completed == 0


# ---- observers of some steps


class Seldom(Diary):
    """Called around every fourth step."""

    every = 4


class Rare(Counter):
    """Of a user, derived from nothing, with a property."""

    @property
    def every(self):
        return 10


def test_an_observer_with_an_interval_is_called_around_the_steps_that_it_divides_only():
    diary = Seldom()
    observed(diary).run(9)
    calls = [("before_step", 3), ("after_step", 4), ("between_steps", 4)]
    calls += [("before_step", 7), ("after_step", 8), ("between_steps", 8)]
    assert diary.entries == [*calls, ("after_run", 9)]


def test_single_steps_call_an_observer_with_an_interval_as_a_run_does():
    one, other = Seldom(), Seldom()
    observed(one).run(25)
    taken(observed(other), 25)
    assert [entry for entry in one.entries if entry[0] != "after_run"] == other.entries


def test_observers_with_several_intervals_are_called_in_their_order():
    calls = []

    def observer(every):
        return SimpleNamespace(every=every, after_step=lambda model, step: calls.append((every, step)))

    model = SwarmModel(rng=1)
    model.observers.extend([observer(6), observer(4), observer(1)])
    model.run(12)
    assert [call for call in calls if call[1] == 12] == [(6, 12), (4, 12), (1, 12)]
    assert {every: sum(call[0] == every for call in calls) for every in (6, 4, 1)} == {6: 2, 4: 3, 1: 12}


def test_the_steps_between_those_of_an_observer_are_taken_in_one_compiled_call():
    rare = Rare()
    with steps_driven() as numbers:
        model = observed(rare)
        plan = str(model.plan)
        model.run(35)
    assert rare.steps == [10, 20, 30]
    assert numbers == [9, 9, 9, 5]
    assert "besides: observer Rare, every 10 steps" in plan
    assert plan.endswith("driven: up to 9 steps in one compiled call, then one in Python")


def test_an_observer_of_each_step_has_every_step_taken_by_itself():
    with steps_driven() as numbers:
        observed(Counter(), observed(Rare())).run(35)
    assert not numbers


def test_what_an_observer_with_an_interval_changes_counts_as_in_single_steps():
    class Pusher(Seldom):
        def between_steps(self, model):
            model.robots[0].position = (30.0 + model.completed, 40.0)

    def make():
        model = SwarmModel(rng=1)
        model.add_robots(AGENT9, 5)
        model.control = Subsumption(Explore())
        return observed(Pusher(), model)

    assert make().run(50).state_hash() == taken(make(), 50).state_hash()


def test_a_step_that_fails_is_reported_to_an_observer_of_other_steps_too():
    diary = Seldom()
    with pytest.raises(RuntimeError, match="broken"):
        observed(diary, Failing(rng=1)).run(5)
    assert diary.entries == [("after_failure", 2), ("close",)]


@process(memory={"t": 0.0})
def fail_late(t, position, step):
    if step == 6:
        t[0] = position[99, 0]


def test_a_step_that_fails_within_a_compiled_call_is_reported_once():
    diary, model = Seldom(), SwarmModel(rng=1)
    model.add_robots(AGENT9, 5)
    model.add_process(fail_late)
    with pytest.raises(BehaviourError):
        observed(diary, model).run(30)
    assert diary.entries[3:] == [("after_failure", 5), ("close",)]


@pytest.mark.parametrize("wrong", [0, -1, 2.5, "x", [3], True, float("nan"), 2**40, Counter.__init__])
def test_an_interval_that_is_not_a_whole_number_from_1_is_refused_in_one_line_and_the_list_stays(wrong):
    counter = Counter()
    model = observed(counter)
    odd = Counter()
    odd.every = wrong
    with pytest.raises(InvalidValueError, match=r"^every of observer Counter is .*; expected a whole number") as caught:
        model.observers.append(odd)
    assert "\n" not in str(caught.value)
    assert model.observers == [counter]
    assert model.run(3).steps == 3
    assert counter.steps == [1, 2, 3]


@pytest.mark.parametrize("every", [np.int64(5), 5.0, Trigger(every=5), None])
def test_an_interval_may_be_any_whole_number_or_a_trigger_and_none_is_each_step(every):
    counter = Counter()
    counter.every = every
    observed(counter).run(11)
    assert counter.steps == ([5, 10] if every is not None else list(range(1, 12)))
