"""Whatever the README and the pages of the documentation show as code or as a command can be run as it stands."""

import contextlib
import io
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from mesa_swarm import cli
from mesa_swarm.study_cli import study

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
# These have tests of their own, which look at what comes out.
OWN = {"sweeps.md", "environments.md", "mesa.md"}
# What these show takes minutes.
LONG = {"learning.md", "fire_learning.md", "reward_lab.md"}
# The same commands with figures so small that they take seconds; what is given last counts.
SMALL = {
    "learn-bench": "--seeds 1 --steps 300 --evaluation-steps 100 --jobs 1",
    "reward-lab": "--steps 200 --seeds 1",
    "compare learning_fires": "--seeds 2 --steps 300 --jobs 1",
    "reality-gap": "--seeds 2 --steps 50 --jobs 1",
    "run learning_fires": "--steps 300",
}
# Commands that serve until they are stopped.
SERVES = {"dashboard", "replay"}


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^ *```{language}\n(.*?)^ *```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def commands(page: Path) -> list[list[str]]:
    """Return the commands of a page in their order, without the name of the program."""
    lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
    typed = [line.removeprefix("mesa-swarm ") for line in lines if line.startswith("mesa-swarm ")]
    smaller = [next((small for start, small in SMALL.items() if line.startswith(start)), "") for line in typed]
    return [f"{line} {small}".split() for line, small in zip(typed, smaller, strict=True)]


def of(pages: list[Path], language: str) -> list:
    shown = [page for page in pages if page.name not in OWN and blocks(page, language)]
    return [pytest.param(page, id=page.name, marks=[pytest.mark.slow] * (page.name in LONG)) for page in shown]


@pytest.mark.parametrize("page", of(PAGES, "python"))
def test_the_code_on_a_page_runs_from_top_to_bottom(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with contextlib.redirect_stdout(io.StringIO()):
        names = {"__name__": "page"}
        for number, block in enumerate(blocks(page, "python")):
            source = tmp_path / f"block{number}.py"  # rules are compiled from their source
            source.write_text(block)
            exec(compile(block, str(source), "exec"), names)


@pytest.mark.slow
@pytest.mark.parametrize("page", of(PAGES, "sh"))
def test_the_commands_on_a_page_run_in_their_order(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for words in commands(page):
        if words[0] in SERVES:
            assert_serves(words)
            continue
        with pytest.raises(SystemExit) as end:
            cli.main(words)
        assert end.value.code == 0, f"mesa-swarm {' '.join(words)}: {capsys.readouterr().err}"


def free_port() -> str:
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        return str(listening.getsockname()[1])


def assert_serves(words: list[str]) -> None:
    """Start a server as the page says, wait for its address, and stop it as Ctrl-C does."""
    words = [word for word in words if word != "--no-browser"]
    server = subprocess.Popen(
        [sys.executable, "-m", "mesa_swarm.cli", *words, "--no-browser", "--port", free_port()],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
        start_new_session=True,
    )
    try:
        assert any("http://" in line for line in server.stdout)
    finally:
        os.killpg(server.pid, signal.SIGINT)
        server.communicate(timeout=120)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_in_a_page_s_sentences_and_tables_exist(page):
    typed = [*cli.app.registered_commands, *study.registered_commands]
    known = {command.name or command.callback.__name__ for command in typed} | {"map"}
    spoken = set(re.findall(r"`mesa-swarm ([a-z-]+)", page.read_text(encoding="utf-8")))
    assert spoken <= known
