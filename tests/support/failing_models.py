"""Models that fail on purpose, in a module of their own, which worker processes can import."""

import os
import signal
import time
from collections import Counter
from pathlib import Path

from mesa_swarm.swarm_model import SwarmModel

# Work that should not be waited for takes so long, s.
LONG = 60.0


class Counting(SwarmModel):
    """Its result is its seed; each run leaves a line in a file."""

    def __init__(self, *, diary: str = "", odd: float = 0.0, rng=None) -> None:
        super().__init__(rng=rng)
        self.diary, self.odd, self.seed = diary, odd, rng

    def step(self) -> None:
        """Write one line."""
        super().step()
        with open(self.diary, "a") as file:
            file.write(f"{self.seed} was run\n")

    def results(self) -> dict[str, float]:
        """Return the seed."""
        return {"seed": self.seed, "odd result": self.odd}


def seeds_run(diary: Path) -> Counter:
    """Return how often each seed was run, from what its runs wrote down."""
    return Counter(int(line.split()[0]) for line in diary.read_text().splitlines())


class Raising(Counting):
    """Seed 2 cannot be run."""

    def step(self) -> None:
        """Raise an error with two lines and an address."""
        super().step()
        if self.seed == 2:
            raise RuntimeError(f"it broke\nin {object()}")


class DyingOnce(Counting):
    """Seed 2 kills its process the first time."""

    def step(self) -> None:
        """Die if the file has no line of seed 2 yet."""
        before = Path(self.diary).read_text() if Path(self.diary).exists() else ""
        super().step()
        if self.seed == 2 and not any(line.startswith("2 ") for line in before.splitlines()):
            os.kill(os.getpid(), signal.SIGKILL)


class Dying(Counting):
    """Seed 2 kills its process whenever it is tried."""

    def step(self) -> None:
        """Die."""
        super().step()
        if self.seed == 2:
            os.kill(os.getpid(), signal.SIGKILL)


def die_beside(diary: Path, dies: bool) -> None:
    """Kill the process that runs this, or work for long and leave a line."""
    if dies:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(LONG)
    diary.write_text("done")
