"""Lines that fit the terminal: text is wrapped, tables are made narrower, letters that it lacks are replaced.

Elsewhere nothing is shortened.
"""

import codecs
import os
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from mesa_swarm.base.wording import in_plain_letters

__all__ = ["print_lines", "terminal_width"]

# The name under which Python knows how letters are replaced.
REPLACED = "mesa_swarm.plain"

# Narrower than this, no more is done: words are longer.
NARROWEST = 40


def _replaced(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return in_plain_letters(error.object[error.start : error.end]), error.end


codecs.register_error(REPLACED, _replaced)


@contextmanager
def any_letters() -> Iterator[None]:
    """Let text of any letters be printed, whatever standard output and standard error can show.

    Windows writes redirected output in the letters of one region: a Greek one would end a command in the middle.
    """
    streams: list[Any] = [stream for stream in (sys.stdout, sys.stderr) if hasattr(stream, "reconfigure")]
    before = [stream.errors for stream in streams]
    for stream in streams:
        if stream.errors != "surrogateescape" or "utf" not in stream.encoding.lower():  # else it prints all there is
            stream.reconfigure(errors=REPLACED)
    try:
        yield
    finally:
        for stream, errors in zip(streams, before, strict=True):
            stream.reconfigure(errors=errors)


def terminal_width() -> int | None:
    """Return how many columns standard output has: `COLUMNS` if it is set, else the terminal's; None for others."""
    given = os.environ.get("COLUMNS", "")
    stream = sys.stdout
    if not (given.isdecimal() and int(given)) and not (stream and stream.isatty()):
        return None
    return max(shutil.get_terminal_size().columns, NARROWEST)


def print_lines(lines: Iterable[str], indent: int = 4) -> None:
    """Print lines, each as soon as it is known; those that are wider than the terminal are wrapped, see `wrapped`."""
    width = terminal_width()
    for text in lines:
        for line in text.splitlines() or [""]:
            print("\n".join(wrapped(line, width, indent)), flush=True)


def wrapped(line: str, width: int | None, indent: int = 4) -> list[str]:
    """Return a line as several of at most this width, of which all but the first are indented further.

    Words are never broken: a path stays whole, even if it is wider.

    Examples
    --------
    >>> wrapped("  n_robots=5   how many robots there are", 24, 10)
    ['  n_robots=5   how many', '            robots there', '            are']
    """
    if width is None or len(line) <= width:
        return [line]
    start = len(line) - len(line.lstrip())
    hanging = " " * min(start + indent, width // 2)
    whole = textwrap.TextWrapper(
        width=width, subsequent_indent=hanging, break_long_words=False, break_on_hyphens=False, drop_whitespace=True
    )
    return whole.wrap(line) or [line]
