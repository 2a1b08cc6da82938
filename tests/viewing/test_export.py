import re
import sys
import types
import warnings

import numpy as np
import pytest

from mesa_swarm.base.errors import ExportError, ExportWarning, InvalidValueError, RecordingError, UnknownNameError
from mesa_swarm.base.extras import install_command
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from mesa_swarm.viewing import films
from mesa_swarm.viewing.export import export
from mesa_swarm.viewing.films import Screen

ENDINGS = ("png", "svg", "gif", "mp4", "csv", "parquet")


def names(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.slow
def test_one_still_has_the_name_that_was_asked_for_and_several_their_steps_too(run, tmp_path):
    assert export(run, tmp_path / "a.svg") == [tmp_path / "a.svg"]
    written = export(run, tmp_path / "b.svg", steps=[300, 0])
    assert [path.name for path in written] == ["b_000.svg", "b_300.svg"]
    assert export(run, tmp_path / "c.svg", every=150, sheet=True) == [tmp_path / "c.svg"]
    assert names(tmp_path) == ["a.svg", "b_000.svg", "b_300.svg", "c.svg"]
    for step in (0, 150, 300):
        assert f"step {step}".encode() in (tmp_path / "c.svg").read_bytes()


@pytest.mark.slow
def test_the_same_recording_gives_the_same_bytes(run, tmp_path):
    for ending in ("svg", "gif", "mp4", "parquet"):
        more = {"steps": [7]} if ending in ("svg", "parquet") else {"last": 4}
        first, second = (
            export(run, tmp_path / f"{name}.{ending}", **more)[0].read_bytes() for name in ("first", "second")
        )
        assert first == second, ending


@pytest.mark.parametrize(
    ("name", "wanted", "words"),
    [
        ("a.gfi", {}, "did you mean '.gif'"),
        ("a", {}, "unknown kind of file ''"),
        ("a.png", {"steps": [5, 301]}, "step 301 was not recorded; there are 301 steps from 0 to 300"),
        ("a.png", {"steps": []}, "expected a list such as"),
        ("a.png", {"steps": [1], "every": 5}, "steps are given beside every"),
        ("a.png", {"fps": 30}, "fps is given, which a .png does not take"),
        ("a.png", {"size": (800,)}, "expected \\(width, height\\)"),
        ("a.png", {"size": (10, 100)}, "width is 10; expected a whole number at least 64"),
        ("a.png", {"first": 301}, "first \\(--from\\) is 301"),
        ("a.png", {"first": 7, "last": 6}, "last \\(--to\\) is 6, before first"),
        ("a.png", {"first": 7, "last": 9, "every": 50}, "no step from 7 to 9 is a multiple of 50"),
        ("a.png", {"every": 0}, "every is 0"),
        ("a.png", {"trails": -1}, "trails is -1"),
        ("a.svg", {"animate": True, "sheet": True}, "an animated .svg does not take"),
        ("a.svg", {"animate": True, "first": 300}, "does not move"),
        ("a.gif", {"steps": [1]}, "steps is given"),
        ("a.gif", {"fps": 51}, "fps is 51"),
        ("a.gif", {"fps": float("nan")}, "fps is nan"),
        ("a.mp4", {"size": (801, 600)}, "films need an even width"),
        ("a.html", {"every": 2}, "it shows the whole recording"),
        ("a.csv", {"table": "loafs"}, "did you mean 'loads'"),
        ("a.csv", {"table": "robots", "animate": True}, "animate is given"),
    ],
)
def test_wrong_options_are_refused_in_one_line_and_leave_nothing(run, tmp_path, name, wanted, words):
    with pytest.raises((InvalidValueError, UnknownNameError), match=words) as refused:
        export(run, tmp_path / name, **wanted)
    assert "\n" not in str(refused.value)
    assert names(tmp_path) == []


@pytest.mark.parametrize("path", [None, 3])
def test_a_path_must_be_one(run, path):
    with pytest.raises(InvalidValueError, match="expected the name of a file"):
        export(run, path)


def test_files_that_are_there_are_replaced_only_if_asked(run, tmp_path):
    for ending in ENDINGS:
        path = tmp_path / f"a.{ending}"
        path.write_text("precious")
        with pytest.raises(ExportError, match="exists already"):
            export(run, path)
        assert path.read_text() == "precious"
    export(run, tmp_path / "a.csv", overwrite=True, table="fires")
    assert (tmp_path / "a.csv").read_text().startswith("step,fire,")


@pytest.mark.slow
def test_the_names_of_several_stills_sort_as_their_steps_do(run, tmp_path):
    export(run, tmp_path / "a.svg", steps=[9, 10, 100])
    assert names(tmp_path) == ["a_009.svg", "a_010.svg", "a_100.svg"]


def test_one_of_several_stills_that_is_there_stops_all(run, tmp_path):
    (tmp_path / "a_200.svg").write_text("precious")
    with pytest.raises(ExportError, match=r"a_200\.svg exists already"):
        export(run, tmp_path / "a.svg", every=100)
    assert names(tmp_path) == ["a_200.svg"]


def test_a_folder_that_cannot_be_written_to_is_refused_before_the_work(run):
    with pytest.raises(InvalidValueError, match="cannot be written to"):
        export(run, "/proc/a.mp4")


@pytest.mark.parametrize("ending", ["gif", "mp4"])
def test_what_is_interrupted_leaves_no_file(run, tmp_path, monkeypatch, ending):
    real, shown = Screen.show, []

    def show(screen, step):
        shown.append(step)
        if len(shown) == 4:
            raise KeyboardInterrupt
        return real(screen, step)

    monkeypatch.setattr(Screen, "show", show)
    with pytest.raises(KeyboardInterrupt):
        export(run, tmp_path / f"a.{ending}")
    assert names(tmp_path) == []


def test_films_name_the_missing_package(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(InvalidValueError, match=re.escape(install_command("video"))):
        export(run, tmp_path / "a.mp4")


def test_a_film_that_ffmpeg_cannot_make_is_one_line_and_no_file(run, tmp_path, monkeypatch):
    monkeypatch.setattr(films, "ENCODING", ["-c:v", "no_such_codec"])
    with pytest.raises(ExportError, match=r"a\.mp4 cannot be written: ffmpeg reports: .*no_such_codec|Error"):
        export(run, tmp_path / "a.mp4", last=5)
    assert names(tmp_path) == []


def test_a_page_is_what_the_viewer_makes_of_the_recording(run, tmp_path, monkeypatch):
    viewer = types.ModuleType("mesa_swarm.viewing.replay_page")
    viewer.replay_page = lambda recording: f"<html>{len(recording)} rows</html>"
    monkeypatch.setitem(sys.modules, "mesa_swarm.viewing.replay_page", viewer)
    (page,) = export(run.path, tmp_path / "a.html")
    assert page.read_text() == "<html>300 rows</html>"


def test_of_a_torn_recording_what_is_whole_is_exported_with_a_warning(run, tmp_path):
    torn = tmp_path / "torn.arrow"
    torn.write_bytes(run.path.read_bytes()[:-200])
    with pytest.warns(ExportWarning, match=r"was not closed: its 256 whole rows are exported"):
        export(torn, tmp_path / "a.csv")
    table = Recording(torn).to_pandas()
    assert len((tmp_path / "a.csv").read_text().splitlines()) == len(table) + 1 == 256 * 15 + 1


def test_of_a_recording_that_is_damaged_on_the_way_the_rows_before_are_exported(run, tmp_path):
    content = bytearray(run.path.read_bytes())
    pieces = run._reader.pieces
    content[pieces[1].batch + 400] ^= 1
    (tmp_path / "hurt.arrow").write_bytes(content)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        export(tmp_path / "hurt.arrow", tmp_path / "a.csv")
    assert any("256" in str(warning.message) for warning in caught)
    assert len((tmp_path / "a.csv").read_text().splitlines()) == 256 * 15 + 1


def test_an_empty_recording_and_what_is_none_are_refused(tmp_path):
    with FireFighting(rng=1).record(tmp_path / "empty.arrow"):
        pass
    with pytest.raises(ExportError, match="has no rows"):
        export(tmp_path / "empty.arrow", tmp_path / "a.png")
    (tmp_path / "text.arrow").write_text("hello")
    with pytest.raises(RecordingError, match="is not a recording"):
        export(tmp_path / "text.arrow", tmp_path / "a.png")


def test_pictures_need_positions_and_tables_do_not(tmp_path):
    model = FireFighting(n_robots=2, rng=1)
    with model.record(tmp_path / "run.arrow", columns=["temperature"], every=3):
        model.run(9)
    with pytest.raises(ExportError, match="position was not recorded"):
        export(tmp_path / "run.arrow", tmp_path / "a.png")
    with pytest.raises(InvalidValueError, match="every 3 steps were recorded, so give a multiple of 3"):
        export(tmp_path / "run.arrow", tmp_path / "a.csv", every=4)
    export(tmp_path / "run.arrow", tmp_path / "a.csv", every=3)
    steps = np.loadtxt(tmp_path / "a.csv", delimiter=",", skiprows=1, usecols=0)
    assert steps.tolist() == [3, 3, 6, 6, 9, 9]
