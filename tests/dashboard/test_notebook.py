"""The canvas in notebooks and on Mesa's own page, driven without a browser."""

import time

import pytest
import reacton
import solara

from mesa_swarm.errors import InvalidValueError
from mesa_swarm.models.fire_fighting import FireFighting
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
