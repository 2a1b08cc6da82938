"""What one user settings for: taken, refused, built or not."""

import re
import threading

import pytest

from mesa_swarm.dashboard.compare.comparing import Comparing
from mesa_swarm.dashboard.page import session as module
from mesa_swarm.dashboard.page.navigation import address_from, query_of
from mesa_swarm.dashboard.page.session import READER, Session
from mesa_swarm.model.gallery import find_model
from mesa_swarm.model.info import model_info
from mesa_swarm.model.parameters import parameters_of
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.viewing.play_loop import AS_FAST_AS_IT_GOES
from support.waiting import threads, wait_until

MODULE = "mesa_swarm.dashboard.page.session"
# A step that no machine reaches during a test, of a model that does not end by itself.
FAR = 1_000_000_000


@pytest.fixture
def session():
    session = Session("fire_fighting", {"n_robots": 4}, seed=3)
    yield session
    session.close()


@pytest.mark.parametrize(("name", "value"), [("k1", "-5"), ("k1", -5.0), ("join", 1e4), ("n_robots", -3)])
def test_a_value_that_is_refused_changes_nothing(session, name, value):
    session.step()
    settings, link, model = dict(session.settings), query_of(session), session.model
    session.set_parameter(name, value)
    assert name in session.faults
    assert (session.settings, session.waiting, query_of(session)) == (settings, frozenset(), link)
    session.reset()
    assert session.error == ""
    assert session.model is not model
    session.set_parameter(name, settings[name])
    assert session.faults == {}


def test_each_model_is_played_at_its_own_speed_until_the_user_chooses_one(session):
    for name in ("ant_trails", "boids", "fire_fighting"):
        session.choose(name)
        assert session.own_speed == session.loop.speed == model_info(name).speed
    session.set_speed(5.0)
    session.choose("ant_trails")
    assert session.own_speed == session.loop.speed == 5.0


def test_several_values_are_taken_together_or_not_at_all(session):
    settings = dict(session.settings)
    with pytest.raises(ValueError, match="join"):
        session.set_parameters({"k1": 0.001, "join": 1e4})
    assert (session.settings, session.waiting) == (settings, frozenset())
    session.set_parameters({"join": 10.0, "leave": 20.0})
    assert (session.model.fire_constants.join, session.model.fire_constants.leave) == (10.0, 20.0)


def test_settings_that_cannot_be_built_are_left_for_the_last_ones(session):
    session.step()
    session.settings["n_robots"] = 9999
    session.set_seed(8)
    session.reset()
    assert session.unbuilt
    assert session.error
    session.go_back()
    assert (session.error, session.unbuilt, session.waiting) == ("", False, frozenset())
    assert (session.settings["n_robots"], session.seed, session.model.steps) == (4, 3, 0)
    assert session.model.state_hash() == FireFighting(n_robots=4, rng=3).state_hash()


def test_settings_from_which_nothing_was_built_yet_are_left_for_the_defaults():
    session = Session("fire_fighting", {"k1": -5.0}, seed=3)
    assert (session.unbuilt, session.built, session.model) == (True, {}, None)
    session.go_back()
    assert (session.error, session.model.state_hash()) == ("", FireFighting(rng=3).state_hash())
    session.close()


def test_a_model_that_breaks_is_not_one_that_could_not_be_built(session, monkeypatch):
    monkeypatch.setattr(FireFighting, "step", lambda model: 1 / 0)
    session.step()
    assert re.fullmatch(r"test_session\.py, line \d+: ZeroDivisionError: division by zero", session.error)
    assert not session.unbuilt


def test_steps_that_take_too_long_before_the_first_picture_are_played_up_to_their_goal(monkeypatch):
    at_once = Session("fire_fighting", seed=2, steps=20)
    assert (at_once.model.steps, at_once.note) == (20, "")
    monkeypatch.setattr(f"{MODULE}.LONGEST_WAIT", 0.0)
    far = Session("fire_fighting", seed=2, steps=300)
    wait_until(lambda: not far.goal and far.past.shown.fingerprint)
    assert (far.model.steps, far.past.shown.step, far.note, far.goal) == (300, 300, "", 0)
    assert far.loop.speed == far.own_speed
    assert query_of(far).endswith("step=300")
    for session in (at_once, far):
        session.close()


class EndsEarly(FireFighting):
    """Is done after thirty steps."""

    def step(self):
        super().step()
        self.running = self.steps < 30


class BreaksEarly(FireFighting):
    """Breaks in its thirtieth step."""

    def step(self):
        if self.steps == 29:
            raise ZeroDivisionError("nothing left")
        super().step()


@pytest.mark.parametrize("wait", [0.0, 60.0])
@pytest.mark.parametrize(
    ("model", "note", "error"),
    [
        (EndsEarly, "the run ended at step 30, before step 300", ""),
        (BreaksEarly, "", "ZeroDivisionError: nothing left"),
    ],
)
def test_a_run_that_ends_or_breaks_on_its_way_to_the_step_of_a_link_is_not_reported_as_paused(
    model, note, error, wait, monkeypatch
):
    monkeypatch.setattr(f"{MODULE}.LONGEST_WAIT", wait)
    session = Session("fire_fighting", seed=2, steps=300, find=lambda name: model)
    wait_until(lambda: not session.goal and not threads("play"))
    assert (session.note, session.error.partition(": ")[2]) == (note, error)
    session.close()


@pytest.mark.parametrize("speed", [5.0, 240.0, AS_FAST_AS_IT_GOES])
def test_the_speed_that_the_user_chose_is_the_one_after_the_way_to_the_step_of_a_link(speed, monkeypatch):
    monkeypatch.setattr(f"{MODULE}.LONGEST_WAIT", 0.0)
    session = Session("collision_avoidance", seed=2)
    session.set_speed(speed)
    session.reset(FAR)
    assert session.loop.speed == AS_FAST_AS_IT_GOES
    assert session.own_speed == speed
    assert session.companion(Comparing).pair.loop.speed == speed
    session.reset(100)
    wait_until(lambda: not session.goal and not threads("play"))
    assert (session.model.steps, session.loop.speed) == (100, speed)
    session.reset(FAR)
    session.set_speed(30.0)
    assert session.loop.speed == 30.0
    session.pause()
    assert session.loop.speed == session.own_speed == 30.0
    session.close()


@pytest.mark.parametrize("act", ["pause", "step", "reset", "close"])
def test_what_the_user_does_ends_a_run_that_is_on_its_way_to_the_step_of_a_link(act, monkeypatch):
    monkeypatch.setattr(f"{MODULE}.LONGEST_WAIT", 0.0)
    session = Session("collision_avoidance", seed=2, steps=FAR)
    assert (session.playing, session.goal) == (True, FAR)
    assert session.note.startswith(f"step {FAR:,} takes a while")
    getattr(session, act)()
    wait_until(lambda: not threads("play"))
    if act != "close":
        assert (session.goal, session.loop.speed) == (0, session.own_speed)
        assert session.model.steps < FAR
        halfway = f"step {session.model.steps:,} of {FAR:,}: paused early"
        assert session.note == "" if act == "reset" else session.note.startswith(halfway)
    session.close()


def test_a_word_that_is_wrong_does_not_throw_the_link_away():
    asked = address_from("model=flocking&seed=7&foo=1&n_robots=12&step=x&sight=nan", "fire_fighting")
    assert (asked.model, asked.seed, asked.steps, asked.settings) == ("flocking", 7, 0, {"n_robots": 12})
    about = ("step is 'x'", "sight")
    assert all(part in fault for part, fault in zip(about, asked.faults, strict=True))


@pytest.mark.parametrize("robots", ["20000", "-3", "many"])
def test_a_link_cannot_ask_for_what_the_page_would_refuse(robots):
    asked = address_from(f"model=fire_fighting&n_robots={robots}&strategy=A", "boids")
    assert (asked.settings, len(asked.faults)) == ({"strategy": "A"}, 1)
    assert asked.faults[0].startswith("n_robots is ")


def test_words_that_are_not_of_the_page_are_ignored_and_wrong_values_reported_in_few_lines():
    asked = address_from("model=boids&" + "&".join(f"word{i}=1" for i in range(50)), "fire_fighting")
    assert (asked.model, asked.faults) == ("boids", ())
    wrong = "&".join(f"{name}=x" for name in parameters_of(find_model("boids")))
    assert len(address_from(f"model=boids&{wrong}", "fire_fighting").faults) == 6


def test_of_an_unknown_model_nothing_is_taken():
    asked = address_from("model=fire_fihgting&seed=7&strategy=A", "boids")
    assert (asked.model, asked.seed, asked.settings, len(asked.faults)) == ("boids", 1, {}, 1)
    assert "did you mean 'fire_fighting'" in asked.faults[0]


HALL = b'<svg width="800" height="600"><rect width="9" height="9"/></svg>'


class SlowReader:
    """Reads maps as the page does, but not before it may."""

    def __init__(self, monkeypatch):
        self.begun, self.may = threading.Event(), threading.Event()
        self.read = module.map_from
        monkeypatch.setattr(module, "map_from", self)

    def __call__(self, name, content):
        self.begun.set()
        assert self.may.wait(20)
        return self.read(name, content)


def wait_for_readers():
    for thread in threading.enumerate():
        if thread.name == READER:
            thread.join(20)
            assert not thread.is_alive()


def test_an_uploaded_map_is_built_on_and_a_wrong_one_is_refused_in_one_line(session):
    session.upload("hall.svg", HALL.replace(b"<rect", b'<circle class="fire" cx="99" cy="99" r="20"/><rect'))
    wait_for_readers()
    assert (session.error, session.settings["map"], session.model.map.name) == ("", "hall", "hall")
    assert "uploaded or drawn map" in address_from(query_of(session), "boids").faults[0]
    session.upload("hall.svg", b"<svg")
    wait_for_readers()
    assert session.faults["map"].startswith("hall.svg: line 1")
    assert session.settings["map"] == "hall"


def test_the_session_goes_on_while_an_upload_is_read(session, monkeypatch):
    reader = SlowReader(monkeypatch)
    session.upload("hall.svg", HALL)
    assert reader.begun.wait(20)
    assert session.lock.acquire(timeout=20)
    session.lock.release()
    session.step()
    assert session.model.steps == 1
    reader.may.set()
    wait_for_readers()
    assert session.settings["map"] == "hall"


def test_of_two_uploads_the_later_one_counts(session, monkeypatch):
    reader = SlowReader(monkeypatch)
    session.upload("first.svg", HALL)
    assert reader.begun.wait(20)
    session.upload("second.svg", HALL)
    reader.may.set()
    wait_for_readers()
    assert session.settings["map"] == "second"
    assert "first" not in session.uploads


@pytest.mark.parametrize("end", [lambda session: session.close(), lambda session: session.choose("boids")])
def test_what_was_uploaded_to_a_page_that_is_gone_is_dropped(session, monkeypatch, end):
    reader = SlowReader(monkeypatch)
    session.upload("hall.svg", HALL)
    assert reader.begun.wait(20)
    end(session)
    model = session.model
    reader.may.set()
    wait_for_readers()
    assert session.uploads == {}
    assert session.model is model
