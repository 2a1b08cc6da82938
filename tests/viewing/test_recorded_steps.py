import pickle
from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import AGENT9, Map, SwarmModel, disc, rectangle
from mesa_swarm.base.errors import UnknownNameError
from mesa_swarm.models.cooperative_transport import CooperativeTransport
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from mesa_swarm.recording.frames import PICTURED, frame_of
from mesa_swarm.viewing.pictures import svg, trail_parts, world_figure
from mesa_swarm.viewing.recorded_steps import PicturedSteps
from mesa_swarm.viewing.scene import scene_of


@pytest.mark.parametrize("step", [0, 1, 130, 300])
def test_a_recorded_step_looks_as_the_model_did(run, step):
    model, drawn = FireFighting(n_robots=15, strategy="A", rng=1).run(step), PicturedSteps(run)
    shown, live = drawn.frame(step), frame_of(model)
    assert (shown.step, shown.robots.tolist()) == (step, live.robots.tolist())
    for name in ("position", "heading", "hot"):
        np.testing.assert_allclose(shown[name], live[name], rtol=1e-6, err_msg=name)
    for field in live["fires"].dtype.names:
        np.testing.assert_allclose(shown["fires"][field], live["fires"][field], rtol=1e-6, err_msg=field)
    scene = scene_of(model)
    assert (drawn.scene.name, drawn.scene.bounds) == (scene.name, scene.bounds) == ("FireFighting", model.map.bounds)
    assert drawn.scene.obstacles(step) == scene.obstacles(step) == tuple(body.shape for body in model.obstacles)
    assert drawn.scene.radius_of(shown.robots).tolist() == model.swarm.radius.tolist()


def test_a_frame_of_a_model_does_not_change_with_it():
    model = FireFighting(n_robots=15, rng=1).run(60)
    frame = frame_of(model, (*PICTURED, "distance", "contacts"))
    before = {name: values.tobytes() for name, values in frame.columns.items()}
    now = model.swarm.position.tobytes()
    model.run(40)
    assert {name: values.tobytes() for name, values in frame.columns.items()} == before
    assert before["position"] == now != model.swarm.position.tobytes()


def test_columns_that_a_model_does_not_have_are_refused():
    with pytest.raises(UnknownNameError, match=r"unknown column 'positon'.*position"):
        frame_of(SwarmModel(rng=1), ("positon",))


def test_frames_and_scenes_travel_between_processes():
    model = CooperativeTransport(n_robots=3, rng=1).run(5)
    frame, scene = pickle.loads(pickle.dumps((frame_of(model), scene_of(model))))
    assert svg(world_figure({"here": (frame, scene)})) == svg(world_figure({"here": model}))


def test_robots_too_hot_to_fight_follow_from_the_temperatures(run):
    model = FireFighting(n_robots=15, strategy="A", rng=1)
    drawn = PicturedSteps(run)
    wanted = [model.run(1).swarm.columns["hot"].copy() for _ in range(300)]
    shown = [drawn.frame(step)["hot"] for step in range(1, 301)]
    assert np.any(wanted)
    assert np.array_equal(shown, wanted)


def test_loads_are_shown_where_they_were(pushed):
    drawn = PicturedSteps(pushed)
    (before,), (after,) = (drawn.scene.loads(drawn.frame(step)).poses for step in (20, 21))
    assert before[:2] == pytest.approx([250, 300], abs=5)
    assert after[:2] == pytest.approx([400, 200], abs=5)
    (form,) = drawn.scene.forms.values()
    assert form.shape_at(tuple(after)).geometry.area == pytest.approx(2500)


def test_robots_that_come_and_go_have_their_own_bodies(tmp_path):
    hall = Map(name="hall", bounds=(0, 0, 200, 100), obstacles=[rectangle((0, 0), (10, 100))], fires=[])
    model = SwarmModel(map=hall, rng=1)
    first, _ = model.add_robots(AGENT9, poses=[(50, 50, 0.0), (90, 50, 1.0)])
    with model.record(tmp_path / "run.arrow"):
        model.run(3)
        first.remove()
        model.add_robots(replace(AGENT9, radius=8.0), poses=[(150, 50, 2.0)])
        model.add_obstacle(disc((60, 90), 4))
        model.run(3)
    drawn = PicturedSteps(Recording(tmp_path / "run.arrow"))
    assert drawn.steps.tolist() == [1, 2, 3, 4, 5, 6]
    assert drawn.frame(3)["position"].tolist() == [[50, 50], [90, 50]]
    assert drawn.frame(4)["position"].tolist() == [[90, 50], [150, 50]]
    assert drawn.scene.radius_of(drawn.frame(4).robots).tolist() == [5, 8]
    assert drawn.scene.obstacles(3) == hall.obstacles
    assert drawn.scene.obstacles(4) == tuple(body.shape for body in model.obstacles)
    radii = [design.radius for design in drawn.scene.designs]
    assert [radii[design] for design in drawn.scene.design_of(drawn.frame(4).robots)] == [5, 8]
    sensors, own = drawn.scene.designs[1].proximity, AGENT9.proximity
    assert [sensor.range for sensor in sensors] == [sensor.range for sensor in own]
    assert [sensor.bearing_degrees for sensor in sensors] == pytest.approx([sensor.bearing_degrees for sensor in own])
    assert [trail[:, 0].tolist() for trail in trail_parts(drawn, 5, 4)[0]] == [[90] * 5, [150] * 2]


def test_a_model_of_ones_own_is_drawn_as_its_recording_describes(tmp_path):
    class Own(SwarmModel):
        """A model that no recording makes a program import."""

        def __init__(self, rng=None):
            super().__init__(map="sparse", rng=rng)
            self.add_robots(replace(AGENT9, radius=8.0), 2)
            self.add_obstacle(disc((400, 300), 20))

    model = Own(rng=3)
    with model.record(tmp_path / "run.arrow"):
        model.run(4)
    drawn = PicturedSteps(Recording(tmp_path / "run.arrow"))
    assert drawn.steps.tolist() == [1, 2, 3, 4]
    assert drawn.scene.obstacles(4) == tuple(body.shape for body in model.obstacles)
    assert drawn.scene.radius_of(drawn.frame(4).robots).tolist() == [8, 8]
    np.testing.assert_allclose(drawn.frame(4)["position"], model.swarm.position, rtol=1e-6)


def test_trails_end_where_the_robots_are_and_are_no_longer_than_asked(run):
    drawn = PicturedSteps(run)
    position = run["position"]
    for robot, trail in enumerate(trail_parts(drawn, 50, 20)[0]):
        assert np.array_equal(trail, position[29:50, robot])
    long = trail_parts(drawn, 300, 250)[0][0]
    assert len(long) <= 60
    assert np.array_equal(long[-1], position[-1, 0])
