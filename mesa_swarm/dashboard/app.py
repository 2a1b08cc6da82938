# ruff: noqa: N802 - Solara's components are named like classes
"""The page: a world that one can play, and a slider for everything that its model lets one change.

Every browser session builds its own `Session`; nothing is shared between them.
"""

import math
import os
from collections.abc import Callable
from typing import Any

import reacton.ipyvuetify as rv
import solara
from solara.server import settings

from mesa_swarm.dashboard import FIRST, MODEL_VARIABLE
from mesa_swarm.dashboard.session import LIVE, Frame, Session
from mesa_swarm.gallery import find_model, model_names
from mesa_swarm.parameters import Choice, Parameter, Slider, parameters_of

SPEED = Parameter("speed", Session.speed, int, Slider(1, 100, 1, "steps a frame, up to 20 frames a second"))
CSS = """
.swarm { display: grid; grid-template: 100vh / 300px 1fr; font-size: 14px; line-height: 1.3; }
.swarm-controls { overflow-y: auto; padding: 10px 16px 20px; border-right: 1px solid #ddd; background: #fafaf8; }
.swarm-controls h1 { font-size: 20px; margin-bottom: 8px; }
.swarm-controls h2 { font-size: 15px; margin: 6px 0 2px; border-top: 1px solid #ddd; padding-top: 8px; }
.swarm-controls small { color: #5c5c5c; display: block; font-size: 12px; }
.swarm-controls .v-sheet { row-gap: 0 !important; background: none; }
.swarm-controls .v-text-field__details { display: none; }
.swarm-controls .v-input { margin: 0 0 4px; padding-top: 0; font-size: 14px; }
.swarm-controls .v-input__slider { margin: -6px -8px -4px; }
.swarm-controls .v-input--checkbox .v-messages { display: none; }
.swarm-name { display: flex; justify-content: space-between; font-weight: 600; margin-top: 5px; }
.swarm-name i { font-weight: 400; font-size: 12px; color: #8a4b00; }
.swarm-stage { display: flex; flex-direction: column; min-width: 0; padding: 10px 16px; }
.swarm-bar { display: flex; flex-wrap: wrap; align-items: center; gap: 6px 24px; margin-bottom: 8px; }
.swarm-buttons { display: flex; gap: 6px; }
.swarm-reading { min-width: 64px; color: #5c5c5c; }
.swarm-reading b { display: block; font-size: 16px; color: #1d1f23; font-variant-numeric: tabular-nums; }
.swarm-world { flex: 1; min-height: 0; }
.swarm-world svg { width: 100%; height: 100%; display: block; }
"""

# Of itself Solara reports its use, has the browser ask solara.dev whether it works, and keeps a page that vanished
# without a word (its model plays on) for a day.
settings.telemetry.mixpanel_enable = False
settings.main.mode = "production"
settings.kernel.cull_timeout = "10m"
settings.theme.show_banner = False


@solara.component
def Layout(children: list):
    """Show the page and nothing else: no bar of Solara's above it."""
    solara.Div(children=children)


@solara.component
def Page():
    """Show one model at a time; another one starts from its defaults."""
    name, choose = solara.use_state(os.environ.get(MODEL_VARIABLE, FIRST))
    solara.Title("mesa_swarm")
    solara.Style(CSS)
    Dashboard(name, choose).key(name)


@solara.component
def Dashboard(name: str, choose: Callable[[str], None]):
    """Show the controls on the left and the world on the right.

    The session's latest frame is what is drawn; `shown` only tells when to draw.
    """
    session = solara.use_memo(lambda: Session(find_model(name)), [])
    shown = solara.use_reactive(session.frame)
    solara.use_effect(lambda: session.pause, [])  # on leaving the page or the model

    def redraw() -> None:
        shown.set(session.frame)

    with solara.Div(classes=["swarm"]):
        with solara.Div(classes=["swarm-controls"]):
            solara.HTML(tag="h1", unsafe_innerHTML="mesa_swarm")
            solara.Select("Model", model_names(), name, choose)
            General(session, redraw)
            solara.HTML(tag="h2", unsafe_innerHTML="Parameters")
            for parameter in parameters_of(session.model_class).values():
                ParameterControl(session, parameter, redraw)
        Stage(session, shown, redraw)


@solara.component
def General(session: Session, redraw: Callable[[], None]):
    """Show what every model has: speed, seed and whether sectors are drawn."""
    sectors, set_sectors = solara.use_state(session.sectors)
    seed, set_seed = solara.use_state(session.seed)

    def change_seed(value: int) -> None:
        session.seed = value
        set_seed(value)

    def change_sectors(value: bool) -> None:
        session.show_sectors(value)
        set_sectors(value)
        redraw()

    NumberSlider(SPEED, lambda value: setattr(session, "speed", value))
    Caption("seed", "", "the same seed gives the same run", live=False)
    solara.InputInt("", seed, change_seed)
    solara.Checkbox(label="sensor sectors", value=sectors, on_value=change_sectors)


@solara.component
def ParameterControl(session: Session, parameter: Parameter, redraw: Callable[[], None]):
    """Show a slider or a list for a parameter that has a range or choices, and nothing for others."""

    def change(value: Any) -> None:
        session.change(parameter.name, value)
        redraw()

    if isinstance(parameter.control, Slider):
        NumberSlider(parameter, change, live=parameter.name in LIVE)
    elif isinstance(parameter.control, Choice):
        ChoiceList(parameter, change)


@solara.component
def NumberSlider(parameter: Parameter, on_change: Callable[[float], None], live: bool = True):
    """Show a slider that counts its steps from the parameter's default.

    The browser moves a slider's value to the nearest step as soon as it is drawn: counted from anywhere else,
    that would change a default such as k1 = ln 2 / 1000 without being asked.
    """
    position, move = solara.use_state(0)
    slider = parameter.control

    def change(position: int) -> None:
        move(position)
        on_change(value_at(position, parameter))

    Caption(parameter.name, f"{value_at(position, parameter):.4g}", slider.help, live)
    rv.Slider(
        v_model=position,
        on_v_model=change,
        min=math.floor((slider.minimum - parameter.default) / slider.step),
        max=math.ceil((slider.maximum - parameter.default) / slider.step),
        step=1,
        hide_details=True,
    )


def value_at(position: int, parameter: Parameter) -> float:
    """Return the value so many of its slider's steps from a parameter's default, within the slider's range.

    Examples
    --------
    >>> share = Parameter("share", 0.75, float, Slider(0, 1, 0.1))
    >>> value_at(2, share), value_at(9, share)
    (0.95, 1.0)
    """
    slider = parameter.control
    value = min(max(parameter.default + position * slider.step, slider.minimum), slider.maximum)
    return parameter.kind(round(value, 12))


@solara.component
def ChoiceList(parameter: Parameter, on_change: Callable[[str], None]):
    """Show a list of a parameter's choices."""
    value, set_value = solara.use_state(parameter.default)

    def change(value: str) -> None:
        set_value(value)
        on_change(value)

    Caption(parameter.name, "", parameter.help, live=False)
    solara.Select("", list(parameter.control.options), value, change, dense=True)


@solara.component
def Caption(name: str, value: str, explanation: str, live: bool):
    """Show name, value and explanation of a control, and whether it waits for a reset."""
    mark = "" if live else "<i>on reset</i>"
    solara.HTML(classes=["swarm-name"], unsafe_innerHTML=f"<span>{name} {value}</span>{mark}")
    solara.HTML(tag="small", unsafe_innerHTML=explanation)


@solara.component
def Stage(session: Session, shown: solara.Reactive[Frame], redraw: Callable[[], None]):
    """Show buttons, numbers, what went wrong, and the world."""
    shown.get()  # subscribes; the session's frame is never older
    frame = session.frame
    with solara.Div(classes=["swarm-stage"]):
        with solara.Div(classes=["swarm-bar"]):
            Buttons(session, frame, redraw)
            for name, value in frame.readings:
                solara.HTML(classes=["swarm-reading"], unsafe_innerHTML=f"{name}<b>{value}</b>")
        if frame.error:
            solara.Error(frame.error, dense=True)
        solara.HTML(classes=["swarm-world"], unsafe_innerHTML=frame.svg)


@solara.component
def Buttons(session: Session, frame: Frame, redraw: Callable[[], None]):
    """Show play, pause, step and reset."""

    def then_redraw(action: Callable[[], None]) -> Callable[[], None]:
        return lambda: (action(), redraw())

    with solara.Div(classes=["swarm-buttons"]):
        play, missing = then_redraw(lambda: session.play(redraw)), not frame.svg
        solara.Button("Play", play, disabled=frame.playing or missing, color="primary", icon_name="mdi-play")
        solara.Button("Pause", then_redraw(session.pause), disabled=not frame.playing, icon_name="mdi-pause")
        solara.Button("Step", then_redraw(session.step), disabled=missing, icon_name="mdi-step-forward")
        solara.Button("Reset", then_redraw(session.reset), icon_name="mdi-restart")
