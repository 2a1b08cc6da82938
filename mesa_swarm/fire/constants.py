"""The constants of the fire model, and their design from required properties."""

import math
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, field
from decimal import Decimal, localcontext

from mesa_swarm.base.errors import FireConstantsWarning, InvalidValueError, check_flag, check_number, shortened

LONGEST = 1e12
# Of the extinguishing with which one robot just holds the smallest fire: rounding must not tip the balance.
HELD = 0.95
LOG_2 = 0.6931471805599453
# Digits of a share, which has 16.
DIGITS = 40


@dataclass(frozen=True, slots=True)
class FireConstants:
    """The constants of fires and of the heat in robots (appendix B of the thesis).

    Parameters
    ----------
    k1 : float
        Growth: an unattended fire's temperature grows by k1 (T + 1) a step (B.2), above 0.
    k2 : float
        Extinguishing: each robot lowers it by k2 / A a step, above 0.
    k3 : float
        Heating: a robot at a fire takes k3 T A a step (B.5), at least 0.
    k4 : float
        Cooling: a robot loses k4 a step, at least 0.
    leave : float
        At this temperature a robot is too hot and leaves the fire (B.12), above 0.
    join : float
        At or below it, it may fight again (B.13), at least 0 and below `leave`.
    remarks : tuple of str
        Of `design_constants`.

    Examples
    --------
    >>> FireConstants(k1=0.001, k2=0.02, k3=0.08, k4=0.25, leave=250, join=150).join
    150
    """

    k1: float
    k2: float
    k3: float
    k4: float
    leave: float
    join: float
    remarks: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        """Check every value; other kinds of numbers become floats, which kernels take."""
        for name in ("k1", "k2", "k3", "k4", "leave", "join"):
            value = getattr(self, name)
            if not isinstance(value, (int, float)):
                object.__setattr__(self, name, check_number(name, value))
        check_number("k1", self.k1, above=0, maximum=1e6)
        check_number("k2", self.k2, above=0, maximum=LONGEST)
        check_number("k3", self.k3, minimum=0, maximum=1e6)
        check_number("k4", self.k4, minimum=0, maximum=1e6)
        check_number("leave", self.leave, above=0, maximum=LONGEST)
        check_number("join", self.join, minimum=0, maximum=LONGEST)
        if self.join >= self.leave:
            raise InvalidValueError(
                f"join is {self.join:g} and leave {self.leave:g}; expected join below leave, "
                "or robots would leave and return in the same step"
            )


def design_constants(
    *,
    growth_time: float = 2000.0,
    robots: float = 2.0,
    extinguish_time: float = 1600.0,
    initial_temperature: float = 1.0,
    area: float = 16.0,
    largest_area: float = 16.0,
    balance_temperature: float = 0.6,
    stay_time: float = 100.0,
    rest_time: float = 60.0,
    areas: Iterable[float] | None = None,
    alone: bool = True,
) -> FireConstants:
    """Return the constants that give fires and robots the required properties, with remarks.

    Parameters
    ----------
    growth_time : float
        Steps in which an unattended fire grows from temperature 0 to 1.
    robots, extinguish_time : float
        This many robots, at the fire all the time, put out one of `area` and `initial_temperature` in this time.
    initial_temperature : float
        Above 0, at most 1.
    area, largest_area : float
        Of that fire, and of the largest fire in the world.
    balance_temperature : float
        At this temperature of the largest fire, heating and cooling of a robot balance; 0 < T < 1.
    stay_time : float
        Steps that a cold robot can stay at the largest fire at T = 1: the shortest stay there is.
    rest_time : float
        Steps that a robot rests before it may fight again.
    areas : iterable of float or None
        Of all fires in the world, such as ``model.fires.area``: the largest is then both `area` and `largest_area`.
    alone : bool
        Whether a fire may fall to a single robot. If not, k2 is at most 0.95 k1 A (T0 + 1) for the smallest area A and
        the initial temperature T0: one robot, even at the fire all the time, cannot stop its growth.

    Returns
    -------
    FireConstants
        Its `remarks` state which fires fall to a single robot, whether one suffices for the largest, no number of
        robots can put that out, a robot must cool down completely, or fires never heat a robot. A remark about
        requirements that contradict each other is also issued as a `FireConstantsWarning`.

    Notes
    -----
    k1 = ln 2 / growth_time (B.6); k2 = (k1 A / n)(1 + T E / (E - 1)), E = exp(k1 extinguish_time) (B.9,
    corrected); k3 = 1 / (A_max (1 - T_b)) (B.11); k4 = T_b A_max k3 (B.10); leave = stay_time (B.12);
    join = max(leave - k4 rest_time, 0) (B.13).

    Examples
    --------
    >>> constants = design_constants(growth_time=1000, robots=3, extinguish_time=1000)
    >>> round(constants.k2, 5)
    0.01109

    That the smallest fire takes two robots means that the largest takes many::

    >>> constants = design_constants(areas=(2, 4, 16), robots=20, alone=False)
    >>> [round(robots_needed(constants, area), 1) for area in (2, 4, 16)]
    [1.5, 3.0, 11.9]
    """
    if areas is not None:
        all_areas = _checked_areas(areas)
        area = largest_area = max(all_areas)
    growth_time = check_number("growth_time", growth_time, above=0, maximum=LONGEST)
    robots = check_number("robots", robots, above=0, maximum=1e9)
    extinguish_time = check_number("extinguish_time", extinguish_time, above=0, maximum=LONGEST)
    initial_temperature = check_number("initial_temperature", initial_temperature, above=0, maximum=1)
    largest_area = check_number("largest_area", largest_area, above=0, maximum=LONGEST)
    area = check_number("area", area, above=0, maximum=largest_area)
    balance_temperature = check_number("balance_temperature", balance_temperature, above=0, maximum=0.999999)
    stay_time = check_number("stay_time", stay_time, above=0, maximum=LONGEST)
    rest_time = check_number("rest_time", rest_time, above=0, maximum=LONGEST)
    k1 = LOG_2 / growth_time
    share = grown_share(k1 * extinguish_time)
    least_k2 = k1 * area / robots * (1.0 + initial_temperature * share)
    held = HELD * k1 * (area if areas is None else min(all_areas)) * (initial_temperature + 1.0)
    k2 = least_k2 if check_flag("alone", alone) else min(least_k2, held)
    k3 = 1.0 / (largest_area * (1.0 - balance_temperature))
    k4 = balance_temperature * largest_area * k3
    join = max(stay_time - k4 * rest_time, 0.0)
    remark = (
        f"one robot, at a fire of T = {initial_temperature:g} all the time, puts it out if its area is below "
        f"{k2 / (k1 * (initial_temperature + 1.0)):.2f}"
    )
    too_few = (
        f"{robots:g} robots cannot put out area {area:g} in {extinguish_time:g} steps where no fire falls to one; "
        f"ask for at least {math.ceil(robots * least_k2 / k2)} robots"
    )
    warned = [too_few] if k2 < least_k2 else []
    remarks = _remarks(k1, k2, k4, largest_area, balance_temperature, stay_time, rest_time, join, warned)
    return FireConstants(k1, k2, k3, k4, stay_time, join, (remark, *remarks))


def grown_share(growth: float) -> float:
    """Return E / (E - 1) for E = exp(growth), rounded once, so that it is the same whatever the C library.

    Not by `kernels.elementary`: what lists models and their constants would wait for a compiler.

    Examples
    --------
    >>> grown_share(0.5)
    2.5414940825367984
    """
    with localcontext() as context:
        exact = Decimal(growth)
        context.prec = DIGITS + max(0, -exact.adjusted())  # as many again as cancel
        return float(1 / (1 - (-exact).exp()))


def _checked_areas(areas: Iterable[float]) -> list[float]:
    """Return the areas of fires, at least one of them."""
    try:
        values = list(areas)
    except TypeError:
        values = []
    if isinstance(areas, (str, bytes)) or not values:
        raise InvalidValueError(f"areas is {shortened(areas)}; expected the areas of all fires, such as (2, 4, 16)")
    return [check_number("each of areas", area, above=0, maximum=LONGEST) for area in values]


def robots_needed(constants: FireConstants, area: float, temperature: float = 1.0) -> float:
    """Return how many robots, at the fire all the time, just stop its growth: k1 A (T + 1) / k2.

    Examples
    --------
    >>> round(robots_needed(design_constants(), area=16), 1)
    1.2
    """
    return constants.k1 * area * (temperature + 1.0) / constants.k2


def _remarks(
    k1: float,
    k2: float,
    k4: float,
    largest_area: float,
    balance: float,
    stay: float,
    rest: float,
    join: float,
    warned: list[str],
) -> tuple[str, ...]:
    """Return what follows from the constants, and warn of what defeats their purpose; `warned` is known before."""
    robots = 2.0 * k1 * largest_area / k2
    # Hot, a robot rests until join; cold again, it can stay (leave - join) steps at least.
    away = (stay - join) / k4
    duty = (stay - join) / (stay - join + away)
    if robots <= duty:
        warned.append(
            f"one robot suffices for the largest fire at T = 1 (it takes {robots:.2f} robots, and one with its "
            f"rests counts as {duty:.2f}); ask for more robots or a longer extinguish_time"
        )
    if robots > 1000:
        warned.append(
            f"the largest fire at T = 1 takes {robots:.0f} robots: the robots cannot put it out; "
            "ask for a longer growth_time or a shorter extinguish_time"
        )
    if join == 0.0:
        warned.append(
            f"join is 0: a robot cools down completely, in {stay / k4:.0f} steps, less than the rest_time of "
            f"{rest:.0f}; ask for a longer stay_time or a shorter rest_time"
        )
    for remark in warned:
        warnings.warn(remark, FireConstantsWarning, stacklevel=3)
    start = (k2 / (k1 * largest_area)) - 1.0
    facts = (
        f"fires with area times temperature below {balance * largest_area:g} never heat a robot",
        f"the largest fire at T = 1 takes {robots:.2f} robots without rests, or {robots / duty:.2f} with rests",
        f"below T = {max(start, 0.0):.2f} a single robot puts the largest fire out, whatever the strategy",
    )
    return (*warned, *facts)
