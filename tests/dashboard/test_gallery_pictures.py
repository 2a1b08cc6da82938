"""The pictures of models that come with the package: one of each kind for every model, small, and as drawn today."""

import re
from base64 import b64decode
from hashlib import blake2b
from io import BytesIO
from urllib.parse import urlsplit
from xml.etree import ElementTree

import pytest
import shapely
from PIL import Image

from mesa_swarm.base.errors import UnknownNameError
from mesa_swarm.dashboard.gallery.gallery_pictures import (
    FOLDER,
    HEIGHT,
    LARGEST_ALL,
    LARGEST_MOVING,
    LARGEST_STILL,
    MOMENTS,
    SHOTS,
    draw_both,
    drawing_of,
    main,
    moving_of,
    picture_address,
    picture_at,
    still_of,
)
from mesa_swarm.dashboard.gallery.gallery_view import card_of, thumbnail, title
from mesa_swarm.model.gallery import find_model, gallery_names

PACKED = re.compile(r"data:image/png;base64,([A-Za-z0-9+/=]+)")
# Two stills are drawn anew by default, one of them with a field; all pictures in the slow tests.
FEW = ["ant_trails", "boids"]
COMMAND = "make them anew with: python -m mesa_swarm.dashboard.gallery.gallery_pictures"


def unpacked(svg: str) -> str:
    """Return a drawing with its pixels in the place of packed images: versions of libraries pack differently."""

    def pixels(found: re.Match) -> str:
        image = Image.open(BytesIO(b64decode(found[1])))
        return f"{image.size} {image.mode} {blake2b(image.tobytes()).hexdigest()}"

    return PACKED.sub(pixels, svg)


def test_every_model_of_the_gallery_has_a_shot_and_both_pictures_and_there_are_no_others():
    assert sorted(SHOTS) == gallery_names()
    names = [f"{name}{kind}.svg" for name in SHOTS for kind in ("", "_moving")]
    assert sorted(path.name for path in FOLDER.iterdir()) == sorted(names)


@pytest.mark.parametrize("name", gallery_names())
class TestThePicturesOfEveryModel:
    def test_are_small(self, name):
        assert len(still_of(name)[0]) <= LARGEST_STILL
        assert len(moving_of(name)[0]) <= LARGEST_MOVING

    def test_are_well_formed_and_have_the_proportions_of_a_card(self, name):
        for content, kind in (still_of(name), moving_of(name)):
            root = ElementTree.fromstring(content)
            _, _, width, height = map(float, root.get("viewBox").split())
            assert (kind, height / width) == ("image/svg+xml", pytest.approx(HEIGHT, rel=1e-3))

    def test_show_robots_large_enough_to_be_seen_on_a_card(self, name):
        shot = SHOTS[name]
        radii = find_model(name)(**shot.settings, rng=shot.seed).swarm.columns["radius"]
        assert 2 * shot.larger * radii.max() * 250 / shot.window[2] >= 5  # pixels
        assert b'class="robot"' in still_of(name)[0]

    def test_load_nothing_and_run_nothing(self, name):
        for content, _ in (still_of(name), moving_of(name)):
            text = PACKED.sub("", content.decode())
            links = re.findall(r'(?:href|src|url)[=(]"?([^")]*)', text)
            assert all(link.startswith("#") for link in links if link)
            assert not re.search(r"<script|<foreignObject|<style|\son\w+=", text)

    def test_name_their_parts_apart_from_those_of_other_models(self, name):
        ids = re.findall(r'\bid="([^"]+)"', moving_of(name)[0].decode())
        assert all(one.startswith(f"{name}-") for one in ids)
        assert len(ids) == len(set(ids))

    def test_move_for_as_many_moments_as_are_drawn(self, name):
        moves = re.findall(r'type="translate" values="([^"]+)"', moving_of(name)[0].decode())
        assert max(len(values.split(";")) for values in moves) == MOMENTS


def test_all_pictures_together_are_small():
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) <= LARGEST_ALL


@pytest.mark.slow
@pytest.mark.parametrize("name", FEW)
def test_the_stored_pictures_at_rest_are_as_drawn_today(name):
    assert unpacked(drawing_of(name, moments=1).text()) == unpacked(still_of(name)[0].decode()), COMMAND


@pytest.mark.slow
@pytest.mark.parametrize("name", gallery_names())
def test_all_stored_pictures_are_as_drawn_today(name):
    still, moving = draw_both(name)
    assert unpacked(still) == unpacked(still_of(name)[0].decode()), COMMAND
    assert unpacked(moving) == unpacked(moving_of(name)[0].decode()), COMMAND


@pytest.mark.slow
def test_the_command_makes_the_pictures_that_it_is_given(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("mesa_swarm.dashboard.gallery.gallery_pictures.FOLDER", tmp_path / "new")
    main(["puck_clustering"])
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == [
        "puck_clustering.svg",
        "puck_clustering_moving.svg",
    ]
    assert "puck_clustering.svg" in capsys.readouterr().out


def test_pictures_of_unknown_models_are_refused():
    for function in (still_of, moving_of):
        with pytest.raises(UnknownNameError, match="unknown model"):
            function("../gate")


def test_the_address_of_a_moving_picture_leads_to_it_and_changes_with_it():
    found = urlsplit(picture_address("boids"))
    assert picture_at(f"/{found.path}") == moving_of("boids")
    assert found.query == f"v={blake2b(moving_of('boids')[0], digest_size=6).hexdigest()}"


def test_cards_of_the_gallery_have_their_pictures_from_the_beginning():
    card = card_of("boids")
    assert card["still"].startswith("<svg")
    assert card["moving"] == picture_address("boids")
    assert (card["title"], card["about"]) == ("Boids", "Reynolds's three rules on robots that move in any direction.")


def test_a_model_of_the_gallery_has_a_title_and_a_thumbnail_that_is_drawn_once():
    assert title("fire_fighting") == "Fire fighting"
    assert thumbnail("fire_fighting").startswith("<svg")
    assert thumbnail("fire_fighting") is thumbnail("fire_fighting")


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SHOTS if SHOTS[name].trail])
def test_trails_of_the_pictures_lead_through_no_obstacle(name):
    """Their points are some steps apart."""
    pictured = drawing_of(name, MOMENTS)
    solid = [body.geometry for body in pictured.scene.obstacles(pictured.frames[0].step) if body.contact]
    lines = [shapely.LineString(line + pictured.corner) for line in pictured.lines()]
    assert lines
    assert not shapely.intersects(lines, shapely.union_all(solid)).any()
