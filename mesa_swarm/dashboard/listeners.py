"""Who is told when something changed."""

import threading
from collections.abc import Callable

import solara


class Listeners:
    """Functions that are called with whatever is told.

    Attributes
    ----------
    told : int
        How often anything was told, also when nobody listened.

    Never tell while holding a lock: a listener may draw a page, whose own lock somebody holds who waits for yours.

    Examples
    --------
    >>> heard, listeners = [], Listeners()
    >>> leave = listeners.add(heard.append)
    >>> listeners.tell("hello")
    >>> leave()
    >>> listeners.tell("still there?")
    >>> heard
    ['hello']
    >>> listeners.told
    2
    """

    def __init__(self) -> None:
        self._functions: list[Callable] = []
        self._lock = threading.Lock()
        self.told = 0

    def __len__(self) -> int:
        return len(self._functions)

    def add(self, function: Callable) -> Callable[[], None]:
        """Call a function from now on, until what is returned is called."""
        with self._lock:
            self._functions = [*self._functions, function]

        def leave() -> None:
            with self._lock:
                self._functions = [other for other in self._functions if other is not function]

        return leave

    def tell(self, *news: object) -> None:
        """Call all, in the order in which they came."""
        with self._lock:
            self.told += 1
            functions = self._functions
        for function in functions:
            function(*news)

    def clear(self) -> None:
        """Forget all."""
        with self._lock:
            self._functions = []


def use_changes(listeners: Listeners) -> int:
    """Draw a Solara component anew whenever these listeners are told; return how often that was."""
    count, set_count = solara.use_state(0)
    drawn = solara.use_memo(lambda: listeners.told, [listeners])

    def hear(*_: object) -> None:
        set_count(lambda n: n + 1)

    def listen() -> Callable[[], None]:
        leave = listeners.add(hear)
        if listeners.told != drawn:  # before anybody heard it, but after the component had looked
            hear()
        return leave

    solara.use_effect(listen, [listeners])
    return count
