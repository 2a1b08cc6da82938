"""A file that comes in pieces, in a folder of its own that is deleted with it."""

from pathlib import Path, PureWindowsPath
from tempfile import TemporaryDirectory

from mesa_swarm.files import unwritable

# So many letters of a name are kept: no file system is asked for more bytes than it can take.
LONGEST_NAME = 60


class Incoming:
    """A file that somebody hands over, piece by piece.

    Parameters
    ----------
    name : str
        What its owner calls it.

    Attributes
    ----------
    path : Path
        Where it is; it is called there nearly as its owner calls it, for errors name the file that they found.

    Examples
    --------
    >>> incoming = Incoming("run.arrow")
    >>> incoming.take(b"abc")
    3
    >>> incoming.end()
    >>> incoming.path.name, incoming.path.read_bytes()
    ('run.arrow', b'abc')
    >>> incoming.discard()
    >>> incoming.path.exists()
    False
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self._folder = TemporaryDirectory(prefix="mesa_swarm_", ignore_cleanup_errors=True)
        self.path = Path(self._folder.name, harmless(name))
        self._file = self.path.open("wb", buffering=0)  # else a full disk would be noticed at the end

    def take(self, piece: bytes) -> int:
        """Take the next piece; return how many bytes have come.

        Raises
        ------
        InvalidValueError
            If the disk does not take it.
        """
        left = memoryview(piece)
        try:
            while left:
                left = left[self._file.write(left) :]
        except OSError as error:
            raise unwritable(Path(self.name), error, cure="the server's disk is full or broken") from None
        return self._file.tell()

    def end(self) -> None:
        """Take note that all has come."""
        self._file.close()

    def discard(self) -> None:
        """Delete the file, and its folder."""
        self.end()
        self._folder.cleanup()


def harmless(name: str) -> str:
    """Return a name under which a file can be kept, whatever its owner calls it.

    Examples
    --------
    >>> harmless("my run.arrow"), harmless("../../etc/passwd"), harmless("..")
    ('my run.arrow', 'passwd', 'file')
    """
    letters = [letter if letter.isalnum() or letter in " ._-()" else "_" for letter in PureWindowsPath(name).name]
    return "".join(letters)[-LONGEST_NAME:].strip(" .") or "file"
