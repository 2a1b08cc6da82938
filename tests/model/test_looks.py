"""Looks that models declare: what is refused, and what reaches pictures, pages, recordings and charts."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.colors import to_hex
from matplotlib.patches import Patch
from PIL import Image

from mesa_swarm import AGENT9, Chart, ColourMap, Looks, Recording, SwarmModel, disc
from mesa_swarm.base.errors import InvalidValueError, RecordingError, SwarmError, UnknownNameError
from mesa_swarm.dashboard.page.series import Series
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.model.looks import LABEL_BYTES, label_bytes, looks_of, pair_colours
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.recording.schema import checked_scenery
from mesa_swarm.viewing.export import export
from mesa_swarm.viewing.frame_bytes import PACKED_FROM, packed_chunk, packed_frame
from mesa_swarm.viewing.palette import LIGHT, VALUE_STEPS, value_colours, value_steps
from mesa_swarm.viewing.pictures import legend_of, world_figure
from mesa_swarm.viewing.scene import scene_of, scene_of_recording
from support.unpacking import unpacked_chunk, unpacked_frame

NAMES = ("one", "", "é" * 20)


class Looking(SwarmModel):
    """Three robots in colours of their first coordinate."""

    looks = Looks(
        kinds={"obstacle": ("#112233", "#aabbcc"), "robot": "#445566"},
        column=ColourMap(lambda model: model.swarm.position[:, 0], 0, 800, label="x", colours=("#000000", "#ffffff")),
        label=lambda model: NAMES,
        charts=(
            Chart("count", lambda model: len(model.swarm), unit="robots"),
            Chart("place", lambda model: model.swarm.position[0], curves=("x", "y")),
            Chart("fails", lambda model: 1 / 0),
            Chart("all collisions", "total_collisions"),
        ),
    )

    def __init__(self, *, rng=None):
        super().__init__(map="original", rng=rng)
        self.add_robots(AGENT9, poses=[(200, 400, 0.0), (400, 400, 0.0), (550, 100, 0.0)])


class Warm(SwarmModel):
    """Robots in colours of a column that is recorded, with its values as labels."""

    looks = Looks(column=ColourMap("temperature", 0, 2), label="temperature")

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, 4)
        self.swarm.columns["temperature"][:] = [0.0, 0.5, 1.0, 4.0]


REFUSED = {
    "colour of 'load' is 'red'; expected #rrggbb": lambda: Looks(kinds={"load": "red"}),
    "colour of 'load' is .'#000000',.; expected": lambda: Looks(kinds={"load": ("#000000",)}),
    "colour of 'load' is None": lambda: Looks(kinds={"load": None}),
    "kinds is 'load'; expected a mapping": lambda: Looks(kinds="load"),
    "source is 3; expected a name, or a function": lambda: Looks(column=3),
    "label is 3; expected a name, or a function": lambda: Looks(label=3),
    "high is 0; expected a finite number above 1": lambda: ColourMap("heat", 1, 0),
    "low is nan; expected a finite number": lambda: ColourMap("heat", float("nan")),
    "colours are 1; expected 2 to 16": lambda: ColourMap("heat", colours=("#000000",)),
    "charts has 'count'; expected Chart": lambda: Looks(charts=("count",)),
    "two charts are named 'a'": lambda: Looks(charts=(Chart("a", len), Chart("a", len))),
    "charts is Chart": lambda: Looks(charts=Chart("a", len)),
    "panels has 'panel'; expected a Solara component": lambda: Looks(panels=("panel",)),
    "source of a is None": lambda: Chart("a", None),
    "name of a curve is ''": lambda: Chart("a", len, curves=("",)),
}


@pytest.mark.parametrize("words", REFUSED)
def test_wrong_looks_are_refused_in_one_line_where_they_are_declared(words):
    with pytest.raises(InvalidValueError, match=words) as refused:
        REFUSED[words]()
    assert "\n" not in str(refused.value)


def model_with(looks):
    found = SwarmModel(rng=1)
    found.add_robots(AGENT9, 2)
    found.looks = looks
    return found


@pytest.mark.parametrize(
    ("looks", "kind", "words"),
    [
        (Looks(column="temperatur"), UnknownNameError, "column of looks: unknown column 'temperatur'; did you mean"),
        (Looks(column="position"), InvalidValueError, r"position, has shape \(2, 2\); expected one value a robot"),
        (Looks(label=lambda model: ["a"]), InvalidValueError, r"label of looks, value, has shape \(1,\)"),
        (Looks(column=lambda model: ["a", "b"]), InvalidValueError, "column of looks has .*; expected numbers"),
        (Looks(column=lambda model: model.energy), InvalidValueError, "value, failed: AttributeError"),
        ("red", InvalidValueError, "looks of SwarmModel is 'red'; expected Looks"),
    ],
)
def test_looks_that_do_not_fit_the_model_are_refused_when_it_is_drawn(looks, kind, words):
    with pytest.raises(kind, match=words):
        frame_of(model_with(looks))


def test_a_model_without_looks_is_drawn_as_before():
    model = SwarmModel(rng=1)
    scene = scene_of(model)
    assert looks_of(model) is None
    assert "looks" not in scene.world()
    assert {"value", "label"}.isdisjoint(scene.columns)


def test_a_browser_gets_colours_of_both_themes_and_each_robot_s_colour_and_text():
    model = Looking(rng=1)
    scene = scene_of(model)
    world = scene.world()
    assert world["looks"]["kinds"]["light"] == {"obstacle": "#112233", "robot": "#445566"}
    assert world["looks"]["kinds"]["dark"] == {"obstacle": "#aabbcc", "robot": "#445566"}
    column = world["looks"]["column"]
    assert (column["label"], column["low"], column["high"]) == ("x", 0.0, 800.0)
    assert (column["light"][0], column["dark"][-1], len(column["light"])) == ("#000000", "#ffffff", VALUE_STEPS)
    for columns in (
        unpacked_frame(packed_frame(frame_of(model, PACKED_FROM), scene), world)[1],
        unpacked_chunk(packed_chunk([frame_of(model, PACKED_FROM)], scene), world)[0][1],
    ):
        assert columns["value"].ravel().tolist() == [4, 8, 11]
        texts = [bytes(row.astype(np.int8).tobytes()).rstrip(b"\0").decode() for row in columns["label"]]
        assert texts == ["one", "", "é" * 6]


def test_pictures_have_the_colours_and_texts_and_name_them_in_the_legend():
    model = Looking(rng=1)
    axes = world_figure({"": model}).axes[0]
    drawn = {one.get_label(): one for one in axes.collections}
    shades = (drawn["robots"].get_facecolor()[:, 0] * (VALUE_STEPS - 1)).round().tolist()
    assert shades == [4, 8, 11]
    assert drawn["obstacles"].get_facecolor()[0, :3] == pytest.approx([0x11 / 255, 0x22 / 255, 0x33 / 255])
    assert [text.get_text() for text in axes.texts] == ["one", "é" * 12]
    labels = [entry.get_label() for entry in legend_of(model)]
    assert labels[-1] == "robot, x, 0 to 800"


class Pucks(SwarmModel):
    """Bodies of two kinds of its own: pucks that are pushed, and a nest that stands still."""

    looks = Looks(kinds={"puck": "#c08030", "nest": ("#102030", "#d0e0f0")})

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, 1)
        self.add_body(disc((200, 200), 20), kind="nest", mode="fixed")
        self.add_body(disc((400, 200), 8), kind="puck", mode="pushed", resistance=1.0)
        self.add_body(disc((500, 200), 8), kind="stone", mode="pushed", resistance=1.0)


def test_bodies_of_own_kinds_have_their_colours_and_are_named_in_the_legend():
    model = Pucks(rng=1)
    drawn = {one.get_label(): one for one in world_figure({"": model}).axes[0].collections}
    assert to_hex(drawn["obstacles"].get_facecolor()[-1]) == "#102030"
    assert [to_hex(colour) for colour in drawn["loads"].get_facecolor()] == ["#c08030", LIGHT.load]
    patches = [entry for entry in legend_of(model) if isinstance(entry, Patch)]
    entries = {entry.get_label(): to_hex(entry.get_facecolor()) for entry in patches}
    assert (entries["puck"], entries["nest"]) == ("#c08030", "#102030")
    world = scene_of(model).world()
    assert world["shapes"][-1]["kind"] == "nest"
    assert [load["kind"] for load in world["loads"]] == ["puck", "stone"]
    assert world["looks"]["kinds"]["dark"] == {"puck": "#c08030", "nest": "#d0e0f0"}
    assert [entry["name"] for entry in world["legend"]] == ["obstacle", "stone", "nest", "puck"]
    assert world["legend"][-2]["dark"] == ["#d0e0f0"]


def test_the_usual_bodies_are_in_the_legend_of_a_page_but_not_of_a_film():
    scene = scene_of(model := SwarmModel(rng=1))
    assert [entry["name"] for entry in scene.world()["legend"]] == ["obstacle"]
    assert scene.own_legend(frame_of(model)) == []


def test_a_recording_is_replayed_with_the_looks_of_its_columns(tmp_path):
    model = Warm(rng=1)
    with model.record(tmp_path / "warm.arrow", rerun=False):
        model.run(3)
    recording = Recording(tmp_path / "warm.arrow")
    scene, live = scene_of_recording(recording), scene_of(model)
    assert scene.world()["looks"] == live.world()["looks"]
    assert {"value", "label"} < set(scene.columns)
    last = [
        unpacked_frame(packed_frame(frame, one), one.world())[1]
        for frame, one in ((recording[-1], scene), (frame_of(model, PACKED_FROM), live))
    ]
    for name in ("value", "label"):
        np.testing.assert_array_equal(last[0][name], last[1][name])


def test_what_a_function_computes_is_not_in_a_replay(tmp_path):
    model = Looking(rng=1)
    with model.record(tmp_path / "looking.arrow", rerun=False):
        model.run(3)
    scene = scene_of_recording(Recording(tmp_path / "looking.arrow"))
    assert {"value", "label"}.isdisjoint(scene.columns)
    assert scene.world()["looks"]["kinds"]["light"]["obstacle"] == "#112233"


@pytest.mark.parametrize(
    "forged",
    [
        {"kinds": {"load": ["red", "#000000"]}},
        {"kinds": {"load": ["#000000"]}},
        {"column": {"name": "x", "label": "x", "low": 0.0, "high": float("nan"), "colours": []}},
        {"column": {"name": "x", "label": "x", "low": 0.0, "high": 1.0, "colours": [["#000000", "url(x)"]]}},
        {"label": 3},
        [],
    ],
)
def test_forged_looks_in_a_recording_are_refused(forged):
    scenery = Looking(rng=1)
    written = {**scene_of(scenery).changes[0][1], "looks": forged}
    with pytest.raises(RecordingError, match="looks"):
        checked_scenery(written)


def test_looks_change_no_bit_of_a_run():
    plain = SwarmModel(rng=1)
    plain.add_robots(AGENT9, 2)
    dressed = model_with(Looks(column="temperature", label="task"))
    for model in (plain, dressed):
        model.run(5)
    frame_of(dressed)
    assert plain.state_hash() == dressed.state_hash()


def test_own_charts_are_measured_after_every_step():
    model, series = Looking(rng=1), Series()
    series.follow(model)
    model.run(4)
    steps, counts = series.rows("own count")
    assert (steps.tolist(), counts[:, 0].tolist()) == ([1, 2, 3, 4], [3.0] * 4)
    assert series.chart("own place").names == ("x", "y")
    np.testing.assert_array_equal(series.rows("own place")[1][-1], model.swarm.position[0])
    assert np.isnan(series.rows("own fails")[1]).all()
    assert series.rows("own all collisions")[1].shape == (4, 1)


@given(st.lists(st.text(), max_size=5))
def test_labels_are_whole_letters_of_at_most_twelve_bytes(texts):
    rows = label_bytes(np.array([*texts, ""], object))
    assert rows.shape == (len(texts) + 1, LABEL_BYTES)
    for text, row in zip(texts, rows, strict=False):
        shown = row.tobytes().rstrip(b"\0").decode(errors="surrogatepass")
        assert text.encode(errors="replace").decode().startswith(shown)


@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6), st.floats(0, 1))
def test_the_colour_of_a_value_rises_with_it_and_ends_at_the_range(low, width, share):
    high = low + width
    steps = value_steps([low - 1, low, low + share * width, high, high + 1, np.nan], low, high)
    assert steps[:2].tolist() == [0, 0]
    assert 0 <= steps[2] <= VALUE_STEPS - 1
    assert steps[3:].tolist() == [VALUE_STEPS - 1, VALUE_STEPS - 1, -1]


def test_a_colour_may_differ_between_themes():
    assert pair_colours("load", "#A0b1C2") == ("#A0b1C2", "#A0b1C2")
    assert pair_colours("load", ("#000000", "#ffffff")) == ("#000000", "#ffffff")
    with pytest.raises(SwarmError):
        pair_colours("load", "#fff")
    assert len(LIGHT.values) == VALUE_STEPS


def test_a_page_shows_a_wrong_column_as_an_error_and_goes_on():
    class Wrong(Looking):
        looks = Looks(column="nothing")

    session = Session("wrong", find=lambda name: Wrong)
    assert "unknown column 'nothing'" in session.error
    session.close()


class Turning(SwarmModel):
    """Robots in colours of their headings, with the numbers of their tasks, which change."""

    looks = Looks(kinds={"nest": "#d0e0f0"}, column=ColourMap("heading", 0, 1, label="way"), label="number")

    def __init__(self, *, rng=None):
        super().__init__(map="openspace", rng=rng)
        self.add_body(disc((400, 200), 20), kind="nest", mode="fixed")
        self.add_robots(AGENT9, poses=[(100, 300, 0.0), (200, 300, 1.0)])

    def step(self):
        super().step()
        self.robots[0].heading = 0.5
        self.swarm.columns["number"][1] = self.completed


def moving_drawing(folder, ending=".svg"):
    model = Turning(rng=1)
    with model.record(folder / "run.arrow"):
        model.run(3)
    export(folder / "run.arrow", folder / f"run{ending}", **({"animate": True} if ending == ".svg" else {}))
    return folder / f"run{ending}"


def test_an_animation_has_the_colours_of_values_and_the_labels(tmp_path):
    text = moving_drawing(tmp_path).read_text()
    colours = value_colours(Turning.looks.as_json(), "light")
    robots = re.findall(r'<use class="back" fill="(#\w+)"', text)
    assert robots == [colours[8], colours[-1]]
    labels = [re.findall(r">(\d)</text>", group) for group in re.findall(r'<g class="label".*?</g>', text)]
    assert labels == [["0"], ["1", "2", "3"]]


def test_a_recording_has_the_columns_that_looks_name_unless_others_are_asked_for(tmp_path):
    moving_drawing(tmp_path)
    assert {"heading", "number"} < set(Recording(tmp_path / "run.arrow").columns)
    with Turning(rng=1).record(tmp_path / "few.arrow", columns=("position",)) as recorder:
        assert len(recorder) == 0
    assert Recording(tmp_path / "few.arrow").columns == ("position",)


def test_an_animation_names_what_its_colours_mean(tmp_path):
    written = re.findall(r">([^<>]+)</text>", moving_drawing(tmp_path).read_text())
    assert written[-3:] == ["obstacle", "nest", "robot, way, 0 to 1"]


def test_a_film_has_a_legend_below_the_world_and_the_colours_of_kinds(tmp_path):
    with Image.open(moving_drawing(tmp_path, ".gif")) as film:
        image = film.convert("RGB")
    assert image.width == 808
    assert image.height > 640
    assert image.getpixel((4 + 400, 36 + 400)) == (0xD0, 0xE0, 0xF0)
    foot = np.array(image)[640:].reshape(-1, 3)
    assert (foot == (0xD0, 0xE0, 0xF0)).all(axis=1).sum() > 50


def test_a_film_of_a_model_without_own_looks_is_as_large_as_before(tmp_path):
    model = SwarmModel(map="openspace", rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(2)
    export(tmp_path / "run.arrow", tmp_path / "run.gif")
    with Image.open(tmp_path / "run.gif") as film:
        assert film.size == (808, 640)
