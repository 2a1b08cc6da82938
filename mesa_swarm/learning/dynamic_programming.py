"""Exact values of the thesis's actions before a wall, by dynamic programming, beside what robots learn (8.4)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mesa_swarm.base.errors import InvalidValueError, check_choice, check_count, check_number, shortened
from mesa_swarm.kernels.elementary import cos
from mesa_swarm.learning.actions import ACTION_NAMES, ACTIONS, as_floats, boltzmann, checked_actions, describe_value
from mesa_swarm.learning.reward_lab import wall_readings
from mesa_swarm.learning.rewards import CRITICAL, REWARD_STATES, REWARDS, STATE, rewarded
from mesa_swarm.robots.design import AGENT9, RobotDesign

FORWARD = ACTION_NAMES.index("forward")
TURNING = ("exact", "leave", "stand")
# Values are exact to this, and equal if they differ by less than a hundred times as much.
TOLERANCE = 1e-9
EQUAL = 100 * TOLERANCE
MOST_SWEEPS = 1_000_000
LARGEST_GAMMA = 0.999


@dataclass(frozen=True, slots=True, eq=False)
class ApproachValues:
    """Exact values of the actions of a robot that faces a wall.

    Parameters
    ----------
    gamma : float
    distance : ndarray, shape (p,), map units
        From the rim to the wall, from 0 on, equally spaced.
    reward : ndarray, shape (p, a)
        Of each action of `learning.actions.ACTION_NAMES`.
    values : ndarray, shape (p, a)
        Q*(s, a): the discounted return of the action, if each later one is the best.
    """

    gamma: float
    distance: np.ndarray
    reward: np.ndarray
    values: np.ndarray

    @property
    def utility(self) -> np.ndarray:
        """The value of forward as a share of the largest possible (8.4), ``(1 - gamma) Q``, shape (p,)."""
        return (1.0 - self.gamma) * self.values[:, FORWARD]

    @property
    def switching_distance(self) -> float:
        """The least distance from which on forward is better than every other action; infinite if it never is.

        Where actions are equally good, as all are below the critical distance with gamma 0, none is the best.
        """
        others = np.delete(self.values, FORWARD, axis=1).max(axis=1)
        return self._beyond(self.values[:, FORWARD] > others + EQUAL)

    def probability(self, temperature: float) -> np.ndarray:
        """Return Boltzmann's probability of each action (7.4), shape (p, a), at a temperature above 0."""
        check_number("temperature", temperature, above=0)
        return np.array([boltzmann(row, temperature) for row in self.values])

    def even_distance(self, temperature: float) -> float:
        """Return the least distance from which on forward has a probability of 1/2 or more at a temperature."""
        return self._beyond(self.probability(temperature)[:, FORWARD] >= 0.5)

    def _beyond(self, held: np.ndarray) -> float:
        """Return the least distance from which on something holds."""
        failed = np.flatnonzero(~held)
        first = failed[-1] + 1 if len(failed) else 0
        return float(self.distance[first]) if first < len(held) else math.inf


def approach_values(
    gamma: float,
    *,
    reward: str = "b",
    critical: float = CRITICAL,
    actions: int = 8,
    reward_of: str = STATE,
    turning: str = "exact",
    design: RobotDesign = AGENT9,
    cells: int = 10,
) -> ApproachValues:
    """Return the exact values of a robot's actions before an endless flat wall, by value iteration.

    The state is the distance to the wall and the heading. The drive moves the robot exactly; at a distance of 0 it
    touches and advances no farther. Sensors have no error. Values between two distances are interpolated, which moves
    straight towards the wall or away from it do not need.

    Parameters
    ----------
    gamma : float
        Discount of the next step's value, 0 to 0.999.
    reward : str
        "a", "b" or "c", see `learning.reward`.
    critical : float
        Reading, as a share of the range, below which the reward depends on nearness only; above 0, at most 1.
    actions : int
        8, or the first 4 of them.
    reward_of : str
        The state whose reading the reward depends on: "state", in which the action is chosen, or "next state".
    turning : str
        What actions that turn lead to. "exact": to the next heading, which is part of the state. The other two reduce
        the state to the distance: "leave": to open ground, where nothing is in sight for ever; "stand": to the same
        heading, as if a robot moved by its mean wheel speed only.
    design : RobotDesign
        With proximity sensors and two wheels; its sensors, radius and speed count.
    cells : int
        Distances in one step of the robot at full speed, 1 to 100.

    Returns
    -------
    ApproachValues
        For a robot that faces the wall, up to the range of its sensors.

    Raises
    ------
    InvalidValueError, UnknownNameError

    References
    ----------
    Bellman's equation, ``Q(s, a) = r(s, a) + gamma max_a' Q(s', a')``: the fixed point of (7.3) in the thesis.

    Examples
    --------
    >>> [approach_values(gamma, turning="stand").switching_distance for gamma in (0.0, 0.7, 0.95)]
    [4.0, 4.0, 4.0]
    """
    gamma = check_number("gamma", gamma, minimum=0, maximum=LARGEST_GAMMA)
    number = REWARDS.index(check_choice("reward", reward, REWARDS))
    critical = check_number("critical", critical, above=0, maximum=1)
    moves = ACTIONS[: checked_actions(actions)]
    check_choice("reward_of", reward_of, REWARD_STATES)
    check_choice("turning", turning, TURNING)
    wall = _Wall(_checked(design), check_count("cells", cells, minimum=1, maximum=100), turning)
    following, share = wall.following(moves)
    near = wall.nearest()
    read = near if reward_of == STATE else (1 - share) * near[following] + share * near[following + 1]
    paid = _rewards(number, np.broadcast_to(read, following.shape), moves, critical)
    values = value_iteration(paid, following, share, gamma)
    ahead = slice(0, len(wall.distance))
    return ApproachValues(gamma, wall.distance, paid[:, ahead].T.copy(), values[:, ahead].T.copy())


def _checked(design: RobotDesign) -> RobotDesign:
    """Return a design if it can approach a wall that it sees."""
    if not isinstance(design, RobotDesign):
        raise InvalidValueError(f"design is {shortened(design)}; expected a RobotDesign, such as AGENT9")
    if not design.proximity or design.max_speed <= 0:
        raise InvalidValueError(f"design {design.name} cannot approach a wall; expected proximity sensors and a speed")
    return design


def _rewards(number: int, read: np.ndarray, moves: np.ndarray, critical: float) -> np.ndarray:
    """Return the reward of every action in every state (a, s), of the nearest readings (a, s)."""
    paid = np.vectorize(rewarded, otypes=[float])
    return np.array([paid(number, row, *move, critical) for row, move in zip(read, moves, strict=True)])


class _Wall:
    """A robot before a wall as a table of states: distances for each heading from 0 to pi, then open ground.

    A robot that turns left is the mirror image of one that turns right, so that headings are absolute.
    """

    def __init__(self, design: RobotDesign, cells: int, turning: str) -> None:
        self.design, self.cells, self.turning = design, cells, turning
        self.range = max(sensor.range for sensor in design.proximity)
        self.distance = np.arange(math.ceil(self.range * cells / design.max_speed) + 1) * (design.max_speed / cells)
        # One wheel at full speed turns by this; two by twice as much.
        self.turn = design.max_speed / (2.0 * design.radius)
        self.headings = np.arange(math.floor(math.pi / self.turn) + 1 if turning == "exact" else 1) * self.turn

    def nearest(self) -> np.ndarray:
        """Return the nearest reading in every state, as a share of the range (s,)."""
        limits = np.array([sensor.range for sensor in self.design.proximity])
        near = [self._nearest_at(math.degrees(heading), limits) for heading in self.headings]
        return np.concatenate([*near, [1.0]])

    def _nearest_at(self, degrees: float, limits: np.ndarray) -> np.ndarray:
        readings = wall_readings(self.design, self.distance, degrees)
        return np.where(readings < 0, 1.0, np.minimum(readings / limits, 1.0)).min(axis=1)

    def following(self, moves: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return what `value_iteration` takes: the state that follows (a, s), and the share of the one after it."""
        parts = [self._after(left, right) for left, right in moves]
        return np.array([first for first, _ in parts]), np.array([share for _, share in parts])

    def _after(self, left: float, right: float) -> tuple[np.ndarray, np.ndarray]:
        count = len(self.distance)
        last = len(self.headings) * count
        if left != right and self.turning == "leave":
            return np.full(last + 1, last - 1), np.ones(last + 1)
        places = np.array([self._places(heading, left, right) for heading in self.headings])
        cell = np.minimum(places.astype(int), count - 2)
        heading = np.arange(len(self.headings)) + (round(right - left) if self.turning == "exact" else 0)
        heading = np.minimum(np.abs(heading), len(self.headings) - 1)
        states = heading[:, np.newaxis] * count + cell
        # Open ground follows itself.
        return np.append(states, last - 1), np.append(places - cell, 1.0)

    def _places(self, heading: float, left: float, right: float) -> np.ndarray:
        """Return the distances after an action, in cells: the chord of an arc, or a straight move."""
        turned = (right - left) * self.turn if self.turning == "exact" else 0.0
        chord = 0.5 * (left + right) * self.cells * np.sinc(0.5 * turned / math.pi)
        towards = chord * cos(heading + 0.5 * turned)
        places = np.arange(len(self.distance)) - towards
        return np.clip(np.where(np.abs(places - places.round()) < EQUAL, places.round(), places), 0, len(places) - 1)


def value_iteration(reward: ArrayLike, following: ArrayLike, share: ArrayLike, gamma: float) -> np.ndarray:
    """Return Q* of a table of states, of which an action leads to one or to a mean of two neighbours.

    ``Q(a, s) = r(a, s) + gamma ((1 - w) V(k) + w V(k + 1))`` with ``V(s) = max_a Q(a, s)``, k the following state of
    the action and w its share, is applied until no value can change by more than 1e-9.

    Parameters
    ----------
    reward : ndarray, shape (a, s)
    following : int ndarray, shape (a, s)
        0 to s - 2.
    share : ndarray, shape (a, s)
        Of the state after the following one, 0 to 1.
    gamma : float
        0 to 0.999.

    Returns
    -------
    ndarray, shape (a, s)

    Raises
    ------
    InvalidValueError

    Examples
    --------
    Standing in the second of two states pays 1 a step, and the only action leads there:

    >>> value_iteration([[0.0, 1.0]], [[0, 0]], [[1.0, 1.0]], 0.5).round(6)
    array([[1., 2.]])
    """
    paid, weight, index = _checked_table(reward, following, share)
    gamma = check_number("gamma", gamma, minimum=0, maximum=LARGEST_GAMMA)
    values = paid.copy()
    for _ in range(MOST_SWEEPS):
        best = values.max(axis=0)
        new = paid + gamma * ((1.0 - weight) * best[index] + weight * best[index + 1])
        change = float(np.abs(new - values).max())
        values = new
        if gamma * change <= TOLERANCE * (1.0 - gamma):
            break
    return values


def _checked_table(reward: ArrayLike, following: ArrayLike, share: ArrayLike) -> tuple[np.ndarray, ...]:
    """Return rewards, shares and following states if they describe a table."""
    paid, weight, index = as_floats(reward), as_floats(share), as_floats(following)
    if paid.ndim != 2 or paid.shape[0] < 1 or paid.shape[1] < 2 or not np.isfinite(paid).all():
        raise InvalidValueError(
            f"reward is {describe_value(reward)}; expected finite numbers, shape (actions, 2 states or more)"
        )
    for name, array, most in (("following", index, paid.shape[1] - 2), ("share", weight, 1)):
        if array.shape != paid.shape or not ((array >= 0) & (array <= most)).all():
            raise InvalidValueError(f"{name} holds {shortened(array)}; expected 0 to {most}, shape {paid.shape}")
    if (index != index.astype(int)).any():
        raise InvalidValueError(f"following holds {shortened(index)}; expected whole numbers")
    return paid, weight, index.astype(np.int64)
