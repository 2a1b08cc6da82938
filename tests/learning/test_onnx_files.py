"""Exported ONNX graphs: valid, equal to the policy in Python; what cannot be exported is refused."""

import json
import re

import numpy as np
import pytest

from mesa_swarm.base import extras
from mesa_swarm.base.errors import SwarmError
from mesa_swarm.base.extras import install_command
from mesa_swarm.learning.onnx_files import HEADER, export_onnx
from support.c_code import drawn_inputs
from support.exported_policies import NINE, POLICIES, in_python, q


def acted_in_runtime(session, policy, readings, kinds, chance, numbers=None):
    """Return wheel commands and memory of an exported policy by ONNX Runtime."""
    inputs = {"readings": readings, "kinds": kinds.astype(np.int64), "chance": chance}
    if numbers is not None:
        inputs["numbers"] = numbers
    if getattr(policy, "memory", 0):
        inputs["memory"] = np.zeros((len(readings), policy.memory))
        return session.run(["wheels", "new_memory"], inputs)
    return *session.run(["wheels"], inputs), np.zeros((len(readings), 0))


@pytest.mark.slow
@pytest.mark.parametrize("name", POLICIES)
def test_a_graph_acts_as_the_policy(name, tmp_path):
    onnx, runtime = pytest.importorskip("onnx"), pytest.importorskip("onnxruntime")
    policy, rng = POLICIES[name], np.random.default_rng(1)
    file = export_onnx(policy, tmp_path / "robot.onnx")
    onnx.checker.check_model(onnx.load(file), full_check=True)
    session = runtime.InferenceSession(file, providers=["CPUExecutionProvider"])
    numbers = rng.integers(0, 1000, 10_000) if policy.copies > 1 else None
    for count, chances in ((10_000, None), (1, None), (300, -1.0)):
        readings, kinds, chance = drawn_inputs(NINE, max(count, 3), rng)
        inputs = readings[:count], kinds[:count], (chance if chances is None else np.full(count, chances))[:count]
        mine = None if numbers is None else numbers[:count]
        wheels, memory = acted_in_runtime(session, policy, *inputs, mine)
        given = inputs if chances is None else (*inputs[:2], None)
        expected, remembered = in_python(policy, *given, mine)
        assert wheels.shape == (count, 2)
        assert np.abs(wheels - expected).max() <= 1e-6
        assert np.abs(memory - remembered).max(initial=0) <= 1e-6


@pytest.mark.slow
def test_a_file_holds_the_sensors_of_the_policy_and_one_set_of_weights_if_chosen(tmp_path):
    onnx = pytest.importorskip("onnx")
    model = onnx.load(export_onnx(POLICIES["wires of 2 robots, typed"], tmp_path / "robot.onnx", copy=1))
    header = json.loads({entry.key: entry.value for entry in model.metadata_props}[HEADER])
    assert header["sensors"]["bearings"] == list(NINE.bearings)
    assert (header["family"], header["copies"], header["memory"]) == ("wires", 1, 0)
    assert [entry.name for entry in model.graph.input] == ["readings", "kinds", "chance"]


def test_without_the_package_the_error_names_the_command_that_installs_it(tmp_path, monkeypatch):
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(SwarmError, match=re.escape(install_command("onnx"))):
        export_onnx(q(4), tmp_path / "robot.onnx")


def test_a_file_of_another_ending_is_refused(tmp_path):
    with pytest.raises(SwarmError, match="does not end with"):
        export_onnx(q(4), tmp_path / "robot.c")
    assert not list(tmp_path.iterdir())
