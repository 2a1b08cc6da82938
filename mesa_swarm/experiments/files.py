"""Results on disk: files appear whole or not at all, and folders are tried before the work begins."""

import os
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryFile

from mesa_swarm.errors import InvalidValueError, shortened


def check_writable(folder: str | os.PathLike[str]) -> Path:
    """Return a folder in which files can be written, or say why they cannot; nothing stays behind.

    Raises
    ------
    InvalidValueError
        If it cannot be created or written to.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as home:
    ...     folder = check_writable(Path(home) / "new")
    ...     folder.name, folder.exists()
    ('new', False)
    """
    path = Path(folder)
    missing: list[Path] = []
    try:
        missing = [part for part in (path, *path.parents) if not part.exists()]
        path.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=path):
            return path
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        reason = getattr(error, "strerror", None) or error
        raise InvalidValueError(
            f"results cannot be written to {shortened(str(path))}: {reason}; choose another folder"
        ) from None
    finally:
        _remove_empty(missing)


def checked_file(path: Path, ending: str, name: str = "out") -> Path:
    """Return where a file goes if it can be written there, and its name ends as it should.

    Parameters
    ----------
    path : Path
    ending : str
        Such as ".png".
    name : str
        Of what was typed.

    Raises
    ------
    InvalidValueError

    Examples
    --------
    >>> checked_file(Path("a.jpg"), ".png")
    Traceback (most recent call last):
    mesa_swarm.errors.InvalidValueError: out is 'a.jpg'; expected the name of a .png file
    """
    if path.suffix.lower() != ending or path.is_dir():
        what = ", which is a folder" if path.is_dir() else ""
        raise InvalidValueError(f"{name} is {shortened(str(path))}{what}; expected the name of a {ending} file")
    check_writable(path.parent)
    return path


def write_whole(path: Path, content: str | bytes) -> Path:
    """Write a file under another name in its folder, then rename it: readers see the old one or the new.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as home:
    ...     write_whole(Path(home) / "a" / "b.txt", "all of it").read_text()
    'all of it'
    """
    with draft_of(path) as draft:
        draft.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@contextmanager
def draft_of(path: Path) -> Iterator[Path]:
    """Yield another name in a file's folder; what was written there gets the file's name if nothing goes wrong.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as home:
    ...     with draft_of(Path(home) / "b.txt") as draft:
    ...         length = draft.write_text("all of it")
    ...     [path.name for path in Path(home).iterdir()]
    ['b.txt']
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    draft = path.with_name(f".{uuid.uuid4().hex}.draft")
    try:
        yield draft
        os.replace(draft, path)
    finally:
        with suppress(OSError):  # else it would hide why writing failed
            draft.unlink(missing_ok=True)


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        try:
            folder.rmdir()
        except (OSError, ValueError):
            return
