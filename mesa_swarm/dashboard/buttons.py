# ruff: noqa: N802 - Solara's components are named like classes
"""Buttons of the page, plain ones: Vuetify's are made for phones."""

from collections.abc import Callable

import solara
from reacton import ipyvuetify as rv


@solara.component
def Button(
    label: str, act: Callable[[], object], class_: str = "", pressed: bool | None = None, enabled: bool = True
) -> None:
    """Show a button; of those that are pressed or not, whether this one is."""
    about = {"type": "button"} | ({} if enabled else {"disabled": True})
    if pressed is not None:
        about["aria-pressed"] = "true" if pressed else "false"
    button = rv.Html(tag="button", class_=class_, attributes=about, children=[label])
    rv.use_event(button, "click", lambda *_: act())


@solara.component
def Item(name: str, act: Callable[[], object], more: str = "", chosen: bool = False) -> None:
    """Show one line of a list as a button."""
    about = {"type": "button"} | ({"aria-current": "true"} if chosen else {})
    children = [name, rv.Html(tag="small", children=[more])] if more else [name]
    button = rv.Html(tag="button", attributes=about, children=children)
    rv.use_event(button, "click", lambda *_: act())
