"""Changes by hand: each does what it is called, can be written into a link, undone, and repeated to the last bit."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from mesa_swarm import SwarmModel, disc, polygon
from mesa_swarm.base.errors import InvalidValueError, SwarmError
from mesa_swarm.dashboard.page.edits import EDITS, MOST_EDITS, SET, Edit, apply_edit, as_text, edits_from, find_thing_at
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.run.editing import edited_map
from mesa_swarm.maps.map import Map
from mesa_swarm.models.boids import Boids
from mesa_swarm.models.fire_fighting import FireFighting

NUMBERS = st.floats(-1e9, 1e9, allow_nan=False).map(lambda number: number + 0.0)
EDIT = st.builds(Edit, st.integers(0, 10**6), st.sampled_from(sorted(EDITS)), st.lists(NUMBERS, max_size=5).map(tuple))


@given(st.lists(EDIT, max_size=20).map(lambda edits: sorted(edits, key=lambda edit: edit.step)))
def test_edits_in_a_link_are_read_back_exactly(edits):
    assert edits_from(as_text(edits)) == edits


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("5,dance,1", "edit"),
        ("x,move,1,2,3,4", "has no step"),
        ("-3,clear", "has no step"),
        ("5,move,1,2,three,4", "not a number"),
        ("5,disc", "edit"),
        ("5,obstacle,nan,2,3", "obstacle is nan"),
        ("9,clear;5,clear", "order of their steps"),
        (";".join(["1,clear"] * (MOST_EDITS + 1)), "at most 200"),
    ],
)
def test_a_damaged_link_is_refused_with_the_reason(text, why):
    with pytest.raises(SwarmError, match=why):
        edits_from(text)


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused_in_one_line(text):
    try:
        edits_from(text)
    except SwarmError as error:
        assert "\n" not in str(error)


@pytest.fixture
def model():
    return FireFighting(rng=1).run(10)


def test_what_is_at_a_place_is_a_robot_before_a_body_and_nothing_on_free_ground(model):
    robot = model.robots[3]
    assert find_thing_at(model, *robot.position) is robot
    assert find_thing_at(model, *model.fires[2].position) is model.fires[2]
    x, y = np.add(robot.position, (0, robot.radius + 3))
    assert find_thing_at(model, x, y, near=9.0) is robot
    open_model = SwarmModel(map="openspace", rng=1)
    assert find_thing_at(open_model, 400, 300) is None
    load = open_model.add_load(polygon([(380, 280), (420, 280), (400, 320)]), resistance=1.0)
    assert find_thing_at(open_model, 400, 290) is load


def test_a_robot_is_moved_to_free_ground_and_not_onto_anything(model):
    robot, other = model.robots[0], model.robots[1]
    apply_edit(model, "move", (robot.unique_id, 400, 60, 1.0))
    assert robot.position.tolist() == [400, 60]
    assert robot.heading == 1.0
    taken = {f"robot {other.unique_id}": other.position, "fire 1": model.fires[0].position, "border": (-9, 300)}
    for what, place in taken.items():
        with pytest.raises(InvalidValueError, match=f"it would overlap .*{what}"):
            apply_edit(model, "move", (robot.unique_id, *place, 0.0))
    assert robot.position.tolist() == [400, 60]


@pytest.mark.parametrize("mode", ["fixed", "pushed", "driven"])
def test_bodies_of_every_mode_are_moved(mode):
    model = Boids(n_robots=3, rng=1).run(2)
    shape = polygon([(300, 200), (340, 200), (320, 230)])
    resistance = {"resistance": 1.0} if mode == "pushed" else {}
    body = model.add_body(shape, mode=mode, **resistance)
    model.run(1)
    x, y = np.add(body.position, (20, 15))
    apply_edit(model, "move", (body.unique_id, x, y, 0.0))
    model.run(1)
    moved = [one for one in model.bodies if one.mode == mode][-1]
    assert moved.position == pytest.approx((x, y), abs=1e-6)


def test_a_fire_is_added_moved_put_out_lit_and_removed():
    model = Boids(n_robots=2, rng=1).run(3)
    apply_edit(model, "fire", (600, 500, 25))
    (fire,) = model.fires
    apply_edit(model, "switch", (fire.unique_id,))
    assert fire.out
    apply_edit(model, "switch", (fire.unique_id,))
    assert (fire.out, fire.temperature) == (False, 1.0)
    apply_edit(model, "move", (fire.unique_id, 500, 400, 0.0))
    (fire,) = model.fires
    assert (fire.position.tolist(), fire.radius) == ([500, 400], 25)
    apply_edit(model, "remove", (fire.unique_id,))
    assert len(model.fires) == 0
    model.run(3)


def test_walls_discs_and_bodies_are_where_they_were_drawn():
    model = Boids(n_robots=5, rng=1).run(2)
    before = len(model.obstacles)
    apply_edit(model, "wall", (100, 100, 300, 100, 10))
    apply_edit(model, "obstacle", (400, 400, 30))
    apply_edit(model, "load", (600, 500, 20))
    wall, round_one, load = model.obstacles[before:]
    assert wall.shape.bounds == pytest.approx((100, 95, 300, 105))
    assert round_one.shape == disc((400, 400), 30)
    assert load.mode == "pushed"
    with pytest.raises(InvalidValueError, match="shorter than wide"):
        apply_edit(model, "wall", (100, 100, 101, 100, 10))
    apply_edit(model, "clear", ())
    assert [one.mode for one in model.obstacles] == ["pushed"]
    model.run(5)


def test_a_new_robot_has_the_design_of_the_one_that_it_is_like():
    model = Boids(n_robots=4, rng=1).run(2)
    apply_edit(model, "robot", (60, 60, 0.5, model.robots[1].unique_id))
    assert len(model.robots) == 5
    assert model.robots[-1].design is model.robots[1].design
    apply_edit(model, "remove", (model.robots[0].unique_id,))
    assert len(model.run(3).robots) == 4


@pytest.mark.parametrize("edit", [("move", (1, 2)), ("remove", (10**6,)), ("switch", (float("nan"),)), ("dance", ())])
def test_wrong_edits_are_refused(model, edit):
    before = model.state_hash()
    with pytest.raises(SwarmError):
        apply_edit(model, *edit)
    assert model.state_hash() == before


def played(session, steps):
    for _ in range(steps):
        session.step()
    return session


def changed_session():
    session = played(Session("fire_fighting"), 12)
    session.set_parameter("noise", 0.3)
    session.set_parameter("n_robots", 14)
    session.edit("obstacle", 400, 300, 20)
    played(session, 5)
    session.edit("move", session.model.robots[0].unique_id, 300, 500, 0.5)
    session.edit("robot", 200, 500, 1, -1)
    session.edit("switch", session.model.fires[0].unique_id)
    return played(session, 5)


def test_a_link_with_its_edits_shows_the_same_run_and_its_settings():
    session = changed_session()
    again = Session("fire_fighting", steps=session.model.completed, edits=edits_from(as_text(session.edits)))
    assert again.model.state_hash() == session.model.state_hash()
    assert (again.settings["noise"], again.settings["n_robots"], again.waiting) == (0.3, 14, frozenset())
    assert again.straight


def test_a_changed_run_is_repeated_to_the_last_bit():
    session = changed_session()
    again = session.repetition()
    for _ in range(session.model.completed):
        again.step()
    again.finish()
    assert again.model.state_hash() == session.model.state_hash()


def test_undo_goes_back_to_the_state_before_each_change_also_in_time():
    session = played(Session("fire_fighting"), 12)
    at_first = session.model.state_hash()
    session.edit("obstacle", 400, 300, 20)
    at_second = played(session, 6).model.state_hash()
    session.edit("robot", 200, 500, 1, -1)
    session.undo()
    assert session.model.state_hash() == at_second
    assert [edit.do for edit in session.edits] == ["obstacle"]
    session.undo()
    assert (session.model.completed, session.past.last_step, len(session.series)) == (12, 12, 12)
    assert session.model.state_hash() == at_first
    assert session.undoable is None
    session.undo()
    assert played(session, 3).model.state_hash() == played(Session("fire_fighting"), 15).model.state_hash()


def test_a_robot_that_is_dragged_is_one_change():
    session = played(Session("boids", {"n_robots": 2}), 3)
    robot = session.model.robots[0].unique_id
    session.edit("move", robot, 60, 60, 0.0)
    for x in range(61, 90):
        session.edit("move", robot, x, 60, 0.0, in_place=True)
    assert session.edits == (Edit(3, "move", (robot, 89, 60, 0.0)),)
    session.undo()
    assert session.edits == ()


@pytest.mark.slow
def test_too_many_changes_for_a_link_are_stated_as_a_run_that_cannot_be_repeated():
    session = played(Session("boids", {"n_robots": 2}), 1)
    for k in range(MOST_EDITS + 1):
        assert session.straight
        session.step()
        session.set_parameter("noise", 0.1 + 0.001 * k)
    assert not session.straight


def test_a_change_in_a_link_that_does_not_fit_is_left_out_and_stated():
    session = Session("boids", steps=5, edits=[Edit(2, "remove", (10**6,)), Edit(3, SET, ("noise", "0.2"))])
    assert session.model.completed == 5
    assert "1e+06 is not a robot" in session.note
    assert session.settings["noise"] == 0.2
    assert not session.straight


def test_the_map_as_it_is_now_can_be_saved_and_read_back():
    model = FireFighting(rng=1).run(5)
    apply_edit(model, "wall", (100, 120, 300, 180, 12))
    apply_edit(model, "fire", (700, 80, 15))
    apply_edit(model, "switch", (model.fires[0].unique_id,))
    drawn = edited_map(model, "drawn")
    for again in (Map.from_toml(drawn.to_toml()), Map.from_svg(drawn.to_svg())):
        assert len(again.fires) == len(model.fires) - 1
        assert len(again.obstacles) == len(model.obstacles)
    assert np.allclose(drawn.obstacles[-1].bounds, Map.from_toml(drawn.to_toml()).obstacles[-1].bounds)


@pytest.mark.parametrize("file", ["/etc/passwd.toml", "hall.svg"])
def test_a_link_never_makes_the_page_read_a_file_as_a_map(file, monkeypatch):
    monkeypatch.setattr(Map, "load", classmethod(lambda cls, source: pytest.fail(f"{source} is read")))
    with pytest.raises(InvalidValueError, match="map cannot be changed during a run"):
        edits_from(f"3,set,noise,0.2;5,set,map,{file}")
