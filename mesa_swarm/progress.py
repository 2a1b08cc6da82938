"""A progress bar that shows the time left and the time of day at which the work will be done."""

from datetime import datetime, timedelta

from tqdm import tqdm
from tqdm.std import TqdmDefaultWriteLock

LAYOUT = "{desc}{percentage:3.0f} % |{bar:30}| {n_fmt}/{total_fmt} {unit}, {remaining} left, {finishing}"


class Progress(tqdm):
    """tqdm with one more field, ``finishing``: when it will be done, by the wall clock."""

    @property
    def format_dict(self) -> dict:
        """What the layout may show."""
        shown = super().format_dict
        rate = shown["rate"] or (self.n - self.initial) / max(shown["elapsed"], 1e-9)
        shown["finishing"] = finishing_time(self.total - self.n, rate, datetime.now())
        return shown


# tqdm's own lock is one between processes as well, for which Python starts another process.
Progress.set_lock(TqdmDefaultWriteLock.th_lock)


def finishing_time(left: int, rate: float, now: datetime) -> str:
    """Return when the work left is done at this rate a second."""
    if rate <= 0 or left / rate > 1e9:
        return "measuring"
    done = now + timedelta(seconds=left / rate)
    return f"done at {done:%H:%M:%S}" if done.date() == now.date() else f"done on {done:%d %b} at {done:%H:%M}"


def progress_bar(total: int, unit: str, shown: bool) -> Progress:
    """Return a bar for `total` units of work; call its ``update``."""
    return Progress(total=total, unit=unit, disable=not shown, bar_format=LAYOUT, mininterval=0.2)
