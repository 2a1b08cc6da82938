"""All that the page about commands shows is done in its order, in an empty folder; the package is installed from it."""

import re
from pathlib import Path

from documentation.test_own_package_page import NAMED, install
from documentation.test_pages import every_block, run_command

from mesa_swarm.cli import installed

PAGE = Path(__file__).parents[2] / "docs" / "own_command.md"


def test_files_code_and_commands_of_the_page_work_in_their_order(model_folder, capsys):
    printed = ""
    for language, block in every_block(PAGE):
        named = NAMED.match(block)
        if named:
            (model_folder / named[1]).write_text(block)
        elif language == "python":
            printed += capsys.readouterr().out
            exec(compile(block, "page", "exec"), {"__name__": "page"})
            assert capsys.readouterr().out == "[{'square': 0}, {'square': 1}, {'square': 4}]\n"
        for line in block.splitlines() if language == "sh" else ():
            if line == "pip install ./visits":
                install(model_folder)
            else:
                run_command(line.removeprefix("mesa-swarm ").split(), capsys)
    assert re.search(r"^runs +distance\n-+\n2 +\d", printed, re.MULTILINE)
    assert re.search(r"^  visits +Print how far robots are", printed, re.MULTILINE)


def test_the_page_shows_every_message_as_it_is():
    messages = re.findall(r"^\| `([^`]+)` \|", PAGE.read_text().partition("## What is refused")[2], re.MULTILINE)
    source = Path(installed.__file__).read_text()
    assert len(messages) == 3
    assert [message for message in messages if message.removesuffix(": ...") not in source] == []
