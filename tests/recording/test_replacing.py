"""A recording that replaces another takes its name only when its first rows are on the disk."""

import os
import signal
import threading

import pytest

from mesa_swarm.base.errors import RecordingError
from mesa_swarm.base.files import is_locked
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording
from mesa_swarm.recording.sealed_stream import SealedWriter
from support.disks import small_disk
from support.forks import forked

POSIX = pytest.mark.skipif(os.name == "nt", reason="needs POSIX")


def small():
    return FireFighting(n_robots=3, rng=1)


def names_in(folder):
    return sorted(path.name for path in folder.iterdir())


def recorded(path, steps, **options):
    model = small()
    with model.record(path, **options):
        model.run(steps)
    return path


@pytest.fixture
def seven(tmp_path):
    """Return the path of a recording of seven steps, and its bytes."""
    path = recorded(tmp_path / "run.arrow", 7)
    return path, path.read_bytes()


def test_the_old_recording_stays_until_the_new_one_has_rows_and_can_then_be_read(seven):
    path, before = seven
    model = small()
    recorder = model.record(path, overwrite=True)
    model.step()
    assert path.read_bytes() == before
    recorder.flush()
    assert len(Recording(path)) == 1
    assert names_in(path.parent) == ["run.arrow"]
    model.run(20)
    assert Recording(path).steps.tolist() == list(range(1, 22))
    recorder.close()
    assert Recording(path).complete
    assert names_in(path.parent) == ["run.arrow"]


def test_a_recording_that_replaces_another_has_the_rows_of_one_that_replaces_none(seven, tmp_path):
    path, _ = seven
    recorded(path, 30, overwrite=True)
    other = Recording(recorded(tmp_path / "other.arrow", 30))
    assert [Recording(path)[-1].step, len(Recording(path))] == [other[-1].step, len(other)]


def test_one_that_is_closed_without_rows_replaces_too_and_one_that_is_broken_off_does_not(seven):
    path, before = seven
    with pytest.raises(ZeroDivisionError), small().record(path, overwrite=True):
        1 / 0  # noqa: B018
    assert path.read_bytes() == before

    class Broken(FireFighting):
        def step(self):
            raise KeyboardInterrupt

    model = Broken(n_robots=2, rng=1)
    recorder = model.record(path, overwrite=True, rerun=False)
    with pytest.raises(KeyboardInterrupt):
        model.run(5)
    assert recorder.closed
    assert path.read_bytes() == before
    assert names_in(path.parent) == ["run.arrow"]
    small().record(path, overwrite=True).close()
    assert len(Recording(path)) == 0


@pytest.mark.parametrize("room", [0, 2_000, 12_000, 40_000])
def test_on_a_full_disk_the_old_recording_is_whole_or_the_new_one_has_the_rows_that_it_claims(tmp_path, room):
    with small_disk(tmp_path / "disk", 512) as disk:
        path = recorded(disk / "run.arrow", 7)
        before = path.read_bytes()
        _fill(disk, room)
        model = small()
        with pytest.raises(RecordingError) as error, model.record(path, overwrite=True):
            model.run(20_000)
        text = str(error.value)
        assert text.startswith(f"{path} cannot be written: No space left on device; ")
        if "is untouched" in text:
            assert path.read_bytes() == before
        else:
            assert f"its {len(Recording(path))} rows so far remain" in text
        assert names_in(disk) == ["ballast", "run.arrow"]


@pytest.mark.parametrize("room", [0, 4_096, 12_000, 20_000])
def test_a_new_recording_without_rows_does_not_stay_on_a_full_disk(tmp_path, room):
    with small_disk(tmp_path / "disk", 512) as disk:
        _fill(disk, room)
        model = small()
        with pytest.raises(RecordingError, match=r"No space left on device; (no row|its \d+ rows)") as error:
            model.record(disk / "run.arrow") and model.run(20_000)
        has_rows = "rows so far" in str(error.value)
        assert names_in(disk) == (["ballast", "run.arrow"] if has_rows else ["ballast"])
        assert not has_rows or len(Recording(disk / "run.arrow"))


def _fill(disk, room):
    """Fill a disk except for a number of bytes."""
    with (disk / "ballast").open("wb", buffering=0) as ballast:
        try:
            while True:
                ballast.write(b"x" * 4096)
        except OSError:
            ballast.truncate(max(0, ballast.tell() - room))


@POSIX
def test_a_kill_before_the_first_rows_leaves_the_old_recording_and_the_next_one_tidies_up(seven):
    path, before = seven
    child = os.fork()
    if not child:
        model = small()
        recorder = model.record(path, overwrite=True)
        model.step()
        os.kill(os.getpid() if not recorder.closed else 0, signal.SIGKILL)
    os.waitpid(child, 0)
    assert path.read_bytes() == before
    assert names_in(path.parent) == [".run.arrow.0.draft", "run.arrow"]
    recorded(path, 12, overwrite=True)
    assert names_in(path.parent) == ["run.arrow"]
    assert len(Recording(path)) == 12


@POSIX
@pytest.mark.parametrize("overwritten", [False, True])
def test_what_another_process_is_recording_is_not_replaced(tmp_path, overwritten):
    path = tmp_path / "run.arrow"
    if overwritten:
        recorded(path, 3)
    read, write = os.pipe()
    child = os.fork()
    if not child:
        model = small()
        model.record(path, overwrite=overwritten)
        model.run(10)
        os.write(write, b"!")
        signal.pause()
    os.read(read, 1)
    with pytest.raises(RecordingError, match="is being recorded by another program; wait"):
        small().record(path, overwrite=True)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    assert len(Recording(path)) == 10
    assert names_in(tmp_path) == ["run.arrow"]
    recorded(path, 4, overwrite=True)
    assert len(Recording(path)) == 4


@POSIX
@pytest.mark.parametrize("overwritten", [False, True])
def test_a_closed_recording_can_be_replaced_though_a_child_that_was_forked_meanwhile_has_it_open(tmp_path, overwritten):
    path = tmp_path / "run.arrow"
    if overwritten:
        recorded(path, 3)
    model = small()
    recorder = model.record(path, overwrite=overwritten)
    model.run(12)
    with forked():
        recorder.close()
        recorded(path, 4, overwrite=True)
    assert len(Recording(path)) == 4


@POSIX
def test_a_child_that_lets_go_of_a_recording_leaves_it_locked_for_who_records_it(tmp_path):
    model = small()
    recorder = model.record(tmp_path / "run.arrow")
    model.run(12)
    child = os.fork()
    if not child:
        try:
            recorder._buffer.writer._release()
        finally:
            os._exit(0)
    os.waitpid(child, 0)
    assert is_locked(tmp_path / "run.arrow")
    recorder.close()
    assert not is_locked(tmp_path / "run.arrow")


@POSIX
@pytest.mark.parametrize("late", [False, True])
def test_a_recording_whose_draft_was_deleted_is_refused_and_the_old_one_remains(seven, late):
    path, before = seven
    model = small()
    recorder = model.record(path, overwrite=True)
    model.step()
    (path.parent / ".run.arrow.0.draft").unlink()
    if late:  # another file of that name is not ours either
        (path.parent / ".run.arrow.0.draft").write_text("other text")
    with pytest.raises(RecordingError, match=r"was not replaced: the draft .* was deleted; record again") as error:
        recorder.close()
    assert len(str(error.value).splitlines()) == 1
    assert len(str(error.value)) <= 300
    assert path.read_bytes() == before
    assert recorder.closed
    assert recorder.written.rows == 0


def test_a_recorder_that_was_left_open_gives_way_to_the_next_one_of_the_same_process(tmp_path):
    path = tmp_path / "run.arrow"
    models = small(), small()
    left_open = models[0].record(path)
    models[0].run(15)
    with models[1].record(path, overwrite=True):
        models[1].run(10)
    models[0].run(15)
    left_open.close()
    assert len(Recording(path)) == 10
    assert names_in(tmp_path) == ["run.arrow"]


def test_two_that_replace_one_file_at_once_leave_one_whole_recording(seven):
    path, _ = seven
    models = small(), small()
    recorders = [model.record(path, overwrite=True) for model in models]
    for model, recorder in zip(models, recorders, strict=True):
        model.run(20)
        recorder.close()
    assert Recording(path).complete
    assert len(Recording(path)) == 20
    assert names_in(path.parent) == ["run.arrow"]


def test_ctrl_c_just_after_the_name_was_taken_neither_loses_rows_nor_leaves_a_draft(seven, monkeypatch):
    path, _ = seven
    model = small()
    recorder = model.record(path, overwrite=True)
    model.step()
    with monkeypatch.context() as patch:
        patch.setattr(SealedWriter, "_take_name", _interrupted(SealedWriter._take_name))
        with pytest.raises(KeyboardInterrupt):
            recorder.flush()
    model.step()
    recorder.close()
    assert Recording(path).steps.tolist() == [1, 2]
    assert names_in(path.parent) == ["run.arrow"]


def _interrupted(take_name):
    def call(self):
        place = self._place
        take_name(self)
        self._place = place  # as if the interrupt had come before this was noted
        raise KeyboardInterrupt

    return call


@pytest.mark.parametrize("name", ["a.mp4", "a.CSV", "a.toml", "a.npz", "a.parquet", "a.svg", "a.arrow.gz", "a.py"])
def test_endings_of_other_kinds_of_files_are_refused_before_a_file_is_made(tmp_path, name):
    with pytest.raises(RecordingError, match=r"suffix of another kind of file; expected a name such as a.*\.arrow"):
        small().record(tmp_path / name)
    assert names_in(tmp_path) == []


@pytest.mark.parametrize("name", ["run", "run.arrow", "run.ARROW", "run.arrows", "run.ipc", "speed_0.5", "run.2"])
def test_other_names_of_recordings_are_taken(tmp_path, name):
    small().record(tmp_path / name).close()
    assert len(Recording(tmp_path / name)) == 0


@POSIX
def test_what_is_no_regular_file_is_never_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for place in (tmp_path / "pipe", "/dev/null", tmp_path):
        for overwrite in (False, True):
            with pytest.raises(RecordingError, match=r"cannot be written: it is (not a regular file|a folder)"):
                small().record(place, overwrite=overwrite)
    assert (tmp_path / "pipe").is_fifo()


def test_threads_that_record_different_files_do_not_disturb_each_other(tmp_path):
    def work(number):
        for _ in range(3):
            recorded(tmp_path / f"{number}.arrow", 5, overwrite=True)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [len(Recording(tmp_path / f"{number}.arrow")) for number in range(4)] == [5] * 4
