"""Errors of real sensors and wheels: one schema for all of them, and a dial from 0 to 1."""

from dataclasses import dataclass, fields, replace
from functools import reduce
from typing import Any

from mesa_swarm.base.errors import InvalidValueError, check_count, check_number, shortened
from mesa_swarm.kernels.elementary import hypot
from mesa_swarm.robots.design import RobotDesign
from mesa_swarm.robots.sensors import LONGEST_HOLD, ProximitySensor

LONGEST_LAG, LARGEST_ERROR = 1e6, 10.0
PROBABILITIES = ("failure", "sensor_failure", "wheel_failure", "slip_probability")


@dataclass(frozen=True, kw_only=True, slots=True)
class Imperfection:
    """Error of one value between sensor and controller, or between controller and wheel.

    In a step, the value is lost with probability `dropout` (a sensor sees nothing, a wheel stands); with probability
    `outliers` it is replaced by any value within the range; else the value x becomes
    ``x (1 + error z)``, z from a normal distribution, within the range.

    Parameters
    ----------
    error : float
        Standard deviation, as a share of the value, 0 to 10.
    dropout, outliers : float
        Probabilities, 0 to 1, together at most 1.
    hold : int
        Steps for which chance stays as it was drawn, at least 1.
    period : int
        Steps from one fresh value to the next, which stays meanwhile, at least 1.
    lag : float
        Steps in which a value comes within 1 / e of what it should be, 0 for at once: y += (x - y)(1 - e^(-1 / lag)).
        Of wheels only: a reading that comes late has a `period`.

    Raises
    ------
    InvalidValueError
        If a value is out of its range.

    Examples
    --------
    >>> Imperfection(error=0.03).at(0.5).error
    0.015
    """

    error: float = 0.0
    dropout: float = 0.0
    outliers: float = 0.0
    hold: int = 1
    period: int = 1
    lag: float = 0.0

    def __post_init__(self) -> None:
        """Check every value."""
        check_number("error", self.error, minimum=0, maximum=LARGEST_ERROR)
        dropout = check_number("dropout", self.dropout, minimum=0, maximum=1)
        outliers = check_number("outliers", self.outliers, minimum=0, maximum=1)
        check_number("dropout + outliers", dropout + outliers, maximum=1)
        check_count("hold", self.hold, minimum=1, maximum=LONGEST_HOLD)
        check_count("period", self.period, minimum=1, maximum=LONGEST_HOLD)
        check_number("lag", self.lag, minimum=0, maximum=LONGEST_LAG)

    def at(self, dial: float) -> "Imperfection":
        """Return the imperfection at a place of the dial: shares and lag in proportion, whole steps rounded."""
        steps = {name: 1 + round((int(getattr(self, name)) - 1) * dial) for name in ("hold", "period")}
        shares = {name: float(getattr(self, name)) * dial for name in ("error", "dropout", "outliers", "lag")}
        changes: dict[str, Any] = {**steps, **shares}
        return replace(self, **changes)

    @property
    def limits(self) -> tuple[float, float, float, int, int, float]:
        """All values, as the compiled functions take them."""
        return (
            float(self.error), float(self.dropout), float(self.outliers), int(self.hold), int(self.period),
            float(self.lag),
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True, slots=True)
class Imperfections:
    """How far robots are from ideal ones.

    Parameters
    ----------
    sensing : Imperfection
        Of every proximity, radiation and line sensor. What line sensors read is yes or no: it has no `error`, and
        an outlier is either. Of custom sensors each number for itself, within `Sensor.minimum` and `Sensor.maximum`,
        unless `Sensor.spoiled` is False; what is lost reads NaN.
    driving : Imperfection
        Of every wheel.
    battery : float
        Steps at full speed that a charge lasts, after which a robot stands for good; 0 for a charge without end.
    failure : float
        Probability in each step that a robot breaks down and stands for good, 0 to 1.
    sensor_failure, wheel_failure : float
        Probabilities, in each step for each sensor and each wheel, that it fails for good: a sensor reads nothing, a
        wheel is stuck; see `Robot.fail`.
    slip_probability, slip_magnitude : float
        In each step each wheel loses, with this probability, this share of the speed at which it rolls; both 0 to 1.

    Raises
    ------
    InvalidValueError
        If a value is out of its range, or readings are to lag.

    Examples
    --------
    >>> MEASURED.at(0) is None, MEASURED.at(1) == MEASURED
    (True, True)
    """

    sensing: Imperfection = Imperfection()
    driving: Imperfection = Imperfection()
    battery: float = 0.0
    failure: float = 0.0
    sensor_failure: float = 0.0
    wheel_failure: float = 0.0
    slip_probability: float = 0.0
    slip_magnitude: float = 0.5

    def __post_init__(self) -> None:
        """Check every value."""
        for name in ("sensing", "driving"):
            imperfection = getattr(self, name)
            if not isinstance(imperfection, Imperfection):
                raise InvalidValueError(f"{name} is {shortened(imperfection)}; expected Imperfection(...)")
        if self.sensing.lag:
            raise InvalidValueError(f"lag of sensing is {self.sensing.lag}; expected 0: late readings have a period")
        check_number("battery", self.battery, minimum=0, maximum=1e12)
        for name in (*PROBABILITIES, "slip_magnitude"):
            check_number(name, getattr(self, name), minimum=0, maximum=1)

    def at(self, dial: float) -> "Imperfections | None":
        """Return the imperfections at a place of the dial; None, which costs nothing, where there are none.

        Parameters
        ----------
        dial : float
            0 for ideal robots, 1 for these, between them in proportion; a charge lasts 1 / dial times as long.

        Raises
        ------
        InvalidValueError
        """
        share = check_number("dial", dial, minimum=0, maximum=1)
        if share == 0:
            return None
        imperfections = Imperfections(
            sensing=self.sensing.at(share),
            driving=self.driving.at(share),
            battery=float(self.battery) / share,
            slip_magnitude=self.slip_magnitude,
            **{name: float(getattr(self, name)) * share for name in PROBABILITIES},
        )
        return None if changes_nothing(imperfections) else imperfections


# Of the Robotarium's robots: seven distance sensors, 3 % error, 3.5 % dropout, 1.4 % outliers.
ROBOTARIUM = Imperfections(sensing=Imperfection(error=0.03, dropout=0.035, outliers=0.014))
# All errors at once, of the order of those of small robots: a choice, not a measurement of one robot.
MEASURED = Imperfections(
    sensing=Imperfection(error=0.03, dropout=0.035, outliers=0.014, hold=2, period=2),
    driving=Imperfection(error=0.05, dropout=0.02, lag=2.0),
    battery=20_000.0,
    failure=1e-5,
)
PRESETS = {"measured": MEASURED, "robotarium": ROBOTARIUM}
ROBOTARIUM_ROBOT = RobotDesign(
    name="ROBOTARIUM_ROBOT",
    sensors=tuple(
        ProximitySensor(bearing_degrees=b, field_of_view_degrees=25) for b in (0, 35, -35, 75, -75, 140, -140)
    ),
)


def is_ideal(defect: Imperfection) -> bool:
    """Return whether an imperfection changes nothing; how long errors are held does not matter where there are none."""
    return all(getattr(defect, field.name) == field.default for field in fields(defect) if field.name != "hold")


def changes_nothing(imperfections: Imperfections) -> bool:
    """Return whether robots are ideal: by how much wheels slip does not matter where they never do."""
    return replace(imperfections, slip_magnitude=Imperfections().slip_magnitude) == Imperfections()


def combine_imperfections(*sources: Imperfections | None) -> Imperfections | None:
    """Return the imperfections of robots with several independent ones; None for none.

    Relative errors add as variances, probabilities as those of independent events, lags add up; the shorter charge and
    the longer period count, and of slipping wheels the larger loss.

    Examples
    --------
    >>> both = combine_imperfections(ROBOTARIUM, Imperfections(sensing=Imperfection(error=0.04), slip_probability=0.1))
    >>> round(both.sensing.error, 3), both.slip_probability
    (0.05, 0.1)
    >>> combine_imperfections(None, Imperfections()) is None
    True
    """
    effective = [source for source in sources if source is not None and not changes_nothing(source)]
    return reduce(_combine_two, effective) if effective else None


def _combine_two(a: Imperfections, b: Imperfections) -> Imperfections:
    return Imperfections(
        sensing=_combine_parts(a.sensing, b.sensing),
        driving=_combine_parts(a.driving, b.driving),
        battery=min(charges) if (charges := [part for part in (a.battery, b.battery) if part]) else 0.0,
        slip_magnitude=max((part.slip_magnitude for part in (a, b) if part.slip_probability), default=b.slip_magnitude),
        **{name: _probability_of_either(getattr(a, name), getattr(b, name)) for name in PROBABILITIES},
    )


def _combine_parts(a: Imperfection, b: Imperfection) -> Imperfection:
    dropout = _probability_of_either(a.dropout, b.dropout)
    return Imperfection(
        error=min(hypot(a.error, b.error), LARGEST_ERROR),
        dropout=dropout,
        outliers=min(_probability_of_either(a.outliers, b.outliers), 1.0 - dropout),
        hold=max(a.hold, b.hold),
        period=max(a.period, b.period),
        lag=min(a.lag + b.lag, LONGEST_LAG),
    )


def _probability_of_either(p: float, q: float) -> float:
    """Return the probability of at least one of two independent events; exactly the other where one is 0."""
    return p + q - p * q
