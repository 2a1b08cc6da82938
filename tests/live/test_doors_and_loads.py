"""Worlds on pages in which robots push loads about doors: nothing in a step of theirs asks for Python."""

import math

import pytest

from mesa_swarm.live.live_page import LivePage
from support.doors import with_a_long_load, with_swinging_doors
from support.live_pages import ask_node, hashes_in_python
from support.tables import farthest_from

pytestmark = pytest.mark.slow
# When the long load is in one corner of its world, and when it is turned in another.
LEAVES, ARRIVES = 1640, 2400


def hashes_on_page(model, steps, folder):
    """Return what a page of this model, which begins as this is now, has in place of `hashes_in_python`."""
    each = "{ model.step(step - model.steps); return [model.steps, model.hash()]; }"
    return ask_node(LivePage(model, ()), f"return {list(steps)}.map((step) => {each});", folder)


def test_doors_that_loads_stop_have_the_fingerprints_of_python_on_a_page(tmp_path):
    steps, blocked = (*range(301), 600, 3000), 0
    model = with_swinging_doors(1)
    found = hashes_on_page(model, steps, tmp_path)
    for step, expected in zip(steps, found, strict=True):
        model.run(step - model.steps)
        blocked += int(model.movers.blocked.any())
        assert [step, model.state_hash()] == expected
    assert 100 < blocked < 250


def test_a_long_load_may_turn_from_corner_to_corner_of_a_page(tmp_path):
    """Tables of a page are made once: they are never worn."""
    model = with_a_long_load(1).run(LEAVES)
    (load,), bounds = model.loads, model.map.bounds
    begin, steps = load.pose, (LEAVES, LEAVES + 400, ARRIVES, ARRIVES + 1, 5000)
    found = hashes_on_page(model, steps, tmp_path)
    assert found[:3] == hashes_in_python(model, steps[:3])
    # As far as its points may have gone, they would be beyond the map.
    assert farthest_from(load, begin) > math.hypot(bounds[2], bounds[3])
    assert found[3:] == hashes_in_python(model, steps[3:])
