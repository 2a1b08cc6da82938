"""Driven bodies among robots: nothing ever overlaps, they stop where robots cannot yield, and both engines agree."""

import mesa
import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from mesa_swarm import AGENT9, Map, Radio, SwarmModel, disc, rectangle
from mesa_swarm.control import Explore, Subsumption
from support.driven_worlds import check_apart, driven_world, send, with_driven
from support.random_worlds import Commanded

seeds = st.integers(0, 2**32 - 1)
some = settings(max_examples=12, deadline=None)
SMALL = Map(name="small", bounds=(0.0, 0.0, 120.0, 80.0), obstacles=())


def room(engine="compiled", poses=(), commands=None):
    """Return a small room with robots that are commanded."""
    model = SwarmModel(map=SMALL, engine=engine, rng=1)
    if len(poses):
        model.add_robots(AGENT9, poses=poses)
    model.control = Commanded(np.zeros((len(poses), 2)) if commands is None else commands)
    return model


@pytest.mark.slow
@some
@given(seeds, st.integers(2, 40))
def test_robots_never_overlap_driven_bodies_wherever_these_are_sent(seed, robots):
    model = with_driven(*driven_world(seed, robots=robots))
    rng = np.random.default_rng(seed)
    for _ in range(12):
        send(model, rng)
        model.step()
        check_apart(model)


@settings(max_examples=5, deadline=None)
@given(seeds)
def test_neither_robots_nor_driven_bodies_overlap_loads(seed):
    model = with_driven(*driven_world(seed, robots=12, loads=4))
    rng = np.random.default_rng(seed)
    for _ in range(10):
        send(model, rng)
        model.step()
        check_apart(model)


@pytest.mark.slow
@settings(max_examples=8, deadline=None)
@given(seeds, st.integers(0, 3))
@example(0, 0)  # robots that a long way of a body pushes far
def test_both_engines_move_the_same_bodies_and_robots_to_the_same_places(seed, loads):
    world, shapes = driven_world(seed, robots=7, loads=loads)
    ours, oracle = (with_driven(world, shapes, engine) for engine in ("compiled", "shapely"))
    assume(np.abs(ours.swarm.position - oracle.swarm.position).max() < 1e-9)
    for k in range(3):
        for model in (ours, oracle):
            send(model, np.random.default_rng([seed % 1000, k]))
            model.step()
            model.sense()
        for name in ("position", "heading", "distance", "kind", "contact_kind", "contact_index"):
            assert ours.swarm.columns[name] == pytest.approx(oracle.swarm.columns[name], abs=1e-9)
        for one, other in zip(ours.movers.poses, oracle.movers.poses, strict=True):
            assert one == pytest.approx(other, abs=1e-9)
        assert ours.movers.blocked.tolist() == oracle.movers.blocked.tolist()


@pytest.mark.parametrize("engine", ["compiled", "shapely"])
def test_a_robot_is_pushed_out_of_the_way_of_a_door(engine):
    model = room(engine, [(50.0, 40.0, 0.0)])
    door = model.add_body(rectangle((30, 20), (40, 60)), kind="door")
    model.step()
    for _ in range(5):
        door.position += (4.0, 0.0)
        model.step()
    assert door.position.tolist() == [55.0, 40.0]
    assert model.swarm.position[0] == pytest.approx([65.0, 40.0])
    assert not door.blocked
    assert model.kinds[model.swarm.contact_kind[0]] == "door"
    assert model.contacts.other.tolist() == [door.unique_id]


@pytest.mark.parametrize("engine", ["compiled", "shapely"])
def test_a_door_stops_where_a_robot_has_no_room_to_yield_and_moves_on_when_it_is_sent_back(engine):
    model = room(engine, [(110.0, 40.0, 0.0)])
    door = model.add_body(rectangle((90, 0), (100, 80)), kind="door")
    model.step()
    door.position = (110.0, 40.0)
    model.step()
    assert door.blocked
    assert 105.0 >= door.position[0] > 102.9
    assert model.swarm.position[0, 0] <= 115.0
    door.position = (90.0, 40.0)
    model.step()
    assert not door.blocked
    assert door.position.tolist() == [90.0, 40.0]


def test_a_request_that_was_stopped_is_forgotten():
    model = room(poses=[(113.0, 40.0, 0.0)])
    door = model.add_body(rectangle((90, 0), (100, 80)), kind="door")
    door.position = (101.0, 40.0)
    model.step()
    door.position = (110.0, 40.0)
    model.step()
    place = door.position
    model.remove_robots(model.robots)
    assert (model.run(2).movers.position[0] == place).all()


@pytest.mark.parametrize("engine", ["compiled", "shapely"])
def test_a_body_that_is_sent_far_away_jumps_and_stays_where_it_is_if_a_robot_is_there(engine):
    model = SwarmModel(engine=engine, rng=1)
    model.add_robots(AGENT9, poses=[(700, 500, 0.0), (400, 300, 0.0)])
    far, taken = (model.add_body(rectangle((x, 20), (x + 60, 80)), kind="box") for x in (20, 120))
    model.step()
    far.position, taken.position = (600, 300), (695, 510)
    model.step()
    assert (far.blocked, taken.blocked) == (False, True)
    assert far.position.tolist() == [600, 300]
    assert taken.position.tolist() == [150, 50]
    assert model.swarm.position.tolist() == [[700, 500], [400, 300]]


def test_a_load_stops_a_driven_body():
    model = room()
    load = model.add_load(disc((60, 40), 8), resistance=1.0)
    body = model.add_body(disc((30, 40), 5), kind="ram")
    model.step()
    body.position = (70, 40)
    model.step()
    assert body.blocked
    assert body.position.tolist() == [30, 40]
    assert load.position.tolist() == [60, 40]


def test_robots_do_not_push_a_load_into_a_driven_body():
    model = room(poses=[(30.0, 40.0, 0.0)], commands=np.ones((1, 2)))
    load = model.add_load(rectangle((36, 35), (46, 45)), resistance=0.5)
    model.add_body(rectangle((50, 20), (55, 60)), kind="door")
    model.run(30)
    assert load.position[0] == pytest.approx(45.0, abs=0.02)
    check_apart(model)


def test_a_turning_door_sweeps_robots_along():
    model = room(poses=[(85.0, 50.0, 0.0), (96.0, 50.0, 0.0)])
    door = model.add_body(rectangle((60, 39), (100, 41)), kind="door")
    model.step()
    for _ in range(20):
        door.heading += 0.05
        model.step()
        check_apart(model)
    assert door.heading == pytest.approx(1.0)
    assert (model.swarm.position[:, 1] > 50).all()


def test_driven_bodies_move_without_robots():
    model = room()
    body = model.add_body(disc((30, 40), 5), kind="ball")
    model.step()
    body.move_to((35, 41, 9.0))
    model.step()
    assert body.pose == pytest.approx((35, 41, 9.0 - 2 * np.pi))


def test_a_driven_body_stops_broadcasts_where_obstacles_do():
    heard = []
    for occlusion in (True, False):
        model = room(poses=[(30.0, 40.0, 0.0), (90.0, 40.0, 0.0)])
        model.communication = Radio(range=200, state=True, occlusion=occlusion)
        door = model.add_body(rectangle((55, 60), (60, 79)), kind="door")
        for y in (70.0, 45.0):
            door.position = (57.5, y)
            model.step()
            model.swarm.columns["task"][:] = 1
            model.parts.radio.exchange()
            heard.append(int(model.swarm.columns["heard_task"][0]))
    assert heard == [1, -1, 1, 1]


def test_robots_that_are_placed_on_a_driven_body_move_away_and_free_places_avoid_it():
    model = room(poses=[(60.0, 40.0, 0.0)])
    model.add_body(rectangle((20, 10), (100, 70)), kind="block")
    model.add_robots(AGENT9, 10)
    model.control = Commanded(np.zeros((11, 2)))
    x, y = model.swarm.position[1:].T
    assert ((x < 20) | (x > 100) | (y < 10) | (y > 70)).all()
    model.step()
    check_apart(model)


def lines_of(model, what):
    return [line for line in str(model.plan).splitlines() if what in line]


def test_stages_of_bodies_are_kernels_and_agents_are_asked_only_where_bodies_follow_some():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 3)
    assert not lines_of(model, "bodies follow")
    door = model.add_body(disc((100, 100), 5), kind="door")
    model.attach(model.robots[0], door)
    for what in ("driven bodies begin", "bodies rest"):
        assert "Python" not in lines_of(model, what)[0]
    model.add_body(disc((300, 100), 5), agent=mesa.Agent(model))
    assert "Python: agents" in lines_of(model, "bodies follow")[0]


def test_a_carried_body_is_where_its_robot_is_after_each_step_whatever_robots_are_removed():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 6)
    model.control = Subsumption(Explore())
    puck, robot = model.add_body(disc((100, 100), 2), kind="puck"), model.robots[4]
    model.run(2).attach(robot, puck)
    for _ in range(4):
        model.run(3)
        assert puck.pose == (*robot.position.tolist(), robot.heading)
        assert puck.table.aim[puck.row].tolist() == robot.position.tolist()
        model.robots[0].remove()
    assert robot.row == 0
