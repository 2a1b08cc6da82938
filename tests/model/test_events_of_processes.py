"""Events that processes of arrays report: those of single steps, in their order, whatever the calls."""

import copy
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, Previous, SwarmModel, process
from mesa_swarm.base.errors import BehaviourError, InvalidValueError, UncompiledBehaviourWarning
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.kernels.event_rows import MOST_EVENTS
from mesa_swarm.kernels.plan import Driver


@process(events=("passed", "returned"))
def note_passages(position, previous_position, passed, returned, step, line=400.0):
    """Report who passes a line, and where or when."""
    for i in range(position.shape[0]):
        if previous_position[i, 0] < line <= position[i, 0]:
            passed[i] = position[i, 1]
        if previous_position[i, 0] >= line > position[i, 0]:
            returned[i] = step


@process(events=("alive",))
def report_all(position, alive):
    """Report each robot in each step."""
    for i in range(position.shape[0]):
        alive[i] = 1.0


def plaza(*processes, n=12, rng=1):
    model = SwarmModel(rng=rng)
    model.add_robots(AGENT9, n)
    model.control = Subsumption(Avoid(), Explore(turn_interval=40))
    model.add_part(Previous("position"))
    for rule in processes:
        model.add_process(rule)
    return model


def stepped(model, steps):
    for _ in range(steps):
        model.step()
    return model


def test_events_of_a_driven_run_are_those_of_single_steps(monkeypatch):
    taken, take = [], Driver.take

    def take_noting(driver, steps, *arguments):
        taken.append(steps)
        return take(driver, steps, *arguments)

    monkeypatch.setattr(Driver, "take", take_noting)
    driven = plaza(note_passages, note_passages(line=300.0)).run(1500)
    assert max(taken) > 900
    single = stepped(plaza(note_passages, note_passages(line=300.0)), 1500)
    assert len(single.events) > 5
    assert driven.events.rows() == single.events.rows()
    assert driven.state_hash() == single.state_hash()


@given(st.lists(st.integers(1, 60), min_size=1, max_size=5))
def test_events_are_the_same_for_any_splits_of_a_run(parts):
    whole, split = plaza(note_passages), plaza(note_passages)
    whole.run(sum(parts))
    for steps in parts:
        split.run(steps)
    assert split.events.rows() == whole.events.rows()


def test_more_events_than_the_buffer_holds_are_all_there_and_in_order():
    steps = MOST_EVENTS // 50 + 30
    model = plaza(report_all, report_all, n=60).run(steps)
    assert len(model.events) == 2 * 60 * steps
    assert (np.diff(model.events.step) >= 0).all()
    assert model.events.unique_id[:60].tolist() == model.swarm.unique_ids.tolist()
    assert model.events.rows() == stepped(plaza(report_all, report_all, n=60), steps).events.rows()


def test_events_name_the_robots_that_are_there_after_some_were_removed_and_others_added():
    model = plaza(report_all, n=5).run(10)
    model.remove_robots([model.robots[1]])
    model.add_robots(AGENT9, 1)
    model.run(10)
    last = model.events.unique_id[model.events.step == 20]
    assert last.tolist() == model.swarm.unique_ids.tolist()


def test_events_of_a_method_of_the_model_and_of_processes_stay_in_their_order():
    model = plaza(report_all, n=2).run(5)
    model.event("noon")
    model.run(1)
    assert model.events.name.tolist() == ["alive"] * 10 + ["noon"] + ["alive"] * 2


def test_a_process_that_numba_refuses_reports_the_same():
    @process(events=("alive",))
    def report_plainly(position, alive):
        """Report each robot in a way that Numba refuses."""
        for i, label in enumerate([str(x) for x in position[:, 0]]):
            alive[i] = {"length": float(bool(label))}["length"]

    model = plaza(report_plainly, n=3)
    with pytest.warns(UncompiledBehaviourWarning):
        model.run(5)
    assert model.events.rows() == plaza(report_all, n=3).run(5).events.rows()


def test_copies_report_for_themselves():
    model = plaza(note_passages).run(200)
    twin = copy.deepcopy(model)
    before = model.events.rows()
    twin.run(300)
    assert model.events.rows() == before
    assert model.run(300).events.rows() == twin.events.rows()


def test_a_resumed_run_reports_what_the_recorded_one_did(tmp_path):
    model = Reporting(rng=3)
    with model.record(tmp_path / "run.arrow", checkpoint_every=50):
        model.run(200)
    assert Reporting.verify(tmp_path / "run.arrow").same
    resumed = Reporting.resume(tmp_path / "run.arrow", step=120).run(80)
    assert resumed.events.rows() == model.events.rows()
    assert len(model.events) > 2


class Reporting(SwarmModel):
    """Robots that report where they pass."""

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, 30)
        self.control = Subsumption(Avoid(), Explore(turn_interval=40))
        self.add_part(Previous("position"))
        self.add_process(note_passages)


@pytest.mark.parametrize("steps", [1, 30])
def test_an_infinite_value_is_refused_with_robot_and_step_and_leaves_nothing_behind(steps):
    @process(events=("burnt",), memory={"from_step": 20})
    def overheat(position, burnt, step, from_step):
        """Report an infinite number."""
        for i in range(position.shape[0]):
            if step > from_step[0] or from_step[0] == 0:
                burnt[i] = math.inf

    model = plaza(overheat, n=3)
    if steps == 1:
        model.processes[0].memory["from_step"][:] = 0
    with pytest.raises(BehaviourError, match=r"overheat failed in step \d+: it reported burnt of robot \d+ as inf"):
        model.run(steps)
    assert len(model.events) == 0


WRONG = [
    {"events": "passed"},
    {"events": ("unknown",)},
    {"events": ("line",)},
    {"events": ("passed", "passed")},
    {"events": 3},
    {"events": (3,)},
    {"events": ([],)},
    {"events": ("passed",), "memory": {"passed": 0}},
]


@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_names_of_events_are_refused_in_one_line(wrong):
    def rule(position, passed, line=1.0):
        """Do nothing."""

    with pytest.raises(InvalidValueError) as refused:
        process(**wrong)(rule)
    assert "\n" not in str(refused.value)


def test_a_process_of_the_model_calls_event_instead():
    with pytest.raises(InvalidValueError, match=r"call model\.event instead"):
        process(events=("passed",))(lambda model: None)


def test_an_event_with_the_name_of_a_column_is_refused_when_the_process_is_added():
    @process(events=("heading",))
    def turn(heading):
        """Report headings."""

    with pytest.raises(InvalidValueError, match="has heading, a column; give it another name"):
        plaza(turn)


def test_events_of_a_step_that_failed_are_not_reported_later():
    @process(events=("alive",), memory={"steps": 0})
    def fail_once(alive, steps):
        """Raise an error in the third step."""
        steps[0] += 1
        if steps[0] == 3:
            alive[0] = 7.0
            raise ValueError("boom")

    model = plaza(fail_once, n=2)
    with pytest.raises(BehaviourError):
        model.run(10)
    model.run(5)
    assert len(model.events) == 0


def test_a_process_that_is_removed_leaves_its_namesake_its_own_stream():
    @process(memory={"drawn": 0.0})
    def draw(chance, drawn):
        """Draw a number."""
        drawn[0] = chance

    both, other = plaza(draw, draw, n=1), plaza(draw, draw, n=1)
    other.remove_process(other.run(3).processes[0])
    assert other.run(1).processes[0].drawn == both.run(4).processes[1].drawn


def test_a_copy_by_pickle_is_small_and_has_the_events():
    model = plaza(note_passages).run(300)
    content = pickle.dumps(model)
    assert len(content) < 150_000
    assert pickle.loads(content).events.rows() == model.events.rows()
