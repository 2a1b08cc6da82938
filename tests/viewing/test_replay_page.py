import json
import re
from base64 import b64decode

import pytest

from mesa_swarm import SwarmModel
from mesa_swarm.models.collision_avoidance import CollisionAvoidance
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from mesa_swarm.viewing.replay_page import page_of, replay_page
from mesa_swarm.viewing.server_headers import policy, source_of
from support.unpacking import unpacked_chunk

MOST = 2_000_000


def facts_of(page):
    return json.loads(re.search(r'<script type="application/json" id="about">(.*?)</script>', page)[1])


@pytest.fixture(scope="module")
def page(fires):
    return replay_page(Recording(fires))


def test_the_page_holds_every_step(page):
    about = facts_of(page)
    chunks = re.findall(r'id="chunk-\d+">([^<]*)<', page)
    frames = [frame for chunk in chunks for frame in unpacked_chunk(b64decode(chunk), about["world"])]
    assert [step for step, _ in frames] == list(range(1, 301))


def test_the_page_refers_to_nothing_outside_itself(page):
    assert re.findall(r"https?://|//[a-z0-9.-]+\.[a-z]{2,}/", page) == []
    assert re.findall(r"<script[^>]*\ssrc|<link[^>]*stylesheet|@import|\burl\(|\bimport\b[^;\n]*from", page) == []
    assert re.findall(r'(?:src|href)="([^"]*)"', page) == ["data:,", "#"]  # a link for the script


def test_nothing_in_a_recording_can_end_the_element_that_holds_it():
    page = page_of({"model": "</script><script>alert(1)</script>{{script}}{{data}}"}, [])
    assert facts_of(page)["model"] == "</script><script>alert(1)</script>{{script}}{{data}}"
    assert "<script>alert" not in page


def test_a_page_of_no_steps_is_a_page(tmp_path):
    SwarmModel(rng=1).record(tmp_path / "run.arrow").close()
    assert facts_of(replay_page(Recording(tmp_path / "run.arrow")))["rows"] == 0


def page_of_run(model_class, steps, path):
    model = model_class(n_robots=50, rng=1)
    with model.record(path):
        for _ in range(steps):  # fires that are out end a run, but not this one
            model.step()
    assert len(Recording(path)) == steps
    return len(replay_page(Recording(path)).encode())


def test_fifty_robots_take_less_than_500_bytes_a_step(tmp_path):
    few, more = (page_of_run(CollisionAvoidance, steps, tmp_path / f"{steps}.arrow") for steps in (10, 266))
    assert (more - few) / 256 < 500


@pytest.mark.slow
@pytest.mark.parametrize("model_class", [CollisionAvoidance, FireFighting])
def test_fifty_robots_and_three_thousand_steps_take_less_than_two_megabytes(model_class, tmp_path):
    assert page_of_run(model_class, 3000, tmp_path / "run.arrow") < MOST


def test_a_policy_permits_what_is_listed_and_in_a_page_does_not_mention_framing():
    inside = "default-src 'self'; object-src 'none'; base-uri 'none'; form-action 'none'"
    assert policy({"default-src": "'self'"}, in_page=True) == inside
    assert policy({"default-src": "'self'"}) == f"{inside}; frame-ancestors 'none'"
    assert source_of("") == "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='"
