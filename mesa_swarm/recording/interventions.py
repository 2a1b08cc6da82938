"""Interventions: what somebody changed of a model by hand, between two steps of a recorded run."""

import json
from collections.abc import Sequence
from dataclasses import dataclass

from mesa_swarm.errors import RecordingError
from mesa_swarm.recording.schema import checked_intervention

MOST_TOLD = 5


@dataclass(frozen=True, kw_only=True, slots=True)
class Intervention:
    """What was changed by hand after a step, and before the next one.

    Parameters
    ----------
    step : int
    what : tuple of str
        In words, see `Mark`.
    why_not : str
        Why the state after it was not stored; empty if it was.
    checkpoint : int or None
        Place of that state among `Recording.checkpoints`, None if there is none.

    Examples
    --------
    >>> print(Intervention(step=20, what=("control", "heading of robots")))
    after step 20 somebody changed control, heading of robots
    """

    step: int
    what: tuple[str, ...]
    why_not: str = ""
    checkpoint: int | None = None

    def __str__(self) -> str:
        return f"after step {self.step} somebody changed {', '.join(self.what)}"


def intervention_to_json(what: Sequence[str], why_not: str) -> bytes:
    """Return what a recording keeps of an intervention.

    Examples
    --------
    >>> intervention_to_json(["control"], "")
    b'{"what": ["control"], "why_not": ""}'
    """
    return json.dumps({"what": list(what), "why_not": why_not}).encode()


def intervention_from_json(step: int, content: bytes, checkpoint: int | None) -> Intervention:
    """Return the intervention that was kept.

    Raises
    ------
    RecordingError
        If it is none.
    """
    try:
        told = checked_intervention(content)
        what, why_not = tuple(told["what"]), told["why_not"]
    except ValueError:
        raise RecordingError(f"what was changed by hand after step {step} is not told") from None
    why_not = why_not or ("" if checkpoint is not None else "the recording ends before it")
    return Intervention(step=step, what=what, why_not=why_not, checkpoint=checkpoint)


def in_words(interventions: Sequence[Intervention]) -> str:
    """Return what must be said beside a verdict: nothing if nobody intervened.

    Examples
    --------
    >>> in_words([Intervention(step=20, what=("control",)), Intervention(step=30, what=("running",))])
    '; by hand were changed control after step 20, running after step 30, each time the stored state was taken'
    >>> in_words([])
    ''
    """
    if not interventions:
        return ""
    told = [f"{' and '.join(one.what)} after step {one.step}" for one in interventions[:MOST_TOLD]]
    more = len(interventions) - len(told)
    told += [f"and more after {more} other steps"] if more else []
    taken = "where the stored state was taken" if len(interventions) == 1 else "each time the stored state was taken"
    return f"; by hand were changed {', '.join(told)}, {taken}"
