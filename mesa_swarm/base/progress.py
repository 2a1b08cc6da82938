"""A progress bar that shows the time left and the time of day at which the work will be done.

Where it cannot be seen to move, as in a file or a pipe, there is one line at the end instead, see `work_done`.
"""

import io
import sys
from datetime import datetime, timedelta
from time import perf_counter

from tqdm import tqdm
from tqdm.std import TqdmDefaultWriteLock

from mesa_swarm.base.work_line import WorkDone, is_drawn, report_work

LAYOUT = "{desc}{percentage:3.0f} % |{bar:30}| {n_fmt}/{total_fmt} {unit}, {remaining} left, {finishing}"


class _Nowhere(io.StringIO):
    """A stream that keeps nothing."""

    def write(self, text: str) -> int:
        return len(text)


class Progress(tqdm):
    """tqdm with one more field, ``finishing``: when it will be done, by the wall clock."""

    # When the work began, if one line is printed at the end instead of a bar.
    unseen_since: float | None = None
    remark = ""
    _noted_at = 0.0

    def note(self, text: str) -> None:
        """Show a text in place of the bar until the next unit of work is done; with "" the bar again."""
        self.remark, self._noted_at = text, self.n
        self.refresh()

    def close(self) -> None:
        """End the bar."""
        if self in _SHOWN:
            _SHOWN.remove(self)
        super().close()
        if self.unseen_since is not None:
            report_work(WorkDone(self.unit, self.n, self.total, self.initial), self.unseen_since)
            self.unseen_since = None

    @property
    def format_dict(self) -> dict:
        """What the layout may show."""
        values = super().format_dict
        if self.remark and self.n == self._noted_at:
            return values | {"bar_format": "{remark}", "remark": self.remark}
        rate = values["rate"] or (self.n - self.initial) / max(values["elapsed"], 1e-9)
        values["finishing"] = finishing_time(self.total - self.n, rate, datetime.now())
        return values


# tqdm's own lock is one between processes as well, for which Python starts another process.
Progress.set_lock(TqdmDefaultWriteLock.th_lock)
# The bars that are shown now, the innermost last.
_SHOWN: list[Progress] = []


def note(text: str) -> None:
    """Show a text in place of the innermost bar, if any is shown: why no work is done for a while.

    Examples
    --------
    >>> note("compiling")  # there is no bar
    """
    if _SHOWN:
        _SHOWN[-1].note(text)


def notice(text: str) -> None:
    """Print a line to standard error, above the bar if one is shown.

    Examples
    --------
    >>> notice("no worker is connected")  # to standard error
    """
    Progress.write(f"mesa-swarm: {text}", file=sys.stderr)


def finishing_time(remaining: int, rate: float, now: datetime) -> str:
    """Return when the work left is done at this rate a second."""
    if rate <= 0 or remaining / rate > 1e9:
        return "measuring"
    end = now + timedelta(seconds=remaining / rate)
    return f"done at {end:%H:%M:%S}" if end.date() == now.date() else f"done on {end:%d %b} at {end:%H:%M}"


def progress_bar(total: int, unit: str, is_shown: bool, layout: str = LAYOUT) -> Progress:
    """Return a bar for `total` units of work; call its ``update``, and ``close`` at the end."""
    file = None if is_drawn() else _Nowhere()
    bar = Progress(total=total, unit=unit, disable=not is_shown, bar_format=layout, mininterval=0.2, file=file)
    if is_shown:
        _SHOWN.append(bar)
        bar.unseen_since = perf_counter() if file else None
    return bar
