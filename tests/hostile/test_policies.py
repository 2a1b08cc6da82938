"""Hostile policy files: mutated bytes, forged headers and arrays, archives that swell; a LearningError of one line."""

import io
import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.control import Subsumption
from mesa_swarm.errors import SwarmError
from mesa_swarm.learning import PolicyLayer, load_policy, save_policy
from mesa_swarm.learning.networks import Networks
from mesa_swarm.learning.policy import SensorLayout
from mesa_swarm.learning.q_learning import QPolicy
from mesa_swarm.learning.reflex_policy import ReflexPolicy, genome_length
from mesa_swarm.learning.wire_learning import WirePolicy
from support.hostile import attack

pytestmark = pytest.mark.slow


def policies():
    rng, sensors = np.random.default_rng(1), SensorLayout.of(AGENT9)
    reflex = ReflexPolicy.of_genome(sensors, rng.normal(size=genome_length(sensors, 2)), units=2, steps=1)
    wires = WirePolicy(sensors=sensors, networks=Networks.random(12, inputs=len(sensors), rng=rng))
    return [QPolicy.untrained(AGENT9, rng=rng), wires, reflex]


@pytest.fixture
def files(tmp_path):
    return [save_policy(one, tmp_path / f"{k}.npz").read_bytes() for k, one in enumerate(policies())]


@pytest.fixture
def driven(tmp_path):
    def work(content):
        path = Path(tmp_path, "hostile.npz")
        path.write_bytes(content)
        policy = load_policy(path)
        model = SwarmModel(map="openspace", rng=1)
        model.add_robots(AGENT9, poses=[(100, 100, 0.0), (115, 100, 1.0)])
        model.control = Subsumption(PolicyLayer(policy=policy, explore=True))
        model.run(2)

    return work


def parts(content):
    """Return the header and the arrays of a policy's file."""
    with np.load(io.BytesIO(content)) as found:
        arrays = {name: found[name] for name in found.files}
    return json.loads(arrays.pop("header").tobytes()), arrays


def packed(header, arrays):
    file = io.BytesIO()
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    np.savez_compressed(file, header=np.frombuffer(text, np.uint8), **arrays)
    return file.getvalue()


def zipped(members, method=zipfile.ZIP_DEFLATED):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return file.getvalue()


def npy(shape, descr="<f8", content=b"", version=1):
    header = repr({"descr": descr, "fortran_order": False, "shape": shape}).encode() + b"\n"
    length = struct.pack("<H" if version == 1 else "<I", len(header))
    return b"\x93NUMPY" + bytes([version, 0]) + length + header + content


VALUES = [
    None,
    True,
    -1,
    0,
    0.5,
    1e308,
    float("nan"),
    float("inf"),
    2**62,
    10**400,
    "",
    "text",
    "x" * 5000,
    "a\nb",
    [],
    {},
]
VALUES += [
    [1],
    [[1]],
    [None],
    {"a": 1},
    [0.0] * 9,
    [10**400] * 9,
    ["a"] * 9,
    [0.0] * 20_000,
    "\ud800",
    3,
    "typed",
    "one-hot",
]
ARRAYS = [np.zeros(0), np.zeros((0, 0, 0)), np.zeros(()), np.full((4, 4), np.nan), np.zeros((3, 3), np.int8)]
ARRAYS += [
    np.zeros((1, 1, 1)),
    np.full((8, 10, 4), 1e308),
    np.array(["a"]),
    np.zeros((2, 3), complex),
    np.zeros((10**6, 2)),
]


def set_within(header, rng):
    """Set something in a header, at any depth, to a wrong value, or take it out."""
    place, found = header, None
    while isinstance(place, dict) and place:
        found, key = place, str(rng.choice(list(place)))
        if rng.random() < 0.4:
            break
        place = place[key]
    if rng.random() < 0.15:
        found.pop(key)
    else:
        found[key] = VALUES[rng.integers(len(VALUES))]


def forged(content, rng):
    header, arrays = parts(content)
    for _ in range(rng.integers(1, 3)):
        if rng.random() < 0.6:
            set_within(header, rng)
        else:
            name = str(rng.choice([*arrays, "more"]))
            arrays[name] = ARRAYS[rng.integers(len(ARRAYS))]
    return packed(header, arrays)


def mutated(content, rng):
    changed = bytearray(content)
    for _ in range(rng.integers(1, 6)):
        changed[rng.integers(len(changed))] = rng.integers(256)
    return bytes(changed[: rng.integers(1, len(changed))] if rng.random() < 0.2 else changed)


def handmade(content):
    header, arrays = parts(content)
    name, text = next(iter(arrays)), json.dumps(header).encode()
    head = npy((len(text),), "|u1", text)
    yield "deep header", packed(b"[" * 500_000, arrays)
    yield "deep objects", packed(b'{"a":' * 100_000, arrays)
    yield "long header", packed(b" " * (1 << 21), arrays)
    for shape in ((10**12,), (2**31, 2**31), (2**62, 4), (10**5, 10**5), (-1,), (2**70,), "x", (1.5,)):
        yield f"shape {shape}", zipped({"header.npy": head, f"{name}.npy": npy(shape)})
        yield f"header of shape {shape}", zipped({"header.npy": npy(shape, "|u1")})
    for descr in ("|O", "<U1000000000", "<f2", ">f8", "x", [("a", "<f8")] * 3, "|V1000000000", "<M8[ns]"):
        yield f"kind {descr}", zipped({"header.npy": head, f"{name}.npy": npy((1,), descr, b"\x80\x04N." * 100)})
    yield "long NPY header", zipped({"header.npy": head, "a.npy": npy((1,), "<f8" + " " * 60_000)})
    yield "huge NPY header", zipped({"header.npy": b"\x93NUMPY\x02\x00" + struct.pack("<I", 2**32 - 1) + b" " * 10**7})
    yield "zip bomb", zipped({"header.npy": head, "a.npy": npy((100 << 20,), "|u1", b"\0" * (100 << 20))})
    yield "larger bomb", zipped({"header.npy": head, "a.npy": npy((300 << 20,), "|u1", b"\0" * (300 << 20))})
    yield "many members", zipped({f"{k}.npy": b"" for k in range(60_000)})
    yield "65 members", zipped({f"{k}.npy": npy((0,)) for k in range(65)})
    yield "no arrays", zipped({"header": text, "a.txt": b"x" * 1000})
    yield "names that lead out", zipped({"header.npy": head, "../../a.npy": npy((0,))})
    yield "bzip2", zipped({"header.npy": head, "a.npy": npy((0,))}, zipfile.ZIP_BZIP2)
    yield "LZMA", zipped({"header.npy": head, "a.npy": npy((0,))}, zipfile.ZIP_LZMA)
    yield "a pickle", b"\x80\x04cos\nsystem\n(S'touch x'\ntR."
    yield "an NPY", npy((1,), "<f8", b"\0" * 8)
    yield "nothing", b""
    yield "text", b"x" * 1000
    yield "an empty archive", zipped({})


def test_a_policy_drives_or_is_refused_in_one_line(files, driven, tally, amount):
    for content in files:
        driven(content)  # compiles what all of them use
    rng = np.random.default_rng(1)
    inputs = {
        "hand-made": list(handmade(files[0])),
        "forged": [(f"forged {k}", forged(files[k % 3], rng)) for k in range(amount(120, 5000))],
        "mutated": [(f"mutated {k}", mutated(files[k % 3], rng)) for k in range(amount(120, 5000))],
    }
    for area, listed in inputs.items():
        tally(f"policies: {area}").add(attack(driven, listed, refusals=SwarmError, cpu=5, memory=500))
