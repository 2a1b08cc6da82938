"""The reward laboratory: reward, learned values and choice as functions of the distance ahead (thesis 8.3)."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, check_number, shortened
from mesa_swarm.kernels.elementary import cos, direction_of
from mesa_swarm.learning.actions import ACTION_NAMES, ACTIONS, boltzmann, checked_actions
from mesa_swarm.learning.policy import SensorLayout
from mesa_swarm.learning.q_learning import QPolicy
from mesa_swarm.learning.rewards import CRITICAL, REWARDS, rewarded
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.sensors import mount_of

MOST_POINTS = 100_000
# A change that stays larger than this however fine the interval is a leap; the rewards' are 1 and 0.5.
LEAST_LEAP = 0.01
HALVINGS = 45
LEVEL = 1e-12


@dataclass(frozen=True, slots=True)
class Mark:
    """A place on a curve where a robot may oscillate.

    A "leap" is a jump of the reward by `size`; a "plateau" is constant from `start` to `end`; a "switch" makes another
    action the best from there on; in an "undecided" stretch no action is chosen more often than all others together.
    `start` and `end` are shares of the range.
    """

    kind: str
    start: float
    end: float
    action: str
    size: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """Curves over the distance ahead (p,), a share of the range: reward, or learned value, of each action (p, a).

    `policy` (p, a) is the probability of each action; `marks` are sorted by their start.
    """

    distance: np.ndarray
    values: np.ndarray
    policy: np.ndarray | None
    marks: tuple[Mark, ...]

    @property
    def actions(self) -> tuple[str, ...]:
        """Names of the columns."""
        return ACTION_NAMES[: self.values.shape[1]]


def reward_profile(kind: str, *, actions: int = 8, critical: float = CRITICAL, points: int = 201) -> Profile:
    """Return the reward of every action over the nearest reading, with its leaps and plateaus marked.

    The marks are found in the function itself, by halving intervals, not from the formula.

    Parameters
    ----------
    kind : str
        "a", "b" or "c".
    actions : int
        4 or 8.
    critical : float
        The critical distance as a share of the range, above 0, at most 1.
    points : int
        At least 3.

    Raises
    ------
    InvalidValueError, UnknownNameError

    Examples
    --------
    >>> for mark in reward_profile("b", actions=4).marks[-2:]:
    ...     print(mark.kind, mark.action, round(mark.start, 3), round(mark.end, 3), mark.size)
    plateau right on the spot 0.08 1.0 0.0
    plateau forward 0.08 1.0 0.0
    """
    number = REWARDS.index(check_choice("reward", kind, REWARDS))
    critical = check_number("critical", critical, above=0, maximum=1)
    distance = np.linspace(0.0, 1.0, check_count("points", points, minimum=3, maximum=MOST_POINTS))
    values = np.empty((len(distance), checked_actions(actions)))
    marks = []
    for a, (left, right) in enumerate(ACTIONS[: values.shape[1]]):
        curve = partial(_reward_at, number, left, right, critical)
        values[:, a] = [curve(x) for x in distance]
        marks += marks_of(curve, distance, ACTION_NAMES[a])
    return Profile(distance, values, None, tuple(sorted(marks, key=_order)))


def _reward_at(kind: int, left: float, right: float, critical: float, nearest: float) -> float:
    return rewarded(kind, float(nearest), left, right, critical)


def marks_of(curve: Callable[[float], float], distance: np.ndarray, name: str) -> list[Mark]:
    """Return the leaps and plateaus of a function over these distances."""
    values = [curve(x) for x in distance]
    leaps = []
    for i in np.flatnonzero(np.abs(np.diff(values)) > LEAST_LEAP):
        low, high = _narrowed(curve, float(distance[i]), float(distance[i + 1]))
        size = curve(high) - curve(low)
        if abs(size) > LEAST_LEAP:
            leaps.append(Mark("leap", high, high, name, round(size, 9)))
    return leaps + _plateaus(distance, values, [leap.start for leap in leaps], name)


def _narrowed(curve: Callable[[float], float], low: float, high: float) -> tuple[float, float]:
    """Return a tiny interval with the largest change of the function."""
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if abs(curve(middle) - curve(low)) > abs(curve(high) - curve(middle)):
            high = middle
        else:
            low = middle
    return low, high


def _plateaus(distance: np.ndarray, values: list[float], leaps: list[float], name: str) -> list[Mark]:
    marks = []
    for i, j in _stretches(np.abs(np.diff(values)) < LEVEL):
        before = [leap for leap in leaps if distance[max(i - 1, 0)] <= leap <= distance[i]]
        start = before[0] if before else float(distance[i])
        marks.append(Mark("plateau", start, float(distance[j]), name))
    return marks


def _stretches(true: np.ndarray) -> list[tuple[int, int]]:
    """Return the first index of each stretch of True, and the one after its last."""
    edges = np.diff(np.concatenate([[False], true, [False]]).astype(int))
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))


def learned_profile(
    policy: QPolicy,
    design: RobotDesign,
    *,
    robot: int | None = None,
    wall_degrees: float = 0.0,
    temperature: float | None = None,
    points: int = 101,
) -> Profile:
    """Return learned values and action probabilities over the distance to a flat wall.

    Parameters
    ----------
    policy : QPolicy
    design : RobotDesign
        The design that it was trained with.
    robot : int, optional
        The robot whose networks are shown; by default the mean over all of them.
    wall_degrees : float
        Bearing of the wall's nearest point: 0 ahead, 90 on the left. -180 to 180.
    temperature : float, optional
        Of the choice; the policy's by default.
    points : int
        At least 3.

    Returns
    -------
    Profile
        Its distance is the gap between rim and wall as a share of the greatest range.

    Raises
    ------
    InvalidValueError, LearningError

    Examples
    --------
    >>> from mesa_swarm import AGENT9
    >>> policy = QPolicy.untrained(AGENT9, rng=np.random.default_rng(1), actions=4)
    >>> learned_profile(policy, AGENT9, points=5).policy.shape
    (5, 4)
    """
    if not isinstance(policy, QPolicy):
        raise InvalidValueError(f"policy is {shortened(policy)}; expected a QPolicy, such as from QLearning.policy()")
    policy.sensors.check(design)
    distance = np.linspace(0.0, 1.0, check_count("points", points, minimum=3, maximum=MOST_POINTS))
    readings = wall_readings(design, distance * max(policy.sensors.ranges), wall_degrees)
    chosen = range(policy.copies) if robot is None else [check_count("robot", robot, maximum=policy.copies - 1)]
    kinds = np.where(readings >= 0, 0, -1)
    tables = np.array([policy.of_robot(k).values(readings, kinds) for k in chosen])
    heat = policy.temperature if temperature is None else check_number("temperature", temperature, above=0)
    shares = np.array([[boltzmann(row, heat) for row in table] for table in tables]).mean(axis=0)
    return profile_of(distance, tables.mean(axis=0), shares)


def profile_of(distance: np.ndarray, values: np.ndarray, shares: np.ndarray) -> Profile:
    """Return the profile of learned values (p, a) and probabilities (p, a) over distances (p,), with its marks."""
    return Profile(distance, values, shares, tuple(_decisions(distance, values, shares)))


def wall_readings(design: RobotDesign, gaps: ArrayLike, wall_degrees: float = 0.0) -> np.ndarray:
    """Return proximity readings (p, s) of an endless flat wall, -1 beyond their range.

    `gaps` (p,) are from the robot's rim to the wall; `wall_degrees` is the bearing of its nearest point.
    """
    towards = math.radians(check_number("wall_degrees", wall_degrees, minimum=-180, maximum=180))
    normal = np.array(direction_of(towards))
    away = design.radius + np.asarray(gaps, float)
    readings = np.full((len(away), len(SensorLayout.of(design))), -1.0)
    for s, sensor in enumerate(design.proximity):
        bearing = math.radians(sensor.bearing_degrees)
        off = abs(math.remainder(bearing - towards, math.tau)) - math.radians(sensor.field_of_view_degrees) / 2
        facing = cos(max(off, 0.0))
        if facing > LEVEL:
            along = (away - np.dot(mount_of(sensor, design.radius), normal)) / facing
            readings[:, s] = np.where(along <= sensor.range, np.maximum(along, 0.0), -1.0)
    return readings


def _decisions(distance: np.ndarray, values: np.ndarray, shares: np.ndarray) -> list[Mark]:
    best = values.argmax(axis=1)
    marks = [
        Mark("switch", float(distance[i + 1]), float(distance[i + 1]), ACTION_NAMES[best[i + 1]])
        for i in np.flatnonzero(np.diff(best))
    ]
    for i, j in _stretches(shares.max(axis=1) < 0.5):
        marks.append(Mark("undecided", float(distance[i]), float(distance[j - 1]), ACTION_NAMES[best[i]]))
    return sorted(marks, key=_order)


def _order(mark: Mark) -> tuple[float, int, int]:
    return mark.start, ("leap", "switch", "undecided", "plateau").index(mark.kind), ACTION_NAMES.index(mark.action)
