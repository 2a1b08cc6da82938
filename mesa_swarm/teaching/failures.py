"""What went wrong with an answer, as one sentence and never as a traceback."""

import linecache
import traceback
from pathlib import Path

from mesa_swarm.errors import SwarmError, shortened

PACKAGE = str(Path(__file__).parent.parent)
LIBRARIES = ("site-packages", "dist-packages", "<frozen")


def in_words(error: BaseException) -> str:
    """Return in one sentence what an error says, and at which line of the learner's own code it happened.

    Examples
    --------
    >>> in_words(ZeroDivisionError("division by zero"))
    'it stopped with ZeroDivisionError: division by zero'
    """
    message = " ".join(str(error).split())
    if isinstance(error, SwarmError):
        return message
    line = own_line(error)
    where = f", at the line: {line}" if line else ""
    return f"it stopped with {type(error).__name__}: {message or 'no more is known'}{where}"


def own_line(error: BaseException) -> str:
    """Return the last line of code that is the learner's own on the way to an error, "" if there is none."""
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        foreign = frame.filename.startswith(PACKAGE) or any(part in frame.filename for part in LIBRARIES)
        line = (frame.line or linecache.getline(frame.filename, frame.lineno or 0)).strip()
        if line and not foreign:
            return line
    return ""


def is_missing(answer: object) -> bool:
    """Tell whether an answer is only a place for one: None or dots.

    Examples
    --------
    >>> is_missing(...), is_missing(0)
    (True, False)
    """
    return answer is None or answer is ...


def told(what: str, got: object, expected: str) -> str:
    """Return one sentence: what was got and what was expected.

    Examples
    --------
    >>> told("your answer", "ten", "a number")
    "your answer is 'ten'; expected a number"
    """
    return f"{what} is {shortened(got)}; expected {expected}"
