import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.recording import Recording
from mesa_swarm.recording.frames import frame_of
from mesa_swarm.viewing.frame_bytes import PACKED_FROM, _coded, drawn_columns, packed_chunk, packed_rows
from mesa_swarm.viewing.scene import COLUMNS, scene_of, scene_of_recording
from support.unpacking import Reader, unpacked_chunk

WORLD = {
    "bounds": [-50.0, 10.0, 750.0, 610.0],
    "reach": 60.0,
    "fastest": 2.0,
    "columns": [
        {"name": name, "table": table, "width": width, "type": kind} for name, (table, width, kind) in COLUMNS.items()
    ],
}


def check(rows, frames, world):
    """Assert that frames are the rows to within the limits of the format."""
    width, height = np.subtract(world["bounds"][2:], world["bounds"][:2])
    within = {
        "distance": world["reach"] / 254 / 2,
        "command": world["fastest"] / 127 / 2,
        "heat": 0.5 / 200,
        "heard": max(width, height) / 65534 / 2,
        "fires": 0.5 / 255,
    }
    slack = 1 + 1e-4  # float32
    assert len(rows) == len(frames)
    for (wanted_step, wanted), (step, columns) in zip(rows, frames, strict=True):
        assert step == wanted_step
        for name in columns:
            given, got = wanted[name].astype(float), columns[name].astype(float)
            assert given.shape == got.shape, name
            if name in ("pose", "loads"):
                check_poses(given[:, -3:], got[:, -3:], width, height)
            elif name == "contacts":
                np.testing.assert_array_equal(given[:, 0], got[:, 0])
                assert (np.abs(np.sin((given[:, 1] - got[:, 1]) / 2)) <= np.pi / 256 / 2 * slack).all()
            else:
                np.testing.assert_allclose(got, given, rtol=0, atol=within.get(name, 0) * slack, err_msg=name)


def check_poses(given, got, width, height):
    slack = 1e-4  # float32 at 800
    assert (np.abs(given[:, 0] - got[:, 0]) <= width / 65535 / 2 + slack).all()
    assert (np.abs(given[:, 1] - got[:, 1]) <= height / 65535 / 2 + slack).all()
    assert (np.abs(np.sin((given[:, 2] - got[:, 2]) / 2)) <= np.pi / 65536 / 2 + 1e-6).all()


@given(
    table=st.sampled_from([np.uint8, np.uint16]).flatmap(
        lambda kind: arrays(kind, st.tuples(st.integers(1, 9), st.integers(0, 5)))
    ),
    order=st.integers(1, 2),
)
def test_tracks_come_back_as_they_were(table, order):
    reader = Reader(_coded(table, order))
    again = reader.track(*table.shape, table.dtype.type, order)
    np.testing.assert_array_equal(again, table)
    assert reader.at == len(reader.packed)


@st.composite
def row_lists(draw):
    """Draw a few rows of a world in which robots may come and go, with values up to their limits."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    sensors, f, k = (draw(st.integers(0, 3)) for _ in range(3))
    fires, n, rows = rng.uniform(10, 600, (f, 3)).astype(np.float32), draw(st.integers(0, 4)), []
    for step in range(draw(st.integers(1, 8))):
        n = draw(st.integers(0, 4)) if draw(st.integers(0, 3)) == 0 else n
        rows.append(drawn_row(rng, step, n, sensors, fires, k))
    return rows


def drawn_row(rng, step, n, sensors, fires, k):
    low, high = np.array(WORLD["bounds"]).reshape(2, 2)

    def poses(count):
        return np.column_stack([rng.uniform(low, high, (count, 2)), rng.uniform(-np.pi, np.pi, count)])

    seen, heard, met = rng.random((n, sensors)) < 0.5, rng.random((n, 1)) < 0.5, rng.integers(0, n + 1)
    burning = np.column_stack([rng.random(len(fires)), rng.integers(0, 9, len(fires)), rng.integers(0, 2, len(fires))])
    columns = {
        "ids": np.arange(n)[:, None] + 7,
        "pose": poses(n),
        "distance": np.where(seen, rng.choice([0.0, 60.0, 31.7], (n, sensors)), -1.0),
        "kind": np.where(seen, rng.integers(0, 4, (n, sensors)), -1),
        "command": rng.uniform(-2, 2, (n, 2)),
        "heat": rng.uniform(0, 1.2, (n, 1)),
        "heard": np.where(heard, rng.uniform(low, high, (n, 2)), np.nan),
        "layer": rng.integers(-1, 5, (n, 1)),
        "hot": rng.integers(0, 2, (n, 1)),
        "design": np.zeros((n, 1)),
        "value": rng.integers(-1, 17, (n, 1)),
        "label": rng.integers(-128, 128, (n, 12)),
        "fires": np.column_stack([fires, burning]),
        "loads": np.column_stack([np.arange(k), poses(k)]),
        "contacts": np.column_stack([np.arange(met), rng.uniform(-np.pi, np.pi, met)]),
    }
    typed = {name: values.astype(f"<{COLUMNS[name][2]}") for name, values in columns.items()}
    return step, typed


@settings(max_examples=60, deadline=None)
@given(rows=row_lists())
def test_chunks_hold_rows_to_the_stated_precision_also_when_robots_come_and_go(rows):
    check(rows, unpacked_chunk(packed_rows(rows, WORLD), WORLD), WORLD)


@pytest.mark.slow
def test_chunks_of_recordings_hold_their_frames(fires, transport):
    for path in (fires, transport):
        recording = Recording(path)
        scene = scene_of_recording(recording)
        rows = [(frame.step, drawn_columns(frame, scene)) for frame in recording]
        check(rows, unpacked_chunk(packed_chunk(recording, scene), scene.world()), scene.world())


@pytest.mark.slow
def test_positions_are_right_to_the_promised_fraction_of_the_map_after_any_number_of_steps():
    model = SwarmModel(rng=1)
    model.add_robots(AGENT9, poses=[(33.337, 44.441, 3.1415)])
    scene = scene_of(model)
    frame = frame_of(model, PACKED_FROM)
    frames = unpacked_chunk(packed_chunk([frame] * 1000, scene), scene.world())
    check([(frame.step, drawn_columns(frame, scene))] * 1000, frames, scene.world())
