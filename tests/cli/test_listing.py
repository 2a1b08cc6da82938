"""list: what is read from a model's source is what importing the model gives."""

import subprocess
import sys
from pathlib import Path
from typing import Annotated

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.cli import listing
from mesa_swarm.cli.listing import NotPlainError, Source, lines_of, listed
from mesa_swarm.model.gallery import class_name, description, find_model, gallery_names, model_names
from mesa_swarm.model.parameters import Choice, Slider, parameters_of
from support.own_models import write_model

HEAVY = ("mesa", "numba", "numpy", "pandas", "scipy", "shapely", "matplotlib", "networkx", "pyarrow", "solara")


def test_list_names_every_model_with_its_parameters_and_defaults(typed):
    status, out, _ = typed("list")
    assert status == 0
    assert [line for line in out.splitlines() if not line.startswith(" ")] == model_names()
    assert "strategy=B" in out
    assert max(map(len, out.splitlines())) <= 100


def test_list_has_of_each_model_what_importing_it_gives(typed):
    _, out, _ = typed("list")
    models = {name: find_model(name) for name in model_names()}
    assert out.splitlines() == [line for name, model in models.items() for line in (name, *lines_of(model))]
    for name, model in models.items():
        assert lines_of(model)[0] == f"    {description(model)}"
        assert len(lines_of(model)) == 1 + len(parameters_of(model))
        assert typed(f"list {name}")[1].splitlines() == [name, *lines_of(model)]


@pytest.mark.parametrize("name", gallery_names())
def test_every_model_of_the_gallery_can_be_read_without_running_it(name):
    model = find_model(name)
    source = Path(sys.modules[model.__module__].__file__).read_text(encoding="utf-8")
    assert Source(source).lines(class_name(name)) == lines_of(model)


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", ["list", "list fire_fighting", "--help", "run --help", "--version", "run fire_figting"]
)
def test_what_runs_no_model_imports_nothing_that_is_slow(words):
    code = f"import sys\nfrom mesa_swarm.cli import main\ntry:\n    main({words.split()})\nfinally:\n"
    code += f"    print(sorted({set(HEAVY)} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[-1] == "[]"


def test_a_file_is_imported_and_listed_in_the_same_way(typed, model_folder):
    write_model(model_folder)
    lines = lines_of(find_model("./mine.py"))
    assert typed("list ./mine.py") == (0, "\n".join(["./mine.py", *lines]) + "\n", "")


def test_a_model_of_the_gallery_that_cannot_be_read_is_imported(monkeypatch):
    def refuse(self, name):
        raise NotPlainError

    monkeypatch.setattr(listing.Source, "lines", refuse)
    assert listed("boids") == lines_of(find_model("boids"))


HEAD = (
    "from mesa_swarm import SwarmModel\nfrom mesa_swarm.fire import design_constants\nCONSTANTS = design_constants()\n"
)
NUMBERS = st.integers(-(10**6), 10**6).map(repr) | st.floats(-1e6, 1e6).map(repr)
NUMBERS |= st.sampled_from(["CONSTANTS.k1", "CONSTANTS.leave", "design_constants().join"])
TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\r\n"), max_size=20)


@st.composite
def parameters(draw):
    """Return the source of one parameter, without its name."""
    text = draw(TEXTS)
    if draw(st.booleans()):
        return f"Annotated[float, Slider(0, 1, 0.1, {text!r})] = {draw(NUMBERS)}"
    if draw(st.booleans()):
        return f"Annotated[str, Choice(('a', 'b'), {text!r})] = 'a'"
    return (
        f"{draw(st.sampled_from(['int', 'str', 'bool']))} = {draw(st.sampled_from(['None', '3', 'True', repr(text)]))}"
    )


@given(st.text(st.sampled_from("ab .\n'"), max_size=30), st.lists(parameters(), max_size=4))
def test_source_and_class_have_the_same_lines(docstring, given_parameters):
    signature = ", ".join(f"p{number}: {one}" for number, one in enumerate([*given_parameters, "int = 1"]))
    source = (
        f"{HEAD}class Mine(SwarmModel):\n    {docstring!r}\n    def __init__(self, *, {signature}, rng=None): pass\n"
    )
    names = {"Annotated": Annotated, "Slider": Slider, "Choice": Choice, "__name__": "mine"}
    exec(source, names)
    assert Source(source).lines("Mine") == lines_of(names["Mine"])


NOT_PLAIN = {
    "a default that is computed": "class A:\n    def __init__(self, *, n: int = 1 + len('a')): pass",
    "a name that is computed": "N = max(3, 4)\nclass A:\n    def __init__(self, *, n: int = N): pass",
    "a name that is bound twice": "N = 3\nN = 4\nclass A:\n    def __init__(self, *, n: int = N): pass",
    "a name that is bound in a loop": "for N in (1, 2): pass\nclass A:\n    def __init__(self, *, n: int = N): pass",
    "a name of another package": "from math import pi\nclass A:\n    def __init__(self, *, n: float = pi): pass",
    "another name": "from mesa_swarm import show as n\nclass A:\n    def __init__(self, *, n: int = show): pass",
    "a name that is nowhere": "class A:\n    def __init__(self, *, n: int = N): pass",
    "an annotation with a name": "class A:\n    def __init__(self, *, n: Robots = 3): pass",
    "a slider that begins nowhere": "class A:\n    def __init__(self, *, n: Annotated[int, Slider(1, 2)] = None): pass",
    "parameters by position": "class A:\n    def __init__(self, n: int = 3): pass",
    "an inherited constructor": "class A(B): pass",
    "a decorated constructor": "class A:\n    @b\n    def __init__(self, *, n: int = 3): pass",
    "a decorated class": "@b\nclass A:\n    def __init__(self, *, n: int = 3): pass",
    "another class": "class B:\n    def __init__(self, *, n: int = 3): pass",
}


@pytest.mark.parametrize("what", NOT_PLAIN)
def test_what_only_running_would_explain_is_not_guessed(what):
    with pytest.raises(NotPlainError):
        Source(NOT_PLAIN[what]).lines("A")


def test_reading_does_not_run_a_module():
    source = "raise SystemExit(3)\nclass A:\n    'A model.'\n    def __init__(self, *, n: int = 3): pass"
    assert Source(source).lines("A") == ["    A model.", "      n=3"]
