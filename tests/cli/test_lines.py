"""Lines fit the terminal's width, and are whole where there is none."""

from collections import Counter
from itertools import chain

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mesa_swarm.cli import lines
from mesa_swarm.cli.lines import terminal_width, wrapped
from mesa_swarm.experiments.tables import aligned, fitting, markdown_fitting

WIDTHS = (60, 80, 120)
COMMANDS = {
    "list": "list",
    "info": "info boids",
    "run": "run fire_fighting --steps 5 --quiet",
    "diagnose": "diagnose fire_fighting --steps 60 --quiet",
    "items": "reproduce --items",
    "results": "reproduce --list",
    "map": "map show original",
    "compare": "compare fire_fighting --seeds 2 --steps 5 --jobs 1 --quiet",
    "gap": "reality-gap flocking --seeds 2 --steps 4 --jobs 1 --quiet",
}


def broken_words(text):
    """Return the words of a text, without what only tables and their rules consist of."""
    return [word for word in text.split() if set(word) != {"-"}]


@pytest.fixture
def wide(monkeypatch):
    def widen(columns):
        monkeypatch.setenv("COLUMNS", str(columns))

    monkeypatch.delenv("COLUMNS", raising=False)
    return widen


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n == "compare")) for n in COMMANDS])
def test_a_commands_lines_fit_the_terminal_and_lose_no_word(typed, wide, name):
    typed(COMMANDS[name])
    status, whole, err = typed(COMMANDS[name])  # its runs were done before, as those below
    assert (status, err) == (0, "")
    for columns in WIDTHS:
        wide(columns)
        _, out, _ = typed(COMMANDS[name])
        texts = [line for line in out.splitlines() if not line.startswith("    mesa-swarm ")]  # these are to be copied
        assert max(map(len, texts)) <= columns
        if name in ("compare", "gap"):  # cells have several lines
            assert sorted("".join(broken_words(out))) == sorted("".join(broken_words(whole)))
        else:
            assert broken_words(out) == broken_words(whole)


def test_where_there_is_no_terminal_every_parameter_is_one_whole_line(typed, wide):
    _, whole, _ = typed("list")
    assert terminal_width() is None
    wide(60)
    assert terminal_width() == 60
    _, narrow, _ = typed("list")
    assert len(narrow.splitlines()) > len(whole.splitlines())


def test_a_terminal_narrower_than_words_counts_as_40_columns_wide(wide):
    wide(10)
    assert terminal_width() == lines.NARROWEST == 40
    wide(0)
    assert terminal_width() is None


def test_a_path_is_never_broken():
    path = "/tmp/" + "a-long-name/" * 10
    assert wrapped(f"written to {path}", 40) == ["written to", f"    {path}"]


CELLS = [
    ["scene", "turns [95 %]", "share"],
    ["beside a wall", "12.6 [11.0, 14.1]", "6.5 %"],
    ["", "0.4 [0.1, 1.2]", "0 %"],
]


@pytest.mark.parametrize("width", [18, 22, 26, 30, 34, 38])
def test_a_narrow_table_has_the_same_characters_in_columns_that_fit(width):
    drawn = fitting(CELLS, width)
    assert max(map(len, drawn)) <= width
    characters = sorted("".join("".join(row) for row in CELLS).replace(" ", ""))
    assert sorted("".join(broken_words("\n".join(drawn)))) == characters


WORDS = st.lists(st.text("abc019.", min_size=1, max_size=8), max_size=3).map(" ".join)


@pytest.mark.slow
@given(st.integers(1, 6).flatmap(lambda n: st.lists(st.lists(WORDS, min_size=n, max_size=n), min_size=2, max_size=4)))
def test_no_number_and_no_word_of_a_narrow_table_is_broken_and_all_are_there(table):
    drawn = fitting(table, 20)
    assert max(map(len, drawn)) <= 20
    shown, given_words = Counter(broken_words(" ".join(drawn))), [" ".join(row).split() for row in table]
    assert shown >= Counter(chain(*given_words))
    assert set(shown) == set(chain(*given_words))


def test_columns_that_do_not_fit_are_in_a_further_table():
    table = [["robots", "required", "ir-sim"], ["10,000", "0.031", "29,500"]]
    first = ["robots  required", "----------------", "10,000  0.031"]
    assert fitting(table, 18) == [*first, "", "robots  ir-sim", "--------------", "10,000  29,500"]


def test_a_table_of_any_width_is_aligned_only():
    assert fitting(CELLS, None) == fitting(CELLS, 50) == aligned(CELLS)


def test_markdown_tables_are_tables_in_a_terminal_and_stay_markdown_elsewhere():
    page = "**Training**\n\n| contestant | seeds |\n|---|---|\n| random walk | 10 |\n\nend"
    assert markdown_fitting(page, None) == page.splitlines()
    assert markdown_fitting(page, 60)[2:5] == ["contestant   seeds", "------------------", "random walk  10"]
    assert max(map(len, markdown_fitting(page, 12))) <= 12
