"""Whatever the README and the pages of the documentation show as code or as a command can be run as it stands."""

import contextlib
import io
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from mesa_swarm import cli
from mesa_swarm_studies.benchmarks.speed import PEERS, TARGETS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md")), *sorted(DOCS.glob("appendix/*.md"))]
MAKE_AN_ENVIRONMENT = [page for page in PAGES if "-m venv" in page.read_text(encoding="utf-8")]
# These have tests of their own, which look at the results.
OWN = {"abc.md", "clusters.md", "sweeps.md", "environments.md", "mesa.md", "own_command.md", "own_package.md", "ppo.md"}
# What these show takes seconds to minutes: in the slow tests, once, with the commands beside it if there are any.
LONG = {
    *("extend.md", "fire_learning.md", "from_argos.md", "learning.md", "microcontroller.md", "reward_lab.md"),
    *("own_actuator.md", "own_body.md", "own_field.md", "own_message.md", "own_process.md", "own_robot.md"),
    *("own_sensor.md", "sensitivity.md", "train.md", "tutorial.md"),
}
# The same commands with figures so small that they take seconds; what is given last counts.
SMALL = {
    "learn-bench": "--only random --seeds 1 --steps 300 --evaluation-steps 100 --maps 1 --jobs 1",
    "reward-lab": "--steps 200 --seeds 1",
    "compare learning_fires": "--seeds 2 --steps 300 --jobs 1",
    "reality-gap": "--seeds 2 --steps 50 --jobs 1",
    "run learning_fires": "--steps 300",
    "design ": "--generations 2 --population 4 --robots 4 --steps 40",
    "design-gap": "--generations 1 --population 4 --robots 4 --steps 40 --designs 2 --seeds 2",
    "sensitivity ": "--points 2 --seeds 2 --steps 20 --jobs 1",
    "calibrate ": "--points 2 --seeds 1 --fresh 2 --steps 20 --jobs 1",
    "diversity": "--generations 2 --robots 4 --steps 40",
}
# Commands that serve until they are stopped.
SERVES = {"dashboard", "replay"}


def every_block(page: Path) -> list[tuple[str, str]]:
    """Return the languages and contents of a page's blocks in their order."""
    text = page.read_text(encoding="utf-8")
    return re.findall(r"^ *```(\w+)\n(.*?)^ *```", text, re.DOTALL | re.MULTILINE)


def blocks(page: Path, language: str) -> list[str]:
    return [block for spoken, block in every_block(page) if spoken == language]


def commands(block: str) -> list[list[str]]:
    """Return the commands of a block in their order, without the name of the program."""
    typed = [line.removeprefix("mesa-swarm ") for line in block.splitlines() if line.startswith("mesa-swarm ")]
    smaller = [next((small for start, small in SMALL.items() if line.startswith(start)), "") for line in typed]
    return [shlex.split(f"{line} {small}") for line, small in zip(typed, smaller, strict=True)]


def of(pages: list[Path], language: str) -> list:
    return [pytest.param(page, id=page.name) for page in pages if page.name not in OWN and blocks(page, language)]


def code_alone() -> list:
    """Return the pages whose code is run by itself, the long ones among them marked as slow."""
    alone = [page for page in PAGES if page.name not in LONG or not blocks(page, "sh")]
    marks = {page.name: [pytest.mark.slow] for page in alone if page.name in LONG}
    return [pytest.param(*p.values, id=p.id, marks=marks.get(p.id, [])) for p in of(alone, "python")]


def run_code(block: str, number: int, names: dict) -> None:
    source = Path(f"block{number}.py").absolute()  # rules are compiled from their source
    source.write_text(block)
    with contextlib.redirect_stdout(io.StringIO()):
        exec(compile(block, str(source), "exec"), names)


def run_command(words: list[str], capsys) -> None:
    if words[0] in SERVES:
        assert_serves(words)
        return
    if words[0] == "diversity":
        pytest.importorskip("ribs")
    with pytest.raises(SystemExit) as end:
        cli.main(words)
    assert end.value.code == 0, f"mesa-swarm {' '.join(words)}: {capsys.readouterr().err}"


@pytest.mark.slow
@pytest.mark.parametrize("page", code_alone())
def test_the_code_on_a_page_runs_from_top_to_bottom(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page"}
    for number, block in enumerate(blocks(page, "python")):
        run_code(block, number, names)
    assert names.keys() - {"__name__", "__builtins__"}, "the page's code defines nothing"


@pytest.mark.slow
@pytest.mark.parametrize("page", of(PAGES, "sh"))
def test_commands_and_code_of_a_page_run_in_one_folder_in_their_order(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {"__name__": "page"}
    for number, (language, block) in enumerate(every_block(page)):
        if language == "python":
            run_code(block, number, names)
        for words in commands(block) if language == "sh" else ():
            run_command(words, capsys)


def test_all_code_of_pages_is_run_alone_or_beside_commands():
    code = {page.name for page in PAGES if blocks(page, "python")}
    run = {param.id for param in [*code_alone(), *of(PAGES, "sh")]}
    assert code - OWN <= run
    assert code >= LONG


def test_no_two_recordings_of_all_pages_have_the_same_name():
    texts = [page.read_text(encoding="utf-8") for page in PAGES]
    made = [name for text in texts for name in re.findall(r'--record (\w+\.arrow)|record\((?:model, )?"(\S+?)"', text)]
    names = ["".join(either) for either in made]
    assert len(names) >= 5
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("page", MAKE_AN_ENVIRONMENT, ids=lambda page: page.name)
def test_a_page_that_makes_an_environment_activates_it_before_a_command_is_typed(page):
    lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
    typed = [number for number, line in enumerate(lines) if line.startswith("mesa-swarm ")]
    assert lines.index(". .venv/bin/activate") < typed[0]
    assert r".venv\Scripts\activate" in page.read_text(encoding="utf-8")


def test_the_table_of_speeds_has_a_row_of_ours_and_those_of_the_bench():
    text = (ROOT / "docs" / "comparison.md").read_text(encoding="utf-8").split("## Speed")[1]
    rows = [[cell.strip(" *") for cell in line.strip("|").split("|")] for line in text.splitlines() if line[:1] == "|"]
    robots = [int(cell.replace(",", "")) for cell in rows[0][1:]]
    ours, *others = rows[2:]
    assert ours[0] == "mesa_swarm"
    assert robots == list(TARGETS)
    assert all(float(cell) > 0 for cell in ours[1:])
    printed = [{n: float(cell) for n, cell in zip(robots, row[1:], strict=True) if cell} for row in others]
    assert printed == list(PEERS.values())


def free_port() -> str:
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        return str(listening.getsockname()[1])


def assert_serves(words: list[str]) -> None:
    """Start a server as the page shows, wait for its address, and stop it as Ctrl-C does."""
    words = [word for word in words if word != "--no-browser"]
    server = subprocess.Popen(
        [sys.executable, "-m", "mesa_swarm", *words, "--no-browser", "--port", free_port()],
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


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_in_a_page_s_sentences_and_tables_exist(page):
    group = typer.main.get_command(cli.app)
    known = group.list_commands(typer.Context(group))
    named = set(re.findall(r"`mesa-swarm ([a-z][a-z-]+)", page.read_text(encoding="utf-8")))
    assert named <= set(known)
