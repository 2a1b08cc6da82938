"""Policies as ONNX files, for the runtimes of other programs and languages."""

import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import LearningError, check_count, shortened, without_middle
from mesa_swarm.base.extras import require_extra
from mesa_swarm.base.files import show_path, write_whole
from mesa_swarm.learning.actions import ACTIONS
from mesa_swarm.learning.c_source import exportable
from mesa_swarm.learning.policy import Policy, SensorLayout, checked_chances, checked_numbers
from mesa_swarm.learning.policy_files import file_at, stored_sensors
from mesa_swarm.learning.q_learning import QPolicy
from mesa_swarm.learning.reflex_policy import ReflexPolicy
from mesa_swarm.learning.wire_learning import STARTS, WirePolicy
from mesa_swarm.world.statics import FIRE, LOAD, ROBOT

if TYPE_CHECKING:
    from onnx import ModelProto, NodeProto, TensorProto, ValueInfoProto
    from onnxruntime import InferenceSession

# Old enough for the runtimes in use; of 2021.
OPSET, FORMAT_VERSION = 15, 8
# The name under which a file holds sensors, family and training as JSON.
HEADER = "mesa_swarm policy"
# A policy of 1,000 robots takes 13 MB.
LARGEST_BYTES = 1 << 24
# Bytes of memory for what all graphs of a process compute.
LARGEST_MEMORY = 1 << 30
MOST_PARTS, MOST_NODES = 300_000, 100_000
# Memory units of a robot, sets of weights and training steps.
MOST_UNITS, MOST_COPIES, MOST_STEPS = 10_000, 2**31 - 1, 2**62
# Operators that repeat others as often as the numbers that they get demand.
LOOPS = {"Loop", "Scan", "SequenceMap", "BeamSearch", "GreedySearch", "Sampling", "WhisperBeamSearch"}
# Of the runtime's messages, which would be printed besides the errors that it raises.
FATAL_ONLY = 4


def export_onnx(policy: Policy, path: str | os.PathLike[str], *, copy: int | None = None) -> Path:
    """Write a policy as an ONNX graph in double precision, and return the path of the file.

    Its inputs are, for any number n of robots, ``readings`` (n, s) in map units, float64; ``kinds`` (n, s), int64;
    ``chance`` (n,), float64, a negative one for the best action; where the policy has several sets of weights
    ``numbers`` (n,), int64; where it is recurrent ``memory`` (n, u), float64. Its outputs are ``wheels`` (n, 2),
    float64, shares of max_speed, and ``new_memory`` (n, u). They are those of ``policy.act`` within 1e-6; only a chance
    within rounding (1e-15) of the border between two choices may yield the other. The file also holds sensors and
    family of the policy, as metadata.

    Parameters
    ----------
    policy : QPolicy, ReflexPolicy or WirePolicy
    path : str or Path
        Ends with .onnx.
    copy : int, optional
        Which of the policy's sets of weights is exported; all by default.

    Raises
    ------
    InvalidValueError
        If the policy is of another family, or `copy` not one of its sets of weights.
    LearningError
        If the name ends otherwise, or the file cannot be written.
    SwarmError
        If the package onnx is not installed.

    Examples
    --------
    >>> from mesa_swarm import AGENT3
    >>> policy = QPolicy.untrained(AGENT3, rng=np.random.default_rng(1))
    >>> export_onnx(policy, "robot.txt")
    Traceback (most recent call last):
        ...
    mesa_swarm.base.errors.LearningError: 'robot.txt' does not end with .onnx; give the policy such a name
    """
    file = file_at(path)
    if file.suffix != ".onnx":
        raise LearningError(f"{shortened(file.name)} does not end with .onnx; give the policy such a name")
    chosen = exportable(policy, copy)
    require_extra("onnx", "onnx", "ONNX files need")
    return write_whole(file, _model_of(chosen).SerializeToString(), LearningError)


def _model_of(policy: QPolicy | ReflexPolicy | WirePolicy) -> "ModelProto":
    """Return the model: graph, inputs, outputs and metadata."""
    from onnx import TensorProto, helper  # noqa: PLC0415 - optional

    graph, sensors = Graph(), len(policy.sensors)
    units = getattr(policy, "memory", 0)
    if isinstance(policy, ReflexPolicy):
        _reflex(policy, graph)
    else:
        _networks(policy, graph)

    def value(name: str, kind: int, *sides: int) -> "ValueInfoProto":
        return helper.make_tensor_value_info(name, kind, ["n", *sides])

    inputs = [value("readings", TensorProto.DOUBLE, sensors), value("kinds", TensorProto.INT64, sensors)]
    inputs.append(value("chance", TensorProto.DOUBLE))
    outputs = [value("wheels", TensorProto.DOUBLE, 2)]
    if policy.copies > 1:
        inputs.append(value("numbers", TensorProto.INT64))
    if units:
        inputs.append(value("memory", TensorProto.DOUBLE, units))
        outputs.append(value("new_memory", TensorProto.DOUBLE, units))
    made = helper.make_graph(graph.nodes, f"{policy.family} policy", inputs, outputs, graph.constants)
    versions = {"opset_imports": [helper.make_opsetid("", OPSET)], "ir_version": FORMAT_VERSION}
    model = helper.make_model(made, producer_name="mesa_swarm", **versions)
    header = {
        "family": policy.family,
        "sensors": asdict(policy.sensors),
        "steps": policy.steps,
        "encoding": policy.encoding,
        "copies": policy.copies,
        "memory": units,
    }
    helper.set_model_props(model, {HEADER: json.dumps(header)})
    return model


def onnx_session(path: str | os.PathLike[str]) -> "InferenceSession":
    """Return the graph in an ONNX file, ready to run in one thread.

    What it computes has a limit: graphs with loops, of operators or of functions that call themselves, are refused,
    and all graphs of a process have 1 GB of memory for what they compute.

    Raises
    ------
    LearningError
        If the file is missing, or not such a graph.
    SwarmError
        If the packages onnx and onnxruntime are not installed.
    """
    file = Path(path)
    if not file.is_file():
        raise LearningError(f"there is no file {show_path(path)}; expected an ONNX file such as from export_onnx")
    for package in ("onnx", "onnxruntime"):
        require_extra(package, "onnx", "ONNX files need")
    try:
        if file.stat().st_size > LARGEST_BYTES:
            raise ValueError(f"it has more than {LARGEST_BYTES >> 20} MB")
        content = file.read_bytes()
        _check_graph(content)
        session = _session_of(content)
        if not all(
            [(value.name, value.shape) for value in part] for part in (session.get_inputs(), session.get_outputs())
        ):
            raise ValueError("it has no inputs or no outputs")
        return session
    except Exception as error:  # the runtime has many kinds of its own
        text = f"{show_path(path)} is not a usable ONNX file: {' '.join(str(error).split())}"
        raise LearningError(without_middle(text)) from None


def _session_of(content: bytes) -> "InferenceSession":
    """Return a graph that is ready to run; its errors are raised, not printed as well."""
    import onnxruntime  # noqa: PLC0415 - optional

    _limit_memory()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = FATAL_ONLY
    options.add_session_config_entry("session.use_env_allocators", "1")
    # What is computed when a graph is loaded has no limit of memory; a second attempt is printed.
    without: dict[str, Any] = {"disabled_optimizers": ["ConstantFolding"], "enable_fallback": 0}
    return onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"], **without)


@cache
def _limit_memory() -> None:
    """Limit, once in a process, the memory of what graphs compute."""
    import onnxruntime as runtime  # noqa: PLC0415 - optional

    place = runtime.OrtMemoryInfo("Cpu", runtime.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, runtime.OrtMemType.DEFAULT)
    runtime.create_and_register_allocator(place, runtime.OrtArenaCfg({"max_mem": LARGEST_MEMORY}))


def _check_graph(content: bytes) -> None:
    """Refuse what would run without end, or read other files."""
    import onnx  # noqa: PLC0415 - optional

    model = onnx.ModelProto.FromString(content)
    if sum(1 for _ in islice(_parts_of(model, object), MOST_PARTS + 1)) > MOST_PARTS:
        raise ValueError(f"it has more than {MOST_PARTS:,} parts; expected a policy")
    if any(tensor.data_location == onnx.TensorProto.EXTERNAL for tensor in _parts_of(model, onnx.TensorProto)):
        raise ValueError("some of its numbers are in another file; export it as one file")
    if looping := next((node.op_type for node in _parts_of(model, onnx.NodeProto) if node.op_type in LOOPS), None):
        raise ValueError(f"its operator {looping} may run without end; export it without loops")
    functions = {_called(function, function.name): function for function in model.functions}
    if _unfolded(model.graph, functions, {}) > MOST_NODES:
        raise ValueError(f"it has more than {MOST_NODES:,} operators, or a function that calls itself")


def _parts_of(message: Any, kind: type) -> Iterator[Any]:
    """Yield the parts of a message of this kind, at any depth."""
    if isinstance(message, kind):
        yield message
    for field, value in message.ListFields():
        if field.message_type is not None:
            for part in (value,) if hasattr(value, "ListFields") else value:
                yield from _parts_of(part, kind)


def _called(part: Any, name: str) -> tuple[str, str, str]:
    """Return by what a function is called; the standard domain has two names."""
    return "" if part.domain == "ai.onnx" else part.domain, name, part.overload


def _unfolded(part: Any, functions: dict, counts: dict[tuple, int]) -> int:
    """Return how many operators a graph or function has, with those of functions that it calls; many if it is endless.

    `counts` has those of functions that were counted before.
    """
    from onnx import NodeProto  # noqa: PLC0415 - optional

    total = 0
    for node in _parts_of(part, NodeProto):
        called = _called(node, node.op_type)
        if called in functions and called not in counts:
            counts[called] = MOST_NODES  # as long as it is not counted: of one that calls itself
            counts[called] = _unfolded(functions[called], functions, counts)
        total += 1 + counts.get(called, 0)
    return total


def is_own(session: "InferenceSession") -> bool:
    """Return whether a graph is one of `export_onnx`: its first inputs are readings, kinds and chance."""
    return [value.name for value in session.get_inputs()][:3] == ["readings", "kinds", "chance"]


@dataclass(frozen=True, kw_only=True, eq=False)
class OnnxPolicy:
    """A policy that was exported to ONNX, for `PolicyLayer`.

    Parameters
    ----------
    session : onnxruntime.InferenceSession
    sensors : SensorLayout
    steps : int
        Robot-steps of training.
    memory, copies : int
        As of `Policy`.
    training : dict
        Its family and encoding.
    """

    family: ClassVar[str] = "onnx"
    session: "InferenceSession"
    sensors: SensorLayout
    steps: int
    memory: int
    copies: int
    training: dict

    @classmethod
    def of(cls, session: "InferenceSession", name: str) -> "OnnxPolicy":
        """Return the policy of a graph of `export_onnx`; `name` is that of its file, for errors."""
        try:
            header = json.loads(session.get_modelmeta().custom_metadata_map[HEADER])
            sensors = stored_sensors(header["sensors"])
            most = {"steps": MOST_STEPS, "memory": MOST_UNITS, "copies": MOST_COPIES}
            numbers = {part: check_count(part, header[part], maximum=most[part]) for part in most}
            training = {part: str(header[part]) for part in ("family", "encoding")}
        except (ArithmeticError, LookupError, RecursionError, TypeError, ValueError):
            raise LearningError(f"{name} has no valid header of mesa_swarm; export the policy again") from None
        return cls(session=session, sensors=sensors, training=training, **numbers)

    def act(
        self,
        readings: ArrayLike,
        kinds: ArrayLike | None = None,
        chance: ArrayLike | None = None,
        memory: np.ndarray | None = None,
        *,
        numbers: ArrayLike | None = None,
    ) -> np.ndarray:
        """Return wheel commands (n, 2) as shares of max_speed; see `ReflexPolicy.act`.

        Raises
        ------
        LearningError
            If the graph fails, such as for want of memory, or returns another number of values.
        """
        distance, kind = self.sensors.check_readings(readings, kinds, self.training["encoding"])
        n = len(distance)
        inputs = {"readings": distance, "kinds": kind.astype(np.int64)}
        inputs["chance"] = np.full(n, -1.0) if chance is None else checked_chances(chance, n)
        if self.copies > 1:
            inputs["numbers"] = np.arange(n) if numbers is None else checked_numbers(numbers, n)
        if self.memory:
            inputs["memory"] = np.zeros((n, self.memory)) if memory is None else memory
        try:
            wheels, *remembered = self.session.run(None, inputs)
            if memory is not None and remembered:
                memory[:] = remembered[0]
        except Exception as error:  # the runtime has many kinds of its own
            raise LearningError(without_middle(f"the ONNX graph failed: {' '.join(str(error).split())}")) from None
        return wheels


class Graph:
    """Nodes and constants of a graph; operators are its methods' names, results have numbers as names."""

    def __init__(self) -> None:
        self.nodes: list[NodeProto] = []
        self.constants: list[TensorProto] = []

    def constant(self, values: Any, kind: type = np.float64) -> str:
        """Add a constant and return its name."""
        from onnx import numpy_helper  # noqa: PLC0415 - optional

        name = f"constant_{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.array(values, kind), name))
        return name

    def add(self, operator: str, *inputs: str, output: str | None = None, **attributes: Any) -> str:
        """Add a node with one output and return that output's name."""
        from onnx import helper  # noqa: PLC0415 - optional

        name = output or f"{operator.lower()}_{len(self.nodes)}"
        self.nodes.append(helper.make_node(operator, list(inputs), [name], **attributes))
        return name

    def cast(self, value: str) -> str:
        """Return a truth value as 1.0 or 0.0."""
        from onnx import TensorProto  # noqa: PLC0415 - optional

        return self.add("Cast", value, to=TensorProto.DOUBLE)

    def shaped(self, value: str, *sides: int) -> str:
        """Return a value in another shape; a side of 0 stays as it is."""
        return self.add("Reshape", value, self.constant(sides, np.int64))

    def chosen_copy(self, weights: np.ndarray) -> str:
        """Return the weights of each robot (n, ...) of all sets (copies, ...), or the only set (1, ...)."""
        if len(weights) == 1:
            return self.constant(weights)
        index = self.add("Mod", "numbers", self.constant(len(weights), np.int64))
        return self.add("Gather", self.constant(weights), index, axis=0)


def _shares(policy: QPolicy | ReflexPolicy | WirePolicy, graph: Graph) -> str:
    """Return the readings as shares of the ranges (n, s), 1 where nothing is in range."""
    ranges = np.array(policy.sensors.ranges)
    reach = graph.constant(np.where(ranges > 0.0, ranges, 1.0))
    none = graph.add("Less", "readings", graph.constant(0.0))
    if (ranges <= 0.0).any():
        none = graph.add("Or", none, graph.constant(ranges <= 0.0, np.bool_))
    ones = graph.constant(np.ones(len(ranges)))
    return graph.add("Where", none, ones, graph.add("Min", graph.add("Div", "readings", reach), ones))


def _sees(graph: Graph, kind: int) -> str:
    """Return 1.0 for each sensor that sees a thing of this kind (n, s)."""
    return graph.cast(graph.add("Equal", "kinds", graph.constant(kind, np.int64)))


def _networks(policy: QPolicy | WirePolicy, graph: Graph) -> None:
    """Add the graph of a policy that chooses by network outputs."""
    parts = [_shares(policy, graph)]
    if policy.encoding == "typed":
        parts += [_sees(graph, kind) for kind in (ROBOT, FIRE, LOAD)]
    inputs = graph.add("Concat", *parts, axis=1) if len(parts) > 1 else parts[0]
    outputs = _outputs(policy, graph, inputs)
    if isinstance(policy, QPolicy):
        taken = _taken(policy, graph, outputs, policy.actions)
        graph.add("Gather", graph.constant(ACTIONS[: policy.actions]), taken, output="wheels", axis=0)
        return
    wires = graph.shaped(outputs, -1, policy.wires, 3)
    values = graph.add("Gather", wires, graph.constant(2, np.int64), axis=2)
    ends = graph.add("Gather", wires, graph.constant([0, 1], np.int64), axis=2)
    starts = graph.constant(np.arctanh(STARTS[: policy.wires]))
    commands = graph.add("Tanh", graph.add("Add", ends, starts))
    taken = graph.shaped(_taken(policy, graph, values, policy.wires), -1, 1)
    graph.add("GatherND", commands, taken, output="wheels", batch_dims=1)


def _outputs(policy: QPolicy | WirePolicy, graph: Graph, inputs: str) -> str:
    """Return the output of each network of each robot (n, group)."""
    group, copies = policy.group, policy.copies
    inner, inner_bias, outer, outer_bias = policy.networks.weights
    width, hidden = inner.shape[1:]
    # A robot's networks side by side: (copies, inputs, group x hidden).
    wide = inner.reshape(copies, group, width, hidden).transpose(0, 2, 1, 3).reshape(copies, width, group * hidden)
    sums = graph.add("MatMul", graph.shaped(inputs, -1, 1, width), graph.chosen_copy(wide))
    sums = graph.add("Add", sums, graph.chosen_copy(inner_bias.reshape(copies, 1, group * hidden)))
    units = graph.shaped(graph.add("Tanh", sums), -1, group, hidden)
    weighted = graph.add("Mul", units, graph.chosen_copy(outer.reshape(copies, group, hidden)))
    total = graph.add("ReduceSum", weighted, graph.constant([2], np.int64), keepdims=0)
    return graph.add("Add", total, graph.chosen_copy(outer_bias.reshape(copies, group)))


def _taken(policy: QPolicy | WirePolicy, graph: Graph, values: str, choices: int) -> str:
    """Return the number of each robot's choice (n,), by Boltzmann's probabilities of values (n, a).

    As in `learning.actions.chosen`, terms are subtracted one after the other from the chance's share of their sum.
    """
    best = graph.add("ArgMax", values, axis=1, keepdims=0)
    above = graph.add("Sub", values, graph.add("ReduceMax", values, axes=[1], keepdims=1))
    terms = graph.add("Exp", graph.add("Div", above, graph.constant(float(policy.temperature))))
    columns = [graph.add("Gather", terms, graph.constant(a, np.int64), axis=1) for a in range(choices)]
    total = columns[0]
    for column in columns[1:]:
        total = graph.add("Add", total, column)
    left, zero = graph.add("Mul", "chance", total), graph.constant(0.0)
    spent = []
    for column in columns:
        left = graph.add("Sub", left, column)
        spent.append(graph.shaped(graph.add("Less", left, zero), -1, 1))
    # The first that is spent; none by rounding, or all, of a negative chance, yield the best.
    first = graph.add("ArgMax", graph.cast(graph.add("Concat", *spent, axis=1)), axis=1, keepdims=0)
    drawn = graph.add("And", graph.add("Less", left, zero), graph.add("GreaterOrEqual", "chance", zero))
    return graph.add("Where", drawn, first, best)


def _reflex(policy: ReflexPolicy, graph: Graph) -> None:
    """Add the graph of a reflex, or of a network with recurrent units."""
    near = graph.add("Sub", graph.constant(1.0), _shares(policy, graph))
    parts = [near]
    if policy.encoding == "typed":
        parts.append(graph.add("Mul", near, _sees(graph, ROBOT)))
    zero = graph.constant(0.0)
    whim = graph.add("Sub", graph.add("Mul", "chance", graph.constant(2.0)), graph.constant(1.0))
    whim = graph.add("Where", graph.add("Less", "chance", zero), zero, whim)
    ends = graph.shaped(whim, -1, 1)
    bias = graph.add("Add", graph.add("Mul", ends, zero), graph.constant(1.0))
    if policy.memory:
        senses = graph.add("Concat", *parts, "memory", ends, bias, axis=1)
        units = graph.add("Tanh", _weighted(graph, senses, policy.hidden))
        parts.append(graph.add("Identity", units, output="new_memory"))
    senses = graph.add("Concat", *parts, ends, bias, axis=1)
    sums = _weighted(graph, senses, policy.wheel)
    if policy.squash == "tanh":
        graph.add("Tanh", sums, output="wheels")
    elif policy.squash == "linear":
        graph.add("Clip", sums, graph.constant(-1.0), graph.constant(1.0), output="wheels")
    else:
        ahead = graph.add("Greater", sums, zero)
        graph.add("Where", ahead, graph.constant(1.0), graph.constant(-1.0), output="wheels")


def _weighted(graph: Graph, senses: str, weights: np.ndarray) -> str:
    """Return the weighted sums (n, columns) of inputs (n, rows), given weights (copies, rows, columns)."""
    _, rows, columns = weights.shape
    return graph.shaped(graph.add("MatMul", graph.shaped(senses, -1, 1, rows), graph.chosen_copy(weights)), -1, columns)
