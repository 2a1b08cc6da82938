"""Parts, columns and stages: what a model is made of, and what its step is a list of."""

import dis
from collections.abc import Callable, Iterable, Mapping
from enum import IntEnum
from functools import cache
from types import FunctionType
from typing import Any, Literal, NamedTuple, Protocol, get_args

import numpy as np

from mesa_swarm.base.errors import InvalidValueError


class Phase(IntEnum):
    """The phases of a step, in their order; within a phase stages follow in the order of parts.

    Examples
    --------
    >>> [phase.name.lower() for phase in Phase]
    ['sense', 'exchange', 'decide', 'act', 'move', 'resolve', 'process', 'collect']
    """

    SENSE = 0
    EXCHANGE = 1
    DECIDE = 2
    ACT = 3
    MOVE = 4
    RESOLVE = 5
    PROCESS = 6
    COLLECT = 7


Rows = Literal["robots", "bodies"]
Role = Literal["state", "parameter", "derived", "index"]
ROLES: tuple[str, ...] = get_args(Role)
# Roles of columns that belong to the fingerprint of a model.
HASHED = ("state", "parameter")
# Roles of columns that recordings store; what is derived is made anew from the others.
STORED = ("state", "parameter", "index")


class Column(NamedTuple):
    """An array of a part's state.

    Parameters
    ----------
    array : ndarray
        Written in place. The model itself adds and removes its rows, if it has any.
    rows : "robots", "bodies" or None
        Of what each row is: of a robot, in the order of `model.robots`; of a body, in that of `model.bodies`; None for
        arrays of any shape.
    role : "state", "parameter", "derived" or "index"
        State and parameters are hashed and stored; `continued` takes over all but parameters. Indices are stored, but
        not hashed. What is derived is neither.
    initial : number
        The value of a new row.

    Examples
    --------
    >>> Column(np.zeros(3), "robots").role
    'state'
    """

    array: np.ndarray
    rows: Rows | None = None
    role: Role = "state"
    initial: Any = 0


class Kernel(NamedTuple):
    """A compiled stage: a function ``int64 f(block, step, first, last)`` and the block of its arguments.

    It advances rows `first` to `last` of the robots, 0 and n for all, and returns a code, 0 if it is done; an exception
    never crosses it. A function that cannot be cut into ranges of rows states so, and takes all.

    Parameters
    ----------
    function : compiled function
        Of one signature.
    block : int64 ndarray
        Addresses and shapes of arrays, and numbers, see `kernels.block`: valid as long as the plan that has it, and no
        parameter is set by hand; `model.plan` is made anew with these.
    kept : object
        What the block refers to, which has to live as long.
    attend : callable, optional
        Does in Python what the function could not, such as to make an array longer, after it has returned this code.
        Then it is called again, and goes on.
    finish : callable, optional
        Takes what the function has written into buffers, after the last of several steps.
    rows : bool
        Whether threads may call the function for ranges of rows at the same time: what it does for a row depends on no
        other, and it draws nothing.
    """

    function: Callable[[np.ndarray, int, int, int], int]
    block: np.ndarray
    kept: Any = None
    attend: Callable[[int], None] | None = None
    finish: Callable[[], None] | None = None
    rows: bool = False

    def run(self, step: int, n: int) -> None:
        """Call the function for n robots until it is done; `step` counts from 1."""
        while code := self.function(self.block, step, 0, n):
            self.attend(code)  # type: ignore[misc]
        if self.finish is not None:
            self.finish()


def kernel_of(instance: Any, method: str, *arguments: Any) -> Kernel | None:
    """Return what ``kernel_for(*arguments)`` of an object does, which does the same as a method of it, else None.

    None as well where a derived class has another such method.
    """
    owner = next((kind for kind in type(instance).__mro__ if {method, "kernel_for"} & vars(kind).keys()), object)
    return instance.kernel_for(*arguments) if "kernel_for" in vars(owner) else None


class Prepared:
    """What a part has made of its state, and makes anew where that has changed; a copy begins without."""

    state: Any = None
    kernel: Kernel | None = None

    def __reduce__(self) -> tuple:
        return type(self), ()


class Stage(NamedTuple):
    """What a part does in a phase of the step.

    Parameters
    ----------
    phase : Phase
    call : callable
        Of no arguments: does it, by the kernel if there is one.
    name : str
        A few words for `print(model.plan)`.
    kernel : Kernel, optional
        The same as one compiled function, where that does all of it.
    every : int
        Steps from one call to the next, counted from the beginning of the run.
    compiled : str
        Names of the compiled functions that do the work where there is no kernel, if they do.
    python : str
        What makes Python due, such as a rule that could not be compiled; empty for nothing but the call.
    """

    phase: Phase
    call: Callable[[], None]
    name: str
    kernel: Kernel | None = None
    every: int = 1
    compiled: str = ""
    python: str = ""


class Shown(NamedTuple):
    """What a viewer may draw and name of a part, in map units.

    Parameters
    ----------
    name : str
        As in a legend.
    discs : ndarray, shape (k, 3), optional
        x, y and radius of each.
    values : ndarray, shape (rows, columns), optional
        A picture of the whole map, from 0 for nothing; its first row is at the bottom.
    colour : str
        Of the discs, # and six hexadecimal digits, by default that of the first field. Values are drawn as fields are.
    rows : mapping of str to array, optional
        Values of each robot, shape (n,) or (n, k), which the inspector names besides columns of robots.
    text : str
        A line about the part as it is now.
    """

    name: str
    discs: np.ndarray | None = None
    values: np.ndarray | None = None
    colour: str = ""
    rows: Mapping[str, np.ndarray] = {}
    text: str = ""


class Context(NamedTuple):
    """What a part may use: the model, its other parts, and streams of random numbers by name."""

    model: Any
    parts: "Mapping[str, Part]"
    streams: Mapping[str, np.random.Generator]


class Part(Protocol):
    """What a model is made of: robots, bodies, fields, radio, control, processes, and parts of a user's own.

    Derive from it, and add an object with `SwarmModel.add_part`. A part that declares its columns is hashed, recorded,
    resumed, continued, copied and inspected without another line. Every method has a default: attributes of plain
    values that the constructor of a part sets are stored, those that `bind` sets are made anew.

    Attributes
    ----------
    name : str
        One word, different from those of other parts.
    first : tuple of str
        Names in what `store` returns that decide which columns there are: they are restored before these.

    Examples
    --------
    >>> from mesa_swarm import AGENT9, Part, SwarmModel
    >>> from mesa_swarm.kernels.part import Column, Phase, Stage
    >>> class Odometer(Part):
    ...     name = "odometer"
    ...
    ...     def bind(self, context):
    ...         self.model = context.model
    ...         if not hasattr(self, "driven"):
    ...             self.driven = np.zeros(len(context.model.swarm))
    ...
    ...     def columns(self):
    ...         return {"driven": Column(self.driven, "robots")}
    ...
    ...     def stages(self):
    ...         return [Stage(Phase.PROCESS, self.add, "adds up ways")]
    ...
    ...     def add(self):
    ...         self.driven += np.abs(self.model.swarm.command).mean(axis=1)
    >>> model = SwarmModel(rng=1)
    >>> robots = model.add_robots(AGENT9, 2)
    >>> odometer = model.add_part(Odometer())
    >>> model.run(3).parts["odometer"].driven
    array([0., 0.])
    """

    name: str
    first: tuple[str, ...] = ()

    def bind(self, context: Context) -> None:
        """Take what the part needs; called when it is added, and anew after the model was copied or restored."""
        return

    def columns(self) -> Mapping[str, Column]:
        """Return the arrays of its state by name."""
        return {}

    def stages(self) -> Iterable[Stage]:
        """Return what it does in each step; called after `bind`, and neither stored nor copied."""
        return ()

    def store(self) -> dict[str, Any]:
        """Return the state that is not in arrays, as plain values, agents and designs by name.

        By default the attributes that its constructor has set, without those that are columns.
        """
        columns = {id(column.array) for column in self.columns().values()}
        return {name: value for name, value in list_attributes(self).items() if id(value) not in columns}

    def word_of(self, name: str) -> str:
        """Return in a few words what a stored value is, for messages."""
        return f"{self.name}'s {name}"

    def restore(self, stored: dict[str, Any]) -> None:
        """Take back what `store` returned, or some of it."""
        for name, value in stored.items():
            object.__setattr__(self, name, value)

    def replace(self, name: str, array: np.ndarray) -> None:
        """Have another array as a column, of which the model has added or removed rows.

        By default the attribute that held the former one has it.
        """
        old_array = self.columns()[name].array
        holder = next((attribute for attribute, value in vars(self).items() if value is old_array), None)
        if holder is None:
            raise InvalidValueError(
                f"part {self.name} has no attribute that is its column {name}; define replace(name, array)"
            )
        setattr(self, holder, array)

    def shown(self) -> Shown | None:
        """Return what a viewer may draw and name, None for nothing."""
        return None


class Itself:
    """An object that is equal to itself only, however its class defines equality."""

    __slots__ = ("value",)
    __hash__ = object.__hash__

    def __init__(self, value: Any) -> None:
        self.value = value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Itself) and other.value is self.value


def list_attributes(part: Part) -> dict[str, Any]:
    """Return the attributes of a part, without those that `bind` makes anew."""
    bound = find_bound_names(type(part))  # type: ignore[arg-type]
    return {name: value for name, value in vars(part).items() if name not in bound}


@cache
def find_bound_names(kind: type) -> frozenset[str]:
    """Return the attributes that `bind` of a class assigns and its constructor does not: they are made anew.

    Examples
    --------
    >>> class Odometer(Part):
    ...     def __init__(self):
    ...         self.driven = 0.0
    ...
    ...     def bind(self, context):
    ...         self.model, self.driven = context.model, self.driven
    >>> sorted(find_bound_names(Odometer))
    ['model']
    """
    return find_assigned_names(kind, "bind") - find_assigned_names(kind, "__init__")


def find_assigned_names(kind: type, method: str) -> frozenset[str]:
    """Return the names of attributes that a method of a class, and of its bases, assigns."""
    functions = [attribute for base in kind.__mro__ if isinstance(attribute := vars(base).get(method), FunctionType)]
    steps = (step for function in functions for step in dis.get_instructions(function))
    return frozenset(step.argval for step in steps if step.opname == "STORE_ATTR")
