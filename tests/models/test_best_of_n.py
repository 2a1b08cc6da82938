"""Best of n: robots agree on one of two sites, by the voter rule or the majority rule."""

import numpy as np
import pytest

from mesa_swarm.base.errors import SwarmError
from mesa_swarm.models.best_of_n import NEST, BestOfN

STORED = {"agreed at": None, "share for the left site": 0.5}


def test_a_run_has_the_stored_numbers():
    assert BestOfN(rng=1, n_robots=10, advertising=50.0).run(1_000).results() == pytest.approx(STORED)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_robots_begin_with_the_opinions_that_they_are_given(share):
    assert BestOfN(rng=1, n_robots=10, first_share=share).run(1).for_left == share


def test_it_stops_when_all_robots_have_one_opinion():
    model = BestOfN(rng=1, n_robots=5, first_share=1.0).run(50)
    assert (model.agreed_at, model.steps, model.running) == (1, 1, False)
    assert model.results() == {"agreed at": 1, "share for the left site": 1.0}


def test_a_robot_alone_keeps_its_opinion():
    model = BestOfN(rng=1, n_robots=2, first_share=0.5, range=10.0).run(20)
    assert model.for_left == 0.5


def test_only_robots_in_the_nest_are_heard():
    model = BestOfN(rng=1, n_robots=30).run(300)
    sent = np.isfinite(model.swarm.columns["send.opinion"])
    x = model.swarm.position[sent, 0]
    assert sent.any()
    # A robot may have left the nest by the step that it took after sending.
    assert ((NEST[0] - 2.0 <= x) & (x <= NEST[1] + 2.0)).all()


@pytest.mark.parametrize("wrong", [{"quality": 2}, {"first_share": np.nan}, {"rule": "most"}, {"range": -1}])
def test_wrong_values_are_refused_in_one_line_that_names_them(wrong):
    with pytest.raises(SwarmError, match=next(iter(wrong))) as caught:
        BestOfN(rng=1, **wrong)
    assert "\n" not in str(caught.value)
