"""Runs that continue with other parameters: the same place, and the parameters of the new ones from there on."""

import numpy as np
import pytest

from mesa_swarm import SwarmModel
from mesa_swarm.errors import InvalidValueError, UnknownNameError
from mesa_swarm.gallery import find_model, gallery_names
from mesa_swarm.models.agglomeration import Agglomeration
from mesa_swarm.models.boids import Boids
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.models.q_learning import QLearning
from mesa_swarm.observers import Observer
from mesa_swarm.parameters import Choice, Slider, parameters_of
from mesa_swarm.recording import Recording, continued
from mesa_swarm.recording.continuing import continue_with, match_robots

# Parameters that matter only when a model is made.
OF_BEGINNING = {
    "best_of_n": {"first_share"},
    "collision_avoidance": {"obstacles", "moving_obstacles"},
    "fire_fighting": {"initial_temperature"},
    "foraging": {"thresholds", "items"},
    "learning_fires": {"first_temperature"},
    "puck_clustering": {"rows"},
    "q_learning": {"first_temperature"},
    "shepherding": {"n_sheep"},
    "task_allocation": {"major_share"},
}
EVERYWHERE = {"n_robots", "map"}


def another_value(parameter):
    """Return a value other than the default, None if there is none."""
    control = parameter.control
    if isinstance(control, Choice):
        return next((one for one in control.options if one != parameter.default), None)
    if isinstance(control, Slider):  # a quarter of the way to an end
        far = control.maximum if control.maximum > parameter.default else control.minimum
        return parameter.kind(parameter.default + (far - parameter.default) / 4) if parameter.kind is float else far
    return None


def changes_of(model_class):
    values = {name: another_value(one) for name, one in parameters_of(model_class).items()}
    values |= {"join": 5.0} if "join" in values else {}  # it has to be below `leave`
    return {name: value for name, value in values.items() if value is not None}


@pytest.mark.parametrize("name", gallery_names())
def test_every_parameter_of_the_gallery_changes_at_once_but_those_of_the_beginning(name):
    model_class, waiting = find_model(name), set()
    for parameter, value in changes_of(model_class).items():
        model = model_class(rng=3).run(20)
        position = model.swarm.position.copy()
        new, fresh = model_class(rng=3, **{parameter: value}), model_class(rng=3)
        try:
            continue_with(new, model, fresh, (parameter,))
        except InvalidValueError:
            waiting.add(parameter)
            continue
        assert new.completed == 20
        assert np.array_equal(new.swarm.position, position)
        new.run(5)
    assert waiting - EVERYWHERE == OF_BEGINNING.get(name, set())


@pytest.mark.parametrize("name", gallery_names())
def test_a_run_that_continues_with_the_same_parameters_is_the_same_to_the_last_bit(name):
    model_class = find_model(name)
    model = model_class(rng=2).run(30)
    new = model_class(rng=2)
    continue_with(new, model, model_class(rng=2), ())
    assert new.run(20).state_hash() == model_class(rng=2).run(50).state_hash()


@pytest.mark.parametrize(
    ("model", "there", "back"),
    [
        (Boids, {"noise": 0.4, "sight": 90.0}, {"noise": 0.0, "sight": 100.0}),
        (FireFighting, {"k1": 0.001, "strategy": "A"}, None),
        (QLearning, {"gamma": 0.1, "slip": 0.5}, None),
        (Agglomeration, {"avoid_distance": 25.0}, None),
    ],
    ids=["boids", "fires", "learning", "agglomeration"],
)
def test_a_change_that_is_taken_back_before_the_next_step_leaves_no_trace(model, there, back):
    defaults = {name: parameters_of(model)[name].default for name in there}
    changed = continued(continued(model(rng=5).run(25), **there), **(defaults if back is None else defaults | {}))
    assert changed.run(25).state_hash() == model(rng=5).run(50).state_hash()


def test_a_change_has_an_effect_from_the_next_step_on():
    model = Boids(rng=1).run(20)
    plain = Boids(rng=1).run(40).state_hash()
    assert model.continued(cohesion_weight=0.0).run(20).state_hash() != plain


def test_what_belongs_to_the_beginning_is_refused_and_the_run_goes_on():
    model = FireFighting(rng=1).run(10)
    with pytest.raises(InvalidValueError, match="'initial_temperature' belongs to the beginning of a run"):
        model.continued(initial_temperature=0.5)
    assert model.run(10).state_hash() == FireFighting(rng=1).run(20).state_hash()


def test_a_parameter_that_there_is_not_is_named():
    with pytest.raises(UnknownNameError, match="did you mean 'noise'"):
        Boids(rng=1).continued(noize=0.1)


class Stock(SwarmModel):
    """A model with an attribute that the run uses up."""

    def __init__(self, *, stock: int = 10, price: float = 1.0, rng=None) -> None:
        super().__init__(rng=rng)
        self.stock, self.price = stock, price

    def step(self) -> None:
        super().step()
        self.stock -= 1


def test_an_attribute_that_the_run_has_changed_does_not_follow_its_parameter_silently():
    model = Stock(rng=1).run(3)
    with pytest.raises(InvalidValueError, match="belongs to the beginning"):
        model.continued(stock=50)
    assert model.continued(price=2.0).price == 2.0


class Heard(Observer):
    def __init__(self):
        self.steps, self.what = [], []

    def after_step(self, model, step):
        self.steps.append(step)

    def replaced(self, old, new, what):
        self.what += what


def test_observers_continue_with_the_model_that_takes_the_place_of_another():
    heard, model = Heard(), Boids(rng=1)
    model.observers.append(heard)
    new = model.run(2).continued(noise=0.1, slip=0.1)
    new.run(2)
    assert (heard.steps, heard.what) == ([1, 2, 3, 4], ["parameter noise", "parameter slip"])
    assert list(model.observers) == []


def test_a_recording_notes_the_change_and_can_be_verified_and_resumed(tmp_path):
    model = FireFighting(rng=4)
    with model.record(tmp_path / "run.arrow"):
        model.run(30)
        new = model.continued(k1=0.001, noise=0.2)
        match_robots(new, FireFighting(n_robots=13, rng=4))
        new.run(30)
    recording = Recording(tmp_path / "run.arrow")
    assert [one.step for one in recording.interventions] == [30]
    assert "parameter k1" in str(recording.interventions[0])
    assert len(recording) == 60
    assert FireFighting.verify(recording.path).same
    assert FireFighting.resume(recording.path, step=45).run(15).state_hash() == new.state_hash()


@pytest.mark.parametrize("wanted", [1, 20, 37])
def test_robots_are_added_at_free_places_or_the_last_ones_are_removed(wanted):
    model = Boids(n_robots=20, rng=1).run(5)
    first = [robot.unique_id for robot in model.robots][: min(wanted, 20)]
    match_robots(model, Boids(n_robots=wanted, rng=1))
    assert len(model.robots) == wanted
    assert [robot.unique_id for robot in model.robots][: len(first)] == first
    gaps = np.hypot(*(model.swarm.position[:, None] - model.swarm.position[None]).T)
    np.fill_diagonal(gaps, np.inf)
    assert (gaps > 2 * model.swarm.radius[0] - 1e-6).all()
    model.run(5)
