"""Rewards (a), (b), (c): drive fast and stay away from things (thesis 8.2)."""

import math

from mesa_swarm.base.errors import check_choice, check_number
from mesa_swarm.kernels.compiled import compiled
from mesa_swarm.kernels.elementary import log

REWARDS = ("a", "b", "c")
# The state by whose readings an action is rewarded: the one in which it was chosen, as in the thesis, or the next.
STATE, NEXT_STATE = "state", "next state"
REWARD_STATES = (STATE, NEXT_STATE)
# d_crit of the thesis is 0.4, in units that it does not state. We read it as 0.4 of a robot's diameter of 10, which is
# 0.08 of a range of 50: with this reading alone collisions fall with T as in the thesis whether there are four or eight
# actions, and whichever state is rewarded; see docs/appendix/readings.md.
CRITICAL = 0.08


def reward(kind: str, nearest: float, left: float, right: float, critical: float = CRITICAL) -> float:
    """Return the reward of an action in a state, r(s, a).

    With i the nearest reading in that state, d the critical distance and ``q = (e - 1) / d``: below d it is
    ``ln(q i + 1) - 1``, from -1 when touching to 0 at d. From d on

    - (a) ``(left + right) / 2`` (8.5);
    - (b) 1 for both wheels ahead at full speed, -1 for all other actions of the thesis (8.6), and interpolated
      between them: ``max(2 min(left, right) - 1, -1)``;
    - (c) that of (b), blended in linearly from 0 at d to all of it at 2 d: no leap at d (thesis 8.3).

    Parameters
    ----------
    kind : str
        "a", "b" or "c".
    nearest : float
        The least reading as a share of its sensor's range, 0 to 1; 1 when nothing is in range.
    left, right : float
        Wheel commands as shares of max_speed, -1 to 1.
    critical : float
        d, a share of the range, above 0, at most 1. The thesis's 0.4 has no unit; the default, 0.4 of a robot's
        diameter of 10 with a range of 50, was chosen because collisions then fall with T, as the thesis states.

    Returns
    -------
    float
        In [-1, 1].

    Raises
    ------
    InvalidValueError, UnknownNameError

    Examples
    --------
    >>> reward("b", 1.0, 1, 1), reward("b", 1.0, 1, 0), reward("a", 1.0, 1, 0), reward("c", 0.6, 1, 1, 0.4)
    (1.0, -1.0, 0.5, 0.5)
    """
    number = REWARDS.index(check_choice("reward", kind, REWARDS))
    check_number("nearest", nearest, minimum=0, maximum=1)
    for name, wheel in (("left", left), ("right", right)):
        check_number(name, wheel, minimum=-1, maximum=1)
    check_number("critical", critical, above=0, maximum=1)
    return round(rewarded(number, float(nearest), float(left), float(right), float(critical)), 15)


@compiled
def rewarded(kind, nearest, left, right, critical):
    """Return the reward; `kind` is an index into `REWARDS`."""
    if nearest < critical:
        return log((math.e - 1.0) / critical * nearest + 1.0) - 1.0
    if kind == 0:
        return 0.5 * (left + right)
    ahead = max(2.0 * min(left, right) - 1.0, -1.0)
    return ahead if kind == 1 else ahead * min((nearest - critical) / critical, 1.0)
