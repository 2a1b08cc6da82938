"""The model of robots that teach themselves: what it takes for yes and no, and where it finds what learns."""

import numpy as np
import pytest

from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.control import Avoid, Subsumption
from mesa_swarm.dashboard.page.controls import control_values
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.model.parameters import parameters_of
from mesa_swarm.models.q_learning import QLearning
from mesa_swarm.recording.provenance import provenance_of, rebuild_model


@pytest.mark.parametrize(("answer", "meant"), [("yes", True), ("no", False), (True, True), (np.False_, False)])
def test_yes_and_true_switch_on_and_no_and_false_switch_off(answer, meant):
    learner = QLearning(n_robots=2, rng=1, shared=answer, self_adjusting=answer).learner
    assert (learner.shared, learner.self_adjusting) == (meant, meant)


@pytest.mark.parametrize("wrong", ["maybe", 1, "True", None])
@pytest.mark.parametrize(("name", "known"), [("shared", "no, yes"), ("self_adjusting", "no, yes, with gamma")])
def test_what_is_neither_is_refused_by_name(name, known, wrong):
    with pytest.raises(SwarmError, match=rf"^unknown {name} .*known: {known}$"):
        QLearning(n_robots=2, rng=1, **{name: wrong})


def test_robots_may_adapt_gamma_too_to_how_often_they_collide():
    learner = QLearning(n_robots=2, rng=1, self_adjusting="with gamma").learner
    assert (learner.self_adjusting, learner.gamma, learner.alert_gamma) == (True, 0.7, 0.9)
    assert QLearning(n_robots=2, rng=1, self_adjusting="yes").learner.alert_gamma is None


def test_a_reflex_above_the_learner_is_driven_by_and_the_model_goes_on_measuring_what_is_learned():
    model = QLearning(n_robots=3, rng=1).run(50)
    steps = model.learner.policy().steps
    model.control = Subsumption(Avoid(distance=3), model.learner)
    assert model.learner.policy().steps == steps
    model.run(20)
    assert model.control.layers[1] is model.learner
    assert model.learner.policy().steps > steps
    assert len(model.datacollector.model_vars["temperature"]) >= 70


def test_a_model_without_a_learner_names_its_drivers():
    model = QLearning(n_robots=3, rng=1)
    model.control = Subsumption(Avoid(distance=3))
    with pytest.raises(InvalidValueError, match=r"^the model is driven by \(Avoid\(.*; expected a layer that learns"):
        _ = model.learner


def test_a_recording_of_before_the_state_was_rewarded_is_run_again_with_the_next_state():
    provenance = provenance_of(QLearning(n_robots=2, critical=0.4, actions=4, rng=1), rerun=True)
    assert rebuild_model(provenance, QLearning).learner.reward_of == "state"
    del provenance["parameters"]["reward_of"]
    older = rebuild_model(provenance, QLearning)
    assert (older.learner.reward_of, older.learner.critical, older.learner.actions) == ("next state", 0.4, 4)


@pytest.mark.parametrize(
    "given",
    [{"eta": 0.3}, {"eta": 0}, {"encoding": "typed"}, {"self_adjusting": "yes"}, {"self_adjusting": "with gamma"}],
    ids=str,
)
def test_a_table_refuses_settings_of_networks_instead_of_ignoring_them(given):
    QLearning(n_robots=2, rng=1, **given)
    ((name, value),) = given.items()
    with pytest.raises(InvalidValueError, match=rf"^{name} is {value!r}, .*memory 'table'; expected .*'networks'$"):
        QLearning(n_robots=2, rng=1, memory="table", **given)


@pytest.mark.parametrize("off", ["no", False, np.False_])
def test_a_table_takes_the_defaults_of_settings_of_networks(off):
    given = {"eta": 0.1, "encoding": "distance", "self_adjusting": off}
    plain, same = (QLearning(n_robots=2, rng=1, memory="table", **one).run(5) for one in ({}, given))
    assert plain.state_hash() == same.state_hash()


def test_the_page_shows_beside_the_control_that_a_table_has_no_eta_and_goes_on():
    session = Session("q_learning", {"n_robots": 2, "eta": 0.3})
    session.set_parameter("memory", "table")
    assert control_values(session)["memory"]["fault"].startswith("eta is 0.3")
    assert (session.error, session.settings["memory"]) == ("", "networks")
    session.set_parameter("eta", 0.1)
    session.set_parameter("memory", "table")
    assert {value["fault"] for value in control_values(session).values()} == {""}
    assert (session.error, session.model.given[1]["memory"]) == ("", "table")


def test_the_slider_of_critical_reaches_the_thesis_s_number_in_map_units():
    slider = parameters_of(QLearning)["critical"].control
    assert ((0.008 - slider.minimum) / slider.step) == pytest.approx(round((0.008 - slider.minimum) / slider.step))
    assert (slider.minimum, slider.maximum) == (0.005, 1)
