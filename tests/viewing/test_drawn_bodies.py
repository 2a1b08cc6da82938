"""Bodies of a user's own kinds as they are drawn: in pictures and animations."""

import re

import pytest

from mesa_swarm import Gripper, Looks, Recording, RobotDesign, SwarmModel, disc, rectangle
from mesa_swarm.viewing.export import export
from mesa_swarm.viewing.pictures import world_figure
from mesa_swarm.viewing.scene import scene_of


class Carrying(SwarmModel):
    """A robot that carries a puck; a nest and a door stand by."""

    looks = Looks(kinds={"puck": "#c08030", "nest": "#c0c0ff", "robot": "#123456", "door": ("#007000", "#60ff60")})

    def __init__(self, *, radius=2.0, rng=None):
        super().__init__(map="openspace", rng=rng)
        self.puck = self.add_body(disc((100, 100), radius), kind="puck")
        self.add_body(disc((700, 500), 20), kind="nest", mode="fixed")
        self.add_body(rectangle((400, 100), (410, 200)), kind="door")
        (robot,) = self.add_robots(RobotDesign(actuators=(Gripper(kinds=("puck",)),)), poses=[(300, 300, 0.0)])
        self.attach(robot, self.puck)


def heights(model, label):
    axes = world_figure({"now": model}).axes[0]
    return [artist.get_zorder() for artist in axes.collections if artist.get_label() == label]


def test_what_a_robot_carries_is_drawn_on_it():
    assert max(heights(Carrying(), "loads")) > max(heights(Carrying(), "fronts"))


def test_a_carried_body_larger_than_its_robot_is_drawn_below_it():
    assert max(heights(Carrying(radius=30.0), "loads")) < min(heights(Carrying(radius=30.0), "robots"))


@pytest.mark.parametrize(("radius", "small"), [(2.0, 1), (30.0, 0)])
def test_a_scene_knows_which_bodies_a_robot_would_hide(radius, small):
    assert len(scene_of(Carrying(radius=radius)).small) == small


def test_an_animation_has_the_colours_of_kinds_and_carried_bodies_on_top(tmp_path):
    model = Carrying(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(3)
    target = tmp_path / "run.svg"
    export(Recording(tmp_path / "run.arrow"), target, animate=True)
    fills = re.findall(r'class="(load|robot|obstacles)"[^>]*? fill="(#\w+)"', target.read_text())
    assert ("obstacles", "#c0c0ff") in fills
    assert [fill for kind, fill in fills if kind != "obstacles"] == ["#007000", "#123456", "#c08030"]
