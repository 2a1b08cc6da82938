"""Teams: one arbiter for each design or named group of robots."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from copy import copy
from typing import Any, NamedTuple

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_name, shortened
from mesa_swarm.base.streams import Streams
from mesa_swarm.control.arbiter import (
    BEGUN,
    MOST_LAYERS,
    PLACE,
    Arbiter,
    TurnArrays,
    Turns,
    begin_turns,
    call_layer,
    check_drives,
    end_turn,
)
from mesa_swarm.control.layer import Senses
from mesa_swarm.kernels.block import unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.part import Kernel, kernel_of
from mesa_swarm.kernels.type_names import Integers, RealRows
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.swarm import Swarm

Key = RobotDesign | str
# Of the keys in messages.
LONGEST_LIST = 100


class Team(Arbiter, Mapping):
    """Arbiters of parts of a swarm, by design or by the name of a group: what a mapping becomes as `model.control`.

    Its layers are those of all arbiters, one arbiter after the other: the column `layer` has indices into them. Each
    layer decides on its own robots, with random streams and columns of its own. The names of layers that several
    arbiters have begin with the group or the design, such as "scouts: Avoid".

    Parameters
    ----------
    arbiters : mapping
        Of designs and names of groups to arbiters, or to None for robots that stand still. A robot is driven by the
        arbiter of its group; if that has none, by the one of its design.

    Raises
    ------
    InvalidValueError
        If it is empty, a key is neither a design nor a name, a value is not an arbiter, or there are too many layers.

    Examples
    --------
    >>> from mesa_swarm import AGENT9
    >>> from mesa_swarm.control import Avoid, Explore, Subsumption
    >>> team = Team({"scouts": Subsumption(Avoid(distance=30), Explore()), AGENT9: Subsumption(Avoid())})
    >>> team.names
    ('scouts: Avoid', 'Explore', 'AGENT9: Avoid')
    """

    _swarm: Swarm | None = None
    _version: tuple[int, int] = (-1, -1)
    _owner: np.ndarray

    def __init__(self, arbiters: Mapping[Key, Arbiter | None]) -> None:
        for key, arbiter in arbiters.items():
            if not isinstance(key, RobotDesign):
                _check_key(key)
            if arbiter is not None and (not isinstance(arbiter, Arbiter) or isinstance(arbiter, Team)):
                raise InvalidValueError(
                    f"control of {message_label(key)} is {shortened(arbiter)}; expected an arbiter such as "
                    "Subsumption(Avoid(), Explore()), or None for robots that stand still"
                )
        if not arbiters:
            raise InvalidValueError("control has no arbiters; expected one for each design or group, or None for all")
        self._arbiters = dict(arbiters)
        self._arrange()
        if len(self.layers) > MOST_LAYERS:
            raise InvalidValueError(f"control has {len(self.layers)} layers in all; expected at most {MOST_LAYERS}")

    def __getitem__(self, key: Key) -> Arbiter | None:
        """Return the arbiter of a design or group."""
        return self._arbiters[key]

    def __iter__(self) -> Iterator[Key]:
        """Iterate over the designs and groups."""
        return iter(self._arbiters)

    def __len__(self) -> int:
        """How many designs and groups have an arbiter."""
        return len(self._arbiters)

    def __repr__(self) -> str:
        return f"<Team of {', '.join(self._labels)}>"

    __hash__ = object.__hash__

    def _arrange(self) -> None:
        """Index the layers of all arbiters, one arbiter after the other."""
        driving = {key: arbiter for key, arbiter in self._arbiters.items() if arbiter is not None}
        self._driving = tuple(driving.values())
        self.layers = tuple(layer for arbiter in self.arbiters for layer in arbiter.layers)
        counts = [len(arbiter.layers) for arbiter in self.arbiters]
        self._firsts = [sum(counts[:k]) for k in range(len(counts))]
        self._places = {key: k for k, key in enumerate(driving)}
        labels = list(map(message_label, driving))
        self._labels = [f"{label} {k + 1}" if labels.count(label) > 1 else label for k, label in enumerate(labels)]

    @property
    def arbiters(self) -> tuple[Arbiter, ...]:
        """The arbiters, without those that are None."""
        return self._driving

    @property
    def labels(self) -> tuple[str, ...]:
        """The names of the designs and groups of `arbiters`, distinct."""
        return tuple(self._labels)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the layers, distinct between arbiters."""
        times = Counter(name for arbiter in self.arbiters for name in dict.fromkeys(arbiter.names))
        labelled = zip(self._labels, self.arbiters, strict=True)
        return tuple(
            f"{label}: {name}" if times[name] > 1 else name for label, arbiter in labelled for name in arbiter.names
        )

    def arbiter_of(self, index: int) -> Arbiter:
        """Return the arbiter that a layer belongs to."""
        return self.arbiters[int(np.searchsorted(self._firsts, index, side="right")) - 1]

    @property
    def noted(self) -> tuple[str, ...]:
        """The columns that explain the decisions of its arbiters."""
        return tuple(name for arbiter in self.arbiters for name in arbiter.noted)

    def layers_of(self, row: int) -> tuple:
        """Return the layers that may drive the robot in this row."""
        place = self._owners()[row]
        return () if place < 0 else tuple(self.arbiters[place].layers)

    def check_robots(self, robots: Iterable[tuple[RobotDesign, str]]) -> None:
        """Refuse robots, given as design and group, that have no arbiter, or one that is not for their drive."""
        for design, group in robots:
            arbiter = self._arbiters[self._key_of(design, group)]
            if arbiter is not None:
                check_drives(arbiter, [design])

    def _key_of(self, design: RobotDesign, group: str) -> Key:
        if group in self._arbiters:
            return group
        for key in self._arbiters:
            if key == design:  # not by hash: custom drives need none
                return key
        of_group = f" in the group {group}" if group else ""
        keys = ", ".join(f"the {'group' if isinstance(key, str) else 'design'} {message_label(key)}" for key in self)
        text = keys if len(keys) <= LONGEST_LIST else f"{keys[:LONGEST_LIST]}..."
        raise InvalidValueError(
            f"robots of the design {design.name}{of_group} have no arbiter; control has one for {text}; "
            "add one for their design or group, or None if they are to stand still"
        )

    def bound(self, swarm: Swarm, streams: Streams, **_: Any) -> "Team":
        """Return a copy whose arbiters and layers have their columns and random streams in this swarm."""
        team = copy(self)
        team._arbiters, team._swarm, team._version = dict(self._arbiters), swarm, (-1, -1)
        for key, place in self._places.items():
            designs = tuple(design for design, group in robots_of(swarm) if self._key_of(design, group) == key)
            first, label = self._firsts[place], self._labels[place]
            team._arbiters[key] = self.arbiters[place].bound(swarm, streams, first=first, label=label, driven=designs)
        team._arrange()
        return team

    def unbind(self) -> None:
        """Let the layers of all arbiters store their state."""
        for arbiter in self.arbiters:
            arbiter.unbind()

    def kernel_for(self, senses: Senses, command: np.ndarray, layer: np.ndarray) -> Kernel:
        """Return what decides on these columns: each arbiter for its own robots."""
        owners, own = self._owners(), (self._commands, self._winners)
        kernels = [kernel_of(arbiter, "decide", senses, *own) for arbiter in self.arbiters]

        def decide(place: int) -> None:
            self.arbiters[place].decide(senses, *own)

        turns = Turns(kernels, decide, self.arbiters, np.empty(0, np.bool_))
        firsts = np.array(self._firsts, np.int64)
        return turns.kernel(run_team, TeamArrays(turns.arrays, owners, firsts, *own, command, layer))

    def _owners(self) -> np.ndarray:
        """Return the place of each robot's arbiter (n,), -1 for none, and prepare for these robots."""
        swarm: Any = self._swarm
        if self._version == (swarm.version, swarm.regrouped):
            return self._owner
        columns, n = swarm.columns, len(swarm)
        kinds = list(robots_of(swarm))
        keys = [self._key_of(design, group) for design, group in kinds]
        places = {kind: self._places.get(key, -1) for kind, key in zip(kinds, keys, strict=True)}
        groups = (*swarm.groups, "")  # the index -1 is of none
        pairs = zip(columns["design"].tolist(), columns["group"].tolist(), strict=True)
        self._owner = np.array([places[swarm.designs[d], groups[g]] for d, g in pairs], np.int64)
        self._commands, self._winners = np.zeros((n, columns["command"].shape[1])), np.full(n, -1)
        for place, arbiter in enumerate(self.arbiters):
            arbiter.others = self._owner != place
            driven = tuple(design for design, group in kinds if places[design, group] == place)
            arbiter.set_driven(driven)
        self._version = swarm.version, swarm.regrouped
        return self._owner


def robots_of(swarm: Swarm) -> Iterator[tuple[RobotDesign, str]]:
    """Yield each design with each group of which there are robots, in the order of their indices."""
    groups = ("", *swarm.groups)  # index -1 comes first
    pairs = np.bincount(swarm.columns["design"] * len(groups) + swarm.columns["group"] + 1)
    for pair in np.flatnonzero(pairs).tolist():
        yield swarm.designs[pair // len(groups)], groups[pair % len(groups)]


def message_label(key: object) -> str:
    """Return how messages and pictures call a design or a group."""
    return key.name if isinstance(key, RobotDesign) else str(key)


def _check_key(key: object) -> None:
    if not isinstance(key, str):
        raise InvalidValueError(f"control has the key {shortened(key)}; expected a design or the name of a group")
    check_name("group of control", key)


class TeamArrays(NamedTuple):
    """What `run_team` takes.

    Parameters
    ----------
    turns : TurnArrays
        Of the arbiters, as of layers.
    owner : int64 ndarray, shape (n,)
        The place of each robot's arbiter, -1 for none.
    firsts : int64 ndarray, shape (k,)
        The first layer of each arbiter.
    own_command, winner : ndarrays, shapes (n, w), (n,)
        What an arbiter decides.
    """

    turns: TurnArrays
    owner: Integers
    firsts: Integers
    own_command: RealRows
    winner: Integers
    command: RealRows
    layer: Integers


@compiled(nogil=True)
def run_team(block, step, first, last):
    """Let each arbiter decide, and take over what it commands its own robots."""
    t = unpack(block, TeamArrays)
    turns = t.turns
    if begin_turns(turns, step):
        t.command[:], t.layer[:] = 0.0, -1
    while turns.progress[PLACE] < turns.calls.shape[0]:
        code = call_layer(turns, step, first, last)
        if code:
            return code
        place = turns.progress[PLACE]
        take_over_commands(t.owner, place, t.firsts[place], t.own_command, t.winner, t.command, t.layer)
        end_turn(turns)
    turns.progress[BEGUN] = -1
    return 0


@compiled
def take_over_commands(owner, place, first, own_command, winner, command, layer):
    """Write what an arbiter decided where it owns the robot; the indices of its layers begin at `first`."""
    for i in range(owner.shape[0]):
        if owner[i] != place or winner[i] < 0:
            continue
        for w in range(command.shape[1]):
            command[i, w] = own_command[i, w]
        layer[i] = first + winner[i]
