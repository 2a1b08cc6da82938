"""Loads as Mesa agents: what one may ask of them, where they may be put, how they come and go."""

import copy
import math
import pickle

import numpy as np
import pytest
from shapely import Point

from mesa_swarm import AGENT9, disc, rectangle
from mesa_swarm.base.errors import InvalidValueError, RemovedRobotError
from mesa_swarm.control import Avoid, Explore, Subsumption
from mesa_swarm.models.cooperative_transport import CooperativeTransport
from mesa_swarm.world.bodies import Load
from support.scenes import ahead, blind, empty

BOX = rectangle((200, 100), (240, 200))


def pushed(steps=10, n=3, **options):
    """Return a model in which robots have pushed a box for some steps, and the box."""
    model = empty(**options)
    load = model.add_load(BOX, resistance=0.5)
    model.add_robots(blind(), poses=[(195, 150 + 12 * k, 0.0) for k in range(n)])
    model.control = Subsumption(ahead)
    return model.run(steps), load


def test_a_load_is_an_obstacle_and_a_mesa_agent_that_is_where_it_was_put():
    model = empty()
    wall, load = model.add_obstacle(disc((50, 50), 10)), model.add_load(BOX, resistance=2)
    assert list(model.loads) == [load]
    assert list(model.obstacles) == [wall, load]
    assert isinstance(load, Load)
    assert load.shape == BOX
    assert load.position.tolist() == load.pos.tolist() == [220.0, 150.0]
    assert (load.heading, load.resistance, load.moved, load.pushers, load.contact) == (0.0, 2.0, False, 0, True)


def test_shape_position_and_the_arena_follow_a_load_that_moves():
    model, load = pushed()
    assert load.shape is not BOX
    assert load.position[0] > 225
    assert load.shape.position == pytest.approx(load.position, rel=1e-12)
    row = model.space.active_agents.index(load)
    assert model.space.agent_positions[row].tolist() == load.position.tolist()
    assert load in model.space.get_agents_in_radius(load.position, 1.0)[0]


def test_a_shape_that_has_been_moved_and_turned_is_congruent_to_what_it_was():
    _, load = pushed(steps=60)
    assert abs(load.heading) > 0.1
    assert load.shape.geometry.area == pytest.approx(BOX.geometry.area, rel=1e-12)
    assert load.shape.geometry.length == pytest.approx(BOX.geometry.length, rel=1e-12)
    assert load.shape.kind == "polygon"


@pytest.mark.parametrize("resistance", [0, -1, math.nan, math.inf, "2", None])
def test_a_resistance_that_is_none_is_refused(resistance):
    model = empty()
    with pytest.raises(InvalidValueError, match="resistance"):
        model.add_load(BOX, resistance=resistance)
    load = model.add_load(BOX, resistance=1)
    with pytest.raises(InvalidValueError, match="resistance"):
        load.resistance = resistance
    assert load.resistance == 1.0


@pytest.mark.parametrize("shape", [disc((0, 0), 5), (3, 4), None], ids=["off the map", "a pair", "nothing"])
def test_what_is_no_shape_or_not_within_the_map_is_refused(shape):
    model = empty()
    with pytest.raises(InvalidValueError, match=r"load is .*; (expected disc|move it inside)"):
        model.add_load(shape, resistance=1)
    assert len(model.obstacles) == 0


def test_a_mark_on_the_ground_is_no_load():
    with pytest.raises(InvalidValueError, match="mark on the ground"):
        empty().add_load(disc((100, 100), 5, contact=False), resistance=1)


@pytest.mark.parametrize(
    "shape", [disc((239, 201), 3), rectangle((210, 110), (220, 120)), rectangle((0, 0), (400, 300))]
)
def test_a_load_that_overlaps_an_obstacle_a_load_or_a_fire_is_refused_and_so_is_what_overlaps_a_load(shape):
    model = empty()
    model.add_load(BOX, resistance=1)
    for add in (model.add_obstacle, lambda s: model.add_load(s, resistance=1)):
        with pytest.raises(InvalidValueError, match=r"overlaps .*load at \[220\.0, 150\.0\]; expected free space"):
            add(shape)
    with pytest.raises(InvalidValueError, match="fire overlaps a load"):
        model.add_fire((245, 150), radius=6)
    assert (len(model.obstacles), len(model.fires)) == (1, 0)


def test_a_load_is_refused_on_an_obstacle_and_on_a_fire_but_not_on_a_mark_or_flush_with_a_wall():
    model = empty()
    model.add_obstacle(rectangle((0, 0), (200, 300)))
    model.add_obstacle(disc((220, 150), 10, contact=False))
    model.add_fire((300, 150), radius=20)
    for shape, what in ((disc((205, 150), 10), "an obstacle"), (disc((325, 150), 10), "a fire")):
        with pytest.raises(InvalidValueError, match=f"load overlaps {what}"):
            model.add_load(shape, resistance=1)
    model.add_load(BOX, resistance=1)
    model.add_obstacle(disc((220, 150), 10, contact=False))
    assert len(model.loads) == 1


def test_robots_where_a_load_is_put_are_moved_out_of_it():
    model = empty()
    model.add_robots(blind(), poses=[(220, 150, 0.0), (205, 110, 0.0)])
    model.add_load(BOX, resistance=1)
    model.step()
    assert all(BOX.geometry.distance(robot) >= 5 - 1e-6 for robot in map(Point, model.swarm.position))


def test_random_robots_are_never_placed_on_a_load_where_it_lies_now():
    model, load = pushed(steps=60)
    robots = model.add_robots(blind(), 150)
    assert min(load.shape.geometry.distance(Point(robot.position)) for robot in robots) >= 5


def test_only_robots_move_a_load():
    _, load = pushed()
    with pytest.raises(InvalidValueError, match="only when robots push"):
        load.position = (100, 100)


def test_a_removed_load_is_gone_and_what_robots_met_keeps_its_index():
    model, load = pushed(steps=0)
    light = model.add_load(disc((300, 250), 10), resistance=9)
    model.add_robots(blind(), poses=[(285, 250, 0.0)])
    load.resistance = 9
    model.step()
    assert model.contacts.other.tolist() == [load.unique_id] * 3 + [light.unique_id]
    load.remove()
    assert list(model.loads) == list(model.obstacles) == [light]
    assert model.contacts.other.tolist() == [-1, -1, -1, light.unique_id]
    light.remove()
    assert len(model.loads) == 0
    assert model.contacts.other.tolist() == [-1] * 4
    with pytest.raises(RemovedRobotError):
        light.remove()
    before = model.swarm.position[0, 0]
    assert model.run(5).swarm.position[0, 0] == pytest.approx(before + 5)


def test_a_load_rests_once_all_robots_are_gone():
    model, load = pushed()
    assert (load.moved, load.pushers) == (True, 3)
    model.remove_robots(model.robots)
    model.step()
    assert (load.moved, load.pushers) == (False, 0)


def test_the_state_hash_depends_on_where_loads_are_and_which_way_they_point():
    model, load = pushed()
    before = model.state_hash()
    x, y, heading = load.pose
    for pose in ((x + 1e-9, y, heading), (x, y, heading + 1e-9)):
        load.move_to(pose)
        assert model.state_hash() != before
    load.move_to((x, y, heading))
    assert model.state_hash() == before


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["compiled", "shapely"])
@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda model: pickle.loads(pickle.dumps(model))])
def test_a_copied_model_with_loads_goes_on_as_the_model_does(duplicate, engine):
    model, load = pushed(engine=engine)
    model.add_load(disc((300, 150), 12), resistance=0.3)
    model.add_robots(AGENT9, 5)
    model.control = Subsumption(Avoid(loads="never", distance=3), Explore())
    model.run(3)
    twin = duplicate(model)
    steps = 60 if engine == "compiled" else 8
    model.run(steps)
    twin.run(steps)
    assert twin.state_hash() == model.state_hash()
    assert twin.loads[0] is not load
    assert twin.loads[0].pose == load.pose
    assert twin.parts.bodies.cache.scene.bodies is twin.parts.bodies.table
    assert (twin.parts.bodies.cache.scene.statics.edges == model.parts.bodies.cache.scene.statics.edges).all()


@pytest.mark.parametrize(("loads", "turns"), [("always", True), ("never", False)])
def test_robots_avoid_loads_or_do_not(loads, turns):
    model = empty()
    model.add_load(BOX, resistance=1)
    model.add_robots(AGENT9, poses=[(185, 150, 0.0)], tendency="left")
    model.control = Subsumption(Avoid(loads=loads), Explore())
    model.step()
    assert bool(model.swarm.layer[0] == 0) is turns


def test_robots_that_do_not_avoid_loads_avoid_walls_and_each_other():
    model = empty()
    model.add_load(BOX, resistance=1)
    model.add_robots(AGENT9, poses=[(15, 150, math.pi), (100, 100, 0.0), (120, 100, math.pi)])
    model.control = Subsumption(Avoid(loads="never"), Explore())
    model.step()
    assert model.swarm.layer.tolist() == [0, 0, 0]


# ---- moved by hand


def test_a_load_that_is_moved_by_hand_is_seen_where_it_is_and_robots_there_give_way():
    model = empty(400, 300)
    load = model.add_load(disc((300, 200), 10), resistance=1.0)
    (robot,) = model.add_robots(AGENT9, poses=[(100, 100, 0.0)])
    model.sense()
    load.move_to((125, 100, 0.0))
    model.sense()
    assert robot.distance[0] == pytest.approx(10.0)
    load.move_to((110, 100, 0.0))
    model.step()
    assert np.hypot(*(robot.position - load.position)) >= 15.0 - 1e-6


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        ((500, 100, 0.0), "is outside the arena"),
        ((395, 100, 0.0), "is not within map"),
        ((math.nan, 100, 0.0), "is outside the arena"),
        ((100, 100, math.inf), "heading is inf"),
        ((100, 100), "expected three numbers"),
        ("here", "expected three numbers"),
        ((200, 100, 0.0), "overlaps an obstacle or load"),
        ((250, 100, 0.0), "overlaps a fire"),
        ((300, 100, 0.0), "overlaps an obstacle or load"),
    ],
)
def test_a_load_is_moved_to_free_places_on_the_map_only(pose, reason):
    model = empty(400, 300)
    model.add_obstacle(disc((200, 100), 10))
    model.add_fire((250, 100), radius=10)
    model.add_load(disc((300, 100), 10), resistance=1.0)
    load = model.add_load(disc((100, 200), 10), resistance=1.0)
    with pytest.raises(InvalidValueError, match=reason):
        load.move_to(pose)
    assert load.pose == (100.0, 200.0, 0.0)


def test_a_load_may_be_moved_onto_its_own_former_place():
    load = empty(400, 300).add_load(disc((100, 200), 10), resistance=1.0)
    load.move_to((104, 200, 1.0))
    assert load.pose == (104.0, 200.0, 1.0)


def test_a_recording_of_a_load_that_was_moved_by_hand_is_resumed(tmp_path):
    model = CooperativeTransport(rng=2)
    with model.record(tmp_path / "run.arrow", checkpoint_every=3):
        model.run(5)
        x, y, _ = model.loads[0].pose
        model.loads[0].move_to((x, y + 30, 0.5))
        model.run(7)
    assert CooperativeTransport.verify(tmp_path / "run.arrow").same
    for step in (4, 5, 9):
        again = CooperativeTransport.resume(tmp_path / "run.arrow", step=step)
        if step == 9:
            assert again.run(3).state_hash() == model.state_hash()
