import pytest

from mesa_swarm import SwarmModel, cli


@pytest.fixture
def typed(capsys, monkeypatch, tmp_path, run):
    """Export the recording with what was typed, in an empty folder; get the exit status, output and errors."""
    monkeypatch.chdir(tmp_path)

    def type_in(line, source=None):
        with pytest.raises(SystemExit) as left:
            cli.main(["export", str(source or run.path), *line.split()])
        output = capsys.readouterr()
        return left.value.code or 0, output.out, output.err

    return type_in


def test_what_was_written_is_printed_and_progress_shown_with_the_time_left(typed, tmp_path):
    status, out, err = typed("out.svg --steps 0,300")
    assert (status, out) == (0, "out_0.svg\nout_300.svg\n")
    assert "2/2 pictures" in err
    assert "left, done at" in err
    assert typed("a.csv --table fires --every 100 --quiet") == (0, "a.csv\n", "")
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 1 + 3 * 7


def test_options_have_the_names_that_one_expects(typed, tmp_path):
    line = "out.gif --from 10 --to 20 --every 5 --fps 10 --size 80x64 --trails 5 --sectors --quiet"
    assert typed(line) == (0, "out.gif\n", "")
    assert typed("out.svg --animate --to 4 --quiet") == (0, "out.svg\n", "")
    assert "<animateTransform" in (tmp_path / "out.svg").read_text()


@pytest.mark.parametrize(
    "line",
    [
        "out.doc",
        "out.png --steps 1,x",
        "out.png --steps 999",
        "out.png --size 12",
        "out.gif --fps 99",
        "out.gif --steps 3",
        "out.csv --table fire",
        "out.mp4 --size 65x65",
        "/proc/out.png",
        "nowhere/out.png",
        "nowhere/out.csv",
        "out.png --every 0",
    ],
)
def test_what_is_wrong_is_one_line_and_status_2(typed, tmp_path, line):
    status, out, err = typed(f"{line} --quiet")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert "Traceback" not in err
    assert list(tmp_path.iterdir()) == []


def test_files_are_replaced_only_by_force(typed, tmp_path):
    (tmp_path / "a.csv").write_text("precious")
    assert typed("a.csv --quiet")[0] == 2
    assert (tmp_path / "a.csv").read_text() == "precious"
    assert typed("a.csv --quiet --force")[0] == 0


@pytest.mark.filterwarnings("default")
def test_a_torn_recording_is_exported_as_far_as_it_is_whole_with_a_warning(typed, tmp_path, run):
    (tmp_path / "torn.arrow").write_bytes(run.path.read_bytes()[:-200])
    status, out, err = typed("a.csv --quiet", "torn.arrow")
    assert (status, out) == (0, "a.csv\n")
    assert err == "mesa-swarm: warning: torn.arrow was not closed: its 256 whole rows are exported\n"


def test_a_folder_that_is_not_there_is_not_made(typed):
    status, _, err = typed("nowhere/a.csv --quiet")
    assert (status, err) == (2, "mesa-swarm: folder nowhere does not exist; make it first, or choose another place\n")


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_an_empty_table_is_written_with_a_warning(typed, tmp_path, kind):
    model = SwarmModel(rng=1)
    with model.record(tmp_path / "bare.arrow"):
        model.run(3)
    status, out, err = typed(f"a.{kind} --table fires --quiet", "bare.arrow")
    assert (status, out) == (0, f"a.{kind}\n")
    assert err == "mesa-swarm: warning: bare.arrow has no fires in these steps: the table is empty\n"


def test_an_unknown_table_is_reported_before_an_existing_file(typed, tmp_path):
    (tmp_path / "a.csv").write_text("precious")
    assert "table 'fire'; did you mean 'fires'" in typed("a.csv --table fire --quiet")[2]
