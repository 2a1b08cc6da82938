"""One row a step, also where the class of a model collects; and a step that is not taken is noticed."""

import copy
import pickle
import warnings

import mesa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9, SwarmModel, batch_run
from mesa_swarm.base.errors import InvalidValueError, StepWarning
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.experiments.reports import reduced
from mesa_swarm.viewing.final_state import final_state_of


def layer_of(agent):
    """Return the layer that drives a robot; obstacles, which are agents too, have none."""
    return getattr(agent, "layer", None)


class Plain(SwarmModel):
    """A model with a data collector that it does not collect, but at the beginning where that is required."""

    def __init__(self, *, own: bool = True, where: str = "after", every: int = 1, rng=None):
        reporters = {"robots": lambda model: len(model.robots)}
        super().__init__(rng=rng, collect_every=every, model_reporters=None if own else reporters)
        self.add_robots(AGENT9, 3)
        self.control = Subsumption(Avoid(), Explore())
        self.where = where
        if own:
            self.datacollector = mesa.DataCollector(model_reporters=reporters, agent_reporters={"x": layer_of})
        if "begin" in where:
            self.datacollector.collect(self)

    def step(self):
        super().step()
        self.robots[0].remove()


class Counting(Plain):
    """A model whose class collects where it is asked to: before the step or after it."""

    def step(self):
        if "before" in self.where:
            self.datacollector.collect(self)
        super().step()
        if "after" in self.where:
            self.datacollector.collect(self)


def rows_of(model):
    return model.datacollector.get_model_vars_dataframe()


@given(st.integers(0, 3), st.sampled_from(["after", "before", "none"]))
def test_a_collector_of_ones_own_has_one_row_a_step_and_the_collisions(steps, where):
    kind = Plain if where == "none" else Counting
    frame = rows_of(kind(where=where, rng=1).run(steps))
    assert len(frame) == steps
    assert set(frame) == {"robots", "collisions", "total_collisions"}


def test_rows_are_as_they_are_when_the_class_collects_or_at_the_end_of_its_step():
    values = {where: rows_of(Counting(where=where, rng=1).run(3))["robots"].tolist() for where in ("before", "after")}
    assert values == {"before": [3, 2, 1], "after": [2, 1, 0]}
    assert rows_of(Plain(where="none", rng=1).run(3))["robots"].tolist() == [2, 1, 0]


def test_a_row_of_the_beginning_is_kept_as_in_mesa():
    assert rows_of(Counting(where="begin after", rng=1).run(3))["robots"].tolist() == [3, 2, 1, 0]


def test_a_collector_of_ones_own_that_the_class_collects_has_rows_of_all_steps_whatever_collect_every_is():
    assert len(rows_of(Counting(every=4, rng=1).run(3))) == 3
    assert len(rows_of(Plain(every=2, where="none", rng=1).run(3))) == 1
    assert len(rows_of(Plain(every=0, where="none", rng=1).run(3))) == 0


class EachTenth(SwarmModel):
    """A model that collects now and then."""

    def __init__(self, *, every=1, rng=None):
        super().__init__(rng=rng, collect_every=every)
        self.datacollector = mesa.DataCollector(model_reporters={"step": "steps"})

    def step(self):
        super().step()
        if self.steps % 10 == 0:
            self.datacollector.collect(self)


class Gatherers(SwarmModel):
    """A model that collects something else."""

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.datacollector = mesa.DataCollector(model_reporters={"step": "steps"})
        self.found = []

    def collect(self, piece):
        self.found.append(piece)

    def step(self):
        super().step()
        self.collect(self.steps)


def test_a_class_that_collects_something_else_has_a_row_of_every_step():
    assert rows_of(Gatherers(rng=1).run(4))["step"].tolist() == [1, 2, 3, 4]


def test_where_a_class_collects_now_and_then_each_step_has_a_row_and_a_warning_names_the_way_out():
    with pytest.warns(StepWarning, match=r"EachTenth collects after some steps only.*collect_every=0") as caught:
        model = EachTenth(rng=1).run(30)
    assert len(caught) == 1
    assert rows_of(model)["step"].tolist() == list(range(1, 31))


def test_with_collect_every_0_a_class_that_collects_now_and_then_has_rows_of_these_steps_only():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert rows_of(EachTenth(every=0, rng=1).run(33))["step"].tolist() == [10, 20, 30]


def test_reports_of_rows_of_some_steps_have_the_final_value_of_the_last_step_and_no_sum():
    model = EachTenth(every=0, rng=1).run(33)
    assert reduced(model, ["final value of step", "maximum of step"]) == {
        "final value of step": 33,
        "maximum of step": 30,
    }
    with pytest.raises(
        InvalidValueError, match="sum of step would be over 3 of 33 steps, those in which EachTenth coll"
    ):
        reduced(model, ["sum of step"])
    assert final_state_of(model).series == {}


def test_agents_are_collected_once_too():
    frame = Counting(rng=1).run(3).datacollector.get_agent_vars_dataframe()
    assert frame.groupby("Step").size().tolist() == [frame.loc[step].shape[0] for step in (1, 2, 3)]
    assert frame.index.is_unique


def test_the_models_own_collector_has_one_row_a_step_and_warns_once_if_the_class_collects_as_well():
    with pytest.warns(StepWarning, match="Counting collected step 1 twice, of which the later row counts") as caught:
        model = Counting(own=False, rng=1).run(3)
    assert len(caught) == 1
    assert rows_of(model)["robots"].tolist() == [2, 1, 0]


def test_collect_every_0_leaves_collecting_to_the_class():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert rows_of(Counting(own=False, every=0, rng=1).run(3))["robots"].tolist() == [2, 1, 0]


def test_two_of_the_models_steps_in_one_are_two_rows():
    class Twice(SwarmModel):
        def step(self):
            super().step()
            super().step()

    assert len(rows_of(Twice(rng=1).run(3))) == 6


def test_a_batch_has_the_last_row_of_a_collector_of_ones_own():
    (row,) = batch_run(Counting, {}, rng=1, max_steps=2, display_progress=False, number_processes=1)[:1]
    assert (row["Step"], row["robots"], row["collisions"]) == (2, 1, 0)


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_a_copy_goes_on_collecting(duplicate):
    class_collects = CollectedByClass(rng=1).run(2)
    assert len(rows_of(duplicate(class_collects).run(3))) == 5


class CollectedByClass(SwarmModel):
    """A model of Mesa's usual form, of which a copy can be pickled."""

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.datacollector = mesa.DataCollector(model_reporters={"step": "steps"})

    def step(self):
        super().step()
        self.datacollector.collect(self)


@pytest.mark.parametrize("odd", [None, 5, mesa.DataCollector])
def test_anything_else_than_a_data_collector_is_refused(odd):
    with pytest.raises(InvalidValueError, match=r"expected a mesa.DataCollector\(...\)"):
        SwarmModel(rng=1).datacollector = odd


def test_a_collector_that_has_rows_already_has_no_collisions_in_these():
    model, collector = SwarmModel(rng=1), mesa.DataCollector(model_reporters={"step": "steps"})
    collector.collect(model)
    model.datacollector = collector
    frame = rows_of(model.run(2))
    assert frame["step"].tolist() == [0, 1, 2]
    assert frame["collisions"].isna().tolist() == [True, False, False]


class Forgetful(SwarmModel):
    """A model whose step leaves out that of its base."""

    def __init__(self, *, n: int = 2, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, n)

    def step(self):
        self.swarm.position.sum()


def test_a_step_without_the_models_own_is_named_once():
    with pytest.warns(StepWarning, match=r"Forgetful.step took no step of the model, .* call super\(\)") as caught:
        model = Forgetful(rng=1).run(3)
    assert len(caught) == 1
    assert (model.steps, model.completed) == (3, 0)


def test_a_model_that_rests_now_and_then_is_named_once_only():
    class Resting(SwarmModel):
        def step(self):
            if self.steps % 2:
                super().step()

    with pytest.warns(StepWarning, match="took no step of the model") as caught:
        assert Resting(rng=1).run(6).completed == 3
    assert len(caught) == 1
