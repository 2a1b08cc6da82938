"""All that the page about packages shows is done in its order, in an empty folder; the package is installed from it."""

import re
import sys
import tomllib
from pathlib import Path

import pytest
from documentation.test_pages import every_block, run_command

from mesa_swarm.cli import main
from mesa_swarm.model import gallery

PAGE = Path(__file__).parents[2] / "docs" / "own_package.md"
NAMED = re.compile(r"# (\S+\.(?:py|toml))\n")


def install(folder: Path) -> None:
    """Do what pip does with the folder that the page shows."""
    project = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
    package = folder / "site" / project["name"]
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    for module in {value.split(":")[0] for points in project["entry-points"].values() for value in points.values()}:
        name = f"{module.split('.')[1]}.py"
        (package / name).write_text((folder / name).read_text())
    about = folder / "site" / f"{project['name']}-{project['version']}.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    lines = [f"[{group}]\n" + "\n".join(f"{name} = {value}" for name, value in points.items())
             for group, points in project["entry-points"].items()]  # fmt: skip
    (about / "entry_points.txt").write_text("\n".join(lines))
    sys.path.insert(0, str(folder / "site"))


@pytest.mark.slow
def test_files_code_and_commands_of_the_page_work_in_their_order(model_folder, capsys):
    names = {"__name__": "page"}
    for language, block in every_block(PAGE):
        named = NAMED.match(block)
        if named:
            (model_folder / named[1]).write_text(block)
        elif language == "python":
            exec(compile(block, "page", "exec"), names)
        for line in block.splitlines() if language == "sh" else ():
            if line == "pip install ./anthill":
                install(model_folder)
            elif "dashboard" not in line:
                run_command(line.removeprefix("mesa-swarm ").split(), capsys)
    assert (names["model"].steps, type(names["canvas"]).__name__) == (100, "SwarmCanvas")


@pytest.mark.slow
def test_the_page_shows_every_message_as_it_is(model_folder, capsys):
    (model_folder / "a.py").write_text("from mesa_swarm import SwarmModel\n\nA = not_defined\n")
    with pytest.raises(SystemExit):
        main(["run", "./a.py:A"])
    assert "cannot be imported: a.py, line 3: NameError: " in capsys.readouterr().err
    messages = re.findall(r"^\| `([^`]+)` \|", PAGE.read_text().partition("## What is refused")[2], re.MULTILINE)
    source = "".join(path.read_text() for path in Path(gallery.__file__).parents[1].rglob("*.py"))
    words = [max(re.split(r"[:'.]| A| B|;", message), key=len).strip() for message in messages]
    assert [word for word in words if word not in source] == []
