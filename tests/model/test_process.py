"""Processes and declared state: what a model is besides its robots."""

import copy
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import Process, SwarmModel, process, value
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.model.state import LARGE, State, quick_fingerprint
from support.scenes import blind, empty


@process(memory={"total": 0.0})
def add_up(total, step_size=1.0):
    total[0] += step_size


class Tide:
    """A process with a number and an array."""

    def __init__(self):
        self.level, self.marks = 0.0, np.zeros(3)

    def step(self, model):
        self.level += 0.5
        self.marks[model.steps % 3] += 1


class Log:
    """A process that notes where the robots are when it is called."""

    def __init__(self, name, notes):
        self.name, self.notes = name, notes

    def step(self, model):
        self.notes.append((self.name, model.completed, float(model.swarm.position[0, 0])))


def test_processes_are_called_once_a_step_in_their_order_after_robots_have_moved():
    model, notes = empty(), []
    model.add_robots(blind(), poses=[(100, 100, 0.0)])
    for name in "ba":
        model.add_process(Log(name, notes))
    model.run(2)
    assert [note[:2] for note in notes] == [("b", 0), ("a", 0), ("b", 1), ("a", 1)]
    assert isinstance(model.processes[0], Process)


def test_a_removed_process_is_not_called_again_and_what_it_changed_stays():
    model = empty()
    tide, other = model.add_process(Tide()), model.add_process(Tide())
    model.run(2)
    model.remove_process(tide)
    model.run(2)
    assert (tide.level, other.level) == (1.0, 2.0)
    assert model.processes == (other,)


def test_a_process_may_remove_itself_while_it_steps():
    class Once:
        def step(self, model):
            model.remove_process(self)

    model = empty()
    model.add_process(Once())
    tide = model.add_process(Tide())
    model.run(2)
    assert model.processes == (tide,)
    assert tide.level == 1.0


@pytest.mark.parametrize("wrong", [None, 3, "tide", Tide, object(), math.nan])
def test_what_has_no_step_is_no_process(wrong):
    model = empty()
    with pytest.raises(InvalidValueError, match=r"^process is .* expected an object with step\(model\)") as caught:
        model.add_process(wrong)
    assert "\n" not in str(caught.value)
    assert model.processes == ()


def test_a_process_is_added_once_and_removed_once():
    model, tide = empty(), Tide()
    model.add_process(tide)
    with pytest.raises(InvalidValueError, match="was added before"):
        model.add_process(tide)
    model.remove_process(tide)
    with pytest.raises(InvalidValueError, match=r"expected one of model\.processes"):
        model.remove_process(tide)


def test_the_state_of_processes_is_hashed():
    one, two = empty(), empty()
    tides = [model.add_process(Tide()) for model in (one, two)]
    assert one.state_hash() == two.state_hash()
    tides[0].marks[1] = 7
    assert one.state_hash() != two.state_hash()


def test_without_declared_state_the_hash_is_as_ever():
    model = empty()
    before = model.state_hash()
    model.state["delivered"] = 0
    assert model.state_hash() != before
    del model.state["delivered"]
    assert model.state_hash() == before


def test_state_holds_plain_values_by_name():
    model = empty()
    grid = np.zeros((2, 3))
    model.state.update(count=3, best=math.nan, name="a", done=False, rows=[1, (2.5, None)], by={"k": {1, 2}}, grid=grid)
    assert list(model.state) == ["count", "best", "name", "done", "rows", "by", "grid"]
    assert model.state["grid"] is grid
    assert "absent" not in model.state
    with pytest.raises(KeyError):
        model.state["absent"]


@pytest.mark.parametrize("wrong", [object(), [object()], {"a": {1: len}}, np.array([object()]), SwarmModel, b"".join])
def test_a_value_that_is_not_plain_is_refused_in_one_line(wrong):
    model = empty()
    with pytest.raises(InvalidValueError, match=r"^state\['x'\] is or has .* expected numbers, texts") as caught:
        model.state["x"] = wrong
    assert "\n" not in str(caught.value)
    assert len(model.state) == 0


@pytest.mark.parametrize("name", [1, None, "", "two\nlines", ("a",)])
def test_a_name_of_state_is_one_line_of_text(name):
    with pytest.raises(InvalidValueError, match="name of a value of state"):
        empty().state[name] = 1


@pytest.mark.parametrize("wrong", [3, "text", [("a", 1)]])
def test_state_is_replaced_by_values_by_name_only(wrong):
    model = empty()
    with pytest.raises(InvalidValueError, match="expected values by name"):
        model.state = wrong
    model.state = {"a": 1}
    assert model.state == {"a": 1}


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_a_copy_has_state_and_processes_of_its_own(duplicate):
    model = empty()
    model.add_process(Tide())
    model.state["grid"] = model.processes[0].marks
    twin = duplicate(model.run(2))
    assert twin.state["grid"] is twin.processes[0].marks
    assert twin.run(3).state_hash() != model.state_hash()
    assert twin.state_hash() == model.run(3).state_hash()


PLAIN = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(), st.binary()),
    lambda inner: st.one_of(st.lists(inner), st.tuples(inner), st.dictionaries(st.text(), inner)),
)


@pytest.mark.slow
@given(st.dictionaries(st.text(), PLAIN), st.randoms(use_true_random=False))
def test_equal_values_have_equal_fingerprints_in_whatever_order_they_were_declared(values, random):
    items = list(values.items())
    random.shuffle(items)
    assert quick_fingerprint(dict(items)) == quick_fingerprint(copy.deepcopy(values))


@pytest.mark.slow
@given(st.lists(PLAIN, max_size=5), st.lists(PLAIN, max_size=5))
def test_different_values_have_different_fingerprints(one, other):
    # Text of floats: 0.0 and -0.0 count as one, NaN as itself, 1 and True as different.
    same = repr(one).replace("-0.0", "0.0") == repr(other).replace("-0.0", "0.0")
    assert (quick_fingerprint(one) == quick_fingerprint(other)) >= same
    if "{" not in repr((one, other)):
        assert (quick_fingerprint(one) == quick_fingerprint(other)) == same


@given(st.integers(0, LARGE + 99))
def test_any_cell_of_a_large_array_counts_in_its_fingerprint(cell):
    grid = np.zeros(LARGE + 100, np.int8)
    before = quick_fingerprint(grid)
    grid[cell] = 1
    assert quick_fingerprint(grid) != before
    assert State({"a": grid})["a"] is grid


def test_a_number_that_is_set_by_hand_counts_from_the_next_step():
    model = SwarmModel(rng=1)
    counting = model.add_process(add_up(step_size=1.0))
    model.run(5)
    counting.step_size = 10.0
    assert (model.run(5).processes[0].total, counting.step_size) == (55.0, 10.0)


def test_what_is_remembered_is_set_by_hand_in_place():
    model = SwarmModel(rng=1)
    counting = model.add_process(add_up(step_size=1.0))
    model.run(5)
    counting.total = 100.0
    assert model.run(5).processes[0].total == 105.0


def test_a_wrong_number_that_is_set_by_hand_is_refused_and_the_old_one_stays():
    counting = add_up(step_size=1.0)
    with pytest.raises(InvalidValueError, match="add_up's step_size is nan"):
        counting.step_size = math.nan
    assert counting.step_size == 1.0


def test_a_measure_reads_what_a_process_remembers():
    model = SwarmModel(rng=1, model_reporters={"total": value("add_up.total")})
    model.add_process(add_up(step_size=2.0))
    assert model.run(4).datacollector.model_vars["total"] == [2.0, 4.0, 6.0, 8.0]
    assert "add_up" not in str(model.plan).partition("besides")[2]
