"""Panels of a model's own on the page: drawn anew while it is played, and shown as an error where they fail."""

import ipyvuetify
import pytest
import solara

from mesa_swarm import AGENT9, Looks, SwarmModel
from mesa_swarm.dashboard import app
from mesa_swarm.dashboard.app import EVERY, Beat
from mesa_swarm.dashboard.page.session import Session


@solara.component
def Steps(model):  # noqa: N802 - a component is named like a class
    clicks, _ = solara.use_state(7)
    solara.Button(f"step {model.steps}, {clicks}")


def fails(model):
    raise ValueError("no data")


class Panelled(SwarmModel):
    """One robot, two panels."""

    looks = Looks(panels=(Steps, fails))

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, 1)


@pytest.fixture
def session():
    session = Session("panelled", find=lambda name: Panelled)
    yield session
    session.close()


def labels(context) -> list[str]:
    return [button.children[0] for button in context.find(ipyvuetify.Btn).widgets]


def test_panels_are_called_with_the_model_and_drawn_anew_after_a_step(session):
    _, context = solara.render(app.OwnPanels(session), handle_error=False)
    assert labels(context) == ["step 0, 7"]
    session.step()
    assert labels(context) == ["step 1, 7"]
    texts = [widget.children[0] for widget in context.find(ipyvuetify.Html, tag="p").widgets]
    assert texts == ["test_own_panels.py, line 20: ValueError: no data"]
    context.close()
    assert session.viewers == ()


def test_a_model_without_looks_has_no_panels():
    session = Session("boids", {"n_robots": 4})
    _, context = solara.render(app.OwnPanels(session), handle_error=False)
    assert labels(context) == []
    context.close()
    session.close()


def test_panels_are_drawn_at_most_twice_a_second_while_the_model_is_played(session, monkeypatch):
    now, heard = [100.0], []
    beat = Beat(session, clock=lambda: now[0])
    beat.changed.add(lambda: heard.append(now[0]))
    monkeypatch.setattr(Session, "playing", True)
    for _ in range(12):
        beat.push(1, session.past.shown)
        now[0] += EVERY / 4
    assert heard == [100.0, 100.0 + EVERY, 100.0 + 2 * EVERY]
