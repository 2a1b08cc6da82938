"""Radio: what robots broadcast, its range, and what blocks it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mesa_swarm.base.errors import InvalidValueError, check_count, check_number, shortened
from mesa_swarm.robots.devices import MOST_NUMBERS, check_identifier
from mesa_swarm.robots.sensors import LARGEST_RANGE

MOST_BEACONS = 10_000
MOST_HEARD = 1000
# What is known of every message that is heard, and the columns of what is sent and heard.
OF_HEARD = ("n", "range", "bearing")
SEND, HEARD = "send.", "heard."


@dataclass(frozen=True, kw_only=True, slots=True)
class Radio:
    """How robots broadcast to all robots near them: state, goals, custom messages, or several of these.

    State is which layer drives a robot and which task it has; its hearers also know where it is. A goal is
    a position. With state a robot can go to where another is at work, with goals to what that one works at.

    A message is named numbers. A rule assigns ``me.send.count = 3.0``, and hears ``me.heard.count[j]`` of the j-th
    nearest of ``me.heard.n`` robots, which is ``me.heard.range[j]`` away at ``me.heard.bearing[j]`` (rad, from its
    heading); beyond those it reads NaN. A number that is not set is NaN, and a robot that has set none in its last
    decision sends nothing.

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
    message : dict of name and width, or sequence of names
        What messages hold: of each name one number, or an array of so long a width, 1 to 10,000.
    most : int
        How many messages a robot hears at most, the nearest, of equally near ones that of the robot added first; 1 to
        1000.

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
    >>> Radio(message={"count": 1, "vector": 2}).message
    (('count', 1), ('vector', 2))
    """

    range: float = 100.0
    state: bool = True
    goal: bool = True
    occlusion: bool = False
    loss_probability: float = 0.0
    beacons: Sequence[tuple[float, float]] = ()
    message: Any = ()
    most: int = 8

    def __post_init__(self) -> None:
        """Check every value."""
        check_number("range", self.range, minimum=0, maximum=LARGEST_RANGE)
        check_number("loss_probability", self.loss_probability, minimum=0, maximum=1)
        for name in ("state", "goal", "occlusion"):
            if not isinstance(getattr(self, name), bool):
                raise InvalidValueError(f"{name} is {shortened(getattr(self, name))}; expected True or False")
        object.__setattr__(self, "message", _check_message(self.message))
        check_count("most", self.most, minimum=1, maximum=MOST_HEARD)
        if not (self.state or self.goal or self.message):
            raise InvalidValueError(
                "Radio broadcasts neither state nor goal nor a message; for no communication use None instead"
            )
        object.__setattr__(self, "beacons", _check_beacons(self.beacons))
        if self.beacons and not self.goal:
            raise InvalidValueError("beacons broadcast goals, but goal is False; leave one of them out")

    def columns(self) -> dict[str, tuple[tuple, type, object]]:
        """Return the columns of a swarm that messages need: shape, type, value at first."""
        if not self.message:
            return {}
        most = (int(self.most),)
        sent: dict[str, tuple] = {f"{SEND}{name}": _shape(width) for name, width in self.message}
        senders: dict[str, tuple] = {f"{HEARD}{name}": most for name in OF_HEARD[1:]}
        heard: dict[str, tuple] = {f"{HEARD}{name}": most + _shape(width) for name, width in self.message}
        reals = {name: (shape, np.float64, math.nan) for name, shape in {**sent, **senders, **heard}.items()}
        return {f"{HEARD}{OF_HEARD[0]}": ((), np.int64, 0), **reals}


def _shape(width: int) -> tuple[int, ...]:
    return (width,) if width > 1 else ()


def _check_message(message: object) -> tuple[tuple[str, int], ...]:
    """Return names and widths; a sequence of names stands for widths of 1."""
    try:
        pairs = list(message.items()) if isinstance(message, Mapping) else list(message)  # type: ignore[call-overload]
        pairs = [(pair, 1) if isinstance(pair, str) else (pair[0], pair[1]) for pair in pairs]
    except (TypeError, IndexError):
        pairs = [None] if message else []
    if isinstance(message, (str, bytes)) or None in pairs:
        raise InvalidValueError(f"message is {shortened(message)}; expected names, such as ('count', 'mood')")
    names = [check_identifier("name in message", name, OF_HEARD) for name, _ in pairs]
    if len(set(names)) < len(names):
        raise InvalidValueError(f"message is {shortened(message)}; expected each name once")
    widths = [check_count(f"width of {name} in message", w, minimum=1, maximum=MOST_NUMBERS) for name, w in pairs]
    return tuple(zip(names, widths, strict=True))


def _check_beacons(beacons: object) -> tuple[tuple[float, float], ...]:
    try:
        points = [(x, y) for x, y in beacons]  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise InvalidValueError(f"beacons is {shortened(beacons)}; expected positions (x, y)") from None
    if len(points) > MOST_BEACONS:
        raise InvalidValueError(f"beacons has {len(points)} of them; expected at most {MOST_BEACONS}")
    return tuple((check_number("beacon's x", x), check_number("beacon's y", y)) for x, y in points)
