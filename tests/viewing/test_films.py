"""Films, GIFs and animated drawings: frames, sizes, and robots where they were recorded."""

import re
import subprocess
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from mesa_swarm.models.agglomeration import Agglomeration
from mesa_swarm.recording import Recording
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.drawing import Clock, number_row, tracks
from mesa_swarm.viewing.export import export
from mesa_swarm.viewing.films import Screen
from mesa_swarm.viewing.palette import LIGHT, fire_colour
from mesa_swarm.viewing.pictures import CAPTION, MARGIN, Look
from mesa_swarm.viewing.recorded_steps import PicturedSteps

imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
SVG = "{http://www.w3.org/2000/svg}"


def colour(name):
    return np.rint(255 * np.array(to_rgb(name)))


def check_robots(pixels, frame, tolerance):
    """Find each robot's pale front and blue or orange back where they were recorded, in a film of the usual size."""
    height = pixels.shape[0]
    for position, heading, hot in zip(frame["position"], frame["heading"], frame["hot"], strict=True):
        left = np.array([-np.sin(heading), np.cos(heading)])
        ahead = np.array([np.cos(heading), np.sin(heading)])
        # Beside the line that shows the heading, and away from the rim.
        for along, wanted in ((1.7, LIGHT.robot_front), (-2.0, LIGHT.robot_hot if hot else LIGHT.robot)):
            x, y = position + along * ahead + 2.2 * left
            seen = pixels[int(height - MARGIN - y), int(MARGIN + x)].astype(float)
            assert np.abs(seen[:3] - colour(wanted)).max() <= tolerance, (position, along)


def test_dollars_in_the_name_of_a_model_do_no_harm_to_a_film(tmp_path):
    model = type("a$\\frac{$b", (SwarmModel,), {})(rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(2)
    drawn = PicturedSteps(Recording(tmp_path / "run.arrow"))
    assert Screen(drawn, Look()).show(1).shape[2] == 4


@pytest.mark.parametrize("step", [0, 40, 300])
def test_robots_are_in_the_film_where_they_were_recorded(run, step):
    drawn = PicturedSteps(run)
    pixels = Screen(drawn, Look()).show(step)
    assert pixels.shape == (600 + 2 * MARGIN + CAPTION, 800 + 2 * MARGIN, 4)
    check_robots(pixels, drawn.frame(step), 3)


def test_a_frame_does_not_depend_on_the_frames_before(run):
    drawn = PicturedSteps(run)
    look = Look(size=(300, 200), trails=30)
    screen = Screen(drawn, look)
    for step in (3, 200):
        screen.show(step)
    assert np.array_equal(screen.show(90), Screen(drawn, look).show(90))


def test_what_stands_is_shown_while_it_stands(rebuilt):
    drawn = PicturedSteps(rebuilt)
    screen = Screen(drawn, Look(sectors=True))
    for step in (1, 5, 6, 10, 11, 15, 7):
        pixels = screen.show(step)
        wanted = LIGHT.obstacle if 6 <= step <= 10 else LIGHT.ground
        seen = pixels[pixels.shape[0] - MARGIN - 300, MARGIN + 400, :3]
        assert np.abs(seen - colour(wanted)).max() <= 3, step
        assert np.array_equal(pixels, Screen(drawn, Look(sectors=True)).show(step))


def test_what_stands_for_a_while_is_seen_for_a_while_in_an_animated_drawing(rebuilt, tmp_path):
    (path,) = export(rebuilt, tmp_path / "a.svg", animate=True)
    drawing = ET.parse(path).getroot()
    shown = [
        path.find(f"{SVG}animate[@attributeName='visibility']").get("values")
        for path in drawing.iter(f"{SVG}path")
        if path.get("class") == "obstacles" and "A50 50" in path.get("d")
    ]
    assert shown == ["hidden;visible;hidden"]
    bodies = {body.get("id"): body.find(f"{SVG}circle").get("r") for body in drawing.iter(f"{SVG}g") if body.get("id")}
    assert sorted(map(float, bodies.values())) == [5, 20]


def test_a_film_has_the_frames_and_the_size_that_were_asked_for(run, tmp_path):
    (path,) = export(run, tmp_path / "a.mp4", every=10, first=100, last=200, fps=10, size=(320, 256))
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(path)
    assert frames == 11
    assert seconds == pytest.approx(1.1, abs=0.05)
    facts = next(imageio_ffmpeg.read_frames(path))
    assert facts["size"] == (320, 256)
    assert facts["codec"] == "h264"
    assert facts["pix_fmt"].startswith("yuv420p")


def test_films_have_an_even_size_whatever_the_map(tmp_path, run):
    program = imageio_ffmpeg.get_ffmpeg_exe()
    (path,) = export(run, tmp_path / "a.mp4", last=3)
    described = subprocess.run([program, "-i", str(path)], capture_output=True, text=True, check=False).stderr
    assert "808x640" in described


def test_a_gif_has_the_frames_the_speed_and_the_robots(run, tmp_path):
    (path,) = export(run, tmp_path / "a.gif", every=20, last=200, fps=20)
    drawn = PicturedSteps(run)
    with Image.open(path) as image:
        assert image.n_frames == 11
        assert image.info["duration"] == 50
        assert image.info["loop"] == 0
        for number in range(11):
            image.seek(number)
            shown = np.asarray(image.convert("RGB"))
            assert shown[CAPTION + MARGIN + 300, 400 - 60].tolist() == colour(LIGHT.ground).tolist()
            check_robots(shown, drawn.frame(20 * number), 12)


def test_all_frames_of_a_gif_share_one_palette(run, tmp_path):
    (path,) = export(run, tmp_path / "a.gif", last=5)
    content = path.read_bytes()
    with Image.open(path) as image:
        tables = [bool(flags & 128) for flags in local_flags(content, image.size)]
    assert content[10] & 128
    assert tables == [False] * 6


def local_flags(content, size):
    """Return the flags of all images of a GIF, by walking through its blocks."""
    at = 13 + 3 * 2 ** ((content[10] & 7) + 1)
    while content[at : at + 1] != b";":
        if content[at : at + 1] == b"!":
            at += 2
        else:
            assert int.from_bytes(content[at + 5 : at + 7], "little") <= size[0]
            yield content[at + 9]
            at += 11
        while content[at]:
            at += content[at] + 1
        at += 1


def drawing(path):
    return ET.fromstring(path.read_text())


def value_at(node, kind, seconds):
    """Return the value of an animation of this type at a time, as a browser computes it."""
    (animation,) = (a for a in node.findall(f"{SVG}animateTransform") if a.get("type") == kind)
    rows = np.array([[float(number) for number in row.split()] for row in animation.get("values").split(";")])
    whole = float(animation.get("dur").removesuffix("s"))
    assert animation.get("repeatCount") == "indefinite"
    moments = np.linspace(0, whole, len(rows)) if len(rows) > 1 else [0]
    return np.array([np.interp(seconds % whole, moments, column) for column in rows.T])


def test_an_animated_drawing_has_robots_where_they_were_when_they_were_there(run, tmp_path):
    (path,) = export(run, tmp_path / "a.svg", animate=True, every=5, first=50, last=250, fps=10)
    robots = drawing(path).findall(f".//{SVG}g[@class='robot']")
    assert [int(node.get("data-robot")) for node in robots] == run[0].robots.tolist()
    for place in (0, 1, 17, 39):
        frame = run.at(50 + 5 * place)
        for row, node in enumerate(robots):
            assert value_at(node, "translate", place / 10) == pytest.approx(frame["position"][row], abs=0.051)
            turned = np.radians(value_at(node, "rotate", place / 10)[0]) - frame["heading"][row]
            assert abs(np.sin(turned / 2)) < np.radians(0.51) / 2


def test_an_object_that_is_not_there_has_the_values_that_it_has_next():
    moments = [(np.array([7]), np.array([[1.0]])), (np.array([7, 8]), np.array([[2.0], [5.0]]))]
    found = [(track.number, track.values.ravel().tolist(), track.present.tolist()) for track in tracks(moments)]
    assert found == [(7, [1.0, 2.0], [True, True]), (8, [5.0, 5.0], [False, True])]


def test_an_animation_names_only_changes_and_has_numbers_without_trailing_zeros():
    assert number_row((1.26, -0.01, 30.0), 1) == "1.3 0 30"
    assert 'values="red;blue" keyTimes="0;1"' in Clock(moments=3, seconds=2.0).jumping("fill", ["red", "red", "blue"])
    assert Clock(moments=3, seconds=2.0).jumping("fill", ["red"] * 3) == ""
    moved = Clock(moments=2, seconds=1.0).moving("translate", np.array([[0.0, 1.0], [2.5, 1.0]]), 1)
    assert moved.endswith('type="translate" values="0 1;2.5 1" dur="1s" repeatCount="indefinite"/>')


def test_robots_in_an_animated_drawing_never_spin_round_the_long_way(run, tmp_path):
    (path,) = export(run, tmp_path / "a.svg", animate=True, every=1, last=200)
    for node in drawing(path).findall(f".//{SVG}g[@class='robot']"):
        turn = next(a for a in node.findall(f"{SVG}animateTransform") if a.get("type") == "rotate")
        degrees = np.array([float(value) for value in turn.get("values").split(";")])
        assert np.abs(np.diff(degrees)).max(initial=0) <= 180


def fill_at(node, share):
    """Return a colour that jumps, at this share of the whole time."""
    animation = node.find(f"{SVG}animate[@attributeName='fill']")
    if animation is None:
        return node.get("fill")
    times = [float(time) for time in animation.get("keyTimes").split(";")]
    return animation.get("values").split(";")[sum(time <= share for time in times) - 1]


def test_fires_change_their_colour_when_their_temperature_did(run, tmp_path):
    (path,) = export(run, tmp_path / "a.svg", animate=True, every=2, last=300)
    fires = drawing(path).findall(f".//{SVG}g[@class='fire']")
    assert len(fires) == 7
    for place in (0, 60, 149):
        for row, node in enumerate(fires):
            shown = 255 * np.array(to_rgb(fill_at(node.find(f"{SVG}circle"), place / 150)))
            fire = (run.at(2 * place) if place else run.at(1))["fires"][row]
            wanted = LIGHT.ashes if fire["out"] else fire_colour(float(fire["temperature"]))
            assert np.abs(shown - colour(wanted)).max() <= (1 if place else 4)


def test_loads_move_in_an_animated_drawing(pushed, tmp_path):
    (path,) = export(pushed, tmp_path / "a.svg", animate=True, fps=10)
    (load,) = drawing(path).findall(f".//{SVG}g[@class='load']")
    for place in (0, 20, 21, 39):
        pose = pushed.at(max(place, 1))["loads"][0].tolist()[1:]
        assert value_at(load, "translate", place / 10) == pytest.approx(pose[:2], abs=0.051)


def test_the_captions_of_an_animated_drawing_name_every_step(run, tmp_path):
    (path,) = export(run, tmp_path / "a.svg", animate=True, every=100)
    texts = [text.text for text in drawing(path).iter(f"{SVG}text") if text.text]
    assert [text for text in texts if text.startswith("step")] == [f"step {step}" for step in (0, 100, 200, 300)]


@pytest.mark.long
def test_fifty_robots_and_three_hundred_frames_are_below_two_megabytes_and_fast(tmp_path):
    model = Agglomeration(n_robots=50, rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(3000)
    (path,) = export(tmp_path / "run.arrow", tmp_path / "a.svg", animate=True, every=10)
    assert path.stat().st_size < 1_000_000
    assert len(re.findall("step [0-9,]+<", path.read_text())) == 301
    (film,) = export(Recording(tmp_path / "run.arrow"), tmp_path / "a.mp4", every=5)
    assert imageio_ffmpeg.count_frames_and_secs(film)[0] == 601
