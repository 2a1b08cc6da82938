"""`mesa-swarm reproduce`, as it is typed."""

import pytest

from mesa_swarm import cli
from mesa_swarm.reproduction.registry import items


@pytest.fixture
def typed(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)

    def type_in(line):
        with pytest.raises(SystemExit) as left:
            cli.main(line.split())
        output = capsys.readouterr()
        return left.value.code or 0, output.out, output.err

    return type_in


def test_list_has_a_line_for_every_figure(typed, tmp_path):
    status, out, err = typed("reproduce --list")
    assert (status, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines()] == list(items())
    assert not list(tmp_path.iterdir())


def test_a_figure_is_written_as_pictures_and_a_table_and_its_verdict_is_printed(typed, tmp_path):
    status, out, err = typed("reproduce --figure D.3 --figure 8.2 --quick --quiet --jobs 1")
    assert (status, err) == (0, "")
    made = tmp_path / "results" / "reproduction"
    names = {path.name for path in made.iterdir()}
    assert {f"figure_{f}_quick.{end}" for f in ("8.2", "D.3") for end in ("png", "svg", "csv")} <= names
    assert (made / "figure_8.2_quick.png").read_bytes()[1:4] == b"PNG"
    verdicts = [line.split(":")[0] for line in out.splitlines() if line[:1] in "8D"]
    assert verdicts == ["8.2   confirmed with limits", "D.3   confirmed"]


def test_the_same_figure_gives_the_same_files(typed, tmp_path):
    for folder in ("a", "b"):
        typed(f"reproduce --figure D.1 --quick --quiet --out {folder}")
    for end in ("png", "svg", "csv"):
        first, second = (tmp_path / folder / f"figure_D.1_quick.{end}" for folder in ("a", "b"))
        assert first.read_bytes() == second.read_bytes()


def test_quick_results_do_not_take_the_place_of_full_ones(typed, tmp_path):
    typed("reproduce --figure B.1 --quiet --out here")
    full = {path: path.read_bytes() for path in (tmp_path / "here").glob("figure_*")}
    typed("reproduce --figure B.1 --quick --quiet --out here")
    assert full
    assert {path: path.read_bytes() for path in full} == full
    assert len(list((tmp_path / "here").glob("figure_*_quick.*"))) == len(full)


def test_a_report_says_that_few_seeds_mean_nothing(typed, tmp_path):
    assert typed("reproduce --figure B.1 --quick --quiet --report page.md")[0] == 0
    page = (tmp_path / "page.md").read_text()
    assert "these verdicts mean nothing" in page
    assert "| B.1 | how a fire's temperature grows | **confirmed with limits** |" in page


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("reproduce --figure 8.9", "unknown figure '8.9'; did you mean"),
        ("reproduce --all --figure 8.2", "--all and --figure are given at once"),
        ("reproduce --figure 8.2 --report page.html", "expected the name of a .md file"),
        ("reproduce --figure 8.2 --jobs 0", "jobs is 0"),
        ("reproduce --figure 8.2 --out /proc/nowhere", "results cannot be written to"),
        ("reproduce --figure", "requires an argument"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(typed, line, words, tmp_path):
    status, out, err = typed(line)
    assert (status, out) == (2, "")
    assert words in err
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())
