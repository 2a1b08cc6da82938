"""Files are written whole: beside their place, under a name that is cleaned up after a kill, and never over devices."""

import ast
import errno
import os
import signal
import threading
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest

from mesa_swarm.base.errors import (
    LONGEST,
    ExportError,
    InvalidValueError,
    JobError,
    MapError,
    RecordingError,
    SwarmError,
)
from mesa_swarm.base.files import (
    FORMER,
    check_present_format,
    check_writable,
    checked_file,
    draft_name,
    draft_of,
    is_locked,
    lock,
    open_draft,
    write_all,
    write_whole,
)
from mesa_swarm.experiments.jobs import read_job
from mesa_swarm.maps.map import Map
from mesa_swarm.recording.recording import Recording
from mesa_swarm.viewing.export import export
from support.forks import forked

ROOT = Path(__file__).parents[2]
POSIX = pytest.mark.skipif(os.name == "nt", reason="needs POSIX")


def one_line(error):
    text = str(error.value)
    assert "\n" not in text
    assert len(text) <= 300
    return text


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


@POSIX
def test_a_pipe_or_a_device_is_refused_and_stays(tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    os.symlink("/dev/null", tmp_path / "nothing.png")
    for name in ("pipe.png", "nothing.png"):
        with pytest.raises(InvalidValueError, match="it is not a regular file"):
            write_whole(tmp_path / name, "new")
        with pytest.raises(InvalidValueError, match="it is not a regular file"):
            checked_file(tmp_path / name, ".png")
    assert names_in(tmp_path) == ["nothing.png", "pipe.png"]
    assert (tmp_path / "nothing.png").is_char_device()


def test_a_name_with_another_ending_is_refused_with_the_option_that_has_it(tmp_path):
    assert checked_file(tmp_path / "a.PNG", ".png") == tmp_path / "a.PNG"
    with pytest.raises(InvalidValueError, match=r"^picture is '.*a\.jpg'; expected the name of a \.png file$"):
        checked_file(tmp_path / "a.jpg", ".png", "picture")


@pytest.mark.parametrize("name", ["folder", "a\0b", "x" * 300, "file/below", "loop"])
def test_a_place_where_no_file_can_be_is_refused_in_one_line_with_its_name(tmp_path, name):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("mine")
    (tmp_path / "loop").symlink_to("loop")
    before = names_in(tmp_path)
    with pytest.raises(ExportError) as error:
        write_whole(tmp_path / name, "new", ExportError)
    assert name.split("/")[-1].replace("\0", "\\x00")[-40:] in one_line(error)
    assert names_in(tmp_path) == before
    assert (tmp_path / "file").read_text() == "mine"


def test_the_longest_name_that_a_file_can_have_can_be_written(tmp_path):
    for name in ("x" * 255, "ü" * 127):
        assert write_whole(tmp_path / name, "all").read_text() == "all"
    assert len(names_in(tmp_path)) == 2


def test_a_failed_write_leaves_no_folder_that_was_made_for_it(tmp_path):
    def fill(draft):
        draft.write_text("part of it")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with (
        pytest.raises(InvalidValueError, match=r"b\.txt cannot be written: No space left"),
        draft_of(tmp_path / "new" / "b.txt") as draft,
    ):
        fill(draft)
    assert names_in(tmp_path) == []


@POSIX
def test_what_a_killed_writer_left_is_deleted_when_the_file_is_written_again(tmp_path):
    child = os.fork()
    if not child:
        with draft_of(tmp_path / "a.txt") as draft:
            draft.write_text("half of")
            os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    assert names_in(tmp_path) == [".a.txt.0.draft"]
    write_whole(tmp_path / "a.txt", "all of it")
    assert names_in(tmp_path) == ["a.txt"]


@POSIX
def test_other_files_under_a_drafts_name_are_not_touched(tmp_path):
    (tmp_path / "precious").write_text("mine")
    draft_name(tmp_path / "a.txt", 0).symlink_to(tmp_path / "precious")
    draft_name(tmp_path / "a.txt", 1).mkdir()
    os.mkfifo(draft_name(tmp_path / "a.txt", 2))
    before = names_in(tmp_path)
    write_whole(tmp_path / "a.txt", "new")
    assert names_in(tmp_path) == sorted([*before, "a.txt"])
    assert (tmp_path / "precious").read_text() == "mine"


def test_two_writers_at_once_have_drafts_of_their_own_and_the_last_one_counts(tmp_path):
    path = tmp_path / "a.txt"
    with draft_of(path) as first:
        with draft_of(path) as second:
            first.write_text("first")
            second.write_text("second")
        assert path.read_text() == "second"
        write_whole(path, "third")
    assert path.read_text() == "first"
    assert names_in(tmp_path) == ["a.txt"]


def test_many_threads_that_write_one_file_leave_one_whole_file(tmp_path):
    def write(letter):
        for _ in range(20):
            write_whole(tmp_path / "a.txt", letter * 10_000)

    threads = [threading.Thread(target=write, args=(letter,)) for letter in "abcd"]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(set((tmp_path / "a.txt").read_text())) == 1
    assert names_in(tmp_path) == ["a.txt"]


def test_a_link_is_followed_and_permissions_stay(tmp_path):
    (tmp_path / "file").write_text("old")
    (tmp_path / "file").chmod(0o640)
    (tmp_path / "link").symlink_to(tmp_path / "file")
    write_whole(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "file").read_text() == "new"
    assert (tmp_path / "file").stat().st_mode & 0o777 == 0o640


@POSIX
def test_a_draft_is_locked_while_it_is_open(tmp_path):
    with open_draft(tmp_path / "a.txt") as draft:
        assert is_locked(tmp_path / draft.name)
    assert not is_locked(tmp_path / draft.name)


@pytest.mark.parametrize("name", ["folder", "x" * 300, "file/below", "file/far/below", "x" * 300 + "/below", "loop"])
@pytest.mark.parametrize("below", ["", "link"])
def test_a_place_that_is_named_from_here_or_through_a_link_is_refused_alike(tmp_path, monkeypatch, below, name):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("mine")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "link").symlink_to(".")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ExportError, match="cannot be written") as error:
        write_whole(Path(below) / name, "new", ExportError)
    one_line(error)


def test_errors_about_other_files_stay_what_they_are_and_those_about_the_draft_do_not(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileNotFoundError), draft_of(Path("a.txt")):
        Path("not_there").read_text()
    with pytest.raises(InvalidValueError, match=r"^a\.txt cannot be written"), draft_of(Path("a.txt")) as draft:
        Path(os.path.relpath(draft)).unlink()
    assert names_in(tmp_path) == []


@pytest.mark.parametrize("full", [1, 2, 3])
def test_of_files_that_belong_together_none_is_new_where_a_disk_reports_late_that_it_is_full(
    tmp_path, monkeypatch, full
):
    names = ["a.csv", "b.csv", "c.csv"]
    write_all(tmp_path, dict.fromkeys(names, "old"))
    synced, fsync = [], os.fsync

    def late(place):
        synced.append(place)
        if len(synced) == full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(place)

    monkeypatch.setattr(os, "fsync", late)
    with pytest.raises(InvalidValueError, match=rf"{names[full - 1]} cannot be written: No space left"):
        write_all(tmp_path, dict.fromkeys(names, "new"))
    assert [(tmp_path / name).read_text() for name in names] == ["old"] * 3
    assert names_in(tmp_path) == names


@POSIX
@pytest.mark.parametrize("fails", [False, True])
def test_a_draft_is_free_when_it_is_done_with_though_a_child_that_was_forked_meanwhile_has_it_open(tmp_path, fails):
    def write(draft):
        opened.append(draft.open("rb"))
        forks.enter_context(forked())
        1 / (not fails)

    opened = []
    with ExitStack() as forks:
        with suppress(ZeroDivisionError), draft_of(tmp_path / "a.txt") as draft:
            write(draft)
        assert lock(opened[0])
    opened[0].close()


def test_a_folder_that_cannot_be_made_is_shown_by_the_end_of_its_path(tmp_path):
    (tmp_path / "taken").touch()
    folder = tmp_path / "taken" / ("a" * 60) / "the_end"
    with pytest.raises(InvalidValueError, match=r"the_end': .*; choose another folder"):
        check_writable(folder)


@pytest.mark.parametrize("ending", FORMER)
@pytest.mark.parametrize(
    ("opened", "kind"),
    [
        (Map.load, MapError),
        (read_job, JobError),
        (Recording, RecordingError),
        (lambda path: export("run.arrow", path), InvalidValueError),
    ],
    ids=["map", "job", "recording", "export"],
)
def test_a_file_of_the_thesis_or_of_scilab_is_refused_with_what_replaces_it(tmp_path, ending, opened, kind):
    path = tmp_path / f"fire{ending.upper()}"
    path.write_bytes(b"\x1f\x8b rectangle 0 0 20 600")
    with pytest.raises(kind) as error:
        opened(path)
    assert FORMER[ending] in one_line(error)


def test_a_recording_may_have_any_name_and_a_long_name_leaves_room_for_the_cure(tmp_path):
    check_present_format("run.arrow")
    check_present_format(b"bytes.png")
    with pytest.raises(SwarmError) as error:
        check_present_format("a" * 400 + ".sim")
    assert len(str(error.value)) <= LONGEST
    assert "mesa-swarm replay" in str(error.value)


def texts_without_encoding(source):
    """Yield the lines on which a text file is opened in the letters of the machine."""
    for call in (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call)):
        name = getattr(call.func, "attr", getattr(call.func, "id", ""))
        words = {keyword.arg: keyword.value for keyword in call.keywords}
        mode = [word for word in (*call.args, words.get("mode")) if isinstance(word, ast.Constant)]
        modes = [word.value for word in mode if isinstance(word.value, str) and set(word.value) <= set("rwaxbt+")]
        is_builtin = isinstance(call.func, ast.Name) and len(call.args) < 2 and "mode" not in words
        is_text = name == "open" and (is_builtin or any("b" not in mode for mode in modes))
        is_text |= name.endswith("TemporaryFile") and any("b" not in mode for mode in modes)
        is_text |= name == "read_text" and not call.args
        is_text |= name == "write_text" and len(call.args) < 2
        if is_text and "encoding" not in words and "opener" not in words:
            yield call.lineno


@pytest.mark.parametrize(
    "line", ["open(p)", "open(p, 'w')", "p.open('a')", "p.read_text()", "p.write_text(t)", "TemporaryFile('w+')"]
)
def test_a_text_file_of_which_the_encoding_is_the_machines_is_noticed(line):
    assert list(texts_without_encoding(line)) == [1]
    assert list(texts_without_encoding(f"{line[:-1]}, encoding='utf-8')".replace("(,", "("))) == []


@pytest.mark.slow
def test_text_files_are_read_and_written_in_utf_8_on_every_machine():
    folders = [ROOT / name for name in ("mesa_swarm", "models", "release", "studies")]
    paths = [path for folder in folders for path in folder.rglob("*.py")]
    lines = {path: list(texts_without_encoding(path.read_text(encoding="utf-8"))) for path in paths}
    assert {path: found for path, found in lines.items() if found} == {}
    assert len(paths) > 300
