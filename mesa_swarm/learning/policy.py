"""Trained controllers, their inputs, and the layer that drives robots by them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from inspect import signature
from typing import Any, ClassVar, Protocol, Self, cast

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import (
    BehaviourError,
    InvalidValueError,
    LearningError,
    check_count,
    check_flag,
    check_name,
    read_attribute,
    shortened,
)
from mesa_swarm.control.layer import Senses
from mesa_swarm.geometry.masked_arrays import fill_masked
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.learning.actions import as_floats, choose_all, describe_value
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.swarm import Swarm


def checked_chances(chance: ArrayLike, robots: int) -> np.ndarray:
    """Return the numbers from which a policy draws as an array (n,)."""
    chances = as_floats(chance)
    if chances.shape != (robots,):
        raise InvalidValueError(f"chance is {shortened(chance)}; expected {robots} numbers from 0 to 1")
    wrong = first_invalid(chances)
    if wrong >= 0:
        raise InvalidValueError(f"chance holds {chances[wrong]:g}; expected numbers from 0 to 1")
    return chances


def checked_numbers(numbers: ArrayLike | None, robots: int) -> np.ndarray:
    """Return the numbers of robots as an array (n,); an empty one stands for 0, 1, 2, ..."""
    if numbers is None:
        return np.empty(0, np.int64)
    try:
        array = fill_masked(numbers)
    except ValueError:
        array = np.empty(0)
    if array.shape != (robots,) or array.dtype.kind not in "iu":
        raise InvalidValueError(f"numbers is {shortened(numbers)}; expected {robots} whole numbers, one a robot")
    return array.astype(np.int64, copy=False)


@compiled
def first_invalid(chances):
    """Return the index of the first number outside 0 to 1, or -1."""
    for i in range(chances.shape[0]):
        if not 0.0 <= chances[i] <= 1.0:
            return i
    return -1


# Comparing two dtypes takes a tenth of the time of comparing a dtype with a type.
DOUBLE = np.dtype(np.float64)


@dataclass(frozen=True, slots=True)
class SensorLayout:
    """The proximity sensors that a policy was trained with, in the order of its readings.

    Parameters
    ----------
    bearings, ranges, fields_of_view : tuples of float, one a sensor
        Degrees, map units, degrees.

    Examples
    --------
    >>> from mesa_swarm import AGENT3
    >>> SensorLayout.of(AGENT3).bearings
    (0.0, 40.0, -40.0)
    """

    bearings: tuple[float, ...]
    ranges: tuple[float, ...]
    fields_of_view: tuple[float, ...]

    @classmethod
    def of(cls, design: RobotDesign) -> "SensorLayout":
        """Return the layout of a design."""
        if not isinstance(design, RobotDesign):
            raise InvalidValueError(f"design is {shortened(design)}; expected a RobotDesign such as AGENT9")
        eyes = design.proximity
        return cls(
            tuple(float(s.bearing_degrees) for s in eyes),
            tuple(float(s.range) for s in eyes),
            tuple(float(s.field_of_view_degrees) for s in eyes),
        )

    def __len__(self) -> int:
        return len(self.bearings)

    @property
    def rows(self) -> list[tuple[float, float, float]]:
        """Bearing, range and field of view of each sensor."""
        return list(zip(self.bearings, self.ranges, self.fields_of_view, strict=True))

    def check(self, design: RobotDesign) -> None:
        """Check that a design has these proximity sensors."""
        other = SensorLayout.of(design)
        if other == self:
            return
        if len(other) != len(self):
            what = f"{len(self)} proximity sensors and {design.name} has {len(other)}"
        else:
            first = next(i for i, rows in enumerate(zip(self.rows, other.rows, strict=True)) if rows[0] != rows[1])
            what = f"{_eye(self.rows[first])} as sensor {first} and {design.name} has {_eye(other.rows[first])}"
        raise LearningError(f"the policy was trained with {what}; use the design that it was trained with")

    def check_readings(
        self, readings: ArrayLike, kinds: ArrayLike | None, encoding: str = "distance"
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return readings and kinds (n, s) as arrays; without kinds, every reading is of an obstacle."""
        if kinds is None and encoding != "distance":
            raise InvalidValueError(f"kinds is None; expected the kind at each sensor, as the encoding is {encoding!r}")
        try:
            distance = np.ascontiguousarray(fill_masked(readings), np.float64)
            # 0 is an obstacle, -1 nothing.
            given = np.where(distance < 0.0, -1, 0) if kinds is None else _whole(fill_masked(kinds))
            kind = np.ascontiguousarray(given, np.int8)
        except (TypeError, ValueError, OverflowError):
            distance, kind = np.empty(0), np.empty(0, np.int8)
        if distance.ndim != 2 or distance.shape[1] != len(self) or distance.shape != kind.shape:
            raise InvalidValueError(
                f"readings are {shortened(np.shape(readings))} and kinds {shortened(np.shape(cast(Any, kinds)))}; "
                f"expected numbers, n rows of {len(self)} of both"
            )
        if not all_finite(distance):
            raise InvalidValueError("readings hold NaN or infinity; expected finite distances, -1 for nothing in range")
        return distance, kind


def _whole(kinds: np.ndarray) -> np.ndarray:
    """Return kinds, none of which is NaN or masked."""
    if kinds.dtype.kind == "f" and not np.isfinite(kinds).all():
        raise ValueError
    return kinds


def _eye(row: tuple[float, float, float]) -> str:
    return "one at {:g} degrees, range {:g}, field of view {:g} degrees".format(*row)


def sensors_of(swarm: Swarm) -> SensorLayout:
    """Return the sensors that all robots of a swarm have."""
    if not len(swarm):
        raise LearningError("there are no robots, and nothing was learned; add robots first")
    layout = SensorLayout.of(swarm.designs[0])
    check_designs(layout, swarm)
    return layout


def check_designs(sensors: SensorLayout, swarm: Swarm, driven: tuple[RobotDesign, ...] | None = None) -> None:
    """Check that all robots of a swarm, or of the designs driven, have these sensors."""
    for design in swarm.designs if driven is None else driven:
        sensors.check(design)


def check_layout(sensors: object) -> None:
    """Check that these are the sensors of a policy."""
    if not isinstance(sensors, SensorLayout):
        raise InvalidValueError(f"sensors is {shortened(sensors)}; expected SensorLayout.of(design)")


def check_stored(family: str, stored: Sequence[str], expected: Sequence[str]) -> None:
    """Check that a file of this family holds these arrays and settings, each of them once, and no others."""
    if sorted(stored) == sorted(expected):
        return
    missing = [name for name in expected if name not in stored]
    unknown = [name for name in stored if name not in expected]
    problem = f"no {missing[0]}" if missing else f"unknown {shortened(unknown[0])}" if unknown else "a part twice"
    raise InvalidValueError(f"a {family} policy has {problem}; expected {', '.join(expected)}")


def check_policy(policy: object, *methods: str) -> None:
    """Check that a policy has these methods."""
    if isinstance(policy, type) or not all(callable(read_attribute(policy, method)) for method in methods):
        raise InvalidValueError(f"policy is {shortened(policy)}; expected a policy such as from load_policy()")


class Policy(Protocol):
    """A controller that was trained, or can be: readings in, wheel commands out.

    Learners of all families return policies, files store them, and `PolicyLayer` drives robots by them. A policy does
    not change when it acts. A recurrent policy has an attribute ``memory``, the number of values that each robot
    remembers from step to step, and its `act` one more argument: these values (n, memory), 0 at first, which it
    writes; see `ReflexPolicy`. A policy with several sets of weights has their number in ``copies``, and its `act`
    has a keyword ``numbers`` (n,): the k-th robot ever made acts by set ``k % copies``, also when robots before it
    are gone; see `QPolicy`.
    """

    family: ClassVar[str]  # its name in files, see `learning.policy_files`

    @property
    def sensors(self) -> SensorLayout:
        """The sensors that it was trained with."""

    @property
    def steps(self) -> int:
        """Robot-steps of training; 0 is untrained."""

    @property
    def training(self) -> dict:
        """Provenance, and figures of its training: texts and numbers by name."""

    def act(self, readings: ArrayLike, kinds: ArrayLike | None = None, chance: ArrayLike | None = None) -> np.ndarray:
        """Return wheel commands as shares of max_speed.

        Parameters
        ----------
        readings : ndarray, shape (n, s), map units
            Of the proximity sensors, -1 for nothing in range.
        kinds : int ndarray, shape (n, s), optional
            0 obstacle, 1 robot, 2 fire, 3 load, -1 nothing. Not needed by policies of distances only.
        chance : ndarray, shape (n,), optional
            Numbers from 0 to 1 for a policy with random choices; without them it takes the best action.

        Returns
        -------
        ndarray, shape (n, 2)
            Left and right wheel, in [-1, 1].

        Raises
        ------
        InvalidValueError
            If the readings do not fit its sensors, or a chance is not from 0 to 1.
        """

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights by name: finite float64 arrays."""

    def settings(self) -> dict:
        """Return the other fields that acting depends on: texts and finite numbers by name."""

    @classmethod
    def restored(
        cls, sensors: SensorLayout, steps: int, training: dict, settings: dict, arrays: dict[str, np.ndarray]
    ) -> "Policy":
        """Return the policy with these parts, or raise a SwarmError if they do not fit together."""


class LearnedPolicy:
    """Base of the policies that learners return: what files store of them, and the sets of weights of their robots.

    Attributes
    ----------
    stored : tuple of str
        The arrays in files.
    of_copies : tuple of str
        Of these fields every robot has an item of its own.
    checks : dict
        The other fields that acting depends on, each with what checks its value, given its name too.
    """

    __slots__ = ()
    family: ClassVar[str]
    stored: ClassVar[tuple[str, ...]] = ("values",)
    of_copies: ClassVar[tuple[str, ...]] = ("values",)
    checks: ClassVar[dict[str, Callable[[str, Any], object]]]
    sensors: SensorLayout
    steps: int
    training: dict

    def _check_settings(self) -> None:
        """Check the fields that are not arrays."""
        check_layout(self.sensors)
        check_count("steps", self.steps, maximum=2**62)
        for name, check in self.checks.items():
            checked = check(name, getattr(self, name))
            if not isinstance(checked, float):
                object.__setattr__(self, name, checked)

    @property
    def copies(self) -> int:
        """The number of robots' sets of weights: the k-th robot acts by set ``k % copies``."""
        return len(getattr(self, self.of_copies[0]))

    def of_robot(self, index: int) -> Self:
        """Return the policy of one robot, 0 to ``copies - 1``, to share it with others."""
        k = check_count("index", index, maximum=self.copies - 1)
        return cast(Self, replace(cast(Any, self), **self._set_of(k)))

    def _set_of(self, k: int) -> dict[str, Any]:
        """Return the fields of the k-th set of weights."""
        return {name: getattr(self, name)[k : k + 1].copy() for name in self.of_copies}

    def arrays(self) -> dict[str, np.ndarray]:
        """Return the weights by name: finite float64 arrays."""
        return {name: np.asarray(getattr(self, name), np.float64) for name in self.stored}

    def settings(self) -> dict:
        """Return the other fields that acting depends on."""
        return {name: getattr(self, name) for name in self.checks}

    @classmethod
    def restored(
        cls, sensors: SensorLayout, steps: int, training: dict, settings: dict, arrays: dict[str, np.ndarray]
    ) -> Self:
        """Return the policy with these parts, from a file."""
        check_stored(cls.family, (*arrays, *settings), (*cls.stored, *cls.checks))
        fields: dict[str, Any] = {**settings, **cls._of_arrays(arrays)}
        return cls(sensors=sensors, steps=steps, training=training, **fields)  # type: ignore[call-arg]

    @classmethod
    def _of_arrays(cls, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
        """Return the fields that these arrays are stored of."""
        return arrays


class ChoosingPolicy(LearnedPolicy):
    """Base of policies that choose one of several actions by Boltzmann's probabilities of their values."""

    __slots__ = ()
    temperature: float

    def act(
        self,
        readings: ArrayLike,
        kinds: ArrayLike | None = None,
        chance: ArrayLike | None = None,
        *,
        numbers: ArrayLike | None = None,
    ) -> np.ndarray:
        """Return wheel commands (n, 2) as shares of max_speed; see `Policy.act`.

        The robot with number k, of ``numbers`` (n,), acts by set ``k % copies``; by default they are 0, 1, and so on.
        """
        values, actions = self._choices(readings, kinds, numbers)
        chances = np.empty(0) if chance is None else checked_chances(chance, len(values))
        taken = np.empty(len(values), np.int64)
        choose_all(values, float(self.temperature), chances, taken)
        return actions[taken] if actions.ndim == 2 else actions[np.arange(len(values)), taken]

    def _choices(
        self, readings: ArrayLike, kinds: ArrayLike | None, numbers: ArrayLike | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the values of every robot's actions (n, a), and these actions: (a, 2) of all, or (n, a, 2)."""
        raise NotImplementedError


@dataclass(kw_only=True)
class PolicyLayer:
    """Drive by a policy that no longer learns; always active.

    Parameters
    ----------
    policy : Policy
    greedy : bool
        Whether robots always take the policy's best action, instead of random choices.
    explore : bool
        Whether an untrained policy may drive.

    Raises
    ------
    InvalidValueError
        If `policy` is not one.
    LearningError
        If it is untrained and `explore` is False; if robots have other sensors than it was trained with.

    Examples
    --------
    >>> from mesa_swarm import AGENT9
    >>> from mesa_swarm.learning.q_learning import QPolicy
    >>> PolicyLayer(policy=QPolicy.untrained(AGENT9, rng=np.random.default_rng(1)))
    Traceback (most recent call last):
        ...
    mesa_swarm.base.errors.LearningError: the policy is untrained; train it first, or let it explore with explore=True
    """

    policy: Policy
    greedy: bool = False
    explore: bool = False
    name: str = "Policy"
    # The designs of its robots in a `Team`, None for all of the swarm.
    driven: ClassVar[tuple[RobotDesign, ...] | None] = None

    def __post_init__(self) -> None:
        check_name("name", self.name)
        own = read_attribute(self.policy, "own_layer")
        if isinstance(own, str):
            raise InvalidValueError(
                f"policy is a {type(self.policy).__name__}, which acts by more than readings; expected a policy with "
                f"act(): drive robots by {own}(start=policy, frozen=True)"
            )
        check_policy(self.policy, "act")
        for flag in ("greedy", "explore"):
            check_flag(flag, getattr(self, flag))
        if not self.policy.steps and not self.explore:
            raise LearningError("the policy is untrained; train it first, or let it explore with explore=True")

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Make the column of a recurrent policy; check the robots' sensors."""
        self._swarm, self._rng, self._known = swarm, rng, 0
        numbers: int = getattr(self.policy, "memory", 0)
        self._kept = f"{prefix}.memory" if numbers else None
        if self._kept:
            swarm.remember(self._kept, (numbers,), np.float64, 0.0)
        # A user's policy need not take numbers.
        self._numbered = getattr(self.policy, "copies", 1) != 1 and "numbers" in signature(self.policy.act).parameters
        self._check_designs()

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Drive the robots that no earlier layer drives."""
        if len(self._designs) != self._known:
            self._check_designs()
        chance = None if self.greedy else self._rng.random(len(layer))
        memory = (self._swarm.columns[self._kept],) if self._kept else ()
        numbers = {"numbers": self._swarm.columns["number"]} if self._numbered else {}
        distance, kind, own = senses.distance, senses.kind, len(self.policy.sensors)
        if self.driven is not None and distance.shape[1] > own:  # others of the team have more sensors
            distance, kind = distance[:, :own].copy(), kind[:, :own].copy()
        returned = self.policy.act(distance, kind, chance, *memory, **numbers)
        shares = returned
        # Compiled code reads one row a robot, and is compiled anew for other kinds of arrays.
        if type(returned) is not np.ndarray or returned.shape != (len(layer), 2) or returned.dtype != DOUBLE:
            shares = _shares_of(returned)
        if shares.shape != (len(layer), 2) or not scale_commands(shares, senses.max_speed, command, layer, index):
            raise BehaviourError(
                f"{self.name}: its policy returned {describe_value(returned)}; "
                f"expected finite numbers of shape {(len(layer), 2)}"
            )

    def reason(self, moment: Moment) -> Reason:
        """Return the readings that the policy acted on."""
        near = tuple(s for s in np.flatnonzero(moment.kind >= 0).tolist() if math.isfinite(moment.distance[s]))
        return Reason("its policy acts on " + (", ".join(map(moment.reading, near)) or "nothing in sight"), near)

    @property
    def _designs(self) -> tuple[RobotDesign, ...]:
        return self._swarm.designs if self.driven is None else self.driven

    def _check_designs(self) -> None:
        check_designs(self.policy.sensors, self._swarm, self.driven)
        self._known = len(self._designs)


def _shares_of(returned: object) -> np.ndarray:
    """Return a policy's result as an array of floats, an empty one if it does not hold numbers."""
    try:
        array = fill_masked(returned)
    except ValueError:  # rows of different lengths
        array = np.empty(0)
    return array.astype(np.float64, order="C") if array.dtype.kind in "biuf" else np.empty(0)


@compiled
def all_finite(table):
    """Return whether a table (n, s) is finite; ten times as fast as NumPy for few robots."""
    for i in range(table.shape[0]):
        for s in range(table.shape[1]):
            if not math.isfinite(table[i, s]):
                return False
    return True


@compiled
def scale_commands(shares, max_speed, command, layer, index):
    """Write the commands of undriven robots, if all `shares` (n, 2) of max_speed are finite."""
    for i in range(layer.shape[0]):
        if not (math.isfinite(shares[i, 0]) and math.isfinite(shares[i, 1])):
            return False
    for i in range(layer.shape[0]):
        if layer[i] < 0:
            command[i, 0] = shares[i, 0] * max_speed[i]
            command[i, 1] = shares[i, 1] * max_speed[i]
            layer[i] = index
    return True
