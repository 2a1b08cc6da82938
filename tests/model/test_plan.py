"""The plan of a step: its stages in order, what makes Python due, and parts that are added and removed."""

import warnings

import numpy as np
import pytest

from mesa_swarm import AGENT9, Part, SwarmModel
from mesa_swarm.base.errors import InvalidValueError, SwarmError, UnknownNameError
from mesa_swarm.control import PASS, Avoid, Explore, Subsumption, behaviour
from mesa_swarm.kernels.part import Column, Phase, Stage
from mesa_swarm.model.gallery import find_model, gallery_names


class Bell(Part):
    """A part that notes the steps in which it rings."""

    def __init__(self, name="bell", phase=Phase.PROCESS, every=1):
        self.name, self.phase, self.every = name, phase, every
        self.rung = []

    def bind(self, context):
        self.model = context.model

    def stages(self):
        return [Stage(self.phase, self.ring, "rings", every=self.every)]

    def ring(self):
        self.rung.append((self.name, self.model.completed))


def world(**named):
    model = SwarmModel(rng=1, **named)
    model.add_robots(AGENT9, 3)
    model.control = Subsumption(Avoid(), Explore())
    return model


@pytest.mark.parametrize("name", gallery_names())
def test_stages_are_in_the_order_of_phases_and_within_a_phase_of_parts(name):
    model = find_model(name)(rng=1)
    order = list(model.parts)
    keys = [(stage.phase, order.index(part)) for part, stage in model.plan.stages]
    assert keys == sorted(keys)
    assert all(word in str(model.plan) for word in ("sense", "move", "robots read their sensors"))


def test_stages_of_added_parts_come_in_their_phase_after_those_that_were_there():
    model = world()
    bells = [model.add_part(Bell(name, phase)) for name, phase in (("late", Phase.ACT), ("early", Phase.SENSE))]
    rung = bells[0].rung = bells[1].rung
    model.run(2)
    assert rung == [("early", 0), ("late", 0), ("early", 1), ("late", 1)]
    assert [part for part, _ in model.plan.stages][:3] == ["robots", "early", "control"]


@pytest.mark.parametrize(("phase", "steps"), [(Phase.SENSE, [2, 5, 8]), (Phase.COLLECT, [3, 6, 9])])
def test_a_stage_is_called_in_the_steps_that_its_interval_divides(phase, steps):
    model = world()
    bell = model.add_part(Bell(phase=phase, every=3))
    model.run(10)
    assert [completed for _, completed in bell.rung] == steps


def test_a_part_that_was_removed_is_called_no_more_and_its_name_is_free():
    model = world()
    bell = model.add_part(Bell())
    model.run(2)
    assert model.remove_part("bell") is bell
    again = model.add_part(Bell())
    model.run(3)
    assert (len(bell.rung), len(again.rung)) == (2, 3)


class Lined(Part):
    """A part with one column as it is given."""

    name = "lined"

    def __init__(self, column):
        self.column = column

    def columns(self):
        return {"value": self.column}


COLUMNS = {
    "two rows": (Column(np.zeros(2), "robots"), "has shape (2,); expected 3 rows"),
    "no rows": (Column(np.array(0.0), "bodies"), "has shape (); expected 4 rows"),
    "a list": (Column([0, 0, 0], "robots"), "expected Column(array, rows, role)"),
    "an array": (np.zeros(3), "expected Column(array, rows, role)"),
    "another role": (Column(np.zeros(3), "robots", "memory"), "unknown role of column value of part lined 'memory'"),
    "other rows": (Column(np.zeros(3), "wheels"), "unknown rows of column value of part lined 'wheels'"),
}


@pytest.mark.parametrize(("column", "words"), COLUMNS.values(), ids=COLUMNS)
def test_a_column_that_does_not_fit_the_model_is_refused_when_its_part_is_added(column, words):
    model = world()
    with pytest.raises(SwarmError) as caught:
        model.add_part(Lined(column))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "lined" not in model.parts
    assert model.parts.get("lined") is None


class Nameless(Part):
    name = 5


@pytest.mark.parametrize("wrong", [None, 5, Bell, object(), Nameless(), Bell("two words"), Bell("robots")])
def test_what_is_no_part_is_refused_in_one_line(wrong):
    model = world()
    with pytest.raises(InvalidValueError, match=r"^(part is |the model has a part)") as caught:
        model.add_part(wrong)
    assert "\n" not in str(caught.value)
    assert len(model.parts) == 10


def test_a_part_that_every_model_has_cannot_be_removed_and_an_unknown_one_is_named():
    model = world()
    with pytest.raises(InvalidValueError, match=r"^part robots is one that every model has"):
        model.remove_part("robots")
    with pytest.raises(UnknownNameError, match="did you mean 'robots'"):
        model.parts["robot"]
    with pytest.raises(InvalidValueError, match=r"^parts is 5"):
        model.parts = 5


def test_the_plan_names_what_makes_python_due():
    @behaviour
    def listed(me):
        return PASS if [me.radius, "text"] else (0.0, 0.0)

    class Own(SwarmModel):
        def step(self):
            super().step()

    model = Own(rng=1, collect_every=5)
    model.add_robots(AGENT9, 2)
    model.control = Subsumption(listed, Explore())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.run(1)
    lines = str(model.plan).splitlines()
    assert any("layers decide" in line and "Python: listed" in line for line in lines)
    assert lines[-2].startswith("besides: Own.step, a method in Python; declare stops")
    assert lines[-1] == "one step at a time: what is Python is due in each"


def test_an_attribute_of_a_model_that_is_called_plan_hides_the_plan():
    class Earlier(SwarmModel):
        def __init__(self, *, rng=None):
            super().__init__(rng=rng)
            self.plan = ["first", "second"]

    assert Earlier(rng=1).run(2).plan == ["first", "second"]


def test_three_classes_of_the_package_make_a_model():
    ours = [kind.__name__ for kind in SwarmModel.__mro__ if kind.__module__.startswith("mesa_swarm.")]
    assert ours == ["SwarmModel", "EngineModel", "MesaModel"]
