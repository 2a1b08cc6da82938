"""What a trained controller is, its inputs, and the layer that drives robots by it."""

import math
from dataclasses import dataclass
from inspect import signature
from typing import Any, ClassVar, Protocol, cast

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.control.layer import Senses
from mesa_swarm.errors import BehaviourError, InvalidValueError, LearningError, asked, check_flag, check_name, shortened
from mesa_swarm.geometry.compiled import compiled
from mesa_swarm.learning.actions import as_floats
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.reasons import Moment, Reason
from mesa_swarm.robots.swarm import Swarm

# Of robots that nobody numbered.
COUNTED = np.empty(0, np.int64)


def checked_chances(chance: ArrayLike, robots: int) -> np.ndarray:
    """Return the numbers from which a policy draws as an array (n,), or refuse them.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> checked_chances([0.5, 1], 2)
    array([0.5, 1. ])
    """
    chances = as_floats(chance)
    if chances.shape != (robots,):
        raise InvalidValueError(f"chance is {shortened(chance)}; expected {robots} numbers from 0 to 1")
    wrong = first_outside(chances)
    if wrong >= 0:
        raise InvalidValueError(f"chance holds {chances[wrong]:g}; expected numbers from 0 to 1")
    return chances


def checked_numbers(numbers: ArrayLike | None, robots: int) -> np.ndarray:
    """Return the numbers of robots as an array (n,), or refuse them; an empty one tells to count robots from 0.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> checked_numbers(None, 2), checked_numbers([3, 4], 2)
    (array([], dtype=int64), array([3, 4]))
    """
    if numbers is None:
        return COUNTED
    try:
        given = np.asarray(numbers)
    except ValueError:
        given = np.empty(0)
    if given.shape != (robots,) or given.dtype.kind not in "iu":
        raise InvalidValueError(f"numbers is {shortened(numbers)}; expected {robots} whole numbers, one a robot")
    return given.astype(np.int64, copy=False)


@compiled
def first_outside(chances):
    """Return the place of the first number that is not from 0 to 1, or -1."""
    for i in range(chances.shape[0]):
        if not 0.0 <= chances[i] <= 1.0:
            return i
    return -1


# To compare a dtype with another takes a tenth of the time that it takes with a type.
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
        """Return the layout of a design.

        Raises
        ------
        InvalidValueError
            If `design` is none.
        """
        if not isinstance(design, RobotDesign):
            raise InvalidValueError(f"design is {shortened(design)}; expected a RobotDesign such as AGENT9")
        eyes = design.proximity
        return cls(
            tuple(float(s.bearing_degrees) for s in eyes),
            tuple(float(s.range) for s in eyes),
            tuple(float(s.field_of_view_degrees) for s in eyes),
        )

    def __len__(self) -> int:
        """How many sensors there are."""
        return len(self.bearings)

    def check(self, design: RobotDesign) -> None:
        """Refuse a design whose proximity sensors are others.

        Raises
        ------
        LearningError
        """
        other = SensorLayout.of(design)
        if other == self:
            return
        if len(other) != len(self):
            what = f"{len(self)} proximity sensors and {design.name} has {len(other)}"
        else:
            first = next(i for i in range(len(self)) if other._row(i) != self._row(i))
            what = f"{_eye(self._row(first))} as sensor {first} and {design.name} has {_eye(other._row(first))}"
        raise LearningError(f"the policy was trained with {what}; use the design that it was trained with")

    def check_readings(
        self, readings: ArrayLike, kinds: ArrayLike | None, encoding: str = "distance"
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return readings and kinds (n, s) as arrays, or refuse them; without kinds, all that is seen is an obstacle.

        Raises
        ------
        InvalidValueError
            If they have not one value a sensor, or a reading is not finite, or the encoding takes kinds and there
            are none.
        """
        if kinds is None and encoding != "distance":
            raise InvalidValueError(f"kinds is None; expected what each sensor sees, as the encoding is {encoding!r}")
        try:
            distance = np.ascontiguousarray(readings, np.float64)
            # 0 is an obstacle, -1 nothing.
            kind = np.ascontiguousarray(np.where(distance < 0.0, -1, 0) if kinds is None else kinds, np.int8)
        except (TypeError, ValueError, OverflowError):
            distance, kind = np.empty(0), np.empty(0, np.int8)
        if distance.ndim != 2 or distance.shape[1] != len(self) or distance.shape != kind.shape:
            raise InvalidValueError(
                f"readings are {shortened(np.shape(readings))} and kinds {shortened(np.shape(cast(Any, kinds)))}; "
                f"expected numbers, n rows of {len(self)} of both"
            )
        if not all_finite(distance):
            raise InvalidValueError("readings hold NaN or infinity; expected finite distances, -1 for nothing seen")
        return distance, kind

    def _row(self, i: int) -> tuple[float, float, float]:
        return self.bearings[i], self.ranges[i], self.fields_of_view[i]


def _eye(row: tuple[float, float, float]) -> str:
    return "one at {:g} degrees, range {:g}, field of view {:g} degrees".format(*row)


def sensors_of(swarm: Swarm) -> SensorLayout:
    """Return the sensors that all robots of a swarm have.

    Raises
    ------
    LearningError
        If there are no robots, or they have not all the same sensors.
    """
    if not len(swarm):
        raise LearningError("there are no robots, so that nothing was learned; add robots first")
    layout = SensorLayout.of(swarm.designs[0])
    check_designs(layout, swarm)
    return layout


def check_designs(sensors: SensorLayout, swarm: Swarm) -> None:
    """Refuse a swarm with robots that have other sensors than these.

    Raises
    ------
    LearningError
    """
    for design in swarm.designs:
        sensors.check(design)


def check_policy(policy: object, *methods: str) -> None:
    """Refuse what lacks these methods of a policy.

    Raises
    ------
    InvalidValueError
    """
    if isinstance(policy, type) or not all(callable(asked(policy, method)) for method in methods):
        raise InvalidValueError(f"policy is {shortened(policy)}; expected what load_policy() returns")


class Policy(Protocol):
    """A controller that was trained, or can be: readings in, wheel commands out.

    What learners of all families make, what files hold, and what `PolicyLayer` drives robots by. A policy does
    not change when it acts. One that goes by what was before has one thing more, ``memory``, how many numbers each
    robot keeps from step to step, and its `act` one argument more: these numbers (n, memory), 0 at first, which it
    writes; see `ReflexPolicy`. One in which robots have sets of weights of their own tells in ``copies`` how many
    there are, and its `act` has a keyword ``numbers`` (n,): the k-th robot ever made acts by set ``k % copies``,
    also when robots before it are gone; see `QPolicy`.
    """

    family: ClassVar[str]  # by which files know it, see `learning.policy_files`

    @property
    def sensors(self) -> SensorLayout:
        """The sensors that it was trained with."""

    @property
    def steps(self) -> int:
        """Robot-steps of training; 0 is untrained."""

    @property
    def training(self) -> dict:
        """Where it comes from, and figures of its training: texts and numbers by name."""

    def act(self, readings: ArrayLike, kinds: ArrayLike | None = None, chance: ArrayLike | None = None) -> np.ndarray:
        """Return wheel commands as shares of max_speed.

        Parameters
        ----------
        readings : ndarray, shape (n, s), map units
            Of the proximity sensors, -1 for nothing seen.
        kinds : int ndarray, shape (n, s), optional
            0 obstacle, 1 robot, 2 fire, 3 load, -1 nothing. A policy that knows distances only acts without them.
        chance : ndarray, shape (n,), optional
            Numbers from 0 to 1, from which a policy that tries things draws; without them it does what it holds
            best.

        Returns
        -------
        ndarray, shape (n, 2)
            Left and right wheel, in [-1, 1].

        Raises
        ------
        InvalidValueError
            If the readings are not those of its sensors, or a chance is not from 0 to 1.
        """

    def arrays(self) -> dict[str, np.ndarray]:
        """Return what was learned, by name: finite float64 arrays."""

    def settings(self) -> dict:
        """Return all else that it takes to act: texts and finite numbers by name."""

    @classmethod
    def restored(
        cls, sensors: SensorLayout, steps: int, training: dict, settings: dict, arrays: dict[str, np.ndarray]
    ) -> "Policy":
        """Return the policy of these parts, or raise an error of ours if they do not fit together."""


@dataclass(kw_only=True)
class PolicyLayer:
    """Drive by a policy that no longer learns; always active.

    Parameters
    ----------
    policy : Policy
    greedy : bool
        Whether robots always do what the policy holds best, or leave to chance what the policy leaves to it.
    explore : bool
        Whether an untrained policy may drive.

    Raises
    ------
    InvalidValueError
        If `policy` is not one.
    LearningError
        If it is untrained and not told to explore; when robots have other sensors than it was trained with.

    Examples
    --------
    >>> from mesa_swarm import AGENT9
    >>> from mesa_swarm.learning.q_learning import QPolicy
    >>> PolicyLayer(policy=QPolicy.untrained(AGENT9, rng=np.random.default_rng(1)))
    Traceback (most recent call last):
        ...
    mesa_swarm.errors.LearningError: the policy is untrained; train it first, or let it explore with explore=True
    """

    policy: Policy
    greedy: bool = False
    explore: bool = False
    name: str = "Policy"

    def __post_init__(self) -> None:
        """Check the policy."""
        check_name("name", self.name)
        check_policy(self.policy, "act")
        for flag in ("greedy", "explore"):
            check_flag(flag, getattr(self, flag))
        if not self.policy.steps and not self.explore:
            raise LearningError("the policy is untrained; train it first, or let it explore with explore=True")

    def bind(self, swarm: Swarm, prefix: str, rng: np.random.Generator) -> None:
        """Remember what the policy keeps, if anything; check that the robots are of a kind that it knows."""
        self._swarm, self._rng, self._known = swarm, rng, 0
        numbers: int = getattr(self.policy, "memory", 0)
        self._kept = f"{prefix}.memory" if numbers else None
        if self._kept:
            swarm.remember(self._kept, (numbers,), np.float64, 0.0)
        # Policies of one's own need not know of numbers.
        self._numbered = getattr(self.policy, "copies", 1) != 1 and "numbers" in signature(self.policy.act).parameters
        self._check_designs()

    def decide(self, senses: Senses, command: np.ndarray, layer: np.ndarray, index: int) -> None:
        """Drive the robots that no earlier layer drives.

        Raises
        ------
        LearningError
            If robots with other sensors were added.
        BehaviourError
            If the policy returned anything but two finite numbers a robot.
        """
        if len(self._swarm.designs) != self._known:
            self._check_designs()
        chance = None if self.greedy else self._rng.random(len(layer))
        kept = (self._swarm.columns[self._kept],) if self._kept else ()
        told = {"numbers": self._swarm.columns["number"]} if self._numbered else {}
        said = self.policy.act(senses.distance, senses.kind, chance, *kept, **told)
        shares = said
        # Compiled code reads as many rows as there are robots, and is compiled anew for other kinds of arrays.
        if type(said) is not np.ndarray or said.shape != command.shape or said.dtype != DOUBLE:
            shares = _shares_of(said)
        if shares.shape != command.shape or not drive(shares, senses.max_speed, command, layer, index):
            raise BehaviourError(
                f"{self.name}: its policy returned {_told(said)}; expected finite numbers of shape {command.shape}"
            )

    def reason(self, moment: Moment) -> Reason:
        """Say what the policy saw."""
        near = tuple(s for s in np.flatnonzero(moment.kind >= 0).tolist() if math.isfinite(moment.distance[s]))
        return Reason("its policy acts on " + (", ".join(map(moment.reading, near)) or "nothing in sight"), near)

    def _check_designs(self) -> None:
        check_designs(self.policy.sensors, self._swarm)
        self._known = len(self._swarm.designs)


def _shares_of(said: object) -> np.ndarray:
    """Return what a policy returned as an array of floats, an empty one if it holds no numbers."""
    try:
        array = np.asarray(said)
    except ValueError:  # rows of different lengths
        array = np.empty(0)
    return array.astype(np.float64, order="C") if array.dtype.kind in "biuf" else np.empty(0)


def _told(said: object) -> str:
    return f"an array of {said.dtype}, shape {said.shape}" if isinstance(said, np.ndarray) else shortened(said)


@compiled
def all_finite(table):
    """Return whether a table (n, s) holds neither NaN nor infinity; of few robots in a tenth of NumPy's time."""
    for i in range(table.shape[0]):
        for s in range(table.shape[1]):
            if not math.isfinite(table[i, s]):
                return False
    return True


@compiled
def drive(shares, max_speed, command, layer, index):
    """Write the commands of robots that no layer drives yet, if all `shares` (n, 2) of max_speed are finite."""
    for i in range(layer.shape[0]):
        if not (math.isfinite(shares[i, 0]) and math.isfinite(shares[i, 1])):
            return False
    for i in range(layer.shape[0]):
        if layer[i] < 0:
            command[i, 0] = shares[i, 0] * max_speed[i]
            command[i, 1] = shares[i, 1] * max_speed[i]
            layer[i] = index
    return True
