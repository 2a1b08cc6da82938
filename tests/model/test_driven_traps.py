"""What may be changed, missing or interrupted in a run that compiled calls drive: each as in single steps."""

import numpy as np
import pytest

from mesa_swarm import AGENT9, Column, Part, Previous, SwarmModel, count, drive, held, mean, process, until, value
from mesa_swarm.control import Explore, Subsumption, behaviour
from mesa_swarm.errors import BehaviourError, InvalidValueError
from mesa_swarm.physics import engine


def make(model_class=SwarmModel, robots=5, control=None, **parameters):
    model = model_class(rng=1, **parameters)
    model.add_robots(AGENT9, robots)
    model.control = control or Subsumption(Explore())
    return model


def taken(model, steps):
    for _ in range(steps):
        if not model.running:
            break
        model.step()
    return model


def rows(model, name="collisions"):
    return len(model.datacollector.model_vars[name])


class Mixin:
    """Not a model by itself."""

    stops = until("robot_steps", at_least=200)

    def step(self):
        self.state["n"] = self.state.get("n", 0) + 1
        super().step()


class Mixed(Mixin, SwarmModel):
    pass


def test_the_step_and_the_conditions_of_a_mixin_count():
    model = make(Mixed).run(60)
    assert (model.steps, model.state["n"], model.stopped_at) == (40, 40, 40)


@pytest.mark.parametrize(("first", "second"), [(1, 5), (10, 3), (4, 1), (5, 0)])
def test_an_interval_of_collecting_that_is_changed_between_runs_counts(first, second):
    one, other = make(collect_every=first).run(20), taken(make(collect_every=first), 20)
    one.collect_every = other.collect_every = second
    assert rows(one.run(20)) == rows(taken(other, 20))


@behaviour
def wander(me):
    return 1.0 - 0.5 * me.chance, 1.0


@process(every=7)
def push(model):
    model.robots[0].position = model.robots[1].position + 3.0


def test_ctrl_c_while_models_are_driven_together_leaves_no_half_step(monkeypatch):
    def crowd():
        model = make(robots=40, control=Subsumption(wander))
        model.add_process(push)
        return model

    calls, settle = [], engine.CompiledEngine.settle

    def interrupted(*arguments):
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return settle(*arguments)

    model = crowd()
    with monkeypatch.context() as patched:
        patched.setattr(engine.CompiledEngine, "settle", interrupted)
        with pytest.raises(KeyboardInterrupt):
            drive([model], 40)
    assert model.steps == model.completed > 7
    assert model.run(40 - model.completed).state_hash() == crowd().run(40).state_hash()


@process(memory={"t": 0.0})
def fail_once(t, position, step):
    if step == 17:
        t[0] = position[99, 0]


def test_after_a_step_that_failed_readings_are_taken_anew_in_runs_and_in_single_steps():
    one, other = make(robots=40), make(robots=40)
    for model, take in ((one, SwarmModel.run), (other, taken)):
        model.add_process(fail_once)
        with pytest.raises(BehaviourError):
            take(model, 30)
        take(model, 20)
    assert one.state_hash() == other.state_hash()


class Watcher:
    def after_step(self, model, step):
        return


@pytest.mark.parametrize("watched", [False, True])
def test_a_condition_given_to_run_is_looked_at_in_its_interval_only(watched):
    model = make()
    if watched:
        model.observers.append(Watcher())
    assert model.run(95, until=until("robot_steps", at_least=15, every=10)).steps == 10
    assert make(collect_every=0).run(2, until=until("robot_steps", at_least=5, every=10)).steps == 2


class Seldom(SwarmModel):
    stops = until("robot_steps", at_least=20, every=50)


def test_a_condition_of_a_class_that_is_not_due_does_not_end_a_run_that_another_has_ended():
    model = make(Seldom).run(30, until=until("robot_steps", at_least=30))
    assert (model.steps, model.running, model.stopped_at) == (6, True, None)
    assert model.run(60).steps == 50


@pytest.mark.parametrize("take", [SwarmModel.run, taken])
def test_a_value_at_a_place_that_there_is_not_is_nan(take):
    model = take(make(model_reporters={"v": value("number", 99), "w": value("number", 1)}), 5)
    assert np.isnan(model.datacollector.model_vars["v"]).all()
    assert {type(number) for number in model.datacollector.model_vars["w"]} == {int}


def test_models_that_are_given_one_held_reporter_hold_values_of_their_own():
    shared = held("total_collisions", every=100)
    models = [make(robots=robots, model_reporters=shared) for robots in (60, 2)]
    drive(models, 150)
    for model, robots in zip(models, (60, 2), strict=True):
        alone = make(robots=robots, model_reporters=held("total_collisions", every=100)).run(150)
        assert alone.datacollector.model_vars == model.datacollector.model_vars


def test_a_copy_of_columns_that_is_replaced_is_written_from_the_next_step_on():
    model = make()
    previous = model.add_part(Previous("heading"))
    taken(model, 5)
    previous.replace("heading", np.full(5, 9.0))
    before = model.swarm.heading.copy()
    model.step()
    np.testing.assert_array_equal(previous.columns()["heading"].array, before)


def test_the_interval_and_the_numbers_of_a_process_stay():
    @process(memory={"t": 0.0}, every=2)
    def tick(t, scale=1.0):
        t[0] += scale

    model = make()
    rule = model.add_process(tick)
    with pytest.raises(TypeError):
        rule.numbers["scale"] = 2.0
    assert model.run(20).processes[0].t == 10.0
    with pytest.raises(InvalidValueError, match=r"^every of process tick stays 2"):
        rule.every = 5


@process(every=50)
def add_late(model):
    if "previous" not in model.parts:
        model.add_part(Previous("heading"))


def test_a_measure_of_a_part_that_is_added_later_is_collected_as_in_single_steps():
    def late():
        model = make(collect_every=100, model_reporters={"h": mean("previous.heading")})
        model.add_process(add_late)
        return model

    one, other = late().run(100), taken(late(), 100)
    assert one.datacollector.model_vars == other.datacollector.model_vars
    assert rows(one, "h") == 1


class Striped(Part):
    name = "striped"

    def bind(self, context):
        self.table = np.arange(10.0).reshape(5, 2)

    def columns(self):
        return {"x": Column(self.table[:, 0])}


def test_a_measure_of_a_column_that_compiled_code_cannot_read_is_collected_in_python():
    model = make(model_reporters={"least": count("striped.x", below=5)})
    model.add_part(Striped())
    assert model.run(10).datacollector.model_vars["least"] == [3] * 10
    assert "reporter least, a function in Python" in str(model.plan)


class Until12(SwarmModel):
    @property
    def running(self):
        return self.steps < 12

    @running.setter
    def running(self, value):
        return


def test_a_class_that_computes_whether_it_runs_is_asked_after_each_step():
    assert make(Until12).run(40).steps == 12
