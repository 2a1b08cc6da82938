# ruff: noqa: N802 - Solara's components are named like classes
"""Buttons of the page, plain ones, for Vuetify's are made for phones; and the card on which trouble is told."""

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


@solara.component
def TroubleCard(title: str, *texts: str, way_out: tuple[str, Callable[[], object]] | None = None) -> None:
    """Show what went wrong, and a button that leads out of it."""
    with rv.Html(tag="section", class_="swarm-trouble", attributes={"role": "alert"}):
        if title:
            rv.Html(tag="h2", children=[title])
        for text in texts:
            rv.Html(tag="p", children=[text])
        if way_out:
            label, act = way_out
            solara.Button(label, act, color="primary")
