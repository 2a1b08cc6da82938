"""Probabilistic finite-state machines: states are layers, transitions are conditions; and their text."""

import ast
import re
import warnings
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, UnknownNameError, check_name, error_line, shortened, unknown_name
from mesa_swarm.base.streams import Streams
from mesa_swarm.control.approach import Approach, Halt, Retreat
from mesa_swarm.control.arbiter import (
    BEGUN,
    DECIDED,
    DUE,
    PLACE,
    STATE,
    Arbiter,
    TurnArrays,
    begin_turn,
    begin_turns,
    call_layer,
    clear_winners,
    end_turn,
)
from mesa_swarm.control.avoid import Avoid
from mesa_swarm.control.conditions import CONDITIONS, OWN, Condition, chance_of, own_chances
from mesa_swarm.control.explore import Explore
from mesa_swarm.control.flocking import Align, Cohere, Cruise, MatchVelocity, Separate
from mesa_swarm.control.follow import Follow
from mesa_swarm.control.gather import Gather, Lead
from mesa_swarm.control.head_on import HeadOn
from mesa_swarm.control.layer import Layer, RobotColumns, Senses, columns_for
from mesa_swarm.control.perimeter import Perimeter
from mesa_swarm.control.push import Push
from mesa_swarm.control.respond import Respond
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import Stream, draw_number, stream_of
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import Integers, RealRows
from mesa_swarm.robots.reasons import Reason
from mesa_swarm.robots.swarm import Swarm
from mesa_swarm.world.read_only import locked_view

# Names of states: words, between which may be single spaces or hyphens.
STATE_NAME = re.compile(r"\w+(?:[ -]\w+)*")
LONGEST_NAME, LONGEST_TEXT, MOST_TRANSITIONS = 60, 100_000, 1000
_TOWARDS = (Approach, Follow, Gather, HeadOn, Lead, Perimeter, Push, Respond, Retreat)
_LAYERS = (*_TOWARDS, Align, Avoid, Cohere, Cruise, Explore, Halt, MatchVelocity, Separate)
# What a text may name.
PARTS: dict[str, type] = {part.__name__: part for part in (*_LAYERS, *CONDITIONS)}
# Characters of "line 1234: ", which errors begin with.
LINE = 12
# What reading an expression raises if it is not the literal of a value.
UNREADABLE = (SyntaxError, TypeError, ValueError, RecursionError, MemoryError)
ARROW = re.compile(r"(.+?)\s*->\s*(.+)")


@dataclass(frozen=True, kw_only=True, slots=True)
class Transition:
    """A change from one state of a machine to another, and its condition.

    Parameters
    ----------
    source, target : str
        Names of two states; a transition may also lead back to its own state, which changes nothing.
    condition : Condition
        Such as `Chance` or `Seen`.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> from mesa_swarm.control import Chance
    >>> Transition(source="stay", target="search", condition=Chance(probability=0.01)).condition.label
    'p = 0.01'
    """

    source: str
    target: str
    condition: Condition

    def __post_init__(self) -> None:
        """Check the names and the condition."""
        check_name("source", self.source)
        check_name("target", self.target)
        if not isinstance(self.condition, Condition):
            raise InvalidValueError(
                f"condition is {shortened(self.condition)}; expected one such as Chance(probability=0.1)"
            )
        if self.condition.code == OWN and type(self.condition).chances is Condition.chances:
            raise InvalidValueError(
                f"condition {shortened(self.condition)} has no method chances; use one such as Chance, or define it"
            )


class StateMachine(Arbiter):
    """A probabilistic finite-state machine: each robot is in a state, whose layers drive it [1]_.

    In each step, first the conditions of the transitions out of a robot's state are tried in their order, each with a
    random number of its own; the first that is fulfilled changes the state. Then the layers of the state that it is in
    now decide, the first active one drives, as in a `Subsumption` of its own. Robots begin in the first state.

    Parameters
    ----------
    states : mapping
        Of each state's name to its layer, or to several, most important first. Layers such as `Approach`, `Halt`,
        `Explore` and `Avoid`, or rules made with `behaviour`.
    transitions : iterable of Transition
        At most 1,000; none for a machine that remains in its first state.

    Raises
    ------
    InvalidValueError
        If a name is not one of words with single spaces or hyphens between, or something is not a layer or transition.
    UnknownNameError
        If a transition is from or to an unknown state.

    References
    ----------
    .. [1] Francesca, Brambilla, Brutschy, Trianni and Birattari, AutoMoDe: a novel approach to the automatic design of
       control software for robot swarms, Swarm Intelligence 8 (2014) 89-112.

    Examples
    --------
    >>> from mesa_swarm.control import Avoid, Chance, Explore, Halt, Seen
    >>> machine = StateMachine(
    ...     states={"search": (Avoid(distance=10), Explore()), "stay": Halt()},
    ...     transitions=[
    ...         Transition(source="search", target="stay", condition=Seen(kind="robot", within=15)),
    ...         Transition(source="stay", target="search", condition=Chance(probability=0.01)),
    ...     ],
    ... )
    >>> print(machine.text())
    search: Avoid(distance=10), Explore()
    stay: Halt()
    search -> stay: Seen(kind='robot', within=15)
    stay -> search: Chance(probability=0.01)
    <BLANKLINE>
    >>> StateMachine.read(machine.text()) == machine
    True
    """

    _swarm: Swarm | None = None
    _prefix = ""

    def __init__(self, states: Mapping[str, Layer | Sequence[Layer]], transitions: Iterable[Transition] = ()) -> None:
        if not isinstance(states, Mapping) or not states:
            raise InvalidValueError(f"states is {shortened(states)}; expected names and layers, at least one state")
        groups = {_check_state(name): _as_layers(name, group) for name, group in states.items()}
        super().__init__(*(layer for layers in groups.values() for layer in layers))
        self.state_names: tuple[str, ...] = tuple(groups)
        self._firsts = np.cumsum([0, *map(len, groups.values())])
        self.transitions = _check_transitions(transitions, self.state_names)
        self._tabulate()

    def _tabulate(self) -> None:
        """Arrange the transitions by their source, as the compiled function takes them."""
        numbers = {name: k for k, name in enumerate(self.state_names)}
        sources = np.array([numbers[transition.source] for transition in self.transitions], np.int64)
        self._order = np.argsort(sources, kind="stable")
        counts = np.bincount(sources, minlength=len(numbers))
        self._out = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        ordered = [self.transitions[k] for k in self._order.tolist()]
        self._targets = np.array([numbers[transition.target] for transition in ordered], np.int64)
        self._rows = np.array([transition.condition.row for transition in ordered], float).reshape(len(ordered), 5)
        self._most = int(counts.max())

    @property
    def states(self) -> dict[str, tuple[Layer, ...]]:
        """The layers of each state by its name, in the order of their numbers."""
        spans = zip(self._firsts[:-1].tolist(), self._firsts[1:].tolist(), strict=True)
        return {name: tuple(self.layers[a:b]) for name, (a, b) in zip(self.state_names, spans, strict=True)}

    def _graph(self) -> list:
        return [
            [[name, len(layers)] for name, layers in self.states.items()],
            [[transition.source, transition.target, transition.condition] for transition in self.transitions],
        ]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the layers, after that of their state: "search: Avoid"."""
        return tuple(f"{name}: {layer.name}" for name, layers in self.states.items() for layer in layers)

    @property
    def noted(self) -> tuple[str, ...]:
        """The columns of the swarm that explain its decisions, once it is part of a model's control."""
        return (f"{self._prefix}.now", f"{self._prefix}.fired") if self._prefix else ()

    @property
    def now(self) -> np.ndarray:
        """The number of each robot's state (n,), an index into `state_names`; of a model's control only.

        Raises
        ------
        InvalidValueError
            If the machine does not belong to a model.
        """
        if self._swarm is None:
            raise InvalidValueError("this machine drives no robots; read it from model.control after setting it there")
        return locked_view(self._swarm.columns[f"{self._prefix}.now"])

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, StateMachine):
            return NotImplemented
        return (list(self.states.items()), self.transitions) == (list(other.states.items()), other.transitions)

    __hash__ = object.__hash__

    def __repr__(self) -> str:
        return f"<StateMachine of {', '.join(self.state_names)}; {len(self.transitions)} transitions>"

    def __str__(self) -> str:
        return self.text()

    def _bind(self, swarm: Swarm, streams: Streams, first: int, place: str) -> None:
        """Make columns for the state of each robot."""
        self._swarm, self._prefix = swarm, f"{first}.{place}state"
        swarm.remember(f"{self._prefix}.now", (), np.int64, 0)
        swarm.remember(f"{self._prefix}.fired", (), np.int64, -1)
        self._rng = streams[f"decide.{place}#state"]  # no layer has such a name

    def kernel_for(self, senses: Senses, command: np.ndarray, layer: np.ndarray) -> Kernel:
        """Return what changes the states, and then decides on these columns."""
        if self._swarm is None:
            raise InvalidValueError("this machine drives no robots; set model.control to it")
        now, fired = (self._swarm.columns[f"{self._prefix}.{name}"] for name in ("now", "fired"))
        n, active = len(layer), np.empty_like(layer)
        own, draws = np.zeros((n, len(self._rows))), np.empty((n, self._most))
        custom = self._custom_conditions()

        def ask_conditions() -> None:
            for place, condition in custom:
                own[:, place] = own_chances(condition, senses)

        turns = self.turns(senses, command, active, ask_conditions if custom else None)
        turns.python += [type(condition).__name__ for _, condition in custom]
        tables = self._out, self._targets, self._order, self._rows, self._firsts
        return turns.kernel(
            run_machine,
            MachineArrays(
                turns.arrays, columns_for(senses, command, layer, 0), *tables, own, draws, stream_of(self._rng), now,
                fired, active,
            ),
        )  # fmt: skip

    def _custom_conditions(self) -> list[tuple[int, Condition]]:
        """Return the conditions whose chances are computed in Python, with their places in the table."""
        ordered = [self.transitions[number].condition for number in self._order.tolist()]
        return [(place, condition) for place, condition in enumerate(ordered) if condition.code == OWN]

    def explain(self, reason: Reason, row: Mapping[str, Any]) -> Reason:
        """Return a layer's reason, after the transition that was taken in that step, if there was one.

        `row` holds the columns `noted` of one robot.
        """
        number = int(row.get(f"{self._prefix}.fired", -1))
        if not 0 <= number < len(self.transitions):
            return reason
        transition = self.transitions[number]
        words = f"{transition.source} -> {transition.target} as {transition.condition.label}; {reason.words}"
        return Reason(words, reason.sensors)

    def text(self) -> str:
        """Return the machine as text, a line for each state and transition, which `read` reads.

        Numbers are written with all their digits; what has its default value is left out.

        Raises
        ------
        InvalidValueError
            If a layer or condition is not a dataclass, such as a rule made with `behaviour`, or has values that a text
            cannot hold.
        """
        states = [f"{name}: {', '.join(map(_part_as_text, layers))}" for name, layers in self.states.items()]
        changes = [f"{way.source} -> {way.target}: {_part_as_text(way.condition)}" for way in self.transitions]
        return "".join(f"{line}\n" for line in (*states, *changes))

    @classmethod
    def read(cls, text: str, parts: Iterable[type] = ()) -> "StateMachine":
        """Return the machine that a text describes.

        Parameters
        ----------
        text : str
            A line for each state, ``name: Layer(...), ...``, and each transition, ``name -> name: Condition(...)``;
            empty lines and those that begin with # are skipped. Nothing in it is executed.
        parts : iterable of classes, optional
            Other layers and conditions that it may name, such as those of `mesa_swarm.fire`, or custom ones.

        Raises
        ------
        InvalidValueError, UnknownNameError
            If a line is not of this form, or names an unknown part; the error gives the line.

        Examples
        --------
        >>> StateMachine.read('''
        ... # Robots that gather, and part now and then.
        ... search: Avoid(distance=5), Approach(target='robot'), Explore()
        ... part: Avoid(distance=5), Retreat(target='robot'), Explore()
        ... search -> part: RobotsSeen(number=6)
        ... part -> search: Chance(probability=0.02)
        ... ''').names[:2]
        ('search: Avoid', 'search: Approach')
        """
        if not isinstance(text, str) or len(text) > LONGEST_TEXT:
            raise InvalidValueError(f"text is {shortened(text)}; expected up to {LONGEST_TEXT:,} characters")
        classes = {**PARTS, **_check_parts(parts)}
        states: dict[str, tuple] = {}
        transitions: list[tuple[int, Transition]] = []
        for number, line in enumerate(text.splitlines(), 1):
            if not line.strip() or line.lstrip().startswith("#"):
                continue
            head, parts_of_line = _read_line(number, line, classes)
            arrow = ARROW.fullmatch(head)
            if arrow:
                make = partial(Transition, source=arrow[1], target=arrow[2])
                transitions += [(number, _at_line(number, partial(make, condition=part))) for part in parts_of_line]
            elif head in states:
                raise InvalidValueError(f"line {number}: the state {shortened(head)} is there twice; rename one")
            else:
                name = _at_line(number, partial(_check_state, head))
                states[name] = _at_line(number, partial(_without_conditions, parts_of_line))
        if not states:
            raise InvalidValueError("text has no state; expected a line such as search: Avoid(), Explore()")
        for number, transition in transitions:
            _at_line(number, partial(_check_ends, transition, states))
        return cls(states, [transition for _, transition in transitions])


def _check_state(name: object) -> str:
    if not isinstance(name, str) or len(name) > LONGEST_NAME or not STATE_NAME.fullmatch(name):
        raise InvalidValueError(
            f"name of a state is {shortened(name)}; expected words of letters, digits and _, with single spaces or "
            f"hyphens between them, at most {LONGEST_NAME} characters"
        )
    return name


def _as_layers(name: str, layers: Any) -> tuple:
    """Return the layers of a state."""
    is_list = isinstance(layers, Sequence) and not isinstance(layers, str)
    if is_list and not layers:
        raise InvalidValueError(f"state {name} has no layers; use Halt() for robots that stand")
    return tuple(layers) if is_list else (layers,)


def _check_transitions(transitions: Any, names: Sequence[str]) -> tuple[Transition, ...]:
    items = tuple(transitions) if isinstance(transitions, Iterable) else (transitions,)
    for item in items:
        if not isinstance(item, Transition):
            raise InvalidValueError(f"transitions has {shortened(item)}; expected Transition(...)")
        _check_ends(item, names)
    if len(items) > MOST_TRANSITIONS:
        raise InvalidValueError(f"the machine has {len(items):,} transitions; expected at most {MOST_TRANSITIONS:,}")
    return items


def _check_ends(transition: Transition, names: Collection[str]) -> None:
    """Check that a transition is from and to states of a machine."""
    for name in (transition.source, transition.target):
        if name not in names:
            raise UnknownNameError(unknown_name("state", name, names, beside=LINE))


def _part_as_text(part: Any) -> str:
    """Return a layer or condition as the call that makes it, without what has its default value."""
    if not is_dataclass(part):
        raise InvalidValueError(
            f"{type(part).__name__} {getattr(part, 'name', '')} is not a dataclass, and has no text; use a layer class"
        )
    kind = type(part).__name__
    values = [(field, _plain(getattr(part, field.name))) for field in fields(part) if field.init]
    keywords = (_as_keyword(kind, field.name, value) for field, value in values if not _is_same(value, field.default))
    return f"{kind}({', '.join(keywords)})"


def _plain(value: Any) -> Any:
    """Return a number of NumPy as one of Python, anything else as it is."""
    return value.item() if isinstance(value, np.generic) else value


def _as_keyword(kind: str, name: str, value: Any) -> str:
    """Return a value as a keyword that `_value` reads as this value."""
    text = repr(value)
    with suppress(*UNREADABLE):
        if ast.literal_eval(text) == value:
            return f"{name}={text}"
    raise _not_plain(kind, name, shortened(value))


def _not_plain(kind: str, name: str, text: str) -> InvalidValueError:
    return InvalidValueError(f"{kind}'s {name} is {text}; expected a number, text, True, False or None")


def _is_same(value: object, default: object) -> bool:
    """Return whether a value is the default and of its type."""
    return type(value) is type(default) and value == default


def _read_line(number: int, line: str, classes: Mapping[str, type]) -> tuple[str, tuple]:
    """Return what stands before the colon of a line, and the parts that stand after it."""
    head, colon, body = line.partition(":")
    tree = None
    with suppress(*UNREADABLE), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about texts such as "\\d", which the user did not write as Python
        tree = ast.parse(f"({body.strip()},)", mode="eval").body
    calls = tree.elts if colon and isinstance(tree, ast.Tuple) else []
    if not calls or not all(map(_is_plain_call, calls)):
        raise InvalidValueError(
            f"line {number} is {shortened(line)}; expected name: Layer(...), ... or name -> name: Condition(...)"
        )
    return head.strip(), tuple(_at_line(number, partial(_make_part, call, classes)) for call in calls)


def _is_plain_call(call: ast.AST) -> bool:
    """Return whether this is a call of a name with nothing but keywords."""
    plain = isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and not call.args
    return plain and all(keyword.arg for keyword in call.keywords)  # type: ignore[attr-defined]


def _make_part(call: Any, classes: Mapping[str, type]) -> Any:
    name = call.func.id
    if name not in classes:
        raise UnknownNameError(unknown_name("layer or condition", name, classes, beside=LINE))
    part, names = classes[name], [keyword.arg for keyword in call.keywords]
    repeated = next((parameter for parameter in names if names.count(parameter) > 1), None)
    if repeated:
        raise InvalidValueError(f"{name} has two values for {shortened(repeated)[1:-1]}; remove one")
    parameters = [field.name for field in fields(part) if field.init]  # type: ignore[arg-type]
    for parameter in names:
        if parameter not in parameters:
            raise UnknownNameError(unknown_name(f"parameter of {name}", parameter, parameters, beside=LINE))
    return part(**{keyword.arg: _value(name, keyword) for keyword in call.keywords})


def _value(kind: str, keyword: Any) -> Any:
    """Return the value of a keyword of a layer or condition."""
    with suppress(*UNREADABLE):
        return ast.literal_eval(keyword.value)
    raise _not_plain(kind, keyword.arg, _source(keyword.value))


def _source(tree: ast.AST) -> str:
    """Return the source of an expression, a long one without its end."""
    text = "too deep"
    with suppress(RecursionError):
        text = " ".join(ast.unparse(tree).split())
    return text if len(text) <= 80 else f"{text[:77]}..."


def _check_parts(parts: Any) -> dict[str, type]:
    """Return other layers and conditions by their names."""
    classes = list(parts) if isinstance(parts, Iterable) else [parts]
    if not all(isinstance(part, type) and is_dataclass(part) for part in classes):
        raise InvalidValueError(
            f"parts is {shortened(parts)}; expected classes of layers and conditions, as dataclasses"
        )
    return {part.__name__: part for part in classes}


def _without_conditions(layers: tuple) -> tuple:
    """Return the layers of a state, none of which may be a condition."""
    for part in layers:
        if isinstance(part, Condition):
            raise InvalidValueError(f"a state has {shortened(part)}; expected layers such as Avoid()")
    return layers


def _at_line(number: int, make: Any) -> Any:
    """Return what is made; an error names the line."""
    try:
        return make()
    except UnknownNameError as error:
        raise UnknownNameError(f"line {number}: {error}") from None
    except (ValueError, TypeError) as error:
        raise InvalidValueError(f"line {number}: {error_line(error)}") from None


class MachineArrays(NamedTuple):
    """What `run_machine` takes.

    Parameters
    ----------
    turns : TurnArrays
    robots : RobotColumns
    out : int64 ndarray, shape (states + 1,)
        Where in the tables the transitions out of each state begin.
    targets, numbers : int64 ndarrays, shape (transitions,)
        The states to which they lead, and their numbers.
    rows : ndarray, shape (transitions, 5)
        See `Condition.row`.
    firsts : int64 ndarray, shape (states + 1,)
        The first layer of each state.
    own, draws : ndarrays, shapes (n, transitions), (n, most)
        Chances of custom conditions, and random numbers.
    stream : Stream
    now, fired : int64 ndarrays, shape (n,)
        States, and the transitions taken in a step.
    active : int64 ndarray, shape (n,)
        Which layer of a state won.
    """

    turns: TurnArrays
    robots: RobotColumns
    out: Integers
    targets: Integers
    numbers: Integers
    rows: RealRows
    firsts: Integers
    own: RealRows
    draws: RealRows
    stream: Stream
    now: Integers
    fired: Integers
    active: Integers


@compiled(nogil=True)
def run_machine(block, step, first, last):
    """Change the states, then let the layers of each state decide on the robots that are in it."""
    m = unpack(block, MachineArrays)
    turns, layer, progress = m.turns, m.robots.layer, m.turns.progress
    if begin_turns(turns, step):
        m.robots.command[:] = 0.0
        clear_winners(turns, layer)
        for i in range(m.draws.shape[0]):
            for t in range(m.draws.shape[1]):
                m.draws[i, t] = draw_number(m.stream)
        if not turns.waits:
            change_states(m)
    elif progress[PLACE] < 0 and progress[STATE] == DECIDED:  # Python has asked the custom conditions
        change_states(m)
        end_turn(turns)
    if progress[PLACE] < 0:
        return DUE
    while progress[PLACE] < turns.calls.shape[0]:
        state = np.searchsorted(m.firsts, progress[PLACE], side="right") - 1
        if begin_turn(turns) and progress[PLACE] == m.firsts[state]:
            begin_state(m.now, state, layer, m.active)
        code = call_layer(turns, step, first, last)
        if code:
            return code
        end_turn(turns)
        if progress[PLACE] == m.firsts[state + 1]:
            end_state(m.now, state, layer, m.active)
    progress[BEGUN] = -1
    return 0


@compiled
def change_states(m):
    """Write the new states (n,) and the transitions taken (n,), -1 for none, of robots that no other arbiter drives."""
    robots, now, fired = m.robots, m.now, m.fired
    distance, kind, line, radiation = robots.distance, robots.kind, robots.line, robots.radiation
    for i in range(now.shape[0]):
        fired[i] = -1
        if robots.layer[i] >= 0:
            continue
        first = m.out[now[i]]
        for t in range(first, m.out[now[i] + 1]):
            custom = m.rows[t, 0] == OWN
            chance = m.own[i, t] if custom else chance_of(distance, kind, line, radiation, i, m.rows[t])
            if m.draws[i, t - first] < chance:
                now[i] = m.targets[t]
                fired[i] = m.numbers[t]
                break


@compiled
def begin_state(now, number, layer, active):
    """Let only those robots be decided on that are in this state: -1, all others 0."""
    for i in range(now.shape[0]):
        active[i] = -1 if now[i] == number and layer[i] < 0 else 0


@compiled
def end_state(now, number, layer, active):
    """Take over which layer won where a robot is in this state and is driven by this arbiter."""
    for i in range(now.shape[0]):
        if now[i] == number and layer[i] < 0:
            layer[i] = active[i]
