"""Parameters: what may be typed or given for a map that a model declares as a choice."""

import pytest

from mesa_swarm.base.errors import InvalidValueError, SwarmError, UnknownNameError
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.parameters import parameters_of

READERS = pytest.mark.parametrize("read", ["parse", "checked"])


@READERS
@pytest.mark.parametrize(
    ("model", "name"),
    [("collision_avoidance", "openspace_FIRE"), ("agglomeration", "openspace_fire"), ("fire_fighting", "Original")],
)
def test_a_known_map_that_a_model_does_not_offer_is_not_called_unknown(read, model, name):
    parameter = parameters_of(find_model(model))["map"]
    with pytest.raises(InvalidValueError) as caught:
        getattr(parameter, read)(name)
    assert str(caught.value).startswith(f"map is {name!r}, which this model does not offer; expected ")
    assert all(option in str(caught.value) for option in parameter.control.options)
    assert len(str(caught.value)) <= 300


@READERS
def test_a_map_that_does_not_exist_is_unknown(read):
    with pytest.raises(UnknownNameError, match=r"^unknown map 'orignal'; did you mean 'original'\?"):
        getattr(parameters_of(find_model("boids"))["map"], read)("orignal")


@READERS
@pytest.mark.parametrize("text", ["openspace", "sparse", "original"])
def test_a_map_that_a_model_offers_is_taken(read, text):
    assert getattr(parameters_of(find_model("boids"))["map"], read)(text) == text


@READERS
def test_another_choice_is_unknown_even_if_a_map_has_its_name(read):
    with pytest.raises(SwarmError, match=r"^unknown reward 'original'"):
        getattr(parameters_of(find_model("q_learning"))["reward"], read)("original")
