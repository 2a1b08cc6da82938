"""Where a user is: links of every tab, Back and Forward, reloads, the first moment, and what is paused unseen."""

from pathlib import Path

import pytest

from mesa_swarm.dashboard import RECORDINGS_VARIABLE
from mesa_swarm.dashboard.app import COMPANIONS, MORE_TABS
from mesa_swarm.dashboard.compare.comparing import Comparing
from mesa_swarm.dashboard.page.navigation import KEYS, Linkable, Navigation, address_from, query_of
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.replay.replaying import Replaying
from mesa_swarm.model.info import model_info
from mesa_swarm.models.boids import Boids
from support.waiting import wait_until


def opened(query: str, *, motion: bool = True, resume=None) -> Navigation:
    navigation = Navigation(query, "fire_fighting", COMPANIONS)
    navigation.begin(motion=motion, resume=resume)
    return navigation


@pytest.fixture
def pages():
    """Close all pages that a test opens."""
    found = []

    def page(*given, **named):
        found.append(opened(*given, **named))
        return found[-1]

    yield page
    for one in found:
        one.close()


@pytest.mark.parametrize(
    ("query", "motion", "plays"),
    [
        ("model=boids", True, True),
        ("model=boids", False, False),
        ("model=boids&play=no", True, False),
        ("model=boids&step=4", True, False),
        ("tab=compare", True, False),
        ("", True, True),
    ],
)
def test_a_page_opens_playing_unless_it_should_not(pages, query, motion, plays):
    assert pages(query, motion=motion).session.playing == plays


def test_a_model_that_is_chosen_plays(pages):
    page = pages("tab=models&tour=no")
    page.choose("boids")
    assert (page.tab, page.session.name, page.session.playing) == ("watch", "boids", True)
    assert page.place == "boids watch"


def test_a_run_that_is_not_seen_pauses_and_goes_on_when_it_is(pages):
    page = pages("model=boids")
    page.go("models")
    page.session.pause()  # as the canvas that is taken off the page does
    page.go("watch")
    assert page.session.playing
    page.session.pause()
    page.go("compare")
    page.go("watch")
    assert not page.session.playing


def test_back_shows_what_was_there_and_leaves_a_run_that_still_is(pages):
    page = pages("model=fire_fighting&n_robots=4&play=no")
    page.session.step()
    first = page.query
    state = page.session.model.state_hash()
    page.go("models")
    model = page.session.model
    page.visit("?" + first)
    assert page.session.model is model
    page.choose("boids")
    page.visit("?" + first)
    assert (page.tab, page.session.settings["n_robots"], page.session.model.state_hash()) == ("watch", 4, state)


def test_a_link_to_a_comparison_shows_the_same_comparison(pages):
    page = pages("tab=compare&model=boids&n_robots=20")
    comparing = page.session.companion(Comparing)
    comparing.choose_parameter("sight")
    comparing.set_value("B", "90")
    comparing.set_count("seeds", "12")
    again = pages(page.query)
    other = again.session.companion(Comparing)
    assert (again.tab, again.faults) == ("compare", ())
    assert (other.name, other.parameter, other.values, other.seeds) == ("boids", "sight", [60.0, 90.0], 12)
    assert other.shared_settings == {"n_robots": 20}
    assert [len(side.model.robots) for side in other.pair.sides] == [20, 20]


def test_a_link_to_a_recording_shows_its_step(pages, tmp_path, monkeypatch):
    monkeypatch.setenv(RECORDINGS_VARIABLE, str(tmp_path))
    model = Boids(n_robots=5, rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(20)
    page = pages("tab=replay")
    replaying = page.session.companion(Replaying)
    replaying.open_listed("run.arrow")
    replaying.player.look_at(7)
    again = pages(page.query)
    assert again.session.companion(Replaying).player.step_shown == 7
    assert pages("tab=replay&replay.recording=../secret").faults[0].startswith("recording '../secret'")


@pytest.mark.parametrize(
    "words", ["compare.parameter=nothing", "compare.model=./x.py:A", "compare.seeds=1", "compare.A=x"]
)
def test_wrong_words_of_a_tab_are_reported_in_one_line(pages, words):
    page = pages(f"tab=compare&model=boids&{words}")
    assert len(page.faults) == 1
    assert "\n" not in page.faults[0]


def test_a_reload_goes_on_where_the_run_was_and_plays_on(pages):
    page = pages("model=boids", resume={"step": 30, "playing": True, "speed": 3})
    wait_until(lambda: page.session.model.completed > 30)
    page.session.pause()
    assert page.session.own_speed == 5.0
    other = pages("model=boids", resume={"step": 30, "playing": False, "speed": 5})
    wait_until(lambda: not other.session.playing)
    assert other.session.model.completed == 30
    plain = Session("boids", steps=30)
    assert other.session.model.state_hash() == plain.model.state_hash()
    plain.close()


@pytest.mark.parametrize("plays", [True, False])
def test_a_reload_on_compare_goes_on_where_both_worlds_were_and_leaves_the_run_of_watch(pages, plays):
    page = pages("tab=compare&model=boids", resume={"step": 40, "playing": plays, "speed": 3})
    pair = page.session.companion(Comparing).pair
    wait_until(lambda: pair.completed > 40 if plays else pair.completed == 40 and not pair.playing)
    assert (pair.playing, pair.loop.speed) == (plays, 5.0)
    pair.pause()
    pair.step()  # which waits until the thread that plays has left both models
    assert page.session.model.completed == 0
    for side in pair.sides:
        side.model.run(200 - side.model.completed)
    again = Comparing(page.session)
    for side, other in zip(again.pair.sides, pair.sides, strict=True):
        assert side.model.run(200).state_hash() == other.model.state_hash()
    again.close()


def test_pausing_on_the_way_to_a_step_ends_the_way(pages):
    page = pages("tab=compare&model=boids")
    pair = page.session.companion(Comparing).pair
    before = pair.loop.speed
    page.session.companion(Comparing).go_on_to(10**9, plays=False, speed=None)
    wait_until(lambda: pair.completed > 3)
    pair.pause()
    assert (pair.playing, pair.loop.speed) == (False, before)
    done = pair.completed
    pair.step()
    assert pair.completed == done + 1


def test_a_reload_on_replay_plays_on_in_the_recording(pages, tmp_path, monkeypatch):
    monkeypatch.setenv(RECORDINGS_VARIABLE, str(tmp_path))
    model = Boids(n_robots=5, rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(20)
    page = pages("tab=replay&replay.recording=run.arrow", resume={"step": 12, "playing": True, "speed": 0})
    player = page.session.companion(Replaying).player
    assert (player.playing, player.loop.speed) == (True, 0.5)
    player.pause()
    assert 12 <= player.step_shown < 20
    assert page.session.model.completed == 0


@pytest.mark.parametrize("tab", ["models", "experiment"])
def test_a_reload_on_a_tab_without_a_player_changes_no_speed(pages, tab):
    page = pages(f"tab={tab}&model=boids", resume={"step": 0, "playing": False, "speed": -1})
    assert page.session.own_speed == model_info("boids").speed


@pytest.mark.parametrize(
    "resume", [{"step": "x"}, {"step": -3, "speed": 99}, {"step": 1e300, "playing": "yes"}, {"speed": None}]
)
def test_nonsense_from_the_browser_breaks_nothing(pages, resume):
    page = pages("model=boids&play=no", resume=resume)
    page.session.pause()
    assert page.session.error == ""


def test_a_changed_run_is_in_the_link_or_the_link_states_that_it_is_not():
    session = Session("boids", {"n_robots": 3})
    session.step()
    session.set_parameter("noise", 0.25)
    session.edit("obstacle", 100, 100, 20)
    session.step()
    address = address_from(query_of(session), "boids")
    assert (address.settings, address.steps, address.faults) == ({"n_robots": 3}, 2, ())
    again = Session(address.model, address.settings, address.seed, address.steps, edits=address.edits)
    assert again.model.state_hash() == session.model.state_hash()
    session.straight = False
    assert "changed=yes" in query_of(session)
    assert "changed by hand more often" in address_from(query_of(session), "boids").faults[0]
    again.close()
    session.close()


def test_the_model_shown_is_that_of_the_tab(pages, tmp_path, monkeypatch):
    monkeypatch.setenv(RECORDINGS_VARIABLE, str(tmp_path))
    model = Boids(n_robots=5, rng=1)
    with model.record(tmp_path / "run.arrow"):
        model.run(3)
    page = pages("tab=compare&compare.model=flocking")
    assert page.model_shown == "flocking"
    page.go("watch")
    assert page.model_shown == "fire_fighting"
    page.go("replay")
    assert page.model_shown == ""
    page.session.companion(Replaying).open_listed("run.arrow")
    assert page.model_shown == "boids"


def test_every_tab_with_a_state_can_be_linked():
    session = Session("boids")
    for name in MORE_TABS:
        assert isinstance(session.companion(COMPANIONS[name]), Linkable)
    session.close()


def test_the_page_about_the_dashboard_lists_the_keys_of_the_page():
    text = (Path(__file__).parents[2] / "docs/dashboard.md").read_text(encoding="utf-8")
    for key, what in KEYS:
        assert f"| {key} | {what} |" in text
