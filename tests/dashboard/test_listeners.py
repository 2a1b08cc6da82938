"""Components that are drawn anew when something is told."""

import solara

from mesa_swarm.viewing.play_loop import Listeners, use_changes


def drawn_while(change) -> list[str]:
    """Return what a component drew that began to listen only after something had changed."""
    state, drawn, listeners = ["looking"], [], Listeners()

    @solara.component
    def Told():  # noqa: N802 - Solara's components are named like classes
        solara.use_effect(lambda: change(state, listeners), [])  # effects run in turn: before anybody listens
        use_changes(listeners)
        drawn.append(state[0])
        solara.Text(state[0])

    _, context = solara.render(Told(), handle_error=False)
    context.close()
    assert len(listeners) == 0
    return drawn


def test_what_was_told_before_a_component_listened_is_shown_all_the_same():
    def change(state, listeners):
        state[0] = "found"
        listeners.notify()

    assert drawn_while(change)[-1] == "found"


def test_a_component_is_drawn_once_if_nothing_was_told():
    assert drawn_while(lambda state, listeners: None) == ["looking"]
