"""The list of what happened in the run so far: the model's events, with steps that can be gone to."""

from collections.abc import Callable
from functools import partial

import solara
from reacton import ipyvuetify as rv

from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.page.widgets import Button
from mesa_swarm.viewing.play_loop import Listeners, use_changes
from mesa_swarm.viewing.player import PackedFrame

# Of the last events, and of names.
MOST_LISTED, MOST_NAMES = 8, 12


class EventNews:
    """Notifies when the events of a session are others, or are stored for other steps."""

    ready = False  # a list alone needs no picture

    def __init__(self, session: Session) -> None:
        self.changed = Listeners()
        self._session, self._state = session, (0, 0)

    def begin(self) -> Callable[[], None]:
        """Notify from now on, until what is returned is called."""
        self._session.add_viewer(self)
        return partial(self._session.remove_viewer, self)

    def push(self, number: int, frame: PackedFrame) -> None:
        """Notify, if there is something new."""
        model = self._session.model
        state = (id(model), 0 if model is None else len(model.events))
        if state != self._state:
            self._state = state
            self.changed.notify()


def go_to(session: Session, step: int) -> None:
    """Display the first stored step that is not before this one."""
    session.pause()
    with session.lock:
        past = session.recent
        past.look_at(step)
        moment = past.shown
        if moment is not None and moment.step < step:
            past.look(past.index + 1)
    session.rest()


@solara.component
def EventList(session: Session) -> None:
    """Show how many events of each name there were, and the last ones; nothing for models without events."""
    use_changes(session.changed)
    news = solara.use_memo(lambda: EventNews(session), [])
    solara.use_effect(news.begin, [])
    use_changes(news.changed)
    with session.lock:
        model, past = session.model, session.past
        if model is None or not len(model.events):
            return
        counts = model.events.counts
        last = model.events.rows(max(0, len(model.events) - MOST_LISTED))[::-1]
        first_step, last_step = past.first_step, past.last_step
    with solara.Div(classes=["swarm-happened"]):
        solara.HTML(tag="h2", unsafe_innerHTML="Events")
        names = [f"{name} {count:,}" for name, count in list(counts.items())[:MOST_NAMES]]
        more = f", and {len(counts) - MOST_NAMES} more names" if len(counts) > MOST_NAMES else ""
        rv.Html(tag="p", children=[", ".join(names) + more])
        with solara.Div(classes=["swarm-list"]):
            for place, (step, name, robot, value) in enumerate(last):
                text = event_text(name, robot, value)
                is_stored = first_step <= step <= last_step
                Button(f"step {step:,}", partial(go_to, session, step), more=text, enabled=is_stored).key(f"{place}")
        if last[-1][0] < first_step:
            text = f"Steps {first_step:,} to {last_step:,} are in memory."
            rv.Html(tag="p", class_="swarm-hint", children=[text])


def event_text(name: str, robot: int, value: float) -> str:
    """Return an event in words.

    Examples
    --------
    >>> event_text("delivered", 7, 2.0), event_text("opened", -1, 1.0)
    ('delivered: robot 7, value 2', 'opened')
    """
    parts = [*([f"robot {robot}"] if robot >= 0 else []), *([f"value {value:g}"] if value != 1.0 else [])]
    return f"{name}: {', '.join(parts)}" if parts else name
