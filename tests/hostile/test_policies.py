"""Hostile policies: mutated bytes, forged headers and graphs, archives that swell, endless loops; one line each."""

import io
import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from mesa_swarm import AGENT9, SwarmModel
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.control import Subsumption
from mesa_swarm.experiments.controllers import algorithm_of, load_controller
from mesa_swarm.learning import PolicyLayer, export_onnx, load_policy, save_policy
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


def packed_by_sb3(settings, method=zipfile.ZIP_STORED, **parts):
    """Return a file as Stable-Baselines3 packs it."""
    usual = {
        "data": settings,
        "policy.pth": b"x" * 5000,
        "_stable_baselines3_version": b"2.4.0",
        "system_info.txt": b"-",
    }
    return zipped({**usual, **parts}, method)


SPACES = {name: {":type:": "Box", ":serialized:": "gAWVAA=="} for name in ("observation_space", "action_space")}
SETTINGS = {"policy_class": {"__module__": "stable_baselines3.common.policies"}, **SPACES, "clip_range": 0.2, "n": [1]}


def archives():
    """Yield hand-made files that are not Stable-Baselines3's, or swell."""
    text, deflated = json.dumps(SETTINGS).encode(), zipfile.ZIP_DEFLATED
    yield "good", packed_by_sb3(text)
    yield (
        "1.5 MB of settings that become 3 GB",
        packed_by_sb3(b"[" + b"[]," * (500 << 20) + b"[]]", deflated)[: 1 << 30],
    )
    yield "settings at the limit", packed_by_sb3(b"[" + b"[]," * ((8 << 20) // 3 - 1) + b"[]]")
    yield "deep settings", packed_by_sb3(b"[" * 1_000_000)
    yield "deep objects", packed_by_sb3(b'{"policy_class":' * 100_000)
    yield "long numbers", packed_by_sb3(b"1" * 5_000_000)
    yield "not JSON", packed_by_sb3(b"\xff\xfe\x00")
    for value in VALUES:
        for name in ("policy_class", "observation_space"):
            yield f"{name} {str(value)[:20]}", packed_by_sb3(json.dumps({**SETTINGS, name: value}).encode())
        settings = {**SETTINGS, "policy_class": {"__module__": value}}
        yield f"module {str(value)[:20]}", packed_by_sb3(json.dumps(settings).encode())
    for method in (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA, deflated):
        yield f"method {method}", packed_by_sb3(text, method)
    yield "many parts", packed_by_sb3(text, **{f"{k}.pth": b"" for k in range(60_000)})
    yield "swelling weights", packed_by_sb3(text, deflated, **{"more.pth": b"\0" * (300 << 20)})
    yield "encrypted", packed_by_sb3(text).replace(b"PK\1\2\x14\x03\x14\x00\x00", b"PK\1\2\x14\x03\x14\x00\x01")
    yield "nothing", b""
    yield "an empty archive", zipped({})
    yield "a pickle", b"\x80\x04cos\nsystem\n(S'touch x'\ntR."


def test_an_archive_is_one_of_stable_baselines_or_is_refused_in_one_line(tmp_path, tally, amount):
    rng = np.random.default_rng(1)
    good = packed_by_sb3(json.dumps(SETTINGS).encode())

    def work(content):
        path = Path(tmp_path, "hostile.zip")
        path.write_bytes(content)
        return algorithm_of(path)

    inputs = {
        "hand-made": list(archives()),
        "mutated": [(f"mutated {k}", mutated(good, rng)) for k in range(amount(200, 20_000))],
    }
    for area, listed in inputs.items():
        tally(f"policies: Stable-Baselines3, {area}").add(attack(work, listed, refusals=SwarmError, cpu=5, memory=500))


def graphs(onnx, good):
    """Yield hand-made graphs."""
    make = onnx.helper

    def altered(change):
        model = onnx.ModelProto.FromString(good)
        change(model)
        return model.SerializeToString()

    def with_header(text):
        return altered(lambda model: setattr(model.metadata_props[0], "value", text))

    header = json.loads(onnx.ModelProto.FromString(good).metadata_props[0].value)
    yield "good", good
    for value in VALUES:
        for name in header:
            yield f"{name} {str(value)[:20]}", with_header(json.dumps({**header, name: value}))
        forged_sensors = {**header["sensors"], "ranges": value}
        yield f"ranges {str(value)[:20]}", with_header(json.dumps({**header, "sensors": forged_sensors}))
    yield "deep header", with_header("[" * 500_000)
    yield "no header", altered(lambda model: model.ClearField("metadata_props"))
    yield "no outputs", altered(lambda model: model.graph.ClearField("output"))
    yield "no operators", altered(lambda model: model.graph.ClearField("node"))
    yield "an unknown operator", altered(lambda model: setattr(model.graph.node[0], "op_type", "Nothing"))
    yield "an unknown domain", altered(lambda model: setattr(model.graph.node[0], "domain", "of.another"))
    yield "a loop", altered(lambda model: model.graph.node.append(make.make_node("Loop", ["", ""], ["x"])))
    yield "a circle", altered(lambda model: model.graph.node.append(make.make_node("Add", ["x", "y"], ["x"])))
    wide = [make.make_node("Concat", ["wheels"] * 300, [f"w{k}"], axis=1) for k in range(300)]
    yield "many wide operators", altered(lambda model: model.graph.node.extend(wide))
    for size in (10**9, 10**12, 2**62, -1):
        shape = onnx.numpy_helper.from_array(np.array([size]), "huge")

        def fill(model, shape=shape):
            model.graph.initializer.append(shape)
            model.graph.node[-1].output[0] = "plain"
            model.graph.node.append(make.make_node("ConstantOfShape", ["huge"], ["wheels"]))

        yield f"a result of {size} numbers", altered(fill)
    yield "very many empty operators", field(7, b"\x0a\x00" * (3 << 20))
    yield "a number that is too large", field(7, field(5, b"\x08" + b"\xff" * 9 + b"\x01"))
    yield "nothing", b""
    yield "too large", b"\0" * (17 << 20)


def field(number, content):
    """Return a field of a message, as bytes."""
    return varint(number << 3 | 2) + varint(len(content)) + content


def varint(number):
    head = b""
    while number > 127:
        head, number = head + bytes([number & 127 | 128]), number >> 7
    return head + bytes([number])


def test_a_graph_drives_or_is_refused_in_one_line(tmp_path, tally, amount):
    onnx = pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")
    rng, path = np.random.default_rng(1), Path(tmp_path, "hostile.onnx")
    good = export_onnx(policies()[2], tmp_path / "good.onnx").read_bytes()

    def work(content):
        path.write_bytes(content)
        controller = load_controller(path)
        if controller.control is None:
            controller.actor("continuous")(np.zeros((2, 9), np.float32))
            return
        model = SwarmModel(map="openspace", rng=1)
        model.add_robots(AGENT9, poses=[(100, 100, 0.0), (115, 100, 1.0)])
        model.control = controller.control
        model.run(2)

    work(good)  # compiles what all of them use
    inputs = {
        "hand-made": list(graphs(onnx, good)),
        "mutated": [(f"mutated {k}", mutated(good, rng)) for k in range(amount(120, 10_000))],
    }
    for area, listed in inputs.items():
        tally(f"policies: ONNX, {area}").add(attack(work, listed, refusals=SwarmError, cpu=5, memory=1500))
