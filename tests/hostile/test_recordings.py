"""Whatever a recording contains, each reader of it answers, or refuses in one line, with bounded time and memory."""

import json
import warnings

import numpy as np
import pytest

from mesa_swarm import SwarmModel
from mesa_swarm.base.errors import ExportError, RecordingError
from mesa_swarm.dashboard.replay.replaying import ReplayPlayer
from mesa_swarm.models.boids import Boids
from mesa_swarm.models.cooperative_transport import CooperativeTransport
from mesa_swarm.models.fire_fighting import FireFighting
from mesa_swarm.models.q_learning import QLearning
from mesa_swarm.recording import Recording, verify
from mesa_swarm.recording.resume import shipped_class_of
from mesa_swarm.viewing.export import export
from mesa_swarm.viewing.frame_bytes import packed_frame
from mesa_swarm.viewing.replay_page import Reel, replay_page
from mesa_swarm.viewing.replay_server import ReplayServer
from mesa_swarm.viewing.scene import scene_of_recording
from support import forging
from support.hostile import attack

pytestmark = pytest.mark.slow

REFUSALS = (RecordingError, ExportError)
LONGEST = 300
STEPS = 12


def whole_columns(path, place):
    recording = Recording(path)
    for name in recording.columns:
        try:
            recording[name]
        except ValueError:  # a table, or robots were added or removed
            recording.to_pandas(name) if name in ("fires", "contacts", "loads") else None
    recording.to_pandas()


def facts(path, place):
    recording = Recording(path)
    repr(recording), recording.damage, recording.why_short, recording.hashes, recording.steps.tolist()
    json.dumps(recording.provenance)
    recording.changes, recording.sceneries, [str(one) for one in recording.interventions]
    [recording.checkpoint(number) for number in range(len(recording.checkpoints))]


def frames(path, place):
    recording = Recording(path)
    scene = scene_of_recording(recording)
    for frame in recording:
        packed_frame(frame, scene)


def replayed(path, place):
    replay_page(Recording(path))


def served(path, place):
    reel = Reel(Recording(path))
    with ReplayServer(reel):
        [reel.chunk(number) for number in range(reel.chunks)]
        json.dumps(reel.events)


def projected(path, place):
    player = ReplayPlayer(path)
    while not player.finished and not player.error:
        player.step()
    player.close()
    if player.error:
        assert len(player.error) <= LONGEST


def verified(path, place):
    recording = Recording(path)
    str(verify(recording, shipped_class_of(recording)))


def resumed(path, place):
    SwarmModel.resume(path)


def resumed_early(path, place):
    recording = Recording(path)
    if len(recording):
        SwarmModel.resume(path, step=recording[0].step)


def written(ending, **options):
    def reader(path, place):
        export(path, place / f"out{ending}", overwrite=True, **options)

    reader.__name__ = f"export_{ending[1:]}"
    return reader


READERS = (facts, whole_columns, frames, replayed, served, projected, verified, resumed, resumed_early,
           written(".csv"), written(".png", sectors=True, trails=3, size=(64, 64)))  # fmt: skip
RARE = (*READERS, written(".html"), written(".svg", animate=True), written(".gif", size=(64, 64)), written(".parquet"))


def read_all(path, place, readers=READERS):
    """Call each reader; raise what none of them may raise, or that all have refused."""
    refused = None
    for reader in readers:
        try:
            reader(path, place)
        except REFUSALS as error:
            text = str(error)
            assert 0 < len(text.splitlines()[0]) == len(text) <= LONGEST, f"{reader.__name__}: {text!r:.100}"
            refused = error
        except BaseException as error:
            raise AssertionError(f"{reader.__name__}: {type(error).__name__}: {error}") from error
    if refused is not None:
        raise refused


def by_hand(model, change, path, **options):
    with model.record(path, **options):
        model.run(STEPS // 3)
        change(model)
        model.run(STEPS - STEPS // 3)
    return path


def with_fewer(model):
    model.remove_robots(model.robots[:1])
    model.extinguish_range = 20.0


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Return paths of several small recordings."""
    home = tmp_path_factory.mktemp("recordings")

    def nothing(model):
        pass

    made = {
        "boids": (Boids(n_robots=3, rng=1), nothing, {"checkpoint_every": 0}),
        "fires": (FireFighting(n_robots=3, rng=1, communication="goal"), with_fewer, {"checkpoint_every": 5}),
        "learners": (QLearning(n_robots=2, rng=1), nothing, {"checkpoint_every": 6, "every": 2}),
        "loads": (CooperativeTransport(n_robots=2, rng=1), nothing, {"checkpoint_every": 1000, "exact": True}),
    }
    paths = {
        name: by_hand(model, change, home / f"{name}.arrow", **options)
        for name, (model, change, options) in made.items()
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for path in paths.values():  # compiled and imported before anything is measured
            read_all(path, home, RARE)
    return paths


def quiet(work):
    def quietly(given):
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            return work(given)

    return quietly


def test_recordings_of_this_version_pass_through_every_reader_and_the_forge(recordings, tmp_path):
    for name, path in recordings.items():
        again = forging.put_together(forging.taken_apart(path), tmp_path / f"{name}.arrow")
        assert again.read_bytes() == path.read_bytes()


def test_forged_recordings_are_read_or_refused(recordings, tmp_path, tally, amount):
    parts = {name: forging.taken_apart(path) for name, path in recordings.items()}
    path = tmp_path / "forged.arrow"

    def work(seed):
        name, number = seed
        other, what = forging.forged(parts[name], np.random.default_rng(number))
        try:
            forging.put_together(other, path)
        except (ValueError, TypeError, OverflowError):  # not even Arrow can write it
            return
        try:
            read_all(path, tmp_path, RARE if number % 20 == 0 else READERS)
        except REFUSALS:
            raise
        except BaseException as error:
            raise AssertionError(f"{what}: {error}") from error

    inputs = [(f"{name} {number}", (name, number)) for number in range(amount(25, 5000)) for name in parts]
    tally("recordings: forged, right checksums").add(attack(quiet(work), inputs, refusals=REFUSALS, cpu=5, memory=500))


def test_mutated_bytes_are_read_or_refused(recordings, tmp_path, tally, amount):
    contents = {name: path.read_bytes() for name, path in recordings.items()}
    path = tmp_path / "mutated.arrow"

    def work(seed):
        name, number = seed
        path.write_bytes(mutated(contents[name], np.random.default_rng(number)))
        read_all(path, tmp_path)

    inputs = [(f"{name} {number}", (name, number)) for number in range(amount(8, 3000)) for name in contents]
    tally("recordings: bytes mutated").add(attack(quiet(work), inputs, refusals=REFUSALS, cpu=5, memory=500))


def mutated(content, rng):
    """Return bytes of which some are flipped, cut off, left out, doubled, exchanged or replaced."""
    other = bytearray(content)
    for _ in range(rng.integers(1, 4)):
        begin, end = sorted(rng.integers(0, len(other) + 1, size=2).tolist())
        end = min(end, begin + int(rng.choice([1, 8, 64, 1000, len(other)])))
        match rng.integers(6):
            case 0:
                other[begin : begin + 1] = bytes([rng.integers(256)])
            case 1:
                del other[begin:end]
            case 2:
                other[begin:begin] = other[begin:end]
            case 3:
                other[begin:end] = bytes(end - begin)
            case 4:
                other[begin:end] = rng.bytes(end - begin)
            case 5:
                other[begin:end] = b"\xff" * (end - begin)
    return bytes(other)
