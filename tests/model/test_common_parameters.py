"""Noise, slip and imperfections: parameters that every model takes, declared or not."""

import inspect
from typing import Annotated

import mesa
import numpy as np
import pytest

from mesa_swarm import AGENT9, Radio, SwarmModel, batch_run
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.dashboard.page.controls import control_groups, group_of
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.experiments.reality_gap import reality_gap
from mesa_swarm.experiments.sweep import sweep
from mesa_swarm.model.common import ALSO, COMMON
from mesa_swarm.model.gallery import find_model, gallery_names
from mesa_swarm.model.imperfections_part import SLIP_MAGNITUDE
from mesa_swarm.model.parameters import Noise, Slider, parameters_of
from mesa_swarm.physics.shapely_engine import ShapelyEngine
from mesa_swarm.robots.imperfections import MEASURED

STEPS = 40
AT_ONCE = {"noise": 0.1, "slip": 0.1, "imperfections": 1.0}


class Plain(SwarmModel):
    """A model that does not know of the common parameters."""

    def __init__(self, n_robots=3, *, rng=None):
        super().__init__(map="original", rng=rng)
        self.add_robots(AGENT9, n_robots)
        self.control = Subsumption(Avoid(distance=15), Explore())


class Derived(Plain):
    """One that is derived from it, and passes on all that it is given."""

    def __init__(self, *, more=1, **others):
        super().__init__(**others)
        self.more = more


class Noisy(SwarmModel):
    """One with a default of its own."""

    def __init__(self, *, noise: Noise = 0.05, rng=None):
        super().__init__(rng=rng, noise=noise)


class Different(SwarmModel):
    """One whose `noise` means something else."""

    def __init__(self, *, noise: Annotated[str, "a colour"] = "pink", rng=None):
        super().__init__(rng=rng)
        self.colour = noise


def path_of(model, steps=STEPS):
    """Return the positions of the robots after each step."""
    return np.array([model.run(1).swarm.position.copy() for _ in range(steps)])


@pytest.mark.parametrize("name", gallery_names())
class TestEveryModelOfTheGallery:
    @pytest.mark.slow
    @pytest.mark.parametrize("parameter", [*COMMON, "all"])
    def test_runs_with_imperfect_robots_whose_paths_differ_from_those_of_ideal_ones(self, name, parameter):
        given = AT_ONCE if parameter == "all" else {parameter: AT_ONCE[parameter]}
        ideal, imperfect = path_of(find_model(name)(rng=1)), path_of(find_model(name)(rng=1, **given))
        assert not np.array_equal(ideal, imperfect)

    def test_has_a_slider_for_each_in_the_same_group(self, name):
        known = parameters_of(find_model(name))
        assert all(isinstance(known[each].control, Slider) and known[each].help for each in COMMON)
        assert {group_of(each) for each in COMMON} == {"Disturbances"}

    @pytest.mark.slow
    def test_is_as_it_was_where_all_are_0(self, name):
        plain, zero = (find_model(name)(rng=2, **given).run(10) for given in ({}, dict.fromkeys(COMMON, 0)))
        assert zero.imperfections is None
        assert plain.state_hash() == zero.state_hash()

    @pytest.mark.slow
    def test_takes_them_from_batch_run(self, name):
        run = getattr(mesa, "batch_run", batch_run)  # Mesa 4 has none
        seeds = {"rng": [1]} if "rng" in inspect.signature(run).parameters else {"iterations": 1}
        values = {"noise": [0, 0.1]}
        rows = run(find_model(name), values, max_steps=3, display_progress=False, **seeds)
        assert {row["noise"] for row in rows} == {0, 0.1}


def test_a_model_takes_them_without_a_line_and_stores_them_as_given():
    model = Plain(2, noise=0.2, slip=0.3, rng=1)
    assert model.given == ((2,), {"noise": 0.2, "slip": 0.3, "rng": 1})
    assert model.imperfections.sensing.error == 0.2
    assert (model.imperfections.slip_probability, model.imperfections.slip_magnitude) == (0.3, SLIP_MAGNITUDE)
    assert list(inspect.signature(Plain).parameters) == ["n_robots", "rng", *COMMON]


def test_a_model_takes_what_is_common_to_all_without_showing_it(tmp_path):
    named = {
        "engine": "shapely",
        "threads": 2,
        "collect_every": 5,
        "history_every": 0,
        "communication": Radio(range=50),
    }
    for model_class in (Plain, Derived):
        model = model_class(**named, rng=1)
        assert (model.threads, model.collect_every, model.fires.history.every) == (2, 5, 0)
        assert (model.communication, type(model.parts.robots.engine)) == (Radio(range=50), ShapelyEngine)
    assert not {*ALSO} & {*inspect.signature(Plain).parameters}
    assert {*ALSO} <= {*inspect.signature(SwarmModel).parameters}
    with (model := Plain(rng=1, collect_every=5, turn_angle_degrees=30.0)).record(tmp_path / "run.arrow"):
        model.run(12)
    again = Plain.resume(tmp_path / "run.arrow", step=7)
    assert (again.collect_every, again.run(5).state_hash()) == (5, model.state_hash())


def test_the_dial_alone_is_that_of_measured_robots():
    assert Plain(imperfections=1).imperfections == MEASURED
    assert Plain(imperfections=0.5).imperfections == MEASURED.at(0.5)


def test_a_derived_model_takes_them_too():
    model = Derived(more=2, n_robots=4, noise=0.2, rng=1)
    assert (model.more, len(model.swarm), model.imperfections.sensing.error) == (2, 4, 0.2)
    assert list(inspect.signature(Derived).parameters) == ["more", *COMMON, "others"]


def test_a_model_may_have_a_default_of_its_own_or_another_meaning():
    assert Noisy(rng=1).imperfections.sensing.error == 0.05
    assert Noisy(noise=0, rng=1).imperfections is None
    assert parameters_of(Noisy)["noise"].default == 0.05
    assert Different(noise="white").imperfections is None
    assert Different(slip=0.5).colour == "pink"
    assert Different(slip=0.5).imperfections.slip_probability == 0.5


def test_what_a_model_is_given_counts_more_than_what_its_class_passes_on():
    class Fixed(SwarmModel):
        def __init__(self, *, rng=None):
            super().__init__(rng=rng, noise=0.3)

    assert Fixed().imperfections.sensing.error == 0.3
    assert Fixed(noise=0.1).imperfections.sensing.error == 0.1


class Taught(SwarmModel):
    """A model with a default of its own and robots."""

    def __init__(self, *, n=5, noise: Noise = 0.3, rng=None):
        super().__init__(map="openspace", rng=rng, noise=noise)
        self.own_noise = noise
        self.add_robots(AGENT9, n)
        self.control = Subsumption(Avoid(), Explore())


class Child(Taught):
    """One that does not mention it."""

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)


class Grandchild(Child):
    """One that passes on all that it is given."""

    def __init__(self, **others):
        super().__init__(**others)


class Passing(SwarmModel):
    """One that lets the next class of a mixed one decide."""

    def __init__(self, **others):
        super().__init__(**others)


class Mixed(Passing, Taught):
    """One that inherits its constructor from one class and its noise from the other."""


class TestAModelDerivedFromOneWithADefaultOfItsOwn:
    derived = pytest.mark.parametrize("model_class", [Child, Grandchild, Mixed])

    @derived
    def test_declares_that_default_and_its_slider(self, model_class):
        known = parameters_of(model_class)["noise"]
        assert inspect.signature(model_class).parameters["noise"].default == known.default == 0.3
        assert isinstance(known.control, Slider)
        assert inspect.signature(model_class).parameters["slip"].default == 0.0
        assert model_class(rng=1).imperfections.sensing.error == 0.3

    @derived
    def test_has_the_same_bits_with_the_default_given_and_others_without_noise(self, model_class):
        plain, given, ideal = (model_class(rng=1, **one) for one in ({}, {"noise": 0.3}, {"noise": 0}))
        assert ideal.imperfections is None
        assert plain.run(20).state_hash() == given.run(20).state_hash() != ideal.run(20).state_hash()

    @pytest.mark.slow
    @derived
    @pytest.mark.parametrize("noise", [{}, {"noise": 0.1}], ids=str)
    def test_has_recordings_that_can_be_run_again(self, model_class, noise, tmp_path):
        with (model := model_class(rng=1, **noise)).record(tmp_path / "run.arrow", checkpoint_every=0):
            model.run(15)
        assert model_class.verify(tmp_path / "run.arrow").same

    @derived
    def test_passes_what_it_is_given_to_the_class_that_declares_it(self, model_class):
        assert model_class(noise=0.1).own_noise == 0.1

    def test_takes_another_meaning_as_that_class_does(self):
        class Coloured(Different):
            def __init__(self, *, rng=None):
                super().__init__(rng=rng)

        assert parameters_of(Coloured)["noise"].default == "pink"
        assert Coloured(noise="white").colour == "white"
        assert Coloured(noise="white", slip=0.5).imperfections.slip_probability == 0.5

    def test_replaces_what_is_passed_on_by_position(self):
        class Positional(SwarmModel):
            def __init__(self, noise=0.2, rng=None):
                super().__init__(rng=rng, noise=noise)

        class Second(Positional):
            def __init__(self, *, rng=None):
                super().__init__(0.4, rng)

        assert Second().imperfections.sensing.error == 0.4
        assert Second(noise=0.1).imperfections.sensing.error == 0.1

    def test_need_not_give_what_its_base_requires(self):
        class Requiring(SwarmModel):
            def __init__(self, *, noise, rng=None):
                super().__init__(rng=rng, noise=noise)

        class Giving(Requiring):
            def __init__(self, *, rng=None):
                super().__init__(noise=0.2, rng=rng)

        assert Giving(rng=1).imperfections.sensing.error == 0.2
        assert Giving(noise=0.1, rng=1).imperfections.sensing.error == 0.1


@pytest.mark.parametrize("name", COMMON)
@pytest.mark.parametrize("wrong", [-0.1, 1.1, np.nan, "much", None, [0.1]])
def test_anything_but_a_number_from_0_to_1_is_refused_in_one_line(name, wrong):
    with pytest.raises(InvalidValueError, match=rf"^{name} is ") as caught:
        Plain(**{name: wrong})
    assert "\n" not in str(caught.value)


def test_an_object_for_the_dial_is_refused_with_the_attribute_that_takes_it():
    for model_class in (SwarmModel, Plain, find_model("boids")):
        with pytest.raises(InvalidValueError, match=r"^imperfections is Imperfections\(") as caught:
            model_class(imperfections=MEASURED)
        assert "from 0, ideal robots, to 1, MEASURED" in str(caught.value)
        assert "model.imperfections = " in str(caught.value)
        assert len(str(caught.value)) <= 300
    model = SwarmModel(rng=1)
    model.imperfections = MEASURED
    assert model.imperfections == SwarmModel(imperfections=1, rng=1).imperfections


def test_a_slipping_wheel_rolls_at_half_its_speed_as_often_as_given():
    class Straight(SwarmModel):
        def __init__(self, *, rng=None):
            super().__init__(rng=rng)
            self.add_robots(AGENT9, 40)
            self.control = Subsumption(Explore())

    model, slips = Straight(slip=0.2, rng=3), []
    for _ in range(50):
        model.run(1)
        slips.append(model.swarm.slip[~model.swarm.collided])
    lost = np.concatenate(slips)
    assert set(np.round(np.unique(lost), 9)) == {0.0, SLIP_MAGNITUDE}
    assert (lost > 0).mean() == pytest.approx(0.2, abs=0.03)


def test_a_recorded_run_of_imperfect_robots_is_verified_resumed_and_changed(tmp_path):
    model = Plain(3, noise=0.1, slip=0.2, imperfections=0.5, rng=1)
    with model.record(tmp_path / "run.arrow", checkpoint_every=10):
        model.run(30)
    assert Plain.verify(tmp_path / "run.arrow").same
    assert Plain.resume(tmp_path / "run.arrow", step=12).run(18).state_hash() == model.state_hash()
    changed = Plain.resume(tmp_path / "run.arrow", step=12, noise=0.0, slip=0.0, imperfections=0.0)
    assert changed.imperfections is None


def test_a_sweep_varies_them(tmp_path):
    found = sweep("agglomeration", {"noise": [0.0, 0.5]}, seeds=1, steps=60, out=tmp_path, jobs=1)
    rows = found.frame()
    assert list(rows.noise) == [0.0, 0.5]
    assert len(set(rows["mean distance to the nearest robot"])) == 2


def test_the_dial_of_the_reality_gap_adds_to_noise_and_replaces_imperfections():
    noisy = reality_gap("agglomeration", dial=(0, 1), seeds=[1], steps=60, settings={"n_robots": 8, "noise": 0.5})
    plain = find_model("agglomeration")(n_robots=8, noise=0.5, rng=1).run(60)
    assert noisy.scores[0.0] == [plain.results()["groups"]]
    with pytest.raises(InvalidValueError, match=r"^imperfections is given as a setting"):
        reality_gap("agglomeration", settings={"imperfections": 0.5})


def test_the_page_has_a_slider_of_each():
    session = Session("agglomeration")
    fields = {field["name"]: field for group in control_groups(session) for field in group["fields"]}
    assert {fields[name]["kind"] for name in COMMON} == {"slider"}
