"""Processes that are killed at random moments, with all that they have started known by a mark."""

import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from support.waiting import comes_true, wait_until

MARK = "MESA_SWARM_TEST"
# After a kill, s: workers look twice a second, and the machine may be busy.
LONGEST = 15.0
COMMAND = "import sys; from mesa_swarm.cli import main; main(sys.argv[1:])"


def environment(**more: str) -> dict[str, str]:
    """Return the environment of a process that imports what this one does."""
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[2]), *sys.path]), **more}


KILLED_AT_A_CALL = """
import os, signal, sys
from importlib import import_module

module, name = import_module(sys.argv[1]), sys.argv[2]
inner, calls = getattr(module, name), []

def killed_at_a_call(*values, **named):
    calls.append(name)
    if len(calls) == int(sys.argv[3]):
        os.kill(os.getpid(), signal.SIGKILL)
    return inner(*values, **named)

setattr(module, name, killed_at_a_call)
home = sys.argv[4]
"""


def kill_at_call(module: str, name: str, number: int, script: str, home: Path, errors: Path) -> None:
    """Run a script until this call of a function of a module, at which its process is killed; `home` is its folder."""
    victim = Victim(KILLED_AT_A_CALL + script, module, name, number, home, errors=errors)
    assert victim.process.wait(600) == -signal.SIGKILL, victim.errors.read_text()


class Victim:
    """A process that is to be killed, and everything that it starts.

    Parameters
    ----------
    script : str
        Python.
    words : arguments
        Of the script.
    errors : path
        Where it may complain.
    """

    def __init__(self, script: str, *words: object, errors: Path) -> None:
        self._mark = f"{MARK}={uuid.uuid4().hex}".encode()
        name, _, value = self._mark.decode().partition("=")
        self.errors = errors
        with errors.open("a") as complaints:
            self.process = subprocess.Popen(
                [sys.executable, "-c", script, *map(str, words)],
                env=environment(**{name: value}),
                stdout=subprocess.DEVNULL,
                stderr=complaints,
                start_new_session=True,
            )

    @property
    def ended(self) -> bool:
        return self.process.poll() is not None

    def alive(self) -> list[int]:
        """Return all processes that it has started, and itself, that are still there."""
        found = []
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                marked = self._mark in (folder / "environ").read_bytes().split(b"\0")
            except OSError:  # it has just ended, or is not ours
                continue
            if marked:
                found.append(int(folder.name))
        return found

    def kill(self, group: bool = False) -> list[int]:
        """Kill it, or all of its group, and return what it has started and is still there after a while."""
        if group:
            os.killpg(self.process.pid, signal.SIGKILL)
        else:
            self.process.kill()
        self.process.wait()
        if comes_true(lambda: not self.alive(), LONGEST, every=0.02):
            return []
        left = self.alive()
        for number in left:
            os.kill(number, signal.SIGKILL)
        return left

    def finish(self, seconds: float = 600) -> None:
        """Wait until it is done, which it must be without an error."""
        assert self.process.wait(seconds) == 0, self.errors.read_text()[-2000:]


def killed(
    begun: Callable[[int], Victim], made: Callable[[], int], kills: int, chance: np.random.Generator, latest: float
) -> Iterator[list[int]]:
    """Begin, and kill soon after one more result is on the disk; again and again, then let it finish.

    Yields after each kill the processes that it left behind. Ends early if the work is done.

    Parameters
    ----------
    begun : callable
        Starts the process, which goes on where the last one was killed, with this number of workers.
    made : callable
        Returns how much is on the disk, a number that grows.
    kills : int
    chance : Generator
    latest : float
        Most seconds between the result and the kill.
    """
    for number in range(kills):
        victim, before = begun(2), made()
        wait_until(lambda before=before, victim=victim: made() > before or victim.ended, 600.0)
        time.sleep(chance.uniform(0, latest))
        if victim.ended:
            victim.finish()
            return
        yield victim.kill(group=number % 5 == 4)
    begun(1).finish()


def lines_in(file: Path) -> int:
    """Return how many lines a file has, 0 if there is none."""
    return file.read_bytes().count(b"\n") if file.exists() else 0
