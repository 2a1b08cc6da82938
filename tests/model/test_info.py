"""What is known about each model: from its docstrings, its code, and the file beside its module."""

import sys
from importlib import import_module
from pathlib import Path

import pytest

import mesa_swarm
from mesa_swarm import SwarmModel
from mesa_swarm.base.errors import InvalidValueError
from mesa_swarm.model.gallery import find_model, gallery_names
from mesa_swarm.model.info import info_file, model_info
from mesa_swarm.model.parameters import Slider, parse_settings
from mesa_swarm.models.agglomeration import Agglomeration
from support.own_models import write_model

ROOT = Path(__file__).parents[2]
PRESETS = [
    pytest.param(name, one, id=f"{name}: {one.label}") for name in gallery_names() for one in model_info(name).presets
]
EQUATIONS = [
    pytest.param(one.latex, id=f"{name} {number}")
    for name in gallery_names()
    for number, one in enumerate(model_info(name).equations)
]
PRESET = '[[try]]\nlabel = "Few"\ntext = "Few robots."\nsettings = {{ {} }}\n'


@pytest.fixture
def mine(tmp_path, monkeypatch):
    """Return a function that writes a file with a model, and the file beside it, and returns what is known of both."""
    files = []

    def about(text=None):
        path = write_model(tmp_path, f"mine{len(files)}.py")
        files.append(path)
        if text is not None:
            path.with_suffix(".toml").write_text(text, encoding="utf-8")
        return model_info(f"{path}:Foraging")

    return about


@pytest.mark.parametrize("name", gallery_names())
def test_every_model_has_all_texts_three_presets_and_a_source(name):
    info = model_info(name)
    assert info_file(info.model_class).is_file()
    assert all((info.what, info.how, info.watch, info.source))
    assert "WHAT IS IT?" not in info.what
    assert len(info.presets) == 3
    assert 1 <= len(info.equations) <= 4
    assert all(one.text.endswith((".", ")")) for one in (*info.presets, *info.equations))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "preset"), PRESETS)
def test_a_preset_is_built_runs_and_fits_the_sliders(name, preset):
    model_class = find_model(name)
    model = model_class(rng=1, **preset.settings)
    assert model.run(50).steps == 50
    known = model_info(name).parameters
    for parameter, value in preset.settings.items():
        assert value != known[parameter].default
        control = known[parameter].control
        assert not isinstance(control, Slider) or control.minimum <= value <= control.maximum


@pytest.mark.parametrize(("name", "preset"), PRESETS)
def test_the_command_of_a_preset_sets_what_the_preset_sets(name, preset):
    info = model_info(name)
    words = info.command(preset).split()
    assert words[:3] == ["mesa-swarm", "run", name]
    assert words[3::2] == ["--set"] * len(preset.settings)
    assert parse_settings(info.model_class, words[4::2]) == preset.settings


@pytest.mark.parametrize("latex", EQUATIONS)
def test_an_equation_is_converted_whole(latex):
    convert = pytest.importorskip("latex2mathml.converter").convert
    drawn = convert(latex, display="block")
    assert drawn.startswith("<math")
    assert "\\" not in drawn, "a command that the converter does not know"
    assert "<mi>&amp;</mi>" not in drawn
    assert "<mi>&</mi>" not in drawn


@pytest.mark.parametrize("name", gallery_names())
def test_the_code_is_that_of_the_layers_and_then_of_the_model(name):
    info, model = model_info(name), find_model(name)(rng=1)
    assert [one.name for one in info.code] == [*model.control.names, info.model_class.__name__]
    for one in info.code:
        module = import_module(one.module)
        source = Path(module.__file__).read_text(encoding="utf-8")
        lines = {line.removesuffix("  # fmt: skip").strip() for line in source.splitlines()}
        assert {line.strip() for line in one.code.splitlines()} <= lines
    ways = "def arguments(", "def decide(", "@behaviour"
    assert all(any(way in listing.code for way in ways) for listing in info.code[:-1])
    assert f"class {info.model_class.__name__}(" in info.code[-1].code
    assert '"""' not in info.code[-1].code.splitlines()[0], "the docstring is shown as text"


def test_of_a_model_the_code_is_that_of_its_own_layers():
    names = [one.name for one in model_info(Agglomeration(moving="lead", rng=1)).code]
    assert names == ["Avoid", "Lead", "Gather", "Explore", "Agglomeration"]


def test_a_rule_is_shown_with_the_functions_that_it_uses():
    code = model_info("agglomeration").code[0].code
    assert next(line for line in code.splitlines() if line.startswith("def ")).startswith("def arguments(")
    assert "def is_activated(" in code
    assert "def reason(" not in code


def test_a_model_without_a_file_has_its_docstring_its_parameters_and_its_code(mine):
    info = mine()
    assert info.what == "Robots that forage."
    assert (info.how, info.watch, info.source, info.presets, info.equations) == ("", "", "", (), ())
    assert info.parameters["n_robots"].help == "robots"
    assert [one.name for one in info.code] == ["Avoid", "Explore", "Foraging"]


def test_a_file_beside_a_file_with_a_model_is_read(mine):
    info = mine('how = "Like\nthis."\n'.replace("\n", "\\n", 1) + PRESET.format("n_robots = 5"))
    assert info.how == "Like this."
    assert info.presets[0].settings == {"n_robots": 5}
    assert info.command(info.presets[0]).endswith("mine0.py:Foraging --set n_robots=5")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('hwo = "x"', r"mine0.toml: unknown key 'hwo'; did you mean 'how'\?"),
        ("how = 3", "mine0.toml: how is 3; expected a text"),
        ("speed = 0", "mine0.toml: speed is 0; expected a finite number at least 0.5"),
        ('speed = "fast"', "mine0.toml: speed is 'fast'; expected a finite number"),
        ('how = ""', "mine0.toml: how is ''; expected a text"),
        ("try = 3", r"mine0.toml: try is 3; expected tables, each headed \[\[try\]\]"),
        ('[[try]]\nlabel = "x"', "mine0.toml: try 1 has no text; expected label, text, settings"),
        (PRESET.format("n_robts = 5"), "mine0.toml: try 1, settings: unknown parameter 'n_robts'; did you mean"),
        (PRESET.format('n_robots = "x"'), "mine0.toml: try 1, settings: n_robots is 'x'; expected a whole number"),
        (PRESET.format("") + 'more = "x"', "mine0.toml: try 1: unknown key 'more'"),
        ('[[equations]]\nlatex = "x"', "mine0.toml: equations 1 has no text; expected latex, text"),
    ],
)
def test_a_wrong_file_is_refused_with_its_name_and_the_key(mine, text, words):
    with pytest.raises(InvalidValueError, match=words) as refused:
        mine(text)
    assert "\n" not in str(refused.value)


def test_a_file_that_is_not_toml_is_refused_with_its_name(mine):
    with pytest.raises(InvalidValueError, match=r"^mine0\.toml"):
        mine("how = ")


def test_a_class_that_comes_from_no_file_has_its_docstring_only(monkeypatch):
    kind = type("Loose", (SwarmModel,), {"__doc__": "A loose one.", "__module__": "__loose__"})
    monkeypatch.delitem(sys.modules, "__loose__", raising=False)
    info = model_info(kind)
    assert info.what == "A loose one."
    assert info.code == ()


def test_a_model_that_cannot_be_built_without_parameters_shows_its_own_code(mine):
    class Sized(SwarmModel):
        """One that needs a size."""

        def __init__(self, *, size, rng=None):
            super().__init__(rng=rng)

    assert [one.name for one in model_info(Sized).code] == ["Sized"]


def test_what_is_not_a_model_is_refused():
    with pytest.raises(InvalidValueError, match="model is 3; expected a SwarmModel"):
        model_info(3)


def test_notebooks_get_texts_calls_equations_and_code_as_markdown():
    info = find_model("boids").info()
    text = info._repr_markdown_()
    assert info == mesa_swarm.model_info(info.model_class)
    assert text.startswith("### Boids\n\nThe best known model of a flock")
    assert "`mesa_swarm.show('boids', rng=1, separation_weight=0.0)`" in text
    assert f"$${info.equations[0].latex}$$" in text
    assert "```python\ndef arguments(" in text
    assert "| `n_robots` | 50 | robots |" in text
    assert text.count("<details") == text.count("</details>") == 2 + 4


@pytest.mark.slow
def test_the_call_of_a_preset_shows_it():
    info = model_info("boids")
    shown = eval(info.call(info.presets[0]), {"mesa_swarm": mesa_swarm})
    assert type(shown).__name__ == "SwarmCanvas"


def test_a_page_of_the_site_exists_for_each_model_and_runs_commands():
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert [name for name in gallery_names() if f": models/{name}.md\n" not in navigation] == []
    info = model_info("boids")
    page = info.markdown(level=1, command=info.command)
    assert page.startswith("# Boids\n")
    assert "`mesa-swarm run boids --set separation_weight=0.0`" in page
