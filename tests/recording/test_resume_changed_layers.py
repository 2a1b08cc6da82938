"""Resuming with another parameter: which layer's memory goes to which layer."""

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, SwarmModel
from mesa_swarm.control import Avoid, Explore, Subsumption


class Tally:
    """A layer of a class of its own, which counts in an attribute and in a column."""

    name = "Tally"

    def __init__(self, pace):
        self.pace, self.count = pace, 0

    def bind(self, swarm, prefix, rng):
        self.marks = swarm.remember(f"{prefix}.marks", (), float, 0.0)

    def decide(self, senses, command, layer, index):
        self.count += self.pace
        self.marks += self.pace


class Groups(SwarmModel):
    """Two groups and a design with layers of the same names."""

    def __init__(self, *, distance=15.0, avoids=True, together=False, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, 2, group="scouts")
        self.add_robots(AGENT9, 2, group="workers")
        self.add_robots(AGENT3, 2)
        avoid = [Avoid(distance=distance)] if avoids else []
        team = {
            "scouts": Subsumption(*avoid, Tally(1), Tally(10), Explore()),
            "workers": Subsumption(*avoid, Tally(100), Explore()),
            AGENT3: Subsumption(Tally(1000)),
        }
        self.control = Subsumption(*avoid, Tally(1), Tally(10), Explore()) if together else team


def counts(model):
    return [layer.count for layer in model.control.layers if layer.name == "Tally"]


def marks(model):
    return [column.max() for name, column in model.swarm.columns.items() if name.endswith("Tally.marks")]


@pytest.fixture(scope="module", params=[False, True], ids=["groups", "together"])
def recorded(request, tmp_path_factory):
    path, model = tmp_path_factory.mktemp("groups") / "run.arrow", Groups(together=request.param, rng=1)
    with model.record(path):
        model.run(5)
    return path, model


@pytest.mark.parametrize("change", [{"distance": 20.0}, {"avoids": False}], ids=["parameter", "one layer less"])
def test_layers_of_several_groups_take_over_their_own_memory(recorded, change):
    path, model = recorded
    changed = Groups.resume(path, **change)
    assert counts(changed) == counts(model)
    assert marks(changed) == marks(model)
    assert counts(changed.run(1)) == [value * 6 // 5 for value in counts(model)]


def test_layers_are_matched_by_name_and_place_where_groups_are_given_up(recorded):
    path, model = recorded
    changed = Groups.resume(path, together=True)
    assert counts(changed) == counts(model)[:2] == [5, 50]
    np.testing.assert_array_equal(marks(changed), marks(model)[:2])
