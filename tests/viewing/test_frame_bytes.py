from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import AGENT3, AGENT9, ProximitySensor, Radio, SwarmModel, disc, polygon
from mesa_swarm.control import Avoid, Explore, Respond, Subsumption
from mesa_swarm.models.cooperative_transport import CooperativeTransport
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.viewing.frame_bytes import PACKED_FROM, drawn_columns, packed_frame
from mesa_swarm.viewing.scene import OWN, Scene, scene_of, scene_of_recording
from support.unpacking import unpacked_frame


def seen(model):
    """Return the columns of a model as a browser gets them."""
    scene = scene_of(model)
    step, columns = unpacked_frame(packed_frame(frame_of(model, PACKED_FROM), scene), scene.world())
    assert step == model.completed
    return columns


def test_a_packed_frame_holds_what_the_model_has_to_the_last_bit_of_32():
    model = FireFighting(n_robots=12, rng=3).run(150)
    columns, swarm, fires = seen(model), model.swarm, model.fires
    expected = {
        "ids": np.array([[robot.unique_id] for robot in model.robots], np.int32),
        "pose": np.column_stack([swarm.position, swarm.heading]).astype(np.float32),
        "distance": swarm.distance.astype(np.float32),
        "kind": swarm.kind,
        "command": swarm.command.astype(np.float32),
        "layer": swarm.layer[:, None].astype(np.int8),
        "hot": swarm.columns["hot"][:, None].astype(np.int8),
        "heat": (swarm.temperature / model.fire_constants.leave)[:, None].astype(np.float32),
        "fires": np.column_stack([fires.position, fires.radius, fires.temperature, fires.robots, fires.out]).astype(
            np.float32
        ),
    }
    for name, values in expected.items():
        assert columns[name].tobytes() == np.ascontiguousarray(values).tobytes(), name


def test_recorded_and_live_frames_show_the_same(tmp_path):
    model = CooperativeTransport(n_robots=12, load="box", resistance=0.5, rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(80)
    recording = Recording(tmp_path / "run.arrow")
    scene, live = scene_of_recording(recording), seen(model)
    world = scene.world()
    step, replayed = unpacked_frame(packed_frame(recording.at(80), scene), world)
    assert step == 80
    assert replayed.keys() == live.keys() - {"heard", "hot"}
    for name in replayed:
        np.testing.assert_array_equal(replayed[name], live[name], name)
    assert {key: world[key] for key in world if key != "columns"} == {
        key: value for key, value in scene_of(model).world().items() if key != "columns"
    }


WIDE = replace(
    AGENT3, name="wide", radius=9.0, max_speed=3.0, sensors=(ProximitySensor(range=80, field_of_view_degrees=90),)
)
WHAT_HAPPENS = {
    3: lambda model: model.add_robots(WIDE, 2),
    5: lambda model: model.add_obstacle(disc((300, 150), 25)),
    6: lambda model: model.robots[1].remove(),
    7: lambda model: model.add_load(disc((200, 200), 12), resistance=1.5),
    8: lambda model: setattr(model, "control", Subsumption(Explore())),
    9: lambda model: setattr(model, "fire_constants", replace(model.fire_constants, leave=400.0)),
    10: lambda model: model.loads[0].remove(),
    11: lambda model: setattr(model.robots[0], "position", (100.0, 300.0)),
    12: lambda model: model.obstacles[-1].remove(),
    13: lambda model: model.add_robots(AGENT9, 1),
    14: lambda model: model.add_load(polygon([(500, 400), (540, 400), (520, 440)]), resistance=0.5),
}


def drawn(frame, scene):
    """Return all that is drawn of a frame, with designs and loads themselves in the place of their numbers."""
    world = scene.world(frame.step)
    columns = {name: values.tolist() for name, values in drawn_columns(frame, scene).items()}
    columns["design"] = [world["designs"][design] for (design,) in columns["design"]]
    columns["loads"] = [(world["loads"][int(load)], pose) for load, *pose in columns["loads"]]
    return {**columns, **{name: world[name] for name in ("shapes", "layers", "leave")}}


@pytest.mark.slow
@pytest.mark.parametrize("every", [1, 2])
def test_what_comes_and_goes_is_replayed_as_it_was_seen(every, tmp_path):
    model, live = FireFighting(n_robots=6, strategy="A", rng=2), {}
    with model.record(tmp_path / "run.arrow", exact=True, every=every):
        for step in range(1, 19):
            model.step()
            live[step] = drawn(frame_of(model, PACKED_FROM), scene_of(model))
            WHAT_HAPPENS.get(step, lambda model: None)(model)
    recording = Recording(tmp_path / "run.arrow")
    scene = scene_of_recording(recording)
    assert len(recording) == 18 // every
    for frame in recording:
        replayed = drawn(frame, scene)
        for name, values in replayed.items():
            assert values == live[frame.step][name], (frame.step, name)
        assert replayed.keys() == live[frame.step].keys() - {"heard", "hot"}
    worlds = [scene.world(step) for step, _ in scene.changes]
    common = [{name: world[name] for name in world.keys() - {"shapes", "layers", "leave"}} for world in worlds]
    assert all(one == common[0] for one in common)
    later = [{"step": step, **{name: scene.world(step)[name] for name in OWN}} for step, _ in scene.changes[1:]]
    assert len(later) > 3
    assert scene.later == later


def test_no_scenery_is_recorded_for_robots_that_were_only_removed(tmp_path):
    model = FireFighting(n_robots=6, rng=2)
    with model.record(tmp_path / "run.arrow"):
        for _ in range(5):
            model.step()
            model.robots[0].remove()
    recording = Recording(tmp_path / "run.arrow")
    assert len(recording.changes) == 4
    assert len(recording.sceneries) == 1


def test_looking_at_a_model_changes_nothing():
    looked_at, alone = FireFighting(rng=1), FireFighting(rng=1)
    for _ in range(30):
        looked_at.step()
        alone.step()
        seen(looked_at)
    assert looked_at.state_hash() == alone.state_hash()


def test_a_contact_points_from_the_robot_to_what_it_met():
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, poses=[(300, 300, 0.0), (310.5, 300, np.pi)])
    model.control = Subsumption(Explore())
    for _ in range(3):
        model.step()
    contacts = seen(model)["contacts"]
    np.testing.assert_allclose(contacts[contacts[:, 0] == 0, 1], [0.0], atol=1e-6)
    np.testing.assert_allclose(np.abs(contacts[contacts[:, 0] == 1, 1]), [np.pi], atol=1e-6)


def test_a_message_comes_from_where_the_robot_stands_that_was_heard():
    model = SwarmModel(map="openspace_fire", rng=1, communication=Radio(range=2000.0))
    model.add_robots(AGENT9, 8)
    model.control = Subsumption(Avoid(), Respond(to="goal"), Explore())
    model.swarm.columns["heard_from"][0] = 30.0, 0.0
    x, y, heading = seen(model)["pose"][0]
    heard = seen(model)["heard"]
    np.testing.assert_allclose(heard[0], [x + 30 * np.cos(heading), y + 30 * np.sin(heading)], rtol=1e-5)
    assert np.isnan(heard[1:]).all()


def test_the_world_knows_every_robots_design_and_what_was_added_by_hand():
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, 2)
    model.add_robots(AGENT3, 3)
    model.add_robots(AGENT9, 1)
    model.add_obstacle(disc((400, 300), 20, contact=False))
    holed = polygon([(100, 100), (200, 100), (200, 200)], [[(150, 110), (190, 110), (190, 150)]])
    model.add_obstacle(holed)
    world = scene_of(model).world()
    assert [len(design["sensors"]) for design in world["designs"]] == [len(AGENT9.sensors), len(AGENT3.sensors)]
    assert seen(model)["design"].ravel().tolist() == [0, 0, 1, 1, 1, 0]
    mark, solid = world["shapes"][-2:]
    assert mark == {"disc": [400.0, 300.0, 20.0], "mark": True}
    assert [len(ring) for ring in solid["rings"]] == [3, 3]


def test_robots_that_the_scene_does_not_know_are_drawn_with_the_first_design():
    model = SwarmModel(map="openspace", rng=1)
    model.add_robots(AGENT9, 1)
    scene = scene_of(model)
    model.add_robots(AGENT3, 2)
    frame = frame_of(model, PACKED_FROM)
    assert scene.design_of(frame.robots).tolist() == [0, -1, -1]
    assert drawn_columns(frame, scene)["design"].ravel().tolist() == [0, 0, 0]


def test_unknown_robots_have_a_radius_of_five():
    scene = Scene(name="", map="", bounds=(0, 0, 1, 1), changes=((0, {"robots": [[4, 5, 0]], "designs": []}),))
    assert scene.radius_of(np.array([1, 9])).tolist() == [5.0, 5.0]


def test_sensors_of_the_world_are_those_of_the_engine():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 1)
    rows, table = scene_of(model).world()["designs"][0]["sensors"], model.swarm.table.proximity[0]
    for (mx, my, bearing, half, reach), row in zip(rows, table, strict=True):
        np.testing.assert_allclose(
            [mx, my, np.cos(bearing), np.sin(bearing), reach, half], row[[0, 1, 2, 3, 6, 8]], atol=1e-12
        )
