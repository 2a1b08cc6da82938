"""The panel that explains the model: its presets, equations and code."""

from html.parser import HTMLParser

import ipyvuetify
import pytest
import solara

from mesa_swarm.dashboard.page.session import Session
from mesa_swarm.dashboard.run import info_view
from mesa_swarm.dashboard.run.info_view import (
    SCROLLED,
    Info,
    draw_equation,
    draw_listing,
    draw_plan,
    is_built,
    play_with,
    prose,
)
from mesa_swarm.model.info import Equation, Listing, Preset, model_info
from support.names import HOSTILE_NAMES

# Tags and attributes of what is drawn; besides these there are only those of MathML.
TAGS = {"p", "code", "div", "details", "summary", "small", "pre", "span"}
ALLOWED = TAGS | {"class", "xmlns", "display", "stretchy", "tabindex", "role", "aria-label"}


@pytest.fixture
def session():
    session = Session("boids", {"n_robots": 4})
    yield session
    session.close()


def html(context, tag: str) -> list:
    return context.find(ipyvuetify.Html, tag=tag).widgets


def labels(context) -> list[str]:
    return [button.children[0] for button in html(context, "button")]


def pressed(context) -> list[str]:
    states = [button.attributes.get("aria-pressed") for button in html(context, "button")]
    return [state for state in states if state is not None]


def test_the_panel_has_a_button_for_each_preset_and_folds_the_rest(session):
    _, context = solara.render(Info(session), handle_error=False)
    info = model_info("boids")
    assert labels(context) == [one.label for one in info.presets]
    assert [one.children[0] for one in html(context, "small")] == [one.text for one in info.presets]
    folded = ["About this model", "How it works", "What to watch", "Equations", "Source", "Code"]
    folded.append("What a step does, and how fast")
    assert [one.children[0] for one in html(context, "summary")] == folded
    context.close()


def test_the_plan_of_a_step_names_what_is_python_and_what_to_declare_also_where_an_attribute_hides_it(session):
    session.model.datacollector.model_reporters["mine"] = lambda model: 1.0
    text = draw_plan(session.model)
    assert "robots read their sensors" in text
    assert "reporter mine, a function in Python; declare it by count, share, mean, value or measure" in text
    session.model.plan = "mine"
    assert draw_plan(session.model) == text
    assert draw_plan(None) == ""


def test_a_preset_sets_all_parameters_and_plays(session):
    session.set_parameter("sight", 100.0)
    play_with(session, {"separation_weight": 0.0})
    assert session.playing
    session.loop.pause()
    built = {name: value for name, value in session.built.items() if name != "seed"}
    defaults = {name: one.default for name, one in session.parameters.items()}
    assert built == defaults | {"separation_weight": 0.0}
    assert not session.waiting


def test_the_button_of_the_preset_that_is_shown_is_pressed_and_the_defaults_can_be_played(session):
    _, context = solara.render(Info(session), handle_error=False)
    assert pressed(context) == ["false"] * 3
    play_with(session, model_info("boids").presets[1].settings)
    session.loop.pause()
    assert pressed(context) == ["false", "true", "false"]
    assert "Play with the defaults" in labels(context)
    context.close()


def test_a_preset_that_the_page_refuses_leaves_the_model_as_it_is(session):
    before = session.model
    with pytest.raises(ValueError, match="n_robots"):
        play_with(session, {"n_robots": 20_000})
    assert session.model is before
    assert not is_built(session, Preset(label="", text="", settings={"n_robots": 20_000}))


def test_a_file_that_cannot_be_read_is_named_in_the_panel(session, monkeypatch):
    def refuse(model):
        raise ValueError("mine.toml: how is 3")

    monkeypatch.setattr(info_view, "model_info", refuse)
    _, context = solara.render(Info(session), handle_error=False)
    (text,) = [one.children[0] for one in html(context, "p")]
    assert text.endswith(": ValueError: mine.toml: how is 3")
    context.close()


def test_text_is_escaped_and_quoted_names_are_code():
    assert prose("a < b in `sight`\n\nmore") == "<p>a &lt; b in <code>sight</code></p><p>more</p>"
    assert prose("") == ""


class Tags(HTMLParser):
    """The tags and attributes of some HTML."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.found: set[str] = set()
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        self.found |= {tag, *(name for name, _ in attributes)}


@pytest.mark.parametrize("name", [*HOSTILE_NAMES, "<img src=x onerror=alert(1)>", "</code><script>alert(1)</script>"])
def test_texts_equations_and_code_make_no_markup(name):
    text = Tags(prose(f"{name} `{name}`")).found
    code = Tags(draw_listing(Listing(name=name, module=name, code=f"x = 1  # {name}"))).found
    latex = Tags(draw_equation(Equation(latex=rf"\text{{{name}}} + x_{{{name}}}", text=name))).found
    assert (text | code | latex) <= ALLOWED | {tag for tag in latex if tag.startswith("m")}
    assert "src" not in latex | code | text


def test_equations_are_mathml_and_stay_latex_where_they_cannot_be_drawn(monkeypatch):
    assert "<math" in draw_equation(Equation(latex=r"\frac{a}{b}", text="a over b"))
    monkeypatch.setattr(info_view, "convert", lambda *_, **__: 1 / 0)
    drawn = draw_equation(Equation(latex=r"x < \y", text="letters"))
    box = f'<div class="swarm-equation" {SCROLLED} aria-label="equation">'
    assert drawn == rf"{box}<p><code>x &lt; \y</code></p></div><p>letters</p>"


def test_code_is_highlighted_by_classes_and_escaped():
    drawn = draw_listing(Listing(name="<Rule>", module="mine", code="def rule(me):\n    return 1 < 2"))
    assert '<span class="k">def</span>' in drawn
    assert "&lt;Rule&gt;" in drawn
    assert "style=" not in drawn
