"""No damage to a file makes a wrong frame: what is read is a prefix of what was written, or a clear error."""

import os
import random
import signal
import subprocess
import sys
import time

import pyarrow as pa
import pytest

from mesa_swarm.base.errors import RecordingError
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.recording import Recording, verify
from mesa_swarm.recording.sealed_stream import END_OF_STREAM, SealedReader, SealedWriter

ENDLESS = """
import sys
from mesa_swarm.models.fire_fighting import FireFighting
model = FireFighting(n_robots=12, strategy="A", k2=0.001, rng=5)
recorder = model.record(sys.argv[1])
print("begun", flush=True)
while True:
    model.run(20)
    recorder.flush()
    print(model.steps, flush=True)
"""


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Return the bytes of a small recording, and its frames' bytes."""
    path = tmp_path_factory.mktemp("short") / "run.arrow"
    model = FireFighting(n_robots=2, rng=5)
    with model.record(path, columns=("position", "fires")) as recorder:
        for _ in range(4):
            model.run(5)
            recorder.flush()
    return path.read_bytes(), frames_of(Recording(path))


def frames_of(recording):
    return [
        (frame.step, frame.state_hash, *(frame[name].tobytes() for name in recording.columns)) for frame in recording
    ]


def check_prefix(path, content, whole):
    """Read damaged bytes: a clear error, or frames that are all right."""
    path.write_bytes(content)
    try:
        read = frames_of(Recording(path))
    except RecordingError as error:
        assert str(path) in str(error)
        assert "\n" not in str(error)
        return None
    assert read == whole[: len(read)]
    return len(read)


def test_any_arrow_reader_reads_a_recording(recorded):
    with pa.OSFile(str(recorded)) as file:
        table = pa.ipc.open_stream(file).read_all()
    assert table.num_rows == 600
    assert table["step"].to_pylist() == list(range(1, 601))
    assert len(table["position"][0]) == 12


def test_a_recording_ends_as_arrow_streams_end(recorded):
    assert recorded.read_bytes().endswith(END_OF_STREAM)
    assert Recording(recorded).complete


@pytest.mark.parametrize("every", [7, pytest.param(1, marks=pytest.mark.slow)])
def test_a_recording_that_is_torn_anywhere_in_its_last_chunk_keeps_all_chunks_before(short, tmp_path, every):
    content, whole = short
    path = tmp_path / "torn.arrow"
    path.write_bytes(content)
    last = SealedReader(path).pieces[-1]
    # Where a part of the chunk begins or ends, byte by byte.
    edges = {place + k for place in (last.batch, last.seal, last.end) for k in range(-8, 9)}
    for length in sorted({*range(last.batch, last.end, every), *(edges & set(range(last.batch, last.end)))}):
        path.write_bytes(content[:length])
        recording = Recording(path)
        assert frames_of(recording) == whole[:15]
        assert not recording.complete
        assert recording.lost == length - last.batch


def test_a_recording_that_lacks_its_end_keeps_every_row(short, tmp_path):
    content, whole = short
    for missing in range(1, len(END_OF_STREAM) + 1):
        assert check_prefix(tmp_path / "torn.arrow", content[:-missing], whole) == 20
        assert not Recording(tmp_path / "torn.arrow").complete


def test_a_recording_that_is_torn_in_its_header_is_refused(short, tmp_path):
    content, whole = short
    path = tmp_path / "torn.arrow"
    path.write_bytes(content)
    first = SealedReader(path).attached[0].batch  # the checkpoint at the start follows the header
    for length in range(0, first, 37):
        assert check_prefix(path, content[:length], whole) is None


def flipped(path, content, place):
    """Return the recording with another bit somewhere."""
    path.write_bytes(content[:place] + bytes([content[place] ^ 4]) + content[place + 1 :])
    return Recording(path)


def test_a_flipped_bit_of_a_closed_recording_is_reported_as_damage_wherever_it_is(short, tmp_path):
    content, _ = short
    path = tmp_path / "flipped.arrow"
    path.write_bytes(content)
    reader = SealedReader(path)
    begin, rest = reader.attached[0].batch, reader.pieces[1]
    for place in range(begin, len(content) - len(END_OF_STREAM), 41):
        recording = flipped(path, content, place)
        # Bytes that only fill up the last seal are sealed by none.
        assert recording.damage or place > reader.pieces[-1].seal, place
    second = flipped(path, content, (rest.batch + rest.seal) // 2)
    assert second.damage == "is damaged after step 5: 5 rows are whole, the rest is not read"


def test_what_tears_a_closed_recording_apart_is_damage_and_not_the_end_of_a_killed_run(short, tmp_path):
    content, _ = short
    path = tmp_path / "flipped.arrow"
    path.write_bytes(content)
    second = SealedReader(path).pieces[1]
    recording = flipped(path, content, second.batch + 5)  # how long the next message is
    assert (len(recording), recording.complete) == (5, False)
    assert recording.damage.startswith("is damaged after step 5: 5 rows are whole")
    # Also where the run was killed later: whole chunks follow.
    assert flipped(path, content[:-60], second.batch + 5).damage == recording.damage


def test_a_run_that_was_killed_is_not_called_damaged(short, tmp_path):
    content, _ = short
    path = tmp_path / "torn.arrow"
    path.write_bytes(content)
    last = SealedReader(path).pieces[-1]
    for length in range(last.batch, len(content), 7):
        path.write_bytes(content[:length])
        assert Recording(path).damage == ""
    path.write_bytes(content[: last.batch + 30] + bytes(200))  # a power cut leaves holes
    assert Recording(path).damage == ""


def flip(short, path, seed, count):
    content, whole = short
    draw = random.Random(seed)
    for _ in range(count):
        place = draw.randrange(len(content))
        damaged = bytearray(content)
        damaged[place] ^= 1 << draw.randrange(8)
        check_prefix(path, bytes(damaged), whole)


@pytest.mark.slow
def test_a_flipped_bit_never_makes_a_wrong_frame(short, tmp_path):
    flip(short, tmp_path / "flipped.arrow", seed=1, count=200)


@pytest.mark.slow
def test_a_flipped_bit_never_makes_a_wrong_frame_in_many_tries(short, tmp_path):
    flip(short, tmp_path / "flipped.arrow", seed=2, count=2000)


def test_what_is_not_a_recording_is_refused_in_words(tmp_path):
    for content in (b"", b"ARROW1\0\0", b"hello" * 1000, b"\xff" * 64, END_OF_STREAM):
        (tmp_path / "other").write_bytes(content)
        with pytest.raises(RecordingError, match="is not a recording"):
            Recording(tmp_path / "other")
    with pytest.raises(RecordingError, match="No such file"):
        Recording(tmp_path / "missing.arrow")
    with pytest.raises(RecordingError, match="cannot be read"):
        Recording(tmp_path)


def test_another_arrow_stream_is_refused_in_words(tmp_path):
    table = pa.table({"step": [1, 2]})
    with pa.ipc.new_stream(str(tmp_path / "other.arrow"), table.schema) as writer:
        writer.write_table(table)
    with pytest.raises(RecordingError, match="is not a recording"):
        Recording(tmp_path / "other.arrow")


def kill_while_recording(path, seconds, flushes):
    """Start a run, kill it some seconds after a number of flushes, and return the steps that it printed as on disk."""
    with subprocess.Popen([sys.executable, "-c", ENDLESS, str(path)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "begun\n"
        printed = ["0", *(process.stdout.readline() for _ in range(flushes))]
        time.sleep(seconds)
        process.send_signal(signal.SIGKILL)
        printed += process.stdout.read().split("\n")[:-1]
    return int(printed[-1])


def check_killed(path, seconds, flushes=0):
    on_disk = kill_while_recording(path, seconds, flushes)
    recording = Recording(path)
    assert len(recording) >= on_disk
    assert recording.steps.tolist() == list(range(1, len(recording) + 1))
    assert not recording.complete
    return recording


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
def test_a_killed_run_keeps_all_chunks_that_were_written(tmp_path):
    recording = check_killed(tmp_path / "run.arrow", 0.1, flushes=3)
    assert len(recording) > 0
    assert verify(recording, FireFighting).same


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="there is no SIGKILL")
def test_runs_killed_at_thirty_moments_keep_all_chunks_that_were_written(tmp_path):
    draw = random.Random(3)
    for number in range(30):
        check_killed(tmp_path / f"{number}.arrow", draw.uniform(0.0, 0.8))


# ---- pieces that a thread writes


def batch_of(*numbers):
    return pa.record_batch([pa.array(numbers)], ["n"])


def test_a_piece_that_is_written_later_stands_before_whatever_is_written_after_it(tmp_path):
    writer = SealedWriter(tmp_path / "stream.arrow", batch_of(1).schema, overwrite=False)

    def write():
        time.sleep(0.05)
        writer.write_now(batch_of(1, 2), 1)

    writer.write_later(write, 2)
    assert writer.rows == 2
    writer.write(batch_of(3), 3)
    writer.write_later(write, 2)
    writer.attach("moves", b"left", 4)
    assert (writer.rows, writer.sealed.rows) == (5, 5)
    writer.write_later(write, 2)
    writer.close()
    reader = SealedReader(tmp_path / "stream.arrow")
    assert [(piece.rows, piece.step) for piece in reader.pieces] == [(2, 1), (1, 3), (2, 1), (2, 1)]
    assert reader.attached[0].begin > reader.pieces[2].begin
    assert reader.complete


def test_what_a_thread_could_not_write_is_raised_by_whatever_comes_next_and_once(tmp_path):
    writer = SealedWriter(tmp_path / "stream.arrow", batch_of(1).schema, overwrite=False)

    def fail():
        raise RecordingError("disk full")

    for after in (lambda: writer.write(batch_of(1), 1), lambda: writer.attach("moves", b"", 1), writer.sync):
        writer.write_later(fail, 1)
        with pytest.raises(RecordingError, match="disk full"):
            after()
        assert writer.rows == 0
    writer.write(batch_of(1), 1)
    writer.close()
    assert [piece.rows for piece in SealedReader(tmp_path / "stream.arrow").pieces] == [1]


def test_a_stream_that_is_abandoned_waits_for_its_thread_and_writes_no_more(tmp_path):
    writer = SealedWriter(tmp_path / "stream.arrow", batch_of(1).schema, overwrite=False)
    writer.write_later(lambda: (time.sleep(0.05), writer.write_now(batch_of(1, 2), 1)), 2)
    writer.abandon()
    assert writer.closed
    size = (tmp_path / "stream.arrow").stat().st_size if (tmp_path / "stream.arrow").exists() else 0
    time.sleep(0.1)
    assert ((tmp_path / "stream.arrow").stat().st_size if size else 0) == size
