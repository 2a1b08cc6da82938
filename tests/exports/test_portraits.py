from dataclasses import replace

import numpy as np
import pytest

from mesa_swarm import AGENT9, Map, SwarmModel, disc, rectangle
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from mesa_swarm.viewing.pictures import trails_of
from mesa_swarm.viewing.portrait import Portraits, Rows, portrait_of


def same(shown, wanted):
    assert shown.steps == wanted.steps
    assert shown.bounds == wanted.bounds
    assert shown.obstacles == wanted.obstacles
    for ours, theirs in ((shown.robots, wanted.robots), (shown.fires, wanted.fires)):
        assert ours.keys() == theirs.keys()
        for name, values in ours.items():
            np.testing.assert_allclose(values, theirs[name], rtol=1e-6, err_msg=name)


@pytest.mark.parametrize("step", [0, 1, 130, 300])
def test_the_portrait_of_a_recorded_step_is_that_of_the_model(run, step):
    model = FireFighting(n_robots=15, strategy="A", rng=1).run(step)
    same(Portraits(Rows(run)).at(step), portrait_of(model))


def test_who_is_too_hot_follows_from_the_temperatures(run):
    model = FireFighting(n_robots=15, strategy="A", rng=1)
    portraits = Portraits(Rows(run))
    wanted = [model.run(1).swarm.columns["hot"].copy() for _ in range(300)]
    shown = [portraits.hot(portraits.frame(step)) for step in range(1, 301)]
    assert np.any(wanted)
    assert np.array_equal(shown, wanted)


def test_loads_are_shown_where_they_lay(pushed):
    portraits = Portraits(Rows(pushed))
    (before,), (after,) = portraits.at(20).loads, portraits.at(21).loads
    assert before.position == pytest.approx([250, 300], abs=5)
    assert after.position == pytest.approx([400, 200], abs=5)
    assert after.geometry.area == pytest.approx(2500)


def test_robots_that_come_and_go_keep_their_own_bodies(tmp_path):
    hall = Map(name="hall", bounds=(0, 0, 200, 100), obstacles=[rectangle((0, 0), (10, 100))], fires=[])
    model = SwarmModel(map=hall, rng=1)
    first, _ = model.add_robots(AGENT9, poses=[(50, 50, 0.0), (90, 50, 1.0)])
    with model.record(tmp_path / "run.arrow"):
        model.run(3)
        first.remove()
        model.add_robots(replace(AGENT9, radius=8.0), poses=[(150, 50, 2.0)])
        model.add_obstacle(disc((60, 90), 4))
        model.run(3)
    portraits = Portraits(Rows(Recording(tmp_path / "run.arrow")))
    assert portraits.steps.tolist() == [1, 2, 3, 4, 5, 6]
    assert portraits.at(3).robots["position"].tolist() == [[50, 50], [90, 50]]
    assert portraits.at(4).robots["position"].tolist() == [[90, 50], [150, 50]]
    assert portraits.at(4).robots["radius"].tolist() == [5, 8]
    assert portraits.at(3).obstacles == hall.obstacles
    assert portraits.at(4).obstacles == tuple(body.shape for body in model.obstacles)
    radii = [design.radius for design in portraits.at(4).designs]
    assert [radii[design] for design in portraits.at(4).robots["design"]] == [5, 8]
    sensors, own = portraits.at(4).designs[1].proximity, AGENT9.proximity
    assert [sensor.range for sensor in sensors] == [sensor.range for sensor in own]
    assert [sensor.bearing_degrees for sensor in sensors] == pytest.approx([sensor.bearing_degrees for sensor in own])
    assert [trail[:, 0].tolist() for trail in trails_of(portraits, 5, 4)] == [[90] * 5, [150] * 2]


def test_a_model_of_ones_own_is_drawn_as_its_recording_says(tmp_path):
    class Own(SwarmModel):
        """A model that no file can make anybody import."""

        def __init__(self, rng=None):
            super().__init__(map="sparse", rng=rng)
            self.add_robots(replace(AGENT9, radius=8.0), 2)
            self.add_obstacle(disc((400, 300), 20))

    model = Own(rng=3)
    with model.record(tmp_path / "run.arrow"):
        model.run(4)
    portraits = Portraits(Rows(Recording(tmp_path / "run.arrow")))
    assert portraits.steps.tolist() == [1, 2, 3, 4]
    assert portraits.at(4).obstacles == tuple(body.shape for body in model.obstacles)
    assert portraits.at(4).robots["radius"].tolist() == [8, 8]
    np.testing.assert_allclose(portraits.at(4).robots["position"], model.swarm.position, rtol=1e-6)


def test_trails_end_where_the_robots_are_and_are_no_longer_than_asked(run):
    portraits = Portraits(Rows(run))
    position = run["position"]
    for robot, trail in enumerate(trails_of(portraits, 50, 20)):
        assert np.array_equal(trail, position[29:50, robot])
    long = trails_of(portraits, 300, 250)[0]
    assert len(long) <= 60
    assert np.array_equal(long[-1], position[-1, 0])
