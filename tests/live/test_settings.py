"""What parameters change in images: which values are tried, and how many images that takes."""

import struct
from types import SimpleNamespace

import numpy as np
import pytest

from mesa_swarm.live.image import Functions
from mesa_swarm.live.live_page import LivePage, accepted_places
from mesa_swarm.live.settings import Change, Facts, Trials, are_apart, find_same_changes
from mesa_swarm.live.starts import BASE
from mesa_swarm.models.boids import Boids
from mesa_swarm.models.foraging import Foraging

PRESENT = {"gain": 0.5, "bias": 0.25}
PLACES = {"gain": 8, "bias": 24}
START = SimpleNamespace(image=SimpleNamespace(layout=[(BASE, 64)]))
VALUES = (0.125, 0.25, 0.5, 1.0)


class ToyTrials(Trials):
    """Images of 64 bytes, in which numbers are as they are, and what `also` makes of them is at the end."""

    def __init__(self, also=lambda gain, bias: 0.0):
        super().__init__(START, None, Functions())
        self.also, self.tried = also, []

    def _content_of(self, changes, functions):
        self.tried.append(changes)
        values, content = PRESENT | changes, bytearray(64)
        for name, place in PLACES.items():
            content[place : place + 8] = struct.pack("<d", values[name])
        content[48:56] = struct.pack("<d", self.also(**values))
        return np.frombuffer(bytes(content), np.uint8)


def known(**bytes_of_values):
    """Return what is known of the parameters: copies, or bytes of each value of those that are named."""
    changes = {name: Change({"f8": [place]}, [], {}) for name, place in PLACES.items()}
    for name in bytes_of_values:
        places = list(range(PLACES[name], PLACES[name] + 8))
        changes[name] = Change({}, places, {value: list(struct.pack("<d", value)) for value in VALUES})
    return {name: Facts(VALUES, PRESENT[name], change) for name, change in changes.items()}


def test_numbers_are_tried_together_in_another_start():
    trials, facts = ToyTrials(), known(gain=True)
    found = find_same_changes(facts, START, trials)
    assert found == {name: fact.change for name, fact in facts.items()}
    assert [*map(len, trials.tried)] == [0, 2, 2, 1]


def test_a_number_that_changes_more_in_another_start_is_tried_one_by_one_and_found():
    found = find_same_changes(known(), START, ToyTrials(also=lambda gain, bias: gain))
    assert found["gain"] == Change({"f8": [PLACES["gain"], 48]}, [], {})
    assert found["bias"] == known()["bias"].change


def test_an_image_is_not_made_again_for_the_same_values():
    trials = ToyTrials()
    first, again = (trials.content_with({"gain": 1.0}, Functions()) for _ in range(2))
    assert first is again
    assert trials.tried == [{"gain": 1.0}]


def test_functions_that_an_image_needs_are_known_whenever_it_is_asked_for():
    trials = ToyTrials()
    trials._content_of = lambda changes, functions: functions.place_of("new")
    for _ in range(2):
        functions = Functions()
        assert trials.content_with({"gain": 1.0}, functions) == 1
        assert functions.places == {"new": 1}


def test_a_start_of_which_the_least_value_has_another_form_is_none_and_the_functions_it_needs_are_known():
    trials = ToyTrials()
    made = trials._content_of

    def content_of(changes, functions):
        if changes.get("bias") == VALUES[0]:
            functions.place_of("new")
        return None if changes.get("bias") == VALUES[0] else made(changes, functions)

    trials._content_of = content_of
    assert find_same_changes(known(), START, trials) is None
    assert trials.functions.places == {"new": 1}


@pytest.mark.parametrize(("also", "apart"), [(lambda gain, bias: 0.0, True), (lambda gain, bias: gain > bias, False)])
def test_numbers_are_apart_if_all_at_their_ends_are_what_each_makes_alone(also, apart):
    assert are_apart(known(), ToyTrials(also)) == apart


@pytest.mark.parametrize("least", range(10))
def test_the_first_place_that_is_accepted_is_found(least):
    asked = []
    places = accepted_places([0, 4, 8], lambda place: asked.append(place) or place >= least)
    assert places == [*range(least, 9)]
    assert accepted_places([0, 4, 8], lambda place: place < least) == [*range(min(least, 9))]


def test_few_models_are_made_to_find_which_values_are_accepted(monkeypatch):
    class Bounded(Boids):
        def __init__(self, **parameters):
            asked.append(parameters["memory"])
            super().__init__(**parameters)

    asked = []
    page = LivePage.__new__(LivePage)
    page.model_class, page.given, page.seed = Bounded, {"n_robots": 3, "memory": 10.0}, 1
    values = [float(value) for value in range(-40, 61)]
    assert page._list_accepted("memory", values, 10.0) == values[41:]
    assert len(asked) < 12


@pytest.mark.slow
def test_what_a_process_begins_with_is_a_beginning_of_the_page_and_not_a_slider_of_the_run():
    page = LivePage(Foraging(n_robots=3, rng=1), ())
    assert "thresholds" not in page.changes
    assert ("thresholds", "no") in {(variant.name, variant.value) for variant in page.variants}
