"""Full disks and read-only folders: one clear line, nothing lost, and one goes on when there is room."""

import pytest

from mesa_swarm import cli
from mesa_swarm.base.errors import RecordingError, SwarmError
from mesa_swarm.base.files import write_all
from mesa_swarm.experiments.sweep import sweep
from mesa_swarm.model.gallery import find_model
from mesa_swarm.recording import Recording
from support.disks import read_only, small_disk

FIRE = find_model("fire_fighting")


@pytest.fixture
def full(tmp_path):
    """Return a disk of 64 KB and a function that fills it up to a few bytes, or makes room again."""
    with small_disk(tmp_path / "disk", 64) as disk:

        def fill(left):
            (disk / "ballast").unlink(missing_ok=True)
            if left is None:
                return
            with (disk / "ballast").open("wb", buffering=0) as ballast:
                while True:
                    try:
                        ballast.write(b"x" * 4096)
                    except OSError:
                        break
                ballast.truncate(ballast.tell() - left)

        yield disk, fill


def typed(capsys, *words):
    with pytest.raises(SystemExit) as left:
        cli.main(list(map(str, words)))
    return left.value.code or 0, capsys.readouterr().err


def test_a_recording_on_a_disk_that_fills_up_keeps_its_rows_and_the_model_may_go_on(full):
    disk, _ = full
    model = FIRE(n_robots=2, rng=1)
    model.record(disk / "run.arrow")
    with pytest.raises(RecordingError, match=r"No space left on device; its [0-9]+ rows so far remain"):
        model.run(5_000)
    recording = Recording(disk / "run.arrow")
    assert recording.steps.tolist() == list(range(1, len(recording) + 1))
    assert len(recording) > 0
    step = model.steps
    assert model.run(3).steps == step + 3


@pytest.mark.slow
def test_a_sweep_on_a_disk_that_fills_up_goes_on_when_there_is_room(full, tmp_path):
    disk, fill = full
    how = {"seeds": 30, "steps": 3, "jobs": 1}
    whole = sweep(FIRE, out=tmp_path / "whole", **how).path.read_bytes()
    fill(4096)
    with pytest.raises(SwarmError, match="No space left on device"):
        sweep(FIRE, out=disk / "out", **how)
    fill(None)
    made = sweep(FIRE, out=disk / "out", **how)
    assert 0 < made.done_before < 30
    assert made.path.read_bytes() == whole


def test_the_table_on_a_full_disk_is_not_half_written_and_no_run_is_done_again(full):
    disk, fill = full
    how = {"seeds": 3, "steps": 3, "jobs": 1}
    before = sweep(FIRE, out=disk / "out", **how).path.read_bytes()
    fill(0)
    with pytest.raises(SwarmError, match="No space left on device"):
        sweep(FIRE, out=disk / "out", **{**how, "seeds": 2})
    assert (disk / "out" / "runs.parquet").read_bytes() == before
    assert sorted(path.name for path in (disk / "out").iterdir()) == ["ledger.jsonl", "runs.parquet"]


def test_commands_on_a_full_disk_fail_in_one_line(full, tmp_path, capsys, monkeypatch):
    disk, fill = full
    fill(0)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "job.toml").write_text("model = 'fire_fighting'\nsteps = 5\nseeds = 2\nrobots = 2\n")
    status, err = typed(capsys, "sweep", "job.toml", "--quiet", "--jobs", 1, "--out", disk / "out")
    assert (status, err.count("\n")) == (2, 1)
    assert "No space left on device" in err
    status, err = typed(capsys, "run", "job.toml", "--quiet", "--record", disk / "{seed}.arrow")
    assert (status, err.count("\n")) == (1, 2)
    assert err.count("No space left on device") == 2
    assert list(disk.glob("*.arrow")) == []


def test_a_sweep_whose_recordings_do_not_fit_names_the_file_and_leaves_no_part_of_it(full):
    disk, fill = full
    how = {"seeds": 2, "steps": 300, "jobs": 1, "record": {"exact": True}}
    fill(24_000)
    with pytest.raises(RecordingError, match=r"recordings/[0-9a-f]+\.arrow cannot be written: No space") as error:
        sweep(FIRE, out=disk / "out", **how)
    assert str(error.value).endswith("; make room and sweep again")
    assert list((disk / "out" / "recordings").iterdir()) == []


def test_files_that_belong_together_are_all_replaced_or_none_on_a_full_disk(full):
    disk, fill = full
    names = ["a.csv", "b.csv", "c.csv"]
    write_all(disk, dict.fromkeys(names, "old"))
    fill(12_288)
    with pytest.raises(SwarmError, match=r"c\.csv cannot be written: No space left on device; make room"):
        write_all(disk, {"a.csv": "new", "b.csv": "new", "c.csv": "new" * 4096})
    assert [(disk / name).read_text() for name in names] == ["old"] * 3
    assert sorted(path.name for path in disk.iterdir()) == ["a.csv", "b.csv", "ballast", "c.csv"]


def test_a_drawing_of_a_map_on_a_full_disk_names_its_file(full, capsys):
    disk, fill = full
    fill(0)
    status, err = typed(capsys, "map", "show", "original", "--out", disk / "map.png")
    assert (status, err) == (
        2,
        f"mesa-swarm: {disk}/map.png cannot be written: No space left on device; make room or choose another place\n",
    )
    assert [path.name for path in disk.iterdir()] == ["ballast"]


def test_commands_in_a_read_only_folder_fail_in_one_line_before_anything_is_run(tmp_path, capsys, monkeypatch):
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "job.toml").write_text("model = 'fire_fighting'\nsteps = 5\nrecord = 'runs/{seed}.arrow'\n")
    with read_only(folder):
        monkeypatch.chdir(folder)
        printed = [
            typed(capsys, *words, "--quiet")
            for words in (("sweep", "job.toml"), ("run", "job.toml"), ("run", "boids", "--record", "run.arrow"))
        ]
        monkeypatch.chdir(tmp_path)
    assert [(status, err.count("\n")) for status, err in printed] == [(2, 1), (1, 1), (2, 1)]
    assert all("Read-only file system" in err or "Permission denied" in err for _, err in printed)
    assert [path.name for path in folder.iterdir()] == ["job.toml"]
