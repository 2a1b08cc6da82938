"""Other processes that compile what a first step needs, from the end of the list, while this one begins at its start.

What they have stored on disk is loaded by the process that waits for it. As ``python -m``, the module reads names of
functions, with types, from its standard input, and ends when that is closed: with the process that started it.
"""

import atexit
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from threading import Thread

from mesa_swarm.kernels.code_files import PACKAGE
from mesa_swarm.kernels.compiling import compilation, function_named, stored_functions
from mesa_swarm.kernels.type_names import types_in_words
from mesa_swarm.kernels.waiting import count_processors

# To start a process takes as long as compiling a few functions.
FEWEST_FUNCTIONS = 20
MOST_PROCESSES = 3


def start_compiling(names: Sequence[str]) -> None:
    """Start processes that compile these functions, on cores that are free, if that pays."""
    count = min(count_processors() - 1, MOST_PROCESSES) if len(names) >= FEWEST_FUNCTIONS else 0
    for k in range(count):
        with suppress(OSError):  # where no process can be started, this one compiles all
            _start_process(sorted(names, reverse=True)[k::count])


def _start_process(names: list[str]) -> None:
    paths = os.pathsep.join([str(PACKAGE.parent), os.environ.get("PYTHONPATH", "")])
    process = subprocess.Popen(
        [sys.executable, "-m", __name__],
        env=os.environ | {"PYTHONPATH": paths.rstrip(os.pathsep)},
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    atexit.register(_end, process)
    with suppress(BrokenPipeError):
        process.stdin.write(json.dumps(names) + "\n")  # type: ignore[union-attr]
        process.stdin.flush()  # type: ignore[union-attr]


def _end(process: subprocess.Popen) -> None:
    process.kill()
    process.communicate()


def compile_named(name: str) -> None:
    """Compile a function of the package, named as `compiling.name_of` does.

    Examples
    --------
    >>> compile_named("geometry.overlap.wrap_angle float64")
    """
    stem, _, words = name.partition(" ")
    function_named(stem).compile(types_in_words(words))


def _exit_with_parent() -> None:
    sys.stdin.read()
    os._exit(0)


def main() -> None:
    """Compile the functions named on standard input that are not there yet."""
    compilation.alone = True
    names = json.loads(sys.stdin.readline())
    Thread(target=_exit_with_parent, daemon=True).start()
    for name in names:
        if not stored_functions([name]):
            with suppress(Exception):  # the process that waits compiles it, and shows the error
                compile_named(name)


if __name__ == "__main__":
    main()
