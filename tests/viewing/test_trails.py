"""Trails: the places of all steps, broken where robots were put, never through a wall that a robot did not cross."""

import re
from importlib.resources import files

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm import AGENT9
from mesa_swarm.dashboard.compare.comparing import Pair
from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.replay.replaying import ReplayPlayer
from mesa_swarm.recording.recording import Recording
from mesa_swarm.viewing import trails
from mesa_swarm.viewing.canvas_widget import SwarmCanvas
from mesa_swarm.viewing.pictures import Look, still_figure, trail_parts
from mesa_swarm.viewing.player import Player
from mesa_swarm.viewing.recorded_steps import PicturedSteps
from mesa_swarm.viewing.run_pictures import trace
from mesa_swarm.viewing.trails import PLACES, TRAIL_STEPS, TrailKeeper, news, packed_points, reach, stride
from support.walls import Circling, crosses


class Viewer:
    """Draws trails."""

    ready = True

    def __init__(self):
        self.frames = []

    def push(self, number, frame):
        self.frames.append(frame)


def places_of(points, bounds=(0, 0, 200, 120)) -> np.ndarray:
    """Return the places (k, n, 2) of the points of a trail, as a browser is sent them."""
    low, high = np.array(bounds, float).reshape(2, 2)
    sent = np.frombuffer(packed_points(points, bounds), np.uint16).reshape(len(points), -1, 2)
    return low + sent / PLACES * (high - low)


def test_a_trail_has_the_places_of_all_steps_however_few_pictures_are_shown():
    model, viewer = Circling(rng=1), Viewer()
    player = Player(model)
    player.add_viewer(viewer)
    player.trace(viewer, True)
    places = [model.swarm.position.copy()]
    for _ in range(130):
        model.step()
        places.append(model.swarm.position.copy())
    player.rest()
    trail = viewer.frames[-1].trail
    assert [point.step for point in trail] == list(range(130 - TRAIL_STEPS, 131))
    assert np.abs(places_of(trail) - np.stack(places[30:])).max() < 200 / PLACES
    assert not crosses(places_of(trail).swapaxes(0, 1))
    assert crosses(np.stack(places[30::50]).swapaxes(0, 1)), "lines from picture to picture would"
    player.close()


def test_nothing_is_noted_while_no_viewer_draws_trails():
    model, viewer = Circling(rng=1), Viewer()
    player = Player(model)
    player.add_viewer(viewer)
    player.step()
    assert (len(model.observers), viewer.frames[-1].trail) == (0, ())
    player.trace(viewer, True)
    player.step()
    assert (len(model.observers), len(viewer.frames[-1].trail)) == (1, 2)
    player.trace(viewer, False)
    player.step()
    assert (len(model.observers), viewer.frames[-1].trail) == (0, ())
    player.trace(viewer, True)
    player.remove_viewer(viewer)
    assert len(model.observers) == 0
    player.close()


def test_trails_do_not_change_a_run():
    plain, traced = Circling(rng=1), Circling(rng=1)
    keeper = TrailKeeper()
    keeper.follow(traced)
    assert plain.run(50).state_hash() == traced.run(50).state_hash()
    assert len(keeper.points()) == 51


def test_a_robot_that_is_moved_by_hand_breaks_its_trail_only():
    model, keeper = Circling(rng=1), TrailKeeper()
    keeper.follow(model)
    model.run(3)
    model.robots[1].position = (50, 30)
    (*_, before, now) = keeper.points()
    assert (before.step, before.moved, now.step, now.moved) == (2, (), 3, (1,))
    model.robots[1].position = (51, 30)
    model.robots[2].position = (30, 30)
    model.run(1)
    (*_, before, now) = keeper.points()
    assert (before.step, before.moved, now.step, now.moved) == (3, (1, 2), 4, ())
    assert places_of([before])[0][1] == pytest.approx([51, 30], abs=0.01)


def test_trails_begin_anew_when_robots_are_added_and_when_the_model_is_another():
    model, keeper = Circling(rng=1), TrailKeeper()
    keeper.follow(model)
    model.run(5)
    model.add_robots(AGENT9, poses=[(30, 30, 0.0)])
    assert [point.step for point in keeper.points()] == [5]
    model.run(2)
    assert [point.step for point in keeper.points()] == [5, 6, 7]
    keeper.follow(Circling(rng=2))
    assert [point.step for point in keeper.points()] == [0]
    assert model.observers == []


def test_trails_go_on_when_a_parameter_is_changed_and_begin_anew_at_a_reset():
    session, viewer = Session("collision_avoidance", seed=2), Viewer()
    session.add_viewer(viewer)
    session.trace(viewer, True)
    for _ in range(5):
        session.step()
    session.set_parameter("noise", 0.1)
    session.step()
    assert [point.step for point in viewer.frames[-1].trail] == list(range(7))
    robot = session.model.robots[0]
    session.edit("move", robot.unique_id, *(robot.position - (12.0, 12.0)), 0.0)
    assert viewer.frames[-1].trail[-1].moved == (0,)
    session.reset()
    assert [point.step for point in viewer.frames[-1].trail] == [0]
    session.close()


def test_the_trails_of_very_many_robots_are_shorter(monkeypatch):
    monkeypatch.setattr(trails, "MOST_PLACES", 30)
    model, keeper = Circling(rng=1), TrailKeeper()
    keeper.follow(model)
    model.run(40)
    assert [point.step for point in keeper.points()] == list(range(31, 41))


def test_a_canvas_is_sent_only_the_steps_that_it_lacks(monkeypatch):
    sent = []
    monkeypatch.setattr(SwarmCanvas, "send", lambda self, message, buffers=None: sent.append((message, buffers)))
    model = Circling(rng=1)
    canvas = model.show()

    def hear(do, value=None):
        canvas._hear({"do": do, "value": value, "view": "a"})

    def trail():
        (message, buffers) = [(one, parts) for one, parts in sent if one["kind"] == "picture"][-1]
        hear("drawn", message["number"])
        found = message.get("trail")
        assert (found is None) == (len(buffers) == 1)
        if found:
            assert len(buffers[1]) == 4 * len(model.swarm) * len(found["steps"])
        return found and (found["steps"], found["more"])

    hear("ready")
    canvas.commands["step"]()
    assert trail() is None
    hear("trails", True)
    canvas.commands["step"]()
    assert trail() == ([1, 2], False)
    model.run(5)
    canvas.caught_up()
    assert trail() == ([3, 4, 5, 6, 7], True)
    canvas.commands["back"]()
    assert trail() == ([1, 2], False)
    hear("trails", False)
    canvas.commands["look"](10)
    assert trail() is None
    hear("trails", True)
    hear("left")
    assert len(model.observers) == 1, "only what shows steps that a program takes"


def test_both_worlds_of_a_comparison_have_trails():
    pair, viewer = Pair(), Viewer()
    pair.place(Circling(rng=1), Circling(rng=2))
    pair.sides[1].add_viewer(viewer)
    pair.sides[1].trace(viewer, True)
    for _ in range(3):
        pair.step()
    assert [point.step for point in viewer.frames[-1].trail] == [0, 1, 2, 3]
    pair.close()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Recordings of a run of 200 steps: of every step, and of every tenth."""
    folder = tmp_path_factory.mktemp("trails")
    for every in (1, 10):
        model = Circling(rng=1)
        with model.record(folder / f"{every}.arrow", every=every, rerun=False):
            model.run(200)
    return folder


def test_a_recording_that_is_replayed_has_the_trails_of_its_rows(recorded):
    player, viewer = ReplayPlayer(recorded / "1.arrow"), Viewer()
    player.add_viewer(viewer)
    player.look(149)
    assert viewer.frames[-1].trail == ()
    player.trace(viewer, True)
    trail = viewer.frames[-1].trail
    assert [point.step for point in trail] == list(range(50, 151))
    positions = np.stack([player.recording[step - 1]["position"] for step in range(50, 151)])
    assert np.abs(places_of(trail) - positions).max() < 200 / PLACES
    player.look(160)
    assert news(viewer.frames[-1].trail, trail[-1]) == (viewer.frames[-1].trail[-11:], True)
    player.close()
    sparse = ReplayPlayer(recorded / "10.arrow")
    sparse.add_viewer(viewer)
    sparse.trace(viewer, True)
    sparse.look(15)
    assert [point.step for point in viewer.frames[-1].trail] == list(range(60, 161, 10))
    sparse.close()


def test_pictures_of_a_recording_have_lines_where_each_step_is_known_and_dots_elsewhere(recorded):
    whole, sparse = (PicturedSteps(Recording(recorded / f"{every}.arrow")) for every in (1, 10))
    lines, dots = trail_parts(whole, 200, 150)
    assert (len(lines), len(dots), crosses(lines)) == (3, 0, False)
    lines, dots = trail_parts(sparse, 200, 150)
    assert (lines, len(dots)) == ([], 3 * 16)
    for drawn, words in ((whole, False), (sparse, True)):
        figure = still_figure(drawn, [200], Look(trails=150))
        texts = [text.get_text() for text in figure.legends[0].get_texts()]
        assert ("where it was, way unknown" in texts) is words


def test_a_robot_that_was_put_elsewhere_has_no_line_there_in_pictures(tmp_path):
    model = Circling(rng=1)
    with model.record(tmp_path / "run.arrow", rerun=False):
        model.run(20)
        model.robots[0].position = (100, 30)
        model.run(20)
    lines, dots = trail_parts(PicturedSteps(Recording(tmp_path / "run.arrow")), 40, 40)
    assert (len(lines), len(dots), crosses(lines)) == (4, 0, False)


@pytest.mark.parametrize("every", [1, 40])
def test_a_trace_crosses_no_wall_however_few_points_are_asked_for(every):
    figure = trace(Circling(rng=1), steps=200, robots=3, every=every)
    lines = [line for part in figure.axes[0].collections for line in getattr(part, "get_segments", list)()]
    assert len(lines) > 60
    assert not crosses(lines)


@pytest.mark.slow
@given(
    radius=st.floats(0.5, 50), speed=st.floats(0.01, 20), turns=st.lists(st.floats(-3, 3), min_size=200, max_size=200)
)
def test_a_line_between_points_so_far_apart_keeps_clear_of_what_a_robot_keeps_clear_of(radius, speed, turns):
    headings = np.cumsum(turns)
    way = np.cumsum(speed * np.column_stack([np.cos(headings), np.sin(headings)]), axis=0)
    spared = stride(radius, speed)
    if spared == 1:
        return
    for begin in range(0, len(way) - spared, spared):
        part = way[begin : begin + spared + 1]
        line = shapely.points(np.linspace(part[0], part[-1], 30))
        assert shapely.distance(line, shapely.LineString(part)).max() < radius


@given(radius=st.floats(0.5, 50), speed=st.floats(0, 200), steps=st.integers(1, 100))
def test_what_a_robot_can_reach_is_no_jump_and_what_crosses_a_wall_in_a_step_is_one(radius, speed, steps):
    assert reach(radius, speed, steps) >= speed * steps
    assert reach(radius, speed, steps) >= 2 * radius


def test_the_browser_knows_the_same_numbers():
    script = (files("mesa_swarm.viewing") / "canvas.js").read_text(encoding="utf-8")
    assert f"TRAIL_STEPS = {TRAIL_STEPS};" in script
    margin, least = re.search(r"MARGIN = ([\d.]+), LEAST_JUMP = ([\d.]+);", script).groups()
    assert reach(1.0, 10.0, 3) == float(margin) * 30
    assert reach(1.0, 0.0, 3) == float(least)
