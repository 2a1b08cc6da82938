"""The panel that explains the model: what it is, what to try at a press, how it works, its equations and code."""

import re
from collections.abc import Mapping
from functools import cache, partial
from html import escape
from typing import Any

import solara
from latex2mathml.converter import convert
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import PythonLexer
from reacton import ipyvuetify as rv

from mesa_swarm.dashboard.page.session import Session, checked_setting
from mesa_swarm.dashboard.page.widgets import Button
from mesa_swarm.model.engine_model import EngineModel
from mesa_swarm.model.info import Equation, Listing, ModelInfo, Preset, model_info
from mesa_swarm.viewing.error_lines import reported
from mesa_swarm.viewing.play_loop import use_changes

# Words of docstrings between such quotes are names.
QUOTED = re.compile(r"`([^`]+)`")
# Attributes of what may be wider than the panel: it can be scrolled by keys.
SCROLLED = 'tabindex="0" role="group"'


@solara.component
def Info(session: Session) -> None:
    """Show what the session's model is, and buttons that set, reset and play what there is to try."""
    use_changes(session.changed)
    about, fault = solara.use_memo(lambda: _info_of(session), [session.model_class, _drivers(session)])
    with rv.Html(tag="details", class_="swarm-info", attributes={"open": True}):
        rv.Html(tag="summary", children=["About this model"])
        if about is None:
            rv.Html(tag="p", class_="swarm-fault", children=[fault])
        else:
            Explained(session, about)


@solara.component
def Explained(session: Session, about: ModelInfo) -> None:
    """Show all that is known about a model."""
    Fixed(prose(about.what))
    if about.presets:
        Presets(session, about)
    more = {"How it works": prose(about.how), "What to watch": prose(about.watch)}
    more["Equations"] = "".join(map(draw_equation, about.equations))
    more["Source"] = prose(about.source)
    for title, text in more.items():
        if text:
            Folded(title, text).key(f"{about.name} {title}")
    Code(about).key(f"{about.name} code")
    StepPlan(session).key(f"{about.name} plan")


@solara.component
def StepPlan(session: Session) -> None:
    """Show the plan of a step, what of it is Python, and what to declare instead, once it is opened."""
    is_open, open_ = solara.use_state(False)
    with rv.Html(tag="details", class_="swarm-more") as details:
        rv.Html(tag="summary", children=["What a step does, and how fast"])
        if is_open:
            Fixed(draw_plan(session.model))
    rv.use_event(details, "toggle", lambda *_: open_(True))


@solara.component
def Presets(session: Session, about: ModelInfo) -> None:
    """Show a button for each preset, and one for the defaults."""
    use_changes(session.changed)
    fault, set_fault = solara.use_state("")

    def play(settings: Mapping[str, Any]) -> None:
        try:
            play_with(session, settings)
            set_fault("")
        except Exception as problem:  # settings may be refused by what the page limits
            set_fault(reported(problem))

    with rv.Html(tag="div", class_="swarm-try"):
        rv.Html(tag="h2", children=["Try"])
        for preset in about.presets:
            with rv.Html(tag="div").key(f"{about.name} {preset.label}"):
                Button(preset.label, partial(play, preset.settings), pressed=is_built(session, preset))
                rv.Html(tag="small", children=[preset.text])
        if any(is_built(session, preset) for preset in about.presets):
            Button("Play with the defaults", partial(play, {}), "swarm-plain").key(f"{about.name} defaults")
        if fault:
            rv.Html(tag="p", class_="swarm-fault", children=[fault])


@solara.component
def Code(about: ModelInfo) -> None:
    """Show the code of the rules and of the model; it is highlighted when it is opened first."""
    is_open, open_ = solara.use_state(False)
    with rv.Html(tag="details", class_="swarm-more") as details:
        rv.Html(tag="summary", children=["Code"])
        for listing in about.code if is_open else ():
            Fixed(draw_listing(listing)).key(f"{listing.module} {listing.name}")
    rv.use_event(details, "toggle", lambda *_: open_(True))


@solara.component
def Folded(title: str, text: str) -> None:
    """Show HTML that is folded at first."""
    with rv.Html(tag="details", class_="swarm-more"):
        rv.Html(tag="summary", children=[title])
        Fixed(text)


@solara.component
def Fixed(escaped: str) -> None:
    """Show HTML that `prose`, `draw_equation` or `draw_listing` made, in which texts are escaped."""
    solara.HTML(unsafe_innerHTML=escaped)


def play_with(session: Session, settings: Mapping[str, Any]) -> None:
    """Set these parameters, and all others to their defaults; build the model anew and play it."""
    new_settings = {name: checked_setting(session.parameters[name], value) for name, value in settings.items()}
    session.choose(session.name, new_settings)
    if not session.error:
        session.play()


def is_built(session: Session, preset: Preset) -> bool:
    """Return whether the present model has the settings of a preset."""
    defaults = {name: parameter.default for name, parameter in session.parameters.items()} | dict(preset.settings)
    return {name: session.built.get(name) for name in defaults} == defaults


def prose(text: str) -> str:
    """Return text as paragraphs of HTML."""
    paragraphs = (" ".join(part.split()) for part in re.split(r"\n\s*\n", text))
    html = "".join(f"<p>{escape(part)}</p>" for part in paragraphs if part)
    return QUOTED.sub(r"<code>\1</code>", html)


@cache
def draw_equation(equation: Equation) -> str:
    """Return an equation as MathML, and what its letters are; as LaTeX if it cannot be drawn."""
    # The converter does not escape what stands in \text.
    latex = equation.latex.replace("<", r"\lt ").replace(">", r"\gt ")
    try:
        markup = convert(latex, display="block")
    except Exception:  # text of a user's may be any LaTeX
        markup = f"<p><code>{escape(equation.latex)}</code></p>"
    return f'<div class="swarm-equation" {SCROLLED} aria-label="equation">{markup}</div>{prose(equation.text)}'


@cache
def draw_listing(listing: Listing) -> str:
    """Return code with its tokens marked by classes, folded under its name."""
    code = highlight(listing.code, PythonLexer(), HtmlFormatter(nowrap=True))
    head = f"{escape(listing.name)} <small>{escape(listing.module)}</small>"
    name = f'aria-label="code of {escape(listing.name)}"'
    box = f'<div class="swarm-code" {SCROLLED} {name}><pre>{code}</pre></div>'
    return f"<details><summary>{head}</summary>{box}</details>"


def draw_plan(model: Any) -> str:
    """Return the plan of a model's step as HTML."""
    if model is None:
        return ""
    plan = EngineModel.plan.function(model)  # which an attribute of a user's may hide
    return f'<div class="swarm-code" {SCROLLED} aria-label="plan of a step"><pre>{escape(str(plan))}</pre></div>'


def _drivers(session: Session) -> tuple:
    """Return what the code of a session's model depends on: the classes and rules of its layers."""
    layers = getattr(getattr(session.model, "control", None), "layers", ())
    return tuple((type(layer), layer.name) for layer in layers)


def _info_of(session: Session) -> tuple[ModelInfo | None, str]:
    """Return what is known about a session's model, or why it cannot be read."""
    try:
        return model_info(session.model if session.model is not None else session.model_class), ""
    except Exception as problem:  # a file of a user's may hold anything
        return None, reported(problem)
