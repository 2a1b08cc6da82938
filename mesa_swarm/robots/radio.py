"""Radio: what robots broadcast, its range, and what blocks it."""

from collections.abc import Sequence
from dataclasses import dataclass

from mesa_swarm.errors import InvalidValueError, check_number, shortened
from mesa_swarm.robots.sensors import LARGEST_RANGE

MOST_BEACONS = 10_000


@dataclass(frozen=True, kw_only=True, slots=True)
class Radio:
    """How robots broadcast to all robots near them: state, goals, or both.

    State is which layer drives a robot and which task it has; its hearers also know where it is. A goal is
    a position. With state a robot can go to where another is at work, with goals to what that one works at.

    Each robot hears what the others decided in the step before.

    Parameters
    ----------
    range : float
        How far a broadcast carries, centre to centre, map units, 0 to 1e6.
    state, goal : bool
        What is broadcast.
    occlusion : bool
        Whether a broadcast is stopped by an obstacle on the straight line between the two centres. Robots,
        fires, burning or out, and marks on the ground stop nothing.
    loss_probability : float
        With which a robot misses a broadcast, for each sender, hearer and step anew, 0 to 1.
    beacons : sequence of (x, y)
        Stationary senders, which broadcast their own positions as goals.

    Raises
    ------
    InvalidValueError
        If a value is out of its range, or nothing is broadcast at all.

    References
    ----------
    T. Balch and R. C. Arkin, Communication in reactive multiagent robotic systems, Autonomous Robots 1
    (1994) 27-52.

    Examples
    --------
    >>> Radio(range=150, goal=False).loss_probability
    0.0
    """

    range: float = 100.0
    state: bool = True
    goal: bool = True
    occlusion: bool = False
    loss_probability: float = 0.0
    beacons: Sequence[tuple[float, float]] = ()

    def __post_init__(self) -> None:
        """Check every value."""
        check_number("range", self.range, minimum=0, maximum=LARGEST_RANGE)
        check_number("loss_probability", self.loss_probability, minimum=0, maximum=1)
        for name in ("state", "goal", "occlusion"):
            if not isinstance(getattr(self, name), bool):
                raise InvalidValueError(f"{name} is {shortened(getattr(self, name))}; expected True or False")
        if not (self.state or self.goal):
            raise InvalidValueError("Radio broadcasts neither state nor goal; for no communication use None instead")
        object.__setattr__(self, "beacons", _checked_beacons(self.beacons))
        if self.beacons and not self.goal:
            raise InvalidValueError("beacons broadcast goals, but goal is False; leave one of them out")


def _checked_beacons(beacons: object) -> tuple[tuple[float, float], ...]:
    try:
        points = [(x, y) for x, y in beacons]  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise InvalidValueError(f"beacons is {shortened(beacons)}; expected positions (x, y)") from None
    if len(points) > MOST_BEACONS:
        raise InvalidValueError(f"beacons has {len(points)} of them; expected at most {MOST_BEACONS}")
    return tuple((check_number("beacon's x", x), check_number("beacon's y", y)) for x, y in points)
