"""The list of events on the Watch page: counts, and steps that can be gone to."""

import ipyvuetify
import pytest
import solara

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.dashboard.app import MOST_LISTED, EventList, EventNews, go_to
from mesa_swarm.dashboard.page.session import Session


class Delivering(SwarmModel):
    """Robots one of which delivers something in every second step."""

    def __init__(self, *, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT9, 2)

    def step(self):
        super().step()
        if self.steps % 2 == 0:
            self.event("delivered", robot=self.robots[0], value=2.0)


@pytest.fixture
def session():
    session = Session("delivering", find=lambda name: Delivering)
    yield session
    session.close()


def buttons(context) -> list[str]:
    return words_of(context, "button")


def words_of(context, tag: str) -> list[str]:
    return [widget.children[0] for widget in context.find(ipyvuetify.Html, tag=tag).widgets]


def test_a_model_without_events_has_no_list(session):
    _, context = solara.render(EventList(session), handle_error=False)
    session.step()
    assert not buttons(context)
    context.close()


def test_the_last_events_are_listed_newest_first_with_their_counts(session):
    _, context = solara.render(EventList(session), handle_error=False)
    for _ in range(2 * MOST_LISTED + 6):
        session.step()
    steps = [f"step {step}" for step in range(2 * MOST_LISTED + 6, 6, -2)]
    assert buttons(context) == steps
    assert words_of(context, "p") == [f"delivered {MOST_LISTED + 3}"]
    robot = session.model.robots[0].unique_id
    assert words_of(context, "small")[0] == f"delivered: robot {robot}, value 2"
    context.close()


def test_pressing_a_step_displays_it(session):
    for _ in range(8):
        session.step()
    go_to(session, 4)
    assert session.past.shown.step == 4
    session.step()
    assert session.past.shown.step == 5


def test_of_a_step_that_is_not_stored_the_next_stored_one_is_displayed(session):
    for _ in range(3):
        session.model.step()
    session.step()
    for _ in range(3):
        session.model.step()
    session.step()
    go_to(session, 6)
    assert session.past.shown.step == 8


def test_the_list_is_drawn_anew_only_for_other_events(session):
    news, times = EventNews(session), []
    stop = news.begin()
    news.changed.add(lambda: times.append(session.model.completed))
    for _ in range(5):
        session.step()
    assert times == [2, 4]
    stop()
