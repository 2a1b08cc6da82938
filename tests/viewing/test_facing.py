"""Bodies that move without turning are drawn in their direction of motion: pictures, animations, thumbnails."""

import re

import numpy as np
import pytest

from mesa_swarm import AGENT9, HolonomicDrive, Recording, RobotDesign, SwarmModel
from mesa_swarm.control import Subsumption
from mesa_swarm.models.boids import Boids
from mesa_swarm.models.flocking import Flocking
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.viewing.drawing import drawing_of_model
from mesa_swarm.viewing.export import export
from mesa_swarm.viewing.pictures import world_figure
from mesa_swarm.viewing.scene import scene_of
from support.scenes import circle

HEADINGS = 0.3, -2.0, 0.0


class Mixed(SwarmModel):
    """Two robots that move in any direction, and one on wheels."""

    def __init__(self, *, rng=None):
        super().__init__(map="openspace", rng=rng)
        free = RobotDesign(name="free", drive=HolonomicDrive())
        self.add_robots(free, poses=[(200, 200, HEADINGS[0]), (400, 300, HEADINGS[1])])
        self.add_robots(AGENT9, poses=[(600, 200, HEADINGS[2])])
        self.control = Subsumption(circle(left=0.6, right=0.8))


def facing(model):
    return scene_of(model).facing(frame_of(model))


def fronts_in(model):
    """Return the azimuth of the middle of each robot's front half in a picture, from the robot's centre."""
    (fronts,) = (one for one in world_figure({"now": model}).axes[0].collections if one.get_label() == "fronts")
    middles = np.array([path.vertices[1:-2].mean(axis=0) for path in fronts.get_paths()])
    return np.arctan2(*(middles - model.swarm.position).T[::-1])


def apart(one, other):
    return np.abs(np.angle(np.exp(1j * (np.asarray(one) - np.asarray(other)))))


def test_a_body_that_does_not_turn_faces_where_it_moves_and_one_on_wheels_its_heading():
    model = Mixed()
    assert facing(model).tolist() == pytest.approx(HEADINGS)  # nothing has moved yet
    before = model.swarm.position.copy()
    model.run(3)
    dx, dy = (model.swarm.position - before).T
    assert facing(model)[:2] == pytest.approx(np.arctan2(dy, dx)[:2])
    assert model.swarm.heading[:2] == pytest.approx(HEADINGS[:2])
    assert facing(model)[2] == pytest.approx(model.swarm.heading[2]) != pytest.approx(HEADINGS[2])


def test_boids_face_their_direction_of_motion_and_robots_that_turn_their_heading():
    boids = Boids(n_robots=20, rng=1).run(40)
    moved = np.isfinite(boids.travel)
    assert moved.sum() > 15
    # Others push some of them aside, which no command shows.
    assert np.median(apart(facing(boids), boids.travel)[moved]) < 0.01
    assert np.median(apart(boids.swarm.heading, boids.travel)[moved]) > 0.5
    wheeled = Flocking(n_robots=5, rng=1).run(5)
    assert (facing(wheeled) == wheeled.swarm.heading).all()


def test_the_fronts_of_a_picture_are_there():
    model = Mixed().run(3)
    assert apart(fronts_in(model), facing(model)).max() < 0.01


def test_a_recording_shows_the_same_and_without_commands_the_heading(tmp_path):
    model = Mixed(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(3)
    export(Recording(tmp_path / "run.arrow"), tmp_path / "run.svg", animate=True, first=2)
    drawn = re.findall(r'class="robot"[^>]* rotate\((-?[\d.]+)\)', (tmp_path / "run.svg").read_text())
    # That of step 2, in whole degrees; the third robot turns by 0.02 rad a step.
    assert apart(np.radians(np.array(drawn, float)), facing(model) - (0, 0, 0.02)).max() < 0.01
    frame = frame_of(model, ("position", "heading"))
    assert scene_of(model).facing(frame).tolist() == model.swarm.heading.tolist()


def test_thumbnails_show_the_same():
    model = Mixed(rng=1).run(3)
    turned = re.findall(r'class="robot"[^>]* rotate\((-?[\d.]+)\)', drawing_of_model(model))
    assert apart(np.radians(np.array(turned, float)), facing(model)).max() < 0.01
