"""Controls: groups, labels, sliders counted from the default, and constants designed from requirements."""

import pytest

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.dashboard.page.controls import (
    REQUIREMENTS,
    ControlPanel,
    Designer,
    Panel,
    control_groups,
    group_of,
    parameter_label,
    slider_ends,
    slider_position,
    value_at,
    value_text,
)
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.fire import design_constants
from mesa_swarm.model.parameters import Parameter, Slider

SHARE = Parameter("share", 0.75, float, Slider(0, 1, 0.1))


@pytest.fixture
def session():
    session = Session("fire_fighting")
    yield session
    session.close()


def test_positions_are_counted_from_the_default_and_stay_within_the_range():
    assert slider_ends(SHARE) == (-8, 3)
    assert [value_at(place, SHARE) for place in (-9, 0, 2, 9)] == [0.0, 0.75, 0.95, 1.0]
    assert [slider_position(value, SHARE) for value in (0.75, 0.95, 7.0)] == [0, 2, 3]


def test_a_parameter_without_a_slider_has_no_positions():
    with pytest.raises(InvalidValueError, match="strategy has no slider; choose or type its value"):
        slider_ends(Parameter("strategy", "A", str, None))


def test_groups_have_titles_in_order_and_labels_in_words(session):
    assert [group["title"] for group in control_groups(session)][:3] == ["World", "Robots", "Behaviour"]
    assert [group_of(name) for name in ("k1", "avoid_distance")] == ["Fires and heat", "Behaviour"]
    assert [parameter_label(name) for name in ("n_robots", "k1", "avoid_distance")] == [
        "robots",
        "k1",
        "avoid distance",
    ]


def test_values_are_shown_in_four_digits():
    assert [value_text(value) for value in (0.1 + 0.2, 7, "A")] == ["0.3", "7", "A"]


def test_a_requirement_sets_all_constants_to_their_design(session):
    designer = Designer(session)
    designer.require("growth_time", 1000)
    model = session.model
    largest = float(model.fires.area.max())
    start = session.settings["initial_temperature"]
    expected = design_constants(**designer.requirements, initial_temperature=start, area=largest, largest_area=largest)
    assert {name: session.settings[name] for name in ("k1", "k4", "join")} == {
        name: getattr(expected, name) for name in ("k1", "k4", "join")
    }
    assert round(session.settings["k1"], 6) == 0.000693


@pytest.mark.parametrize(("name", "place"), [("extinguish_time", 0), ("rest_time", 99), ("growth_time", 0)])
def test_remarks_call_requirements_as_their_sliders_are_called(session, name, place):
    designer = Designer(session)
    designer.place(name, place)
    remarks = " ".join(text for _, text in designer.notes())
    assert remarks
    assert not [requirement for requirement in REQUIREMENTS if "_" in requirement and requirement in remarks]


def test_a_constant_that_its_slider_does_not_reach_is_remarked_on_and_used(session):
    designer = Designer(session)
    designer.place("extinguish_time", 0)
    ends = session.parameters["k2"].control
    assert session.model.fire_constants.k2 > ends.maximum
    assert any(text.startswith("k2 is ") and f"ends at {ends.maximum:g}" in text for _, text in designer.notes())
    designer.require("extinguish_time", 1600)
    assert not any("beyond its slider" in text for _, text in designer.notes())


def test_each_position_of_a_requirement_is_the_one_that_its_value_has(session):
    panel = Panel(ControlPanel(), session)
    for name, one in REQUIREMENTS.items():
        assert one.place(one.least) == 0
        panel.act({"do": "place", "name": name, "value": 3})
        assert panel.designer.requirements[name] == pytest.approx(one.least + 3 * one.step)
        assert panel.widget.values[name]["place"] == 3
    panel.close()
