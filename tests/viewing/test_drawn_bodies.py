"""Bodies of a user's own kinds as they are drawn: in pictures and animations."""

import re

import pytest
from matplotlib.colors import to_hex

from mesa_swarm import Gripper, Looks, Recording, RobotDesign, SwarmModel, disc, rectangle
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.viewing.drawing import drawing_of_model
from mesa_swarm.viewing.export import export
from mesa_swarm.viewing.palette import DARK, LIGHT, fire_colour
from mesa_swarm.viewing.pictures import world_figure
from mesa_swarm.viewing.scene import scene_of, scene_of_recording


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
    fills = re.findall(r'class="(body|back|obstacles)"[^>]*? fill="(#\w+)"', target.read_text())
    assert ("obstacles", "#c0c0ff") in fills
    assert [fill for kind, fill in fills if kind != "obstacles"] == ["#007000", "#123456", "#c08030"]


class Lit(SwarmModel):
    """A lamp that stands, one that is carried about, and a pillar; after two steps one is out, and one brighter."""

    def __init__(self, *, rng=None):
        super().__init__(map="openspace", rng=rng)
        self.lamp = self.add_body(disc((200, 200), 20), kind="lamp", mode="fixed", temperature=1.0)
        self.torch = self.add_body(disc((400, 200), 10), kind="lamp", temperature=0.5)
        self.add_obstacle(disc((600, 200), 10))

    def step(self):
        super().step()
        if self.completed == 2:
            self.lamp.temperature = 0.0
            self.torch.temperature = 1.0


def test_what_radiates_has_the_colour_of_its_temperature_in_pictures():
    axes = world_figure({"now": Lit()}).axes[0]
    fills = {one.get_label(): {to_hex(colour) for colour in one.get_facecolor()} for one in axes.collections}
    assert fills["obstacles"] == {LIGHT.obstacle, fire_colour(1.0)}
    assert fills["loads"] == {fire_colour(0.5)}


def test_what_radiates_has_an_entry_with_colours_in_legends():
    model = Lit()
    entries = scene_of(model).legend(frame_of(model))
    assert [(entry.form, entry.text) for entry in entries] == [
        ("body", "obstacle"),
        ("radiant", "lamp, temperature, 0 to 1"),
    ]


def test_a_drawing_has_the_colours_of_temperatures_in_both_themes():
    text = drawing_of_model(Lit())
    assert re.findall(r'class="body (?:day|night)"[^>]*? fill="(#\w+)"', text) == [
        fire_colour(0.5),
        fire_colour(0.5, DARK),
    ]
    assert f'<path class="obstacles day" fill="{fire_colour(1.0)}"' in text


def test_pages_get_the_temperatures_of_bodies():
    world = scene_of(Lit()).world()
    assert [shape.get("temperature") for shape in world["shapes"][-2:]] == [1.0, None]
    assert [load["temperature"] for load in world["loads"]] == [0.5]


def test_a_kind_whose_colour_a_model_declares_keeps_it_though_it_radiates():
    class Declared(Lit):
        looks = Looks(kinds={"lamp": "#ffee00"})

    axes = world_figure({"now": Declared()}).axes[0]
    loads = [one for one in axes.collections if one.get_label() == "loads"]
    assert {to_hex(colour) for one in loads for colour in one.get_facecolor()} == {"#ffee00"}


def test_a_recording_shows_when_a_temperature_has_changed(tmp_path):
    model = Lit(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(4)
    recording = Recording(tmp_path / "run.arrow")
    scene = scene_of_recording(recording)
    colours = [scene.standing(step)[-2][1] for step in (1, 2, 3, 4)]
    assert colours == [fire_colour(1.0), *[fire_colour(0.0)] * 3]
    torch = [scene.loads(frame).colours[0, 0] for frame in recording]
    assert torch == [fire_colour(0.5), *[fire_colour(1.0)] * 3]
    (change,) = scene.later
    assert [load["temperature"] for load in change["loads"]] == [1.0]
