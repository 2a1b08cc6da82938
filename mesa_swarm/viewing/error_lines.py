"""Errors on pages and in notebooks: there one line with the place, in the terminal the traceback, once."""

import sys
import threading
import traceback

from mesa_swarm.base.errors import SwarmError, error_line, locate_error, place_of_error

# Different tracebacks after which those that were printed before are printed anew.
MOST_KNOWN = 1000
_printed: set[tuple[str, str]] = set()
_lock = threading.Lock()


def reported(error: BaseException) -> str:
    """Return the line about an error that a page shows, see `locate_error`; print its traceback unless that was done.

    Of a value that we refuse nothing is printed, unless it came from a user's code: only then a program has to change.

    Examples
    --------
    >>> reported(SwarmError("n_robots is 0; expected at least 1"))
    'n_robots is 0; expected at least 1'
    """
    if place_of_error(error) or not isinstance(error, SwarmError):
        _print_once(error)
    return locate_error(error)


def _print_once(error: BaseException) -> None:
    about = place_of_error(error), error_line(error)
    with _lock:
        if about in _printed:
            return
        if len(_printed) >= MOST_KNOWN:
            _printed.clear()
        _printed.add(about)
    print_traceback(error)


def print_traceback(error: BaseException) -> None:
    """Print the traceback of an error in the terminal, in one piece."""
    print("".join(traceback.format_exception(error)), end="", file=sys.stderr, flush=True)
