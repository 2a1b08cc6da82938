"""Consoles that lack letters: every command ends as it does elsewhere, and what they cannot show is replaced."""

import io
import sys

import pytest
import typer

from mesa_swarm import cli
from mesa_swarm.cli.lines import any_letters
from mesa_swarm.model.gallery import gallery_names

# What Windows and old systems have where output is redirected; all of them lack some of the letters below.
ENCODINGS = ("cp1252", "ascii", "cp437")
GREEK = '''
"""A model of a user's."""
from typing import Annotated
from mesa_swarm import AGENT3, SwarmModel
from mesa_swarm.model.parameters import Slider

class Θέμα(SwarmModel):
    """Ρομπότ that turn by θ ≤ π, 日本."""

    def __init__(self, *, θ: Annotated[float, Slider(0, 3, 0.1, "Größe of the turn, rad")] = 1.0, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT3, 2)

    def results(self):
        return {"Größe": self.steps, "θ²": 0.5}
'''
MINE = "./größe.py:Θέμα"
# Commands that print what they know at once.
SHORT = [
    ["list"],
    ["list", MINE],
    *(["info", name] for name in gallery_names()),
    ["info", "fire_fighting", "--odd"],
    ["info", "fire_fighting", "--code"],
    ["info", MINE],
    ["run", MINE, "--steps", "2"],
    ["run", MINE, "--steps", "2", "--record", "Größe {seed}.arrow"],
    ["verify", "Größe 1.arrow", "--model", MINE],
    ["export", "Größe 1.arrow", "θ.csv"],
    ["export", "Größe 1.arrow", "θ.csv"],  # it exists already
    ["map", "show", "original"],
    ["map", "import", "original", "Größe.toml"],
    ["map", "show", "Größe.toml"],
    ["reproduce", "--list"],
    ["reproduce", "--items"],
    ["validate", "--list"],
    ["compare", MINE, "--parameter", "θ", "--values", "0,1", "--seeds", "2", "--steps", "2", "--jobs", "1"],
    ["sweep", "Größe.job.toml", "--dry-run"],
    ["diagnose", MINE, "--steps", "3"],
    ["picture", MINE, "--steps", "0,1"],
]


def commands():
    """Yield the words of every command."""
    for name, command in typer.main.get_command(cli.app).commands.items():
        yield [name]
        yield from ([name, inner] for inner in getattr(command, "commands", ()))


def ended(words, encoding, monkeypatch):
    """Run a command on a console; return its exit status and what it wrote, as bytes."""
    streams = {name: io.TextIOWrapper(io.BytesIO(), encoding, write_through=True) for name in ("stdout", "stderr")}
    with monkeypatch.context() as patch:
        for name, stream in streams.items():
            patch.setattr(sys, name, stream)
        with pytest.raises(SystemExit) as left:
            cli.main(words)
    return left.value.code or 0, *(stream.buffer.getvalue() for stream in streams.values())


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a model and a job of a user's."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "größe.py").write_text(GREEK, encoding="utf-8")
    job = f"model = '{MINE}'\nname = 'Größe'\nsteps = 2\nseeds = 2\n"
    (tmp_path / "Größe.job.toml").write_text(job, encoding="utf-8")
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("words", list(commands()), ids=" ".join)
def test_the_help_and_the_errors_of_every_command_are_shown(folder, monkeypatch, encoding, words):
    status, out, err = ended([*words, "--help"], encoding, monkeypatch)
    assert (status, err) == (0, b"")
    assert out.startswith(b"Usage: mesa-swarm")
    status, out, err = ended([*words, "--Größe", "θ"], encoding, monkeypatch)
    assert (status, out, err.count(b"\n")) == (2, b"", 1)
    assert err.decode(encoding).startswith("mesa-swarm: ")


@pytest.mark.slow
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_whatever_a_command_prints_is_shown_on_any_console(folder, monkeypatch, encoding, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("utf-8")
    for name in ("größe.py", "Größe.job.toml"):
        (elsewhere / name).write_bytes((folder / name).read_bytes())
    for words in SHORT:
        monkeypatch.chdir(folder)
        status, out, err = ended(words, encoding, monkeypatch)
        monkeypatch.chdir(elsewhere)
        expected_status, expected, expected_err = ended(words, "utf-8", monkeypatch)
        assert status == expected_status, (words, err)
        assert len(out.decode(encoding).splitlines()) == len(expected.decode().splitlines()), words
        assert len(err.splitlines()) == len(expected_err.splitlines()), (words, err)
        assert b"UnicodeEncodeError" not in err
    files = {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*.csv")}
    assert files == {path.relative_to(elsewhere): path.read_bytes() for path in elsewhere.rglob("*.csv")}
    assert any("θ" in content.decode("utf-8") for content in files.values())


def test_a_result_whose_name_cannot_be_shown_is_named_in_plain_letters(folder, monkeypatch):
    status, out, _ = ended(["run", MINE, "--steps", "2", "--quiet"], "ascii", monkeypatch)
    assert status == 0
    assert [line.split()[:2] for line in out.decode("ascii").splitlines()][:3] == [
        ["steps", "2"],
        ["Grosse", "2"],
        ["theta2", "0.5"],
    ]


def test_what_a_console_can_show_is_left_as_it_is_and_its_way_with_errors_returns(monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), "cp437", "strict", write_through=True)
    monkeypatch.setattr(sys, "stdout", stream)
    with any_letters():
        print("Größe φ θ")
    assert stream.buffer.getvalue().decode("cp437").rstrip() == "Größe φ theta"
    assert stream.errors == "strict"


def test_the_name_of_a_file_that_is_in_no_letters_is_escaped(monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), "utf-8", "strict", write_through=True)
    monkeypatch.setattr(sys, "stdout", stream)
    with any_letters():
        print(b"caf\xe9.csv".decode("utf-8", "surrogateescape"))
    assert stream.buffer.getvalue().rstrip() == b"caf\\udce9.csv"


def test_the_end_of_a_file_is_not_an_interruption(typed, monkeypatch):
    def end():
        raise EOFError("Ran out of input")

    monkeypatch.setattr("mesa_swarm.cli.listing.model_names", end)
    status, out, err = typed("list")
    assert (status, out) == (2, "")
    assert err == "mesa-swarm: a file or the input ended too early: EOFError: Ran out of input (--debug shows where)\n"
