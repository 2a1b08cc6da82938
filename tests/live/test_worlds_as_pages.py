"""The twenty worlds whose bits are stored, as pages: each has the fingerprints of Python, or is refused by name.

Changes by hand are Python, which pages do not have: a page begins before them, or after them as the world stands then.
"""

import re

import pytest

from mesa_swarm import SwarmModel
from mesa_swarm.errors import ExportError
from mesa_swarm.live.live_page import LivePage
from support import bit_worlds
from support.bit_parts import kind_of, sum_of_positions
from support.bit_worlds import WORLDS
from support.live_pages import ask_node, hashes_in_python

# How many steps after its beginning a page is compared with Python.
STEPS = (0, 1, 50, 400)
STEPS_OF = {"a_crowd_of_two_thousand": (0, 1, 50, 200)}
# The cheapest one of the worlds that are equal: its module is that of a model of the gallery.
CHEAP = ("fires_by_strategy_a", 0)
# Of each world that is equal the steps after which a page begins: before all that is changed by hand, and after it.
# Robots of the world in which all comes and goes are on top of each other before its first step.
EQUAL = {
    "fires_by_strategy_a": (0,),
    "fires_by_strategy_b_with_errors": (0,),
    "a_team_of_three_arbiters": (0, 401),
    "learners": (0, 150),
    "discs_pushed_along_walls": (0,),
    "polygons_pushed_against_each_other": (0,),
    "loads_between_doors": (0, 501),
    "carriers_of_pucks": (0, 301),
    "trails_and_walls": (0, 301, 701),
    "talkers_by_radio": (0, 150),
    "imperfect_robots": (0,),
    "drives_at_the_measured_dial": (0, 150),
    "all_that_comes_and_goes": (1, 101, 201, 351, 501, 651, 801),
    "a_crowd_of_two_thousand": (0,),
}
IN_PYTHON = "takes place (processes) in Python: its step is a method or function"
# What refuses the others, and all that is named.
REFUSED = {
    "own_rules": ["layers decide (control) in Python: Weary", "Weary decides in Python"],
    "doors_and_bodies_that_wander": [f"Wander {IN_PYTHON}"],
    "bodies_that_follow_agents": ["bodies follow their agents (bodies) in Python: agents"],
    "own_sensors_and_actuators": [
        "robots read their sensors (robots) in Python: drift",
        "actuators do what they are set to (robots) in Python: spray, bell",
    ],
    "all_that_comes_and_goes": ["robots overlap at the start"],
    "events_states_and_processes": [f"{name} {IN_PYTHON}" for name in ("Spreading", "Tide", "Ledger")],
    "one_drawn_by_the_slow_engine": [
        "robots read their sensors (robots) in Python: the Shapely twin",
        "robots move, and contacts are resolved (robots) in Python: the Shapely twin",
    ],
}
CASES = [(name, begin) for name, begins in EQUAL.items() for begin in begins]


class Unplanned(SwarmModel):
    """What `Planned` is, without its step in Python: who runs it makes the changes."""

    def __init__(self, **named):
        super().__init__(
            **{"map": "openspace", **named},
            model_reporters={"x": sum_of_positions, "completed": "completed"},
            agent_reporters={"kind": kind_of, "id": "unique_id"},
        )
        self.plan, self.each = {}, ()


@pytest.fixture
def begun(monkeypatch):
    """Return a function that returns a world after some steps with the changes by hand that it has in them."""
    monkeypatch.setattr(bit_worlds, "Planned", Unplanned)

    def begin(name, steps):
        model = WORLDS[name]()
        changes, each = vars(model).pop("plan", {}), vars(model).pop("each", ())
        for _ in range(steps):
            for change in (*each, *changes.get(model.completed, ())):
                change(model)
            model.step()
        return model

    return begin


def hashes_of_page(page, steps, folder):
    """Return what a page has in place of `hashes_in_python`, from where it begins."""
    each = "{ model.step(step - model.steps); return [model.steps, model.hash()]; }"
    return ask_node(page, f"return {list(steps)}.map((step) => {each});", folder)


@pytest.mark.parametrize(
    ("name", "begin"), [pytest.param(*case, marks=[] if case == CHEAP else pytest.mark.slow) for case in CASES]
)
def test_a_world_on_a_page_has_the_fingerprints_of_python(name, begin, begun, tmp_path):
    model = begun(name, begin)
    page = LivePage(model, ())
    steps = [begin + step for step in STEPS_OF.get(name, STEPS)]
    assert hashes_of_page(page, steps, tmp_path) == hashes_in_python(model, steps)


@pytest.mark.parametrize("name", REFUSED)
def test_a_world_that_is_python_in_a_step_is_refused_by_what_it_is(name, begun):
    with pytest.raises(ExportError) as caught:
        LivePage(begun(name, 0), ())
    reasons = str(caught.value)
    assert "\n" not in reasons
    for reason in REFUSED[name]:
        assert reason in reasons
    # Nothing else refuses it.
    assert len(re.findall("in Python", reasons)) <= len(REFUSED[name])


def test_each_of_the_worlds_is_equal_or_refused():
    assert EQUAL.keys() | REFUSED.keys() == WORLDS.keys()
    # What is refused where it begins is equal later.
    assert {name for name in REFUSED if 0 in EQUAL.get(name, ())} == set()


@pytest.mark.slow
def test_to_read_the_fingerprint_after_every_step_changes_nothing(begun, tmp_path):
    """Held readings that imperfections disturb are disturbed once, as often as they are read."""
    model = begun("imperfect_robots", 0)
    steps = range(101)
    page = LivePage(model, ())
    assert hashes_of_page(page, steps, tmp_path) == hashes_in_python(model, steps)
