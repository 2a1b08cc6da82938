"""Conditions of transitions between the states of a `StateMachine`: what a robot senses, and chance."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, check_flag, check_number
from mesa_swarm.control.layer import Senses
from mesa_swarm.geometry.masked_arrays import fill_masked
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import exp
from mesa_swarm.robots.sensors import LARGEST_RANGE
from mesa_swarm.world.statics import KINDS, MOST_KINDS, ROBOT

ANYTHING = "anything"
# The first number of a condition's row: which function of the readings it is.
OWN, CHANCE, ROBOTS_SEEN, SEEN, UNSEEN, ON_MARK, OFF_MARK, HEAT_SENSED = range(8)
# Numbers of a row.
WIDTH = 5
STEEPEST, MOST_SEEN = 1000.0, 1000.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Condition:
    """Base class of conditions: the probability, in each step, with which a transition is taken.

    A custom condition is a frozen dataclass that inherits from it and has a method ``chances(senses)``, which returns
    the probability of each robot (n,), 0 to 1, from what robots know.

    Parameters
    ----------
    probability : float
        Of the transition in a step in which the readings are as the condition states, 0 to 1.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> from mesa_swarm import AGENT3, SwarmModel
    >>> model = SwarmModel(rng=1)
    >>> robots = model.add_robots(AGENT3, 2)
    >>> Chance(probability=0.25).chances(Senses.of(model.swarm))
    array([0.25, 0.25])
    """

    code: ClassVar[int] = OWN
    form: ClassVar[str] = "{0.__class__.__name__}"  # of its words
    probability: float = 1.0

    def __init_subclass__(cls) -> None:
        """Let a class act by chances of its own, also one that inherits from a condition of the package."""
        if "chances" in vars(cls):
            cls.code = OWN

    def __post_init__(self) -> None:
        """Check the probability."""
        check_number(f"{type(self).__name__}'s probability", self.probability, minimum=0, maximum=1)

    @property
    def parameters(self) -> tuple[float, float, float]:
        """The numbers on which its probability depends, as `chance_of` takes them."""
        return (0.0, 0.0, 0.0)

    @property
    def row(self) -> tuple[float, ...]:
        """Its row in the table of a machine: the code of what it is, the probability, the three parameters."""
        return (self.code, float(self.probability), *self.parameters)

    @property
    def words(self) -> str:
        """What it states of the readings, such as "robot within 30"; "" for nothing."""
        return self.form.format(self)

    @property
    def label(self) -> str:
        """What drawings call it, such as "robot within 30, p = 0.5"."""
        chance = f"p = {self.probability:.3g}" if self.probability != 1 or not self.words else ""
        return ", ".join(part for part in (self.words, chance) if part)

    def chances(self, senses: Senses) -> np.ndarray:
        """Return the probability that it is fulfilled in this step, for each robot, shape (n,)."""
        if self.code == OWN:
            raise NotImplementedError(f"{type(self).__name__} needs a method chances(senses)")
        chances = np.empty(len(senses.design))
        write_chances(senses.distance, senses.kind, senses.line, senses.radiation, np.array(self.row), chances)
        return chances


@dataclass(frozen=True, kw_only=True, slots=True)
class Chance(Condition):
    """Chance alone: the same probability in every step, whatever the robot senses.

    Examples
    --------
    >>> Chance(probability=0.01).label
    'p = 0.01'
    """

    code: ClassVar[int] = CHANCE
    form: ClassVar[str] = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class RobotsSeen(Condition):
    """Many robots are seen, or few: a logistic function of the number n of sensors that see a robot [1]_.

        ``probability / (1 + exp(steepness (number - n)))``, for `fewer` with the opposite sign of the exponent

    Parameters
    ----------
    probability : float
        0 to 1.
    number : float
        Of robots at which it is half of `probability`, 0 to 1,000.
    steepness : float
        How abruptly it rises there, 0 to 1,000; 0 for a probability that does not depend on robots.
    fewer : bool
        Whether it falls with the number instead.

    Raises
    ------
    InvalidValueError

    References
    ----------
    .. [1] Francesca, Brambilla, Brutschy, Trianni and Birattari, AutoMoDe: a novel approach to the automatic design of
       control software for robot swarms, Swarm Intelligence 8 (2014) 89-112.

    Examples
    --------
    >>> RobotsSeen(number=3, steepness=5).label
    'robots >= 3'
    """

    code: ClassVar[int] = ROBOTS_SEEN
    number: float = 2.0
    steepness: float = 5.0
    fewer: bool = False

    def __post_init__(self) -> None:
        """Check every value."""
        Condition.__post_init__(self)
        check_number("number", self.number, minimum=0, maximum=MOST_SEEN)
        check_number("steepness", self.steepness, minimum=0, maximum=STEEPEST)
        check_flag("fewer", self.fewer)

    @property
    def parameters(self) -> tuple[float, float, float]:
        """The number, and the steepness with its sign."""
        return (float(self.number), (-1.0 if self.fewer else 1.0) * float(self.steepness), 0.0)

    @property
    def words(self) -> str:
        """What it states of the readings."""
        return f"robots {'<=' if self.fewer else '>='} {self.number:.3g}"


@dataclass(frozen=True, kw_only=True, slots=True)
class Seen(Condition):
    """A proximity sensor sees something of a kind that is near.

    Parameters
    ----------
    probability : float
        0 to 1.
    kind : str or int
        "obstacle", "robot", "fire", "load" or "anything"; of a kind of a model's own its code, `model.kind_code`.
    within : float
        Greatest reading that counts, map units, at least 0.

    Raises
    ------
    InvalidValueError, UnknownNameError

    Examples
    --------
    >>> Seen(kind="robot", within=30, probability=0.5).label
    'robot within 30, p = 0.5'
    """

    code: ClassVar[int] = SEEN
    kind: str | int = ANYTHING
    within: float = 20.0

    def __post_init__(self) -> None:
        """Check every value."""
        Condition.__post_init__(self)
        if isinstance(self.kind, int) and not isinstance(self.kind, bool):
            check_count("kind", self.kind, maximum=MOST_KINDS)
        else:
            check_choice("kind", self.kind, (*KINDS, ANYTHING))
        check_number("within", self.within, minimum=0, maximum=LARGEST_RANGE)

    @property
    def parameters(self) -> tuple[float, float, float]:
        """The code of the kind, -1 for anything, and the greatest reading."""
        codes = {**{name: code for code, name in enumerate(KINDS)}, ANYTHING: -1}
        return (float(codes.get(str(self.kind), self.kind)), float(self.within), 0.0)

    @property
    def words(self) -> str:
        """What it states of the readings."""
        kind = f"kind {self.kind}" if isinstance(self.kind, int) else self.kind
        return f"{kind} within {self.within:.3g}"


@dataclass(frozen=True, kw_only=True, slots=True)
class Unseen(Seen):
    """No proximity sensor sees anything of a kind that is near; parameters are those of `Seen`.

    Examples
    --------
    >>> Unseen(kind="robot", within=30).label
    'no robot within 30'
    """

    code: ClassVar[int] = UNSEEN

    @property
    def words(self) -> str:
        """What it states of the readings."""
        kind = f"no kind {self.kind}" if isinstance(self.kind, int) else f"no {self.kind}"
        return f"{'nothing' if self.kind == ANYTHING else kind} within {self.within:.3g}"


@dataclass(frozen=True, kw_only=True, slots=True)
class OnMark(Condition):
    """A line sensor is over a mark on the ground.

    Examples
    --------
    >>> OnMark(probability=0.9).label
    'on a mark, p = 0.9'
    """

    code: ClassVar[int] = ON_MARK
    form: ClassVar[str] = "on a mark"


@dataclass(frozen=True, kw_only=True, slots=True)
class OffMark(Condition):
    """No line sensor is over a mark on the ground.

    Examples
    --------
    >>> OffMark().label
    'off marks'
    """

    code: ClassVar[int] = OFF_MARK
    form: ClassVar[str] = "off marks"


@dataclass(frozen=True, kw_only=True, slots=True)
class HeatSensed(Condition):
    """A radiation sensor reads more than a limit.

    Parameters
    ----------
    probability : float
        0 to 1.
    above : float
        The limit, a temperature of a fire, 0 to 1.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> HeatSensed(above=0.2).label
    'heat > 0.2'
    """

    code: ClassVar[int] = HEAT_SENSED
    form: ClassVar[str] = "heat > {0.above:.3g}"
    above: float = 0.0

    def __post_init__(self) -> None:
        """Check every value."""
        Condition.__post_init__(self)
        check_number("above", self.above, minimum=0, maximum=1)

    @property
    def parameters(self) -> tuple[float, float, float]:
        """The limit."""
        return (float(self.above), 0.0, 0.0)


CONDITIONS: tuple[type[Condition], ...] = (Chance, HeatSensed, OffMark, OnMark, RobotsSeen, Seen, Unseen)


def own_chances(condition: Condition, senses: Senses) -> np.ndarray:
    """Return the probabilities (n,) of a custom condition, checked.

    Raises
    ------
    InvalidValueError
        If they are not one number from 0 to 1 for each robot.
    """
    returned: Any = condition.chances(senses)
    try:
        chances = np.asarray(fill_masked(returned), float)
    except (TypeError, ValueError):
        chances = np.empty(0)
    n = len(senses.design)
    if chances.shape != (n,) or not bool(((chances >= 0.0) & (chances <= 1.0)).all()):
        raise InvalidValueError(
            f"chances of {type(condition).__name__} returned an array of shape {chances.shape}; "
            f"expected {n} numbers from 0 to 1, one a robot"
        )
    return chances


@compiled
def write_chances(distance, kind, line, radiation, row, chances):
    """Write the probability of one condition for every robot (n,)."""
    for i in range(chances.shape[0]):
        chances[i] = chance_of(distance, kind, line, radiation, i, row)


@compiled
def chance_of(distance, kind, line, radiation, i, row):
    """Return the probability that the condition in this row of a table is fulfilled for robot i."""
    code, probability = row[0], row[1]
    if code == ROBOTS_SEEN:
        count = 0
        for s in range(kind.shape[1]):
            if kind[i, s] == ROBOT:
                count += 1
        # No more than 700 in the exponent, whose exponential is finite.
        return probability / (1.0 + exp(min(row[3] * (row[2] - count), 700.0)))
    fulfilled = code == CHANCE
    if code in (SEEN, UNSEEN):
        fulfilled = is_near(distance, kind, i, row[2], row[3]) == (code == SEEN)
    elif code in (ON_MARK, OFF_MARK):
        fulfilled = is_any_above(line, i, 0.0) == (code == ON_MARK)
    elif code == HEAT_SENSED:
        fulfilled = is_any_above(radiation, i, row[2])
    return probability if fulfilled else 0.0


@compiled
def is_near(distance, kind, i, target, within):
    """Return whether a sensor of robot i sees something of a kind, -1 for any, at most this far away."""
    for s in range(kind.shape[1]):
        if kind[i, s] >= 0 and (target < 0 or kind[i, s] == target) and distance[i, s] <= within:
            return True
    return False


@compiled
def is_any_above(readings, i, limit):
    """Return whether any reading of robot i is above the limit."""
    for s in range(readings.shape[1]):
        if readings[i, s] > limit:
            return True
    return False
