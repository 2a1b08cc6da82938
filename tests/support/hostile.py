"""Attacks: hostile inputs in processes with limits of CPU and memory, and the table of their outcomes."""

import os
import pickle
import resource
import select
import signal
import struct
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from support.machine import slowness
from support.waiting import Deadline

MEGABYTE = 1 << 20
# An input that sleeps uses no CPU: it counts as hung after this multiple of its CPU limit.
PATIENCE = 25
# Tries of an input that takes too much CPU, the least of which counts: a busy host makes each slower.
TRIES = 3
LONGEST_REFUSAL = 300
INPUTS_PER_PROCESS = 200
# Megabytes of its own that a process holds which has only imported what is attacked; and files that it maps.
FRESH = 200


@dataclass(frozen=True)
class Result:
    """How one input ended.

    Attributes
    ----------
    status : str
        "accepted" or "refused", which are good; "raw", "CPU", "hang", "memory" or "crash", which are failures.
    """

    name: str
    status: str
    detail: str = ""
    seconds: float = 0.0
    megabytes: float = 0.0

    @property
    def failed(self) -> bool:
        return self.status not in ("accepted", "refused")


@dataclass
class Tally:
    """Counts of one area, and the failures by name."""

    area: str
    tried: int = 0
    failures: list[str] = field(default_factory=list)
    seconds: float = 0.0
    megabytes: float = 0.0

    def add(self, results: Iterable[Result]) -> "Tally":
        """Count results of `attack`."""
        for result in results:
            self.tried += 1
            self.seconds = max(self.seconds, result.seconds)
            self.megabytes = max(self.megabytes, result.megabytes)
            if result.failed:
                self.failures.append(f"{result.name}: {result.status} {result.detail}")
        return self

    def check(self, name: str, good: bool, detail: str = "") -> None:
        """Count one try that was judged elsewhere."""
        self.tried += 1
        if not good:
            self.failures.append(f"{name}: {detail}")

    def row(self) -> tuple[str, int, int, float, float]:
        return self.area, self.tried, len(self.failures), self.seconds, self.megabytes


def table(rows: Iterable[Sequence]) -> list[str]:
    """Return the lines of the table of areas; rows of one area are added up."""
    areas: dict[str, list] = {}
    for area, tried, failed, seconds, megabytes in rows:
        sums = areas.setdefault(area, [0, 0, 0.0, 0.0])
        sums[0] += tried
        sums[1] += failed
        sums[2:] = [max(sums[2], seconds), max(sums[3], megabytes)]
    lines = [f"{'area':<44}{'tried':>8}{'failed':>8}{'most CPU, s':>13}{'most memory, MB':>17}"]
    for area, (tried, failed, seconds, megabytes) in sorted(areas.items()):
        most = f"{seconds:>13.2f}{megabytes:>17.0f}" if megabytes else f"{'-':>13}{'-':>17}"
        lines.append(f"{area:<44}{tried:>8}{failed:>8}{most}")
    return lines


def attack(
    work: Callable[[Any], object],
    inputs: Iterable[tuple[str, Any]],
    *,
    refusals: type[Exception] | tuple[type[Exception], ...],
    cpu: float = 10.0,
    memory: int = 500,
) -> Iterator[Result]:
    """Yield how `work` ends for each named input, in forked processes with limits; call it warm.

    Parameters
    ----------
    work : callable
        Called with one input; what it needs should be imported already, since imports count.
    inputs : iterable of (name, input)
    refusals : exception types
        With a message of one line of at most 300 characters they are good answers; all others are failures.
    cpu : float
        Seconds for each input, of a processor as fast as usual: processors of virtual machines are not always.
    memory : int
        Most megabytes resident, those of the interpreter and its libraries included. What this process has gathered
        before beyond those, in other tests, is not counted.
    """
    left = list(inputs)
    while left:
        done = 0
        for result in _in_child(work, left[:INPUTS_PER_PROCESS], refusals, cpu, memory):
            done += 1
            yield result
        left = left[done:]


def _in_child(work: Callable, inputs: list, refusals: Any, cpu: float, memory: int) -> Iterator[Result]:
    """Yield results until the child has done all, or died of one, which is the last."""
    read, write = os.pipe()
    gathered = max(0.0, _status("RssAnon") - FRESH)
    child = os.fork()
    if not child:
        _child(work, [content for _, content in inputs], refusals, cpu, memory, write)
    os.close(write)
    number = 0
    why = ""
    try:
        for name, _ in inputs:
            message = _message(read, Deadline(PATIENCE * cpu + 10))
            if not isinstance(message, tuple):
                why = message
                break
            status, detail, seconds, megabytes = message
            megabytes -= gathered
            if status in {"accepted", "refused"}:
                status = "memory" if megabytes > memory else "CPU" if seconds > cpu else status
            number += 1
            yield Result(name, status, detail, seconds, megabytes)
            if status == "memory":  # what it keeps would be counted against the next
                why = "full"
                break
    finally:
        os.close(read)
        if why in ("hang", "full"):
            os.kill(child, signal.SIGKILL)
        _, ended, used = os.wait4(child, 0)
    if number < len(inputs) and why != "full":
        status = why if why == "hang" else "CPU" if os.waitstatus_to_exitcode(ended) == -signal.SIGXCPU else "crash"
        peak = used.ru_maxrss / 1024 - gathered
        yield Result(inputs[number][0], status, f"ended with {os.waitstatus_to_exitcode(ended)}", 0.0, peak)


def _child(work: Callable, inputs: list, refusals: Any, cpu: float, memory: int, write: int) -> None:
    """Do the work on each input, report on each, and leave without any of pytest's endings."""
    try:
        signal.signal(signal.SIGXCPU, signal.SIG_DFL)
        # Address space is more than what is resident: twice the limit stops what runs away.
        slow = slowness()
        now = _status("VmSize")
        resource.setrlimit(resource.RLIMIT_AS, (int((now + 2 * memory) * MEGABYTE), resource.RLIM_INFINITY))
        for content in inputs:
            _forget_peak()
            least = float("inf")
            for _ in range(TRIES):
                used = time.process_time()
                resource.setrlimit(resource.RLIMIT_CPU, (int(used + 3 * cpu * slow) + 2, resource.RLIM_INFINITY))
                status, detail = _ended(work, content, refusals)
                took = time.process_time() - used
                if took > cpu * slow:
                    slow = max(slow, slowness())
                least = min(least, took / slow)
                if least <= cpu or status not in ("accepted", "refused"):
                    break
            _send(write, (status, detail, least, _status("VmHWM")))
    finally:
        os._exit(0)


def _ended(work: Callable, content: Any, refusals: Any) -> tuple[str, str]:
    try:
        work(content)
    except refusals as error:
        text = str(error)
        good = 0 < len(text) <= LONGEST_REFUSAL and "\n" not in text
        return ("refused", text) if good else ("raw", f"{type(error).__name__} of {len(text)} characters: {text!r}")
    except MemoryError:
        return "memory", "MemoryError"
    except BaseException as error:
        return "raw", f"{type(error).__name__}: {str(error)[:200]!r}"
    return "accepted", ""


def _forget_peak() -> None:
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")


def _status(name: str) -> float:
    """Return one of the system's figures about this process, in megabytes."""
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) / 1024 for line in file if line.startswith(name))


def _send(write: int, message: tuple) -> None:
    content = pickle.dumps(message)
    os.write(write, struct.pack("I", len(content)) + content)


def _message(read: int, deadline: Deadline) -> Any:
    """Return the child's next message, "gone" if it died, "hang" if none comes in time."""
    head = _bytes(read, 4, deadline)
    if not isinstance(head, bytes):
        return head
    content = _bytes(read, struct.unpack("I", head)[0], deadline)
    return pickle.loads(content) if isinstance(content, bytes) else content


def _bytes(read: int, number: int, deadline: Deadline) -> bytes | str:
    content = b""
    while len(content) < number:
        if not select.select([read], [], [], deadline.left)[0]:
            return "hang"
        part = os.read(read, number - len(content))
        if not part:
            return "gone"
        content += part
    return content
