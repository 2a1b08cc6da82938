"""What the model keeps of loads: tables that follow them, what sensors see of them, the same bits again."""

import math

import pytest

from mesa_swarm import AGENT9, ProximitySensor, RobotDesign, disc, rectangle
from mesa_swarm.control import Subsumption
from mesa_swarm.world.statics import LOAD, Statics
from support.pushing import BOX, ENGINES, abreast, world
from support.scenes import blind, circle, empty


def test_tables_that_follow_a_load_are_those_that_are_made_anew():
    model, load = world(poses=[(195, 130, 0.0)])
    model.add_load(disc((100, 50), 10), resistance=0.1)
    model.add_robots(blind(), poses=[(85, 50, 0.2)])
    scene = model.parts.bodies.scene()
    model.run(8)
    assert load.heading > 0.01
    assert model.parts.bodies.scene() is scene
    bodies = [load.form.body_at(load.pose) for load in model.loads]
    fresh = Statics.of(model.map.bounds, bodies, [LOAD, LOAD], sight=0, touch=5, loads=[0, 1])
    for name in ("edges", "discs", "owner", "kind", "body", "rings"):
        assert (getattr(scene.statics, name) == getattr(fresh, name)).all()


def test_the_tables_are_made_anew_only_when_a_load_has_moved_by_several_radii():
    model, _ = world(poses=abreast(3))
    scenes = set()
    for _ in range(100):
        model.step()
        scenes.add(id(model.parts.bodies.cache.scene))
        model.scenes = [
            *getattr(model, "scenes", []),
            model.parts.bodies.cache.scene,
        ]  # kept, so that no id is used twice
    assert 3 <= len(scenes) <= 7


@pytest.mark.parametrize("engine", ENGINES)
def test_sensors_see_a_load_as_such_where_it_lies_now(engine):
    model, load = world(poses=abreast(3), engine=engine)
    (watcher,) = model.add_robots(AGENT9, poses=[(300, 150, math.pi)])
    watcher.max_speed = 0.0
    model.sense()
    assert watcher.distance[0] == -1.0
    model.run(20)
    model.sense()
    assert (watcher.kind[0], watcher.distance[0]) == (LOAD, pytest.approx(295 - 260))
    load.remove()
    model.sense()
    assert watcher.kind[0] != LOAD


@pytest.mark.parametrize("engine", ENGINES)
def test_a_sensor_inside_a_load_reads_zero_and_a_wall_in_the_same_place_first(engine):
    feeler = RobotDesign(sensors=(ProximitySensor(mount=(9.0, 0.0), field_of_view_degrees=20),))
    model = empty(engine=engine)
    model.add_load(BOX, resistance=1)
    model.add_load(rectangle((380, 100), (400, 200)), resistance=1)
    model.add_robots(feeler, poses=[(194, 150, 0.0), (374, 150, 0.0), (6, 150, math.pi)])
    model.sense()
    assert model.swarm.distance[:, 0].tolist() == [0.0, 0.0, 0.0]
    assert model.swarm.kind[:, 0].tolist() == [LOAD, LOAD, 0]


def test_robots_that_circle_around_loads_leave_them_in_their_own_way():
    hashes = []
    for _ in range(2):
        model, load = world(disc((200, 150), 25), 0.4)
        model.add_robots(AGENT9, 20)
        model.control = Subsumption(circle(left=0.8))
        hashes.append(model.run(100).state_hash())
        assert load.position[0] > 205
    assert hashes[0] == hashes[1]
