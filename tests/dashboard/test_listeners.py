"""Listeners, and components that are drawn anew when listeners are notified."""

import solara

from mesa_swarm.viewing.play_loop import Listeners, use_changes


def drawn_while(change) -> list[str]:
    """Return what a component drew that began to listen only after something had changed."""
    state, drawn, listeners = ["looking"], [], Listeners()

    @solara.component
    def Noticing():  # noqa: N802 - Solara's components are named like classes
        solara.use_effect(lambda: change(state, listeners), [])  # effects run in turn: before it listens
        use_changes(listeners)
        drawn.append(state[0])
        solara.Text(state[0])

    _, context = solara.render(Noticing(), handle_error=False)
    context.close()
    assert len(listeners) == 0
    return drawn


def test_a_change_before_a_component_listened_is_shown_all_the_same():
    def change(state, listeners):
        state[0] = "found"
        listeners.notify()

    assert drawn_while(change)[-1] == "found"


def test_a_component_is_drawn_once_if_nothing_changed():
    assert drawn_while(lambda state, listeners: None) == ["looking"]


def test_a_listener_is_called_until_it_leaves_and_notifications_are_counted():
    heard, listeners = [], Listeners()
    leave = listeners.add(heard.append)
    listeners.notify("hello")
    leave()
    listeners.notify("hello again")
    assert (heard, listeners.count) == (["hello"], 2)
