"""The canvas in notebooks and on Mesa's own page, driven without a browser."""

import asyncio
import sys
import time
from types import SimpleNamespace

import pytest
import reacton
import solara

from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.viewing import last_picture
from mesa_swarm.viewing.canvas_widget import (
    EVERY,
    SPEEDS,
    SwarmCanvas,
    nearest_speed,
    rate_text,
    speed_text,
    swarm_canvas,
)
from mesa_swarm.viewing.play_loop import AS_FAST_AS_IT_GOES


@pytest.fixture
def sent(monkeypatch):
    """What canvases send to the browser: kinds, and steps of pictures."""
    messages = []
    monkeypatch.setattr(SwarmCanvas, "send", lambda self, message, buffers=None: messages.append(message))
    return messages


@pytest.fixture
def canvases(monkeypatch):
    """All canvases that were connected with a model."""
    known, show_state = [], SwarmCanvas.show_state

    def noting(self, **state):
        if self not in known:
            known.append(self)
        show_state(self, **state)

    monkeypatch.setattr(SwarmCanvas, "show_state", noting)
    return known


def steps(sent) -> list[int]:
    return [message["step"] for message in sent if message["kind"] == "picture"]


def drawn(canvas, number: int) -> None:
    canvas._hear({"do": "drawn", "value": number})


def test_a_model_in_a_notebook_is_a_widget_with_a_picture_for_where_none_can_live():
    bundle, _ = FireFighting(n_robots=3, rng=1).show()._repr_mimebundle_()
    assert "application/vnd.jupyter.widget-view+json" in bundle
    assert bundle["image/png"].startswith(b"\x89PNG") or bundle["image/png"].startswith("iVBOR")


def test_a_widget_sends_nothing_before_it_is_shown_and_then_the_world_and_a_picture(sent):
    canvas = FireFighting(n_robots=3, rng=1).show()
    assert sent == []
    canvas._hear({"do": "ready"})
    assert [message["kind"] for message in sent] == ["state", "world", "picture"]


def test_steps_that_a_program_takes_are_shown_and_the_last_one_when_the_browser_can(sent):
    model = FireFighting(n_robots=3, rng=1)
    canvas = model.show()
    canvas._hear({"do": "ready"})
    for _ in range(5):
        time.sleep(EVERY)
        model.run(10)
    assert len(steps(sent)) == 2, "no more than two are on their way"
    drawn(canvas, 2)
    assert steps(sent)[-1] > 10
    while steps(sent)[-1] < 50:
        drawn(canvas, len(steps(sent)))
    assert steps(sent)[-1] == 50


def test_the_buttons_of_a_widget_step_the_model_itself(sent):
    model = FireFighting(n_robots=3, rng=1)
    canvas = model.show()
    canvas._hear({"do": "ready"})
    canvas._hear({"do": "step"})
    assert model.steps == 1
    canvas._hear({"do": "reset"})
    canvas._hear({"do": "close"})
    assert model.steps == 1, "what is not a button does nothing"


def test_what_a_model_of_ones_own_has_collected_is_kept_however_long_it_is_played(sent, monkeypatch):
    monkeypatch.setattr("mesa_swarm.viewing.player.MOST_COLLECTED", 5)
    model = FireFighting(n_robots=3, rng=1)
    canvas = model.show()
    canvas._hear({"do": "ready"})
    for _ in range(12):
        canvas._hear({"do": "step"})
    assert len(model.datacollector.model_vars["collisions"]) == 12


def test_speeds_and_rates_are_shown_in_words():
    assert SPEEDS[nearest_speed(55)] == 60.0
    assert [speed_text(speed) for speed in (0.5, AS_FAST_AS_IT_GOES)] == ["0.5 steps/s", "as fast as it goes"]
    assert [rate_text(rate) for rate in (0.0, 0.512, 1234.5)] == ["at rest", "0.51", "1,234"]


@pytest.mark.parametrize("wrong", [{"speed": 0}, {"speed": 2000}, {"height": 5}])
def test_a_speed_or_height_that_cannot_be_is_refused(wrong):
    with pytest.raises(InvalidValueError):
        FireFighting(n_robots=3, rng=1).show(**wrong)


@pytest.mark.filterwarnings("ignore::UserWarning", "ignore::DeprecationWarning", "ignore::FutureWarning")
def test_mesas_own_page_takes_the_canvas_as_a_component(sent, canvases):
    from mesa.visualization import SolaraViz  # noqa: PLC0415 - its import warns of what Mesa and Solara do

    _, page = reacton.render(SolaraViz(FireFighting(n_robots=3, rng=1), components=[swarm_canvas]), handle_error=False)
    try:
        (canvas,) = canvases
        canvas._hear({"do": "ready"})
        assert steps(sent) == [0]
        assert canvas.options["bar"] is False
    finally:
        page.close()


def test_on_mesas_page_each_new_occasion_shows_the_model_as_it_is_then(sent, canvases):
    model = FireFighting(n_robots=3, rng=1)
    turn = solara.reactive(0)

    @solara.component
    def Page():  # noqa: N802 - Solara's components are named like classes
        solara.Text(str(turn.value))
        swarm_canvas(model)

    _, page = reacton.render(Page(), handle_error=False)
    try:
        (canvas,) = canvases
        canvas._hear({"do": "ready"})
        model.step()
        turn.value += 1
        assert steps(sent) == [0, 1]
        assert canvases == [canvas]
    finally:
        page.close()


# Several views of one canvas: an output may be shown twice, and in two windows.


class Clock:
    """Seconds that a test sets."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def canvas(sent):
    shown = FireFighting(n_robots=3, rng=1).show()
    shown.clock = Clock()
    shown._hear({"do": "ready", "view": "a"})
    return shown


def answer(canvas, view: str, number: int) -> None:
    canvas._hear({"do": "drawn", "view": view, "value": number})


def play_step(canvas, number: int) -> None:
    """Push a frame as a player that is playing does."""
    canvas.push(number, canvas._frame, rest=False)


def pictures(sent) -> list[tuple[int, str]]:
    return [(one["number"], one.get("to", "")) for one in sent if one["kind"] == "picture"]


def test_a_view_that_opens_later_gets_the_state_the_world_and_the_frame_and_the_others_nothing(sent, canvas):
    canvas.commands["step"]()
    canvas.commands["speed"](3)
    del sent[:]
    canvas._hear({"do": "ready", "view": "b"})
    assert [(one["kind"], one["to"]) for one in sent] == [("state", "b"), ("world", "b"), ("picture", "b")]
    assert (sent[0]["state"]["playing"], sent[0]["state"]["speed"], sent[2]["step"]) == (False, 3, 1)


def test_a_faster_view_waits_for_a_slower_one_but_not_for_one_that_does_not_answer(sent, canvas):
    canvas._hear({"do": "ready", "view": "b"})
    answer(canvas, "a", 1)
    answer(canvas, "b", 1)
    for number in range(10, 14):
        play_step(canvas, number)
        answer(canvas, "a", canvas._sent)
    assert canvas._sent == 3, "two frames are on their way to the slower view"
    assert not canvas.ready
    answer(canvas, "b", 2)
    assert canvas._sent == 4
    answer(canvas, "a", 4)
    canvas.clock.now += 10
    assert canvas.ready
    for number in range(20, 24):
        play_step(canvas, number)
        answer(canvas, "a", canvas._sent)
    assert canvas._sent == 8
    answer(canvas, "b", 8)
    play_step(canvas, 30)
    play_step(canvas, 31)
    answer(canvas, "a", canvas._sent)
    assert not canvas.ready, "it answers again, and is waited for again"


def test_to_a_view_that_answers_rarely_as_many_more_frames_are_sent(sent, canvas):
    canvas._hear({"do": "drawn", "view": "a", "value": 1, "each": 3})
    for number in range(10, 20):
        play_step(canvas, number)
    assert canvas._sent == 5, "four are on their way: two, and two for which there is no answer"
    canvas._hear({"do": "drawn", "view": "a", "value": 4, "each": 1})
    play_step(canvas, 30)
    play_step(canvas, 31)
    assert canvas._sent == 6, "only two again"


@pytest.mark.parametrize("each", [0, -5, 10**9, "3", None, 2.5, True])
def test_nonsense_in_an_answer_changes_at_most_how_many_frames_are_on_their_way(sent, canvas, each):
    canvas._hear({"do": "drawn", "view": "a", "value": 1, "each": each})
    for number in range(10, 40):
        play_step(canvas, number)
    assert 3 <= canvas._sent <= 6


def test_a_frame_at_rest_reaches_every_view_that_can_draw_it(sent, canvas):
    canvas._hear({"do": "ready", "view": "hidden"})
    answer(canvas, "a", 1)
    for _ in range(5):
        canvas.commands["step"]()
        answer(canvas, "a", canvas._sent)
    assert [one["step"] for one in sent if one["kind"] == "picture"][-1] == 5


def test_a_view_that_was_closed_is_not_waited_for(sent, canvas):
    canvas._hear({"do": "ready", "view": "b"})
    answer(canvas, "a", 1)
    play_step(canvas, 10)
    answer(canvas, "a", 2)
    assert not canvas.ready
    canvas._hear({"do": "left", "view": "b"})
    assert canvas.ready
    canvas._hear({"do": "left", "view": "a"})
    assert not canvas.ready, "no browser shows it"


def test_without_an_answer_of_any_view_no_frame_is_sent(sent, canvas):
    for number in range(10, 20):
        play_step(canvas, number)
        canvas.clock.now += 60
    assert len(pictures(sent)) == 2


# The stored picture.


def test_a_displayed_widget_stores_the_picture_that_stands_in_for_it():
    canvas = FireFighting(n_robots=3, rng=1).show()
    assert canvas.picture == ""
    canvas._repr_mimebundle_()
    assert canvas.picture.startswith("data:image/png;base64,iVBOR")
    assert len(canvas.picture) <= last_picture.MOST_CHARACTERS


def test_the_picture_is_drawn_anew_at_rest_only_and_if_the_model_has_changed(monkeypatch):
    canvas = FireFighting(n_robots=3, rng=1).show()
    player = canvas.commands["step"].__self__
    (picture,) = [viewer for viewer in player.viewers if isinstance(viewer, last_picture.LastPicture)]
    drawn = []
    monkeypatch.setattr(last_picture, "png", lambda figure, dots=0: drawn.append(dots) or b"PNG")
    picture.draw()
    assert drawn == [], "it is not displayed yet"
    canvas.still()
    picture.draw()
    assert len(drawn) == 1
    player.step()
    picture.after_cell()
    assert len(drawn) == 2
    monkeypatch.setattr(type(player), "playing", True)
    player.model.step()
    picture.draw()
    assert len(drawn) == 2


def test_a_large_picture_is_stored_with_fewer_pixels_or_not_at_all(monkeypatch):
    canvas = FireFighting(n_robots=3, rng=1).show()
    monkeypatch.setattr(last_picture, "png", lambda figure, dots=200: bytes(int(dots) * 3000))
    assert len(canvas.still()) == 600_000, "the one that is displayed is not limited"
    assert len(canvas.picture) == len(last_picture.png_address(bytes(150_000)))
    monkeypatch.setattr(last_picture, "png", lambda figure, dots=200: bytes(300_000))
    canvas.still()
    assert canvas.picture == ""


def test_in_a_notebook_it_is_drawn_a_moment_after_the_last_step_and_after_each_cell(monkeypatch):
    drawn, hooks = [], {}
    monkeypatch.setattr(last_picture, "DELAY", 0.0)
    monkeypatch.setattr(last_picture, "png", lambda figure, dots=0: drawn.append(dots) or b"PNG")
    events = SimpleNamespace(register=hooks.__setitem__, unregister=lambda name, function: hooks.pop(name))
    shell = SimpleNamespace(get_ipython=lambda: SimpleNamespace(events=events))
    monkeypatch.setitem(sys.modules, "IPython", shell)

    async def cells() -> None:
        model = FireFighting(n_robots=3, rng=1)
        canvas = model.show()
        canvas.still()
        canvas.commands["step"]()
        canvas.commands["step"]()
        while len(drawn) < 2:
            await asyncio.sleep(0)
        model.step()
        hooks["post_run_cell"](None)
        assert len(drawn) == 3
        canvas.close()
        hooks["post_run_cell"](None)
        assert hooks == {}

    asyncio.run(cells())


@pytest.mark.parametrize("wrong", [{"width": 5}, {"controls": "noise"}, {"charts": 3}, {"controls": [1]}])
def test_an_option_that_cannot_be_is_refused(wrong):
    with pytest.raises(InvalidValueError):
        FireFighting(n_robots=3, rng=1).show(**wrong)


def test_the_output_has_the_given_size():
    layout = FireFighting(n_robots=3, rng=1).show(width=600, height=300).layout
    assert (layout.width, layout.height, layout.max_width) == ("600px", "300px", "100%")
