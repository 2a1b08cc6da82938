"""Fields as they are drawn: in pictures, films, animations, and on their way to pages."""

import re
from base64 import b64decode
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from mesa_swarm import AGENT3, Field, Recording, SwarmModel, disc
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.viewing.export import export
from mesa_swarm.viewing.films import palette as film_palette
from mesa_swarm.viewing.frame_bytes import PACKED_FROM, packed_chunk, packed_frame
from mesa_swarm.viewing.legend import field_entry
from mesa_swarm.viewing.palette import DARK, LIGHT, rgb, scalar_pixels
from mesa_swarm.viewing.pictures import legend_of, png, world_figure
from mesa_swarm.viewing.player import Player
from mesa_swarm.viewing.scene import scene_of, scene_of_recording
from mesa_swarm.world.fields import average_blocks, levels_of
from support.unpacking import unpacked_chunk, unpacked_frame


class Marked(SwarmModel):
    """A field that is full in the lower left corner, and robots that stand."""

    def __init__(self, *, rng=None, cell=100.0, map="openspace"):
        super().__init__(map=map, rng=rng)
        self.add_robots(AGENT3, poses=[(400, 300, 0.0)])
        self.add_field(Field("trail", cell=cell, evaporation=0.1)).deposit((50, 50), 4.0)
        self.add_field(Field("food", cell=cell)).deposit([(750, 550), (650, 550)], [4.0, 1.0])


def pixel_of(image, x, y):
    """The colour at a place of the map, of a picture that shows nothing else."""
    wide, high = image.size
    return np.array(image.getpixel((int(x / 800 * wide), int((1 - y / 600) * high)))[:3], float)


def on_ground(colour, share=1.0):
    opacity = share * int(colour[7:], 16) / 255
    return opacity * rgb(colour) + (1 - opacity) * rgb(LIGHT.ground)


def picture_of(model):
    figure = world_figure({"": model})
    axes = figure.axes[0]
    figure.legends.clear()
    figure.set_layout_engine("none")
    figure.set_size_inches(8, 6)
    axes.set_position((0, 0, 1, 1))
    axes.set_title("")
    return Image.open(BytesIO(png(figure, 50)))


def test_a_pixel_of_nothing_is_transparent_and_one_of_the_peak_has_the_colour():
    pixels = scalar_pixels(np.array([[0, 128, 255]], np.uint8), 0)
    assert pixels[0, :, 3].tolist() == [0, round(128 / 255 * 0xD9), 0xD9]
    assert (pixels[..., :3] == rgb(LIGHT.scalars[0])).all()
    assert (scalar_pixels(np.zeros((1, 1), np.uint8), 5, DARK)[0, 0, :3] == rgb(DARK.scalars[1])).all()


def test_levels_are_square_roots_of_shares_of_the_peak():
    assert levels_of(np.array([0.0, 1.0, 4.0, 5.0]), 4.0).tolist() == [0, 128, 255, 255]
    assert not levels_of(np.zeros((2, 2)), 0.0).any()


@pytest.mark.parametrize("shape", [(1, 1), (7, 5), (100, 30)])
@pytest.mark.parametrize("most", [1, 10, 1000])
def test_a_smaller_picture_has_the_same_mean(shape, most):
    values = np.random.default_rng(1).random(shape)
    small = average_blocks(values, most)
    assert small.size <= most
    if most == 1:
        assert small[0, 0] == pytest.approx(values.mean())


def test_a_picture_has_row_0_at_the_bottom_and_nothing_where_nothing_is():
    model = Marked(rng=1).run(1)
    image = picture_of(model)
    np.testing.assert_allclose(pixel_of(image, 750, 550), on_ground(LIGHT.scalars[1]), atol=2)
    np.testing.assert_allclose(pixel_of(image, 650, 550), on_ground(LIGHT.scalars[1], 0.5), atol=2)
    np.testing.assert_allclose(pixel_of(image, 50, 50), on_ground(LIGHT.scalars[0], 0.9**0.5), atol=2)
    np.testing.assert_allclose(pixel_of(image, 50, 550), rgb(LIGHT.ground), atol=2)


def test_the_legend_states_the_range_of_a_field():
    labels = [entry.get_label() for entry in legend_of(Marked(rng=1).run(3))]
    assert {"trail, 0 to 4", "food, 0 to 4"} <= set(labels)


def test_the_colours_of_the_legend_are_those_of_the_picture():
    bar = field_entry("trail", 0).light
    for share in (0.0, 0.25, 1.0):
        np.testing.assert_allclose(rgb(bar[int(share * 16)]), on_ground(LIGHT.scalars[0], share**0.5), atol=1)


def test_stages_have_one_scale_and_one_entry_for_a_field():
    model = Marked(rng=1)
    model.fields["trail"].values = np.where(model.fields["trail"].values > 0, 1.0, 0.0)
    model.fields["trail"].peak = 1.0
    early = frame_of(model), scene_of(model)
    model.fields["trail"].deposit((750, 50), 16.0)
    late = frame_of(model), scene_of(model)
    figure = world_figure({"early": early, "late": late})
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert [label for label in labels if label.startswith("trail")] == ["trail, 0 to 16"]
    opacity = [axes.images[0].get_array()[0, 0, 3] for axes in figure.axes]
    assert opacity[0] == opacity[1] == round(int(LIGHT.scalars[0][7:], 16) / 4)
    assert early[0]["fields"]["peak"][0] == 1.0, "the frames stay as they were"


def test_a_browser_is_sent_the_largest_values():
    model = Marked(rng=1).run(2)
    scene = scene_of(model)
    frame = frame_of(model, PACKED_FROM)
    for columns in (
        unpacked_frame(packed_frame(frame, scene), scene.world())[1],
        unpacked_chunk(packed_chunk([frame], scene), scene.world())[0][1],
    ):
        assert (columns["peak.trail"], columns["peak.food"]) == (4.0, 4.0)


def test_a_packed_frame_ends_with_the_pictures_of_its_fields():
    model = Marked(rng=1).run(2)
    scene = scene_of(model)
    _, columns = unpacked_frame(packed_frame(frame_of(model, PACKED_FROM), scene), scene.world())
    assert scene.world()["fields"] == ["trail", "food"]
    assert (columns["fields.trail"] == model.fields["trail"].levels()).all()
    assert (columns["fields.food"] == model.fields["food"].levels()).all()


def test_a_model_without_fields_is_packed_as_if_there_were_no_such_thing():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT3, 3)
    scene = scene_of(model)
    frame = frame_of(model, PACKED_FROM)
    assert "fields" not in scene.world()
    assert not [name for name in frame.columns if name.startswith("fields")]
    without = frame_of(model, [name for name in PACKED_FROM if name != "fields"])
    assert packed_frame(frame, scene) == packed_frame(without, scene)


def test_a_player_notices_a_field_that_is_added_while_it_shows_a_model():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT3, 1)
    player = Player(model)
    player.show()
    assert "fields" not in player.past.shown.world
    model.add_field(Field("trail", cell=100.0))
    model.step()
    player.show()
    assert player.past.shown.world["fields"] == ["trail"]


def recorded(tmp_path, cell=100.0, exact=False, steps=12):
    model = Marked(rng=1, cell=cell)
    with model.record(tmp_path / "run.arrow", exact=exact):
        model.run(steps)
    return Recording(tmp_path / "run.arrow")


@pytest.mark.parametrize("exact", [False, True])
def test_chunks_of_a_replay_hold_the_recorded_pictures(tmp_path, exact):
    recording = recorded(tmp_path, exact=exact)
    scene = scene_of_recording(recording)
    frames = unpacked_chunk(packed_chunk(recording, scene), scene.world())
    model = Marked(rng=1)
    for step, columns in frames:
        model.step()
        assert step == model.completed
        assert (columns["fields.trail"] == model.fields["trail"].levels()).all()


def test_pictures_in_chunks_are_small(tmp_path):
    recording = recorded(tmp_path, cell=2.0, steps=2)
    scene = scene_of_recording(recording)
    _, columns = unpacked_chunk(packed_chunk(recording, scene), scene.world())[0]
    assert 5_000 < columns["fields.trail"].size <= 20_000


def test_an_animation_has_each_picture_once_with_its_first_row_below(tmp_path):
    recorded(tmp_path)
    export(tmp_path / "run.arrow", tmp_path / "run.svg", animate=True)
    text = (tmp_path / "run.svg").read_text()
    images = re.findall(r'<image class="field" x="0" y="0" width="800" height="600"[^>]*base64,([^"]*)"', text)
    assert len(images) == 12 + 1, "one of each step of the trail, one of the food, which does not change"
    pixels = np.array(Image.open(BytesIO(b64decode(images[0]))))
    assert pixels.shape == (6, 8, 4)
    assert pixels[0, 0, 3] > 150
    assert not pixels[1:, :, 3].any()


def test_a_film_shows_fields_below_obstacles(tmp_path):
    model = Marked(rng=1)
    model.add_obstacle(disc((770, 550), 15))
    with model.record(tmp_path / "run.arrow"):
        model.run(3)
    export(tmp_path / "run.arrow", tmp_path / "run.gif", size=(808, 640))
    with Image.open(tmp_path / "run.gif") as film:
        film.seek(film.n_frames - 1)
        image = film.convert("RGB").crop((4, 36, 804, 636))
    np.testing.assert_allclose(pixel_of(image, 720, 520), on_ground(LIGHT.scalars[1]), atol=4)
    np.testing.assert_allclose(pixel_of(image, 770, 550), rgb(LIGHT.obstacle), atol=2)
    np.testing.assert_allclose(pixel_of(image, 200, 400), rgb(LIGHT.ground), atol=5)


def test_films_without_fields_have_the_colours_that_they_had():
    assert film_palette().getpalette() == film_palette(0).getpalette()
    assert film_palette(3).getpalette() != film_palette().getpalette()


class Fading(Marked):
    """The trail is removed after two steps."""

    def step(self):
        super().step()
        if self.completed == 3:
            self.remove_field("trail")


def test_a_field_that_was_removed_is_not_drawn_from_then_on(tmp_path):
    model = Fading(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(4)
    recording = Recording(tmp_path / "run.arrow")
    scene = scene_of_recording(recording)
    frames = unpacked_chunk(packed_chunk(recording, scene), scene.world())
    assert [columns["fields.trail"].shape for _, columns in frames] == [(6, 8)] * 2 + [(0, 8)] * 2
    names = [[entry.label for entry in scene.legend(frame) if entry.form == "field"] for frame in recording]
    assert names == [["trail", "food"]] * 2 + [["food"]] * 2
    export(recording, tmp_path / "run.svg", animate=True)
    assert (tmp_path / "run.svg").read_text().count("<image") == 2 + 1, "the trail twice, and the food"
    export(recording, tmp_path / "run.gif", size=(808, 640))
    with Image.open(tmp_path / "run.gif") as film:
        film.seek(film.n_frames - 1)
        image = film.convert("RGB").crop((4, 36, 804, 636))
    np.testing.assert_allclose(pixel_of(image, 50, 50), rgb(LIGHT.ground), atol=5)
    np.testing.assert_allclose(pixel_of(image, 720, 550), on_ground(LIGHT.scalars[1]), atol=4)
