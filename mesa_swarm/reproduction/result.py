"""What came of one result of the thesis: checks, a verdict computed from them, pictures."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from matplotlib.figure import Figure

from mesa_swarm.errors import check_choice
from mesa_swarm.experiments.tables import csv_text

# Of a check: the data say so, they do not settle it, they say the opposite.
HOLDS, UNSETTLED, FAILS = "holds", "unsettled", "fails"
OUTCOMES = (HOLDS, UNSETTLED, FAILS)
CONFIRMED, LIMITED, NOT_CONFIRMED = "confirmed", "confirmed with limits", "not confirmed"
VERDICTS = (CONFIRMED, LIMITED, NOT_CONFIRMED)
HEADER = ("claim", "the thesis", "here", "criterion", "outcome")


@dataclass(frozen=True, kw_only=True, slots=True)
class Check:
    """One claim of the thesis beside what came out.

    Parameters
    ----------
    claim : str
        What is claimed.
    reported : str
        What the thesis reports of it.
    measured : str
        What came out.
    criterion : str
        When it holds.
    outcome : str
        "holds", "unsettled" or "fails".
    main : bool
        Whether the result stands and falls with it.

    Examples
    --------
    >>> Check(claim="a", reported="1", measured="1", criterion="equal", outcome="holds").main
    True
    """

    claim: str
    reported: str
    measured: str
    criterion: str
    outcome: str
    main: bool = True

    def __post_init__(self) -> None:
        """Check the outcome."""
        check_choice("outcome", self.outcome, OUTCOMES)

    @property
    def row(self) -> tuple[str, ...]:
        """The check as a row of a table."""
        return self.claim, self.reported, self.measured, self.criterion, self.outcome


@dataclass(frozen=True, kw_only=True, slots=True)
class Result:
    """What came of one result of the thesis.

    Parameters
    ----------
    checks : tuple of Check
        At least one of them a main one.
    pictures : dict of matplotlib Figure
        The result's own under "", others by a word.
    settings : str
        Of what was run, in words: what the thesis leaves open and we have chosen.
    remarks : tuple of str
        What else came out.
    """

    checks: tuple[Check, ...]
    pictures: dict[str, Figure]
    settings: str
    remarks: tuple[str, ...] = field(default=())

    @property
    def verdict(self) -> str:
        """Confirmed, confirmed with limits, or not confirmed: see `verdict`."""
        return verdict(self.checks)

    @property
    def limits(self) -> list[str]:
        """The claims that do not hold."""
        return [check.claim for check in self.checks if check.outcome != HOLDS]

    def csv(self) -> str:
        """Return the checks for other programs."""
        return csv_text([(*HEADER, "main"), *((*check.row, check.main) for check in self.checks)])


def verdict(checks: Iterable[Check]) -> str:
    """Return what follows from checks: nothing but their outcomes counts.

    Confirmed if all hold; not confirmed if a main one does not; else confirmed with limits.

    Examples
    --------
    >>> same = dict(claim="a", reported="1", measured="2", criterion="equal")
    >>> verdict([Check(**same, outcome="holds"), Check(**same, outcome="fails", main=False)])
    'confirmed with limits'
    >>> verdict([Check(**same, outcome="unsettled")])
    'not confirmed'
    """
    listed = list(checks)
    if all(check.outcome == HOLDS for check in listed):
        return CONFIRMED
    return LIMITED if all(check.outcome == HOLDS for check in listed if check.main) else NOT_CONFIRMED
