"""The model of robots that teach themselves: what it takes for yes and no, and where it finds what learns."""

import numpy as np
import pytest

from mesa_swarm.errors import SwarmError
from mesa_swarm.models.q_learning import QLearning


@pytest.mark.parametrize(("answer", "meant"), [("yes", True), ("no", False), (True, True), (np.False_, False)])
def test_yes_and_true_switch_on_and_no_and_false_switch_off(answer, meant):
    learner = QLearning(n_robots=2, rng=1, shared=answer, self_adjusting=answer).learner
    assert (learner.shared, learner.self_adjusting) == (meant, meant)


@pytest.mark.parametrize("wrong", ["maybe", 1, "True", None])
@pytest.mark.parametrize("name", ["shared", "self_adjusting"])
def test_what_is_neither_is_refused_by_name(name, wrong):
    with pytest.raises(SwarmError, match=rf"^unknown {name} .*known: no, yes$"):
        QLearning(n_robots=2, rng=1, **{name: wrong})
