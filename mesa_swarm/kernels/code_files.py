"""Machine code in files: read from where it lies, written where that is allowed, and made anew if it is damaged.

Numba would load what a power cut left of a file, or call it: here each file begins with a digest of what follows, and
one that does not match is as good as none. Numba would also write beside the sources or nowhere, and read only from
where it can write: here the code of a read-only installation is read, and new code goes to a folder of the user's.
Code that came with the package, see `kernels.machines`, is read where there is no other.
"""

import os
import pickle
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache
from glob import escape as glob_escape
from hashlib import blake2b
from pathlib import Path
from shutil import rmtree
from tempfile import TemporaryFile
from types import SimpleNamespace
from typing import Any
from uuid import uuid4

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.serialize import dumps
from numba.misc.appdirs import AppDirs

from mesa_swarm.base.progress import notice
from mesa_swarm.kernels.machines import list_machines, name_machine
from mesa_swarm.kernels.type_names import name_type

PACKAGE = Path(__file__).resolve().parent.parent
# Every change of a function leaves code behind: that of the last few, for the same types, is enough.
MOST_VERSIONS = 4
SEAL_BYTES = 16
CURE = "set NUMBA_CACHE_DIR to a folder that can be written to"
# Why code could not be stored by this process, each time.
problems: list[str] = []
# The variable that is set, for processes that this one starts, once a user has read such a line.
REPORTED = "MESA_SWARM_CODE_IS_NOT_STORED"
# Numba finds its settings when it is imported, where no type checker sees them.
settings: Any = numba.config


# Of folders, one for each machine, with files of this form; each is found by a digest of all that its code depends on,
# so that none can be stale.
FOLDER = "kernels-by-machine"
# The code of this installation: beside it, or where the user has Numba store code.
HOME = Path(settings.CACHE_DIR or PACKAGE / "__pycache__").absolute() / FOLDER
# The code that came with the package, which is only read, likewise in a folder for each machine.
SHIPPED = PACKAGE / "machine_code"


@cache
def list_folders() -> tuple[Path, ...]:
    """Return the folders for code of this machine: the last is the one for new code, if it can be written to."""
    home, other = HOME / name_machine(), _folder_of_user()
    return (home,) if other is None or not why_unwritable(home) else (home, other / name_machine())


def list_all_folders() -> tuple[Path, ...]:
    """Return the folders in which code is looked for: those of this machine, then those that came with the package."""
    return list_folders() + tuple(SHIPPED / machine for machine in list_machines())


def _folder_of_user() -> Path | None:
    """Return the user's own folder for code, None if the system does not define it."""
    folder = Path(AppDirs(appname="mesa_swarm", appauthor=False).user_cache_dir)
    return folder / FOLDER if folder.is_absolute() else None


@cache
def why_unwritable(folder: Path) -> str:
    """Return why no file can be written to a folder, which is made if it is missing; "" if one can."""
    try:
        if not folder.exists():
            folder.mkdir(parents=True, exist_ok=True)
            _drop_former(folder.parent)
        with TemporaryFile(dir=folder):
            return ""
    except OSError as error:
        return error.strerror or type(error).__name__


def _drop_former(new: Path) -> None:
    """Remove the folders of versions of before, one for each state of all sources, beside one that has been made."""
    for old in new.parent.glob("kernels-*"):
        if old != new:
            rmtree(old, ignore_errors=True)


def _drop_old(path: Path) -> None:
    """Remove what is left of former versions of a function beside a new file, but for the last few."""
    begin = path.name.rpartition("-")[0]
    for old in sorted(path.parent.glob(f"{glob_escape(begin)}-*.nbc"), key=time_of_change)[:-MOST_VERSIONS]:
        with suppress(OSError):  # another process has removed it
            old.unlink()


def time_of_change(path: Path) -> float:
    """Return when a file or folder was changed, 0 if it is gone meanwhile."""
    with suppress(OSError):
        return path.stat().st_mtime
    return 0.0


def why_not_stored() -> str:
    """Return in one line that no code can be stored, and why; "" if it can."""
    reasons = {str(folder): why_unwritable(folder) for folder in list_folders()}
    if not all(reasons.values()):
        return ""
    folders = "; ".join(f"{folder}: {reason}" for folder, reason in reasons.items())
    return f"machine code cannot be stored ({folders}); {CURE}"


def read_code(name: str) -> Iterator[bytes]:
    """Yield what whole files of this name hold, those of the installation first, those that came with it last."""
    for folder in list_all_folders():
        with suppress(OSError):
            seal, code = _open((folder / name).read_bytes())
            if seal == _seal(code):
                yield code


def is_stored(name: str) -> bool:
    """Return whether there is a whole file of this name."""
    return any(_is_whole(folder / name) for folder in list_all_folders())


def _is_whole(path: Path) -> bool:
    try:
        state = path.stat()
    except OSError:
        return False
    return _was_whole(path, state.st_mtime_ns, state.st_size)


@cache
def _was_whole(path: Path, *_state: int) -> bool:
    """Return whether a file is whole; it is read once as long as it does not change."""
    with suppress(OSError):
        seal, code = _open(path.read_bytes())
        return seal == _seal(code)
    return False


def _open(content: bytes) -> tuple[bytes, bytes]:
    return content[:SEAL_BYTES], content[SEAL_BYTES:]


def drop_damaged(folder: str) -> list[str]:
    """Remove damaged files of a folder within the places; return the names of those that no whole one replaces."""
    files = {f"{folder}/{path.name}": path for place in list_all_folders() for path in (place / folder).glob("*.nbc")}
    damaged = {name: path for name, path in files.items() if not is_stored(name)}
    for path in damaged.values():
        with suppress(OSError):  # of a read-only installation
            path.unlink()
    return sorted(damaged)


def write_code(name: str, code: bytes) -> None:
    """Store code in a file, in one rename; where that cannot be, a user reads so once."""
    path = list_folders()[-1] / name
    draft = path.with_name(f"{path.name}.tmp.{uuid4().hex[:16]}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draft.write_bytes(_seal(code) + code)
        os.replace(draft, path)
        _drop_old(path)
    except OSError as error:
        with suppress(OSError):
            draft.unlink()
        if not path.exists():  # Windows replaces no file that another process reads
            _report(
                why_not_stored() or f"machine code cannot be stored ({path.parent}: {error.strerror or error}); {CURE}"
            )


def _report(problem: str) -> None:
    if not problems and REPORTED not in os.environ:
        os.environ[REPORTED] = "1"
        notice(f"{problem}; until then each start compiles anew")
    problems.append(problem)


def _seal(code: bytes) -> bytes:
    return blake2b(code, digest_size=SEAL_BYTES).digest()


def file_of(stem: str, words: str, more: str = "") -> str:
    """Return the name of the file of a function's code for arguments of these types, in the folder of a machine.

    Parameters
    ----------
    stem : str
        The name of the function.
    words : str
        The types, see `type_names.name_type`.
    more : str
        A digest of whatever else the code depends on.
    """
    digests = [blake2b(part.encode("utf-8", "backslashreplace"), digest_size=10).hexdigest() for part in (words, more)]
    return f"{stem}-{'-'.join(digests)}.nbc"


def name_types(arguments: Iterable[Any]) -> str:
    """Return types in words, as in names of files and in `kernels/needed.json`."""
    return " ".join(map(name_type, arguments))


class _Form(CompileResultCacheImpl):
    """What Numba stores of compiled code; where is decided here."""

    def __init__(self, function: Any) -> None:
        self._lineno = function.__code__.co_firstlineno
        self._locator = SimpleNamespace(_py_file=function.__code__.co_filename)  # for its warnings

    def reduce(self, result: Any) -> tuple:
        """Return what is stored: without the one text, a listing for readers that names folders of this machine."""
        return tuple("" if isinstance(part, str) else part for part in super().reduce(result))


class StoredCode(FunctionCache):
    """The machine code of a function, for Numba to load and to store.

    Parameters
    ----------
    function : function
    stem : str
        The name of its files, see `file_of`.
    digest : callable
        Returns a digest of whatever else the code depends on, None if that is not known: then nothing is stored.
    accepts : callable
        Code is stored if this returns True when it has been compiled.
    """

    def __init__(
        self,
        function: Any,
        stem: str,
        digest: Callable[[], str | None] = lambda: "",
        accepts: Callable[[], bool] = lambda: True,
    ) -> None:
        self._py_func, self._impl = function, _Form(function)
        self._stem, self.digest, self._accepts = stem, cache(digest), accepts

    @property
    def cache_path(self) -> str:
        """The folder for new code."""
        return str(list_folders()[-1])

    def flush(self) -> None:
        """Do nothing: what is stored stays."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code for these types, None if there is none that is whole."""
        target_context.refresh()
        for content in [] if self.digest() is None else read_code(self._file(sig)):
            with suppress(Exception):  # of types that cannot be unpickled or compared: it is compiled
                (types, machine, source), code = pickle.loads(content)
                if (types, source) == (sig, self._source()) and machine in (name_machine(), *list_machines()):
                    return self._impl.rebuild(target_context, code)
        return None

    def save_overload(self, sig: Any, result: Any) -> None:
        """Store code."""
        if self.digest() is not None and self._impl.check_cachable(result) and self._accepts():
            key = sig, name_machine(), self._source()
            write_code(self._file(sig), dumps((key, self._impl.reduce(result))))

    def _source(self) -> tuple[str, str | None]:
        """Return what the code has been made from."""
        return self._stem, self.digest()

    def _file(self, sig: Any) -> str:
        return file_of(self._stem, name_types(getattr(sig, "args", sig)), self.digest() or "")
