"""The page without a browser: its buttons, sliders, errors, and that sessions share nothing."""

import socket
import threading
import time
from contextlib import contextmanager

import ipyvuetify as v
import pytest
import solara
from solara.widgets import HTML

from mesa_swarm.dashboard import HOST, app, launch
from mesa_swarm.dashboard.session import Session
from mesa_swarm.errors import InvalidValueError, SwarmError, UnknownNameError
from mesa_swarm.gallery import model_names
from mesa_swarm.model import SwarmModel
from mesa_swarm.parameters import Parameter, Slider, parameters_of
from mesa_swarm.world.shapes import disc

FireFighting = app.find_model("fire_fighting")


class Page:
    """The rendered page, as a user sees it."""

    def __init__(self, rendering) -> None:
        self.rendering = rendering

    def texts(self) -> list[str]:
        return [widget.unsafe_innerHTML or "" for widget in self.rendering.find(HTML).widgets]

    def reading(self, name: str) -> str:
        return next(text for text in self.texts() if text.startswith(f"{name}<b>"))[len(name) + 3 : -4]

    def click(self, label: str) -> None:
        button = next(b for b in self.rendering.find(v.Btn).widgets if label in b.children)
        assert not button.disabled
        button.click()

    def slider(self, name: str) -> v.Slider:
        ranged = [p.name for p in parameters_of(FireFighting).values() if isinstance(p.control, Slider)]
        return self.rendering.find(v.Slider).widgets[ranged.index(name)]

    def errors(self) -> list[str]:
        return [str(alert.children[0]) for alert in self.rendering.find(v.Alert).widgets]


@contextmanager
def open_page(element=None):
    _, rendering = solara.render(element or app.Page(), handle_error=False)
    try:
        yield Page(rendering)
    finally:
        rendering.close()


def wait_until(condition, seconds: float = 10.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def players() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "play"]


def test_the_page_shows_the_world_and_a_control_for_every_parameter():
    with open_page() as page:
        assert any(text.startswith("<svg") for text in page.texts())
        captions = " ".join(text for text in page.texts() if text.startswith("<span>"))
        assert all(f"<span>{name} " in captions for name in parameters_of(FireFighting))
        assert page.reading("Fires burning") == "7 of 7"


def test_step_advances_by_one_step_and_reset_returns_to_the_start():
    with open_page() as page:
        page.click("Step")
        page.click("Step")
        assert page.reading("Step") == "2"
        page.click("Reset")
        assert page.reading("Step") == "0"


def test_play_advances_until_pause():
    with open_page() as page:
        page.click("Play")
        wait_until(lambda: page.reading("Step") != "0")
        page.click("Pause")
        wait_until(lambda: not players())
        at_rest = page.reading("Step")
        time.sleep(0.2)
        assert page.reading("Step") == at_rest


def test_reset_while_playing_leaves_the_new_model_untouched():
    with open_page() as page:
        for _ in range(5):
            page.click("Play")
            time.sleep(0.03)
            page.click("Reset")
            time.sleep(0.08)
            assert page.reading("Step") == "0"


def test_closing_the_page_ends_its_thread():
    with open_page() as page:
        page.click("Play")
        wait_until(players)
    wait_until(lambda: not players())


def test_playing_stops_by_itself_when_the_model_is_done():
    run = Session(FireFighting)
    run.wishes |= {"initial_temperature": 0.01, "n_robots": 50}
    run.reset()
    run.speed = 100
    run.play(lambda: None)
    wait_until(lambda: not run.frame.playing)
    assert not run.model.running
    assert run.model.fires_burning == 0
    assert not run.frame.error
    steps = run.model.steps
    run.play(lambda: None)
    wait_until(lambda: not run.frame.playing)
    assert run.model.steps == steps


def test_loads_are_drawn_where_they_lie_and_not_among_the_obstacles():
    class Hauling(SwarmModel):
        def __init__(self, *, rng=None):
            super().__init__(rng=rng)
            self.add_load(disc((100, 100), 20), resistance=1)

    run = Session(Hauling)
    run.step()
    assert not run.frame.error
    assert 'class="load"' in run.frame.svg
    before = run.frame.svg
    run.model.loads[0].lay((130.0, 100.0, 0.0))
    run.step()
    assert run.frame.svg != before
    assert run.frame.svg.count('class="load"') == 1


def test_reset_with_the_same_seed_gives_the_same_run():
    run = Session(FireFighting)
    hashes = []
    for _ in range(2):
        run.reset()
        for _ in range(20):
            run.step()
        hashes.append(run.model.state_hash())
    run.seed = 2
    run.reset()
    assert hashes[0] == hashes[1] != run.model.state_hash()


def test_looking_at_a_run_does_not_change_it():
    watched, alone = Session(FireFighting), FireFighting(rng=1)
    for _ in range(50):
        watched.step()
    alone.run(50)
    alone.sense()
    assert watched.model.state_hash() == alone.state_hash()


def test_two_pages_do_not_share_a_model():
    with open_page() as first, open_page() as second:
        first.click("Step")
        assert (first.reading("Step"), second.reading("Step")) == ("1", "0")


def test_another_model_starts_afresh():
    with open_page() as page:
        page.click("Step")
        page.rendering.find(v.Select, label="Model").widget.v_model = "collision_avoidance"
        assert page.reading("Step") == "0"
        assert not any(text.startswith("Fires burning") for text in page.texts())


def test_drawing_a_slider_leaves_every_default_as_it_is():
    for name in model_names():
        for parameter in parameters_of(app.find_model(name)).values():
            if isinstance(parameter.control, Slider):
                assert app.value_at(0, parameter) == pytest.approx(parameter.default, abs=1e-12)
                assert type(app.value_at(1, parameter)) is parameter.kind


def test_a_slider_reaches_both_ends_of_its_range_and_nothing_beyond():
    share = Parameter("share", 0.34, float, Slider(0, 1, 0.1))
    assert (app.value_at(-4, share), app.value_at(7, share)) == (0, 1)


def test_the_constants_of_the_fire_change_during_the_run_and_others_on_reset():
    run = Session(FireFighting)
    model = run.model
    run.change("k1", 0.002)
    run.change("n_robots", 3)
    assert (model.fire_constants.k1, len(model.swarm)) == (0.002, 10)
    run.reset()
    assert len(run.model.swarm) == 3


def test_a_slider_moves_its_constant():
    with open_page() as page:
        page.slider("k1").v_model = 3
        assert any(text.startswith("<span>k1 0.0006466") for text in page.texts())


def test_constants_that_contradict_each_other_are_said_in_one_line_and_can_be_mended():
    run = Session(FireFighting)
    run.change("join", 300.0)
    assert run.frame.error.startswith("join is 300 and leave 100")
    run.reset()
    assert run.frame.error.startswith("join is 300 and leave 100")
    assert run.frame.svg
    run.change("leave", 400.0)
    assert (run.model.fire_constants.join, run.frame.error) == (300, "")


def test_a_seed_that_is_none_is_said_in_one_line():
    run = Session(FireFighting)
    run.seed = -1
    run.reset()
    assert run.frame.error.startswith("rng is -1; expected a whole number")


class Breaks(FireFighting):
    """Breaks in its third step."""

    def step(self) -> None:
        if self.steps == 3:
            raise ZeroDivisionError("nothing left\nto share")
        super().step()


def test_an_error_in_a_step_is_shown_and_reset_starts_again(monkeypatch):
    monkeypatch.setattr(app, "find_model", lambda name: Breaks)
    with open_page() as page:
        page.click("Play")
        wait_until(page.errors)
        assert page.errors() == ["ZeroDivisionError: nothing left; Reset starts again"]
        wait_until(lambda: not players())
        page.click("Reset")
        assert page.errors() == []
        page.click("Step")
        assert page.reading("Step") == "1"


def test_a_model_that_cannot_be_built_leaves_a_page_that_says_so(monkeypatch):
    def broken(*, n_robots: int = 10, rng=None):
        raise InvalidValueError("no room")

    run = Session(broken)
    assert (run.frame.svg, run.frame.error) == ("", "no room")
    run.step()
    assert run.frame.error


def test_the_drawing_is_made_only_of_what_is_asked_for():
    run = Session(FireFighting)
    assert 'class="blind"' in run.frame.svg
    run.show_sectors(False)
    assert 'class="blind"' not in run.frame.svg


def test_solara_is_told_not_to_call_home():
    from solara.server import settings  # noqa: PLC0415 - what the page has set

    assert not settings.telemetry.mixpanel_enable
    assert settings.main.mode == "production"


def test_an_occupied_port_is_said_in_one_line():
    with socket.socket() as listener:
        listener.bind((HOST, 0))
        listener.listen()
        port = listener.getsockname()[1]
        with pytest.raises(SwarmError, match=rf"^port {port} of 127.0.0.1 cannot be used .*another one$"):
            launch(port=port, open_browser=False)


def test_an_unknown_model_and_an_impossible_port_are_refused():
    with pytest.raises(UnknownNameError, match="did you mean 'fire_fighting'"):
        launch("fire_fightin", open_browser=False)
    with pytest.raises(InvalidValueError, match="port is 70000"):
        launch(port=70000, open_browser=False)
