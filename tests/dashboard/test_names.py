"""What files, maps and models are called is shown as text, whatever it is."""

import re
from importlib.resources import files
from xml.dom import minidom

import numpy as np
import pytest

from mesa_swarm import Map
from mesa_swarm.base.errors import MapError, SwarmError
from mesa_swarm.dashboard import RECORDINGS_VARIABLE
from mesa_swarm.dashboard.compare.compare_view import curves_png, table_html
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.replay.replaying import Replaying
from mesa_swarm.recording import Recording
from mesa_swarm.robots.design import AGENT9
from mesa_swarm.swarm_model import SwarmModel
from mesa_swarm.viewing.export import export
from mesa_swarm.viewing.pictures import png, world_figure
from mesa_swarm.viewing.replay_page import replay_page
from support.names import HOSTILE_NAMES

SVG = b'<svg width="80" height="60"><circle cx="40" cy="20" r="5"/></svg>'
# What puts markup into a page: only pictures of buttons, which are ours.
MARKUP = re.compile(
    r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|v-html|\beval\(|new Function|unsafe_innerHTML"
)
OURS = re.compile(
    r"innerHTML = `<svg viewBox=[^`$]*\$\{ICONS[^`]*`"
    r'|unsafe_innerHTML="[\w ]+"\)|unsafe_innerHTML=picture\)|unsafe_innerHTML=table_html\('
    r"|unsafe_innerHTML=escaped\)"
)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("names") / "run.arrow"
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, 1)
    with model.record(path):
        model.run(3)
    return path


@pytest.mark.parametrize("package", ["mesa_swarm.dashboard", "mesa_swarm.viewing"])
def test_no_script_makes_markup_of_a_text(package):
    for file in files(package).iterdir():
        if file.name.endswith((".js", ".py", ".html")):
            text = OURS.sub("", file.read_text(encoding="utf-8"))
            assert MARKUP.findall(text) == [], file.name


def test_names_in_tables_are_text():
    for name in HOSTILE_NAMES:
        html = table_html(name, [["", name], [name, name]])
        assert re.findall(r"<(?!/?(?:table|caption|thead|tbody|tr|th|td)\b)", html) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", HOSTILE_NAMES)
def test_names_in_pictures_are_text(name):
    assert png(world_figure({name: SwarmModel(rng=1)})).startswith(b"\x89PNG")
    numbers = {name: (np.arange(1, 4), np.arange(3.0), name, name)}
    assert curves_png([numbers, numbers], [name, name]).startswith(b"\x89PNG")


@pytest.mark.parametrize("name", HOSTILE_NAMES)
def test_the_name_of_a_recorded_model_is_text_in_drawings_and_pages(name, recorded, tmp_path, monkeypatch):
    recording = Recording(recorded)
    monkeypatch.setitem(recording.provenance["model"], "name", name)
    (path,) = export(recording, tmp_path / "run.svg", animate=True)
    document = minidom.parse(str(path))
    assert document.getElementsByTagName("title")[0].firstChild.data.startswith(name.replace("\r", "\n"))
    assert document.getElementsByTagName("img") == document.getElementsByTagName("script") == []
    page = replay_page(recording)
    assert name not in page or "<" not in name
    assert len(re.findall(r"<script\b", page)) == 3


@pytest.mark.parametrize("name", [*HOSTILE_NAMES, "null\0", "\udcff", "../../etc/passwd", ""])
def test_an_uploaded_map_is_taken_or_refused_whatever_it_is_called(name):
    session = Session("boids")
    for content in (SVG, b"<svg"):
        session.upload(f"{name}.svg", content)
        fault = session.faults.get("map", "")
        assert len(fault) <= 300
        assert fault.isprintable()
    session.close()


@pytest.mark.parametrize("name", [name for name in HOSTILE_NAMES if name.isprintable() and name.isascii()])
def test_the_name_of_a_map_is_text_in_its_drawing(name):
    drawing = Map(name=name, bounds=(0, 0, 80, 60)).to_svg()
    assert minidom.parseString(drawing).getElementsByTagName("title")[0].firstChild.data == name


@pytest.mark.parametrize("name", ["a\nb", "\u202ea", "null\0", "\udcff", "", "x" * 201])
def test_a_map_is_not_called_what_cannot_be_shown(name):
    with pytest.raises(SwarmError) as error:
        Map(name=name, bounds=(0, 0, 80, 60))
    assert isinstance(error.value, MapError | ValueError)
    assert str(error.value).isprintable()


def test_recordings_are_listed_and_opened_whatever_they_are_called(recorded, tmp_path, monkeypatch):
    names = [f"{name.replace('/', '_')}.arrow" for name in (*HOSTILE_NAMES, "\udcff")]
    for name in names:
        (tmp_path / name).write_bytes(recorded.read_bytes())
    (tmp_path / "<b>broken\n.arrow").write_bytes(b"no recording")
    monkeypatch.setenv(RECORDINGS_VARIABLE, str(tmp_path))
    session = Session("boids")
    replaying = session.companion(Replaying)
    assert set(replaying.listed) >= set(names)
    for name in names:
        replaying.open_listed(name)
        assert (replaying.fault, replaying.name) == ("", name)
    replaying.open_listed("<b>broken\n.arrow")
    assert 0 < len(replaying.fault) <= 300
    session.close()
