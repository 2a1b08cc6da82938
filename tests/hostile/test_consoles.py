"""Consoles of any encoding: whatever is printed is shown or replaced, and no command ends for want of a letter."""

import codecs
import io
import os
import subprocess
import sys

import numpy as np
import pytest

from mesa_swarm.cli.lines import any_letters

pytestmark = pytest.mark.slow

# Of Windows, old systems and terminals; of some, letters take several bytes.
ENCODINGS = (
    *(
        "ascii",
        "latin-1",
        "cp437",
        "cp850",
        "cp866",
        "cp932",
        "cp950",
        "cp1250",
        "cp1251",
        "cp1252",
        "cp1253",
        "cp1256",
    ),
    *("gbk", "euc_kr", "iso2022_jp", "koi8-r", "mac_roman", "hp_roman8", "utf-7", "utf-8", "utf-16"),
)
SETTINGS = (
    *({"PYTHONIOENCODING": encoding} for encoding in ("ascii", "cp1252", "cp437", "cp932", "latin-1:strict")),
    {"LC_ALL": "C"},
    {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONIOENCODING": "ascii:strict"},
)
MODEL = '''
"""A model."""
from typing import Annotated
from mesa_swarm import AGENT3, SwarmModel
from mesa_swarm.model.parameters import Slider

class Mine(SwarmModel):
    """\u0420\u043e\u0431\u043e\u0442\u044b that turn by \u03b8 \u2264 \u03c0, \u65e5\u672c \U0001f41d."""

    def __init__(self, *, size: Annotated[float, Slider(0, 3, 0.1, "Gr\u00f6\u00dfe")] = 1.0, rng=None):
        super().__init__(rng=rng)
        self.add_robots(AGENT3, 2)

    def results(self):
        return {"Gr\u00f6\u00dfe": self.steps, "\u03b8\u00b2 \\udce9": 0.5}
'''
COMMANDS = (
    ["list", "./mine.py:Mine"],
    ["info", "./mine.py:Mine"],
    ["info", "task_allocation", "--odd"],
    ["run", "./mine.py:Mine", "--steps", "2"],
    ["reproduce", "--list"],
    ["run", "./mine.py:Mine", "--set", "\u03b8=\u65e5"],
    ["run", "\u03b8\U0001f41d"],
)


def texts(rng, number):
    """Yield texts of letters of all kinds, halves of pairs and letters of no encoding among them."""
    for _ in range(number):
        highest = (0x80, 0x250, 0x2600, 0xE000, 0x110000)[rng.integers(5)]
        yield "".join(map(chr, rng.integers(32, highest, rng.integers(1, 40))))


def printed(text, encoding):
    """Return what is written when a text is printed."""
    stream, before = io.TextIOWrapper(io.BytesIO(), encoding, "strict", newline="\n", write_through=True), sys.stdout
    sys.stdout = stream
    try:
        with any_letters():
            print(text)
    finally:
        sys.stdout = before
    return stream.buffer.getvalue()


def test_any_text_is_printed_whole_on_any_console(tally, amount):
    """What the console has is as it was; only the rest is replaced, and nothing is lost."""
    rng = np.random.default_rng(1)
    for encoding in ENCODINGS:
        area = tally("consoles: any text")
        for number, text in enumerate(texts(rng, amount(200, 5000))):
            name = f"{encoding} {number}"
            try:
                shown = printed(text, encoding).decode(encoding)
            except (UnicodeError, LookupError) as error:
                area.check(name, False, repr(error))
                continue
            known = [letter for letter in text if letter.isascii() and letter.isprintable()]
            area.check(name, in_order(known, shown), f"{text!r} became {shown!r}")


def in_order(letters, text):
    """Return whether letters stand in a text in this order, whatever is between them."""
    left = iter(text)
    return all(letter in left for letter in letters)


def test_every_encoding_of_the_list_is_one():
    assert len({codecs.lookup(encoding).name for encoding in ENCODINGS}) == len(ENCODINGS)


def test_commands_end_as_they_do_where_all_letters_are_there(tmp_path, tally, amount):
    (tmp_path / "mine.py").write_text(MODEL, encoding="utf-8")

    def ended(words, settings):
        command = [sys.executable, "-m", "mesa_swarm", *words]
        environment = {**os.environ, "PYTHONIOENCODING": "utf-8", **settings}
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, check=False)

    for words in COMMANDS[:: amount(3, 1)]:
        expected, area = ended(words, {}), tally("consoles: commands")
        for settings in SETTINGS:
            done = ended(words, settings)
            same = done.returncode == expected.returncode
            same &= len(done.stdout.splitlines()) == len(expected.stdout.splitlines())
            same &= len(done.stderr.splitlines()) == len(expected.stderr.splitlines())
            area.check(f"{words} {settings}", same and b"Unicode" not in done.stderr, repr(done.stderr[-200:]))
