"""Files that are handed to the browser through a widget, piece by piece."""

import threading
from collections.abc import Generator
from pathlib import Path

import anywidget

PIECE = 1_000_000
TYPES = {
    ".png": "image/png",
    ".svg": "image/svg+xml",
    ".gif": "image/gif",
    ".mp4": "video/mp4",
    ".html": "text/html",
    ".csv": "text/csv",
}


# Each with whether it is the last one.
Pieces = Generator[tuple[bytes, bool], None, None]


class Downloads:
    """Sends files; the next piece of one goes when the browser asks for it.

    Parameters
    ----------
    widget : AnyWidget
        Whose module has `Downloads` of downloads.js.

    Examples
    --------
    >>> list(pieces_of(b"abcde", 2))
    [(b'ab', False), (b'cd', False), (b'e', True)]
    """

    def __init__(self, widget: anywidget.AnyWidget) -> None:
        self._widget = widget
        self._lock = threading.Lock()
        self._open: dict[int, tuple[str, Pieces]] = {}
        self._number = 0

    def send(self, name: str, content: bytes | Path) -> None:
        """Hand over a file under a name."""
        with self._lock:
            self._number += 1
            number = self._number
            self._open[number] = name, pieces_of(content, PIECE)
        self.hear({"do": "more", "value": number})

    def hear(self, message: dict) -> bool:
        """Send the next piece, if that is what is asked for; return whether it was."""
        if message.get("do") != "more":
            return False
        with self._lock:
            number = message.get("value")
            if number not in self._open:
                return True
            name, pieces = self._open[number]
            piece, last = next(pieces)
            if last:
                pieces.close()
                del self._open[number]
        kind = TYPES.get(Path(name).suffix, "application/octet-stream")
        self._widget.send({"kind": "file", "number": number, "name": name, "type": kind, "last": last}, [piece])
        return True

    def close(self) -> None:
        """Let go of what was not asked for."""
        with self._lock:
            for _, pieces in self._open.values():
                pieces.close()
            self._open.clear()


def pieces_of(content: bytes | Path, size: int) -> Pieces:
    """Yield the pieces of bytes or of a file, and whether each is the last one."""
    if isinstance(content, bytes):
        for start in range(0, max(len(content), 1), size):
            yield content[start : start + size], start + size >= len(content)
        return
    with content.open("rb") as file:
        piece = file.read(size)
        while True:
            following = file.read(size)
            yield piece, not following
            if not following:
                return
            piece = following
