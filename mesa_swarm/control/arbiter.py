"""Arbiters: subsumption, in which the first active layer drives, and the weighted sum of all layers."""

import math
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_name, check_number, read_attribute, shortened
from mesa_swarm.base.streams import Streams
from mesa_swarm.control.behaviour import Behaviour
from mesa_swarm.control.layer import Layer, Senses
from mesa_swarm.kernels.block import CALL_NUMBERS, Block, KernelCall, call_at, code_address, stack_blocks, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import hypot
from mesa_swarm.kernels.part import Kernel, kernel_of
from mesa_swarm.kernels.type_names import Flags, IntegerRows, Integers, RealRows, Reals
from mesa_swarm.physics.broadcasts import send_goals
from mesa_swarm.physics.threads import RowCrew
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.drive import clear_unused, limit_command, limit_length
from mesa_swarm.robots.reasons import Reason
from mesa_swarm.robots.swarm import Swarm

MOST_LAYERS = 64


class Arbiter:
    """Layers, and how their commands become one: see `Subsumption` and `VectorSum`.

    Parameters
    ----------
    *layers : Layer
        Layers, or rules made with `behaviour`.

    Raises
    ------
    InvalidValueError
        If something is not a layer or has no name, or there are no layers or too many.
    """

    # Whether all active layers drive a robot together; else the one that won drives it alone.
    sums = False
    # Which robots (n,) another arbiter of a `Team` drives; None without a team.
    others: np.ndarray | None = None

    def __init__(self, *layers: Layer) -> None:
        kind = type(self).__name__
        if not 1 <= len(layers) <= MOST_LAYERS:
            raise InvalidValueError(f"{kind} has {len(layers)} layers; expected 1 to {MOST_LAYERS}")
        for layer in layers:
            methods = [read_attribute(layer, name) for name in ("decide", "bind")]
            if isinstance(layer, type) or not all(map(callable, methods)):
                raise InvalidValueError(
                    f"{kind} got {shortened(layer)}; expected layers such as Avoid(), or rules made with @behaviour"
                )
            if not hasattr(layer, "name"):
                raise InvalidValueError(
                    f"{kind} got a {type(layer).__name__} without a name; give the class one, such as name = 'Mine'"
                )
            check_name(f"name of a {type(layer).__name__}", layer.name)
        self.layers: Sequence[Layer] = layers

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the layers, as explanations, charts and recordings have them."""
        return tuple(layer.name for layer in self.layers)

    def _graph(self) -> list:
        """Return states and transitions of one that has them, for the fingerprint of a model."""
        return []

    @property
    def arbiters(self) -> "tuple[Arbiter, ...]":
        """The arbiters that it is made of: itself, or those of a `Team`."""
        return (self,)

    @property
    def parts(self) -> "tuple[Arbiter, ...]":
        """The arbiters; deprecated, see `arbiters`."""
        warnings.warn("Team.parts is called arbiters now", DeprecationWarning, stacklevel=2)
        return self.arbiters

    @property
    def labels(self) -> tuple[str, ...]:
        """What each of `arbiters` is for: "" for all robots, or the name of a design or a group of a `Team`."""
        return ("",)

    @property
    def noted(self) -> tuple[str, ...]:
        """The columns of its memory that explain its decisions, see `explain`."""
        return ()

    def arbiter_of(self, index: int) -> "Arbiter":
        """Return the arbiter that a layer belongs to."""
        return self

    def layers_of(self, row: int) -> Sequence[Layer]:
        """Return the layers that may drive the robot in this row."""
        return self.layers

    def check_robots(self, robots: Iterable[tuple[RobotDesign, str]]) -> None:
        """Refuse robots, given as design and group, whose drive its layers do not command."""
        check_drives(self, [design for design, _ in robots])

    def bound(
        self,
        swarm: Swarm,
        streams: Streams,
        *,
        first: int = 0,
        label: str = "",
        driven: tuple[RobotDesign, ...] | None = None,
    ) -> "Arbiter":
        """Return a copy whose layers have their columns and random streams in this swarm.

        A copy, so that one arbiter can be given to many models. Layers that were bound before begin anew, but
        learners go on with what they have learned. In a `Team` the index of its first layer is `first`, `label` names
        its columns and streams, and it has robots of the designs `driven` only.
        """
        arbiter, place = copy(self), f"{label}." if label else ""
        arbiter.others = None
        arbiter.layers = tuple(map(copy, self.layers))
        arbiter.set_driven(driven)
        count = Counter[str]()
        for index, layer in enumerate(arbiter.layers, start=first):
            count[layer.name] += 1
            stream = f"decide.{place}{layer.name}" + (f"#{count[layer.name]}" if count[layer.name] > 1 else "")
            layer.bind(swarm, f"{index}.{place}{layer.name}", streams[stream])
        arbiter._bind(swarm, streams, first, place)
        return arbiter

    def _bind(self, swarm: Swarm, streams: Streams, first: int, place: str) -> None:
        """Take columns and streams of its own, after its layers have; by default none."""

    def set_driven(self, driven: tuple[RobotDesign, ...] | None) -> None:
        """Inform layers with an attribute ``driven`` of the designs of their robots, None for all of the swarm."""
        layers: Iterable[Any] = self.layers
        for layer in layers:
            if hasattr(layer, "driven"):
                layer.driven = driven

    def clear(self, layer: np.ndarray) -> None:
        """Set the winning layer (n,) to -1 for robots that it drives, and to 0 for others, which layers then skip."""
        layer.fill(-1)
        if self.others is not None:
            layer[self.others] = 0

    def unbind(self) -> None:
        """Let layers with an ``unbind()`` store their state, as all columns are about to be dropped."""
        for layer in self.layers:
            unbind = getattr(layer, "unbind", None)
            if callable(unbind):
                unbind()

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray) -> None:
        """Write the command (n, w) and the winning layer (n,) of every robot."""
        self.kernel_for(senses, command, layer).run(0, len(layer))

    def kernel_for(self, senses: Senses, command: np.ndarray, layer: np.ndarray) -> Kernel:
        """Return what decides on these columns, which calls the kernels of layers, and Python for those without."""
        raise NotImplementedError

    def turns(self, senses: Senses, command: np.ndarray, layer: np.ndarray, first: Callable | None = None) -> "Turns":
        """Return the turns of its layers, which write to these columns; `first` is done in Python before them."""
        kernels = [kernel_of(part, "decide", senses, command, layer, k) for k, part in enumerate(self.layers)]

        def decide(place: int) -> None:
            self.layers[place].decide(senses, command, layer, place)

        others = np.zeros(len(layer), np.bool_) if self.others is None else self.others
        return Turns(kernels, decide, self.layers, others, first, senses._crew)

    def explain(self, reason: Reason, row: Mapping[str, Any]) -> Reason:
        """Return the reason that a layer gives, with what the arbiter adds; `row` holds a robot's columns `noted`."""
        return reason


def check_drives(control: Arbiter, designs: Iterable[RobotDesign]) -> None:
    """Refuse designs whose drive takes another kind of command, or more or fewer numbers, than a layer gives."""
    for design in designs:
        for layer in control.layers:
            numbers = getattr(layer, "numbers", 2)
            if numbers is not None and numbers != design.numbers:
                raise InvalidValueError(
                    f"{layer.name} commands {numbers} numbers, but robots of the design {design.name} take "
                    f"{design.numbers}; give the design another drive, or use layers that are for its drive"
                )
            wheels = getattr(layer, "commands_wheels", None)
            if wheels is None or design.turns is None or bool(wheels) == design.turns:
                continue
            kinds = ("speeds forward and sideways", "speeds of wheels left and right")
            raise InvalidValueError(
                f"{layer.name} commands {kinds[bool(wheels)]}, but robots of the design {design.name} take "
                f"{kinds[design.turns]}; give the design another drive, or use layers that are for its drive"
            )


def name_driver(control: Arbiter, index: int) -> str:
    """Return the name of the layer with this index, and a description of any other index."""
    if index < 0:
        return "no layer"
    names = control.names
    return names[index] if index < len(names) else f"unknown layer {index}"


class Subsumption(Arbiter):
    """Layers in order of importance; the first active one's command stands and suppresses the rest.

    A robot for which no layer is active stops.

    Parameters
    ----------
    *layers : Layer
        Most important first: layers, or rules made with `behaviour`.

    Examples
    --------
    >>> from mesa_swarm.control import Avoid, Explore
    >>> [layer.name for layer in Subsumption(Avoid(distance=15), Explore()).layers]
    ['Avoid', 'Explore']
    """

    def kernel_for(self, senses: Senses, command: np.ndarray, layer: np.ndarray) -> Kernel:
        """Return what decides on these columns."""
        turns = self.turns(senses, command, layer)
        return turns.kernel(subsume, SubsumeArrays(turns.arrays, command, layer))


# What a function returns that decides where Python is due for the layer whose turn it is.
DUE = 1
# What `decide_layers` returns where a layer has commanded NaN.
NAN = -1
# Of the progress of a function that decides: the step that it has begun, the layer whose turn it is, and its state.
BEGUN, PLACE, STATE = range(3)
# The state of a layer whose turn it is: nothing is done yet, its arrays are prepared, Python has decided for it.
NEW, PREPARED, DECIDED = range(3)


class TurnArrays(NamedTuple):
    """The layers that a function lets decide one after the other, and how far it is.

    Parameters
    ----------
    calls : int64 ndarray, shape (k, 3)
        Rows of `KernelCall`, zeros for layers that decide in Python.
    others : bool ndarray, shape (n,)
        Which robots another arbiter drives.
    waits : bool
        Whether Python is due before the first layer.
    progress : int64 ndarray, shape (3,)
        See `BEGUN`.
    """

    calls: IntegerRows
    others: Flags
    waits: bool
    progress: Integers


class Turns:
    """Layers that decide one after the other: by kernels, and in Python, which is called between them where it is due.

    Attributes
    ----------
    arrays : TurnArrays
    python : list of str
        What makes Python due.
    """

    def __init__(
        self,
        kernels: Sequence[Kernel | None],
        decide: Callable[[int], None],
        layers: Sequence[Any],
        others: np.ndarray,
        first: Callable[[], None] | None = None,
        crew: RowCrew | None = None,
    ) -> None:
        calls = [(None, None) if kernel is None else call_of(kernel, crew) for kernel in kernels]
        blocks = [None if call is None else Block(call) for call, _ in calls]
        self.kept = [kept for _, kept in calls]
        self.kernels, self.layers, self.decide, self.first = kernels, layers, decide, first
        self.arrays = TurnArrays(stack_blocks(blocks, CALL_NUMBERS), others, first is not None, np.array([-1, 0, NEW]))
        self.python = [cause for kernel, layer in zip(kernels, layers, strict=True) for cause in _causes(kernel, layer)]

    def kernel(self, function: Any, arguments: NamedTuple) -> Kernel:
        """Return the kernel of a function that lets these layers decide."""
        block = Block(arguments)
        return Kernel(function, block.numbers, (self, block), self.attend)

    def owners(self) -> Iterator[Any]:
        """Iterate over layers and arbiters of whose attributes kernels are made; rules get theirs after a step."""
        for kernel, layer in zip(self.kernels, self.layers, strict=True):
            if kernel is not None or isinstance(layer, Behaviour):
                yield layer
            turns = kernel and _turns_of(kernel)
            yield from turns.owners() if turns else ()

    def attend(self, code: int) -> None:
        """Do in Python what is due for the layer whose turn it is; after an error the next step begins anew."""
        progress = self.arrays.progress
        place = int(progress[PLACE])
        kernel = self.kernels[place] if place >= 0 else None
        try:
            if kernel is not None:
                kernel.attend(code)  # type: ignore[misc]
                return
            self.decide(place) if place >= 0 else self.first()  # type: ignore[misc]
            progress[STATE] = DECIDED
        except BaseException:
            progress[BEGUN] = -1
            raise


def call_of(kernel: Kernel, crew: RowCrew | None) -> tuple[KernelCall, object]:
    """Return the call of a kernel for all rows, shared by a crew if it can be, and what the call refers to."""
    if crew is not None and kernel.rows:
        return crew.call_of(kernel.function, kernel.block)
    return KernelCall(code_address(kernel.function), kernel.block), None


def _causes(kernel: Kernel | None, layer: Any) -> list[str]:
    """Return what makes Python due where a layer decides, or an arbiter of a team."""
    if kernel is None:
        return [getattr(layer, "name", type(layer).__name__)]
    turns = _turns_of(kernel)
    return turns.python if turns else []


def _turns_of(kernel: Kernel) -> Turns | None:
    """Return the turns of an arbiter's kernel; that of a layer has None."""
    turns = kernel.kept[0] if isinstance(kernel.kept, tuple) else None
    return turns if isinstance(turns, Turns) else None


@compiled
def begin_turns(turns, step):
    """Return whether a step begins, and prepare for it; else it goes on."""
    progress = turns.progress
    if progress[BEGUN] == step:
        return False
    progress[BEGUN], progress[PLACE], progress[STATE] = step, 0, NEW
    if turns.waits:
        progress[PLACE] = -1
    return True


@compiled
def begin_turn(turns):
    """Return whether nothing was done yet for the layer whose turn it is, and note that something is."""
    is_new = turns.progress[STATE] == NEW
    if is_new:
        turns.progress[STATE] = PREPARED
    return is_new


@compiled
def call_layer(turns, step, first, last):
    """Let the layer whose turn it is decide, and return the code of its function, `DUE` where Python is to."""
    progress = turns.progress
    if progress[STATE] == DECIDED:
        return 0
    if progress[PLACE] < 0:
        return DUE
    call = unpack(turns.calls[progress[PLACE]], KernelCall)
    return DUE if call.address == 0 else call_at(call.address, call.block, step, first, last)


@compiled
def end_turn(turns):
    """Let it be the next layer's turn."""
    turns.progress[PLACE] += 1
    turns.progress[STATE] = NEW


@compiled
def clear_winners(turns, layer):
    """Set the winning layer (n,) to -1 for robots that this arbiter drives, and to 0 for others, which layers skip."""
    for i in range(layer.shape[0]):
        layer[i] = 0 if turns.others[i] else -1


class SubsumeArrays(NamedTuple):
    """What `subsume` takes."""

    turns: TurnArrays
    command: RealRows
    layer: Integers


@compiled(nogil=True)
def subsume(block, step, first, last):
    """Let each layer decide on the robots that none before it drives."""
    s = unpack(block, SubsumeArrays)
    turns = s.turns
    if begin_turns(turns, step):
        s.command[:] = 0.0
        clear_winners(turns, s.layer)
    while turns.progress[PLACE] < turns.calls.shape[0]:
        code = call_layer(turns, step, first, last)
        if code:
            return code
        end_turn(turns)
    turns.progress[BEGUN] = -1
    return 0


class Clearing(NamedTuple):
    """A column that is set to a value before robots decide."""

    column: Reals
    value: float


# How many numbers the block of one has.
CLEARING_NUMBERS = 3


class DecideArrays(NamedTuple):
    """What `decide_layers` takes.

    Parameters
    ----------
    turns : TurnArrays
        Of the arbiter, as of a layer.
    cleared : int64 ndarray, shape (k, 3)
        Rows of `Clearing`.
    numbers : int64 ndarray, shape (d,)
        How many numbers a command to robots of a design has.
    sends : bool
        Whether goals are sent.
    before, after : KernelCall
        Of `begin_decisions` and `end_decisions`, which threads may share.
    task, goal, ... : ndarrays
        Columns of the swarm, and whether designs go sideways.
    """

    turns: TurnArrays
    cleared: IntegerRows
    numbers: Integers
    sends: bool
    before: KernelCall
    after: KernelCall
    sideways: Flags
    task: Integers
    goal: RealRows
    last_command: RealRows
    command: RealRows
    layer: Integers
    max_speed: Reals
    design: Integers
    position: RealRows
    heading: Reals
    sent_goal: RealRows


def kernel_of_stage(
    arbiter: Any, senses: Senses, swarm: Swarm, cleared: Sequence[Clearing], sends: bool, refuse: Callable[[], None]
) -> Kernel:
    """Return what an arbiter decides and what is done before and after it; `refuse` raises an error for NaN."""
    columns, table = swarm.columns, swarm.table
    command, layer = columns["command"], columns["layer"]
    kernels = [kernel_of(arbiter, "decide", senses, command, layer)]
    turns = Turns(kernels, lambda place: arbiter.decide(senses, command, layer), [arbiter], np.empty(0, np.bool_))
    blocks = [Block(clearing) for clearing in cleared]
    rows = stack_blocks(blocks, CLEARING_NUMBERS)
    arrays = {name: columns[name] for name in DecideArrays._fields if name in columns}
    none = KernelCall(0, np.empty(0, np.int64))
    arguments = DecideArrays(turns.arrays, rows, table.numbers, sends, none, none, table.sideways, **arrays)
    block = Block(arguments)
    # Kernels of rows take the same block, whose numbers have no address before.
    around = [Kernel(function, block.numbers, rows=True) for function in (begin_decisions, end_decisions)]
    (before, kept), (after, kept_too) = (call_of(kernel, senses._crew) for kernel in around)
    block.replace(arguments._replace(before=before, after=after))
    kernel = Kernel(decide_layers, block.numbers, (turns, block, kept, kept_too), turns.attend)

    def attend(code: int) -> None:
        refuse() if code == NAN else turns.attend(code)

    return kernel._replace(kept=(*kernel.kept, blocks), attend=attend)


@compiled(nogil=True)
def decide_layers(block, step, first, last):
    """Clear what was set before, let an arbiter decide, limit what it commands, and send goals: for all rows."""
    d = unpack(block, DecideArrays)
    if begin_turns(d.turns, step):
        for k in range(d.cleared.shape[0]):
            clearing = unpack(d.cleared[k], Clearing)
            clearing.column[:] = clearing.value
        call_at(d.before.address, d.before.block, step, first, last)
    code = call_layer(d.turns, step, first, last)
    if code:
        return code
    d.turns.progress[BEGUN] = -1
    if call_at(d.after.address, d.after.block, step, first, last) > 0:
        return NAN
    if d.sends:
        send_goals(d.position, d.heading, d.goal, d.sent_goal)
    return 0


@compiled(nogil=True)
def begin_decisions(block, step, first, last):
    """Clear tasks and goals of some rows, and remember the last commands."""
    d = unpack(block, DecideArrays)
    task, goal, last_command, command = d.task, d.goal, d.last_command, d.command
    for i in range(first, last):
        task[i] = -1
        goal[i, 0], goal[i, 1] = math.nan, math.nan
        for w in range(command.shape[1]):
            last_command[i, w] = command[i, w]
    return 0


@compiled(nogil=True)
def end_decisions(block, step, first, last):
    """Limit the commands of some rows; return 1 if one is NaN, else 0."""
    d = unpack(block, DecideArrays)
    command, design = d.command[first:last], d.design[first:last]
    clear_unused(command, design, d.numbers)
    return 0 if limit_command(command, d.max_speed[first:last], design, d.sideways) < 0 else 1


HEAVIEST = 1e6
# Larger commands are clipped to this, so that sums stay finite.
LARGEST_COMMAND = 1e300


class VectorSum(Arbiter):
    """Layers whose commands are added up, each with its weight: cooperation where `Subsumption` is competition.

    Commands are linear in the motion that they make, so that their sum makes the sum of the motions. A sum beyond
    what a wheel, or a body that goes sideways, can do is scaled down in the same direction. The column `layer` is
    the layer with the largest share, the first of equals; a robot for which no layer is active stops.

    Parameters
    ----------
    *layers : Layer
        Layers, or rules made with `behaviour`; a layer of weight 0 decides without effect.
    weights : sequence of float, optional
        One a layer, -1,000,000 to 1,000,000; 1 each by default.

    Raises
    ------
    InvalidValueError
        If something is not a layer, or the weights are not one number a layer.

    Examples
    --------
    >>> from mesa_swarm.control import Avoid, Explore
    >>> VectorSum(Avoid(), Explore(), weights=(2, 1)).weights
    (2.0, 1.0)
    """

    sums = True

    def __init__(self, *layers: Layer, weights: Sequence[float] | None = None) -> None:
        super().__init__(*layers)
        values = [1.0] * len(layers) if weights is None else weights
        ordered = isinstance(values, Sequence) and not isinstance(values, str)
        ordered = ordered or (isinstance(values, np.ndarray) and values.ndim == 1)
        if not ordered or len(values) != len(layers):
            raise InvalidValueError(f"weights is {shortened(weights)}; expected {len(layers)} numbers, one a layer")
        self.weights = tuple(check_number("weight", weight, minimum=-HEAVIEST, maximum=HEAVIEST) for weight in values)

    def kernel_for(self, senses: Senses, command: np.ndarray, layer: np.ndarray) -> Kernel:
        """Return what decides on these columns."""
        layer_command, active = np.empty_like(command), np.empty_like(layer)
        turns, weights = self.turns(senses, layer_command, active), np.array(self.weights, float)
        scratch = layer_command, active, np.empty(len(layer))
        limits = senses.max_speed, senses.design, senses.sideways
        return turns.kernel(sum_layers, SumArrays(turns.arrays, weights, *scratch, command, layer, *limits))


class SumArrays(NamedTuple):
    """What `sum_layers` takes: layers and their weights, what one commands, where it is active, the largest shares."""

    turns: TurnArrays
    weights: Reals
    layer_command: RealRows
    active: Integers
    largest: Reals
    command: RealRows
    layer: Integers
    max_speed: Reals
    design: Integers
    sideways: Flags


@compiled(nogil=True)
def sum_layers(block, step, first, last):
    """Write the weighted sum of what all layers command, and the layer with the largest share of every robot."""
    s = unpack(block, SumArrays)
    turns = s.turns
    if begin_turns(turns, step):
        s.command[:], s.layer[:], s.largest[:] = 0.0, -1, 0.0
    while turns.progress[PLACE] < turns.calls.shape[0]:
        if begin_turn(turns):
            s.layer_command[:] = 0.0
            clear_winners(turns, s.active)
        code = call_layer(turns, step, first, last)
        if code:
            return code
        place = turns.progress[PLACE]
        add_weighted(s.layer_command, s.active, s.weights[place], place, s.command, s.layer, s.largest)
        end_turn(turns)
    turns.progress[BEGUN] = -1
    slow_down(s.command, s.max_speed, s.design, s.sideways)
    return 0


@compiled
def add_weighted(layer_command, active, weight, index, command, layer, largest):
    """Add what a layer commands where it is active, and note where its share is the largest so far.

    A layer with a weight that commands NaN has the largest share of all, so that an error can name it.
    """
    for i in range(layer.shape[0]):
        if active[i] < 0:
            continue
        if weight != 0.0 and any_nan(layer_command[i]) and largest[i] < math.inf:
            command[i, 0], command[i, 1], layer[i], largest[i] = math.nan, math.nan, index, math.inf
            continue
        x, y = weigh_command(layer_command[i, 0], weight), weigh_command(layer_command[i, 1], weight)
        command[i, 0] += x
        command[i, 1] += y
        share = hypot(x, y)
        for w in range(2, layer_command.shape[1]):
            z = weigh_command(layer_command[i, w], weight)
            command[i, w] += z
            share = hypot(share, z)
        if layer[i] < 0 or share > largest[i]:
            layer[i], largest[i] = index, share


@compiled
def any_nan(numbers) -> bool:
    """Return whether any of these numbers is NaN."""
    for number in numbers:
        if math.isnan(number):
            return True
    return False


@compiled
def weigh_command(value: float, weight: float) -> float:
    """Return the weighted command, finite; 0 if the weight is 0."""
    if weight == 0.0:
        return 0.0
    return weight * min(max(value, -LARGEST_COMMAND), LARGEST_COMMAND)


@compiled
def slow_down(command, max_speed, design, sideways):
    """Scale commands that ask for more than max_speed of any wheel, or of a body that goes sideways."""
    for i in range(command.shape[0]):
        if sideways[design[i]]:
            command[i, 0], command[i, 1] = limit_length(command[i, 0], command[i, 1], max_speed[i])
            continue
        most = max(abs(command[i, 0]), abs(command[i, 1]))
        for w in range(2, command.shape[1]):
            most = max(most, abs(command[i, w]))
        if most > max_speed[i]:
            share = max_speed[i] / most
            for w in range(command.shape[1]):
                command[i, w] *= share
