"""info: a model explained as text."""

import shlex

import pytest

from mesa_swarm.model.gallery import gallery_names
from mesa_swarm.model.info import model_info
from support.own_models import write_model

SECTIONS = ["How it works", "What to watch", "Things to try", "Equations", "Source"]


@pytest.mark.parametrize("name", gallery_names())
def test_info_has_every_section_and_wraps_its_text(typed, monkeypatch, name):
    monkeypatch.setenv("COLUMNS", "72")
    status, out, _ = typed(f"info {name}")
    assert status == 0
    lines = out.splitlines()
    assert lines[0] == model_info(name).title
    assert [line for line in lines if line in SECTIONS] == SECTIONS
    text = lines[: lines.index("Parameters, set by --set NAME=VALUE")]
    assert max(len(line) for line in text if not line.startswith("    ")) <= 72
    assert "def " not in out


def test_the_commands_that_info_prints_run(typed):
    _, out, _ = typed("info cooperative_transport")
    commands = [line.strip() for line in out.splitlines() if line.startswith("    mesa-swarm ")]
    assert len(commands) == 3
    for command in commands:
        status, out, _ = typed([*shlex.split(command)[1:], "--steps", "5", "--quiet"])
        assert status == 0
        assert "state hash" in out


def test_info_prints_code_if_that_is_required(typed):
    _, out, _ = typed("info foraging --code")
    assert "forage (mesa_swarm.models.foraging)" in out
    assert "def forage(me: Any" in out


@pytest.mark.parametrize("name", ["foraging", "puck_clustering"])
def test_code_is_whole_in_a_narrow_terminal_whose_parameters_are_wrapped(typed, monkeypatch, name):
    whole = typed(f"info {name} --code")[1]
    monkeypatch.setenv("COLUMNS", "50")
    narrow = typed(f"info {name} --code")[1]
    first = model_info(name).code[0].name + " ("
    assert narrow[narrow.index(first) :] == whole[whole.index(first) :]
    _, _, rest = narrow.partition("Parameters, set by --set NAME=VALUE\n")
    assert max(map(len, rest.partition("\n\n")[0].splitlines())) <= 50


def test_info_explains_a_file_with_a_model(typed, tmp_path):
    write_model(tmp_path, "explained.py")
    (tmp_path / "explained.toml").write_text('how = "By chance."\n')
    status, out, _ = typed("info ./explained.py:Foraging")
    assert status == 0
    assert out.splitlines()[:5] == ["Foraging", "  Robots that forage.", "", "How it works", "  By chance."]


def test_a_wrong_file_beside_a_model_is_an_error_of_one_line(typed, tmp_path):
    write_model(tmp_path, "wrongly.py")
    (tmp_path / "wrongly.toml").write_text("how = 3\n")
    assert typed("info ./wrongly.py") == (2, "", "mesa-swarm: wrongly.toml: how is 3; expected a text\n")


def test_info_of_an_unknown_model_names_the_nearest(typed):
    status, _, errors = typed("info boid")
    assert status == 2
    assert "did you mean 'boids'?" in errors
