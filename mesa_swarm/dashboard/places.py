"""How many pages may be open at the same time: each has a model of its own in memory."""

import threading
from collections.abc import Callable

MOST_PAGES = 40


class Places:
    """Places that are taken and given back.

    Parameters
    ----------
    most : int

    Examples
    --------
    >>> places = Places(1)
    >>> leave = places.take()
    >>> places.take() is None
    True
    >>> leave()
    >>> places.taken
    0
    """

    def __init__(self, most: int = MOST_PAGES) -> None:
        self.most = most
        self._holders: set[object] = set()
        self._lock = threading.Lock()

    @property
    def taken(self) -> int:
        """How many are taken."""
        return len(self._holders)

    def take(self) -> Callable[[], None] | None:
        """Take a place, and return what gives it back, however often called; None if there is none."""
        holder = object()
        with self._lock:
            if len(self._holders) >= self.most:
                return None
            self._holders.add(holder)

        def leave() -> None:
            with self._lock:
                self._holders.discard(holder)

        return leave
