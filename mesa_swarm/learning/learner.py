"""One learner: actions, their values in the state of a robot, and a reward by which these are learned.

All learners keep what they learn in columns of the swarm, one row a robot; let new robots begin with what is shared, or
with what a start has learned; return policies, and outlast a change of controls. Each declares its columns, and
has a compiled function that makes a step.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import partial
from importlib.metadata import version
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np

from mesa_swarm.base.errors import (
    InvalidValueError,
    LearningError,
    check_choice,
    check_count,
    check_flag,
    check_name,
    check_number,
    shortened,
)
from mesa_swarm.control.layer import CompiledLayer, Senses, columns_for, kernel_with
from mesa_swarm.kernels.block import Block, stack_blocks, unpack
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.draws import Stream, draw_number, stream_of
from mesa_swarm.kernels.part import Kernel
from mesa_swarm.kernels.type_names import Flags, IntegerRows, Integers, RealRows, Reals, RealTables
from mesa_swarm.learning.actions import ENCODINGS, check_action_count, ranges_of
from mesa_swarm.learning.networks import (
    PARTS,
    NetworkPolicy,
    Networks,
    PolicyOfNetworks,
    WeightArrays,
    draw_weights,
    random_weights,
)
from mesa_swarm.learning.policy import LearnedPolicy, check_designs, sensors_of
from mesa_swarm.learning.rewards import CRITICAL, NEXT_STATE, REWARD_STATES, REWARDS, STATE
from mesa_swarm.robots.swarm import Swarm

P = TypeVar("P", bound=LearnedPolicy)
N = TypeVar("N", bound=PolicyOfNetworks)
Q = TypeVar("Q", bound=NetworkPolicy)
# Of a column: its shape, its type, and with what it begins.
Declared = tuple[tuple[int | str, ...], type, object]
NUMBER: Declared = ((), np.float64, 0.0)
COUNT: Declared = ((), np.int64, 0)
INDEX: Declared = ((), np.int64, -1)  # -1 for none
Check = Callable[[str, Any], object]
SHARE, POSITIVE = partial(check_number, minimum=0, maximum=1), partial(check_number, above=0, maximum=1e6)
# What the parameters of learners may be.
CHECKS: dict[str, Check] = {
    "name": check_name,
    **dict.fromkeys(("shared", "self_adjusting", "frozen"), check_flag),
    **dict.fromkeys(("alpha", "beta", "eta", "last_eta"), SHARE),
    **dict.fromkeys(("gamma", "alert_gamma"), partial(check_number, minimum=0, maximum=0.999)),
    **dict.fromkeys(("first_temperature", "last_temperature"), POSITIVE),
    **dict.fromkeys(("critical", "bump_rate"), partial(check_number, above=0, maximum=1)),
    "bump_window": partial(check_number, minimum=1, maximum=1e9),
    "bump_distance": partial(check_number, minimum=0, maximum=1e6),
    "least_speed": partial(check_number, minimum=-1, maximum=1),
    "hold": partial(check_count, minimum=1),
    "actions": check_action_count,
    "reward": partial(check_choice, choices=REWARDS),
    "reward_of": partial(check_choice, choices=REWARD_STATES),
    "encoding": partial(check_choice, choices=ENCODINGS),
}


class UnboundState:
    """The columns of a layer that was unbound; it can be read in place of the swarm."""

    def __init__(self, swarm: Swarm, prefix: str) -> None:
        self.swarm, self.prefix, self.designs = swarm, prefix, swarm.designs
        self.provenance = provenance(swarm)
        names = [name for name in swarm.columns if name == "number" or name.startswith(f"{prefix}.")]
        self.columns = {name: swarm.columns[name].copy() for name in names}

    def __len__(self) -> int:
        return len(self.columns["number"])

    def restore_to(self, prefix: str) -> None:
        """Write the state of robots that still exist to the columns of this prefix."""
        columns = self.swarm.columns
        _, now, then = np.intersect1d(columns["number"], self.columns["number"], return_indices=True)
        for name, old in self.columns.items():
            if name != "number":
                # Columns may have become wider, with robots of more sensors.
                known: Any = (now, *(slice(0, width) for width in old.shape[1:]))
                columns[prefix + name.removeprefix(self.prefix)][known] = old[then]


# What functions of learners return where Python is due: robots have not begun to learn; values have diverged.
UNBORN, DIVERGED = 1, 2
# Of a row of `SharedColumn`.
SHARED_NUMBERS = 3


class Lesson(NamedTuple):
    """What the functions of all learners take.

    Parameters
    ----------
    born : bool ndarray, shape (n,)
        Which robots have begun.
    shared : int64 ndarray, shape (k, 3)
        Rows of `SharedColumn`: of what all robots learn together.
    chance : ndarray, shape (n,)
        Random numbers of a step, empty for learners that draw none.
    stream : Stream
    diverged : int64 ndarray, shape (1,)
        The row of a robot whose values have diverged, or -1.
    """

    born: Flags
    shared: IntegerRows
    chance: Reals
    stream: Stream
    diverged: Integers


class SharedColumn(NamedTuple):
    """A column (n, k) of what all robots learn together."""

    column: RealRows


@compiled
def begin_lesson(lesson):
    """Draw the random numbers of a step, and return True; False where robots have not begun."""
    for i in range(lesson.born.shape[0]):
        if not lesson.born[i]:
            return False
    for i in range(lesson.chance.shape[0]):
        lesson.chance[i] = draw_number(lesson.stream)
    return True


@compiled
def end_lesson(lesson, diverged):
    """Let all robots have what the first has learned, where they share it; return the code of the function."""
    for k in range(lesson.shared.shape[0]):
        column = unpack(lesson.shared[k], SharedColumn).column
        for i in range(1, column.shape[0]):
            column[i] = column[0]
    lesson.diverged[0] = diverged
    return 0 if diverged < 0 else DIVERGED


class LearningLayer(CompiledLayer, Generic[P]):
    """Base of layers that learn: bound again in the same model, they continue as if never unbound.

    Attributes
    ----------
    policy_class : type
        Of its policies, and of its start.
    learned : tuple of str
        The columns of what it learns, which robots that learn together share.
    of_policies, agreed : tuples of str
        Parameters that its policies have too, and those in which a start has to agree with it.
    stated : tuple of str
        Parameters stored in the `training` of a policy.
    checks : dict
        What its own parameters may be, besides `CHECKS`.
    acts_untrained : bool
        Whether it may be frozen without a trained start.
    draws : bool
        Whether it draws a random number for each robot in every step.
    """

    commands_wheels: ClassVar[bool | None] = None
    draws: ClassVar[bool] = True
    policy_class: ClassVar[Any]
    learned: ClassVar[tuple[str, ...]] = ("values",)
    of_policies: ClassVar[tuple[str, ...]] = ()
    agreed: ClassVar[tuple[str, ...]] = ()
    stated: ClassVar[tuple[str, ...]]
    checks: ClassVar[dict[str, Check]] = {}
    acts_untrained: ClassVar[bool] = False
    name: str
    frozen: bool
    shared = False
    start: P | None = None
    # The swarm, or its columns after unbinding.
    _home: Any = None
    _prefix = ""

    def __post_init__(self) -> None:
        checks = {**CHECKS, **self.checks}
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if field.name in checks and not (value is None and field.default is None):
                checked = checks[field.name](field.name, value)
                if not isinstance(checked, float):
                    setattr(self, field.name, checked)
        self._check_start()

    def _check_start(self) -> None:
        """Check that it can continue from its start, and that a frozen layer has something to act on."""
        start = self.start
        if start is not None:
            if not isinstance(start, self.policy_class):
                expected = f"{self.policy_class.__name__}, as policy() and load_policy() return it"
                raise InvalidValueError(f"start is {shortened(start)}; expected a {expected}")
            has, needs = ({name: getattr(owner, name) for name in self.agreed} for owner in (start, self))
            if has != needs:
                raise InvalidValueError(f"start has {_listed(has)}; expected {_listed(needs)}")
        if self.frozen and not self.acts_untrained and not (start is not None and start.steps):
            raise LearningError(
                f"{self.name} is frozen and untrained; give it a trained policy as start, or let it learn"
            )

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Make the columns of the swarm; in the same model, continue with what was learned before."""
        home = self._home
        before = home if isinstance(home, UnboundState) and home.swarm is swarm else None
        if home is not None and before is None:
            self._start_elsewhere()
        self._home, self._prefix, self._rng = swarm, prefix, rng
        self._check_sensors()
        for name, declared in {**self._columns(), "lessons": COUNT, "born": ((), np.bool_, False)}.items():
            swarm.remember(f"{prefix}.{name}", *declared)
        if before is not None:
            before.restore_to(prefix)

    def unbind(self) -> None:
        """Copy the columns, which are about to be dropped."""
        self._home = UnboundState(self._robots, self._prefix)

    def kernel_for(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> Kernel | None:
        """Return what learns from the last step, chooses where it is due, and drives robots that no other layer drives.

        Robots that have come begin in Python. Values that diverge are an error that names the robot; what was learned
        before is unchanged.
        """
        function, rule = self.arguments(columns_for(senses, command, layer, index), senses)

        def attend(code: int) -> None:
            if code == UNBORN:
                self.begin()
            else:
                self._refuse_diverged(int(rule.lesson.diverged[0]))  # type: ignore[attr-defined]

        return kernel_with(function, rule)._replace(attend=attend)

    def _lesson(self) -> "Lesson":
        """Return what the functions of all learners take."""
        born = self._column("born")
        shared = map(self._column, self.learned) if self.shared and not self.frozen and len(born) else ()
        blocks = tuple(Block(SharedColumn(column.reshape(len(column), -1))) for column in shared)
        rows = stack_blocks(blocks, SHARED_NUMBERS)
        chance = np.empty(len(born) if self.draws else 0)
        return Lesson(born, rows, chance, stream_of(self._rng), np.array([-1]))

    def _refuse_diverged(self, row: int) -> None:
        """Raise an error for the robot in this row, whose values have diverged."""
        robot = self._robots.agents[row]
        rates = " or ".join(name for name in ("eta", "alpha", "gamma") if hasattr(self, name))
        raise LearningError(
            f"{self.name} diverged for robot {robot.unique_id} in step {robot.model.steps}: its values grow "
            f"beyond all bounds; lower {rates}"
        )

    def policy(self, **training: str | float) -> P:
        """Return what all robots have learned so far as a policy that no longer learns.

        Parameters
        ----------
        **training
            Figures to store with it, such as ``collisions=0.4``.

        Raises
        ------
        LearningError
            If there are no robots, or their sensors differ.
        """
        sensors = sensors_of(self._robots)
        self.begin()
        return self.policy_class(sensors=sensors, **self._fields_of_policy(), **self._training(training))

    def _columns(self) -> dict[str, Declared]:
        """Return the columns in which robots remember; those that count lessons and robots are added."""
        raise NotImplementedError

    def _fields_of_policy(self) -> dict[str, Any]:
        """Return the fields of a policy that are not those of all policies."""
        raise NotImplementedError

    def _sets_of_start(self) -> dict[str, np.ndarray]:
        """Return what the robots of the start have learned, by column."""
        return {name: getattr(self.start, name) for name in self.learned}

    def _begin(self, new: np.ndarray) -> None:
        """Let robots in these rows begin with nothing learned: in columns as they are made."""

    def _check_sensors(self) -> None:
        """Check that all robots have the sensors that the start was trained with."""
        if self.start is not None:
            check_designs(self.start.sensors, self._robots)

    def begin(self) -> None:
        """Let new robots begin with what is shared, or with what the start has learned: before their first lesson."""
        born = self._column("born")
        if not born.all():
            self._check_sensors()
            self._init_robots(np.flatnonzero(~born), np.flatnonzero(born))
            born[:] = True

    def beginning(self) -> Kernel | None:
        """Return the kernel that does what `begin` does besides noting it, as far as compiled code can: for pages."""
        return None

    def _init_robots(self, new: np.ndarray, others: np.ndarray) -> None:
        """Initialise what robots in the rows `new` have learned; those in `others` have begun before."""
        if self.shared and len(others):
            for column in map(self._column, self.learned):
                column[new] = column[others[0]]
        elif self.start is not None:
            number = np.zeros_like(new) if self.shared else self._robots.columns["number"][new]
            for name, sets in self._sets_of_start().items():
                self._column(name)[new] = sets[number % len(sets)]
        else:
            self._begin(new)

    def _training(self, training: dict) -> dict:
        """Return the steps and training of a policy: parameters, world, what it started from, and what is given."""
        lessons = int(self._column("lessons").sum())
        described = {
            "learner": type(self).__name__,
            "mesa_swarm": version("mesa-swarm"),
            **provenance(self._robots),
            **{name: getattr(self, name) for name in (*self.stated, *self._set_apart())},
            "robots": len(self._robots),
            "lessons": lessons,
            **({"started_from": self.start.training} if self.start else {}),
            **training,
        }
        return {"steps": lessons + (self.start.steps if self.start else 0), "training": described}

    def _set_apart(self) -> list[str]:
        """Return the names of parameters that a policy states only where they differ from their defaults."""
        return []

    def _start_elsewhere(self) -> None:
        """Let the robots of another model start with what was learned."""
        if self._column("lessons").any():
            self.start = self.policy()

    @property
    def _robots(self) -> Any:
        """The swarm that it belongs to, or its columns after unbinding."""
        if self._home is None:
            raise LearningError(
                f"this {self.name} is in no model, which would learn with a copy of it; ask the copy, such as "
                "model.control.layers[0]"
            )
        return self._home

    def _column(self, name: str) -> np.ndarray:
        return self._robots.columns[f"{self._prefix}.{name}"]


def _listed(values: dict[str, object]) -> str:
    return ", ".join(f"{name} {shortened(value)}" for name, value in values.items())


class RewardedLayer(LearningLayer[P]):
    """Base of layers whose robots are rewarded in every step."""

    @property
    def last_reward(self) -> np.ndarray:
        """Every robot's reward for its last action (n,); a copy."""
        return self._column("reward").copy()


class ChoosingLayer(LearningLayer[P]):
    """Base of layers that learn values of actions and choose by them, at a temperature."""

    first_temperature: float | None

    @property
    def temperature(self) -> np.ndarray:
        """Of every robot's choice (n,); a copy."""
        return self._column("temperature").copy()

    @property
    def _begun_at(self) -> float | None:
        """The initial temperature of robots."""
        return self.first_temperature if self.start is None else self.start.temperature  # type: ignore[attr-defined]

    def _fields_of_policy(self) -> dict[str, Any]:
        own = {name: getattr(self, name) for name in self.of_policies}
        return {"temperature": float(self._column("temperature").mean()), **own}


class TableLayer(ChoosingLayer[P]):
    """Base of layers that learn a table of the values of actions in states: nothing, or those of a start, at first."""

    acts_untrained = True

    @property
    def values(self) -> np.ndarray:
        """Every robot's values of the actions in each state (n, states, actions); a copy."""
        return self._column("values").copy()

    def _fields_of_policy(self) -> dict[str, Any]:
        return {"values": self.values[: 1 if self.shared else None].copy(), **super()._fields_of_policy()}


def provenance(robots: Swarm | UnboundState) -> dict[str, str | int]:
    """Return the robots' design, map, and the number of steps of their model."""
    if isinstance(robots, UnboundState):
        return robots.provenance
    if not len(robots):
        return {}
    model = robots.agents[0].model
    return {"design": robots.designs[0].name, "map": str(model.map.name), "model_steps": int(model.steps)}


class NetworkColumns:
    """A mark in recordings of a learner with networks: its state is in columns of the swarm."""

    def checkpoint(self) -> dict:
        """Return nothing: columns are stored anyway."""
        return {}

    def restore(self, state: dict) -> None:
        """Do nothing: the columns are restored by the swarm."""


class NetworkLayer(ChoosingLayer[N]):
    """Base of layers that learn values by networks, `_count` of them for each robot, with one layer of hidden units.

    Attributes
    ----------
    units : tuple
        Sides of the columns of hidden units: twice the proximity sensors of the widest design present. The columns
        grow with it: new weights of robots that have learned are 0, so that their outputs do not change.
    """

    learned: ClassVar[tuple[str, ...]] = PARTS
    units: ClassVar[tuple[int | str, ...]] = (2, "proximity")

    @property
    def _count(self) -> int:
        """The number of networks of a robot."""
        raise NotImplementedError

    @property
    def _inputs(self) -> tuple[int | str, ...]:
        """The sides of the columns of inputs."""
        raise NotImplementedError

    def _columns(self) -> dict[str, Declared]:
        count, inputs = self._count, self._inputs
        shapes = ((count, *inputs, *self.units), (count, *self.units), (count, *self.units), (count,))
        return {
            **{part: (shape, np.float64, 0.0) for part, shape in zip(PARTS, shapes, strict=True)},
            "inputs": (inputs, np.float64, 1.0),
            "temperature": ((), np.float64, self._begun_at),
        }

    @property
    def _weights(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Views of all networks, robot after robot, for `networks.forward`."""
        inner, inner_bias, outer, outer_bias = map(self._column, PARTS)
        networks = outer_bias.size
        units = math.prod(outer.shape[2:])
        inputs = math.prod(self._column("inputs").shape[1:])
        return (
            inner.reshape(networks, inputs, units),
            inner_bias.reshape(networks, units),
            outer.reshape(networks, units),
            outer_bias.reshape(networks),
        )

    def _last_inputs(self) -> np.ndarray:
        """Return a view of every robot's last inputs (n, k)."""
        inputs = self._column("inputs")
        return inputs.reshape(len(inputs), math.prod(inputs.shape[1:]))

    def _sets_of_start(self) -> dict[str, np.ndarray]:
        weights: Any = self.start.networks.weights if self.start else ()
        return {
            part: sets.reshape(-1, *self._column(part).shape[1:]) for part, sets in zip(PARTS, weights, strict=True)
        }

    def _begin(self, new: np.ndarray) -> None:
        """Draw small random weights, the same for robots that share them."""
        robots, (_, inputs, units) = 1 if self.shared else len(new), self._weights[0].shape
        drawn = random_weights(robots * self._count, inputs, units, self._rng)
        for column, weights in zip(map(self._column, PARTS), drawn, strict=True):
            column[new] = weights.reshape(robots, *column.shape[1:])

    def beginning(self) -> Kernel | None:
        """Return the kernel that draws the weights of robots that each have their own, if none has any yet."""
        if self.shared or self.start is not None or self._column("born").any():
            return None
        block = Block(WeightArrays.of(self._weights, self._rng))
        return Kernel(draw_weights, block.numbers, block)

    def _fields_of_policy(self) -> dict[str, Any]:
        networks = self._count * (1 if self.shared else len(self._robots))
        own = Networks(*(weights[:networks].copy() for weights in self._weights))
        return {"networks": own, **super()._fields_of_policy()}


# Rewards are within [-1, 1], so that values are at most 1 / (1 - gamma), at most 1,000: a correction or a
# weight a million times as large has diverged.
LARGEST = 1e9
# T_0 of the thesis (8.3).
HOT = 1.0


@dataclass(kw_only=True)
class Learner(NetworkLayer[Q], RewardedLayer[Q]):
    """Base of `QLearning`, where the parameters are described, and `WireFittedQ`: they learn in every step."""

    stated = ("reward", "alpha", "eta", "gamma", "beta", "critical", "reward_of", "shared", "self_adjusting")
    last_action: ClassVar[Declared]  # the column of each robot's last action
    reward: str = "b"
    encoding: str = "distance"
    alpha: float = 0.4
    eta: float = 0.1
    last_eta: float | None = None
    gamma: float = 0.7
    beta: float = 1e-4
    first_temperature: float | None = None
    last_temperature: float = 0.2
    critical: float = CRITICAL
    reward_of: str = STATE
    shared: bool = False
    self_adjusting: bool = False
    bump_rate: float = 0.02
    bump_window: int = 1000
    bump_distance: float = 0.5
    alert_gamma: float | None = None
    least_speed: float | None = None
    frozen: bool = False
    start: Q | None = None
    name: str = "Learner"

    @property
    def _hottest(self) -> float:
        """T_0."""
        return HOT if self.first_temperature is None else self.first_temperature

    @property
    def _least_eta(self) -> float:
        """The rate of back-propagation at the last temperature."""
        return self.eta if self.last_eta is None else self.last_eta

    @property
    def _alert(self) -> float:
        """The gamma of a self-adjusting robot that bumps often."""
        return self.gamma if self.alert_gamma is None else self.alert_gamma

    @property
    def _regulates(self) -> bool:
        """Whether robots adapt T to their speed."""
        return self.self_adjusting and self.least_speed is not None

    @property
    def _begun_at(self) -> float:
        """The initial temperature of robots."""
        return self._hottest if self.start is None or self.first_temperature is not None else self.start.temperature

    @property
    def _count(self) -> int:
        """The number of networks of a robot."""
        return self.policy_class.networks_per_choice * getattr(self, self.policy_class.choices_field)

    @property
    def _inputs(self) -> tuple[int | str, ...]:
        return ENCODINGS[self.encoding], "proximity"

    def _start_elsewhere(self) -> None:
        """Let the robots of another model start with what was learned, at its temperature."""
        super()._start_elsewhere()
        if self.start is not None and self._column("lessons").any() and not self.self_adjusting:
            self.first_temperature = self.start.temperature

    def _columns(self) -> dict[str, Declared]:
        """Return the columns: networks of a robot, its last inputs and reward, its temperature and recent bumps."""
        self._memory = NetworkColumns()
        return {
            **super()._columns(),
            "reward": NUMBER,
            "bumps": ((), np.float64, self.bump_rate),
            **({"pace": ((), np.float64, self.least_speed)} if self._regulates else {}),
            "action": self.last_action,
        }

    @property
    def discount(self) -> np.ndarray:
        """Every robot's gamma (n,)."""
        share = np.minimum(1.0, self._column("bumps") / self.bump_rate) if self.self_adjusting else 0.0
        return np.full(len(self._robots), self.gamma) + (self._alert - self.gamma) * share

    def _network_lesson(self, senses: Senses) -> "NetworkLesson":
        """Return what the functions of learners with networks take."""
        lessons, reward, temperature, bumps = map(self._column, ("lessons", "reward", "temperature", "bumps"))
        return NetworkLesson(
            ranges_of(senses.sensors),
            self._weights,
            self._last_inputs(),
            lessons,
            reward,
            temperature,
            bumps,
            self._pace(),
            REWARDS.index(self.reward),
            (float(self.gamma), float(self._alert), float(self.critical)),
            (float(self.alpha) * float(self.eta), float(self.alpha) * float(self._least_eta)),
            (float(self.beta), float(self._hottest), float(self.last_temperature)),
            (float(self.bump_rate), 1.0 / self.bump_window, float(self.bump_distance), float(self.least_speed or 0.0)),
            (bool(self.shared), bool(self.self_adjusting), bool(self.frozen), self.reward_of == NEXT_STATE),
        )

    def _set_apart(self) -> list[str]:
        return [] if self.last_eta is None else ["last_eta"]

    def _pace(self) -> np.ndarray:
        """Return every robot's recent speed, which only self-adjusting robots with a least speed remember."""
        return self._robots.columns.get(f"{self._prefix}.pace", np.empty(0)) if self._regulates else np.empty(0)

    def _last_outputs(self, row: int) -> np.ndarray:
        """Return the outputs of a robot's networks for its last inputs (networks,)."""
        rows = slice(row * self._count, (row + 1) * self._count)
        inner, bias, outer, outer_bias = (weights[rows] for weights in self._weights)
        hidden = np.tanh(bias + np.einsum("i,mih->mh", self._last_inputs()[row], inner))
        return outer_bias + (hidden * outer).sum(axis=1)


class NetworkLesson(NamedTuple):
    """What the functions of `Learner` take.

    Parameters
    ----------
    ranges : ndarray, shape (d, s)
        Of proximity sensors.
    weights : tuple of ndarrays
        Of all networks, robot after robot, see `networks.forward`.
    inputs : ndarray, shape (n, k)
        The last of each robot.
    lessons, rewards, temperature, bumps, pace : ndarrays, shape (n,)
        Columns of robots; `pace` is empty where they do not remember it.
    reward : int
        A place in `REWARDS`.
    discounts : tuple of float
        Gamma, gamma of a robot that bumps often, and the critical reading.
    rates : tuple of float
        Weights of a correction at T_0 and T_c.
    cooling : tuple of float
        Beta, T_0 and T_c.
    bumping : tuple of float
        The usual rate of bumps, the share of a step in it, the largest reading of a bump, the least speed.
    options : tuple of bool
        Whether robots learn together, adjust themselves, only act, and are rewarded of the next state.
    """

    ranges: RealRows
    weights: tuple[RealTables, RealRows, RealRows, Reals]
    inputs: RealRows
    lessons: Integers
    rewards: Reals
    temperature: Reals
    bumps: Reals
    pace: Reals
    reward: int
    discounts: tuple[float, float, float]
    rates: tuple[float, float]
    cooling: tuple[float, float, float]
    bumping: tuple[float, float, float, float]
    options: tuple[bool, bool, bool, bool]


@compiled
def is_bounded(outer, m, step):
    """Return whether network m is within bounds and not NaN, and so is its step of back-propagation."""
    bounded = abs(step) <= LARGEST
    for h in range(outer.shape[1]):
        bounded = bounded and abs(outer[m, h]) <= LARGEST
    return bounded


@compiled
def rate_of(rates, temperature, cooling):
    """Return the weight of a correction at a temperature: linear in it, from that at T_0 to that at T_c."""
    first_rate, last_rate = rates
    _, first, last = cooling
    share = (temperature - last) / (first - last) if first != last else 0.0
    return last_rate + (first_rate - last_rate) * min(max(share, 0.0), 1.0)


@compiled
def discount_of(gamma, alert, bumps, usual, self_adjusting):
    """Return the gamma of a robot; a self-adjusting one looks the farther ahead, the more often it has bumped."""
    return gamma + (alert - gamma) * min(1.0, bumps / usual) if self_adjusting else gamma


@compiled
def adapt(distance, i, ahead, temperature, bumps, pace, cooling, bumping, self_adjusting):
    """Set the temperature of robot i, which drove ahead by this share of its speed, for its next choice."""
    before = temperature[i]
    set_temperature(distance, i, temperature, bumps, cooling, bumping, self_adjusting)
    if pace.shape[0]:
        regulate(pace, i, ahead, before, temperature, cooling, bumping)


@compiled
def set_temperature(distance, i, temperature, bumps, cooling, bumping, self_adjusting):
    """Bring the rate of bumps of robot i up to date, and set its temperature by that rate, or by time."""
    beta, first, last = cooling
    usual_rate, forgetting, bump_distance, _ = bumping
    bumped = 0.0
    for s in range(distance.shape[1]):
        if 0.0 <= distance[i, s] <= bump_distance:
            bumped = 1.0
    bumps[i] += forgetting * (bumped - bumps[i])
    if self_adjusting:
        temperature[i] = last + (first - last) * min(1.0, bumps[i] / usual_rate)
    else:
        temperature[i] -= beta * (temperature[i] - last)


@compiled
def regulate(pace, i, ahead, before, temperature, cooling, bumping):
    """Raise the temperature of robot i by a share if it has recently driven fast enough, else lower it."""
    _, first, last = cooling
    _, forgetting, _, least = bumping
    pace[i] += forgetting * (ahead - pace[i])
    change = 1.0 + forgetting if pace[i] >= least else 1.0 - forgetting
    temperature[i] = max(min(before * change, max(first, last)), min(first, last))
