"""The one way to write a file whole: beside its place, synced, renamed; and folders tried before the work begins."""

import errno
import os
import shutil
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from hashlib import blake2b
from io import FileIO
from itertools import count
from pathlib import Path
from tempfile import TemporaryFile
from typing import BinaryIO

from mesa_swarm.base.errors import InvalidValueError, SwarmError, shortened, without_middle

try:
    import fcntl
except ModuleNotFoundError:  # on Windows
    fcntl = None  # type: ignore[assignment]  # where it is missing, None

__all__ = ["check_apart", "check_writable", "checked_file", "write_all"]

# Bytes of a file's name that its draft's name repeats; file systems take 255 at most, some fewer.
LONGEST_NAME = 100
# Characters of a path in an error.
LONGEST_SHOWN = 120
CURE = "make room or choose another place"
# What replaces the kinds of files of RAS2D, the thesis's simulator, and of Scilab, by their endings.
SCILAB = "a Scilab file, which is not read or written; 'mesa-swarm export run.arrow table.csv' writes tables"
FORMER = {
    ".sim": "drawing commands of RAS2D, which are not read; run the model again with 'mesa-swarm run MODEL --record "
    "run.arrow' and look at it with 'mesa-swarm replay run.arrow'",
    ".job": "a job of RAS2D, which is not read; 'mesa-swarm run collision_avoidance.toml' runs a sample job",
    ".instr": "instructions of RAS2D, which are not read; see 'mesa-swarm --help'",
    ".sce": SCILAB,
    ".sci": SCILAB,
    ".sod": SCILAB,
}


def check_writable(folder: str | os.PathLike[str]) -> Path:
    """Return a folder in which files can be written, or raise why they cannot; nothing stays behind."""
    path = Path(folder)
    new_folders: list[Path] = []
    try:
        new_folders = [part for part in (path, *path.parents) if not part.exists()]
        path.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=path):
            return path
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        reason = getattr(error, "strerror", None) or error
        raise InvalidValueError(
            f"results cannot be written to '{show_path(path)}': {reason}; choose another folder"
        ) from None
    finally:
        _remove_empty(new_folders)


def checked_file(path: Path, ending: str, name: str = "out") -> Path:
    """Return where a file goes if it can be written there and has the ending, such as ".png"; `name` is the option."""
    if path.suffix.lower() != ending or path.is_dir():
        what = ", which is a folder" if path.is_dir() else ""
        raise InvalidValueError(f"{name} is {shortened(str(path))}{what}; expected the name of a {ending} file")
    check_writable(path.parent)
    try:
        checked_place(path)
    except OSError as error:
        raise unwritable(path, error) from None
    return path


def checked_place(path: Path) -> Path:
    """Return where a file is written, symbolic links followed.

    An `OSError` is raised if no file can have that name, or if a folder or something else that is not a regular file
    stands there, such as a device or a pipe, which must not be replaced.
    """
    try:
        place = path.resolve()
        mode = place.stat().st_mode
    except FileNotFoundError:
        return place
    except (ValueError, RuntimeError):  # a null byte in the name; a link that leads to itself
        raise OSError(errno.EINVAL, "no file can have that name", str(path)) from None
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, "it is a folder", str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is not a regular file", str(path))
    return place


def check_apart(
    target: Path, sources: Iterable[str | os.PathLike[str]], error: type[SwarmError] = InvalidValueError
) -> None:
    """Refuse to write to a file that is read as well, under whatever name, also if files may be replaced.

    Examples
    --------
    >>> check_apart(Path("out.toml"), ["in.toml"])  # one of them is not there
    """
    for source in sources:
        if _are_one_file(target, source):
            raise error(
                without_middle(
                    f"{show_path(target)} is the file that is read, {show_path(source)}; choose another name"
                )
            )


def _are_one_file(target: Path, source: str | os.PathLike[str]) -> bool:
    try:
        return os.path.samefile(target, source)
    except (OSError, ValueError):  # one is not there, or no file can have that name
        return False


def unwritable(path: Path, error: OSError, kind: type[SwarmError] = InvalidValueError, cure: str = CURE) -> SwarmError:
    """Return the error about a file that could not be written: its name, why, and what to do."""
    reason = error.strerror or error
    if error.errno == errno.ENOSPC:  # Arrow adds the long message of its own layers
        reason = os.strerror(errno.ENOSPC)
    return kind(f"{show_path(path)} cannot be written: {' '.join(str(reason).split())[:100]}; {cure}")


def show_path(path: str | os.PathLike[str]) -> str:
    """Return a path as errors show it: on one line, a long one by its end, where the name of the file is."""
    text = repr(os.fspath(path))[1:-1].replace("\\\\", "\\")
    return text if len(text) <= LONGEST_SHOWN else f"...{text[-LONGEST_SHOWN:]}"


def check_present_format(path: str | os.PathLike[str], error: type[SwarmError] = InvalidValueError) -> None:
    """Raise an error that names what replaces a file of RAS2D or Scilab, if the ending is one of theirs."""
    ending = os.path.splitext(os.fspath(path))[1].lower()
    if isinstance(ending, str) and ending in FORMER:
        raise error(without_middle(f"{show_path(path)}: {FORMER[ending]}"))


def write_whole(
    path: Path, content: str | bytes, error: type[SwarmError] = InvalidValueError, *, folders: bool = True
) -> Path:
    """Write a file as `draft_of` does, and return its path."""
    with draft_of(path, error, folders=folders) as draft:
        draft.write_bytes(_as_bytes(content))
    return path


def write_all(folder: Path, contents: Mapping[str, str | bytes]) -> list[Path]:
    """Write files, by name, that belong together: all of them, or none if the disk is full; return their paths.

    A name that is an absolute path is that of a file in another folder. All are on the disk before the first is
    renamed: some disks report only at a sync that they are full.
    """
    paths = [folder / name for name in contents]
    with ExitStack() as drafts:
        for path, content in zip(paths, contents.values(), strict=True):
            draft = drafts.enter_context(draft_of(path))
            draft.write_bytes(_as_bytes(content))
            sync(draft)
    return paths


@contextmanager
def draft_of(path: Path, error: type[SwarmError] = InvalidValueError, *, folders: bool = True) -> Iterator[Path]:
    """Yield another name in a file's folder; what was written there gets the file's name if nothing goes wrong.

    The draft is synced to the disk before it is renamed, and the folder after: at any moment, also after a kill or
    a power cut, the name stands for the whole old file or the whole new one. A symbolic link is followed, and the
    permissions of an older file are preserved. Drafts of killed writers are deleted when the file is written again.
    If the file cannot be written, an `error` is raised that has its name, never that of the draft; with `folders` its
    folder is created if it is missing.
    """
    new_folders = [folder for folder in path.parents if not os.path.lexists(folder)] if folders else []
    try:
        place, hold = _begin_draft(path, error, folders)
        with hold:
            try:
                yield Path(hold.name)
                put_in_place(hold, place)
                unlock(hold)
            except OSError as problem:
                discard(hold)
                if _is_of_another(problem, place, Path(hold.name)):
                    raise
                raise unwritable(path, problem, error) from None
            except BaseException:
                discard(hold)
                raise
    finally:
        _remove_empty(new_folders)


def _begin_draft(path: Path, error: type[SwarmError], folders: bool) -> tuple[Path, FileIO]:
    """Return where a file is to stand, symbolic links followed, and its draft, open."""
    try:
        place = checked_place(path)
        if folders:
            place.parent.mkdir(parents=True, exist_ok=True)
        return place, open_draft(place)
    except OSError as problem:
        raise unwritable(path, problem, error) from None


def _is_of_another(problem: OSError, place: Path, draft: Path) -> bool:
    """Return whether an error names a file that is neither a draft, nor its place, nor a folder above."""
    if not isinstance(problem.filename, str):
        return False
    return Path(os.path.realpath(problem.filename)) not in (draft, place, *place.parents)


def open_draft(path: Path) -> FileIO:
    """Open a new file beside another, under a name of its own; drafts that killed writers left there are deleted.

    It is locked as long as it is open, so that other writers of the same file know that it is not left over.
    """
    for number in count():
        draft = draft_name(path, number)
        _remove_left_over(draft)
        try:
            file = open(draft, "xb", buffering=0)  # noqa: SIM115 - it stays open
        except FileExistsError:
            continue
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(path)) from None
        if lock(file) is not False and is_named(file, draft):  # else it was taken for one that is left over
            return file
        file.close()
    raise AssertionError  # the count has no end


def free_draft(path: Path) -> Path:
    """Return the name of a draft of a file that nothing else has, for what opens and locks files itself."""
    for number in count():
        draft = draft_name(path, number)
        _remove_left_over(draft)
        if not os.path.lexists(draft):
            return draft
    raise AssertionError  # the count has no end


def draft_name(path: Path, number: int) -> Path:
    """Return the name of a draft of a file."""
    name = path.name
    if len(os.fsencode(name)) > LONGEST_NAME:
        name = blake2b(os.fsencode(name), digest_size=16).hexdigest()
    return path.with_name(f".{name}.{number}.draft")


def put_in_place(draft: FileIO, path: Path) -> None:
    """Give a finished draft the name of the file that it replaces, in such a way that a power cut cannot halve it."""
    name = Path(draft.name)
    with suppress(FileNotFoundError):  # there was no older file
        shutil.copymode(path, name)
    sync(name)
    if os.name == "nt":  # where open files cannot be renamed
        draft.close()
    os.replace(name, path)
    with suppress(OSError):  # some folders cannot be synced; the file has its name already
        sync(path.parent)


def discard(draft: FileIO) -> None:
    """Close a draft and delete it, unless it was put in its place."""
    name = Path(draft.name)
    with suppress(OSError):  # else it would hide why writing failed
        is_ours = draft.closed or is_named(draft, name)
        if os.name == "nt":
            draft.close()
        if is_ours:
            name.unlink(missing_ok=True)
    unlock(draft)
    draft.close()


def lock(file: FileIO | BinaryIO, shared: bool = False) -> bool | None:
    """Lock an open file until it is closed, and return whether that could be: None where files have no locks.

    A shared lock is refused only where a writer has the other kind.
    """
    if fcntl is None:
        return None
    try:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # some file systems have none
        return None
    return True


def unlock(file: FileIO | BinaryIO) -> None:
    """Give up the lock of an open file, also for child processes that share it.

    Closing alone would not: the lock stays as long as any of them has it open.
    """
    if fcntl is not None and not file.closed:
        with suppress(OSError):  # some file systems have none
            fcntl.flock(file, fcntl.LOCK_UN)


def is_locked(path: Path) -> bool:
    """Return whether the file of a name is locked by a writer."""
    try:
        with open(path, "rb", buffering=0, opener=_open_as_it_is) as file:
            return lock(file, shared=True) is False
    except OSError:
        return False


def is_named(file: FileIO, path: Path) -> bool:
    """Return whether an open file has that name (still)."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), os.stat(path, follow_symlinks=False))
    except FileNotFoundError:
        return False


def sync(path: Path) -> None:
    """Wait until the disk has a file, or what a folder lists; does nothing where folders cannot be synced."""
    if os.name == "nt" and path.is_dir():
        return
    place = os.open(path, os.O_RDONLY if path.is_dir() or os.name != "nt" else os.O_RDWR)
    try:
        os.fsync(place)
    finally:
        os.close(place)


def _remove_left_over(draft: Path) -> None:
    """Delete a draft that is not locked."""
    with suppress(OSError), open(draft, "rb", buffering=0, opener=_open_as_it_is) as file:
        if os.name == "nt":  # where files that are open elsewhere cannot be deleted
            file.close()
            draft.unlink()
        elif stat.S_ISREG(os.fstat(file.fileno()).st_mode) and lock(file) and is_named(file, draft):
            draft.unlink()


def _open_as_it_is(path: str, flags: int) -> int:
    """Open a file, no link to another one, and no pipe that would make us wait."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))


def _as_bytes(content: str | bytes) -> bytes:
    return content.encode() if isinstance(content, str) else content


def _remove_empty(folders: list[Path]) -> None:
    for folder in folders:
        try:
            folder.rmdir()
        except (OSError, ValueError):
            return
